// A live solid: it ends at the equilibrium, its forces follow from poses and ticks alone, a press
// out and back gives and costs nothing, and no pass leaves an element turned inside out.
#include "fixture.h"
#include "solid/live.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stddef.h>
#include <string.h>

typedef struct rig {
  sonde_hexes mesh;
  sonde_probe probe;
  sonde_pose start;
  sonde_solid_live_def def;
  sonde_solid_live *live;
} rig;

static void check(sonde_status status, const sonde_error *error) {
  if (status) fail_msg("%s", error->message);
}

// A block of three layers under a rounded probe whose way is along -z. The state follows the probe
// by at most pass_m in a pass.
static void set_up(rig *r, double pass_m) {
  sonde_error error;
  sonde_hexes_def fine = sonde_hexes_def_default();
  fine.half_u_m = 10e-3, fine.half_v_m = 5e-3, fine.reach_m = 60e-3, fine.growth = 2;
  fine.muscle = 2, fine.fat = 1;
  *r = (rig){.start = {.position = {0, 1e-3, 0}, .rotation = {0, 1, 0, 0}},
             .def = sonde_solid_live_def_default()};
  check(sonde_hexes_block(40e-3, 2e-3, 8e-3, &fine, &r->mesh, &error), &error);
  check(sonde_probe_create("rect:20x10", &r->probe, &error), &error);
  r->def.solid.rounding_m = 2e-3;
  r->def.pass_m = pass_m, r->def.lag_m = 2 * pass_m;
  check(sonde_solid_live_create(&r->mesh, &r->probe, r->start, &r->def, &r->live, &error), &error);
}

static void tear_down(rig *r) {
  sonde_solid_live_destroy(r->live);
  sonde_probe_clear(&r->probe);
  sonde_hexes_clear(&r->mesh);
}

static sonde_pose deep(const rig *r, double depth_m, double aside_m) {
  sonde_pose pose = r->start;
  pose.position.x += aside_m, pose.position.z -= depth_m;
  return pose;
}

static sonde_vec3 step(rig *r, double depth_m, double aside_m) {
  sonde_solid_contact contact;
  sonde_solid_live_tick(r->live, deep(r, depth_m, aside_m), &contact);
  (void)sonde_solid_live_work(r->live);
  return contact.force_n;
}

// From depth to depth at a speed; returns the work of the probe, J, and the last force.
static double press(rig *r, double from_m, double to_m, double speed_m_s, sonde_vec3 *force) {
  const int ticks = (int)(fabs(to_m - from_m) / speed_m_s * 1e3 + 0.5);
  double work = 0;
  for (int t = 1; t <= ticks; ++t) {
    *force = step(r, from_m + (to_m - from_m) * t / ticks, 0);
    work += force->z * (to_m - from_m) / ticks;
  }
  return work;
}

static void a_held_pose_ends_at_the_equilibrium(void **state) {
  (void)state;
  sonde_error error;
  sonde_equilibrium_result result;
  sonde_equilibrium *exact;
  rig r;
  set_up(&r, 3e-3);
  check(sonde_equilibrium_create(&r.mesh, &r.probe, r.start, &r.def.solid, &exact, &error), &error);
  sonde_vec3 force;
  for (int turn = 0; turn < 2; ++turn) { // pressed to 6 mm, then released to 3 mm, and moved aside
    const double depth = turn ? 3e-3 : 6e-3, aside = turn ? 2e-3 : 0;
    (void)press(&r, turn ? 6e-3 : 0, depth, 0.04, &force);
    for (int t = 0; t < 200; ++t) force = step(&r, depth, aside);
    check(sonde_equilibrium_find(exact, deep(&r, depth, aside), &result, &error), &error);
    assert_near(v_distance(force, result.force_n) / v_norm(result.force_n), 0, 5e-4);
    // From there on passes have nothing to do.
    const uint32_t steps = sonde_solid_live_count(r.live).skin_steps;
    for (int t = 0; t < 100; ++t) force = step(&r, depth, aside);
    assert_int_equal(sonde_solid_live_count(r.live).skin_steps, steps);
    assert_near(v_distance(force, result.force_n) / v_norm(result.force_n), 0, 5e-4);
  }
  assert_true(sonde_solid_live_count(r.live).factors >= 2);
  sonde_equilibrium_destroy(exact);
  tear_down(&r);
}

