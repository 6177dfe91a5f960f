// Coulomb's friction between probe and skin: its limits are frictionless and bonded contact, a ball
// that is pushed sideways sticks and slips as Cattaneo and Mindlin found, a plate that slips feels
// the coefficient times its load, and what friction takes is lost.
#include "pressing.h"
#include "sanitized.h"
#include "sonde/solid_live.h"

static sonde_equilibrium_result find_at(bench *b, double depth_m, double aside_m) {
  sonde_error error;
  sonde_equilibrium_result r;
  const sonde_pose pose = {vec3(aside_m, 0, -depth_m), {0, 1, 0, 0}};
  check(sonde_equilibrium_find(b->e, pose, &r, &error), &error);
  return r;
}

static void make_punch(bench *b, double friction, bool bonded, double rounding_m) {
  sonde_hexes_def fine = sonde_hexes_def_default();
  fine.half_u_m = fine.half_v_m = 6e-3, fine.edge_m = 3e-3, fine.reach_m = 0.03, fine.muscle = 3;
  sonde_equilibrium_def def = one_material(ogden(3 * kpa, 8, 24));
  def.bonded = bonded, def.friction = friction, def.rounding_m = rounding_m;
  make_bench(b, "rect:12x12", 0.03, &fine, &def);
}

static void between_frictionless_and_bonded(void **state) {
  (void)state;
  // Coefficient; what it is compared with is frictionless or bonded.
  static const double coefficient[2] = {1e-12, 10}, bound[2] = {1e-9, 0.01};
  for (int k = 0; k < 2; ++k) {
    const double rounding = k == 0 ? 2e-3 : 0;
    bench much, end;
    make_punch(&much, coefficient[k], false, rounding);
    make_punch(&end, 0, k == 1, rounding);
    for (int d = 1; d <= 2; ++d) {
      const double got = find(&much, d * 1e-3).force_n.z, want = find(&end, d * 1e-3).force_n.z;
      print_message("coefficient %g at %d mm: %.9f N, %s %.9f (%+.1e)\n", coefficient[k], d, got,
                    k ? "bonded" : "frictionless", want, got / want - 1);
      assert_near(got / want, 1, bound[k]);
    }
    const sonde_vec3 got = find_at(&much, 2e-3, 0.3e-3).force_n;
    const sonde_vec3 want = find_at(&end, 2e-3, 0.3e-3).force_n;
    print_message("  0.3 mm aside: %.6f N, %.6f\n", got.x, want.x);
    if (k == 1) assert_near(got.x / want.x, 1, 0.02);
    drop_bench(&much);
    drop_bench(&end);
  }
}

// A plate over all of a block has no edge to catch: once everything slips it feels the coefficient
// times its load, and what slip takes is that times the way.
static void a_plate_that_slips(void **state) {
  (void)state;
  const double friction = 0.4, way = 1e-3;
  bench b;
  sonde_hexes_def fine = sonde_hexes_def_default();
  fine.half_u_m = fine.half_v_m = 6e-3, fine.edge_m = 6e-3, fine.reach_m = 0.012, fine.muscle = 2;
  sonde_equilibrium_def def = one_material(ogden(3 * kpa, 8, 24));
  def.friction = friction;
  make_bench(&b, "rect:50x50", 0.012, &fine, &def);
  // Sides of the block that would hold the skin under the plate are free.
  (void)find_at(&b, 0.5e-3, 0);
  (void)find_at(&b, 0.5e-3, 12e-3);
  for (int back = 0; back < 2; ++back) {
    const double from = back ? 2e-3 : 12e-3, to = back ? from - way : from + way;
    if (back) (void)find_at(&b, 0.5e-3, from);
    const sonde_equilibrium_result r = find_at(&b, 0.5e-3, to);
    const double most = friction * r.force_n.z;
    print_message("plate %s: %.9f N aside, coefficient times load %.9f, lost %.6f mJ of %.6f\n",
                  back ? "back" : "there", r.force_n.x, most, 1e3 * r.slipped_j, 1e3 * most * way);
    assert_near(r.force_n.x / most, back ? 1 : -1, 1e-6);
    assert_near(r.slipped_j / (most * way), 1, 1e-3);
  }
  drop_bench(&b);
}

// Share of the load on the points that do not slip.
static double sticking(const sonde_equilibrium *e) {
  double all = 0, stuck = 0;
  for (uint32_t n = 0; n < e->zone_faces; ++n) {
    sonde_vec3 rest[4], now[4];
    sonde_equilibrium_zone_face(e, e->moved, NULL, n, rest, now);
    for (int p = 0; p < SONDE_TOUCH_POINTS; ++p) {
      const sonde_stick *stick = &e->stick[SONDE_TOUCH_POINTS * n + (uint32_t)p];
      double shape[4];
      const double load = sonde_touch_point(rest, p, shape) * stick->limit_pa;
      sonde_vec3 x = vec3(0, 0, 0);
      for (int c = 0; c < 4; ++c) x = v_madd(x, shape[c], now[c]);
      const double pull = v_norm(sonde_stick_pull(stick, pose_apply_inverse(e->pose, x)));
      all += load;
      if (pull * e->def.contact_n_m3 < stick->limit_pa * (1 - 1e-6)) stuck += load;
    }
  }
  return stuck / all;
}

