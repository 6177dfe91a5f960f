// Prediction and the virtual robot: the simplified interaction against the full model with pinned
// neighbours, thread counts, stop rules, noise, cancelling.
#include "fit_test.h"

#include "fit/press.h"
#include "fit_plate.h"

// Any nodal parameters will do; these vary from site to site.
static void set_uneven_parameters(bundled *b, const sonde_surface_law *law) {
  for (uint32_t s = 0; s < b->sites.count; ++s) {
    b->sites.sites[s].k0_n_m3 = 1e5 * (1 + 0.5 * sin(1.0 + s));
    b->sites.sites[s].xm_m = 0.045 + 0.01 * cos(2.0 * s);
  }
  sonde_error error;
  assert_ok(sonde_model_set_parameters(b->model, law, b->sites.sites, b->sites.count, &error),
            &error);
}

// A thigh with weak edges, whose equilibria are found quickly.
static bundled soft_thigh(void) {
  bundled b = bundled_load("indentation.csv", 8.0);
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = 10;
  set_uneven_parameters(&b, &law);
  return b;
}

// Holds every node: those of the footprint moved, all others at rest. The force on the footprint
// is what the world computes there, which nothing in the fit room evaluates.
static double pinned_force(sonde_press *press, const sonde_site *site, const sonde_footprint *f,
                           double depth_m) {
  const sonde_mesh *mesh = &press->model->surface;
  uint32_t n = mesh->vertex_count, *nodes = SONDE_NEW(uint32_t, n), others = 0, next = 0;
  sonde_vec3 *rest = SONDE_NEW(sonde_vec3, n);
  sonde_vec3 *position = SONDE_NEW(sonde_vec3, n);
  for (uint32_t i = 0; i < n; ++i) position[i] = mesh->vertices[i];
  for (uint32_t i = 0; i < n; ++i) {
    if (next < f->held_count && f->held[next] == i) {
      ++next;
      position[i].x -= depth_m * site->normal.x;
      position[i].y -= depth_m * site->normal.y;
      position[i].z -= depth_m * site->normal.z;
    } else {
      nodes[others++] = i;
    }
  }
  for (uint32_t i = 0; i < n; ++i) rest[i] = position[i];
  // All held: sum of the forces on the others and on the footprint, then on the others alone.
  sonde_vec3 *ordered = SONDE_NEW(sonde_vec3, n);
  uint32_t *all = SONDE_NEW(uint32_t, n);
  for (uint32_t i = 0; i < n; ++i) all[i] = i;
  sonde_vec3 total, outer;
  assert_true(sonde_settle_bonded(press->state, all, position, n, 1e-12, 5, &total).converged);
  for (uint32_t k = 0; k < others; ++k) ordered[k] = rest[nodes[k]];
  // The footprint stays where the first call left it when no iteration is allowed.
  sonde_settle_bonded(press->state, nodes, ordered, others, 1e-12, 0, &outer);
  sonde_free(nodes);
  sonde_free(rest);
  sonde_free(position);
  sonde_free(ordered);
  sonde_free(all);
  return (total.x - outer.x) * site->normal.x + (total.y - outer.y) * site->normal.y +
         (total.z - outer.z) * site->normal.z;
}

static void simplified_equals_full_with_pinned_neighbours(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 6.0);
  double worst = 0;
  for (int tension = 0; tension < 2; ++tension) {
    sonde_surface_law law = b.model->law;
    law.edge_stiffness_n_m = 120;
    law.edge_compression = 0.3;
    law.edge_pretension_n = tension ? 0.05 : 0.0;
    law.tangential_stiffness_n_m3 = 0; // the simplified interaction has neither
    law.shear_stiffness_n_m = 0;
    set_uneven_parameters(&b, &law);
    sonde_press press;
    assert_ok(sonde_press_create(b.model, 1e-12, 5, &press, NULL), NULL);
    for (uint32_t s = 3; s < b.sites.count; s += 20)
      for (int probe = 0; probe < 2; ++probe) {
        sonde_footprint f;
        assert_ok(sonde_footprint_create(b.model, &b.sites.sites[s], probe ? 0.03 : 0.003,
                                         probe ? 0.006 : 0.003, SONDE_COVERAGE_CELLS, &f, NULL),
                  NULL);
        for (double depth = 0.002; depth < 0.03; depth += 0.009) {
          double full = pinned_force(&press, &b.sites.sites[s], &f, depth);
          double simplified = sonde_footprint_force(&f, b.model, depth);
          worst = fmax(worst, fabs(simplified / full - 1));
        }
        sonde_footprint_clear(&f);
      }
    sonde_press_clear(&press);
  }
  print_message("simplified against pinned full: %.2g\n", worst);
  assert_true(worst < 1e-10);
  bundled_clear(&b);
}

// Free neighbours follow the dimple: the full force is smaller, and not zero.
static void full_is_softer_than_simplified(void **state) {
  (void)state;
  bundled b = soft_thigh();
  b.m.count = 6; // one curve, up to 12 mm
  double full[6], simplified[6], alone[6];
  sonde_predict_def def = sonde_predict_def_default();
  sonde_error error;
  assert_ok(sonde_predict(b.model, &b.sites, &b.m, &def, NULL, simplified, &error), &error);
  def.interaction = SONDE_INTERACTION_FULL;
  assert_ok(sonde_predict(b.model, &b.sites, &b.m, &def, NULL, full, &error), &error);
  def.threads = 1;
  assert_ok(sonde_predict(b.model, &b.sites, &b.m, &def, NULL, alone, &error), &error);
  for (int i = 0; i < 6; ++i) {
    assert_true(isfinite(full[i]));
    assert_near(full[i], alone[i], 0);
    assert_true(full[i] > 0 && full[i] < simplified[i]);
    if (i) assert_true(full[i] > full[i - 1]);
  }
  bundled_clear(&b);
}

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

