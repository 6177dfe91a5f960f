// Conjugate gradients against a dense Cholesky factorisation on the matrix of an implicit step.
#include "solver_cost.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// M + h C + h^2 K at rest: masses, anchors of 5e5 N/m^3 and springs of `stiffness` along the edges,
// each with a hundredth of it across.
static void fill(const sonde_model *model, double stiffness, sonde_block_matrix *a) {
  double h = 1e-3, s = (h * h + h * model->law.edge_damping_s) * stiffness;
  const sonde_topology *t = &model->topology;
  for (uint32_t i = 0; i < t->vertex_count; ++i)
    for (int c = 0; c < 3; ++c)
      a->diagonal[i].m[c][c] = model->mass_kg[i] + h * h * model->k0_n_m3[i] * model->area_m2[i];
  for (uint32_t e = 0; e < t->edge_count; ++e) {
    uint32_t i = t->edges[e][0], j = t->edges[e][1];
    sonde_vec3 x = model->surface.vertices[i], y = model->surface.vertices[j];
    const double d[3] = {y.x - x.x, y.y - x.y, y.z - x.z};
    double length2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        double k = s * (0.99 * d[r] * d[c] / length2 + (r == c ? 0.01 : 0));
        a->diagonal[i].m[r][c] += k;
        a->diagonal[j].m[r][c] += k;
        a->upper[e].m[r][c] -= k;
      }
  }
}

static double *make_dense(const sonde_block_matrix *a) {
  size_t n = 3 * (size_t)a->row_count;
  double *dense = calloc(n * n, sizeof *dense);
  for (uint32_t i = 0; dense && i < a->row_count; ++i)
    for (uint32_t r = 0; r < 3; ++r)
      for (uint32_t c = 0; c < 3; ++c) dense[(3 * i + r) * n + 3 * i + c] = a->diagonal[i].m[r][c];
  for (uint32_t e = 0; dense && e < a->pair_count; ++e)
    for (uint32_t r = 0; r < 3; ++r)
      for (uint32_t c = 0; c < 3; ++c)
        dense[(3 * a->pairs[e][1] + c) * n + 3 * a->pairs[e][0] + r] = a->upper[e].m[r][c];
  return dense;
}

// Lower Cholesky factor by rows, in place, then both triangular solutions.
static void solve_dense(double *l, size_t n, double *x) {
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j <= i; ++j) {
      const double *a = l + i * n, *b = l + j * n;
      double part[4] = {0}; // four sums at a time
      size_t k = 0;
      for (; k + 4 <= j; k += 4)
        for (size_t c = 0; c < 4; ++c) part[c] += a[k + c] * b[k + c];
      for (; k < j; ++k) part[0] += a[k] * b[k];
      double sum = l[i * n + j] - (part[0] + part[1] + part[2] + part[3]);
      l[i * n + j] = i == j ? sqrt(sum) : sum / l[j * n + j];
    }
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < i; ++k) x[i] -= l[i * n + k] * x[k];
    x[i] /= l[i * n + i];
  }
  for (size_t i = n; i-- > 0;) {
    x[i] /= l[i * n + i];
    for (size_t k = 0; k < i; ++k) x[k] -= l[i * n + k] * x[i];
  }
}

sonde_status solver_system_create(const sonde_model *model, double stiffness, solver_system *s,
                                  sonde_error *error) {
  assert(stiffness > 0);
  uint32_t n = model->surface.vertex_count;
  const sonde_topology *t = &model->topology;
  sonde_status status = sonde_block_matrix_create(n, t->edge_count, (const uint32_t(*)[2])t->edges,
                                                  &s->matrix, error);
  s->memory = calloc(6 * (size_t)n, sizeof *s->memory);
  if (status || !s->memory) return status ? status : SONDE_MEMORY;
  sonde_vec3 *m = s->memory;
  s->scratch = (sonde_pcg_scratch){m, m + n, m + 2 * n, m + 3 * n};
  s->right = m + 4 * n, s->solution = m + 5 * n;
  for (uint32_t i = 0; i < 20 && i < n; ++i) s->right[i] = (sonde_vec3){0, 0, -1e-3};
  fill(model, stiffness, s->matrix);
  sonde_block_invert_diagonal(s->matrix, &(sonde_active_set){0});
  return SONDE_OK;
}

void solver_system_clear(solver_system *s) {
  sonde_block_matrix_destroy(s->matrix);
  free(s->memory);
}

sonde_pcg_result solver_system_solve(solver_system *s, const sonde_pcg_options *options) {
  memset(s->solution, 0, s->matrix->row_count * sizeof *s->solution);
  return sonde_pcg_solve(s->matrix, &(sonde_active_set){0}, NULL, 0, s->right, s->solution,
                         &s->scratch, options);
}

static double difference(const solver_system *s, const double *x) {
  double sum = 0, size = 0;
  for (uint32_t i = 0; i < s->matrix->row_count; ++i) {
    sonde_vec3 a = s->solution[i];
    sum += pow(a.x - x[3 * i], 2) + pow(a.y - x[3 * i + 1], 2) + pow(a.z - x[3 * i + 2], 2);
    size += a.x * a.x + a.y * a.y + a.z * a.z;
  }
  return sqrt(sum / size);
}

static double time_dense(solver_system *s, double *off) {
  size_t n = 3 * (size_t)s->matrix->row_count;
  double *dense = make_dense(s->matrix), *x = malloc(n * sizeof *x), taken = NAN;
  if (dense && x) {
    memcpy(x, s->right, n * sizeof *x);
    double start = now();
    solve_dense(dense, n, x);
    taken = now() - start;
    *off = difference(s, x);
  }
  free(dense);
  free(x);
  return taken;
}

solver_cost solver_cost_measure(solver_system *s, int repeats, bool dense) {
  assert(s->matrix && repeats > 0);
  double n = 3.0 * s->matrix->row_count;
  solver_cost c = {.nodes = s->matrix->row_count,
                   .sparse_bytes = (double)sonde_block_matrix_bytes(s->matrix),
                   .dense_bytes = n * n * sizeof(double),
                   .pcg_s = INFINITY,
                   .dense_s = NAN,
                   .difference = NAN};
  for (int k = 0; k < repeats; ++k) {
    double start = now();
    c.iterations = solver_system_solve(s, &(sonde_pcg_options){1e-8, 0, 5000}).iterations;
    c.pcg_s = fmin(c.pcg_s, now() - start);
  }
  if (dense) c.dense_s = time_dense(s, &c.difference);
  return c;
}
