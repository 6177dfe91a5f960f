// What the tests of the anatomy room share: generated thighs and measures of them that do not use
// the room's own tables.
#ifndef SONDE_TESTS_ANATOMY_TEST_H
#define SONDE_TESTS_ANATOMY_TEST_H

#include "../fixture.h"
#include "sonde/anatomy.h"
#include "sonde/robot.h"

// A coarse mesh where the mesh does not matter.
static inline sonde_thigh_def coarse(void) {
  sonde_thigh_def def = sonde_thigh_def_default();
  def.edge_m = 0.009;
  def.fine_edge_m = 0.0045;
  return def;
}

static inline sonde_model *make_thigh(const sonde_thigh *known, uint64_t seed,
                                      const sonde_thigh_def *def, sonde_thigh *thigh) {
  sonde_error error = {0};
  sonde_thigh unknown = sonde_thigh_unknown();
  sonde_thigh_shape *shape = NULL;
  sonde_model *model = NULL;
  sonde_status status = sonde_thigh_draw(known ? known : &unknown, seed, thigh, &error);
  if (!status) status = sonde_thigh_shape_create(thigh, &shape, &error);
  if (!status) status = sonde_thigh_build(thigh, shape, def, &model, &error);
  sonde_thigh_shape_destroy(shape);
  if (status) fail_msg("seed %d: %s", (int)seed, error.message);
  return model;
}

// Length of the line in which a plane z meets a mesh; its middle when asked for.
static inline double girth_of(const sonde_mesh *mesh, double z, sonde_vec3 *middle) {
  double sum = 0;
  sonde_vec3 weighted = vec3(0, 0, 0);
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    sonde_vec3 p[3];
    int found = 0;
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 a = mesh->vertices[mesh->faces[f][k]];
      sonde_vec3 b = mesh->vertices[mesh->faces[f][(k + 1) % 3]];
      if ((a.z < z) != (b.z < z)) p[found++] = v_lerp(a, b, (z - a.z) / (b.z - a.z));
    }
    if (found < 2) continue;
    sum += v_distance(p[0], p[1]);
    weighted = v_madd(weighted, v_distance(p[0], p[1]), v_lerp(p[0], p[1], 0.5));
  }
  if (middle) *middle = v_scale(weighted, 1 / sum);
  return sum;
}

// The probe upright at a site, its face `depth_m` below the skin, x around the leg.
static inline sonde_pose pose_at(const sonde_site *site, double depth_m) {
  sonde_vec3 z = v_neg(site->normal);
  return (sonde_pose){v_madd(site->position_m, depth_m, z),
                      q_from_matrix(m_columns(site->u, v_cross(z, site->u), z))};
}

static inline void settles_at_three_sites(const sonde_model *model, double depth_m) {
  const uint32_t site[] = {2, 27, 57};
  sonde_probe probe;
  sonde_state *state = NULL;
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  assert_int_equal(sonde_state_create(model, NULL, &state, NULL), SONDE_OK);
  for (size_t k = 0; k < SONDE_COUNT_OF(site); ++k) {
    const sonde_site *at = sonde_model_site(model, site[k]);
    assert_non_null(at);
    sonde_state_reset(state);
    double last = 0;
    for (int step = 1; step <= 2; ++step) {
      sonde_settle_result r =
          sonde_settle(state, &probe, pose_at(at, depth_m * step / 2), 1e-8, 400);
      assert_true(r.converged);
      assert_true(r.contact_n > last);
      assert_near(r.reaction_n, r.contact_n, 1e-6 * r.contact_n);
      last = r.contact_n;
    }
    assert_true(last > 0.5 && last < 40);
  }
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
}

#endif