static void robot_stops_one_step_after_the_limit(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 3);
  sonde_robot_def def = quick_robot();
  def.limit_n = 0.4;
  uint32_t by_force = 0;
  sonde_measurements m, again;
  sonde_error error;
  uint32_t stopped;
  assert_ok(sonde_robot_run(b.model, &sites, &def, NULL, &m, &stopped, &error), &error);
  assert_int_equal(stopped, 0);
  assert_true(m.count >= 3);
  for (uint32_t i = 0; i < m.count; ++i) {
    bool last = i + 1 == m.count || m.data[i + 1].site != m.data[i].site;
    assert_true(last || m.data[i].force_n <= def.limit_n);
    by_force += m.data[i].force_n > def.limit_n && m.data[i].penetration_m < 19e-3;
    assert_true(!last || m.data[i].force_n > def.limit_n ||
                m.data[i].penetration_m > def.depth_limit_m - 1e-9);
    if (i && m.data[i].site == m.data[i - 1].site)
      assert_near(m.data[i].penetration_m - m.data[i - 1].penetration_m, 4e-3, 1e-12);
  }
  assert_true(by_force >= 2);
  def.threads = 1;
  assert_ok(sonde_robot_run(b.model, &sites, &def, NULL, &again, NULL, &error), &error);
  assert_int_equal(again.count, m.count);
  for (uint32_t i = 0; i < m.count; ++i) assert_near(again.data[i].force_n, m.data[i].force_n, 0);
  sonde_measurements_clear(&m);
  sonde_measurements_clear(&again);
  bundled_clear(&b);
}

// What the robot measures, the full prediction gives back.
static void robot_agrees_with_full_prediction(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_site_table sites = first_sites(&b, 1);
  sonde_robot_def def = quick_robot();
  def.relative_residual = 1e-9;
  sonde_measurements m;
  sonde_error error;
  assert_ok(sonde_robot_run(b.model, &sites, &def, NULL, &m, NULL, &error), &error);
  double *predicted = SONDE_NEW(double, m.count);
  sonde_predict_def predict = sonde_predict_def_default();
  predict.interaction = SONDE_INTERACTION_FULL;
  predict.relative_residual = 1e-9;
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
    assert_ok(sonde_robot_run(b.model, &sites, &def, NULL, &m[k], NULL, NULL), NULL);
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

// Cancels when a third of the sites is done; what is finished is kept whole.
static bool stop_at_a_third(double fraction, const char *what, void *user) {
  (void)what;
  (void)user;
  return fraction < 0.3;
}

static void cancelled_robot_keeps_finished_sites(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_robot_def def = quick_robot();
  def.limit_n = 1e3;
  def.step_m = 1e-3;
  def.depth_limit_m = 6e-3;
  const sonde_progress progress = {stop_at_a_third, NULL};
  sonde_measurements m;
  sonde_error error;
  uint32_t stopped;
  sonde_status status = sonde_robot_run(b.model, &b.sites, &def, &progress, &m, &stopped, &error);
  assert_int_equal(status, SONDE_CANCELLED);
  assert_true(m.count >= 6 && m.count < 6 * b.sites.count);
  assert_int_equal(m.count % 6, 0); // 6 mm in steps of 1 mm
  sonde_measurements_clear(&m);
  bundled_clear(&b);
}

static void robot_refuses_bad_orders(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 6.0);
  sonde_measurements m;
  sonde_error error;
  sonde_robot_def def = quick_robot();
  def.probe = "spoon";
  assert_int_equal(sonde_robot_run(b.model, &b.sites, &def, NULL, &m, NULL, &error),
                   SONDE_NOT_FOUND);
  def.probe = "sphere";
  def.contact = SONDE_ROBOT_BONDED;
  assert_int_equal(sonde_robot_run(b.model, &b.sites, &def, NULL, &m, NULL, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "sphere");
  def = quick_robot();
  def.step_m = 0;
  assert_int_equal(sonde_robot_run(b.model, &b.sites, &def, NULL, &m, NULL, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "step_m");
  assert_null(m.data);
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
  sonde_measurements pressed, bonded;
  sonde_error error;
  assert_ok(sonde_robot_run(b.model, &sites, &def, NULL, &pressed, NULL, &error), &error);
  def.contact = SONDE_ROBOT_BONDED;
  assert_ok(sonde_robot_run(b.model, &sites, &def, NULL, &bonded, NULL, &error), &error);
  assert_int_equal(pressed.count, 2);
  assert_int_equal(bonded.count, 2);
  assert_true(pressed.data[0].force_n > 0 && pressed.data[0].force_n < bonded.data[0].force_n);
  assert_true(pressed.data[1].force_n > pressed.data[0].force_n);
  sonde_measurements_clear(&pressed);
  sonde_measurements_clear(&bonded);
  bundled_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(simplified_equals_full_with_pinned_neighbours),
      cmocka_unit_test(full_is_softer_than_simplified),
      cmocka_unit_test(robot_stops_one_step_after_the_limit),
      cmocka_unit_test(robot_agrees_with_full_prediction),
      cmocka_unit_test(noise_depends_on_the_seed_only),
      cmocka_unit_test(cancelled_robot_keeps_finished_sites),
      cmocka_unit_test(robot_refuses_bad_orders),
      cmocka_unit_test(pressed_body_gives_force),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
