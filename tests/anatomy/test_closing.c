// Force at which a healthy vein closes under the linear probe, on generated thighs at the depths
// that they have, against the bands that a half space gives for 22 mmHg at the vein
// (docs/interior_theory.md).
#include "anatomy_test.h"
#include "sonde/interior.h"
#include "sonde/world_path.h"

static const double DEPTH_MM[] = {15, 20, 25, 30, 40}, LEAST_N[] = {3, 4.5, 6, 7.5, 12};
static const double MOST_N[] = {6, 8, 11, 15, 24};

// A band's edge at a depth, straight between the depths that are given and on beyond them.
static double band(const double *edge, double depth_mm) {
  int k = 0;
  while (k + 2 < (int)SONDE_COUNT_OF(DEPTH_MM) && DEPTH_MM[k + 1] < depth_mm) ++k;
  double t = (depth_mm - DEPTH_MM[k]) / (DEPTH_MM[k + 1] - DEPTH_MM[k]);
  return edge[k] + t * (edge[k + 1] - edge[k]);
}

// The state of the vessels after a press to a force.
static void press(const sonde_model *model, sonde_interior *in, const sonde_landmark *mark,
                  double force_n, sonde_vessel_state vessel[2]) {
  sonde_probe probe;
  sonde_state *state;
  sonde_pathology healthy;
  sonde_path_result path;
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  assert_int_equal(sonde_state_create(model, NULL, &state, NULL), SONDE_OK);
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  sonde_vec3 z = v_neg(mark->normal), x = v_unit(v_cross(z, vec3(0, 0, 1)), vec3(1, 0, 0));
  sonde_pose from = {mark->skin_m, q_from_matrix(m_columns(x, v_cross(z, x), z))};
  sonde_pose to = {v_madd(mark->skin_m, 0.045, z), from.rotation};
  sonde_path_def def = sonde_path_def_default();
  def.force_n = force_n, def.relative_residual = 1e-6, def.tolerance = 0.05, def.step_m = 3e-3;
  sonde_error error = {0};
  if (sonde_settle_path(state, &probe, from, to, &def, NULL, &path, &error))
    fail_msg("%s at %.1f N: %s", mark->name, force_n, error.message);
  sonde_interior_update(in, &(sonde_interior_input){sonde_state_positions(state),
                                                    sonde_state_contact_forces(state), path.pose,
                                                    &healthy, -1, 1, probe.half_x_m, probe.half_y_m,
                                                    0, SONDE_POSTURE_SUPINE, NULL});
  for (int which = 0; which < 2; ++which)
    assert_true(sonde_interior_vessel_at_plane(in, which, path.pose, &vessel[which]));
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
}

static void veins_close_in_the_published_bands(void **state) {
  (void)state;
  const char *const places[] = {"common_femoral", "femoral_mid"};
  const double fat_m[] = {0.005, 0.010, 0.016};
  sonde_thigh_def def = coarse();
  for (size_t k = 0; k < SONDE_COUNT_OF(fat_m); ++k) {
    sonde_thigh known = sonde_thigh_unknown(), thigh;
    known.fat_front_m = fat_m[k];
    sonde_model *model = make_thigh(&known, 1 + k, &def, &thigh);
    sonde_interior *in;
    assert_int_equal(sonde_interior_create(model, &in, NULL), SONDE_OK);
    for (size_t i = 0; i < SONDE_COUNT_OF(places); ++i) {
      const sonde_landmark *mark = sonde_anatomy_landmark(model->anatomy, places[i]);
      assert_non_null(mark);
      double depth_mm = 1e3 * v_distance(mark->skin_m, mark->vein_m);
      double least_n = band(LEAST_N, depth_mm), most_n = band(MOST_N, depth_mm);
      sonde_vessel_state low[2], high[2];
      press(model, in, mark, least_n, low);
      press(model, in, mark, most_n, high);
      print_message("%2.0f mm of fat, %-15s %4.1f mm: %4.1f N leave %.2f of the vein, %4.1f N %.3f "
                    "of it and %.3f of the artery\n",
                    1e3 * fat_m[k], places[i], depth_mm, least_n, low[0].area_ratio, most_n,
                    high[0].area_ratio, high[1].area_ratio);
      assert_true(low[0].area_ratio > 0.1);
      assert_true(high[0].area_ratio < 0.1);
      assert_true(high[1].area_ratio > 0.93);
    }
    sonde_interior_destroy(in);
    sonde_model_destroy(model);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(veins_close_in_the_published_bands)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
