// The scalar equilibrium of stage 3 against the full model, its rim, its adjoint derivatives, the
// spread of site parameters, their roughness, and recovery of known parameters.
#include "fit_test.h"

#include "fit/press.h"
#include "fit/refit.h"
#include "fit/site_field.h"
#include "fit_plate.h"

static const double HALF_U[2] = {0.003, 0.030}, HALF_V[2] = {0.003, 0.006};

// A thigh with uneven parameters and shear springs, without surface springs.
static bundled shear_thigh(double fine_mm) {
  bundled b = bundled_load("indentation.csv", fine_mm);
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = 0;
  law.shear_stiffness_n_m = 18;
  law.shear_limit = 0.9;
  for (uint32_t s = 0; s < b.sites.count; ++s) {
    b.sites.sites[s].k0_n_m3 = 1.6e5 * (1 + 0.3 * sin(1.0 + s));
    b.sites.sites[s].xm_m = 0.042 + 0.006 * cos(2.0 * s);
  }
  sonde_error error;
  assert_ok(sonde_model_set_parameters(b.model, &law, b.sites.sites, b.sites.count, &error),
            &error);
  return b;
}

static sonde_patch_law law_of(const sonde_model *model) {
  const sonde_surface_law *law = &model->law;
  return (sonde_patch_law){model->k0_n_m3,   model->xm_m, law->shear_stiffness_n_m,
                           law->shear_limit, law->guard,  law->tangential_stiffness_n_m3};
}

static sonde_footprint footprint_of(const bundled *b, uint32_t site, int probe) {
  sonde_footprint f;
  assert_ok(sonde_footprint_create(b->model, &b->sites.sites[site], HALF_U[probe], HALF_V[probe],
                                   SONDE_COVERAGE_CLIPPED, &f, NULL),
            NULL);
  return f;
}

typedef struct bench {
  sonde_patch patch;
  sonde_patch_solver solver;
  double *s_m;
} bench;

static void bench_create(bench *t, const bundled *b, uint32_t site, int probe, double reach_m,
                         bool hold) {
  sonde_error error;
  sonde_footprint f = footprint_of(b, site, probe);
  assert_ok(sonde_patch_create(b->model, &f, b->sites.sites[site].normal, reach_m, hold, &t->patch,
                               &error),
            &error);
  assert_ok(sonde_patch_solver_create(&t->patch, 1, &t->solver, &error), &error);
  sonde_patch_solver_use(&t->solver, &t->patch);
  t->s_m = SONDE_NEW(double, t->patch.place_count);
  sonde_footprint_clear(&f);
}

static double bench_force(bench *t, const sonde_patch_law *law, double depth_m,
                          sonde_patch_gradient *gradient) {
  double force_n;
  sonde_error error;
  assert_ok(sonde_patch_settle(&t->solver, law, depth_m, 1e-12, 100, t->s_m, &error), &error);
  assert_ok(sonde_patch_force(&t->solver, law, depth_m, t->s_m, &force_n, gradient, &error),
            &error);
  return force_n;
}

static void bench_clear(bench *t) {
  sonde_patch_solver_clear(&t->solver);
  sonde_patch_clear(&t->patch);
  sonde_free(t->s_m);
}

// Tangential springs stay on: they add a term in closed form. The 60 mm patch of the fit, too.
static void scalar_equals_full_model_without_surface_springs(void **state) {
  (void)state;
  bundled b = shear_thigh(4.0);
  sonde_patch_law law = law_of(b.model);
  sonde_press press;
  assert_ok(sonde_press_create(b.model, 1e-7, 400, &press, NULL), NULL);
  double worst_whole = 0, worst_patch = 0;
  for (int probe = 0; probe < 2; ++probe) {
    uint32_t site = probe ? 27 : 12;
    sonde_footprint f = footprint_of(&b, site, probe);
    bench whole, patch;
    bench_create(&whole, &b, site, probe, 1.0, false);
    bench_create(&patch, &b, site, probe, 0.06, false);
    assert_int_equal(whole.patch.place_count, b.model->surface.vertex_count + 1);
    assert_true(patch.patch.place_count < b.model->surface.vertex_count / 2);
    sonde_state_reset(press.state);
    for (double depth = 0.005; depth < 0.021; depth += 0.005) {
      double full = sonde_press_bonded(&press, &b.sites.sites[site], &f, depth);
      assert_true(isfinite(full));
      worst_whole = fmax(worst_whole, fabs(bench_force(&whole, &law, depth, NULL) / full - 1));
      worst_patch = fmax(worst_patch, fabs(bench_force(&patch, &law, depth, NULL) / full - 1));
    }
    bench_clear(&whole);
    bench_clear(&patch);
    sonde_footprint_clear(&f);
  }
  sonde_press_clear(&press);
  print_message("scalar against full: whole skin %.2g, patch %.2g\n", worst_whole, worst_patch);
  assert_true(worst_whole < 1e-5);
  assert_true(worst_patch < 1e-3);
  bundled_clear(&b);
}