typedef enum worker { AT_ONCE, AS_LATE_AS_IT_MAY, ON_A_THREAD } worker;
typedef struct hand {
  sonde_solid_live *live;
  atomic_bool over;
} hand;

static void *work_on(void *user) {
  hand *h = user;
  while (!atomic_load(&h->over))
    if (!sonde_solid_live_work(h->live)) sched_yield();
  return NULL;
}

// Presses, slides and lets go.
static void run_script(worker kind, sonde_vec3 force[400], sonde_solid_live_counts *counts) {
  rig r;
  set_up(&r, 3e-3);
  hand h = {.live = r.live};
  pthread_t thread;
  if (kind == ON_A_THREAD) assert_int_equal(pthread_create(&thread, NULL, work_on, &h), 0);
  for (int t = 0; t < 400; ++t) {
    sonde_solid_contact contact;
    const double depth = 5e-3 * sin(SONDE_PI * t / 400), aside = t > 150 ? 1e-5 * (t - 150) : 0;
    const int tick = t % (int)r.def.pass_ticks;
    // A machine that is busy may be late, which is another test.
    while (kind == ON_A_THREAD && tick == 0 &&
           atomic_load(&r.live->done) != atomic_load(&r.live->asked))
      sched_yield();
    sonde_solid_live_tick(r.live, deep(&r, depth, aside), &contact);
    if (kind == AT_ONCE || (kind == AS_LATE_AS_IT_MAY && tick == (int)r.def.pass_ticks - 1))
      (void)sonde_solid_live_work(r.live);
    force[t] = contact.force_n;
  }
  while (atomic_load(&r.live->done) != atomic_load(&r.live->asked)) sched_yield();
  atomic_store(&h.over, true);
  if (kind == ON_A_THREAD) assert_int_equal(pthread_join(thread, NULL), 0);
  *counts = sonde_solid_live_count(r.live);
  tear_down(&r);
}

static void forces_follow_from_poses_and_ticks(void **state) {
  (void)state;
  sonde_vec3 one[400], other[400];
  sonde_solid_live_counts counts[2];
  run_script(AT_ONCE, one, &counts[0]);
  for (worker kind = AS_LATE_AS_IT_MAY; kind <= ON_A_THREAD; ++kind) {
    run_script(kind, other, &counts[1]);
    assert_memory_equal(one, other, sizeof one);
    // Bytes behind the last member are anything.
    assert_memory_equal(&counts[0], &counts[1],
                        offsetof(sonde_solid_live_counts, late) + sizeof counts[0].late);
  }
  assert_int_equal(counts[0].late, 0);
  assert_int_equal(counts[0].passes, 20);
  assert_true(v_norm(one[200]) > 0.3);
}

static void a_pass_that_is_not_done_is_counted(void **state) {
  (void)state;
  rig r;
  set_up(&r, 3e-3);
  sonde_solid_contact contact;
  for (int t = 0; t < 45; ++t) sonde_solid_live_tick(r.live, deep(&r, 1e-3, 0), &contact);
  assert_int_equal(sonde_solid_live_count(r.live).late, 2); // at ticks 20 and 40
  assert_true(sonde_solid_live_work(r.live));
  assert_false(sonde_solid_live_work(r.live)); // there is one only
  tear_down(&r);
}

