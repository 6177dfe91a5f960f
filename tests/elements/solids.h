// Elastic solids for tests.
#ifndef SONDE_TESTS_SOLIDS_H
#define SONDE_TESTS_SOLIDS_H

#include "geometry/shapes.h"
#include "mesh_laws.h"
#include "elements/elastic.h"

static inline sonde_elastic *make_solid(const sonde_elastic_def *def, double young_pa,
                                        double poisson) {
  sonde_elastic *e = NULL;
  sonde_error error = {0};
  if (sonde_elastic_create(def, &e, &error)) fail_msg("%s", error.message);
  double *young = calloc(def->mesh->count, sizeof *young);
  for (uint32_t t = 0; t < def->mesh->count; ++t) young[t] = young_pa;
  if (sonde_elastic_set(e, young, poisson, 0, &error)) fail_msg("%s", error.message);
  free(young);
  return e;
}

// A ball held on a smaller one inside.
static inline sonde_tetrahedra held_ball(double radius, double core, double edge_m) {
  sonde_mesh outer = shape_sphere(20, radius), inner = shape_sphere(12, core);
  const sonde_tetrahedra_def def = {.edge_m = edge_m};
  sonde_tetrahedra t = make_mesh(&outer, &inner, &def);
  sonde_mesh_clear(&outer);
  sonde_mesh_clear(&inner);
  return t;
}

#endif
