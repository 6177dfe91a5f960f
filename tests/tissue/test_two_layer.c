// The tissue's forces against its energy, its matrix against its forces.
#include "../fixture.h"
#include "sparse/block.h"
#include "tissue/two_layer/linearise.h"

typedef struct bench {
  sonde_model *model;
  uint32_t n;
  sonde_vec3 *x, *v, *force, *product, *probe;
  sonde_block_matrix *matrix;
  sonde_tissue_node scratch[66];
} bench;

static sonde_surface_law full_law(void) {
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = 15;
  law.inplane_stiffness_n_m = 70;
  law.edge_stiffness_n_m = 300;
  return law;
}

// Sphere of 66 nodes, blown up by `stretch` and shaken.
static bench make(double stretch, double noise_m, sonde_surface_law law) {
  bench b = {.model = fixture_model(2, &law)};
  b.n = b.model->surface.vertex_count;
  fixture_vary_shear(b.model);
  sonde_vec3 **array[] = {&b.x, &b.v, &b.force, &b.product, &b.probe};
  for (int k = 0; k < 5; ++k) assert_non_null(*array[k] = SONDE_NEW(sonde_vec3, b.n));
  uint64_t seed = 5;
  for (uint32_t i = 0; i < b.n; ++i) {
    b.x[i] = v_add(v_scale(b.model->surface.vertices[i], stretch), fixture_vector(&seed, noise_m));
    b.v[i] = fixture_vector(&seed, 0.1);
    b.probe[i] = fixture_vector(&seed, 1);
  }
  assert_int_equal(sonde_block_matrix_create(b.n, b.model->topology.edge_count,
                                             (const uint32_t(*)[2])b.model->topology.edges,
                                             &b.matrix, NULL),
                   SONDE_OK);
  return b;
}

static void clear(bench *b) {
  sonde_vec3 *array[] = {b->x, b->v, b->force, b->product, b->probe};
  for (int k = 0; k < 5; ++k) sonde_free(array[k]);
  sonde_block_matrix_destroy(b->matrix);
  sonde_model_destroy(b->model);
}

static void evaluate(bench *b, double mass, double damping, double stiffness) {
  const sonde_tissue_scales scales = {mass, damping, stiffness};
  sonde_tissue_linearise(b->model, NULL, b->x, b->v, &scales, b->force, b->product, b->matrix,
                         b->scratch);
}

static void force_is_the_energys_gradient(void **state) {
  (void)state;
  bench b = make(0.97, 1e-3, full_law());
  memset(b.v, 0, b.n * sizeof *b.v);
  evaluate(&b, 0, 0, 1);
  double worst = 0, size = 0;
  for (uint32_t k = 0; k < 3 * b.n; ++k) {
    double *c = &(&b.x[0].x)[k], at = *c, h = 1e-7;
    *c = at + h;
    double up = sonde_tissue_energy(b.model, b.x);
    *c = at - h;
    double down = sonde_tissue_energy(b.model, b.x);
    *c = at;
    worst = fmax(worst, fabs((down - up) / (2 * h) - (&b.force[0].x)[k]));
    size = fmax(size, fabs((&b.force[0].x)[k]));
  }
  assert_true(size > 0.1);
  assert_true(worst < 1e-6 * size);
  clear(&b);
}

// Directional derivative of the forces, by position (sign -1: K) or velocity (C).
static double jacobian_error(bench *b, bool by_velocity) {
  double h = 1e-7, worst = 0, size = 0;
  sonde_vec3 *product = SONDE_NEW(sonde_vec3, b->n), *moved = by_velocity ? b->v : b->x;
  evaluate(b, 0, by_velocity ? 1 : 0, by_velocity ? 0 : 1);
  sonde_block_multiply(b->matrix, NULL, NULL, 0, b->probe, product);
  for (int side = 0; side < 2; ++side) {
    double step = side ? -2 * h : h;
    for (uint32_t i = 0; i < b->n; ++i) moved[i] = v_madd(moved[i], step, b->probe[i]);
    evaluate(b, 0, 0, 1);
    for (uint32_t i = 0; i < b->n; ++i)
      product[i] = v_madd(product[i], (side ? -1 : 1) / (2 * h), b->force[i]);
  }
  for (uint32_t i = 0; i < b->n; ++i) {
    worst = fmax(worst, v_norm(product[i]));
    size = fmax(size, v_norm(m_mul_v(b->matrix->diagonal[i], b->probe[i])));
  }
  sonde_free(product);
  return worst / size;
}

// Every edge is stretched, so that nothing is projected away; at rest the dampers do not turn.
static void stiffness_is_exact_in_extension(void **state) {
  (void)state;
  bench b = make(1.06, 3e-4, full_law());
  memset(b.v, 0, b.n * sizeof *b.v);
  assert_true(jacobian_error(&b, false) < 1e-6);
  clear(&b);
}

static void damping_is_exact(void **state) {
  (void)state;
  bench b = make(1.0, 1e-3, full_law());
  assert_true(jacobian_error(&b, true) < 1e-6);
  clear(&b);
}

static void product_is_stiffness_times_velocity(void **state) {
  (void)state;
  bench b = make(0.98, 1e-3, full_law());
  evaluate(&b, 0, 0, 1);
  sonde_vec3 *product = SONDE_NEW(sonde_vec3, b.n);
  sonde_block_multiply(b.matrix, NULL, NULL, 0, b.v, product);
  for (uint32_t i = 0; i < b.n; ++i)
    assert_true(v_distance(product[i], b.product[i]) < 1e-9 * (1 + v_norm(product[i])));
  sonde_free(product);
  clear(&b);
}

