// Laws of the implicit step: the paper's (3) and (4), orders, stability, oscillation, sleeping.
#include "../fixture.h"
#include "sparse/block.h"
#include "tissue/two_layer/linearise.h"

static sonde_world_def exact_def(double dt, double lambda) {
  sonde_world_def def = fixture_world_def();
  def.dt_s = dt;
  def.implicitness = lambda;
  def.newton_iterations = 0;
  def.pcg = (sonde_pcg_options){1e-14, 1e-300, 5000};
  def.sleep_displacement_m = 0;
  return def;
}

typedef struct bench {
  sonde_model *model;
  sonde_state *state;
  uint32_t n;
} bench;

static bench make(int levels, const sonde_surface_law *law, const sonde_world_def *def) {
  bench b = {.model = fixture_model(levels, law)};
  b.n = b.model->surface.vertex_count;
  const sonde_world_def usual = fixture_world_def();
  assert_int_equal(sonde_state_create(b.model, def ? def : &usual, &b.state, NULL), SONDE_OK);
  return b;
}

static void clear(bench *b) {
  sonde_state_destroy(b->state);
  sonde_model_destroy(b->model);
}

static void shake(const bench *b, sonde_vec3 *x, sonde_vec3 *v, double move, double speed) {
  uint64_t seed = 21;
  for (uint32_t i = 0; i < b->n; ++i) {
    x[i] = v_add(b->model->surface.vertices[i], fixture_vector(&seed, move));
    v[i] = fixture_vector(&seed, speed);
  }
  sonde_state_set(b->state, x, v);
}

static void free_step(bench *b) { sonde_step(b->state, NULL, fixture_pose(0)); }

// lambda = 0 is eq. (3): v += h F/m, x += h v with the old v.
static void lambda_zero_is_explicit_euler(void **state) {
  (void)state;
  sonde_world_def def = exact_def(1e-4, 0);
  bench b = make(2, NULL, &def);
  sonde_vec3 x[66], v[66], force[66], product[66];
  sonde_tissue_node scratch[66];
  shake(&b, x, v, 1e-3, 0.1);
  sonde_block_matrix *matrix;
  sonde_block_matrix_create(b.n, b.model->topology.edge_count,
                            (const uint32_t(*)[2])b.model->topology.edges, &matrix, NULL);
  const sonde_tissue_scales scales = {1, 0, 0};
  sonde_tissue_linearise(b.model, NULL, x, v, &scales, force, product, matrix, scratch);
  free_step(&b);
  for (uint32_t i = 0; i < b.n; ++i) {
    sonde_vec3 x1 = v_madd(x[i], def.dt_s, v[i]);
    sonde_vec3 v1 = v_madd(v[i], def.dt_s / b.model->mass_kg[i], force[i]);
    assert_true(v_distance(sonde_state_positions(b.state)[i], x1) < 1e-14);
    assert_true(v_distance(sonde_state_velocities(b.state)[i], v1) < 1e-14);
  }
  sonde_block_matrix_destroy(matrix);
  clear(&b);
}

enum { SMALL = 18, DOF = 3 * SMALL };

static void eliminate(double (*a)[2 * DOF + 1], int n, double *x) {
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int r = k; r < n; ++r)
      if (fabs(a[r][k]) > fabs(a[best][k])) best = r;
    for (int c = 0; c <= n; ++c) {
      double swap = a[k][c];
      a[k][c] = a[best][c];
      a[best][c] = swap;
    }
    for (int r = k + 1; r < n; ++r) {
      double factor = a[r][k] / a[k][k];
      for (int c = k; c <= n; ++c) a[r][c] -= factor * a[k][c];
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    x[k] = a[k][n];
    for (int c = k + 1; c < n; ++c) x[k] -= a[k][c] * x[c];
    x[k] /= a[k][k];
  }
}

// Dense column of a block matrix.
static void dense(const sonde_block_matrix *matrix, double (*out)[DOF]) {
  sonde_vec3 e[SMALL], y[SMALL];
  for (int c = 0; c < DOF; ++c) {
    memset(e, 0, sizeof e);
    (&e[0].x)[c] = 1;
    sonde_block_multiply(matrix, NULL, NULL, 0, e, y);
    for (int r = 0; r < DOF; ++r) out[r][c] = (&y[0].x)[r];
  }
}

