// bench_solver [MOST]: the linear system of the ellipsoid's step (docs/performance.md). Per number
// of nodes: bytes of the block matrix, of a whole world of each engine and of the dense 3n x 3n
// matrix; time of conjugate gradients to a relative residual of 1e-8 and of a dense Cholesky
// factorisation with its solution, up to MOST nodes (default 1002), on a matrix of the same pattern
// and kind; their difference. Then the residual after each iteration at 1962 nodes, and the share
// of contact in the step.
#include "solver_cost.h"

#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const long NODES[] = {12, 42, 92, 162, 252, 492, 1002, 1962, 7842, 32492};
enum { SIZES = 10, REPEATS = 5 };

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

static void print_size(const sonde_model *model, solver_system *s, long most) {
  double mib = 1 << 20;
  solver_cost c = solver_cost_measure(s, REPEATS, model->surface.vertex_count <= most);
  printf("%6u %9.2f %9.2f %9.2f %12.1f %6u %9.3f %11.3f %9.1e\n", c.nodes, c.sparse_bytes / mib,
         (double)world_bytes(model, SONDE_ENGINE_DOUBLE) / mib,
         (double)world_bytes(model, SONDE_ENGINE_FAST) / mib, c.dense_bytes / mib, c.iterations,
         c.pcg_s * 1e3, c.dense_s * 1e3, c.difference);
  fflush(stdout);
}

static void print_history(solver_system *s, double stiffness) {
  printf("\nresidual over |b|, %u nodes, %g N/m\niteration residual\n", s->matrix->row_count,
         stiffness);
  for (uint32_t k = 0; k < 400; k += k < 4 ? 1 : k / 2) {
    sonde_pcg_result r = solver_system_solve(s, &(sonde_pcg_options){1e-12, 0, k});
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
  solver_system s = {0};
  sonde_status status = bench_ellipsoid_build(&scene, &model, error);
  if (!status) status = solver_system_create(model, stiffness, &s, error);
  if (!status && what == PART_SIZES) print_size(model, &s, most);
  if (!status && what == PART_HISTORY) print_history(&s, stiffness);
  for (int k = 0; !status && what == PART_STAGES && k < 2; ++k)
    status = print_stages(&scene, model, k ? SONDE_ENGINE_FAST : SONDE_ENGINE_DOUBLE, error);
  solver_system_clear(&s);
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
