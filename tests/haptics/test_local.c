// The local model beside the scene that it stands for.
#include "test.h"

#include "sonde/haptics_local.h"

static const double dt_s = 1e-3;

// Force of eq. (1) with a damper on a probe pressed along -z, and a spring across.
static sonde_vec3 scene(sonde_vec3 at, sonde_vec3 speed) {
  double depth = -at.z;
  if (depth <= 0.0) return vec3(0, 0, 0);
  double along = 400.0 * depth / (1.0 - depth / 0.05) - 6.0 * speed.z;
  return vec3(-200.0 * at.x, 0, fmax(along, 0.0));
}

// Pressed to 20 mm, held, rocked, released: smooth in position and velocity.
static sonde_vec3 path(double time_s) {
  double press = 0.5 - 0.5 * cos(SONDE_PI * fmin(time_s / 0.5, 1.0));
  double rock = time_s > 0.8 ? 0.003 * (1.0 - cos(8.0 * (time_s - 0.8))) : 0.0;
  return vec3(time_s > 0.8 ? 0.002 * sin(8.0 * (time_s - 0.8)) : 0.0, 0,
              0.001 - 0.021 * press + rock);
}

typedef struct comparison {
  double worst_n, largest_n; // error, force
  double jump_n;             // largest step of the model beyond that of the scene, at an answer
  double swing_local, swing_held; // energy of the differences between ticks beyond the scene's
} comparison;

static comparison follow(int period, int late) {
  sonde_local_def def = sonde_local_def_default();
  def.period_s = period * dt_s;
  sonde_local local;
  sonde_local_init(&local, &def);
  comparison c = {0};
  sonde_vec3 held = vec3(0, 0, 0), before = held, model_before = held, held_before = held;
  for (int tick = 0; tick < 2000; ++tick) {
    double t = tick * dt_s, then = t - late * dt_s;
    sonde_vec3 at = path(t), truth = scene(at, v_scale(v_sub(path(t), path(t - 1e-6)), 1e6));
    bool answered = tick >= late && (tick - late) % period == 0;
    if (answered) {
      sonde_vec3 speed = v_scale(v_sub(path(then), path(then - 1e-6)), 1e6);
      held = scene(path(then), speed);
      sonde_local_feed(&local, path(then), speed, held);
    }
    sonde_vec3 model = sonde_local_force(&local, at);
    c.worst_n = fmax(c.worst_n, v_distance(model, truth));
    c.largest_n = fmax(c.largest_n, v_norm(truth));
    double step = v_distance(model, model_before), true_step = v_distance(truth, before);
    if (answered) c.jump_n = fmax(c.jump_n, step - true_step);
    sonde_vec3 change = v_sub(truth, before);
    c.swing_local += v_norm2(v_sub(v_sub(model, model_before), change));
    c.swing_held += v_norm2(v_sub(v_sub(held, held_before), change));
    before = truth;
    model_before = model;
    held_before = held;
  }
  return c;
}

static void follows_a_scene_of_100_hz(void **state) {
  (void)state;
  comparison c = follow(10, 10);
  print_message("100 Hz: error %.3f of %.1f N, jump %.3f N, %.1f dB\n", c.worst_n, c.largest_n,
                c.jump_n, 10 * log10(c.swing_held / c.swing_local));
  assert_true(c.worst_n < 0.05 * c.largest_n);
  assert_true(c.jump_n < 0.1);
  assert_true(c.swing_held > 100.0 * c.swing_local); // 20 dB
}

static void slower_scenes_cost_more(void **state) {
  (void)state;
  comparison fast = follow(3, 3), middle = follow(10, 10), slow = follow(33, 33);
  assert_true(fast.worst_n < middle.worst_n && middle.worst_n < slow.worst_n);
  assert_true(slow.worst_n < 0.25 * slow.largest_n && slow.jump_n < 0.1);
}

// Three answers of eq. (1) itself at rest: the increment bends as it does; the measured slope lags
// a little.
static void increment_is_that_of_eq_1(void **state) {
  (void)state;
  sonde_local local;
  sonde_local_init(&local, NULL);
  sonde_vec3 none = vec3(0, 0, 0);
  for (int i = -1; i <= 4000; ++i) { // slowly, so that the secant is the tangent
    sonde_vec3 at = vec3(0, 0, -5e-6 * i);
    sonde_local_force(&local, at);
    if (i % 50 == 0) sonde_local_feed(&local, at, none, scene(at, none));
  }
  for (int i = 0; i < 105; ++i) { // held, until nothing is left to blend
    if (i % 10 == 0 && i < 100)
      sonde_local_feed(&local, vec3(0, 0, -0.02), none, scene(vec3(0, 0, -0.02), none));
    sonde_local_force(&local, vec3(0, 0, -0.02));
  }
  sonde_vec3 deeper = vec3(0, 0, -0.024);
  sonde_local_force(&local, deeper);
  local.velocity_m_s = none; // at rest there
  local.last_m = deeper;
  sonde_vec3 model = sonde_local_force(&local, deeper);
  double truth = scene(deeper, none).z, straight = scene(vec3(0, 0, -0.02), none).z;
  straight += local.stiffness_n_m * 0.004;
  print_message("at 4 mm more: %.3f N, eq. (1) %.3f N, straight %.3f N\n", model.z, truth,
                straight);
  assert_true(fabs(model.z - truth) < 0.33 * fabs(straight - truth));
}

static void silence_fades(void **state) {
  (void)state;
  sonde_local local;
  sonde_local_init(&local, NULL);
  sonde_vec3 at = vec3(0, 0, -0.01), none = vec3(0, 0, 0);
  for (int tick = 0; tick < 100; ++tick) {
    if (tick % 10 == 0) sonde_local_feed(&local, at, none, vec3(0, 0, 5));
    sonde_local_force(&local, at);
  }
  double last = 5.0;
  for (int tick = 0; tick < 120; ++tick) {
    double now = sonde_local_force(&local, at).z;
    assert_true(now <= last + 1e-12);
    if (tick < 9) assert_true(fabs(now - 5.0) < 1e-6);
    last = now;
  }
  assert_true(last < 0.05);
}

static void nonsense_is_ignored(void **state) {
  (void)state;
  sonde_local local;
  sonde_local_init(&local, &(sonde_local_def){
                               .version = SONDE_DEF_VERSION, .dt_s = -1, .period_s = (double)NAN});
  assert_true(fabs(local.def.dt_s - 1e-3) < 1e-15 && fabs(local.def.period_s - 1e-2) < 1e-15);
  sonde_vec3 at = vec3(0, 0, -0.01), none = vec3(0, 0, 0);
  assert_true(v_norm(sonde_local_force(&local, at)) <= 0.0); // nothing known yet
  sonde_local_feed(&local, at, none, vec3(0, 0, 5));
  sonde_local_feed(&local, vec3((double)NAN, 0, 0), none, vec3(0, 0, 5));
  sonde_local_feed(&local, at, none, vec3(0, (double)INFINITY, 0));
  assert_int_equal(local.answers, 1);
  assert_true(v_finite(sonde_local_force(&local, at)));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(follows_a_scene_of_100_hz), cmocka_unit_test(slower_scenes_cost_more),
      cmocka_unit_test(increment_is_that_of_eq_1), cmocka_unit_test(silence_fades),
      cmocka_unit_test(nonsense_is_ignored),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
