// A picture of two discs pressed with the leg: areas of vein and artery are measured in the
// picture.
#include "interior/interior.h"
#include "interior/tube.h"
#include "sonde/sweep_volume.h"

#include <stdlib.h>

enum { SIDE = 400 };

static const double radius = 0.08, station = 0.15, picture_m = 0.05;

typedef struct bench {
  tube leg;
  sonde_interior *interior;
  sonde_image rest, pressed;
  sonde_image_press press;
  double vein_x, vein_z, vein_r, artery_x, artery_z, artery_r; // rest, in the probe's plane
  sonde_vec3 *positions, *forces;
} bench;

static void find_vessel(bench *b, int which, double *x, double *z, double *r) {
  sonde_vessel_state v;
  assert_true(sonde_interior_vessel_at_plane(b->interior, which, b->press.rest_pose, &v));
  sonde_vec3 p = pose_apply_inverse(b->press.rest_pose, v.rest_centre_m);
  *x = p.x, *z = p.z, *r = v.rest_radius_m;
}

// Vein 60, artery 200, tissue 120.
static void draw_rest(bench *b) {
  double step = picture_m / SIDE;
  for (int i = 0; i < SIDE * SIDE; ++i) {
    double x = (i % SIDE + 0.5) * step - 0.5 * picture_m, z = (i / SIDE + 0.5) * step;
    bool vein = hypot(x - b->vein_x, z - b->vein_z) < b->vein_r;
    bool artery = hypot(x - b->artery_x, z - b->artery_z) < b->artery_r;
    b->rest.pixels[i] = vein ? 60 : artery ? 200 : 120;
  }
}

static void update(bench *b, const char *name, double venous_mmhg, double push_n) {
  sonde_pathology p;
  assert_int_equal(sonde_pathology_preset(name, &p, NULL), SONDE_OK);
  if (venous_mmhg > 0) p.venous_pressure_pa = venous_mmhg * SONDE_PA_PER_MMHG;
  // The force on the nodes under a face of 40 x 10 mm.
  uint32_t n = b->leg.model.surface.vertex_count, touched = 0;
  for (int pass = 0; pass < 2; ++pass)
    for (uint32_t i = 0; i < n; ++i) {
      sonde_vec3 q = pose_apply_inverse(b->press.pose, b->leg.model.surface.vertices[i]);
      bool under = fabs(q.x) < 0.02 && fabs(q.y) < 5e-3 && fabs(q.z) < 0.01;
      if (pass == 0) touched += under;
      sonde_vec3 way = q_rotate(b->press.pose.rotation, vec3(0, 0, 1));
      if (pass == 1) b->forces[i] = under ? v_scale(way, push_n / touched) : vec3(0, 0, 0);
    }
  b->interior->model = &b->leg.model; // the bench was returned by value
  sonde_interior_update(b->interior,
                        &(sonde_interior_input){b->positions, b->forces, b->press.pose, &p, -1, 1,
                                                0.02, 5e-3, 0, SONDE_POSTURE_SUPINE, NULL});
}

static bench make(void) {
  bench b = {.leg = tube_create(radius, 0.014, 0.3, 2.5e-3, 160, 60)};
  b.press.rest_pose = b.press.pose = tube_pose(radius, station);
  assert_int_equal(sonde_interior_create(&b.leg.model, &b.interior, NULL), SONDE_OK);
  uint32_t n = b.leg.model.surface.vertex_count;
  b.forces = SONDE_NEW(sonde_vec3, n);
  b.positions = b.leg.model.surface.vertices;
  assert_int_equal(sonde_image_create(SIDE, SIDE, &b.rest, NULL), SONDE_OK);
  assert_int_equal(sonde_image_create(SIDE, SIDE, &b.pressed, NULL), SONDE_OK);
  b.rest.width_m = b.rest.height_m = b.pressed.width_m = b.pressed.height_m = picture_m;
  b.press.interior = b.interior;
  update(&b, "healthy", 0, 0);
  find_vessel(&b, 0, &b.vein_x, &b.vein_z, &b.vein_r);
  find_vessel(&b, 1, &b.artery_x, &b.artery_z, &b.artery_r);
  draw_rest(&b);
  return b;
}

static void clear(bench *b) {
  sonde_interior_destroy(b->interior);
  sonde_image_clear(&b->rest);
  sonde_image_clear(&b->pressed);
  sonde_free(b->forces);
  tube_clear(&b->leg);
}