// Crushed to 70 %: every edge is compressed, the matrix stays positive.
static void matrix_is_positive_in_compression(void **state) {
  (void)state;
  sonde_surface_law law = full_law();
  law.edge_compression = 1;
  bench b = make(0.7, 2e-3, law);
  evaluate(&b, 0, 0, 1);
  sonde_vec3 *product = SONDE_NEW(sonde_vec3, b.n);
  uint64_t seed = 77;
  for (int trial = 0; trial < 50; ++trial) {
    double quadratic = 0;
    for (uint32_t i = 0; i < b.n; ++i) b.probe[i] = fixture_vector(&seed, 1);
    sonde_block_multiply(b.matrix, NULL, NULL, 0, b.probe, product);
    for (uint32_t i = 0; i < b.n; ++i) quadratic += v_dot(b.probe[i], product[i]);
    assert_true(quadratic > 0);
  }
  sonde_free(product);
  clear(&b);
}

// Edges push and pull in pairs: without anchors the forces add up to zero.
static void edges_conserve_momentum(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = 300;
  law.tangential_stiffness_n_m3 = 0;
  bench b = make(1.02, 2e-3, law);
  for (uint32_t i = 0; i < b.n; ++i) b.model->k0_n_m3[i] = 1e-30;
  evaluate(&b, 0, 0, 1);
  sonde_vec3 sum = vec3(0, 0, 0), torque = sum;
  double size = 0;
  for (uint32_t i = 0; i < b.n; ++i) {
    sum = v_add(sum, b.force[i]);
    torque = v_add(torque, v_cross(b.x[i], b.force[i]));
    size += v_norm(b.force[i]);
  }
  assert_true(size > 1);
  assert_true(v_norm(sum) < 1e-12 * size);
  assert_true(v_norm(torque) < 1e-13 * size);
  clear(&b);
}

// A sphere's skin that turns by the small angle w: t = w x X, |grad t|^2 = 2 w^2 - |w x N|^2, whose
// mean over the sphere is 4/3 w^2.
static void turning_stretches_the_skin(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = law.tangential_stiffness_n_m3 = 0;
  law.inplane_stiffness_n_m = 70;
  sonde_model *model = fixture_model(4, &law);
  uint32_t n = model->surface.vertex_count;
  sonde_vec3 *x = SONDE_NEW(sonde_vec3, n), axis = vec3(0.48, 0.6, 0.64);
  double w = 0.01, radius = FIXTURE_RADIUS_M;
  for (uint32_t i = 0; i < n; ++i)
    x[i] = v_madd(model->surface.vertices[i], w, v_cross(axis, model->surface.vertices[i]));
  double energy = 0.5 * 70 * 4 * M_PI * radius * radius * 4.0 / 3 * w * w;
  assert_near(sonde_tissue_energy(model, x) / energy, 1, 0.01);
  sonde_free(x);
  sonde_model_destroy(model);
}

// A part of the mesh gives the same rows as the whole when everything outside it is at rest.
static void part_equals_whole(void **state) {
  (void)state;
  bench b = make(1.0, 0, full_law());
  uint32_t rows[66], rim[66], edges[200], row_count = 0, rim_count = 0, edge_count = 0;
  uint64_t seed = 9;
  for (uint32_t i = 0; i < b.n; ++i) {
    b.v[i] = vec3(0, 0, 0);
    if (b.model->surface.vertices[i].x < 0.02) {
      rim[rim_count++] = i;
      continue;
    }
    rows[row_count++] = i;
    b.x[i] = v_add(b.x[i], fixture_vector(&seed, 1e-3));
  }
  for (uint32_t e = 0; e < b.model->topology.edge_count; ++e) {
    const uint32_t *p = b.model->topology.edges[e];
    if (fmax(b.model->surface.vertices[p[0]].x, b.model->surface.vertices[p[1]].x) >= 0.02)
      edges[edge_count++] = e;
  }
  uint32_t faces[256], face_count = 0;
  for (uint32_t f = 0; f < b.model->surface.face_count; ++f) {
    const uint32_t *v = b.model->surface.faces[f];
    const sonde_vec3 *x = b.model->surface.vertices;
    assert_true(face_count < SONDE_COUNT_OF(faces));
    if (fmax(x[v[0]].x, fmax(x[v[1]].x, x[v[2]].x)) >= 0.02) faces[face_count++] = f;
  }
  evaluate(&b, 1, 1, 1);
  sonde_vec3 whole[66];
  sonde_mat3 diagonal[66];
  memcpy(whole, b.force, sizeof whole);
  memcpy(diagonal, b.matrix->diagonal, sizeof diagonal);
  const sonde_tissue_part part = {rows,  row_count,  rim,   rim_count,
                                  edges, edge_count, faces, face_count};
  const sonde_tissue_scales scales = {1, 1, 1};
  sonde_tissue_linearise(b.model, &part, b.x, b.v, &scales, b.force, b.product, b.matrix,
                         b.scratch);
  assert_true(row_count > 5 && row_count < b.n);
  for (uint32_t r = 0; r < row_count; ++r) {
    assert_memory_equal(&b.force[rows[r]], &whole[rows[r]], sizeof *whole);
    assert_memory_equal(&b.matrix->diagonal[rows[r]], &diagonal[rows[r]], sizeof *diagonal);
  }
  clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(force_is_the_energys_gradient),
                                     cmocka_unit_test(stiffness_is_exact_in_extension),
                                     cmocka_unit_test(damping_is_exact),
                                     cmocka_unit_test(product_is_stiffness_times_velocity),
                                     cmocka_unit_test(matrix_is_positive_in_compression),
                                     cmocka_unit_test(edges_conserve_momentum),
                                     cmocka_unit_test(turning_stretches_the_skin),
                                     cmocka_unit_test(part_equals_whole)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