// The 3n x 3n system of the step is the paper's unsymmetric 6n system (4), eliminated densely.
static void equals_equation_4(void **state) {
  (void)state;
  const double lambdas[] = {0, 0.3, 0.5, 0.8, 1};
  for (int trial = 0; trial < 5; ++trial) {
    double lambda = lambdas[trial], h = 2e-3;
    sonde_world_def def = exact_def(h, lambda);
    bench b = make(1, NULL, &def);
    assert_int_equal(b.n, SMALL);
    sonde_vec3 x[SMALL], v[SMALL], force[SMALL], product[SMALL];
    sonde_tissue_node scratch[SMALL];
    static double k_dense[DOF][DOF], c_dense[DOF][DOF], a[2 * DOF][2 * DOF + 1];
    double dy[2 * DOF];
    shake(&b, x, v, 1e-3, 0.1);
    sonde_block_matrix *matrix;
    sonde_block_matrix_create(b.n, b.model->topology.edge_count,
                              (const uint32_t(*)[2])b.model->topology.edges, &matrix, NULL);
    sonde_tissue_linearise(b.model, NULL, x, v, &(sonde_tissue_scales){0, 1, 0}, force, product,
                           matrix, scratch);
    dense(matrix, c_dense);
    sonde_tissue_linearise(b.model, NULL, x, v, &(sonde_tissue_scales){0, 0, 1}, force, product,
                           matrix, scratch);
    dense(matrix, k_dense);
    memset(a, 0, sizeof a);
    for (int r = 0; r < DOF; ++r) {
      double m = b.model->mass_kg[r / 3];
      a[r][r] = a[DOF + r][DOF + r] = 1 / h;
      a[r][DOF + r] = -lambda;
      a[r][2 * DOF] = (&v[0].x)[r];
      a[DOF + r][2 * DOF] = (&force[0].x)[r] / m;
      for (int c = 0; c < DOF; ++c) {
        a[DOF + r][c] += lambda * k_dense[r][c] / m;
        a[DOF + r][DOF + c] += lambda * c_dense[r][c] / m;
      }
    }
    eliminate(a, 2 * DOF, dy);
    free_step(&b);
    for (int r = 0; r < DOF; ++r) {
      double dx = (&sonde_state_positions(b.state)[0].x)[r] - (&x[0].x)[r];
      double dv = (&sonde_state_velocities(b.state)[0].x)[r] - (&v[0].x)[r];
      assert_near(dx, dy[r], 1e-11);
      assert_near(dv, dy[DOF + r], 1e-9);
    }
    sonde_block_matrix_destroy(matrix);
    clear(&b);
  }
}

// A node alone on its normal spring: no edges, no tangential spring.
static sonde_surface_law single_law(double damping_s) {
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = 0;
  law.tangential_stiffness_n_m3 = 0;
  law.normal_damping_s = damping_s;
  return law;
}

// Indentation of the node at +x after `steps`, started `start` below the rest skin.
static double swing(double dt, double lambda, double damping_s, double start, uint32_t steps) {
  sonde_surface_law law = single_law(damping_s);
  sonde_world_def def = exact_def(dt, lambda);
  def.newton_iterations = 4;
  bench b = make(0, &law, &def);
  sonde_vec3 x[6];
  memcpy(x, b.model->surface.vertices, sizeof x);
  uint32_t top = 0;
  while (x[top].x < 0.99 * FIXTURE_RADIUS_M) top++;
  x[top].x -= start;
  sonde_state_set(b.state, x, NULL);
  for (uint32_t k = 0; k < steps; ++k) free_step(&b);
  double s = FIXTURE_RADIUS_M - sonde_state_positions(b.state)[top].x;
  clear(&b);
  return s;
}

// Small damped oscillation: s(t) = s0 e^(-dt)(cos wt + d/w sin wt), w0^2 = k0/density.
static void oscillation_is_the_analytic_one(void **state) {
  (void)state;
  double tau = 2e-3, w0 = sqrt(180000.0 / 20), d = 0.5 * tau * w0 * w0, w = sqrt(w0 * w0 - d * d);
  double start = 1e-6, t = 0.03;
  double expected = start * exp(-d * t) * (cos(w * t) + d / w * sin(w * t));
  double got = swing(1e-5, 0.5, tau, start, 3000);
  assert_near(got, expected, 0.01 * start * exp(-d * t));
}

// Error at a fixed time against a fine run falls with h (lambda = 1) and h^2 (lambda = 1/2).
static void orders_of_convergence(void **state) {
  (void)state;
  const double lambdas[2] = {1, 0.5}, expected[2] = {1, 2};
  double t = 0.02, tau = 1e-3, start = 0.01;
  for (int k = 0; k < 2; ++k) {
    double fine = swing(t / 16384, 0.5, tau, start, 16384);
    double coarse = fabs(swing(t / 128, lambdas[k], tau, start, 128) - fine);
    double middle = fabs(swing(t / 256, lambdas[k], tau, start, 256) - fine);
    double order = log(coarse / middle) / log(2);
    assert_true(fabs(order - expected[k]) < 0.15);
  }
}

// Explicit Euler on an underdamped spring is stable up to h = c/k = the damping time.
static void explicit_stability_boundary(void **state) {
  (void)state;
  double tau = 5e-3, start = 1e-7;
  uint32_t steps = 5000;
  assert_true(fabs(swing(0.98 * tau, 0, tau, start, steps)) < start);
  assert_true(fabs(swing(1.02 * tau, 0, tau, start, steps)) > start);
  // The implicit step takes the same spring at twenty times that step.
  assert_true(fabs(swing(20 * tau, 1, tau, start, 200)) < start);
}

