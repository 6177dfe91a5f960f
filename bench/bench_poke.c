// bench_poke MODEL [SECONDS [SEED [FIRST COUNT [DT_MS]]]]: random poking of a model with every
// probe, law, engine and friction in turn, SECONDS of simulated time in all (default 600); FIRST
// and COUNT choose some of the 48 runs, DT_MS the step (1). Prints a row per run and the laws that
// broke (poke.h); exit code 1 if any did, or if a step took memory.
#include "poke.h"
#include "sonde/sonde.h"

#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const char *const PROBES[] = {"point",  "linear",  "square",
                                     "sphere", "ball:20", "rect:24x40"};
enum { PROBE_COUNT = 6, RUNS = 2 * 2 * 2 * PROBE_COUNT };

// Bytes that the library holds and how often it asked.
typedef struct account {
  size_t bytes, asked;
} account;

static void *take(size_t bytes, void *user) {
  account *a = user;
  void *p = malloc(bytes);
  a->asked++;
  if (p) a->bytes += malloc_usable_size(p);
  return p;
}

static void give(void *p, void *user) {
  account *a = user;
  if (p) a->bytes -= malloc_usable_size(p);
  free(p);
}

typedef struct run {
  const sonde_model *model;
  sonde_world_def def;
  const char *probe;
  uint64_t seed;
  long ticks;
} run;

static run run_of(int k, const sonde_model *model, long ticks, uint64_t seed) {
  run r = {model, sonde_world_def_default(), PROBES[k / 8], seed + (uint64_t)k, ticks};
  r.def.engine = k & 1 ? SONDE_ENGINE_DOUBLE : SONDE_ENGINE_FAST;
  r.def.contact_law = k & 2 ? SONDE_CONTACT_NODES : SONDE_CONTACT_FOUNDATION;
  if (k & 4) r.def.friction.mu_static = 0.5, r.def.friction.mu_kinetic = 0.3;
  return r;
}

// Pokes; prints the first ticks that break a law and counts all of them.
static long poke_on(const run *r, sonde_state *state, const sonde_probe *probe, poke_watch *watch) {
  poke_def def = poke_def_default();
  poke path = poke_begin(r->model, &def, r->seed);
  long broken = 0;
  for (long k = 0; k < r->ticks; ++k) {
    sonde_vec3 f = sonde_state_contact(state)->force_n;
    sonde_pose pose = poke_next(&path, sqrt(f.x * f.x + f.y * f.y + f.z * f.z));
    sonde_step(state, probe, pose);
    const char *law = poke_check(watch, state, pose);
    if (law && broken++ < 3) printf("  tick %ld of seed %lu: %s\n", k, (unsigned long)r->seed, law);
  }
  return broken;
}

static long play(const run *r, account *memory) {
  sonde_state *state = NULL;
  sonde_probe probe = {0};
  sonde_error error = {0};
  poke_watch watch = {.least_forward = 1};
  if (sonde_state_create(r->model, &r->def, &state, &error) ||
      sonde_probe_create(r->probe, &probe, &error)) {
    printf("%s\n", error.message);
    return 1;
  }
  size_t asked = memory->asked;
  long broken = poke_on(r, state, &probe, &watch);
  if (memory->asked != asked) broken++, printf("  a step took memory\n");
  printf("%-10s %-6s %-10s %8.1f %7ld %6.1f %6.1f %8lu %6.1f %6.3f %7.3f %5lu %5lu %6ld\n",
         r->probe, r->def.engine == SONDE_ENGINE_FAST ? "fast" : "double",
         r->def.contact_law == SONDE_CONTACT_NODES ? "nodes" : "foundation",
         r->def.friction.mu_static, r->ticks, 100.0 * (double)watch.touching / (double)watch.ticks,
         watch.most_force_n, (unsigned long)watch.pressed, 1e3 * watch.most_move_m,
         watch.most_share, watch.least_forward, (unsigned long)watch.not_converged,
         (unsigned long)watch.full, broken);
  fflush(stdout);
  sonde_probe_clear(&probe);
  sonde_state_destroy(state);
  return broken;
}

int main(int argc, char **argv) {
  long first = argc > 5 ? atol(argv[4]) : 0, count = argc > 5 ? atol(argv[5]) : RUNS;
  if (argc < 2 || argc > 7 || first < 0 || count < 1 || first + count > RUNS) {
    fprintf(stderr,
            "usage: bench_poke MODEL [SECONDS [SEED [FIRST COUNT [DT_MS]]]], runs 0 to 47\n");
    return 2;
  }
  account memory = {0};
  sonde_set_allocator(&(sonde_allocator){take, give, &memory});
  sonde_error error = {0};
  sonde_model *model = NULL;
  if (sonde_model_load(argv[1], &model, &error)) {
    fprintf(stderr, "bench_poke: %s\n", error.message);
    return 2;
  }
  double seconds = argc > 2 ? atof(argv[2]) : 600;
  uint64_t seed = argc > 3 ? strtoul(argv[3], NULL, 10) : 1;
  size_t before = memory.bytes;
  double dt_ms = argc > 6 ? atof(argv[6]) : 1;
  long broken = 0, ticks = (long)(seconds * 1e3 / (RUNS * dt_ms) + 0.5);
  printf("probe      engine law              mu   ticks touch%% most_N  ticks>50N move_mm s/xm "
         "forward "
         "unconv full broken\n");
  for (long k = first; k < first + count; ++k) {
    run r = run_of((int)k, model, ticks, seed);
    r.def.dt_s = 1e-3 * dt_ms;
    broken += play(&r, &memory);
  }
  printf("%ld ticks, %ld broken laws, %ld bytes more held at the end\n", ticks * count, broken,
         (long)(memory.bytes - before));
  broken += memory.bytes != before;
  sonde_model_destroy(model);
  return broken ? 1 : 0;
}
