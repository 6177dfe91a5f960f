// sonde bench: steps per second of the dynamics on named scenes, with the error against the same
// scene solved to the end (every node awake, residual 1e-10) at the same time step.
#include "bench_ellipsoid.h"
#include "bench_haptics.h"
#include "bench_image.h"
#include "options.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct scene {
  const char *name, *probe;
  double depth_m, slide_m;
} scene;

enum { ELLIPSOID = 3 };
static const scene SCENES[] = {{"press", "linear", 0.020, 0},
                               {"point", "point", 0.020, 0},
                               {"slide", "linear", 0.012, 0.040},
                               {"ellipsoid", "ball:30", 0, 0}};
static const char *const SCENE_NAMES[] = {"press", "point", "slide", "ellipsoid", "image", NULL};

typedef struct options {
  const char *model, *csv, *device;
  int scene;
  bench_ellipsoid ellipsoid;
  int engine;                    // of ENGINES
  long newton, newton_reference; // -1, 0: the scene's own
  double tolerance, seconds;     // 0: the scene's own
  double sleep_m, disturb_m, dt_s;
  long repeat, threads;
  bool json, no_reference, haptics;
} options;

static const options DEFAULTS = {.ellipsoid = {7842, 200, 1},
                                 .newton = -1,
                                 .sleep_m = 20 * 1e-6,
                                 .dt_s = 1e-3,
                                 .repeat = 3,
                                 .threads = 1};

static const char *const ENGINES[] = {"fast", "double", NULL};

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_WORD(
        scene, "scene", "NAME", SCENE_NAMES,
        "press: linear probe to 20 mm at the central site in 0.4 s, hold; point: the same with "
        "the point probe; slide: press to 12 mm, then slide 40 mm along the leg; ellipsoid: "
        "the scene that engines are compared on, a ball of 30 mm pressed 20 mm into a soft "
        "ellipsoid in 0.1 s, held to 0.3 s, where the runs are compared (or at the end, if "
        "that is earlier), slid to 0.5 s, no model is read; image: echographic frames, with "
        "options of its own"),
    OPT_INTEGER(ellipsoid.nodes, "nodes", "N", 42, 1000000, "of the ellipsoid"),
    OPT_REAL(ellipsoid.stiffness, "stiffness", "K", 1, 1e6, 1, "of its surface springs, N/m"),
    OPT_REAL(ellipsoid.size, "size", "S", 0.5, 20, 1, "of the ellipsoid; 1: 0.20 x 0.08 x 0.08 m"),
    OPT_WORD(engine, "engine", "NAME", ENGINES, "engine"),
    OPT_INTEGER(newton, "newton", "N", 0, 100,
                "Newton iterations of a step, with the fast engine at most; 0 is the paper's "
                "linearised step and wants --engine double; default 3, ellipsoid 4"),
    OPT_INTEGER(newton_reference, "reference-newton", "N", 1, 100,
                "of the converged run; default as --newton"),
    OPT_REAL(sleep_m, "sleep-um", "D", 0, 1000, 1e-6,
             "nodes nearer than this to balance may sleep; 0: none"),
    OPT_REAL(tolerance, "tolerance", "R", 1e-12, 0.5, 1,
             "of the linear solver, relative to the unbalanced force; default 1e-2, ellipsoid 0.1"),
    OPT_REAL(disturb_m, "disturb-nm", "D", 0, 1e6, 1e-9,
             "once, at 50 ms, move every node at random by up to D, and forget the solver's first "
             "guess, but not in the converged run: what so little makes of the scene"),
    OPT_REAL(seconds, "seconds", "S", 0.05, 60, 1, "simulated time; default 1, ellipsoid 0.5"),
    OPT_REAL(dt_s, "dt-ms", "H", 0.1, 20, 1e-3, "time step"),
    OPT_REAL(dt_s, "dt", "S", 1e-4, 0.02, 1, "the same in seconds"),
    OPT_INTEGER(threads, "threads", "N", 1, 2,
                "2: with the fast engine a second thread for half of a body of 16,384 nodes and "
                "more, the same bits; times are of the first, which waits for it"),
    OPT_INTEGER(repeat, "repeat", "N", 1, 1000, "timed runs, the fastest median is reported"),
    OPT_OUTPUT(csv, "csv", "FILE",
               "write one row per step: time, total and per-stage milliseconds, iterations; with "
               "--haptics one per tick: wall clock and processor time"),
    OPT_FLAG(no_reference, "no-reference", "skip the converged run; relative_error is then null"),
    OPT_FLAG(
        haptics, "haptics",
        "the whole 1 kHz loop in real time instead: a simulated hand presses to 20 mm through "
        "a device's limits, for --seconds (default 5). Lateness is counted from the grid of the "
        "earliest wake-ups; whole periods are deadline misses"),
    OPT_TEXT(device, "device", "NAME",
             "touch, touch_x, premium_1.5, omega.3, omega.6 or falcon; default touch"),
    OPT_JSON(json)};

