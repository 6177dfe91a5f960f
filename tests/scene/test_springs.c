// Deformable bodies: total mass, one oscillator, the explicit limit, order of convergence, the
// direct solution, the half space.
#include "scene/state.h"
#include "scene_fixture.h"
#include "sparse/block.h"

// Two held corners and a free one: along y the springs have 2 k cos^2(30 deg) = 1.5 k.
static const char OSCILLATOR[] =
    "sonde_scene: 1\ncontacts: none\n"
    "bodies:\n"
    "- name: flag\n"
    "  kind: springs\n"
    "  shape: {mesh: {file: ../../tests/scene/triangle.obj, unit_mm: 1}}\n"
    "  springs: {stiffness_n_m: 400, damping_n_s_m: 0.2}\n"
    "  mass_kg: 0.3\n"
    "  held_mm: [[[-60, -1, -1], [60, 1, 1]]]\n";

static world oscillator(void) {
  world w = {0};
  sonde_error error = {0};
  sonde_status status =
      sonde_scene_parse(OSCILLATOR, SONDE_SOURCE_DIR "/data/scenes/x.yaml", NULL, &w.scene, &error);
  if (!status) status = sonde_scene_state_create(w.scene, &w.state, &error);
  if (status) print_error("%s\n", error.message);
  assert_int_equal(status, SONDE_OK);
  return w;
}

static double apex(const world *w) { return sonde_scene_nodes(w->state, 0)[2].y; }

static void pull(world *w, double way_m) {
  sonde_vec3 x[3];
  memcpy(x, sonde_scene_nodes(w->state, 0), sizeof x);
  x[2].y += way_m;
  sonde_scene_set_nodes(w->state, 0, x, NULL);
}

// Frequency and decay of m x'' + 1.5 c x' + 1.5 k x = 0.
static void test_frequency_and_decay(void **unused) {
  (void)unused;
  world w = oscillator();
  set_step(&w, 1e-4, 0.5, 2);
  double rest = apex(&w), amplitude = 1e-5, m = 0.1, k = 1.5 * 400, c = 1.5 * 0.2;
  double decay = c / (2 * m), omega = sqrt(k / m - decay * decay);
  pull(&w, amplitude);
  double crossing[2] = {0, 0}, before = amplitude, peak = 0;
  int crossings = 0;
  while (crossings < 12) {
    steps(&w, 1);
    double now = apex(&w) - rest, t = sonde_scene_time(w.state);
    if (before > 0 && now <= 0) {
      double at = t - 1e-4 * now / (now - before);
      crossing[crossings > 0] = at;
      ++crossings;
    }
    if (crossings == 11) peak = fmax(peak, now);
    before = now;
  }
  double period = (crossing[1] - crossing[0]) / 11;
  assert_near(2 * SONDE_PI / period / omega, 1, 0.01);
  double t_peak = 11 * 2 * SONDE_PI / omega;
  assert_near(log(amplitude / peak) / t_peak / decay, 1, 0.01);
  world_end(&w);
}

// Eq. (4) itself, one linear solve per step, with lambda = 1/2: order 2 against the exact solution.
static void test_order_of_eq_4(void **unused) {
  (void)unused;
  double off[2];
  for (int k = 0; k < 2; ++k) {
    world w = oscillator();
    set_step(&w, k ? 1e-3 : 2e-3, 0.5, 1);
    double rest = apex(&w), amplitude = 1e-8, t = 0.2;
    double decay = 1.5 * 0.2 / 0.2, omega = sqrt(1.5 * 400 / 0.1 - decay * decay);
    pull(&w, amplitude);
    steps(&w, k ? 200 : 100);
    double exact = exp(-decay * t) * (cos(omega * t) + decay / omega * sin(omega * t));
    off[k] = fabs((apex(&w) - rest) / amplitude - exact);
    world_end(&w);
  }
  assert_true(off[1] < 0.01);
  assert_near(log2(off[0] / off[1]), 2, 0.1);
}