static uint64_t press_hash(double sleep, uint32_t *awake, sonde_vec3 *position) {
  sonde_world_def def = fixture_world_def();
  def.sleep_displacement_m = sleep;
  if (sleep == 0) def.pcg.relative_residual = 1e-10;
  bench b = make(4, NULL, &def);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("point", &probe, NULL), SONDE_OK);
  for (int k = 0; k < 300; ++k)
    sonde_step(b.state, &probe, fixture_pose(fmin(0.006, -0.001 + 4e-5 * k)));
  *awake = sonde_state_awake(b.state);
  if (position) memcpy(position, sonde_state_positions(b.state), b.n * sizeof *position);
  uint64_t hash = sonde_state_hash(b.state);
  sonde_probe_clear(&probe);
  clear(&b);
  return hash;
}

static void repeated_runs_are_identical(void **state) {
  (void)state;
  uint32_t awake;
  assert_true(press_hash(5e-6, &awake, NULL) == press_hash(5e-6, &awake, NULL));
}

// Sleeping leaves nodes out and changes positions by micrometres only.
static void sleeping_is_harmless(void **state) {
  (void)state;
  static sonde_vec3 asleep[1026], awake[1026];
  uint32_t few, all;
  press_hash(5e-6, &few, asleep);
  press_hash(0, &all, awake);
  assert_int_equal(all, 1026);
  assert_true(few < 700 && few > 3);
  double worst = 0;
  for (int i = 0; i < 1026; ++i) worst = fmax(worst, v_distance(asleep[i], awake[i]));
  assert_true(worst < 5e-5);
  assert_true(worst > 0);
}

static void everything_sleeps_in_the_end(void **state) {
  (void)state;
  sonde_world_def def = fixture_world_def();
  bench b = make(3, NULL, &def);
  sonde_vec3 x[258], v[258];
  shake(&b, x, v, 5e-4, 0.01);
  for (int k = 0; k < 3000; ++k) free_step(&b);
  assert_int_equal(sonde_state_awake(b.state), 0);
  for (uint32_t i = 0; i < b.n; ++i)
    assert_true(v_distance(sonde_state_positions(b.state)[i], b.model->surface.vertices[i]) < 5e-5);
  clear(&b);
}

static void trouble_is_flagged_and_survived(void **state) {
  (void)state;
  bench b = make(2, NULL, NULL);
  sonde_vec3 v[66] = {{0}};
  v[3].y = NAN;
  sonde_state_set(b.state, NULL, v);
  free_step(&b);
  assert_true(sonde_state_flags(b.state) & SONDE_FLAG_NON_FINITE);
  assert_int_equal(sonde_state_flag_count(b.state), 1);
  free_step(&b);
  assert_int_equal(sonde_state_flags(b.state), 0);
  assert_memory_equal(sonde_state_positions(b.state), b.model->surface.vertices,
                      b.n * sizeof(sonde_vec3));
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("point", &probe, NULL), SONDE_OK);
  sonde_pose lost = fixture_pose(0.002);
  lost.position.x = NAN;
  sonde_step(b.state, &probe, lost);
  assert_near(v_norm(sonde_state_contact(b.state)->force_n), 0, 0);
  sonde_probe_clear(&probe);
  clear(&b);
}

static uint64_t allocations;
static void *count_allocation(size_t bytes, void *user) {
  (void)user;
  allocations++;
  return malloc(bytes);
}

static void steps_do_not_allocate(void **state) {
  (void)state;
  const sonde_allocator counting = {count_allocation, NULL, NULL};
  sonde_set_allocator(&counting);
  bench b = make(3, NULL, NULL);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  assert_true(allocations > 0);
  allocations = 0;
  for (int k = 0; k < 50; ++k) sonde_step(b.state, &probe, fixture_pose(0.0002 * k));
  sonde_settle(b.state, &probe, fixture_pose(0.008), 1e-6, 20);
  assert_true(v_norm(sonde_state_contact(b.state)->force_n) > 0.1);
  assert_int_equal(allocations, 0);
  sonde_probe_clear(&probe);
  clear(&b);
  sonde_set_allocator(NULL);
}

static void bad_options_are_named(void **state) {
  (void)state;
  sonde_model *model = fixture_model(0, NULL);
  sonde_world_def def = fixture_world_def();
  def.implicitness = 1.5;
  sonde_state *s;
  sonde_error error;
  assert_int_equal(sonde_state_create(model, &def, &s, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "implicitness"));
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(lambda_zero_is_explicit_euler),
                                     cmocka_unit_test(equals_equation_4),
                                     cmocka_unit_test(oscillation_is_the_analytic_one),
                                     cmocka_unit_test(orders_of_convergence),
                                     cmocka_unit_test(explicit_stability_boundary),
                                     cmocka_unit_test(repeated_runs_are_identical),
                                     cmocka_unit_test(sleeping_is_harmless),
                                     cmocka_unit_test(everything_sleeps_in_the_end),
                                     cmocka_unit_test(trouble_is_flagged_and_survived),
                                     cmocka_unit_test(steps_do_not_allocate),
                                     cmocka_unit_test(bad_options_are_named)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
