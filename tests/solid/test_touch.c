// Contact of a face with a probe: forces and stiffness are derivatives of one energy, depths are
// exact distances, and a probe that contains another is never shallower.
#include "fixture.h"
#include "solid/touch.h"

typedef struct shape {
  sonde_probe probe;
  sonde_touch_shape touch;
} shape;

static void make(shape *s, const char *name, double rounding_m) {
  sonde_error error;
  assert_int_equal(sonde_probe_create(name, &s->probe, &error), SONDE_OK);
  s->touch = (sonde_touch_shape){.probe = &s->probe, .rounding_m = rounding_m};
  assert_int_equal(sonde_surface_index_create(&s->probe.body.hull, &s->touch.hull, &error),
                   SONDE_OK);
}

static void drop(shape *s) {
  sonde_surface_index_destroy(s->touch.hull);
  sonde_probe_clear(&s->probe);
}

static sonde_vec3 random_point(uint64_t *seed, double size) {
  double x[3];
  for (int k = 0; k < 3; ++k) {
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    x[k] = size * ((double)(*seed >> 11) / 9007199254740992.0 - 0.5);
  }
  return vec3(x[0], x[1], x[2]);
}

// Depth and way out of a rounded box in closed form.
static double box_depth(sonde_vec3 p, double a, double b, double r) {
  double x = fabs(p.x) - a, y = fabs(p.y) - b, z = p.z + r;
  if (x < 0 && y < 0 && z < 0) return r - fmax(x, fmax(y, z));
  return r - v_norm(vec3(fmax(x, 0), fmax(y, 0), fmax(z, 0)));
}

static void depth_is_the_distance_to_the_surface(void **state) {
  (void)state;
  shape box, ball;
  make(&box, "linear", 3e-3);
  make(&ball, "ball:15", 0);
  uint64_t seed = 3;
  int inside = 0;
  for (int n = 0; n < 4000; ++n) {
    sonde_vec3 p = random_point(&seed, 0.08), out;
    p.y *= 0.3, p.z = 0.25 * p.z - 5e-3;
    double depth = 0;
    sonde_mat3 bend;
    bool in = sonde_touch_depth(&box.touch, p, 0, &depth, &out, &bend);
    double want = box_depth(p, 30e-3, 6e-3, 3e-3);
    if (fabs(want) < 1e-9) continue;
    assert_int_equal(in, want > 0);
    inside += in;
    if (in) assert_near(depth, want, 1e-12);
    if (in) assert_near(v_norm(out), 1, 1e-12);
    in = sonde_touch_depth(&ball.touch, p, 0, &depth, &out, &bend);
    want = 15e-3 - v_norm(vec3(p.x, p.y, p.z + 15e-3));
    assert_int_equal(in, want > 0);
    if (in) assert_near(depth, want, 1e-12);
  }
  assert_true(inside > 500);
  drop(&box);
  drop(&ball);
}

static void a_containing_probe_is_never_shallower(void **state) {
  (void)state;
  shape small, wide, round;
  make(&small, "rect:40x10", 0);
  make(&wide, "linear", 0);
  make(&round, "linear", 3e-3);
  uint64_t seed = 11;
  for (int n = 0; n < 4000; ++n) {
    sonde_vec3 p = random_point(&seed, 0.07), out;
    p.y *= 0.3, p.z = 0.3 * p.z - 5e-3;
    double a = 0, b = 0;
    sonde_mat3 bend;
    if (!sonde_touch_depth(&small.touch, p, 0, &a, &out, &bend)) continue;
    assert_true(sonde_touch_depth(&wide.touch, p, 0, &b, &out, &bend));
    assert_true(b >= a - 1e-15);
    double c = 0;
    (void)sonde_touch_depth(&round.touch, p, 0, &c, &out, &bend);
    assert_true(c >= a - 1e-15);
  }
  drop(&small);
  drop(&wide);
  drop(&round);
}

static double *coordinate(sonde_vec3 *p, int k) {
  return k % 3 == 0 ? &p[k / 3].x : k % 3 == 1 ? &p[k / 3].y : &p[k / 3].z;
}

static void forces_and_stiffness_match_differences(void **state) {
  (void)state;
  static const char *const names[4] = {"linear", "rect:2x2", "ball:5", "ball:5"};
  static const double rounding[4] = {0, 3e-3, 0, 0};
  for (int kind = 0; kind < 4; ++kind) {
    shape s;
    make(&s, names[kind], rounding[kind]);
    const sonde_pose pose = {vec3(0.3e-3, -0.2e-3, 0),
                             q_unit((sonde_quat){0.99, 0.05, -0.02, 0.1})};
    sonde_vec3 rest[4] = {
        {-1.5e-3, -1e-3, 0}, {1.2e-3, -1.1e-3, 0}, {1e-3, 1.3e-3, 0}, {-1.3e-3, 1e-3, 0}};
    sonde_vec3 now[4];
    for (int c = 0; c < 4; ++c) now[c] = v_add(rest[c], vec3(0, 1e-4 * c, -1.1e-3));
    sonde_stick sticks[SONDE_TOUCH_POINTS], *stick = kind == 3 ? sticks : NULL;
    for (int p = 0; p < SONDE_TOUCH_POINTS; ++p) { // some stick, some slip, one is free
      const sonde_vec3 out = v_unit(vec3(0.1, 0.02 * p, 1), vec3(0, 0, 1));
      const sonde_vec3 foothold = pose_apply_inverse(pose, v_madd(rest[p % 4], 0.1 * p, rest[2]));
      sticks[p] = (sonde_stick){.foothold = foothold, .out = out, .limit_pa = 4e5 * p};
    }
    double f[12], fp[12], fm[12], k[12][12], worst_f = 0, worst_k = 0, most_f = 0, most_k = 0;
    sonde_touch sum = {0};
    assert_true(sonde_touch_face(&s.touch, pose, 1e9, stick, rest, now, true, &sum, f, k));
    for (int j = 0; j < 12; ++j) {
      const double h = 1e-9;
      double *x = coordinate(now, j), keep = *x;
      sonde_touch plus = {0}, minus = {0};
      *x = keep + h;
      assert_true(sonde_touch_face(&s.touch, pose, 1e9, stick, rest, now, true, &plus, fp, NULL));
      *x = keep - h;
      assert_true(sonde_touch_face(&s.touch, pose, 1e9, stick, rest, now, true, &minus, fm, NULL));
      *x = keep;
      worst_f = fmax(worst_f, fabs((plus.energy_j - minus.energy_j) / (2 * h) + f[j]));
      most_f = fmax(most_f, fabs(f[j]));
      for (int i = 0; i < 12; ++i) {
        worst_k = fmax(worst_k, fabs((fp[i] - fm[i]) / (2 * h) + k[i][j]));
        most_k = fmax(most_k, fabs(k[i][j]));
      }
    }
    print_message("%s: force off by %.1e, stiffness by %.1e\n", names[kind], worst_f / most_f,
                  worst_k / most_k);
    assert_true(worst_f <= 1e-6 * most_f);
    assert_true(worst_k <= 1e-6 * most_k);
    drop(&s);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(depth_is_the_distance_to_the_surface),
      cmocka_unit_test(a_containing_probe_is_never_shallower),
      cmocka_unit_test(forces_and_stiffness_match_differences),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