static void a_press_out_and_back_costs_nothing(void **state) {
  (void)state;
  rig r;
  set_up(&r, 3e-3);
  sonde_vec3 force;
  const double in = press(&r, -1e-3, 5e-3, 0.02, &force), top = force.z;
  const double out = press(&r, 5e-3, -1e-3, 0.02, &force);
  assert_true(top > 0.5 && in > 1e-3);
  assert_near((in + out) / in, 0, 0.02);
  assert_near(v_norm(force), 0, 0);
  // The solid itself comes to rest.
  for (int t = 0; t < 200; ++t) force = step(&r, -1e-3, 0);
  const sonde_vec3 *moved = sonde_solid_live_state(r.live);
  double most = 0;
  for (uint32_t n = 0; n < r.mesh.node_count; ++n) most = fmax(most, v_norm(moved[n]));
  assert_near(most, 0, 1e-6);
  tear_down(&r);
}

static bool is_whole(const rig *r) {
  double energy = 0;
  double *force = calloc(3 * (size_t)r->live->e->unknown_count, sizeof *force);
  const bool whole = sonde_equilibrium_add_forces(r->live->e, NULL, r->mesh.count,
                                                  sonde_solid_live_state(r->live), &energy, force);
  free(force);
  return whole && isfinite(energy);
}

// The force 3 mm deep: pressed from outside, and held.
static double hold(rig *r) {
  sonde_vec3 force;
  (void)press(r, -2e-3, 3e-3, 0.04, &force);
  for (int t = 0; t < 200; ++t) force = step(r, 3e-3, 0);
  return force.z;
}

// Pokes far beyond what a hand does, and a step of the bulk that is far too long: no state that is
// shown has an element inside out, what has been lost is found again, and the hand that holds still
// feels none of it at once.
static void no_pass_turns_an_element_inside_out(void **state) {
  (void)state;
  rig r;
  set_up(&r, 50e-3); // so that steps are taken that are too long
  sonde_vec3 last = vec3(0, 0, 0);
  double change = 0, place = 0;
  for (int t = 0; t < 600; ++t) {
    const double depth = t / 100 % 2 ? 25e-3 : 0, aside = 2e-3 * (t / 37 % 7 - 3);
    const sonde_vec3 force = step(&r, depth, aside);
    assert_true(v_finite(force));
    if (place == depth + aside && v_norm(force) > 0) change = fmax(change, v_distance(force, last));
    last = force, place = depth + aside;
    assert_true(t % 20 || is_whole(&r));
  }
  assert_near(change, 1e-3 * r.def.ease_n_s, 1e-9); // what has been lost is eased out
  assert_true(sonde_solid_live_count(r.live).returns > 0);
  r.live->def.pass_m = 3e-3, r.live->def.lag_m = 6e-3;
  for (int t = 0; t < 200; ++t) (void)step(&r, -2e-3, 0);
  rig fresh;
  set_up(&fresh, 3e-3);
  const double force = hold(&fresh);
  assert_true(force > 0.5);
  assert_near(hold(&r) / force, 1, 1e-3);
  tear_down(&fresh);
  const uint32_t shortened = sonde_solid_live_count(r.live).shortened;
  for (uint32_t k = 0; k < 3 * sonde_patch_first(r.live->e); ++k) r.live->e->step[k] = 100 * sin(k);
  (void)sonde_live_follow(r.live, deep(&r, 4e-3, 0));
  assert_int_equal(sonde_solid_live_count(r.live).shortened, shortened + 1);
  assert_true(is_whole(&r));
  tear_down(&r);
}

