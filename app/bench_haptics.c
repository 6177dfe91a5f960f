// sonde bench --haptics: the whole loop at 1 kHz in real time, with the simulated hand in place of
// a hardware.
#include "bench_haptics.h"

#include "app.h"
#include "haptics_rig.h"

#include <assert.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef struct bench {
  haptics_rig rig;
  size_t capacity;
  _Atomic size_t count;
  double *woken_s, *compute_s, *cpu_s, *scratch; // wall clock, and the thread's own time
} bench;

static void tick(void *user) {
  bench *b = user;
  size_t k = atomic_load(&b->count);
  if (k >= b->capacity) return;
  b->woken_s[k] = app_seconds(CLOCK_MONOTONIC);
  double cpu_s = app_seconds(CLOCK_THREAD_CPUTIME_ID);
  haptics_rig_tick(&b->rig);
  b->cpu_s[k] = app_seconds(CLOCK_THREAD_CPUTIME_ID) - cpu_s;
  b->compute_s[k] = app_seconds(CLOCK_MONOTONIC) - b->woken_s[k];
  atomic_store(&b->count, k + 1);
}

static void print_times(const char *name, double *list, size_t count) {
  assert(count > 0);
  app_json_object(name);
  app_json("p50:%g p99:%g p999:%g max:%g", 1e6 * app_quantile(list, count, 0.5),
           1e6 * app_quantile(list, count, 0.99), 1e6 * app_quantile(list, count, 0.999),
           1e6 * app_quantile(list, count, 1.0));
  app_json_close();
}

static void print_json(bench *b, const sonde_loop_stats *stats) {
  sonde_render_margins margins = sonde_render_margins_of(&b->rig.render.def, b->rig.def.mass_kg,
                                                         b->rig.def.damping_n_s_m, 0.0);
  app_json_begin();
  app_json("device:%s ticks:%lu", b->rig.def.limits->name, b->count);
  print_times("compute_us", b->compute_s, b->count);
  print_times("cpu_us", b->cpu_s, b->count);
  print_times("lateness_us", b->woken_s, b->count);
  app_json("deadline_misses:%lu energy_j:%g energy_min_j:%g max_force_n:%g max_slew_n_per_s:%g "
           "force_scale:%g coupling_n_per_m:%g stiffness_margin:%g phase_margin_deg:%g "
           "passivity_margin:%g fault:%s priority_note:%s",
           stats->deadline_misses, b->rig.render.energy_j, b->rig.render.energy_min_j,
           b->rig.max_force_n, b->rig.max_step_n * 1e3, b->rig.render.def.force_scale,
           b->rig.render.def.stiffness_n_m, margins.stiffness,
           margins.phase_rad * 57.29577951308232, margins.passivity,
           sonde_fault_text(b->rig.safety.fault), stats->priority_note);
  app_json_end();
}

static void print_table(bench *b, const sonde_loop_stats *stats) {
  static const double share[] = {0.5, 0.99, 0.999, 1.0};
  const char *const names[] = {"compute", "cpu", "lateness"};
  double *const lists[] = {b->compute_s, b->cpu_s, b->woken_s};
  printf("%s held by a hand of %g kg, %zu ticks of 1 ms\n", b->rig.def.limits->product,
         b->rig.def.mass_kg, (size_t)b->count);
  for (int i = 0; i < 3; ++i) {
    printf("  %-9s", names[i]);
    for (int q = 0; q < 4; ++q)
      printf("  %s %7.0f us", (const char *const[]){"p50", "p99", "p99.9", "max"}[q],
             1e6 * app_quantile(lists[i], b->count, share[q]));
    printf("\n");
  }
  printf("  deadline misses %llu   energy taken from the hand %.4f J   largest force %.2f N, "
         "slew %.0f N/s\n",
         (unsigned long long)stats->deadline_misses, b->rig.render.energy_j, b->rig.max_force_n,
         b->rig.max_step_n * 1e3);
  printf("  tissue force is rendered times %.3f; %s\n", b->rig.render.def.force_scale,
         sonde_fault_text(b->rig.safety.fault));
  if (stats->priority_note[0]) printf("  %s\n", stats->priority_note);
}

