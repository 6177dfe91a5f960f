// What an estimation of stage 3 is worth, on nine sites of the bundled thigh: profile likelihood,
// what each probe determines, other starts, robust losses.
#include "fit_test.h"

#include "fit/nearby_refit.h"
#include "fit_plate.h"
#include "sonde/fit_confidence.h"

typedef struct nine {
  bundled b;
  sonde_fit_def def;
  sonde_fit_result result;
} nine;

static void nine_create(nine *t) {
  t->b = bundled_load("indentation.csv", 6.0);
  keep_nine_sites(&t->b);
  t->def = sonde_fit_def_default();
  t->def.stages = 3;
  t->def.smoothness_sd = 0.1;
  sonde_error error;
  assert_ok(sonde_fit(t->b.model, &t->b.sites, &t->b.m, &t->def, NULL, &t->result, &error), &error);
}

static void nine_clear(nine *t) {
  sonde_fit_result_clear(&t->result);
  bundled_clear(&t->b);
}

// The least cost is at the estimate and rises to both sides; near it the rise is what the curvature
// says; the interval's ends are where the refitted cost is higher by the threshold.
static void profile_rises_from_the_optimum(void **state) {
  (void)state;
  nine t;
  nine_create(&t);
  sonde_fit_profile p;
  sonde_error error;
  assert_ok(
      sonde_fit_profile_shear(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, NULL, &p, &error),
      &error);
  uint32_t middle = p.count / 2;
  print_message("profile of G: %.3f N/m, %.3f to %.3f\n", p.estimate_n_m, p.interval_95[0],
                p.interval_95[1]);
  assert_near(p.estimate_n_m / t.result.law.shear_stiffness_n_m, 1, 0.01);
  assert_near(p.rise[middle], 0, 0);
  for (uint32_t k = 1; k < p.count; ++k) {
    assert_true(p.shear_n_m[k] > p.shear_n_m[k - 1]);
    assert_true(k <= middle ? p.rise[k] < p.rise[k - 1] : p.rise[k] > p.rise[k - 1]);
  }
  for (uint32_t k = 0; k < p.count; ++k)
    if (k != middle) assert_near(p.rise[k] / p.quadratic[k], 1, 0.3);
  for (int side = 0; side < 2; ++side) {
    sonde_nearby_refit again;
    assert_ok(
        sonde_nearby_refit_create(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, &again, &error),
        &error);
    bool *fixed = SONDE_NEW(bool, again.parameters);
    sonde_refit_result best, held;
    again.refit->near = true;
    again.refit->enough = 1e-6;
    assert_ok(sonde_nearby_refit_run(&again, NULL, &best, &error), &error);
    fixed[again.parameters - 2] = true;
    again.refit->fixed = fixed;
    again.theta[again.parameters - 2] = log(p.interval_95[side]);
    assert_ok(sonde_nearby_refit_run(&again, NULL, &held, &error), &error);
    assert_near(again.theta[again.parameters - 2], log(p.interval_95[side]), 0); // was held
    assert_near(2 * (held.cost - best.cost) / p.threshold, 1, 0.05);
    sonde_free(fixed);
    sonde_nearby_refit_clear(&again);
  }
  nine_clear(&t);
}

// Each probe alone leaves every figure less certain than both together; one probe alone confounds
// the skin's shear with the springs below it.
static void both_probes_determine_more_than_one(void **state) {
  (void)state;
  nine t;
  nine_create(&t);
  sonde_fit_identifiability found;
  sonde_error error;
  assert_ok(
      sonde_fit_identify(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, NULL, &found, &error),
      &error);
  assert_int_equal(found.count, 3);
  const sonde_fit_part *both = &found.part[2];
  assert_string_equal(both->probe, "");
  for (uint32_t p = 3; p-- > 0;) {
    const sonde_fit_part *part = &found.part[p];
    print_message("%-8s ln sd G %.4f gm %.4f k0 %.4f xm %.4f, G-k0 %+.3f, condition %.3g\n",
                  part->probe[0] ? part->probe : "both", part->ln_sd[0], part->ln_sd[1],
                  part->ln_sd[2], part->ln_sd[3], part->correlation[0][2], part->condition);
    for (int k = 0; k < 4; ++k) {
      assert_near(part->correlation[k][k], 1, 1e-9);
      if (p < 2) assert_true(part->ln_sd[k] > both->ln_sd[k]);
    }
    if (p < 2) assert_true(part->condition > 10 * both->condition);
  }
  nine_clear(&t);
}

static void random_starts_end_in_one_optimum(void **state) {
  (void)state;
  const char *wanted = getenv("SONDE_TEST_RUNS");
  uint32_t count = wanted ? (uint32_t)atoi(wanted) : 4;
  nine t;
  nine_create(&t);
  sonde_fit_starts ends, again;
  sonde_error error;
  assert_ok(sonde_fit_random_starts(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, count, 1,
                                    NULL, &ends, &error),
            &error);
  print_message(
      "%u of %u random starts end in the same optimum, %u fail, cost %.4f to %.4f, within "
      "%.3f sd\n",
      ends.same, ends.count, ends.failed, ends.least_cost, ends.most_cost, ends.farthest_sd);
  assert_int_equal(ends.count, count);
  assert_true(ends.same >= 0.85 * count);
  t.def.threads = 1;
  assert_ok(sonde_fit_random_starts(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, 2, 1, NULL,
                                    &ends, &error),
            &error);
  t.def.threads = 3;
  assert_ok(sonde_fit_random_starts(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, 2, 1, NULL,
                                    &again, &error),
            &error);
  assert_near(ends.most_cost, again.most_cost, 0);
  nine_clear(&t);
}

