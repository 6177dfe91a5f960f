// What a case adds, in the picture: branches, clots in them, lesions that move with the tissue,
// enhancement behind fluid; nothing added changes nothing.
#include "echo/bench.h"

#include <stdio.h>
#include <stdlib.h>

static const double face_m = 3e-3; // below the skin

typedef struct scene {
  bench b;
  sonde_thigh_anatomy anatomy;
} scene;

// A saphenous vein 9 mm below the skin at x = 0.012 of the picture and, when asked for, one vein on
// the far side of the leg.
static void add_branch(scene *s, const char *name, double depth, double x, double radius) {
  sonde_branch *branch = &s->anatomy.branch[s->anatomy.branch_count++];
  double r = leg_radius - depth;
  snprintf(branch->name, sizeof branch->name, "%s", name);
  tube_vessel(&branch->line, leg_radius, r, SONDE_PI / 2 + x / r, 0.3, radius);
}

static void renew(scene *s) {
  sonde_echo_destroy(s->b.echo);
  sonde_interior_destroy(s->b.interior);
  s->b.echo = NULL, s->b.interior = NULL;
  s->b.leg.model.anatomy = &s->anatomy;
  assert_int_equal(sonde_interior_create(&s->b.leg.model, &s->b.interior, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_create(s->b.interior,
                                     &(sonde_echo_def){.version = SONDE_DEF_VERSION, .seed = 5},
                                     &s->b.echo, NULL),
                   SONDE_OK);
}

static void create(scene *s, bool vessels) {
  *s = (scene){0};
  bench_create(&s->b, leg_radius, 0.014, 0.012, false, vessels);
  renew(s);
}

static void destroy(scene *s) {
  s->b.leg.model.anatomy = NULL;
  bench_clear(&s->b);
}

static void add_lesion(sonde_findings *f, sonde_lesion_kind kind, double x, double z, double half) {
  f->lesion[f->lesion_count++] =
      (sonde_lesion){kind, vec3(-x, leg_radius - face_m - z, 0.15), vec3(0, 0, 1),
                     vec3(half, half, 1.5 * half), kind == SONDE_LESION_CYST ? 0 : 0.2};
}

// Mean grey of a square of the picture.
static double grey(const bench *b, double x_m, double z_m, double half_m) {
  double pixel = b->image.height_m / b->image.height, sum = 0;
  int count = 0;
  for (double z = z_m - half_m; z <= z_m + half_m; z += pixel)
    for (double x = x_m - half_m; x <= x_m + half_m; x += pixel, ++count) {
      int column = (int)(x / pixel + 0.5 * b->image.width), row = (int)(z / pixel);
      sum += b->image.pixels[row * (int)b->image.width + column];
    }
  return sum / count;
}

static void set(scene *s, const sonde_findings *f) {
  sonde_error error = {0};
  if (sonde_interior_set_findings(s->b.interior, f, &error)) fail_msg("%s", error.message);
}

static void fluid_is_dark_and_brightens_what_lies_behind(void **state) {
  (void)state;
  scene s;
  sonde_findings f = {0};
  create(&s, false);
  add_lesion(&f, SONDE_LESION_CYST, -0.010, 0.022, 4e-3);
  add_lesion(&f, SONDE_LESION_NODE, 0.010, 0.024, 7e-3);
  look(&s.b, NULL);
  double before = grey(&s.b, -0.010, 0.034, 3e-3);
  set(&s, &f);
  look(&s.b, NULL);
  double cyst = grey(&s.b, -0.010, 0.022, 1.5e-3), behind = grey(&s.b, -0.010, 0.034, 3e-3);
  double rim = grey(&s.b, 0.010, 0.024 - 5.2e-3, 0.8e-3), hilum = grey(&s.b, 0.010, 0.024, 1e-3);
  double muscle = grey(&s.b, 0, 0.022, 2.5e-3);
  print_message(
      "cyst %.1f, node's rim %.1f, hilum %.1f, muscle %.1f; behind the cyst %.1f for %.1f\n", cyst,
      rim, hilum, muscle, behind, before);
  assert_true(cyst < 20 && cyst < rim - 10 && rim < muscle - 10 && hilum > rim + 20);
  // Fluid loses 0.05 instead of 1 dB/cm/MHz: over 8 mm and back 11 dB less at 7.5 MHz, of which
  // looking past the cyst's sides leaves some.
  double db = (behind - before) * s.b.settings.dynamic_range_db / 255;
  assert_true(db > 5 && db < 12);
  destroy(&s);
}

// Depth at which a column of the picture first falls below and then rises above a level.
static double middle_of_dark(const bench *b, double x_m, double from_m) {
  double pixel = b->image.height_m / b->image.height, top = 0, low = 0;
  for (double z = from_m; z < 0.05 && low <= 0; z += pixel) {
    bool dark = grey(b, x_m, z, 4e-4) < 25;
    if (dark && top <= 0) top = z;
    if (!dark && top > 0) low = z;
  }
  assert_true(top > 0 && low > top);
  return 0.5 * (top + low);
}

static void lesion_goes_with_the_tissue(void **state) {
  (void)state;
  scene s;
  sonde_findings f = {0};
  create(&s, false);
  add_lesion(&f, SONDE_LESION_CYST, 0, 0.022, 4e-3);
  set(&s, &f);
  look(&s.b, NULL);
  double rest = middle_of_dark(&s.b, 0, 0.015);
  uint32_t n = s.b.leg.model.surface.vertex_count;
  sonde_vec3 *moved = SONDE_NEW(sonde_vec3, n);
  for (uint32_t i = 0; i < n; ++i) {
    sonde_vec3 q = s.b.leg.model.surface.vertices[i];
    double w = q.y > 0 ? 3e-3 * exp(-(q.x * q.x + (q.z - 0.15) * (q.z - 0.15)) / 2 / 0.0009) : 0;
    moved[i] = v_madd(q, -w, vec3(0, 1, 0));
  }
  look(&s.b, moved);
  double now = middle_of_dark(&s.b, 0, 0.015);
  double due = -sonde_interior_displacement(s.b.interior, f.lesion[0].centre_m).y;
  print_message("cyst moved %.2f mm, the tissue %.2f mm\n", 1e3 * (now - rest), 1e3 * due);
  assert_true(due > 1e-3 && fabs(now - rest - due) < 0.3e-3);
  sonde_free(moved);
  destroy(&s);
}

static void branches_show_and_clots_fill_them(void **state) {
  (void)state;
  scene s;
  create(&s, true);
  look(&s.b, NULL);
  double fat = grey(&s.b, 0.012, 0.006, 1e-3);
  add_branch(&s, "great_saphenous", 9e-3, 0.012, 2e-3);
  renew(&s);
  look(&s.b, NULL);
  double open = grey(&s.b, 0.012, 0.006, 0.7e-3);
  sonde_findings f = {.branch_count = 1};
  snprintf(f.branch[0].branch, sizeof f.branch[0].branch, "great_saphenous");
  assert_int_equal(sonde_pathology_preset("chronic", &f.branch[0].pathology, NULL), SONDE_OK);
  set(&s, &f);
  look(&s.b, NULL);
  double clot = grey(&s.b, 0.012, 0.006, 0.7e-3), vein = grey(&s.b, 0, 0.015, 2e-3);
  print_message("fat %.1f, saphenous %.1f, with a clot %.1f, femoral vein %.1f\n", fat, open, clot,
                vein);
  assert_true(open < 35 && fat > open + 25 && clot > open + 40 && vein < 35);
  destroy(&s);
}

static void nothing_added_changes_nothing(void **state) {
  (void)state;
  scene s;
  create(&s, true);
  size_t size = (size_t)s.b.image.width * s.b.image.height;
  uint8_t *plain = SONDE_NEW(uint8_t, size);
  look(&s.b, NULL);
  memcpy(plain, s.b.image.pixels, size);
  const sonde_findings none = {0};
  set(&s, &none);
  look(&s.b, NULL);
  assert_memory_equal(plain, s.b.image.pixels, size);
  // A branch that the picture does not show.
  add_branch(&s, "far_vein", 9e-3, 0.2, 2e-3);
  renew(&s);
  look(&s.b, NULL);
  assert_memory_equal(plain, s.b.image.pixels, size);
  sonde_free(plain);
  destroy(&s);
}

static void all_loops_agree(void **state) {
  (void)state;
  scene s;
  sonde_findings f = {.webs = 0.7, .oedema = 0.6};
  create(&s, true);
  add_branch(&s, "great_saphenous", 9e-3, 0.012, 2e-3);
  renew(&s);
  add_lesion(&f, SONDE_LESION_NODE, -0.012, 0.018, 4e-3);
  add_lesion(&f, SONDE_LESION_HAEMATOMA, 0.008, 0.030, 5e-3);
  set(&s, &f);
  assert_int_equal(sonde_pathology_preset("chronic", &s.b.pathology, NULL), SONDE_OK);
  look(&s.b, NULL);
  size_t size = (size_t)s.b.image.width * s.b.image.height;
  uint8_t *widest = SONDE_NEW(uint8_t, size);
  memcpy(widest, s.b.image.pixels, size);
  const char *const sets[] = {"avx512", "avx2", "sse4", "base"};
  for (size_t k = 0; k < SONDE_COUNT_OF(sets); ++k) {
    if (sonde_echo_set_kernels(s.b.echo, sets[k], NULL)) continue;
    look(&s.b, NULL);
    assert_memory_equal(widest, s.b.image.pixels, size);
  }
  sonde_free(widest);
  destroy(&s);
}

// Bands and clefts: more contrast in the same tissue.
static void webs_and_oedema_show(void **state) {
  (void)state;
  scene s;
  create(&s, true);
  assert_int_equal(sonde_pathology_preset("chronic", &s.b.pathology, NULL), SONDE_OK);
  double darkest[2], range[2];
  for (int k = 0; k < 2; ++k) {
    sonde_findings f = {.webs = k, .oedema = k};
    set(&s, &f);
    look(&s.b, NULL);
    double low = 255, high = 0;
    darkest[k] = 255;
    for (double x = -0.015; x < 0.015; x += 4e-4)
      for (double z = 1.5e-3; z < 7e-3; z += 4e-4)
        darkest[k] = fmin(darkest[k], grey(&s.b, x, z, 2e-4));
    for (double z = 0.0125; z < 0.0175; z += 2e-4) {
      double band = 0;
      for (double x = -2e-3; x <= 2e-3; x += 4e-4) band += grey(&s.b, x, z, 2e-4) / 11;
      low = fmin(low, band), high = fmax(high, band);
    }
    range[k] = high - low;
  }
  print_message("darkest fat %.0f -> %.0f, range within the clot %.0f -> %.0f\n", darkest[0],
                darkest[1], range[0], range[1]);
  assert_true(darkest[1] < 0.5 * darkest[0] && range[1] > 1.4 * range[0]);
  destroy(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(fluid_is_dark_and_brightens_what_lies_behind),
      cmocka_unit_test(lesion_goes_with_the_tissue),
      cmocka_unit_test(branches_show_and_clots_fill_them),
      cmocka_unit_test(nothing_added_changes_nothing),
      cmocka_unit_test(all_loops_agree),
      cmocka_unit_test(webs_and_oedema_show),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