// What lies beyond 60 mm hardly matters, held or cut off, at 30 mm depth; at 10 mm it does.
static void rim_does_not_matter(void **state) {
  (void)state;
  bundled b = shear_thigh(4.0);
  sonde_patch_law law = law_of(b.model);
  double difference[2];
  for (int near = 0; near < 2; ++near) {
    double force[2], reach_m = near ? 0.01 : 0.06;
    for (int hold = 0; hold < 2; ++hold) {
      bench t;
      bench_create(&t, &b, 35, 1, reach_m, hold);
      for (double depth = 0.01; depth < 0.031; depth += 0.01)
        force[hold] = bench_force(&t, &law, depth, NULL);
      bench_clear(&t);
    }
    assert_true(force[1] > force[0]);
    difference[near] = force[1] / force[0] - 1;
  }
  print_message("held against cut rim: %.2g at 60 mm, %.2g at 10 mm\n", difference[0],
                difference[1]);
  assert_true(difference[0] < 3e-3 && difference[1] > 0.02);
  bundled_clear(&b);
}

// The force along a straight line in the logarithms of all parameters.
static double force_along(bench *t, const bundled *b, double h, const double direction[4],
                          double depth_m) {
  uint32_t n = b->model->surface.vertex_count;
  double *k0 = SONDE_NEW(double, n), *xm = SONDE_NEW(double, n);
  for (uint32_t i = 0; i < n; ++i) {
    k0[i] = b->model->k0_n_m3[i] * exp(h * direction[0] * sin(0.7 * i));
    xm[i] = b->model->xm_m[i] * exp(h * direction[1] * cos(0.4 * i));
  }
  sonde_patch_law law = law_of(b->model);
  law.k0_n_m3 = k0;
  law.xm_m = xm;
  law.shear_n_m *= exp(h * direction[2]);
  law.limit *= exp(h * direction[3]);
  double force_n = bench_force(t, &law, depth_m, NULL);
  sonde_free(k0);
  sonde_free(xm);
  return force_n;
}

static double by_adjoint(bench *t, const bundled *b, const double direction[4], double depth_m) {
  uint32_t n = t->patch.place_count;
  sonde_patch_gradient g = {SONDE_NEW(double, n), SONDE_NEW(double, n), 0, 0};
  sonde_patch_law law = law_of(b->model);
  (void)bench_force(t, &law, depth_m, &g);
  double sum = direction[2] * g.by_ln_shear + direction[3] * g.by_ln_limit;
  for (uint32_t k = 0; k < n; ++k) {
    sum += direction[0] * sin(0.7 * t->patch.node[k]) * g.by_ln_k0[k];
    sum += direction[1] * cos(0.4 * t->patch.node[k]) * g.by_ln_xm[k];
  }
  sonde_free(g.by_ln_k0);
  sonde_free(g.by_ln_xm);
  return sum;
}

static void adjoint_equals_finite_differences(void **state) {
  (void)state;
  bundled b = shear_thigh(5.0);
  const double direction[5][4] = {
      {1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}, {0.4, -0.6, 0.8, -0.3}};
  for (int probe = 0; probe < 2; ++probe) {
    bench t;
    bench_create(&t, &b, 20, probe, 0.05, false);
    for (double depth = 0.008; depth < 0.025; depth += 0.008)
      for (int d = 0; d < 5; ++d) {
        double adjoint = by_adjoint(&t, &b, direction[d], depth), h = 1e-4;
        double difference = (force_along(&t, &b, h, direction[d], depth) -
                             force_along(&t, &b, -h, direction[d], depth)) /
                            (2 * h);
        double scale = fmax(fabs(difference), 1e-3 * force_along(&t, &b, 0, direction[d], depth));
        assert_near(adjoint / scale, difference / scale, 1e-5);
      }
    bench_clear(&t);
  }
  bundled_clear(&b);
}

