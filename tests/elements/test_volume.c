// The solid without a factor: forces are derivatives of the energy and the tangent that of the
// forces, its linear law is the assembled one, turning costs the neo-Hookean one nothing, a uniform
// large strain of the boundary goes on inside, equilibria are balanced, all instruction sets give
// the same bits.
#include "solids.h"
#include "elements/volume.h"
#include "base/vector.h"

static const double YOUNG = 1e4, POISSON = 0.47;

static sonde_elastic_volume *make_volume(const sonde_tetrahedra *t, sonde_elastic_material material,
                                         sonde_dilatation dilatation, const uint8_t *held) {
  double *young = calloc(t->count, sizeof *young);
  for (uint32_t k = 0; k < t->count; ++k) young[k] = YOUNG * (1 + k % 3);
  const sonde_elastic_volume_def def = {.mesh = t,
                                        .material = material,
                                        .dilatation = dilatation,
                                        .held = held,
                                        .young_pa = young,
                                        .poisson = POISSON};
  sonde_elastic_volume *v = NULL;
  assert_ok(sonde_elastic_volume_create(&def, &v, &shape_error));
  free(young);
  return v;
}

static double *numbers(const sonde_tetrahedra *t) {
  return calloc(3 * (size_t)t->node_count, sizeof(double));
}

static void randomise(double *u, size_t n, uint64_t *seed, double size) {
  for (size_t k = 0; k < n; ++k) u[k] = shape_uniform(seed, -size, size);
}

static void test_derivatives(void **state) {
  (void)state;
  sonde_tetrahedra t = held_ball(0.05, 0.02, 0.02);
  const size_t n = 3 * (size_t)t.node_count;
  double *u = numbers(&t), *d = numbers(&t), *f = numbers(&t), *df = numbers(&t), *g = numbers(&t);
  uint64_t seed = 1;
  for (int k = 0; k < 6; ++k) {
    sonde_elastic_volume *v =
        make_volume(&t, (sonde_elastic_material)(k % 2), (sonde_dilatation)(k / 2), NULL);
    const double h = 1e-6;
    randomise(u, n, &seed, 1e-3);
    randomise(d, n, &seed, 1e-3);
    (void)sonde_elastic_volume_forces(v, u, f);
    double work = sonde_dot(f, d, (uint32_t)n);
    sonde_elastic_volume_tangent(v, d, df);
    for (size_t i = 0; i < n; ++i) u[i] += h * d[i];
    double high = sonde_elastic_volume_forces(v, u, f);
    for (size_t i = 0; i < n; ++i) u[i] -= 2 * h * d[i];
    double low = sonde_elastic_volume_forces(v, u, g), largest = 0, off = 0;
    assert_near(work, (high - low) / (2 * h), 1e-6 * fabs(work));
    for (size_t i = 0; i < n; ++i) {
      largest = fmax(largest, fabs(df[i]));
      off = fmax(off, fabs(df[i] - (f[i] - g[i]) / (2 * h)));
    }
    assert_true(off <= 1e-6 * largest);
    sonde_elastic_volume_destroy(v);
  }
  free(u), free(d), free(f), free(df), free(g);
  sonde_tetrahedra_clear(&t);
}

