// A scene with each kind of body but the thigh, small enough for a tick of less than a millisecond.
#ifndef SONDE_TESTS_FUZZ_SCENE_TEXT_H
#define SONDE_TESTS_FUZZ_SCENE_TEXT_H

#define FUZZ_SCENE                                                                                 \
  "sonde_scene: 1\n"                                                                               \
  "title: seed\n"                                                                                  \
  "gravity_m_s2: [0, 0, -9.81]\n"                                                                  \
  "duration_s: 0.1\n"                                                                              \
  "step: {dt_s: 1e-3, newton: 2, substep_tolerance_mm: 0}\n"                                       \
  "materials:\n"                                                                                   \
  "- {name: skin, contact_stiffness_n_m3: 2e7, contact_damping_s: 2e-3, friction_static: 0.5, "    \
  "friction_kinetic: 0.4}\n"                                                                       \
  "bodies:\n"                                                                                      \
  "- {name: pad, kind: lattice, shape: {box_mm: [40, 40, 20]}, position_mm: [0, 0, -10], "         \
  "lattice: {cell_mm: 20, youngs_pa: 3e4, damping_s: 5e-3}, density_kg_m3: 1000, material: skin, " \
  "held_mm: [[[-20, -20, -20], [20, 20, -20]]]}\n"                                                 \
  "- {name: ball, kind: springs, shape: {sphere_mm: 8, edge_mm: 8}, "                              \
  "springs: {stiffness_n_m: 150, damping_n_s_m: 0.1, bulk_n_m5: 1e11}, mass_kg: 0.03, "            \
  "material: skin, position_mm: [-10, 0, 8]}\n"                                                    \
  "- {name: brick, shape: {box_mm: [10, 10, 10]}, mass_kg: 0.05, material: skin, "                 \
  "position_mm: [10, 0, 4], spin_rad_s: [0, 3, 1], velocity_m_s: [0, 0, -0.1]}\n"                  \
  "- {name: probe, motion: driven, shape: {probe: point}, material: skin, "                        \
  "path: [{time_s: 0, position_mm: [0, 10, 1], rotation: {axis: [1, 0, 0], angle_deg: 180}}, "     \
  "{time_s: 0.01, position_mm: [0, 10, -4], rotation: {axis: [1, 0, 0], angle_deg: 180}}]}\n"

#endif
