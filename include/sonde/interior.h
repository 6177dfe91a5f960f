/**
 * @file interior.h
 * From surface motion to the inside: a divergence-free displacement field, the stress under the
 * probe, the vein, the artery and the thrombus.
 */
#ifndef SONDE_INTERIOR_H
#define SONDE_INTERIOR_H

#include "sonde/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Tissue at a point of the rest thigh. */
typedef enum sonde_label {
  SONDE_LABEL_OUTSIDE,
  SONDE_LABEL_SKIN,
  SONDE_LABEL_FAT,
  SONDE_LABEL_MUSCLE,
  SONDE_LABEL_BONE,
  SONDE_LABEL_VEIN_WALL,
  SONDE_LABEL_VEIN,
  SONDE_LABEL_THROMBUS,
  SONDE_LABEL_ARTERY_WALL,
  SONDE_LABEL_ARTERY,
  SONDE_LABEL_NODE, /**< lymph node */
  SONDE_LABEL_CYST,
  SONDE_LABEL_HAEMATOMA,
  SONDE_LABEL_FASCIA, /**< this one and the following of models with a tissue map only */
  SONDE_LABEL_TENDON,
  SONDE_LABEL_NERVE,
  SONDE_LABEL_COUNT
} sonde_label;

/** Where in a vein's lumen a clot that does not fill it lies. */
typedef enum sonde_clot_form {
  SONDE_CLOT_MURAL,      /**< on the far wall, with a free surface */
  SONDE_CLOT_FLOATING,   /**< in the middle, blood all around it */
  SONDE_CLOT_RECANALISED /**< all around two channels, which wind */
} sonde_clot_form;

/** State of the vein that a case prescribes. */
typedef struct sonde_pathology {
  char name[32];
  double venous_pressure_pa; /**< in the lumen; 10 mmHg supine. A model's own position
                                (sonde_model.gravity) adds to it */
  double arterial_pressure_pa;
  double thrombus_fraction;              /**< solid share of the rest lumen, 0..1 */
  double thrombus_modulus_pa;            /**< Young's modulus of the solid */
  double thrombus_from_m, thrombus_to_m; /**< extent along the leg (model z); all when equal */
  double lumen_scale;                    /**< rest radius relative to the healthy vein */
  double echogenicity;  /**< backscatter of the thrombus relative to muscle, 0..1 */
  double wall_shear_pa; /**< shear modulus of the vein's wall; 0: 30 kPa */
  /** How firmly the sheath around the vessels ties their walls to the muscle: 0 loose, as in a leg,
   * to 1 glued, as in the finite-element study (docs/interior_theory.md). */
  double sheath;
  sonde_clot_form form;
  uint32_t unused; /**< 0: states are compared byte by byte */
} sonde_pathology;

/** Preset names, NULL-terminated: healthy, partial_mural, free_floating, acute_occlusive,
 *  subacute_occlusive, chronic_occlusive, recanalised. @thread any */
SONDE_API const char *const *sonde_pathology_names(void);
/** Preset by name; '-' and ' ' count as '_', and unique first words (e.g. "chronic") are accepted.
 *  @return SONDE_NOT_FOUND listing the known names @thread any */
SONDE_API sonde_status sonde_pathology_preset(const char *name, sonde_pathology *pathology,
                                              sonde_error *error);

/** A section of a vessel: across its centre line at one point of it. */
typedef struct sonde_vessel_state {
  sonde_vec3 rest_centre_m;
  sonde_vec3 centre_m;  /**< deformed */
  sonde_vec3 axis;      /**< unit, along the vessel */
  sonde_vec3 flat_axis; /**< unit: direction of the short diameter (towards the probe) */
  double rest_radius_m;
  double outside_pa;                /**< effective pressure on the wall */
  double area_ratio;                /**< current / rest, dynamic */
  double half_short_m, half_long_m; /**< semi-axes of the ellipse */
  double coupling;                  /**< of the tissue beside it to the wall, 0..1 */
  /** Gradient of the tissue's motion across the vessel, as it would be without the vessel: a
   * rotation from the flat axis towards the other by an angle of which tissue_rotation is the
   * tangent of the half, then (short, long) -> (tissue_short short, tissue_shear short +
   * tissue_long long). 0, 1, 0, 1 at rest. */
  double tissue_rotation, tissue_short, tissue_shear, tissue_long;
  double tissue_smoothing; /**< share of the motion beyond that gradient which ends at the wall,
                              0..1 */
} sonde_vessel_state;

typedef struct sonde_interior sonde_interior;

/** Builds the column map, the factored surface Laplacian and the vessels' sections.
 *  @param model borrowed @thread owner */
SONDE_API sonde_status sonde_interior_create(const sonde_model *model, sonde_interior **interior,
                                             sonde_error *error);
SONDE_API void sonde_interior_destroy(sonde_interior *interior); /**< @thread owner */

/** How the inside follows the skin. */
typedef enum sonde_interior_method {
  SONDE_INTERIOR_SOLID,  /**< finite elements around the probe; columns until they are factored */
  SONDE_INTERIOR_COLUMNS /**< divergence-free column field only */
} sonde_interior_method;
/** Method of the following updates; SOLID after a creation. @thread owner */
SONDE_API void sonde_interior_set_method(sonde_interior *interior, sonde_interior_method method);
/** Method that the last update used; of a given tissue SOLID. @thread any */
SONDE_API sonde_interior_method sonde_interior_used_method(const sonde_interior *interior);

