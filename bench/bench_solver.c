// bench_solver [MOST]: the linear system of the ellipsoid's step (docs/performance.md). Per number
// of nodes: bytes of the block matrix, of a whole world of each engine and of the dense 3n x 3n
// matrix; time of conjugate gradients to a relative residual of 1e-8 and of a dense Cholesky
// factorisation with its solution, up to MOST nodes (default 1002), on a matrix of the same pattern
// and kind; their difference. Then the residual after each iteration at 1962 nodes, and the share
// of contact in the step.
#include "bench_ellipsoid.h"

#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const long NODES[] = {12, 42, 92, 162, 252, 492, 1002, 1962, 7842, 32492};
enum { SIZES = 10, REPEATS = 5 };

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static size_t held;
static void *take(size_t bytes, void *user) {
  (void)user;
  void *p = malloc(bytes);
  if (p) held += malloc_usable_size(p);
  return p;
}
static void give(void *p, void *user) {
  (void)user;
  if (p) held -= malloc_usable_size(p);
  free(p);
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

// Four sums at a time.
static double dot(const double *a, const double *b, size_t n) {
  double sum[4] = {0};
  size_t k = 0;
  for (; k + 4 <= n; k += 4)
    for (size_t c = 0; c < 4; ++c) sum[c] += a[k + c] * b[k + c];
  for (; k < n; ++k) sum[0] += a[k] * b[k];
  return sum[0] + sum[1] + sum[2] + sum[3];
}

// Lower Cholesky factor by rows, in place, then both triangular solutions.
static void solve_dense(double *l, size_t n, double *x) {
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j <= i; ++j) {
      double sum = l[i * n + j] - dot(l + i * n, l + j * n, j);
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

typedef struct linear_system {
  sonde_block_matrix *matrix;
  sonde_vec3 *memory, *right, *solution;
  sonde_pcg_scratch scratch;
} linear_system;

// A push on the 20 first nodes.
static sonde_status make_system(const sonde_model *model, double stiffness, linear_system *s,
                                sonde_error *error) {
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

static sonde_pcg_result solve(linear_system *s, const sonde_pcg_options *options) {
  memset(s->solution, 0, s->matrix->row_count * sizeof *s->solution);
  return sonde_pcg_solve(s->matrix, &(sonde_active_set){0}, NULL, 0, s->right, s->solution,
                         &s->scratch, options);
}

static double difference(const linear_system *s, const double *x) {
  double sum = 0, size = 0;
  for (uint32_t i = 0; i < s->matrix->row_count; ++i) {
    sonde_vec3 a = s->solution[i];
    sum += pow(a.x - x[3 * i], 2) + pow(a.y - x[3 * i + 1], 2) + pow(a.z - x[3 * i + 2], 2);
    size += a.x * a.x + a.y * a.y + a.z * a.z;
  }
  return sqrt(sum / size);
}

static double time_dense(linear_system *s, double *off) {
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

static size_t world_bytes(const sonde_model *model, sonde_engine engine) {
  sonde_world_def def = bench_ellipsoid_world(1e-3);
  def.newton_iterations = 1;
  def.engine = engine;
  sonde_state *state = NULL;
  size_t before = held;
  sonde_status status = sonde_state_create(model, &def, &state, NULL);
  size_t bytes = held - before;
  sonde_state_destroy(state);
  return status ? 0 : bytes;
}

static void print_size(const sonde_model *model, linear_system *s, long most) {
  uint32_t n = model->surface.vertex_count;
  double best = INFINITY, off = NAN, dense = NAN, mib = 1 << 20;
  sonde_pcg_result result = {0};
  for (int k = 0; k < REPEATS; ++k) {
    double start = now();
    result = solve(s, &(sonde_pcg_options){1e-8, 0, 5000});
    best = fmin(best, now() - start);
  }
  if (n <= most) dense = time_dense(s, &off);
  printf("%6u %9.2f %9.2f %9.2f %12.1f %6u %9.3f %11.3f %9.1e\n", n,
         (double)sonde_block_matrix_bytes(s->matrix) / mib,
         (double)world_bytes(model, SONDE_ENGINE_DOUBLE) / mib,
         (double)world_bytes(model, SONDE_ENGINE_FAST) / mib, 72.0 * n * n / mib, result.iterations,
         best * 1e3, dense * 1e3, off);
  fflush(stdout);
}

static void print_history(linear_system *s, double stiffness) {
  printf("\nresidual over |b|, %u nodes, %g N/m\niteration residual\n", s->matrix->row_count,
         stiffness);
  for (uint32_t k = 0; k < 400; k += k < 4 ? 1 : k / 2) {
    sonde_pcg_result r = solve(s, &(sonde_pcg_options){1e-12, 0, k});
    printf("%9u %.2e\n", r.iterations, r.residual / r.reference);
    if (r.converged) break;
  }
}

// Share of the stages in the whole scene of 0.5 s.
static sonde_status print_stages(const bench_ellipsoid *scene, const sonde_model *model,
                                 sonde_engine engine, sonde_error *error) {
  sonde_world_def def = bench_ellipsoid_world(1e-3);
  def.newton_iterations = 1;
  def.engine = engine;
  sonde_state *state = NULL;
  sonde_probe probe = {0};
  sonde_stage_times sum = {0};
  sonde_status status = sonde_probe_create("ball:30", &probe, error);
  if (!status) status = sonde_state_create(model, &def, &state, error);
  for (int k = 1; !status && k <= 500; ++k) {
    sonde_step(state, &probe, bench_ellipsoid_pose(scene, k * 1e-3));
    sonde_stage_times t = sonde_state_times(state);
    sum.contact_s += t.contact_s, sum.assembly_s += t.assembly_s;
    sum.solve_s += t.solve_s, sum.update_s += t.update_s;
  }
  double all = sum.contact_s + sum.assembly_s + sum.solve_s + sum.update_s;
  if (!status)
    printf("%6u %-7s %9.4f %8.1f %8.1f %8.1f %8.1f\n", model->surface.vertex_count,
           engine == SONDE_ENGINE_FAST ? "fast" : "double", all / 500 * 1e3,
           100 * sum.contact_s / all, 100 * sum.assembly_s / all, 100 * sum.solve_s / all,
           100 * sum.update_s / all);
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  return status;
}

typedef enum part { PART_SIZES, PART_HISTORY, PART_STAGES } part;

static sonde_status show(part what, long nodes, double stiffness, long most, sonde_error *error) {
  bench_ellipsoid scene = {nodes, stiffness, 1};
  sonde_model *model = NULL;
  linear_system s = {0};
  sonde_status status = bench_ellipsoid_build(&scene, &model, error);
  if (!status) status = make_system(model, stiffness, &s, error);
  if (!status && what == PART_SIZES) print_size(model, &s, most);
  if (!status && what == PART_HISTORY) print_history(&s, stiffness);
  for (int k = 0; !status && what == PART_STAGES && k < 2; ++k)
    status = print_stages(&scene, model, k ? SONDE_ENGINE_FAST : SONDE_ENGINE_DOUBLE, error);
  sonde_block_matrix_destroy(s.matrix);
  free(s.memory);
  sonde_model_destroy(model);
  return status;
}

int main(int argc, char **argv) {
  long most = argc > 1 ? atol(argv[1]) : 1002;
  if (argc > 2 || most < 0) {
    fprintf(stderr,
            "usage: bench_solver [MOST]: nodes of the largest dense matrix, default 1002\n");
    return 2;
  }
  sonde_set_allocator(&(sonde_allocator){take, give, NULL});
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  printf(" nodes matrix_MB double_MB   fast_MB     dense_MB pcg_it    pcg_ms    dense_ms "
         "difference\n");
  for (int k = 0; !status && k < SIZES; ++k) status = show(PART_SIZES, NODES[k], 200, most, &error);
  if (!status) status = show(PART_HISTORY, 1962, 200, 0, &error);
  if (!status) status = show(PART_HISTORY, 1962, 20000, 0, &error);
  printf("\n nodes engine    step_ms contact%% assemb%%   solve%%  update%%\n");
  for (int k = 7; !status && k < SIZES; ++k) status = show(PART_STAGES, NODES[k], 200, 0, &error);
  if (status) fprintf(stderr, "bench_solver: %s\n", error.message);
  return status ? 1 : 0;
}