// Any undamped mode diverges under eq. (3); with damping c/k the limit is h = c/k.
static void test_explicit_limit(void **unused) {
  (void)unused;
  const double limit = 0.2 / 400;
  double reached[2];
  for (int side = 0; side < 2; ++side) {
    world w = oscillator();
    sonde_scene_step step = sonde_scene_get_step(w.scene);
    step.lambda = 0;
    step.dt_s = limit * (side ? 1.02 : 0.98);
    assert_int_equal(sonde_scene_set_step(w.scene, &step, NULL), SONDE_OK);
    double rest = apex(&w), last = 0;
    pull(&w, 1e-7);
    for (int k = 0; k < 150000; ++k) {
      steps(&w, 1);
      if (k >= 148000) last = fmax(last, fabs(apex(&w) - rest));
    }
    reached[side] = last / 1e-7;
    world_end(&w);
  }
  assert_true(reached[0] < 0.5);
  assert_true(reached[1] > 2);
}

static const char SHAKEN[] =
    "sonde_scene: 1\ngravity_m_s2: [0, 0, -9]\ncontacts: none\n"
    "bodies:\n"
    "- name: jelly\n"
    "  kind: lattice\n"
    "  shape: {box_mm: [40, 40, 60]}\n"
    "  lattice: {cell_mm: 20, youngs_pa: 2e4, damping_s: 2e-3}\n"
    "  density_kg_m3: 1000\n"
    "  held_mm: [[[-20, -20, 30], [20, 20, 30]]]\n"
    "- name: ball\n"
    "  kind: springs\n"
    "  shape: {sphere_mm: 20, edge_mm: 12}\n"
    "  springs: {stiffness_n_m: 100, damping_n_s_m: 0.05, bulk_n_m5: 1e9}\n"
    "  mass_kg: 0.05\n"
    "  velocity_m_s: [0.1, 0, 0]\n"
    "  spin_rad_s: [0, 0, 20]\n";

static void test_total_mass(void **unused) {
  (void)unused;
  world w = world_of(SHAKEN);
  assert_near(sonde_scene_body(w.scene, 0).mass.mass_kg, 0.096, 1e-15);
  assert_near(sonde_scene_body(w.scene, 1).mass.mass_kg, 0.05, 1e-17);
  world_end(&w);
}

// One step of eq. (3) by hand from the forces that springs must have.
static void test_lambda_zero_is_eq_3(void **unused) {
  (void)unused;
  world w = world_of(SHAKEN);
  set_step(&w, 1e-4, 0, 1);
  steps(&w, 20);
  sonde_body_info jelly = sonde_scene_body(w.scene, 0);
  uint32_t n = jelly.node_count;
  sonde_vec3 x[64], v[64], f[64];
  assert_true(n <= 64);
  memcpy(x, sonde_scene_nodes(w.state, 0), n * sizeof *x);
  memcpy(v, sonde_scene_node_velocities(w.state, 0), n * sizeof *v);
  // 3 x 3 x 4 nodes, x fastest; springs between neighbours and across the squares
  for (uint32_t i = 0; i < n; ++i) f[i] = vec3(0, 0, 0);
  uint32_t springs = 0;
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = i + 1; j < n; ++j) {
      int d[3], sum = 0, share = 1;
      const int size[3] = {3, 3, 4}, stride[3] = {1, 3, 9};
      for (int a = 0; a < 3; ++a) {
        int p = (int)i / stride[a] % size[a], q = (int)j / stride[a] % size[a];
        d[a] = abs(p - q);
        sum += d[a] > 1 ? 9 : d[a];
        if (d[a] == 0) share *= (p > 0) + (p < size[a] - 1);
      }
      if (sum > 2) continue;
      ++springs;
      double k = (sum == 1 ? 0.1 : 0.2) * 2e4 * 0.02 * share, rest = 0.02 * sqrt(sum);
      sonde_vec3 along = v_sub(x[j], x[i]);
      double length = v_norm(along);
      sonde_vec3 u = v_scale(along, 1 / length);
      double pull_n = k * (length - rest) + k * 2e-3 * v_dot(u, v_sub(v[j], v[i]));
      f[i] = v_madd(f[i], pull_n, u);
      f[j] = v_madd(f[j], -pull_n, u);
    }
  assert_int_equal(springs, jelly.spring_count);
  steps(&w, 1);
  const sonde_vec3 *after = sonde_scene_nodes(w.state, 0);
  const sonde_vec3 *faster = sonde_scene_node_velocities(w.state, 0);
  for (uint32_t i = 0; i < n; ++i) {
    if (i >= 27) { // held
      assert_near(v_distance(after[i], x[i]), 0, 0);
      continue;
    }
    int cells = 1;
    const int at[3] = {(int)i % 3, (int)i / 3 % 3, (int)i / 9}, most[3] = {2, 2, 3};
    for (int a = 0; a < 3; ++a) cells *= (at[a] > 0) + (at[a] < most[a]);
    double mass = 1e-3 * cells;
    sonde_vec3 moved = v_madd(x[i], 1e-4, v[i]);
    sonde_vec3 gained = v_madd(v_madd(v[i], 1e-4 / mass, f[i]), 1e-4, vec3(0, 0, -9));
    assert_near(v_distance(after[i], moved), 0, 1e-14 * 0.1);
    assert_near(v_distance(faster[i], gained), 0, 1e-14 * (1 + v_norm(gained)));
  }
  world_end(&w);
}