// Far outliers move an estimate by robust loss less than one by squares, and its intervals grow
// less.
static void robust_loss_holds_estimate_and_intervals(void **state) {
  (void)state;
  nine t;
  nine_create(&t);
  for (uint32_t k = 0; k < t.b.m.count; ++k) t.b.m.data[k].force_n = t.result.model_n[k];
  for (uint32_t k = 5; k < t.b.m.count; k += 37) t.b.m.data[k].force_n *= 1.5;
  double moved[2], sd[2];
  for (int robust = 0; robust < 2; ++robust) {
    t.def.loss = robust ? SONDE_LOSS_HUBER : SONDE_LOSS_SQUARES;
    t.def.loss_scale = 0.05;
    sonde_fit_result r;
    sonde_error error;
    assert_ok(sonde_fit(t.b.model, &t.b.sites, &t.b.m, &t.def, NULL, &r, &error), &error);
    moved[robust] = fabs(log(r.law.shear_stiffness_n_m / t.result.law.shear_stiffness_n_m));
    sd[robust] = r.confidence.ln_shear_sd;
    sonde_fit_result_clear(&r);
  }
  print_message("outliers move ln G by %.4f, with a robust loss by %.4f; sd %.4f and %.4f\n",
                moved[0], moved[1], sd[0], sd[1]);
  assert_true(moved[1] < 0.3 * moved[0]);
  assert_true(sd[1] < 0.3 * sd[0]);
  nine_clear(&t);
}

static void stage_2_has_no_such_confidence(void **state) {
  (void)state;
  nine t;
  nine_create(&t);
  assert_non_null(t.result.stage2_sites);
  assert_near(t.result.stage2_law.edge_stiffness_n_m, t.result.stage2_edge_n_m, 0);
  sonde_fit_result_clear(&t.result);
  t.def.stages = 2;
  sonde_error error;
  assert_ok(sonde_fit(t.b.model, &t.b.sites, &t.b.m, &t.def, NULL, &t.result, &error), &error);
  assert_null(t.result.stage2_sites);
  sonde_fit_profile p;
  sonde_fit_starts ends;
  sonde_fit_identifiability parts;
  assert_int_equal(
      sonde_fit_profile_shear(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, NULL, &p, &error),
      SONDE_ARGUMENT);
  assert_says(&error, "stage 3");
  assert_int_equal(
      sonde_fit_identify(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, NULL, &parts, &error),
      SONDE_ARGUMENT);
  assert_int_equal(sonde_fit_random_starts(t.b.model, &t.b.sites, &t.b.m, &t.def, &t.result, 1, 1,
                                           NULL, &ends, &error),
                   SONDE_ARGUMENT);
  nine_clear(&t);
}

// The model's own law leads back to the result; pre-tension with stiffening follows the data at
// least as well as without; rows that were never fitted are predicted as under their own name.
static void laws_of_the_layer_are_compared(void **state) {
  (void)state;
  nine t;
  nine_create(&t);
  sonde_fit_layer layer[SONDE_FIT_LAYERS];
  sonde_measurements also = {.count = t.b.m.count, .data = SONDE_NEW(sonde_datum, t.b.m.count)};
  sonde_error error;
  memcpy(also.data, t.b.m.data, also.count * sizeof *also.data);
  assert_int_equal(sonde_fit_layers(t.b.model, &t.b.sites, &t.b.m, &also, &t.def, &t.result, NULL,
                                    layer, &error),
                   SONDE_ARGUMENT);
  for (uint32_t k = 0; k < also.count; ++k) {
    bool point = strcmp(also.data[k].probe, "point") == 0;
    snprintf(also.data[k].probe, sizeof also.data[k].probe, point ? "rect:6x6" : "rect:60x12");
  }
  assert_ok(sonde_fit_layers(t.b.model, &t.b.sites, &t.b.m, &also, &t.def, &t.result, NULL, layer,
                             &error),
            &error);
  for (int k = 0; k < SONDE_FIT_LAYERS; ++k) {
    print_message("layer %d: %.2f %%, left out %.2f %%, cost %.2f, T %.3g, %.3g, c %.3g\n", k,
                  layer[k].seen.all.mae_percent, layer[k].one_out.all.mae_percent, layer[k].cost,
                  layer[k].tension_n_m, layer[k].second, layer[k].stiffening);
    assert_int_equal(layer[k].kind, k);
    assert_true(layer[k].converged || k == SONDE_LAYER_TENSION); // its T runs to 0
    assert_int_equal(layer[k].seen.all.count, t.b.m.count);
    assert_true(layer[k].one_out.all.mae_percent > 0.9 * layer[k].seen.all.mae_percent);
    assert_near(layer[k].also.all.mae_percent / layer[k].seen.all.mae_percent, 1, 1e-3);
  }
  assert_near(layer[0].tension_n_m / t.result.law.shear_stiffness_n_m, 1, 0.1);
  assert_true(layer[2].cost < 0.5 * layer[1].cost && layer[2].stiffening > 0);
  assert_int_equal(layer[2].parameters, layer[1].parameters + 1);
  sonde_free(also.data);
  nine_clear(&t);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(profile_rises_from_the_optimum),
      cmocka_unit_test(both_probes_determine_more_than_one),
      cmocka_unit_test(random_starts_end_in_one_optimum),
      cmocka_unit_test(laws_of_the_layer_are_compared),
      cmocka_unit_test(robust_loss_holds_estimate_and_intervals),
      cmocka_unit_test(stage_2_has_no_such_confidence),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