static bool is_ellipsoid(const options *o) { return o->scene == ELLIPSOID; }

static int check(void *from) {
  options *o = from;
  if (!(o->seconds > 0)) o->seconds = o->haptics ? 5 : is_ellipsoid(o) ? 0.5 : 1;
  if (o->haptics && !o->device) o->device = "touch";
  if (!is_ellipsoid(o)) return APP_OK;
  if (o->model) return app_usage_error("bench", "unexpected argument '%s'", o->model);
  o->model = ""; // none is read
  return APP_OK;
}

// The image has its own form.
static const app_command *pick(int argc, char **argv) {
  for (int i = 1; i < argc; ++i)
    if (strcmp(argv[i], "--scene=image") == 0 ||
        (i + 1 < argc && strcmp(argv[i], "--scene") == 0 && strcmp(argv[i + 1], "image") == 0))
      return &bench_image;
  return NULL;
}

typedef struct sample {
  double total_s, contact_s, assembly_s, solve_s, update_s;
  uint32_t iterations, awake;
  double bytes;
} sample;

typedef struct bench {
  const sonde_model *model;
  const sonde_site *site;
  sonde_probe probe;
  const options *o;
  uint32_t steps;
  sample *samples;
} bench;

static double smooth(double x) {
  x = x < 0 ? 0 : x > 1 ? 1 : x;
  return x * x * (3 - 2 * x);
}

// Processor time of this thread: other work on the machine does not count.
static double now(void) { return app_seconds(CLOCK_THREAD_CPUTIME_ID); }

static uint32_t steps_to(const bench *b, double time_s) {
  assert(time_s >= 0);
  return (uint32_t)(time_s / b->o->dt_s + 0.5);
}

// Inner nodes of a volumetric body count, but not those of a condensed one, which only follow.
static uint32_t moving_nodes(const sonde_model *model) {
  bool inner = model->bulk && model->kind != SONDE_CONDENSED_SOLID;
  return inner ? model->bulk->node_count : model->surface.vertex_count;
}