/** Moves the vein below a point of the skin, to the same depth along its whole course, and the
 *  artery 11 mm beside it on its own side. Pressures and radii stay. The model's branches, which
 *  would no longer meet them, are left out.
 *  @return ARGUMENT for a depth out of the tissue @thread owner, before the next update */
SONDE_API sonde_status sonde_interior_set_vein_depth(sonde_interior *interior,
                                                     sonde_vec3 below_skin_m, double depth_m,
                                                     sonde_error *error);

/**
 * Tissue that was solved elsewhere, in place of the interior's own solid, such as
 * sonde_equilibrium_tissue() gives. Its functions are called by several threads at once.
 */
typedef struct sonde_interior_tissue {
  /** Displacement (m) of a point of the leg at rest; beside the leg that of the nearest skin. */
  sonde_vec3 (*moved)(const struct sonde_interior_tissue *self, sonde_vec3 rest_m);
  /** Cauchy stress there: Pa, tension positive, world axes, without vessels. */
  sonde_mat3 (*stress)(const struct sonde_interior_tissue *self, sonde_vec3 rest_m);
} sonde_interior_tissue;

/** What one update reads; all but the tissue borrowed for the call. */
typedef struct sonde_interior_input {
  const sonde_vec3 *positions_m;      /**< [nodes] deformed skin; with a tissue not read */
  const sonde_vec3 *contact_forces_n; /**< [nodes] of the probe on the skin; the same */
  sonde_pose world_from_probe;
  const sonde_pathology *pathology;
  double dt_s; /**< since the last update; < 0: vessels in equilibrium */
  uint64_t tick;
  /** Of the probe's face, as sonde_probe.half_x_m and half_y_m; more than 0 (asserted: without a
   * face the vein would close otherwise). INFINITY: forces that no probe gave, as wide as they are.
   */
  double face_half_x_m, face_half_y_m;
  double cuff_pa; /**< uniform pressure on every vessel from outside, beside the probe's */
  /** Of a limb: blood's own weight raises the groin's pressures below it. A model that says how it
   * lies (sonde_model.gravity) keeps to that. */
  sonde_posture posture;
  /** Moves the inside and presses on its vessels; borrowed until the next update. NULL: the
   * interior's own method. */
  const sonde_interior_tissue *tissue;
} sonde_interior_input;

/** New surface state: solves the field, the stress at the vessels and their areas.
 *  @thread owner of the interior; no allocation */
SONDE_API void sonde_interior_update(sonde_interior *interior, const sonde_interior_input *input);

/** Displacement (m) of the rest point, zero outside and in bone. After an update. @thread any */
SONDE_API sonde_vec3 sonde_interior_displacement(const sonde_interior *interior, sonde_vec3 rest_m);
/** Rest point that is now at `point` (fixed-point inversion). @thread any */
SONDE_API sonde_vec3 sonde_interior_rest_point(const sonde_interior *interior, sonde_vec3 point_m);
/** Static tissue label and depth below the skin of a rest point. @thread any */
SONDE_API sonde_label sonde_interior_label(const sonde_interior *interior, sonde_vec3 rest_m,
                                           double *depth_m);
/** Femoral vein (0), femoral artery (1) and then the branches of the model's anatomy in its order;
 *  at least 2, also in a leg without vessels. @thread any */
SONDE_API uint32_t sonde_interior_vessel_count(const sonde_interior *interior);
/** femoral_vein, femoral_artery or the branch's name. @thread any */
SONDE_API const char *sonde_interior_vessel_name(const sonde_interior *interior, int which);
/** State of the vein (0), the artery (1) or a branch in the probe's image plane; false
 *  when it does not pass within 40 mm of the beam axis. @thread any, not during an update */
SONDE_API bool sonde_interior_vessel_at_plane(const sonde_interior *interior, int which,
                                              sonde_pose world_from_probe,
                                              sonde_vessel_state *state);
/** @thread any, not during an update */
SONDE_API uint64_t sonde_interior_tick(const sonde_interior *interior);

/** What moves the pressures in time. */
typedef struct sonde_circulation {
  sonde_posture posture;
  double heart_rate_hz, systolic_pa, diastolic_pa;
  double breath_rate_hz, breath_pa;                   /**< half swing of the venous pressure */
  double valsalva_from_s, valsalva_to_s, valsalva_pa; /**< a strain and its plateau; none: equal */
  double valve_leak; /**< what the veins' valves leave open to blood that falls back, 0 to 1 */
} sonde_circulation;

/** 1.1 Hz, 120/80 mmHg, 0.25 Hz with 1.5 mmHg, no Valsalva (20 mmHg when timed), sound valves.
 *  @thread any */
SONDE_API sonde_circulation sonde_circulation_default(void);
/** Begins or ends a strain at time t, from whatever share of one is in force: the pressure has no
 *  step. @thread any */
SONDE_API void sonde_circulation_strain(sonde_circulation *circulation, double t_s, bool on);
/** Both pressures of a pathology at a tick of `dt_s`. @thread any */
SONDE_API void sonde_circulation_apply(const sonde_circulation *circulation, uint64_t tick,
                                       double dt_s, sonde_pathology *pathology);

#ifdef __cplusplus
}
#endif
#endif
