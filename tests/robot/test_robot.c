// The virtual robot: stop rules, sensors, probes, cancelling, what it refuses.
#include "fit/fit_thigh.h"

#include "sonde/robot.h"

// Keeps the first sites of the table.
static sonde_site_table first_sites(const bundled *b, uint32_t count) {
  return (sonde_site_table){.count = count, .sites = b->sites.sites};
}

static sonde_robot_def quick_robot(void) {
  sonde_robot_def def = sonde_robot_def_default();
  def.probe = "point";
  def.step_m = 4e-3;
  def.limit_n = 2.0;
  def.depth_limit_m = 20e-3;
  def.relative_residual = 1e-5;
  return def;
}

static sonde_measurements run(const bundled *b, const sonde_site_table *sites,
                              const sonde_robot_def *def, sonde_robot_log *log) {
  sonde_measurements m;
  sonde_error error = {0};
  assert_ok(sonde_robot_run(b->model, sites, def, NULL, &m, log, &error), &error);
  return m;
}

// At most the last row of a site is above the limit, and it is the first that can be.
static void stops_one_step_after_the_limit(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 3);
  sonde_robot_def def = quick_robot();
  def.limit_n = 0.4;
  uint32_t by_force = 0, row = 0;
  sonde_robot_log log;
  sonde_measurements m = run(&b, &sites, &def, &log);
  assert_int_equal(log.count, 3);
  for (uint32_t i = 0; i < m.count; ++i) {
    bool last = i + 1 == m.count || m.data[i + 1].site != m.data[i].site;
    assert_true(last || m.data[i].force_n <= def.limit_n);
    if (i && m.data[i].site == m.data[i - 1].site)
      assert_near(m.data[i].penetration_m - m.data[i - 1].penetration_m, 4e-3, 1e-12);
  }
  for (uint32_t k = 0; k < log.count; ++k) {
    const sonde_robot_visit *visit = &log.visits[k];
    row += visit->rows;
    const sonde_datum *last = &m.data[row - 1];
    assert_int_equal(last->site, visit->site);
    assert_near(last->force_n, visit->force_n, 0);
    assert_near(last->penetration_m, visit->depth_m, 0);
    bool above = last->force_n > def.limit_n;
    assert_int_equal(visit->end, above ? SONDE_ROBOT_FORCE_LIMIT : SONDE_ROBOT_DEPTH_LIMIT);
    assert_true(above || visit->depth_m > def.depth_limit_m - 1e-9);
    by_force += above;
  }
  assert_int_equal(row, m.count);
  assert_true(by_force >= 2);
  def.threads = 1;
  sonde_measurements again = run(&b, &sites, &def, NULL);
  assert_int_equal(again.count, m.count);
  for (uint32_t i = 0; i < m.count; ++i) assert_near(again.data[i].force_n, m.data[i].force_n, 0);
  sonde_measurements_clear(&m);
  sonde_measurements_clear(&again);
  sonde_robot_log_clear(&log);
  bundled_clear(&b);
}

// A sensor that reads too little does not let the robot press on: the limit lies just below the
// true force of the third step, where about every second reading is below it.
static void noise_does_not_pass_the_limit(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 1);
  sonde_robot_def def = quick_robot();
  sonde_measurements truth = run(&b, &sites, &def, NULL);
  assert_true(truth.count > 3);
  def.limit_n = truth.data[2].force_n - 1e-3;
  def.noise_force_n = 0.05 * (truth.data[2].force_n - truth.data[1].force_n);
  uint32_t low = 0;
  for (def.seed = 0; def.seed < 6; ++def.seed) {
    sonde_robot_log log;
    sonde_measurements m = run(&b, &sites, &def, &log);
    assert_int_equal(m.count, 3);
    assert_int_equal(log.visits[0].end, SONDE_ROBOT_FORCE_LIMIT);
    low += m.data[2].force_n < def.limit_n;
    sonde_measurements_clear(&m);
    sonde_robot_log_clear(&log);
  }
  assert_true(low > 0);
  // Nor does one that reads too much.
  def.noise_force_n = 0.3;
  sonde_measurements m = run(&b, &sites, &def, NULL);
  for (uint32_t i = 0; i + 1 < m.count; ++i) assert_true(m.data[i].force_n <= def.limit_n);
  sonde_measurements_clear(&m);
  sonde_measurements_clear(&truth);
  bundled_clear(&b);
}

