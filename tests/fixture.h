// A small thigh for tests: a sphere of 60 mm made from a subdivided octahedron (square roots only,
// so that it is the same on every machine), one site on its +x side, uniform parameters.
#ifndef SONDE_TESTS_FIXTURE_H
#define SONDE_TESTS_FIXTURE_H

#include "base/base.h"
#include "base/maths.h"
#include "sonde/world.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define FIXTURE_RADIUS_M 0.06

// Doubles, with both values in the message (cmocka compares floats).
#define assert_near(got, expected, tolerance)                                                      \
  do {                                                                                             \
    double got_ = (got), expected_ = (expected), tolerance_ = (tolerance);                         \
    if (!(fabs(got_ - expected_) <= tolerance_))                                                   \
      fail_msg("%s is %.17g, expected %.17g within %.3g", #got, got_, expected_, tolerance_);      \
  } while (0)

// The fitted bundled thigh: of the build at hand, or SONDE_TEST_MODEL (sanitizer builds fit none).
static inline sonde_model *bundled_thigh(void) {
  const char *chosen = getenv("SONDE_TEST_MODEL");
  const char *path = chosen ? chosen : SONDE_BINARY_DIR "/share/sonde/thigh.sonde";
  sonde_model *model = NULL;
  if (sonde_model_load(path, &model, NULL))
    fail_msg("%s is not there: build the target thigh or set SONDE_TEST_MODEL", path);
  return model;
}

// A world in double precision, solved closer than the default.
static inline sonde_world_def fixture_world_def(void) {
  sonde_world_def def = sonde_world_def_default();
  def.engine = SONDE_ENGINE_DOUBLE;
  def.newton_iterations = 2;
  def.pcg = (sonde_pcg_options){5e-3, 1e-12, 200};
  def.sleep_displacement_m = 5e-6;
  return def;
}

// The edges of a mesh that is being split: of each corner those to corners of a higher number, at
// most six, with the vertex in the middle of each.
typedef struct fixture_edges {
  uint32_t count, to[6], middle[6];
} fixture_edges;

static inline uint32_t fixture_middle(sonde_mesh *mesh, uint32_t *count, fixture_edges *edges,
                                      uint32_t a, uint32_t b) {
  fixture_edges *of = &edges[a < b ? a : b];
  const uint32_t to = a < b ? b : a;
  for (uint32_t i = 0; i < of->count; ++i)
    if (of->to[i] == to) return of->middle[i];
  assert_true(of->count < 6);
  of->to[of->count] = to;
  of->middle[of->count++] = *count;
  mesh->vertices[*count] = v_unit(v_add(mesh->vertices[a], mesh->vertices[b]), vec3(1, 0, 0));
  return (*count)++;
}

// Octahedron subdivided `levels` times: 4^(levels+1) + 2 vertices on the unit sphere times radius.
static inline sonde_mesh fixture_sphere(int levels, double radius) {
  uint32_t vertices = 4, faces = 8;
  for (int k = 0; k < levels; ++k) vertices *= 4, faces *= 4;
  sonde_mesh mesh, next;
  assert_int_equal(sonde_mesh_create(&mesh, vertices + 2, faces, NULL), SONDE_OK);
  const sonde_vec3 corner[6] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},
                                {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  const uint32_t face[8][3] = {{0, 1, 2}, {1, 3, 2}, {3, 4, 2}, {4, 0, 2},
                               {1, 0, 5}, {3, 1, 5}, {4, 3, 5}, {0, 4, 5}};
  memcpy(mesh.vertices, corner, sizeof corner);
  memcpy(mesh.faces, face, sizeof face);
  uint32_t count = 6, used = 8;
  for (int k = 0; k < levels; ++k) {
    assert_int_equal(sonde_mesh_copy(&mesh, &next, NULL), SONDE_OK);
    fixture_edges *edges = calloc(count, sizeof *edges);
    assert_true(edges != NULL);
    uint32_t out = 0;
    for (uint32_t f = 0; f < used; ++f) {
      const uint32_t *v = mesh.faces[f];
      uint32_t m[3];
      for (int e = 0; e < 3; ++e) m[e] = fixture_middle(&next, &count, edges, v[e], v[(e + 1) % 3]);
      const uint32_t split[4][3] = {
          {v[0], m[0], m[2]}, {v[1], m[1], m[0]}, {v[2], m[2], m[1]}, {m[0], m[1], m[2]}};
      memcpy(next.faces[out], split, sizeof split);
      out += 4;
    }
    used = out;
    free(edges);
    sonde_mesh_clear(&mesh);
    mesh = next;
  }
  assert_int_equal(count, mesh.vertex_count);
  assert_int_equal(used, mesh.face_count);
  for (uint32_t i = 0; i < count; ++i) mesh.vertices[i] = v_scale(mesh.vertices[i], radius);
  return mesh;
}

static inline sonde_site fixture_site(void) {
  return (sonde_site){.id = 0,
                      .position_m = {FIXTURE_RADIUS_M, 0, 0},
                      .normal = {1, 0, 0},
                      .u = {0, 1, 0},
                      .v = {0, 0, 1}};
}

static inline sonde_model *fixture_model(int levels, const sonde_surface_law *law) {
  sonde_mesh skin = fixture_sphere(levels, FIXTURE_RADIUS_M);
  sonde_site site = fixture_site();
  sonde_model_def def = sonde_model_def_default();
  def.name = "sphere";
  def.skin = &skin;
  def.sites = &site;
  def.site_count = 1;
  def.fine_edge_m = 1;
  if (law) def.law = *law;
  sonde_model *model = NULL;
  sonde_error error = {0};
  sonde_status status = sonde_model_build(&def, &model, &error);
  if (status) print_error("%s\n", error.message);
  assert_int_equal(status, SONDE_OK);
  // Exact constants instead of exp(log(x)): the hash must not hang on the machine's exp.
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    model->k0_n_m3[i] = 180000;
    model->xm_m[i] = 0.05;
  }
  sonde_mesh_clear(&skin);
  return model;
}

// Lets the shear layer differ from node to node.
static inline void fixture_vary_shear(sonde_model *model) {
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    model->shear_share[i] = 1 + 0.25 * ((int)(i % 5) - 2) / 2.0;
    model->limit_share[i] = 1 + 0.1 * (int)(i % 3) / 2.0;
  }
}

// A probe that looks along -x at the site, its face `depth_m` below the skin.
static inline sonde_pose fixture_pose(double depth_m) {
  sonde_mat3 r = m_columns(vec3(0, 1, 0), vec3(0, 0, -1), vec3(-1, 0, 0));
  return (sonde_pose){vec3(FIXTURE_RADIUS_M - depth_m, 0, 0), q_from_matrix(r)};
}

// Uniform numbers in [-1, 1) that repeat.
static inline double fixture_random(uint64_t *state) {
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return (double)(int64_t)(*state >> 11) / 4503599627370496.0 - 1.0;
}
static inline sonde_vec3 fixture_vector(uint64_t *state, double size) {
  double x = fixture_random(state), y = fixture_random(state), z = fixture_random(state);
  return vec3(size * x, size * y, size * z);
}

#endif