static void test_is_the_assembled_one(void **state) {
  (void)state;
  sonde_tetrahedra t = held_ball(0.05, 0.02, 0.015);
  double *u = numbers(&t), *f = numbers(&t), *young = calloc(t.count, sizeof *young);
  for (uint32_t k = 0; k < t.count; ++k) young[k] = YOUNG * (1 + k % 3);
  for (int kind = 0; kind < 3; ++kind) {
    sonde_elastic_volume *v = make_volume(&t, SONDE_LINEAR, (sonde_dilatation)kind, NULL);
    const sonde_elastic_def def = {.mesh = &t, .dilatation = (sonde_dilatation)kind};
    sonde_elastic *e = make_solid(&def, YOUNG, POISSON);
    assert_ok(sonde_elastic_set(e, young, POISSON, 0, &shape_error));
    const size_t n = 3 * (size_t)e->count;
    double *x = calloc(n, sizeof *x), *y = calloc(n, sizeof *y), largest = 0, off = 0;
    uint64_t seed = 2;
    randomise(x, n, &seed, 1e-3);
    memset(u, 0, 3 * (size_t)t.node_count * sizeof *u);
    for (uint32_t k = 0; k < e->count; ++k)
      memcpy(u + 3 * (size_t)e->node[k], x + 3 * (size_t)k, 24);
    sonde_elastic_multiply(e, x, y);
    (void)sonde_elastic_volume_forces(v, u, f);
    for (size_t k = 0; k < n; ++k) {
      largest = fmax(largest, fabs(y[k]));
      off = fmax(off, fabs(y[k] - f[3 * (size_t)e->node[k / 3] + k % 3]));
    }
    assert_true(off <= 1e-12 * largest);
    // A push at the pole, settled here and solved there.
    uint32_t pole = v_nearest(t.node, t.surface_count, vec3(0, 0, 0.05));
    memset(u, 0, 3 * (size_t)t.node_count * sizeof *u);
    memset(x, 0, n * sizeof *x), memset(y, 0, n * sizeof *y);
    u[3 * (size_t)pole + 2] = x[3 * (size_t)e->unknown[pole] + 2] = -1e-3;
    sonde_elastic_scratch *s;
    sonde_elastic_volume_result result;
    assert_ok(sonde_elastic_scratch_create(e, &s, &shape_error));
    assert_ok(sonde_elastic_solve(e, s, &pole, 1, y, x, &shape_error));
    assert_ok(sonde_elastic_volume_settle(v, &pole, 1, u, f, &result, &shape_error));
    assert_near(f[3 * (size_t)pole + 2] / y[3 * (size_t)e->unknown[pole] + 2], 1, 1e-7);
    free(x), free(y);
    sonde_elastic_scratch_destroy(s);
    sonde_elastic_destroy(e);
    sonde_elastic_volume_destroy(v);
  }
  free(u), free(f), free(young);
  sonde_tetrahedra_clear(&t);
}

// u = (G - I) (x - origin), where the held node is.
static void move_all(const sonde_tetrahedra *t, sonde_mat3 g, sonde_vec3 origin, double *u) {
  for (uint32_t i = 0; i < t->node_count; ++i) {
    sonde_vec3 from = v_sub(t->node[i], origin), d = v_sub(m_mul_v(g, from), from);
    u[3 * (size_t)i] = d.x, u[3 * (size_t)i + 1] = d.y, u[3 * (size_t)i + 2] = d.z;
  }
}

static void test_large_strains(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(10, 0.05);
  const sonde_tetrahedra_def how = {.edge_m = 0.015};
  sonde_tetrahedra t = make_mesh(&ball, NULL, &how);
  uint8_t *held = calloc(t.node_count, 1);
  held[0] = 7;
  double *u = numbers(&t), *f = numbers(&t), *want = numbers(&t);
  uint32_t *imposed = calloc(t.surface_count, sizeof *imposed);
  for (uint32_t k = 0; k < t.surface_count; ++k) imposed[k] = k;
  uint64_t seed = 3;
  for (int kind = 0; kind < 3; ++kind) {
    double *young = calloc(t.count, sizeof *young);
    for (uint32_t k = 0; k < t.count; ++k) young[k] = YOUNG;
    const sonde_elastic_volume_def def = {.mesh = &t,
                                          .material = SONDE_NEO_HOOKEAN,
                                          .dilatation = (sonde_dilatation)kind,
                                          .held = held,
                                          .young_pa = young,
                                          .poisson = POISSON};
    sonde_elastic_volume *v = NULL;
    assert_ok(sonde_elastic_volume_create(&def, &v, &shape_error));
    free(young);
    // A turn by any angle.
    move_all(&t, q_matrix(q_unit(shape_rotation(&seed))), t.node[0], u);
    double energy = sonde_elastic_volume_forces(v, u, f);
    assert_near(energy, 0, 1e-12 * YOUNG);
    for (size_t k = 0; k < 3 * (size_t)t.node_count; ++k) assert_near(f[k], 0, 1e-9);
    // 30 % of shear and 20 % of stretch at the boundary, the inside starting at rest.
    const sonde_mat3 g = {{{1.2, 0.3, 0}, {0, 0.95, 0.1}, {0, 0, 0.9}}};
    move_all(&t, g, t.node[0], want);
    memcpy(u, want, 3 * (size_t)t.node_count * sizeof *u);
    for (size_t k = 3 * (size_t)t.surface_count; k < 3 * (size_t)t.node_count; ++k)
      u[k] += shape_uniform(&seed, -1e-3, 1e-3);
    sonde_elastic_volume_result result;
    assert_ok(
        sonde_elastic_volume_settle(v, imposed, t.surface_count, u, f, &result, &shape_error));
    for (size_t k = 0; k < 3 * (size_t)t.node_count; ++k) assert_near(u[k], want[k], 1e-9);
    sonde_elastic_volume_destroy(v);
  }
  free(held), free(u), free(f), free(want), free(imposed);
  sonde_tetrahedra_clear(&t);
  sonde_mesh_clear(&ball);
}