// What the robot measures, the full prediction gives back.
static void agrees_with_full_prediction(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 1);
  sonde_robot_def def = quick_robot();
  def.probe = "rect:24x12";
  def.relative_residual = 1e-9;
  sonde_measurements m = run(&b, &sites, &def, NULL);
  double *predicted = SONDE_NEW(double, m.count);
  sonde_predict_def predict = sonde_predict_def_default();
  predict.interaction = SONDE_INTERACTION_FULL;
  predict.relative_residual = 1e-9;
  sonde_error error;
  assert_ok(sonde_predict(b.model, &sites, &m, &predict, NULL, predicted, &error), &error);
  for (uint32_t i = 0; i < m.count; ++i) assert_near(predicted[i], m.data[i].force_n, 1e-12);
  sonde_free(predicted);
  sonde_measurements_clear(&m);
  bundled_clear(&b);
}

static void noise_depends_on_the_seed_only(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 2);
  sonde_robot_def def = quick_robot();
  def.limit_n = 1e3;
  def.depth_limit_m = 8e-3;
  sonde_measurements m[4];
  for (int k = 0; k < 4; ++k) {
    def.noise_force_n = k ? 0.1 : 0.0;
    def.noise_penetration_m = k ? 1e-4 : 0.0;
    def.seed = k == 3 ? 8 : 7;
    def.threads = k == 2 ? 1 : 2;
    m[k] = run(&b, &sites, &def, NULL);
    assert_int_equal(m[k].count, 4);
  }
  for (uint32_t i = 0; i < 4; ++i) {
    double error_n = m[1].data[i].force_n - m[0].data[i].force_n;
    double error_m = m[1].data[i].penetration_m - m[0].data[i].penetration_m;
    assert_true(error_n != 0 && fabs(error_n) < 0.6 && error_m != 0 && fabs(error_m) < 6e-4);
    assert_near(m[1].data[i].force_n, m[2].data[i].force_n, 0);
    assert_true(fabs(m[1].data[i].force_n - m[3].data[i].force_n) > 0);
  }
  for (int k = 0; k < 4; ++k) sonde_measurements_clear(&m[k]);
  bundled_clear(&b);
}

// Readings are multiples of the quanta, the nearest to those without quantisation.
static void quantises_after_the_noise(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 2);
  sonde_robot_def def = quick_robot();
  def.limit_n = 1e3;
  def.noise_force_n = 0.1;
  def.noise_penetration_m = 1e-4;
  sonde_measurements fine = run(&b, &sites, &def, NULL);
  def.quantum_force_n = 0.05;
  def.quantum_penetration_m = 1e-4;
  sonde_measurements coarse = run(&b, &sites, &def, NULL);
  assert_int_equal(fine.count, coarse.count);
  uint32_t changed = 0;
  for (uint32_t i = 0; i < fine.count; ++i) {
    const sonde_datum *f = &fine.data[i], *c = &coarse.data[i];
    assert_near(remainder(c->force_n, 0.05), 0, 1e-12);
    assert_near(remainder(c->penetration_m, 1e-4), 0, 1e-15);
    assert_near(c->force_n, f->force_n, 0.025 + 1e-12);
    assert_near(c->penetration_m, f->penetration_m, 0.5e-4 + 1e-12);
    changed += fabs(c->force_n - f->force_n) > 1e-6;
  }
  assert_true(changed > fine.count / 2);
  sonde_measurements_clear(&fine);
  sonde_measurements_clear(&coarse);
  bundled_clear(&b);
}

// Coarse readings never name a depth twice, so that the file can be read again.
static void repeated_depths_are_not_recorded(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 4);
  sonde_robot_def def = quick_robot();
  def.limit_n = 1e3;
  def.step_m = def.quantum_penetration_m = 2e-3;
  def.noise_penetration_m = 1e-3;
  sonde_robot_log log;
  sonde_measurements m = run(&b, &sites, &def, &log), again;
  sonde_error error;
  assert_true(m.count < 40); // 4 sites x 10 steps: some readings repeat
  const char *path = write_temporary("");
  assert_ok(sonde_measurements_save(path, &m, &error), &error);
  assert_ok(sonde_measurements_load(path, &sites, &again, &error), &error);
  assert_int_equal(again.count, m.count);
  sonde_measurements_clear(&m);
  sonde_measurements_clear(&again);
  sonde_robot_log_clear(&log);
  bundled_clear(&b);
}

