// Truth beside a picture: lumina as large as their sections, tissue as the limb has it at rest,
// displacement as the interior gives it.
#include "echo/bench.h"
#include "echo/echo.h"
#include "sonde/limb_model.h"
#include "sonde/sweep_truth.h"

#include <stdio.h>

enum { SIDE = 400 };

// Pixels of one vessel's lumen, m^2.
static double lumen_m2(const sonde_truth *t, uint8_t vessel) {
  const double pixel = t->width_m / t->width;
  double count = 0;
  for (size_t i = 0; i < (size_t)t->width * t->height; ++i)
    count += t->vessel[i] == vessel &&
             (t->tissue[i] == SONDE_LABEL_VEIN || t->tissue[i] == SONDE_LABEL_ARTERY ||
              t->tissue[i] == SONDE_LABEL_THROMBUS);
  return count * pixel * pixel;
}

// Largest difference of the displacement from the interior's, m.
static double displacement_error(const bench *b, const sonde_truth *t) {
  double worst = 0;
  for (size_t i = 0; i < (size_t)t->width * t->height; i += 37) {
    if (t->tissue[i] == SONDE_LABEL_OUTSIDE || t->vessel[i] > 0) continue;
    const float *place = t->place_m[i], *moved = t->displacement_m[i];
    const sonde_vec3 now =
        pose_apply(b->pose, vec3((double)place[0], (double)place[1], (double)place[2]));
    const sonde_vec3 by =
        q_rotate(b->pose.rotation, vec3((double)moved[0], (double)moved[1], (double)moved[2]));
    const sonde_vec3 due = sonde_interior_displacement(b->interior, v_sub(now, by));
    worst = fmax(worst, v_distance(by, due));
  }
  return worst;
}

// A pressed leg with a clot in a part of its vein.
static void pressed(void **state) {
  (void)state;
  static const char *const CASES[] = {"healthy", "partial_mural"};
  for (size_t k = 0; k < SONDE_COUNT_OF(CASES); ++k) {
    bench b;
    bench_create(&b, leg_radius, 0.014, 0.012, false, true);
    sonde_image_clear(&b.image);
    assert_int_equal(sonde_image_create(SIDE, SIDE, &b.image, NULL), SONDE_OK);
    assert_int_equal(sonde_pathology_preset(CASES[k], &b.pathology, NULL), SONDE_OK);
    b.settings.depth_m = 0.04;
    for (uint32_t i = 0; i < b.leg.model.surface.vertex_count; ++i) {
      const sonde_vec3 p = b.leg.model.surface.vertices[i];
      if (p.y > 0 && fabs(p.x) < 0.02 && fabs(p.z - 0.15) < 0.006) b.forces[i].y = -0.05;
    }
    look(&b, NULL);
    sonde_truth t;
    assert_int_equal(sonde_truth_create(b.echo, &b.image, &t, NULL), SONDE_OK);
    assert_int_equal(t.tick, b.image.tick);
    double clot = 0, fastest = 0;
    for (size_t i = 0; i < (size_t)SIDE * SIDE; ++i) {
      clot += t.tissue[i] == SONDE_LABEL_THROMBUS;
      fastest = fmax(fastest, fabs((double)t.velocity_m_s[i][1]));
      if (t.tissue[i] == SONDE_LABEL_THROMBUS || t.tissue[i] == SONDE_LABEL_MUSCLE)
        assert_true(t.velocity_m_s[i][1] == 0);
    }
    for (int which = 0; which < 2; ++which) {
      sonde_vessel_state v;
      assert_true(sonde_interior_vessel_at_plane(b.interior, which, b.pose, &v));
      const double due = SONDE_PI * v.half_short_m * v.half_long_m;
      const double seen = lumen_m2(&t, (uint8_t)(which + 1));
      printf("%s, vessel %d: %.3f mm^2 of %.3f, %.2f of its rest\n", CASES[k], which, 1e6 * seen,
             1e6 * due, v.area_ratio);
      assert_true(fabs(seen / due - 1) < 0.01);
    }
    const double off = displacement_error(&b, &t);
    printf("displacement %.2f um off, clot %.0f pixels, blood to %.3f m/s\n", 1e6 * off, clot,
           fastest);
    assert_true(off < 1e-6);
    assert_true((clot > 0) == (k == 1));
    assert_true(fastest > 0.15 && fastest < 0.9);
    // Where tissues have their own speeds, a pixel shows another place; what is there stays true.
    b.echo->scanner.sound_speeds = 1;
    look(&b, NULL);
    sonde_truth_clear(&t);
    assert_int_equal(sonde_truth_create(b.echo, &b.image, &t, NULL), SONDE_OK);
    assert_true(displacement_error(&b, &t) < 1e-6);
    const float *place = t.place_m[SIDE / 2 * SIDE + SIDE / 2];
    assert_true(fabs((double)place[2] - 0.02) > 0.1e-3 && fabs((double)place[2] - 0.02) < 2e-3);
    sonde_truth_clear(&t);
    bench_clear(&b);
  }
}

