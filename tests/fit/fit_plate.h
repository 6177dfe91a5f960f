// Two models for the tests: a flat plate put together by hand, and the bundled thigh.
#ifndef SONDE_TESTS_FIT_PLATE_H
#define SONDE_TESTS_FIT_PLATE_H

#include "fit_test.h"

#include "base/base.h"
#include "fit/fit_inside.h"
#include "geometry/internal.h"

// A flat open plate of 2 mm squares in z = 0, outward +z, cut by one diagonal each. No site centre
// or footprint border passes through a node.
typedef struct plate {
  sonde_model *model;
  sonde_site_table sites;
} plate;

enum { PLATE_X = 45, PLATE_Y = 60 };

static inline void plate_mesh(sonde_mesh *mesh) {
  const uint32_t columns = PLATE_X + 1;
  assert_ok(sonde_mesh_create(mesh, columns * (PLATE_Y + 1), 2 * PLATE_X * PLATE_Y, NULL), NULL);
  for (uint32_t j = 0; j <= PLATE_Y; ++j)
    for (uint32_t i = 0; i <= PLATE_X; ++i)
      mesh->vertices[j * columns + i] = (sonde_vec3){0.002 * i, 0.002 * j, 0};
  for (uint32_t j = 0, f = 0; j < PLATE_Y; ++j)
    for (uint32_t i = 0; i < PLATE_X; ++i) {
      uint32_t a = j * columns + i, b = a + 1, c = b + columns, d = a + columns;
      const uint32_t faces[2][3] = {{a, b, c}, {a, c, d}};
      memcpy(mesh->faces[f], faces, sizeof faces);
      f += 2;
    }
}

static inline plate plate_create(uint32_t sites) {
  plate p = {.model = SONDE_NEW(sonde_model, 1), .sites = {.count = sites}};
  sonde_model *model = p.model;
  plate_mesh(&model->surface);
  uint32_t n = model->surface.vertex_count;
  assert_ok(sonde_topology_build(&model->surface, &model->topology, NULL), NULL);
  model->law = sonde_surface_law_default();
  model->normal = SONDE_NEW(sonde_vec3, n);
  model->area_m2 = SONDE_NEW(double, n);
  model->edge_rest_m = SONDE_NEW(double, model->topology.edge_count);
  sonde_mesh_normals(&model->surface, model->normal);
  sonde_mesh_areas(&model->surface, model->area_m2);
  for (uint32_t e = 0; e < model->topology.edge_count; ++e) {
    const uint32_t *pair = model->topology.edges[e];
    sonde_vec3 a = model->surface.vertices[pair[0]], b = model->surface.vertices[pair[1]];
    model->edge_rest_m[e] = hypot(b.x - a.x, b.y - a.y);
  }
  p.sites.sites = SONDE_NEW(sonde_site, sites);
  for (uint32_t s = 0; s < sites; ++s)
    p.sites.sites[s] = (sonde_site){.id = s,
                                    .position_m = {0.0445, 0.0215 + 0.02 * s, 0},
                                    .normal = {0, 0, 1},
                                    .u = {1, 0, 0},
                                    .v = {0, 1, 0}};
  return p;
}

static inline void plate_destroy(plate *p) {
  sonde_model_destroy(p->model);
  sonde_free(p->sites.sites);
}

// The bundled thigh without its layers, which the fit does not use.
typedef struct bundled {
  sonde_site_table sites;
  sonde_measurements m;
  sonde_model *model;
} bundled;

static inline bundled bundled_load(const char *measurements, double fine_mm) {
  bundled b;
  sonde_error error;
  sonde_mesh skin;
  char path[512];
  snprintf(path, sizeof path, "%s%s", DATA_DIR, measurements);
  assert_ok(sonde_site_table_load(DATA_DIR "sites.csv", &b.sites, &error), &error);
  assert_ok(sonde_measurements_load(path, &b.sites, &b.m, &error), &error);
  assert_ok(sonde_mesh_load(DATA_DIR "skin.ply", 1e-3, &skin, &error), &error);
  sonde_model_def def = sonde_model_def_default();
  def.skin = &skin;
  def.sites = b.sites.sites;
  def.site_count = b.sites.count;
  def.fine_edge_m = 1e-3 * fine_mm;
  assert_ok(sonde_model_build(&def, &b.model, &error), &error);
  sonde_mesh_clear(&skin);
  return b;
}

// Nine neighbouring sites of the 8 x 8 (18..20, 26..28, 34..36) with their rows.
static inline void keep_nine_sites(bundled *b) {
  uint32_t kept = 0, rows = 0;
  for (uint32_t s = 0; s < b->sites.count; ++s)
    if (s / 8 >= 2 && s / 8 <= 4 && s % 8 >= 2 && s % 8 <= 4)
      b->sites.sites[kept++] = b->sites.sites[s];
  b->sites.count = kept;
  assert_int_equal(kept, 9);
  for (uint32_t r = 0; r < b->m.count; ++r)
    for (uint32_t s = 0; s < kept; ++s)
      if (b->m.data[r].site == b->sites.sites[s].id) b->m.data[rows++] = b->m.data[r];
  b->m.count = rows;
}

static inline void bundled_clear(bundled *b) {
  sonde_site_table_clear(&b->sites);
  sonde_measurements_clear(&b->m);
  sonde_model_destroy(b->model);
}

#endif