// Four footprints and two bodies. A footprint inside another one needs less force; its covered skin
// is its area, seen along the normal, and a little more where the skin is inclined.
static void any_probe_is_pressed(void **state) {
  (void)state;
  const struct {
    const char *name, *label;
    double least_mm2, most_mm2;
  } probe[] = {{"point", "point", 36, 37},
               {"rect:24x12", "rect:24x12", 288, 297},
               {"square", "square", 576, 594},
               {"rect:60x24", "rect:60x24", 1440, 1700},
               {"sphere", "sphere", 1, 700},
               {SONDE_BINARY_DIR "/robot_test_pyramid.stl", "robot_test_pyramid", 1, 2000}};
  sonde_mesh pyramid;
  assert_ok(sonde_mesh_create(&pyramid, 5, 6, NULL), NULL);
  const sonde_vec3 corner[5] = {
      {20, 20, -30}, {-20, 20, -30}, {-20, -20, -30}, {20, -20, -30}, {0, 0, 0}};
  const uint32_t face[6][3] = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}, {0, 2, 1}, {0, 3, 2}};
  memcpy(pyramid.vertices, corner, sizeof corner);
  memcpy(pyramid.faces, face, sizeof face);
  assert_ok(sonde_mesh_save(probe[5].name, 1, &pyramid, NULL), NULL);
  sonde_mesh_clear(&pyramid);
  bundled b = soft_thigh();
  sonde_site_table sites = {.count = 1, .sites = &b.sites.sites[27]};
  double before_n = 0;
  for (size_t k = 0; k < sizeof probe / sizeof *probe; ++k) {
    sonde_robot_def def = quick_robot();
    def.probe = probe[k].name;
    def.depth_limit_m = 8e-3;
    def.limit_n = 1e3;
    sonde_robot_log log;
    sonde_measurements m = run(&b, &sites, &def, &log);
    assert_int_equal(m.count, 2);
    assert_string_equal(m.data[0].probe, probe[k].label);
    double area_mm2 = 1e6 * log.visits[0].area_m2;
    if (!(area_mm2 >= probe[k].least_mm2 && area_mm2 <= probe[k].most_mm2))
      fail_msg("%s covers %g mm2", probe[k].label, area_mm2);
    assert_true(m.data[0].force_n > 0 && m.data[1].force_n > m.data[0].force_n);
    if (k < 4) {
      assert_true(m.data[1].force_n > before_n);
      before_n = m.data[1].force_n;
    }
    sonde_measurements_clear(&m);
    sonde_robot_log_clear(&log);
  }
  unlink(probe[5].name);
  bundled_clear(&b);
}

// The convex body pressed to the same depth needs less force than the bonded footprint at first:
// a flat face touches a curved skin with a part of its area only.
static void pressed_body_gives_force(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 1);
  sonde_robot_def def = quick_robot();
  def.probe = "linear";
  def.contact = SONDE_ROBOT_PROBE;
  def.depth_limit_m = 8e-3;
  def.limit_n = 1e3;
  sonde_robot_log touched, covered;
  sonde_measurements pressed = run(&b, &sites, &def, &touched);
  def.contact = SONDE_ROBOT_BONDED;
  sonde_measurements bonded = run(&b, &sites, &def, &covered);
  assert_int_equal(pressed.count, 2);
  assert_int_equal(bonded.count, 2);
  assert_true(pressed.data[0].force_n > 0 && pressed.data[0].force_n < bonded.data[0].force_n);
  assert_true(pressed.data[1].force_n > pressed.data[0].force_n);
  assert_true(touched.visits[0].area_m2 > 0);
  sonde_robot_log_clear(&touched);
  sonde_robot_log_clear(&covered);
  sonde_measurements_clear(&pressed);
  sonde_measurements_clear(&bonded);
  bundled_clear(&b);
}

// ---- cancelling ---------------------------------------------------------------------------

// Cancels when some share of the sites is done.
static bool stop_at(double fraction, const char *what, void *user) {
  (void)what;
  return fraction < *(const double *)user;
}