// Cattaneo 1938, Mindlin 1949, for a rigid ball on an elastic half space: pushed aside by Q under a
// load P, it sticks within c = a (1 - Q/(f P))^(1/3) of the contact's radius a, where
// 1 - (1 - (c/a)^2)^(3/2) of the load is, and has moved by
// 3 (2 - nu) f P/(16 G a) (1 - (1 - Q/(f P))^(2/3)).
static void a_ball_sticks_and_slips(void **state) {
  NOT_SANITIZED();
  (void)state;
  const double shear = 3 * kpa, bulk = 24, nu = poisson(bulk), friction = 0.3, d = 0.25e-3;
  const double edge = 0.75e-3;
  const sonde_lines side = lines_from_middle(edge, 5, 2, 0.15);
  ball_lines lines = {.v = side, .down = side};
  for (uint32_t k = 0; k < side.count; ++k) {
    lines.u.at[side.count - 1 + k] = side.at[k];
    lines.u.at[side.count - 1 - k] = -side.at[k];
  }
  lines.u.count = 2 * side.count - 1;
  sonde_equilibrium_def def = one_material(ogden(shear, 2, bulk));
  // The pressure of 600 Pa is felt over 6 um, more than the ball's curve takes from a flat face.
  def.zone_m = 1e-3, def.friction = friction, def.contact_n_m3 = 1e8;
  bench b;
  make_ball_bench(&b, 40e-3, &lines, &def);
  // Half of a ball.
  const double load = 2 * find(&b, d).force_n.z, most = friction * load;
  const double radius = sqrt(40e-3 * d);
  const double whole = 3 * (2 - nu) * most / (16 * shear * radius);
  static const double shares[4] = {0.2, 0.45, 0.7, 0.9}; // of the way at which all slips
  for (int k = 0; k < 4; ++k) {
    const double push = -2 * find_at(&b, d, shares[k] * whole).force_n.x;
    const double want = most * (1 - pow(1 - shares[k], 1.5));
    const double stuck = sqrt(1 - pow(1 - sticking(b.e), 2.0 / 3)), inner = sqrt(1 - shares[k]);
    print_message("ball %.0f %% of the way: %.6f N, theory %.6f (%+.1f %%), sticks within %.3f of "
                  "the radius, theory %.3f\n",
                  100 * shares[k], push, want, 100 * (push / want - 1), stuck, inner);
    assert_near(push / want, 1, 0.06);
    assert_near(stuck, inner, 0.12);
  }
  const sonde_equilibrium_result r = find_at(&b, d, 1.5 * whole);
  print_message("all slips: %.6f N, coefficient times load %.6f\n", -r.force_n.x,
                friction * r.force_n.z);
  assert_near(-r.force_n.x / (friction * r.force_n.z), 1, 3e-3);
  assert_near(sticking(b.e), 0, 0);
  drop_bench(&b);
}

// Pressed, pushed aside and withdrawn: the work is never less than what is stored, and the rest is
// what slip has taken, but for the steps of the way.
static void what_friction_takes_is_lost(void **state) {
  (void)state;
  enum { STEPS = 24 };
  bench b;
  make_punch(&b, 0.3, false, 2e-3);
  double work = 0, lost = 0, most = 0, before[2] = {0, 0};
  sonde_vec3 force = vec3(0, 0, 0);
  for (int k = 1; k <= STEPS; ++k) {
    const int way = 3 * (k - 1) / STEPS; // down, aside, up
    const double share = 3.0 * k / STEPS - way;
    const double depth = 2e-3 * (way == 0 ? share : way == 1 ? 1 : 1 - share);
    const double aside = 1.5e-3 * (way == 0 ? 0 : way == 1 ? share : 1);
    const sonde_equilibrium_result r = find_at(&b, depth, aside);
    work += 0.5 * ((force.z + r.force_n.z) * (depth - before[0]) -
                   (force.x + r.force_n.x) * (aside - before[1]));
    lost += r.slipped_j;
    const double stored = r.tissue_j + r.contact_j;
    force = r.force_n, before[0] = depth, before[1] = aside;
    assert_true(r.slipped_j >= 0);
    assert_true(work >= 0.99 * stored);
    if (k % 8 == 0)
      print_message("step %d: work %.5f mJ, stored %.5f, lost %.5f\n", k, 1e3 * work, 1e3 * stored,
                    1e3 * lost);
    most = fmax(most, work);
    assert_near(stored + lost, work, 0.025 * most);
  }
  drop_bench(&b);
}

static void bad_coefficients_are_refused(void **state) {
  (void)state;
  static const double bad[4] = {-0.1, NAN, 10.1, INFINITY};
  bench b;
  make_punch(&b, 0.3, false, 0);
  for (int k = 0; k < 6; ++k) {
    sonde_error error;
    sonde_equilibrium *e = NULL;
    sonde_equilibrium_def def = sonde_equilibrium_def_default();
    def.friction = k < 4 ? bad[k] : 0.3, def.bonded = k == 4;
    if (k < 5) {
      assert_int_equal(sonde_equilibrium_create(&b.mesh, &b.probe, above(0), &def, &e, &error),
                       SONDE_ARGUMENT);
    } else { // what follows at 1 kHz slides
      sonde_solid_live *live = NULL;
      sonde_solid_live_def how = sonde_solid_live_def_default();
      how.solid = def;
      assert_int_equal(sonde_solid_live_create(&b.mesh, &b.probe, above(0), &how, &live, &error),
                       SONDE_ARGUMENT);
    }
    assert_non_null(strstr(error.message, "friction"));
    assert_null(e);
  }
  drop_bench(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(between_frictionless_and_bonded),
      cmocka_unit_test(a_plate_that_slips),
      cmocka_unit_test(a_ball_sticks_and_slips),
      cmocka_unit_test(what_friction_takes_is_lost),
      cmocka_unit_test(bad_coefficients_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