static void basis_is_the_models_interpolation(void **state) {
  (void)state;
  bundled b = shear_thigh(8.0);
  uint32_t nodes = b.model->surface.vertex_count, count = b.sites.count;
  double *basis = SONDE_NEW(double, (size_t)nodes *count), worst = 0;
  assert_ok(sonde_site_basis(b.model, &b.sites, basis, NULL), NULL);
  for (uint32_t i = 0; i < nodes; ++i) {
    double ln_k = 0, ln_x = 0;
    for (uint32_t s = 0; s < count; ++s) {
      ln_k += basis[(size_t)i * count + s] * log(b.sites.sites[s].k0_n_m3);
      ln_x += basis[(size_t)i * count + s] * log(b.sites.sites[s].xm_m);
    }
    worst = fmax(worst, fabs(ln_k - log(b.model->k0_n_m3[i])));
    worst = fmax(worst, fabs(ln_x - log(b.model->xm_m[i])));
  }
  assert_true(worst < 1e-9);
  sonde_free(basis);
  bundled_clear(&b);
}

// Sites on a flat grid: planes cost nothing, a single raised site does.
static void roughness_spares_planes(void **state) {
  (void)state;
  enum { SIDE = 4, COUNT = SIDE * SIDE };
  sonde_site site[COUNT];
  for (uint32_t s = 0; s < COUNT; ++s)
    site[s] = (sonde_site){.id = s,
                           .position_m = {0.02 * (s % SIDE), 0.019 * (s / SIDE), 0},
                           .normal = {0, 0, 1},
                           .u = {1, 0, 0},
                           .v = {0, 1, 0}};
  const sonde_site_table table = {.count = COUNT, .sites = site};
  double rows[COUNT * COUNT];
  assert_ok(sonde_site_roughness(&table, rows, NULL), NULL);
  for (uint32_t s = 0; s < COUNT; ++s) {
    double level = 0, plane = 0;
    for (uint32_t t = 0; t < COUNT; ++t) {
      level += rows[s * COUNT + t];
      plane += rows[s * COUNT + t] * (3 * site[t].position_m.x - 5 * site[t].position_m.y);
    }
    assert_near(level, 0, 1e-12);
    assert_near(plane, 0, 3e-3); // not 0: the ridge on slopes; the field changes by 0.46
    assert_near(rows[s * COUNT + s], 1, 1e-12);
  }
}

// ---- recovery -----------------------------------------------------------------------------

enum { KEPT = 9 };

// Nine neighbouring sites with their rows: sites 18..20, 26..28, 34..36 of the 8 x 8.
static void keep_nine_sites(bundled *b) {
  uint32_t kept = 0, rows = 0;
  for (uint32_t s = 0; s < b->sites.count; ++s)
    if (s / 8 >= 2 && s / 8 <= 4 && s % 8 >= 2 && s % 8 <= 4)
      b->sites.sites[kept++] = b->sites.sites[s];
  b->sites.count = kept;
  assert_int_equal(kept, KEPT);
  for (uint32_t r = 0; r < b->m.count; ++r)
    for (uint32_t s = 0; s < kept; ++s)
      if (b->m.data[r].site == b->sites.sites[s].id) b->m.data[rows++] = b->m.data[r];
  b->m.count = rows;
}

typedef struct recovery {
  bundled b;
  sonde_fit_plan plan;
  sonde_fit_def def;
  sonde_refit *refit;
  double truth[2 * KEPT + 2];
  double *force_n;
} recovery;

// Measurements replaced by the solver's own forces for smooth known parameters.
static void recovery_create(recovery *r) {
  sonde_error error;
  r->b = bundled_load("indentation.csv", 6.0);
  keep_nine_sites(&r->b);
  r->def = sonde_fit_def_default();
  assert_ok(sonde_fit_plan_create(&r->b.sites, &r->b.m, &r->plan, &error), &error);
  r->force_n = SONDE_NEW(double, r->b.m.count);
  assert_ok(sonde_refit_create(r->b.model, &r->b.sites, &r->b.m, &r->plan, &r->def, 0.06, false,
                               &r->refit, &error),
            &error);
  for (uint32_t s = 0; s < KEPT; ++s) {
    r->truth[s] = log(1.5e5) + 0.08 * (s % 3) - 0.05 * (s / 3);
    r->truth[KEPT + s] = log(0.046) - 0.03 * (s % 3) + 0.04 * (s / 3);
  }
  r->truth[2 * KEPT] = log(22.0);
  r->truth[2 * KEPT + 1] = log(1.2);
  assert_ok(sonde_refit_forces(r->refit, r->truth, r->force_n, NULL, NULL, &error), &error);
  for (uint32_t k = 0; k < r->b.m.count; ++k) r->b.m.data[r->plan.row[k]].force_n = r->force_n[k];
}