// Pixels nearer to that grey than to tissue.
static double area(const sonde_image *image, bool vein) {
  double count = 0;
  for (int i = 0; i < SIDE * SIDE; ++i)
    count += vein ? image->pixels[i] < 90 && image->pixels[i] > 30 : image->pixels[i] > 160;
  return count;
}

static void press(bench *b, const char *name, double venous_mmhg, double push_n, double out[2]) {
  update(b, name, venous_mmhg, push_n);
  sonde_image_pressed(&b->rest, &b->press, &b->pressed, NULL);
  out[0] = area(&b->pressed, true) / area(&b->rest, true);
  out[1] = area(&b->pressed, false) / area(&b->rest, false);
}

// At a force that closes the vein the artery keeps most of the area that the model gives it.
static void the_vein_closes_before_the_artery(void **state) {
  (void)state;
  bench b = make();
  double at[2];
  sonde_vessel_state artery;
  press(&b, "healthy", 0, 4, at);
  assert_true(sonde_interior_vessel_at_plane(b.interior, 1, b.press.pose, &artery));
  print_message("vein %.3f, artery %.3f, of the model %.3f\n", at[0], at[1], artery.area_ratio);
  assert_true(at[0] < 0.15);
  assert_true(at[1] > 3 * at[0]);
  assert_true(fabs(at[1] - artery.area_ratio) < 0.03);
  clear(&b);
}

// Standing fills the vein: at the same force a fuller vein stays wider.
static void a_fuller_vein_closes_later(void **state) {
  (void)state;
  bench b = make();
  double before = 0;
  for (double mmhg = 10; mmhg < 90; mmhg += 20) {
    double at[2];
    press(&b, "healthy", mmhg, 6, at);
    print_message("%2.0f mmHg: vein %.3f, artery %.3f\n", mmhg, at[0], at[1]);
    assert_true(at[0] >= before);
    before = at[0];
  }
  assert_true(before > 0.5);
  clear(&b);
}

static void residual_area_grows_with_the_stage(void **state) {
  (void)state;
  static const char *const stages[] = {"healthy", "partial_mural", "acute_occlusive",
                                       "subacute_occlusive", "chronic_occlusive"};
  bench b = make();
  double before = -1;
  for (int k = 0; k < 5; ++k) {
    double rest[2], at[2];
    press(&b, stages[k], 0, 0, rest);
    press(&b, stages[k], 0, 8, at);
    double residual = at[0] / rest[0];
    print_message("%s: residual %.3f\n", stages[k], residual);
    assert_true(residual > before);
    before = residual;
  }
  clear(&b);
}

// The area in the picture is the mechanical one.
static void the_picture_shows_the_models_area(void **state) {
  (void)state;
  bench b = make();
  for (double push_n = 0; push_n < 3.5; push_n += 1) {
    double at[2];
    sonde_vessel_state v;
    press(&b, "healthy", 0, push_n, at);
    assert_true(sonde_interior_vessel_at_plane(b.interior, 0, b.press.pose, &v));
    print_message("%g N: picture %.3f, model %.3f, artery %.3f\n", push_n, at[0], v.area_ratio,
                  at[1]);
    assert_true(fabs(at[0] - v.area_ratio) < 0.05);
  }
  clear(&b);
}

static void a_shift_moves_the_picture(void **state) {
  (void)state;
  bench b = make();
  update(&b, "healthy", 0, 20);
  sonde_image_pressed(&b.rest, &b.press, &b.pressed, NULL);
  double closed = area(&b.pressed, true);
  // The same picture drawn 4 mm aside and told so.
  b.vein_x += 4e-3, b.artery_x += 4e-3;
  draw_rest(&b);
  b.press.shift_m[0] = 4e-3;
  sonde_image_pressed(&b.rest, &b.press, &b.pressed, NULL);
  assert_true(fabs(area(&b.pressed, true) - closed) < 0.02 * area(&b.rest, true));
  clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_vein_closes_before_the_artery),
      cmocka_unit_test(a_fuller_vein_closes_later),
      cmocka_unit_test(residual_area_grows_with_the_stage),
      cmocka_unit_test(the_picture_shows_the_models_area),
      cmocka_unit_test(a_shift_moves_the_picture),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
