// Probes that tests press on solids.
#ifndef SONDE_TESTS_PRESSING_H
#define SONDE_TESTS_PRESSING_H

#include "fixture.h"
#include "solid/equilibrium.h"
#include "solid/grid.h"

#include <stdio.h>
#include <string.h>

static const double kpa = 1e3;

static inline void check(sonde_status status, const sonde_error *error) {
  if (status) fail_msg("%s", error->message);
}

static inline sonde_equilibrium_def one_material(sonde_hyperelastic m) {
  sonde_equilibrium_def def = sonde_equilibrium_def_default();
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) def.layer[k] = m;
  return def;
}

static inline sonde_hyperelastic ogden(double shear_pa, double exponent, double bulk) {
  return (sonde_hyperelastic){SONDE_ENERGY_OGDEN, shear_pa, exponent, bulk * shear_pa};
}

typedef struct bench {
  sonde_hexes mesh;
  sonde_probe probe;
  sonde_equilibrium *e;
} bench;

static inline sonde_pose above(double depth_m) {
  // The probe's z axis points into the block, along -z; its x axis along x.
  return (sonde_pose){vec3(0, 0, -depth_m), {0, 1, 0, 0}};
}

static inline void make_bench(bench *b, const char *probe, double depth_m,
                              const sonde_hexes_def *fine, const sonde_equilibrium_def *def) {
  sonde_error error;
  check(sonde_probe_create(probe, &b->probe, &error), &error);
  check(sonde_hexes_block(depth_m, 0, 0, fine, &b->mesh, &error), &error);
  check(sonde_equilibrium_create(&b->mesh, &b->probe, above(0), def, &b->e, &error), &error);
}

static inline void drop_bench(bench *b) {
  sonde_equilibrium_destroy(b->e);
  sonde_hexes_clear(&b->mesh);
  sonde_probe_clear(&b->probe);
}

static inline sonde_equilibrium_result find(bench *b, double depth_m) {
  sonde_error error;
  sonde_equilibrium_result r;
  check(sonde_equilibrium_find(b->e, above(depth_m), &r, &error), &error);
  return r;
}

static inline double poisson(double bulk) { return (3 * bulk - 2) / (2 * (3 * bulk + 1)); }

// Part of a block under a ball: lines of nodes along u, v and down from the skin.
typedef struct ball_lines {
  sonde_lines u, v, down;
} ball_lines;

static inline sonde_vec3 place_under_ball(const void *user, double level, uint32_t u, uint32_t v) {
  const ball_lines *l = user;
  return vec3(l->u.at[u], l->v.at[v], -l->down.at[l->down.count - 1] * (1 - level / 3));
}

// `inside` even edges from 0, then edges that grow, until `far`.
static inline sonde_lines lines_from_middle(double edge, uint32_t inside, double growth,
                                            double far) {
  sonde_lines lines = {.count = 1};
  for (double step = edge; lines.at[lines.count - 1] < far; ++lines.count) {
    if (lines.count > inside) step *= growth;
    lines.at[lines.count] = lines.at[lines.count - 1] + step;
  }
  return lines;
}

// A rigid ball over a thick or thin layer on a rigid base. A quarter of the block does, as its
// inner sides stay in their planes.
static inline void make_ball_bench(bench *b, double radius_m, const ball_lines *lines,
                                   const sonde_equilibrium_def *def) {
  sonde_error error;
  char name[32];
  const sonde_lines *down = &lines->down;
  sonde_levels levels = {.count = down->count}; // from the base up
  for (uint32_t k = 0; k < levels.count; ++k)
    levels.at[k] = 3 * (1 - down->at[down->count - 1 - k] / down->at[down->count - 1]);
  const sonde_grid_shape shape = {&levels, lines->u.count,   lines->v.count,
                                  false,   place_under_ball, lines};
  *b = (bench){0};
  check(sonde_hexes_bend(&shape, &b->mesh, &error), &error);
  for (uint32_t n = 0; n < b->mesh.node_count; ++n) {
    const uint32_t u = n / lines->v.count % lines->u.count, v = n % lines->v.count;
    if (u == 0 || u == lines->u.count - 1) b->mesh.held[n] |= 1;
    if (v == 0 || v == lines->v.count - 1) b->mesh.held[n] |= 2;
  }
  snprintf(name, sizeof name, "ball:%g", 1e3 * radius_m);
  check(sonde_probe_create(name, &b->probe, &error), &error);
  check(sonde_equilibrium_create(&b->mesh, &b->probe, above(0), def, &b->e, &error), &error);
}

// Hertz 1881: F = 4/3 E/(1 - nu^2) sqrt(R) d^(3/2) on a half space.
static inline double hertz_n(double shear_pa, double bulk, double radius_m, double d) {
  const double nu = poisson(bulk);
  return 8.0 / 3 * shear_pa / (1 - nu) * sqrt(radius_m) * pow(d, 1.5);
}

#endif