static void recovery_clear(recovery *r) {
  sonde_refit_destroy(r->refit);
  sonde_fit_plan_clear(&r->plan);
  sonde_free(r->force_n);
  bundled_clear(&r->b);
}

static void known_parameters_are_recovered(void **state) {
  (void)state;
  recovery r;
  recovery_create(&r);
  sonde_fit_result result;
  sonde_error error;
  r.def.stages = 3;
  assert_ok(sonde_fit(r.b.model, &r.b.sites, &r.b.m, &r.def, NULL, &result, &error), &error);
  assert_true(result.converged);
  assert_int_equal(result.parameters, 2 * KEPT + 2);
  print_message("recovery: %u iterations, cost %.3g from %.3g, error %.2g %%\n", result.iterations,
                result.cost, result.start_cost, result.stage3.all.mae_percent);
  assert_true(result.cost < 1e-4 * result.start_cost);
  assert_true(result.stage3.all.mae_percent < 0.05);
  for (uint32_t s = 0; s < KEPT; ++s) {
    assert_near(log(result.sites[s].k0_n_m3), r.truth[s], 0.01);
    assert_near(log(result.sites[s].xm_m), r.truth[KEPT + s], 0.01);
  }
  assert_near(log(result.law.shear_stiffness_n_m), r.truth[2 * KEPT], 0.01);
  assert_near(log(result.law.shear_limit), r.truth[2 * KEPT + 1], 0.01);
  assert_near(result.law.edge_stiffness_n_m, r.def.kept_edge_n_m, 0);
  sonde_fit_result_clear(&result);
  recovery_clear(&r);
}

// Jacobian over the sites by differences of the whole forward model, rows of every curve.
static void site_jacobian_equals_finite_differences(void **state) {
  (void)state;
  recovery r;
  recovery_create(&r);
  uint32_t n = sonde_refit_parameters(r.refit), rows = r.plan.row_count;
  double *jacobian = SONDE_NEW(double, (size_t)rows *n), *ahead = SONDE_NEW(double, rows);
  double *behind = SONDE_NEW(double, rows), h = 2e-3;
  assert_ok(sonde_refit_forces(r.refit, r.truth, r.force_n, jacobian, NULL, NULL), NULL);
  const uint32_t some[] = {0, 4, KEPT + 2, KEPT + 4, 2 * KEPT, 2 * KEPT + 1};
  for (size_t k = 0; k < SONDE_COUNT_OF(some); ++k) {
    double kept = r.truth[some[k]], worst = 0;
    r.truth[some[k]] = kept + h;
    assert_ok(sonde_refit_forces(r.refit, r.truth, ahead, NULL, NULL, NULL), NULL);
    r.truth[some[k]] = kept - h;
    assert_ok(sonde_refit_forces(r.refit, r.truth, behind, NULL, NULL, NULL), NULL);
    r.truth[some[k]] = kept;
    for (uint32_t row = 0; row < rows; ++row) {
      double slope = (ahead[row] - behind[row]) / (2 * h);
      worst = fmax(worst, fabs(slope - jacobian[(size_t)row * n + some[k]]) / r.force_n[row]);
    }
    assert_true(worst < 3e-4);
  }
  sonde_free(jacobian);
  sonde_free(ahead);
  sonde_free(behind);
  recovery_clear(&r);
}

static bool refuse(double fraction, const char *what, void *user) {
  (void)fraction;
  (void)user;
  return strncmp(what, "stage 3", 7) != 0;
}

static void progress_cancels_stage_3(void **state) {
  (void)state;
  recovery r;
  recovery_create(&r);
  const sonde_progress progress = {refuse, NULL};
  sonde_fit_result result;
  sonde_error error;
  r.def.stages = 3;
  assert_int_equal(sonde_fit(r.b.model, &r.b.sites, &r.b.m, &r.def, &progress, &result, &error),
                   SONDE_CANCELLED);
  assert_null(result.sites);
  r.def.kept_edge_n_m = -1;
  assert_int_equal(sonde_fit(r.b.model, &r.b.sites, &r.b.m, &r.def, NULL, &result, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "kept_edge_n_m");
  recovery_clear(&r);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(scalar_equals_full_model_without_surface_springs),
      cmocka_unit_test(rim_does_not_matter),
      cmocka_unit_test(adjoint_equals_finite_differences),
      cmocka_unit_test(basis_is_the_models_interpolation),
      cmocka_unit_test(roughness_spares_planes),
      cmocka_unit_test(known_parameters_are_recovered),
      cmocka_unit_test(site_jacobian_equals_finite_differences),
      cmocka_unit_test(progress_cancels_stage_3),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