static double shaken_error(double dt_s, double lambda, uint32_t newton, sonde_vec3 *end,
                           const sonde_vec3 *exact) {
  world w = world_of(SHAKEN);
  set_step(&w, dt_s, lambda, newton);
  steps(&w, (uint32_t)round(0.04 / dt_s));
  double sum = 0;
  for (uint32_t b = 0, at = 0; b < 2; ++b)
    for (uint32_t i = 0; i < sonde_scene_body(w.scene, b).node_count; ++i, ++at) {
      end[at] = sonde_scene_nodes(w.state, b)[i];
      if (exact) sum += v_norm2(v_sub(end[at], exact[at]));
    }
  assert_unflagged(&w);
  world_end(&w);
  return sqrt(sum);
}

// The step converges with order 1 for lambda = 1 (also with one Newton iteration, eq. (4)), order 2
// for 1/2.
static void test_order_of_convergence(void **unused) {
  (void)unused;
  sonde_vec3 exact[400], end[400];
  shaken_error(5e-6, 0.5, 8, exact, NULL);
  double coarse = shaken_error(4e-4, 1, 1, end, exact), fine = shaken_error(2e-4, 1, 1, end, exact);
  assert_near(log2(coarse / fine), 1, 0.15);
  coarse = shaken_error(1e-4, 0.5, 8, end, exact);
  fine = shaken_error(5e-5, 0.5, 8, end, exact);
  assert_near(log2(coarse / fine), 2, 0.15);
}

// Conjugate gradients agree with Gaussian elimination on the matrix of a scene in contact.
static void multiply_dense(const sonde_scene_state *state, const sonde_active_set *active,
                           uint32_t column, double *out) {
  uint32_t n = state->scene->slot_count;
  sonde_vec3 *x = calloc(n, sizeof *x), *y = calloc(n, sizeof *y);
  (&x[active->rows[column / 3]].x)[column % 3] = 1;
  sonde_block_multiply(state->matrix, active, state->terms, state->term_count, x, y);
  for (uint32_t r = 0; r < active->row_count; ++r) memcpy(out + 3 * r, &y[active->rows[r]], 24);
  free(x);
  free(y);
}

static void eliminate(double *a, double *b, uint32_t n) { // column-major, symmetric positive
  for (uint32_t k = 0; k < n; ++k)
    for (uint32_t i = k + 1; i < n; ++i) {
      double factor = a[k * n + i] / a[k * n + k];
      if (factor == 0) continue;
      for (uint32_t j = k; j < n; ++j) a[j * n + i] -= factor * a[j * n + k];
      b[i] -= factor * b[k];
    }
  for (uint32_t k = n; k-- > 0;) {
    for (uint32_t j = k + 1; j < n; ++j) b[k] -= a[j * n + k] * b[j];
    b[k] /= a[k * n + k];
  }
}

