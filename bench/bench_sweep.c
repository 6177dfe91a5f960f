// bench_sweep: the ellipsoid scene over stiffness, step, nodes and engine (docs/performance.md).
// A run blows up when a number is not finite, a flag says so, or a node moves more than 3 cm where
// the ball presses 2 cm deep. Prints a row per stiffness and step, and every failure.
#include "bench_ellipsoid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double STIFFNESS[] = {200, 630, 2000, 6300, 20000},
                    STEP_S[] = {5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2};
static const long NODES[] = {492, 1962, 7842};
enum { STIFFNESSES = 5, STEPS = 6, SIZES = 3 };

typedef struct outcome {
  double most_move_m, most_force_n;
  unsigned flags;
  uint64_t not_converged;
} outcome;

static double size_of(sonde_vec3 a) { return sqrt(a.x * a.x + a.y * a.y + a.z * a.z); }

static void look(sonde_state *state, outcome *seen) {
  const sonde_model *model = sonde_state_model(state);
  const sonde_vec3 *x = sonde_state_positions(state), *rest = model->surface.vertices;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 d = {x[i].x - rest[i].x, x[i].y - rest[i].y, x[i].z - rest[i].z};
    double move = size_of(d);
    if (!(move <= seen->most_move_m)) seen->most_move_m = isfinite(move) ? move : INFINITY;
  }
  seen->most_force_n = fmax(seen->most_force_n, size_of(sonde_state_contact(state)->force_n));
  seen->flags |= sonde_state_flags(state);
  seen->not_converged += (sonde_state_flags(state) & SONDE_FLAG_NOT_CONVERGED) != 0;
}

static sonde_status play(const bench_ellipsoid *scene, const sonde_model *model,
                         const sonde_probe *probe, const sonde_world_def *def, outcome *seen,
                         sonde_error *error) {
  sonde_state *state = NULL;
  sonde_status status = sonde_state_create(model, def, &state, error);
  *seen = (outcome){0};
  for (long k = 1; !status && (double)k * def->dt_s <= 0.5 + 1e-9; ++k) {
    sonde_step(state, probe, bench_ellipsoid_pose(scene, (double)k * def->dt_s));
    look(state, seen);
  }
  sonde_state_destroy(state);
  return status;
}

static bool blew_up(const outcome *o) {
  return !(o->most_move_m <= 0.03) || (o->flags & SONDE_FLAG_NON_FINITE);
}

// Both engines, all steps; returns how many runs blew up.
static int sweep_model(const bench_ellipsoid *scene, const sonde_model *model,
                       const sonde_probe *probe, uint32_t newton, sonde_error *error) {
  int failed = 0;
  for (int h = 0; h < STEPS; ++h)
    for (int engine = 0; engine < 2; ++engine) {
      sonde_world_def def = bench_ellipsoid_world(STEP_S[h]);
      def.newton_iterations = newton;
      def.engine = engine ? SONDE_ENGINE_FAST : SONDE_ENGINE_DOUBLE;
      outcome o;
      if (play(scene, model, probe, &def, &o, error)) return failed + 1;
      failed += blew_up(&o);
      printf("%7.0f %6.1f %6u %-6s %8.2f %9.1f %6lu %s\n", scene->stiffness, STEP_S[h] * 1e3,
             model->surface.vertex_count, engine ? "fast" : "double", o.most_move_m * 1e3,
             o.most_force_n, (unsigned long)o.not_converged, blew_up(&o) ? "BLEW UP" : "");
      fflush(stdout);
    }
  return failed;
}

int main(int argc, char **argv) {
  int sizes = argc > 1 ? atoi(argv[1]) : SIZES, newton = argc > 2 ? atoi(argv[2]) : 4, failed = 0;
  if (argc > 3 || sizes < 1 || sizes > SIZES || newton < 1 || newton > 100) {
    fprintf(stderr,
            "usage: bench_sweep [SIZES [NEWTON]]: how many of 492, 1962 and 7842 nodes, 1 to "
            "3; Newton iterations of a step, default 4; FAST: at most\n");
    return 2;
  }
  sonde_error error = {0};
  sonde_probe probe = {0};
  if (sonde_probe_create("ball:30", &probe, &error)) return 1;
  printf("k_N_m   dt_ms  nodes engine  move_mm   force_N unconv\n");
  for (int n = 0; n < sizes; ++n)
    for (int k = 0; k < STIFFNESSES; ++k) {
      bench_ellipsoid scene = {NODES[n], STIFFNESS[k], 1};
      sonde_model *model = NULL;
      sonde_status status = bench_ellipsoid_build(&scene, &model, &error);
      failed += status ? 1 : sweep_model(&scene, model, &probe, (uint32_t)newton, &error);
      sonde_model_destroy(model);
    }
  if (error.message[0]) fprintf(stderr, "bench_sweep: %s\n", error.message);
  printf("%d runs, %d blew up\n", sizes * STIFFNESSES * STEPS * 2, failed);
  sonde_probe_clear(&probe);
  return failed ? 1 : 0;
}