// On the thigh 22 mm deep, slid along and across at 20 mm/s: the skin beside the rounded edge snaps
// past it, and the state that has lost its balance there comes again from rest. On the way out the
// force is the equilibrium's.
static void a_snap_is_followed(void **state) {
  (void)state;
  const struct {
    double down_m, across_m, along_m;
  } way[] = {{0, 0, 0},        {22e-3, 0, 0}, {22e-3, 6e-3, 0}, {22e-3, 0, 0},
             {22e-3, 0, 6e-3}, {22e-3, 0, 0}, {1e-3, 0, 0}};
  sonde_error error;
  sonde_model *model = bundled_thigh();
  sonde_equilibrium_result result;
  sonde_equilibrium *exact;
  sonde_hexes_def coarse = sonde_hexes_def_default();
  rig r = {.def = sonde_solid_live_def_default()};
  r.def.solid.rounding_m = 3e-3;
  check(sonde_probe_create("linear", &r.probe, &error), &error);
  const sonde_site *site = sonde_model_site(model, 19);
  coarse.edge_m = 10e-3, coarse.half_u_m = r.probe.half_x_m, coarse.half_v_m = r.probe.half_y_m;
  check(sonde_hexes_ring(model, site, &coarse, &r.mesh, &error), &error);
  r.start = sonde_site_pose(site, 0);
  check(sonde_solid_live_create(&r.mesh, &r.probe, r.start, &r.def, &r.live, &error), &error);
  check(sonde_equilibrium_create(&r.mesh, &r.probe, r.start, &r.def.solid, &exact, &error), &error);
  double most = 0;
  for (size_t part = 1; part < SONDE_COUNT_OF(way); ++part) {
    const double down = way[part].down_m - way[part - 1].down_m;
    const double across = way[part].across_m - way[part - 1].across_m;
    const double along = way[part].along_m - way[part - 1].along_m;
    const int ticks = (int)((fabs(down) + fabs(across) + fabs(along)) / 20e-3 * 1e3 + 0.5);
    for (int t = 1; t <= ticks + 100; ++t) {
      const double left = t < ticks ? 1 - (double)t / ticks : 0;
      const sonde_vec3 shift = q_rotate(r.start.rotation, vec3(way[part].across_m - left * across,
                                                               way[part].along_m - left * along,
                                                               way[part].down_m - left * down));
      const sonde_pose pose = {v_add(r.start.position, shift), r.start.rotation};
      sonde_solid_contact contact;
      sonde_solid_live_tick(r.live, pose, &contact);
      (void)sonde_solid_live_work(r.live);
      if (part + 1 < SONDE_COUNT_OF(way) || t % 50 || t > ticks || left * 21e-3 < 2e-3) continue;
      check(sonde_equilibrium_find(exact, pose, &result, &error), &error);
      const double force = v_dot(contact.force_n, site->normal);
      most = fmax(most, fabs(force / v_dot(result.force_n, site->normal) - 1));
    }
  }
  assert_true(most < 0.03);
  assert_true(sonde_solid_live_count(r.live).returns > 0);
  sonde_equilibrium_destroy(exact);
  tear_down(&r);
  sonde_model_destroy(model);
}

static void bad_definitions_are_refused(void **state) {
  (void)state;
  rig r;
  set_up(&r, 3e-3);
  sonde_error error;
  for (int k = 0; k < 4; ++k) {
    sonde_solid_live_def def = r.def;
    sonde_solid_live *live = r.live;
    if (k == 0) def.version = 0;
    if (k == 1) def.solid.bonded = true;
    if (k == 2) def.lag_m = def.refresh_m / 2;
    if (k == 3) def.solid.layer[SONDE_SOLID_FAT].shear_pa = -1;
    assert_int_equal(sonde_solid_live_create(&r.mesh, &r.probe, r.start, &def, &live, &error),
                     SONDE_ARGUMENT);
    assert_null(live);
  }
  tear_down(&r);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_held_pose_ends_at_the_equilibrium),
      cmocka_unit_test(forces_follow_from_poses_and_ticks),
      cmocka_unit_test(a_pass_that_is_not_done_is_counted),
      cmocka_unit_test(a_press_out_and_back_costs_nothing),
      cmocka_unit_test(no_pass_turns_an_element_inside_out),
      cmocka_unit_test(a_snap_is_followed),
      cmocka_unit_test(bad_definitions_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