// Runs the scene from rest, disturbed or not; fills samples when given, and keeps the positions at
// the time of comparison. kept: [nodes].
static void run(const bench *b, sonde_state *state, double way_m, sample *samples,
                sonde_vec3 *kept) {
  uint32_t nodes = b->model->surface.vertex_count, disturbed = steps_to(b, 0.05);
  // The runs are compared at 0.3 s for the ellipsoid, when that is within the run, else at the end.
  uint32_t held = is_ellipsoid(b->o) ? steps_to(b, 0.3) : b->steps;
  uint32_t compared = held < b->steps ? held : b->steps;
  sonde_state_reset(state);
  for (uint32_t k = 0; k < b->steps; ++k) {
    if (way_m > 0 && k == disturbed) { // every node moves at random by up to way_m
      unsigned short seed[3] = {0};
      memcpy(kept, sonde_state_positions(state), nodes * sizeof *kept);
      for (uint32_t i = 0; i < nodes; ++i) {
        kept[i].x += way_m * (2 * erand48(seed) - 1);
        kept[i].y += way_m * (2 * erand48(seed) - 1);
        kept[i].z += way_m * (2 * erand48(seed) - 1);
      }
      sonde_state_set(state, kept, NULL);
    }
    sonde_pose pose;
    {
      // Pose of the scene at a time: 2 mm above the skin, down to depth in 0.4 s, then the slide.
      double time_s = (k + 1) * b->o->dt_s;
      const scene *s = &SCENES[b->o->scene];
      if (is_ellipsoid(b->o)) {
        pose = bench_ellipsoid_pose(&b->o->ellipsoid, time_s);
      } else {
        double depth = -0.002 + (s->depth_m + 0.002) * smooth(time_s / 0.4);
        double slide = s->slide_m * smooth((time_s - 0.4) / 0.5);
        pose = pose_shift(sonde_site_pose(b->site, depth), slide, b->site->v);
      }
    }
    double start = now();
    sonde_step(state, &b->probe, pose);
    double total = now() - start;
    if (k + 1 == compared) memcpy(kept, sonde_state_positions(state), nodes * sizeof *kept);
    if (!samples) continue;
    sonde_stage_times t = sonde_state_times(state);
    samples[k] = (sample){total,
                          t.contact_s,
                          t.assembly_s,
                          t.solve_s,
                          t.update_s,
                          sonde_state_solver(state).iterations,
                          sonde_state_awake(state),
                          (double)sonde_state_bytes_moved(state)};
  }
}

// Order statistic of one field of the samples.
static double quantile(const bench *b, size_t offset, double q) {
  assert(q >= 0 && q <= 1 && b->steps > 0);
  double *list = malloc(b->steps * sizeof *list);
  if (!list) return NAN;
  for (uint32_t k = 0; k < b->steps; ++k)
    memcpy(&list[k], (const char *)&b->samples[k] + offset, sizeof *list);
  double value = app_quantile(list, b->steps, q);
  free(list);
  return value;
}

static double mean_count(const bench *b, size_t offset) {
  assert(b->steps > 0);
  double sum = 0;
  for (uint32_t k = 0; k < b->steps; ++k) {
    uint32_t value;
    memcpy(&value, (const char *)&b->samples[k] + offset, sizeof value);
    sum += value;
  }
  return sum / b->steps;
}

// The world that is timed, or the one solved to the end that it is compared with.
static sonde_world_def world_of(const options *o, bool reference) {
  sonde_world_def def =
      is_ellipsoid(o) ? bench_ellipsoid_world(o->dt_s) : sonde_session_def_default().world;
  def.dt_s = o->dt_s;
  if (o->newton >= 0) def.newton_iterations = (uint32_t)o->newton;
  def.engine = reference || o->engine ? SONDE_ENGINE_DOUBLE : SONDE_ENGINE_FAST;
  def.pcg.max_iterations = 5000;
  if (o->tolerance > 0) def.pcg.relative_residual = o->tolerance;
  if (reference) def.pcg = (sonde_pcg_options){1e-10, 1e-16, 5000};
  if (reference && o->newton_reference) def.newton_iterations = (uint32_t)o->newton_reference;
  if (def.engine == SONDE_ENGINE_FAST) def.threads = (uint32_t)o->threads;
  def.sleep_displacement_m = reference ? 0 : o->sleep_m;
  return def;
}

// Bytes per second when a block of that size is read over and over: what memory could give at best.
static double bandwidth(double bytes) {
  assert(bytes > 0);
  size_t count = (size_t)(bytes / sizeof(uint64_t)) + 1;
  uint64_t *block = calloc(count, sizeof *block), sum = 0;
  if (!block) return NAN;
  for (size_t k = 0; k < count; ++k) block[k] = k;
  size_t rounds = (size_t)(2e8 / (double)(count * sizeof *block)) + 1;
  double best = INFINITY;
  for (int attempt = 0; attempt < 5; ++attempt) {
    double start = now();
    for (size_t r = 0; r < rounds; ++r) {
      for (size_t k = 0; k < count; ++k) sum += block[k];
      __asm__ volatile("" : "+r"(sum) : : "memory");
    }
    best = fmin(best, (now() - start) / (double)rounds);
  }
  free(block);
  return (double)(count * sizeof *block) / best;
}

