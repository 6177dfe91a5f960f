// The map from rest to the picture keeps orientation: no tissue is seen twice or from behind, at
// any site of the thigh, under any force that a probe can give. And its inverse is its inverse.
#include "../sanitized.h"
#include "fixture.h"
#include "interior/interior.h"
#include "sonde/tissue.h"

static const double image_depth_m = 0.05, half_slab_m = 1.5e-3, probing_m = 5e-6;
static const double close_m = 0.2e-6;
static const double press_m[] = {15e-3, 24e-3, 33e-3}; // about 7, 16 and 30 N
static const double hardest_n = 45;

typedef struct scene {
  sonde_model *model;
  sonde_state *state;
  sonde_interior *interior;
  sonde_probe probe;
  sonde_pathology pathology;
  sonde_pose pose;
  uint32_t points, folded, states, lost, inverted; // over all presses
  double least, worst_m, hardest_n;
} scene;

static sonde_vec3 moved(const scene *s, sonde_vec3 rest) {
  return v_add(rest, sonde_interior_displacement(s->interior, rest));
}

// What three steps from a rest point span in the picture, over what they span at rest.
static double spanned(const scene *s, sonde_vec3 rest, double step_m) {
  sonde_vec3 g[3], here = moved(s, rest);
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 e = vec3(k == 0 ? step_m : 0, k == 1 ? step_m : 0, k == 2 ? step_m : 0);
    g[k] = v_scale(v_sub(moved(s, v_add(rest, e)), here), 1 / step_m);
  }
  return v_dot(g[0], v_cross(g[1], g[2]));
}

// Across a face between two elements differences would mix the derivatives of both sides: what
// looks folded is looked at again closer.
static double volume_at(const scene *s, sonde_vec3 rest) {
  double volume = spanned(s, rest, probing_m);
  return volume > 0 ? volume : spanned(s, rest, close_m);
}

// Tissue outside the lumina, a little away from skin and bone, whose derivative is one-sided.
static bool is_tissue(const scene *s, sonde_vec3 rest) {
  sonde_column_point at;
  bool within = sonde_interior_locate(s->interior, rest, &at);
  sonde_label label = sonde_interior_label(s->interior, rest, NULL);
  bool lumen = label == SONDE_LABEL_VEIN || label == SONDE_LABEL_ARTERY;
  return within && !lumen && at.depth_m > 1e-4 && at.r > s->interior->bone_radius_m + 1e-4;
}

// Rest points around the picture that are seen in it.
static void look_for_folds(scene *s) {
  const double half = s->probe.half_x_m;
  for (double x = -half - 6e-3; x < half + 6e-3; x += 3.7e-3)
    for (double z = -40e-3; z < image_depth_m; z += 2.3e-3) {
      sonde_vec3 rest = pose_apply(s->pose, vec3(x, 0, z));
      if (!is_tissue(s, rest)) continue;
      sonde_vec3 seen = pose_apply_inverse(s->pose, moved(s, rest));
      if (fabs(seen.x) > half || fabs(seen.y) > half_slab_m) continue;
      if (seen.z < 0 || seen.z > image_depth_m) continue;
      double volume = volume_at(s, rest);
      ++s->points, s->folded += !(volume > 0);
      if (!(volume > 0)) continue;
      s->least = fmin(s->least, volume);
      if (s->points % 16) continue;
      double off = v_distance(sonde_interior_rest_point(s->interior, moved(s, rest)), rest);
      ++s->inverted, s->lost += off > 50e-6;
      s->worst_m = fmax(s->worst_m, off);
    }
}

static void press(scene *s, const sonde_site *site, const char *probe) {
  assert_int_equal(sonde_probe_create(probe, &s->probe, NULL), SONDE_OK);
  sonde_vec3 beam = v_neg(v_unit(site->normal, vec3(0, 0, 1)));
  sonde_vec3 x = v_unit(v_madd(site->u, -v_dot(site->u, beam), beam), vec3(1, 0, 0));
  sonde_mat3 axes = m_columns(x, v_cross(beam, x), beam);
  sonde_pose start = {site->position_m, q_from_matrix(axes)};
  sonde_state_reset(s->state);
  for (size_t k = 0; k < SONDE_COUNT_OF(press_m); ++k) {
    s->pose = start;
    s->pose.position = v_madd(start.position, press_m[k], beam);
    (void)sonde_settle(s->state, &s->probe, s->pose, 1e-3, 40);
    double force = -v_dot(sonde_state_contact(s->state)->force_n, beam);
    if (force > hardest_n) break;
    s->hardest_n = fmax(s->hardest_n, force), ++s->states;
    sonde_interior_update(s->interior, &(sonde_interior_input){sonde_state_positions(s->state),
                                                               sonde_state_contact_forces(s->state),
                                                               s->pose, &s->pathology, -1, k,
                                                               s->probe.half_x_m, s->probe.half_y_m,
                                                               0, SONDE_POSTURE_SUPINE, NULL});
    look_for_folds(s);
  }
  sonde_probe_clear(&s->probe);
}

static void open_scene(scene *s) {
  const sonde_world_def def = sonde_world_def_default();
  *s = (scene){.least = INFINITY, .model = bundled_thigh()};
  assert_int_equal(sonde_state_create(s->model, &def, &s->state, NULL), SONDE_OK);
  assert_int_equal(sonde_interior_create(s->model, &s->interior, NULL), SONDE_OK);
  assert_int_equal(sonde_pathology_preset("healthy", &s->pathology, NULL), SONDE_OK);
}

static void close_scene(scene *s) {
  sonde_interior_destroy(s->interior);
  sonde_state_destroy(s->state);
  sonde_model_destroy(s->model);
}

static void tell(const scene *s, const char *what) {
  print_message("%s: %u of %u points folded in %u states up to %.0f N, least volume %.3f; %u of %u "
                "inverses off, worst %.2g mm\n",
                what, s->folded, s->points, s->states, s->hardest_n, s->least, s->lost, s->inverted,
                s->worst_m * 1e3);
}

// The two probes by turns.
static void no_site_folds(void **state) {
  (void)state;
  scene s;
  open_scene(&s);
  const uint32_t every = SAMPLES(4, 8), pressed = s.model->site_count / every;
  for (uint32_t k = 0; k < pressed; ++k)
    press(&s, &s.model->sites[1 + k * every], k % 2 ? "square" : "linear");
  tell(&s, "solid");
  assert_true(s.states > 2 * pressed && s.points > 375 * pressed && s.hardest_n > 25);
  assert_true(s.folded == 0);
  assert_true(s.inverted > 25 * pressed && s.lost < 3e-3 * s.inverted);
  close_scene(&s);
}

static void columns_do_not_fold(void **state) {
  (void)state;
  scene s;
  open_scene(&s);
  sonde_interior_set_method(s.interior, SONDE_INTERIOR_COLUMNS);
  for (uint32_t k = 3; k < s.model->site_count; k += 16)
    press(&s, &s.model->sites[k], k % 32 == 3 ? "linear" : "square");
  tell(&s, "columns");
  assert_true(s.states > 6 && s.points > 700);
  assert_true(s.folded == 0);
  close_scene(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(no_site_folds),
      cmocka_unit_test(columns_do_not_fold),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
