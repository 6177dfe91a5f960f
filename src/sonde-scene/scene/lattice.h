// Shared by the files that make deformable bodies.
#ifndef SONDE_SRC_SCENE_LATTICE_H
#define SONDE_SRC_SCENE_LATTICE_H

#include "scene/scene.h"

// Zeroed arrays of a deformable body.
sonde_status sonde_body_allocate(sonde_body *body, uint32_t nodes, uint32_t springs,
                                 sonde_error *error);

typedef struct sonde_solid {
  double youngs_pa, damping_s, density_kg_m3;
} sonde_solid;
// Tetrahedra of NAME.node and NAME.ele (TetGen): springs E V/L^2 per tetrahedron along its edges.
void sonde_read_tetrahedra(const sonde_scene_source *source, sonde_place at, const char *name,
                           sonde_solid solid, sonde_body *body);

#endif