static const struct {
  const char *name;
  size_t offset;
} STAGES[] = {{"contact", offsetof(sample, contact_s)},
              {"assembly", offsetof(sample, assembly_s)},
              {"solve", offsetof(sample, solve_s)},
              {"update", offsetof(sample, update_s)}};

// Time of a step over the time that moving its bytes takes at the measured bandwidth.
static double floor_ratio(const bench *b, double *bytes) {
  *bytes = quantile(b, offsetof(sample, bytes), 0.5);
  if (!(*bytes > 0)) return NAN;
  return quantile(b, offsetof(sample, total_s), 0.5) * bandwidth(*bytes) / *bytes;
}

static void print_json(const bench *b, double error_ratio) {
  size_t total = offsetof(sample, total_s);
  double bytes, ratio = floor_ratio(b, &bytes);
  app_json_begin();
  app_json("scene:%s nodes:%u dt_s:%g steps:%u steps_per_s:%g", SCENE_NAMES[b->o->scene],
           moving_nodes(b->model), b->o->dt_s, b->steps, 1 / quantile(b, total, 0.5));
  app_json_object("step_ms");
  app_json("median:%g p99:%g max:%g", quantile(b, total, 0.5) * 1e3, quantile(b, total, 0.99) * 1e3,
           quantile(b, total, 1) * 1e3);
  app_json_close();
  app_json("iterations:%g awake_nodes:%g bytes_moved:%g floor_ratio:%g relative_error:%g",
           mean_count(b, offsetof(sample, iterations)), mean_count(b, offsetof(sample, awake)),
           bytes, ratio, error_ratio);
  app_json_object("stages_ms");
  for (size_t k = 0; k < 4; ++k)
    app_json_real(STAGES[k].name, quantile(b, STAGES[k].offset, 0.5) * 1e3);
  app_json_close();
  app_json_end();
}

static void print_table(const bench *b, double error_ratio) {
  size_t total = offsetof(sample, total_s);
  double bytes, ratio = floor_ratio(b, &bytes);
  printf("scene %s: %u nodes, dt %g ms, %u steps, one core\n", SCENE_NAMES[b->o->scene],
         moving_nodes(b->model), b->o->dt_s * 1e3, b->steps);
  printf("  step      median %8.4f ms   p99 %8.4f ms   max %8.4f ms   %8.0f steps/s\n",
         quantile(b, total, 0.5) * 1e3, quantile(b, total, 0.99) * 1e3, quantile(b, total, 1) * 1e3,
         1 / quantile(b, total, 0.5));
  for (size_t k = 0; k < 4; ++k)
    printf("  %-9s median %8.4f ms   p99 %8.4f ms\n", STAGES[k].name,
           quantile(b, STAGES[k].offset, 0.5) * 1e3, quantile(b, STAGES[k].offset, 0.99) * 1e3);
  if (bytes > 0)
    printf("  moved     %.2f MB, %.1f times what reading them takes\n", bytes * 1e-6, ratio);
  printf("  iterations %.1f   awake nodes %.0f   relative error ",
         mean_count(b, offsetof(sample, iterations)), mean_count(b, offsetof(sample, awake)));
  if (isnan(error_ratio))
    printf("not measured\n");
  else
    printf("%.2g\n", error_ratio);
}