// The pole pushed in by a fifth of the radius: balanced, stiffer than the linear law says.
static void test_push(void **state) {
  (void)state;
  sonde_tetrahedra t = held_ball(0.05, 0.02, 0.008);
  double *u = numbers(&t), *f = numbers(&t), force[2];
  uint32_t imposed[60], count = 0;
  for (uint32_t k = 0; k < t.surface_count; ++k)
    if (t.node[k].z > 0 && hypot(t.node[k].x, t.node[k].y) < 0.012) imposed[count++] = k;
  assert_in_range(count, 5, 60);
  for (int material = 0; material < 2; ++material) {
    sonde_elastic_volume *v =
        make_volume(&t, (sonde_elastic_material)material, SONDE_DILATATION_PATCH, NULL);
    sonde_elastic_volume_result result;
    memset(u, 0, 3 * (size_t)t.node_count * sizeof *u);
    for (int step = 1; step <= 5; ++step) {
      for (uint32_t k = 0; k < count; ++k) u[3 * (size_t)imposed[k] + 2] = -0.002 * step;
      assert_ok(sonde_elastic_volume_settle(v, imposed, count, u, f, &result, &shape_error));
    }
    force[material] = 0;
    for (uint32_t k = 0; k < count; ++k) force[material] -= f[3 * (size_t)imposed[k] + 2];
    print_message("%s: %.3f N at 10 mm, last step %u Newton and %u conjugate gradient iterations\n",
                  material ? "neo-Hookean" : "linear", force[material], result.newton, result.cg);
    sonde_elastic_volume_destroy(v);
  }
  assert_true(force[1] > 1.02 * force[0] && force[1] < 2 * force[0]);
  free(u), free(f);
  sonde_tetrahedra_clear(&t);
}

static void test_same_bits(void **state) {
  (void)state;
  sonde_tetrahedra t = held_ball(0.05, 0.02, 0.02);
  const size_t n = 3 * (size_t)t.node_count;
  double *u = numbers(&t), *d = numbers(&t), *f = numbers(&t), *df = numbers(&t);
  uint64_t seed = 4, first = 0;
  randomise(u, n, &seed, 1e-3);
  randomise(d, n, &seed, 1e-3);
  const sonde_elastic_volume_kernels *known[] = {
      &sonde_elastic_volume_kernels_base,
#ifdef __x86_64__
      &sonde_elastic_volume_kernels_avx2,
      &sonde_elastic_volume_kernels_avx512,
#endif
  };
  sonde_elastic_volume *v = make_volume(&t, SONDE_NEO_HOOKEAN, SONDE_DILATATION_PATCH, NULL);
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k) {
    if (!sonde_vectors_serve(known[k]->name, NULL)) continue;
    v->kernels = known[k];
    (void)sonde_elastic_volume_forces(v, u, f);
    sonde_elastic_volume_tangent(v, d, df);
    uint64_t hash = sonde_hash(sonde_hash(0, f, n * sizeof *f), df, n * sizeof *df);
    if (k == 0) first = hash;
    assert_true(hash == first);
  }
  sonde_elastic_volume_destroy(v);
  free(u), free(d), free(f), free(df);
  sonde_tetrahedra_clear(&t);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_derivatives),   cmocka_unit_test(test_is_the_assembled_one),
      cmocka_unit_test(test_large_strains), cmocka_unit_test(test_push),
      cmocka_unit_test(test_same_bits),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