static void test_gradients_against_elimination(void **unused) {
  (void)unused;
  world w = world_of(
      "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nmaterials:\n"
      "- {name: m, contact_stiffness_n_m3: 2e7, friction_static: 0.5}\nbodies:\n"
      "- {name: pad, kind: lattice, shape: {box_mm: [40, 40, 20]}, position_mm: [0, 0, -10], "
      "lattice: {cell_mm: 10, youngs_pa: 3e4, damping_s: 1e-3}, density_kg_m3: 1000, material: m}\n"
      "- {name: brick, shape: {box_mm: [25, 15, 10]}, mass_kg: 0.1, material: m, "
      "position_mm: [1, 2, 4.9], velocity_m_s: [0.01, 0, 0]}\n");
  steps(&w, 5);
  sonde_scene_state *state = w.state;
  sonde_active_set active = {state->active_rows, state->active_row_count, state->active_pairs,
                             state->active_pair_count};
  uint32_t n = 3 * active.row_count;
  assert_true(state->term_count > 10);
  double *a = calloc((size_t)n * n, sizeof *a), *b = calloc(n, sizeof *b), size = 0, off = 0;
  sonde_vec3 *x = calloc(state->scene->slot_count, sizeof *x);
  for (uint32_t k = 0; k < n; ++k) multiply_dense(state, &active, k, a + (size_t)k * n);
  uint64_t seed = 7;
  for (uint32_t r = 0; r < active.row_count; ++r) {
    sonde_vec3 right = fixture_vector(&seed, 1);
    state->residual[active.rows[r]] = right;
    memcpy(b + 3 * r, &right, sizeof right);
  }
  sonde_pcg_options options = {1e-12, 0, 5000};
  sonde_block_invert_diagonal(state->matrix, &active);
  sonde_pcg_result result = sonde_pcg_solve(state->matrix, &active, state->terms, state->term_count,
                                            state->residual, x, &state->scratch, &options);
  assert_true(result.converged);
  eliminate(a, b, n);
  for (uint32_t r = 0; r < active.row_count; ++r) {
    sonde_vec3 exact = vec3(b[3 * r], b[3 * r + 1], b[3 * r + 2]);
    size += v_norm2(exact);
    off += v_norm2(v_sub(x[active.rows[r]], exact));
  }
  assert_near(sqrt(off / size), 0, 1e-8);
  free(a);
  free(b);
  free(x);
  world_end(&w);
}

// A free ball of springs keeps both momenta (lambda = 1/2, angular to the order of the scheme).
static void test_ball_keeps_momentum(void **unused) {
  (void)unused;
  world w = world_of(SHAKEN);
  set_step(&w, 1e-3, 0.5, 8);
  sonde_body_measure start = measure(&w, "ball");
  steps(&w, 200);
  sonde_body_measure end = measure(&w, "ball");
  assert_near(v_distance(end.momentum_kg_m_s, vec3(start.momentum_kg_m_s.x, 0, -9 * 0.05 * 0.2)), 0,
              1e-9);
  sonde_vec3 about = v_sub(end.angular_kg_m2_s, v_cross(end.centre_m, end.momentum_kg_m_s));
  sonde_vec3 first = v_sub(start.angular_kg_m2_s, v_cross(start.centre_m, start.momentum_kg_m_s));
  assert_near(about.z / first.z, 1, 1e-6);
  world_end(&w);
}