static int run_bench(void *from) {
  const options *o = from;
  if (o->haptics) return bench_haptics(o->model, o->device, o->seconds, o->json, o->csv);
  bench b = {.o = o};
  b.steps = steps_to(&b, o->seconds);
  assert(b.steps > 0);
  sonde_error error = {0};
  sonde_model *model = NULL;
  double error_ratio = NAN;
  sonde_status status = is_ellipsoid(o) ? bench_ellipsoid_build(&o->ellipsoid, &model, &error)
                                        : sonde_limb_model_load(o->model, &model, &error);
  if (!status) status = sonde_probe_create(SCENES[o->scene].probe, &b.probe, &error);
  b.samples = calloc(b.steps, sizeof *b.samples);
  if (!status && b.samples) {
    b.model = model;
    b.site = sonde_model_site(model, 27);
    if (!b.site) b.site = &model->sites[model->site_count / 2];
    // Times some runs, of which the one with the least median stays, and compares with a run of the
    // same scene that is solved to the end.
    assert(b.steps > 0 && b.o->repeat > 0);
    sonde_world_def def = world_of(b.o, false), exact = world_of(b.o, true);
    sonde_state *state = NULL, *reference = NULL;
    status = sonde_state_create(b.model, &def, &state, &error);
    if (!status) status = sonde_state_create(b.model, &exact, &reference, &error);
    size_t nodes = b.model->surface.vertex_count;
    sonde_vec3 *kept = calloc(2 * nodes, sizeof *kept);
    sample *other = calloc(b.steps, sizeof *other);
    if (!status && (!kept || !other)) status = error.status = SONDE_MEMORY;
    double best = INFINITY;
    for (long r = 0; !status && r < b.o->repeat; ++r) {
      sample *best_samples = b.samples;
      run(&b, state, b.o->disturb_m, other, kept);
      b.samples = other;
      double median = quantile(&b, offsetof(sample, total_s), 0.5);
      other = median < best ? best_samples : other;
      if (median < best)
        best = median;
      else
        b.samples = best_samples;
    }
    error_ratio = NAN;
    if (!status && !b.o->no_reference) {
      run(&b, reference, 0, NULL, kept + nodes);
      // Relative L2 difference of the normal springs' elongations.
      const sonde_vec3 *y = kept + nodes;
      double difference = 0, size = 0;
      for (uint32_t i = 0; i < b.model->surface.vertex_count; ++i) {
        sonde_vec3 n = b.model->normal[i], r = b.model->surface.vertices[i];
        double a = n.x * (r.x - kept[i].x) + n.y * (r.y - kept[i].y) + n.z * (r.z - kept[i].z);
        double c = n.x * (r.x - y[i].x) + n.y * (r.y - y[i].y) + n.z * (r.z - y[i].z);
        difference += (a - c) * (a - c);
        size += c * c;
      }
      error_ratio = size > 0 ? sqrt(difference / size) : NAN;
    }
    free(kept);
    free(other);
    sonde_state_destroy(state);
    sonde_state_destroy(reference);
  }
  sonde_file *file = NULL;
  if (!status && o->csv) status = sonde_file_create(o->csv, &file, &error);
  if (file) {
    sonde_file_printf(file, "step,time_s,step_ms,contact_ms,assembly_ms,solve_ms,update_ms,"
                            "iterations,awake_nodes\n");
    for (const sample *r = b.samples; r < b.samples + b.steps; ++r)
      sonde_file_printf(file, "%td,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%u,%u\n", r - b.samples,
                        (double)(r - b.samples + 1) * o->dt_s, r->total_s * 1e3, r->contact_s * 1e3,
                        r->assembly_s * 1e3, r->solve_s * 1e3, r->update_s * 1e3, r->iterations,
                        r->awake);
    status = sonde_file_commit(file, &error);
  }
  if (!status) (o->json ? print_json : print_table)(&b, error_ratio);
  free(b.samples);
  sonde_probe_clear(&b.probe);
  sonde_model_destroy(model);
  return status ? app_fail("bench", &error) : APP_OK;
}

const app_command cmd_bench = {
    .verb = "bench",
    .summary = "time the simulation's stages",
    .usage = "[MODEL] [--scene NAME] [options]",
    .text =
        "Times the dynamics step by step on one core (processor time of the step, wall clock of "
        "its stages) and compares the result with a fully converged run of the same scene.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .needs = "device>haptics",
    .check = check,
    .pick = pick,
    .run = run_bench};