// Whatever the moment: a kept site holds the first rows of its whole curve, all of them when it is
// said to be finished, and at least three; the file says that it is partial and can be read.
static void cancelled_robot_keeps_what_it_has(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 8);
  sonde_robot_def def = quick_robot();
  def.limit_n = 1e3;
  def.step_m = 0.5e-3;
  def.depth_limit_m = 6e-3;
  sonde_measurements whole = run(&b, &sites, &def, NULL);
  assert_int_equal(whole.count, 12 * sites.count);
  assert_int_equal(whole.remark[0], 0);
  for (double share = 0; share < 0.5; share += 0.3) {
    const sonde_progress progress = {stop_at, &share};
    sonde_measurements m;
    sonde_robot_log log;
    sonde_error error;
    assert_int_equal(sonde_robot_run(b.model, &sites, &def, &progress, &m, &log, &error),
                     SONDE_CANCELLED);
    assert_non_null(strstr(m.remark, "partial"));
    uint32_t r = 0, finished = 0;
    for (uint32_t s = 0; s < log.count; ++s) {
      const sonde_robot_visit *visit = &log.visits[s];
      bool done = visit->end != SONDE_ROBOT_NOT_REACHED;
      finished += done;
      assert_true(done ? visit->rows == 12 : visit->rows == 0 || visit->rows >= 3);
      for (uint32_t k = 0; k < visit->rows; ++k, ++r) {
        assert_int_equal(m.data[r].site, visit->site);
        assert_near(m.data[r].force_n, whole.data[12 * s + k].force_n, 0);
      }
    }
    assert_int_equal(r, m.count);
    assert_true(finished < sites.count && finished + 1.0 > share * sites.count);
    sonde_measurements again = {0};
    const char *path = write_temporary("");
    assert_ok(sonde_measurements_save(path, &m, &error), &error);
    if (m.count) assert_ok(sonde_measurements_load(path, &sites, &again, &error), &error);
    assert_int_equal(again.count, m.count);
    FILE *file = fopen(path, "r");
    char line[16] = "";
    assert_non_null(fgets(line, sizeof line, file));
    fclose(file);
    assert_memory_equal(line, "# partial:", 10);
    sonde_measurements_clear(&again);
    sonde_measurements_clear(&m);
    sonde_robot_log_clear(&log);
  }
  sonde_measurements_clear(&whole);
  bundled_clear(&b);
}

static void refuses(const bundled *b, const sonde_site_table *sites, const sonde_robot_def *def,
                    sonde_status status, const char *says) {
  sonde_measurements m;
  sonde_robot_log log;
  sonde_error error = {0};
  sonde_status got = sonde_robot_run(b->model, sites, def, NULL, &m, &log, &error);
  if (got != status) fail_msg("status %d: %s", (int)got, error.message);
  assert_says(&error, says);
  assert_null(m.data);
  assert_null(log.visits);
}

static void refuses_bad_orders(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 6.0);
  sonde_robot_def def = quick_robot();
  def.probe = "spoon";
  refuses(&b, &b.sites, &def, SONDE_NOT_FOUND, "spoon");
  def.probe = "sphere";
  def.contact = SONDE_ROBOT_BONDED;
  refuses(&b, &b.sites, &def, SONDE_ARGUMENT, "sphere");
  def = quick_robot();
  def.probe = "rect:12.3456789x12.3456789";
  refuses(&b, &b.sites, &def, SONDE_ARGUMENT, "23");
  def = quick_robot();
  def.step_m = 0;
  refuses(&b, &b.sites, &def, SONDE_ARGUMENT, "step_m");
  def = quick_robot();
  def.quantum_penetration_m = 5e-3; // beyond the step
  refuses(&b, &b.sites, &def, SONDE_ARGUMENT, "quantum_penetration_m");
  def = quick_robot();
  b.sites.sites[5].position_m.x += 0.04;
  refuses(&b, &b.sites, &def, SONDE_MISMATCH, "site 5");
  bundled_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(stops_one_step_after_the_limit),
      cmocka_unit_test(noise_does_not_pass_the_limit),
      cmocka_unit_test(agrees_with_full_prediction),
      cmocka_unit_test(noise_depends_on_the_seed_only),
      cmocka_unit_test(quantises_after_the_noise),
      cmocka_unit_test(repeated_depths_are_not_recorded),
      cmocka_unit_test(any_probe_is_pressed),
      cmocka_unit_test(pressed_body_gives_force),
      cmocka_unit_test(cancelled_robot_keeps_what_it_has),
      cmocka_unit_test(refuses_bad_orders),
  };
  return cmocka_run_group_tests(tests, NULL, remove_temporary);
}