// Point load on a half space with E and nu = 1/4 (Boussinesq). The far boundary is put where the
// solution has it, so that the block's size does not matter.
static sonde_vec3 boussinesq(sonde_vec3 at, double force_n, double youngs_pa) {
  const double nu = 0.25;
  double shear = youngs_pa / (2 * (1 + nu)), z = -at.z; // down into the block
  double r = sqrt(at.x * at.x + at.y * at.y), d = sqrt(r * r + z * z);
  double scale = force_n / (4 * SONDE_PI * shear);
  double radial = r > 0 ? scale * (r * z / (d * d * d) - (1 - 2 * nu) * r / (d * (d + z))) : 0;
  double down = scale * (2 * (1 - nu) / d + z * z / (d * d * d));
  return vec3(r > 0 ? radial * at.x / r : 0, r > 0 ? radial * at.y / r : 0, -down);
}

static void test_boussinesq(void **unused) {
  (void)unused;
  world w = world_of("sonde_scene: 1\ncontacts: none\nbodies:\n"
                     "- name: ground\n  kind: lattice\n"
                     "  shape: {box_mm: [240, 240, 120]}\n  position_mm: [0, 0, -60]\n"
                     "  lattice: {cell_mm: 10, youngs_pa: 1e5, damping_s: 0}\n"
                     "  density_kg_m3: 1000\n"
                     "  held_mm:\n"
                     "  - [[-120, -120, -120], [-120, 120, 0]]\n"
                     "  - [[120, -120, -120], [120, 120, 0]]\n"
                     "  - [[-120, -120, -120], [120, -120, 0]]\n"
                     "  - [[-120, 120, -120], [120, 120, 0]]\n"
                     "  - [[-120, -120, -120], [120, 120, -120]]\n"
                     "  loads:\n"
                     "  - {box_mm: [[0, 0, 0], [0, 0, 0]], force_n: [0, 0, -0.01]}\n");
  uint32_t n = sonde_scene_body(w.scene, 0).node_count;
  sonde_vec3 *x = calloc(n, sizeof *x);
  memcpy(x, sonde_scene_nodes(w.state, 0), n * sizeof *x);
  sonde_vec3 *rest = calloc(n, sizeof *rest);
  memcpy(rest, x, n * sizeof *rest);
  for (uint32_t i = 0; i < n; ++i) {
    bool held = fabs(fabs(x[i].x) - 0.12) < 1e-9 || fabs(fabs(x[i].y) - 0.12) < 1e-9 ||
                x[i].z < -0.12 + 1e-9;
    if (held) x[i] = v_add(x[i], boussinesq(rest[i], 0.01, 1e5));
  }
  sonde_scene_set_nodes(w.state, 0, x, NULL);
  sonde_scene_step step = sonde_scene_get_step(w.scene);
  step.dt_s = 1; // far beyond every period: each step goes to rest
  step.solver.relative_residual = 1e-9;
  assert_int_equal(sonde_scene_set_step(w.scene, &step, NULL), SONDE_OK);
  steps(&w, 6);
  const sonde_vec3 *end = sonde_scene_nodes(w.state, 0);
  double worst = 0, square = 0, size = 0;
  for (uint32_t i = 0; i < n; ++i) {
    double d = v_norm(rest[i]);
    if (d < 0.035 || d > 0.1) continue; // from 3.5 cells off the load
    sonde_vec3 exact = boussinesq(rest[i], 0.01, 1e5);
    double off = v_distance(v_sub(end[i], rest[i]), exact);
    worst = fmax(worst, off / v_norm(exact));
    square += off * off;
    size += v_norm2(exact);
  }
  print_message("Boussinesq: worst %.2f %%, rms %.2f %%\n", 100 * worst, 100 * sqrt(square / size));
  assert_true(worst < 0.05);
  free(x);
  free(rest);
  world_end(&w);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_frequency_and_decay),
      cmocka_unit_test(test_order_of_eq_4),
      cmocka_unit_test(test_explicit_limit),
      cmocka_unit_test(test_total_mass),
      cmocka_unit_test(test_lambda_zero_is_eq_3),
      cmocka_unit_test(test_order_of_convergence),
      cmocka_unit_test(test_gradients_against_elimination),
      cmocka_unit_test(test_ball_keeps_momentum),
      cmocka_unit_test(test_boussinesq),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