// Names of both label sets.
static sonde_label label_of(sonde_limb_tissue tissue) {
  static const sonde_label OF[SONDE_LIMB_TISSUES] = {
      [SONDE_LIMB_OUTSIDE] = SONDE_LABEL_OUTSIDE,
      [SONDE_LIMB_SKIN] = SONDE_LABEL_SKIN,
      [SONDE_LIMB_FAT] = SONDE_LABEL_FAT,
      [SONDE_LIMB_SUPERFICIAL_FASCIA] = SONDE_LABEL_FASCIA,
      [SONDE_LIMB_FASCIA] = SONDE_LABEL_FASCIA,
      [SONDE_LIMB_SEPTUM] = SONDE_LABEL_FASCIA,
      [SONDE_LIMB_MUSCLE] = SONDE_LABEL_MUSCLE,
      [SONDE_LIMB_TENDON] = SONDE_LABEL_TENDON,
      [SONDE_LIMB_SHEATH] = SONDE_LABEL_FAT,
      [SONDE_LIMB_NODE] = SONDE_LABEL_NODE,
      [SONDE_LIMB_NERVE] = SONDE_LABEL_NERVE,
      [SONDE_LIMB_BONE] = SONDE_LABEL_BONE};
  return OF[tissue];
}

// A limb's truth beside its vessels is the label of the limb at the place at rest.
static void limb(void **state) {
  (void)state;
  enum { PIXELS = 128 };
  sonde_limb_body body = sonde_limb_unknown();
  sonde_model *model = NULL;
  sonde_interior *interior = NULL;
  sonde_echo *echo = NULL;
  sonde_image image;
  const sonde_limb_model_def def = sonde_limb_model_def_default();
  assert_int_equal(sonde_limb_draw(&body, 41, &body, NULL), SONDE_OK);
  assert_int_equal(sonde_limb_model(&body, &def, &model, NULL), SONDE_OK);
  assert_int_equal(sonde_interior_create(model, &interior, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_create(interior, NULL, &echo, NULL), SONDE_OK);
  assert_int_equal(sonde_image_create(PIXELS, PIXELS, &image, NULL), SONDE_OK);
  const sonde_limb *of = sonde_limb_of(model);
  sonde_echo_settings settings = sonde_echo_settings_default();
  sonde_pathology pathology;
  assert_int_equal(sonde_pathology_preset("healthy", &pathology, NULL), SONDE_OK);
  const uint32_t n = model->surface.vertex_count;
  sonde_vec3 *forces = SONDE_NEW(sonde_vec3, n), *skin = SONDE_NEW(sonde_vec3, n);
  for (uint32_t k = 1; k < 8; k += 3) {
    const sonde_site *site = &model->sites[k];
    const sonde_vec3 beam = v_scale(site->normal, -1);
    const sonde_pose pose = {site->position_m,
                             q_from_matrix(m_columns(site->u, v_cross(beam, site->u), beam))};
    // The skin about the site is pushed in by up to 6 mm.
    for (uint32_t i = 0; i < n; ++i) {
      const sonde_vec3 d = v_sub(model->surface.vertices[i], pose.position);
      skin[i] = v_madd(model->surface.vertices[i], 6e-3 * exp(-v_dot(d, d) / (0.03 * 0.03)),
                       q_rotate(pose.rotation, vec3(0, 0, 1)));
    }
    sonde_interior_update(interior,
                          &(sonde_interior_input){skin, forces, pose, &pathology, -1, 7, INFINITY,
                                                  INFINITY, 0, SONDE_POSTURE_SUPINE, NULL});
    sonde_echo_render(echo, pose, 0.04, &pathology, &settings, &image);
    sonde_truth t;
    assert_int_equal(sonde_truth_create(echo, &image, &t, NULL), SONDE_OK);
    uint32_t looked = 0, other = 0, kinds = 0;
    for (size_t i = 0; i < (size_t)PIXELS * PIXELS; ++i) {
      if (t.tissue[i] == SONDE_LABEL_OUTSIDE || t.vessel[i] > 0) continue;
      const float *at = t.place_m[i], *by = t.displacement_m[i];
      const sonde_vec3 rest = pose_apply(
          pose, vec3((double)(at[0] - by[0]), (double)(at[1] - by[1]), (double)(at[2] - by[2])));
      const sonde_limb_label due = sonde_limb_at(of, sonde_limb_to_model(of, rest));
      if (due.tissue == SONDE_LIMB_LUMEN || due.tissue == SONDE_LIMB_WALL) continue;
      ++looked, other += label_of(due.tissue) != t.tissue[i], kinds |= 1u << t.tissue[i];
    }
    printf("site %u: %u of %u pixels are labelled otherwise, %d kinds\n", k, other, looked,
           __builtin_popcount(kinds));
    assert_true(other == 0 && looked > 5000 && __builtin_popcount(kinds) >= 5);
    sonde_truth_clear(&t);
  }
  sonde_free(forces), sonde_free(skin);
  sonde_image_clear(&image);
  sonde_echo_destroy(echo);
  sonde_interior_destroy(interior);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(pressed), cmocka_unit_test(limb)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