// Runs the loop for some seconds and prints what it took.
static sonde_status measure(bench *b, const haptics_rig_def *def, double seconds, bool json,
                            const char *csv, sonde_error *error) {
  assert(seconds > 0);
  sonde_world_def world = haptics_world();
  sonde_loop_stats stats = {0};
  sonde_state *state = NULL;
  sonde_loop *loop = NULL;
  app_catch_interrupt();
  sonde_status status = sonde_state_create(def->model, &world, &state, error);
  if (!status) status = haptics_rig_start(&b->rig, def, state, error);
  if (!status) status = sonde_loop_start(1e-3, tick, b, &loop, error);
  if (!status) {
    double until = app_seconds(CLOCK_MONOTONIC) + seconds;
    while (app_seconds(CLOCK_MONOTONIC) < until && !app_interrupted())
      nanosleep(&(struct timespec){0, 20000000}, NULL);
    sonde_loop_stop(loop, &stats);
  }
  haptics_rig_stop(&b->rig);
  sonde_state_destroy(state);
  // The table keeps the order of the ticks, which the quantiles sort away.
  if (!status && csv) {
    sonde_file *file;
    status = sonde_file_create(csv, &file, error);
    if (!status) {
      sonde_file_printf(file, "tick,compute_us,cpu_us\n");
      for (size_t k = 0; k < b->count; ++k)
        sonde_file_printf(file, "%zu,%.3f,%.3f\n", k, 1e6 * b->compute_s[k], 1e6 * b->cpu_s[k]);
      status = sonde_file_commit(file, error);
    }
  }
  if (status || b->count == 0) return status;
  // In place. Where wake-ups lie within the period is a circle; they begin after its widest empty
  // arc. Whole periods are deadline misses and counted by the loop.
  assert(b->count > 0);
  const double period = 1e-3;
  double start = b->woken_s[0], widest = 0.0, earliest = 0.0;
  for (size_t k = 0; k < b->count; ++k)
    b->scratch[k] = b->woken_s[k] = fmod(b->woken_s[k] - start, period);
  app_quantile(b->scratch, b->count, 0.5); // sorts
  for (size_t k = 0; k < b->count; ++k) {
    double before = k ? b->scratch[k - 1] : b->scratch[b->count - 1] - period;
    if (b->scratch[k] - before <= widest) continue;
    widest = b->scratch[k] - before;
    earliest = b->scratch[k];
  }
  for (size_t k = 0; k < b->count; ++k)
    b->woken_s[k] = fmod(b->woken_s[k] - earliest + period, period);
  (json ? print_json : print_table)(b, &stats);
  return SONDE_OK;
}

int bench_haptics(const char *model_path, const char *device, double seconds, bool json,
                  const char *csv) {
  const sonde_device_limits *limits = sonde_device_limits_find(device);
  if (!limits || !(limits->force_peak_n > 0.0))
    return app_usage_error("bench",
                           "no known limits of a device '%s', expected touch, touch_x, "
                           "premium_1.5, omega.3, omega.6 or falcon",
                           device);
  bench b = {0};
  sonde_error error = {0};
  sonde_model *model = NULL;
  sonde_probe probe = {0};
  sonde_status status = sonde_limb_model_load(model_path, &model, &error);
  if (!status) status = sonde_probe_create("linear", &probe, &error);
  b.capacity = (size_t)(seconds * 1e3) + 1000;
  double *times = calloc(4 * b.capacity, sizeof *times);
  if (!status && !times) status = error.status = SONDE_MEMORY;
  if (!status) {
    b.woken_s = times, b.compute_s = times + b.capacity;
    b.cpu_s = times + 2 * b.capacity, b.scratch = times + 3 * b.capacity;
    const sonde_site *site = sonde_model_site(model, 27);
    haptics_rig_def def = {.model = model,
                           .probe = &probe,
                           .site = site ? site : &model->sites[model->site_count / 2],
                           .limits = limits,
                           .mass_kg = 0.5,
                           .damping_n_s_m = 2.0,
                           .depth_m = 0.02};
    status = measure(&b, &def, seconds, json, csv, &error);
  }
  free(times);
  sonde_probe_clear(&probe);
  sonde_model_destroy(model);
  return status ? app_fail("bench", &error) : APP_OK;
}
