// sonde bench: steps per second of the dynamics on named scenes, with the error against the same
// scene solved to the end (every node awake, residual 1e-10) at the same time step.
#include "app.h"
#include "bench_ellipsoid.h"
#include "bench_haptics.h"
#include "bench_image.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const char HELP[] =
    "usage: sonde bench [MODEL] [--scene NAME] [options]\n"
    "\n"
    "Times the dynamics step by step on one core (processor time of the step, wall clock of its\n"
    "stages) and compares the result with a fully converged run of the same scene.\n"
    "\n"
    "  --scene NAME   press  linear probe to 20 mm at the central site in 0.4 s, hold (default)\n"
    "                 point  the same with the point probe\n"
    "                 slide  press to 12 mm, then slide 40 mm along the leg\n"
    "                 ellipsoid  the scene that engines are compared on: a ball of 30 mm pressed\n"
    "                        20 mm into a soft ellipsoid in 0.1 s, held to 0.3 s, where the\n"
    "                        runs are compared, slid to 0.5 s; no model is read\n"
    "                 image  echographic frames; sonde bench --scene image --help\n"
    "  --nodes N      of the ellipsoid, 42 to 1000000; default 7842\n"
    "  --stiffness K  of its surface springs, 1 to 1e6 N/m; default 200\n"
    "  --size S       of the ellipsoid, 0.5 to 20; default 1: 0.20 x 0.08 x 0.08 m\n"
    "  --engine NAME  fast (default) or double\n"
    "  --newton N     Newton iterations of a step, with the fast engine at most; default 3,\n"
    "                 ellipsoid 4\n"
    "  --reference-newton N  of the converged run; default as --newton\n"
    "  --sleep-um D   nodes nearer than this to balance may sleep, 0 to 1000; default 20\n"
    "  --tolerance R  of the linear solver, 1e-12 to 0.5; default 1e-2,\n"
    "                 ellipsoid 0.1\n"
    "  --disturb-nm D once, at 50 ms, move every node at random by up to D, 0 to 1e6, and forget\n"
    "                 the solver's first guess, but not in the converged run; default: not at all\n"
    "  --seconds S    simulated time, 0.05 to 60; default 1, ellipsoid 0.5\n"
    "  --dt-ms H      time step, 0.1 to 20; default 1\n"
    "  --dt S         the same in seconds\n"
    "  --threads N    1 (default) or 2: a second thread for half of a body of 16,384 nodes and\n"
    "                 more, the same bits; times are of the first, which waits for it\n"
    "  --repeat N     timed runs, the fastest median is reported; default 3\n"
    "  --csv FILE     write one row per step: time, total and per-stage milliseconds, iterations;\n"
    "                 with --haptics wall clock and processor time\n"
    "  --no-reference skip the converged run; relative_error is then null\n"
    "  --haptics      the whole 1 kHz loop in real time instead: a simulated hand presses to\n"
    "                 20 mm through a device's limits, for --seconds (default 5)\n"
    "  --device NAME  touch (default), touch_x, premium_1.5, omega.3, omega.6 or falcon\n"
    "  --json         print one JSON object\n"
    "  --help         this text\n";

typedef struct scene {
  const char *name, *probe;
  double depth_m, slide_m;
} scene;

static const scene SCENES[] = {{"press", "linear", 0.020, 0},
                               {"point", "point", 0.020, 0},
                               {"slide", "linear", 0.012, 0.040},
                               {"ellipsoid", "ball:30", 0, 0}};

typedef struct options {
  char model[1024];
  const scene *scene;
  bench_ellipsoid ellipsoid;
  sonde_engine engine;
  long newton, newton_reference;
  double tolerance;
  double sleep_um, disturb_nm;
  double seconds, dt_s;
  long repeat, threads;
  const char *csv;
  bool json, reference, haptics;
  const char *device;
} options;

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

static const scene *find_scene(const char *name) {
  for (size_t k = 0; k < sizeof SCENES / sizeof *SCENES; ++k)
    if (strcmp(SCENES[k].name, name) == 0) return &SCENES[k];
  return NULL;
}

static bool is_ellipsoid(const options *o) { return strcmp(o->scene->name, "ellipsoid") == 0; }

static int read_scene(options *o, const char *name) {
  o->scene = find_scene(name);
  if (o->scene) return -1;
  return app_usage_error(
      "bench", "unknown scene '%s', expected press, point, slide, ellipsoid or image", name);
}

static int read_engine(options *o, const char *name) {
  o->engine = strcmp(name, "fast") == 0 ? SONDE_ENGINE_FAST : SONDE_ENGINE_DOUBLE;
  if (o->engine == SONDE_ENGINE_FAST || strcmp(name, "double") == 0) return -1;
  return app_usage_error("bench", "unknown engine '%s', expected fast or double", name);
}

static const struct option LONG[] = {{"scene", required_argument, NULL, 's'},
                                     {"nodes", required_argument, NULL, 'N'},
                                     {"stiffness", required_argument, NULL, 'K'},
                                     {"size", required_argument, NULL, 'S'},
                                     {"engine", required_argument, NULL, 'e'},
                                     {"newton", required_argument, NULL, 'i'},
                                     {"reference-newton", required_argument, NULL, 'I'},
                                     {"sleep-um", required_argument, NULL, 'u'},
                                     {"tolerance", required_argument, NULL, 'T'},
                                     {"disturb-nm", required_argument, NULL, 'm'},
                                     {"seconds", required_argument, NULL, 't'},
                                     {"dt-ms", required_argument, NULL, 'd'},
                                     {"dt", required_argument, NULL, 'q'},
                                     {"repeat", required_argument, NULL, 'r'},
                                     {"threads", required_argument, NULL, 'w'},
                                     {"csv", required_argument, NULL, 'c'},
                                     {"no-reference", no_argument, NULL, 'n'},
                                     {"haptics", no_argument, NULL, 'H'},
                                     {"device", required_argument, NULL, 'D'},
                                     {"json", no_argument, NULL, 'j'},
                                     {"help", no_argument, NULL, 'h'},
                                     {NULL, 0, NULL, 0}};

// One option with a number; false after printing what was expected.
static bool read_number(options *o, int option, const char *text) {
  double ms;
  bool ok = true;
  switch (option) {
  case 'N': return app_parse_integer("bench", "--nodes", text, 42, 1000000, &o->ellipsoid.nodes);
  case 'K': return app_parse_real("bench", "--stiffness", text, 1, 1e6, &o->ellipsoid.stiffness);
  case 'S': return app_parse_real("bench", "--size", text, 0.5, 20, &o->ellipsoid.size);
  case 'i': return app_parse_integer("bench", "--newton", text, 0, 100, &o->newton);
  case 'I':
    return app_parse_integer("bench", "--reference-newton", text, 1, 100, &o->newton_reference);
  case 'u': return app_parse_real("bench", "--sleep-um", text, 0, 1000, &o->sleep_um);
  case 'T': return app_parse_real("bench", "--tolerance", text, 1e-12, 0.5, &o->tolerance);
  case 'm': return app_parse_real("bench", "--disturb-nm", text, 0, 1e6, &o->disturb_nm);
  case 't': return app_parse_real("bench", "--seconds", text, 0.05, 60, &o->seconds);
  case 'q': return app_parse_real("bench", "--dt", text, 1e-4, 0.02, &o->dt_s);
  case 'r': return app_parse_integer("bench", "--repeat", text, 1, 1000, &o->repeat);
  case 'w': return app_parse_integer("bench", "--threads", text, 1, 2, &o->threads);
  default:
    ok = app_parse_real("bench", "--dt-ms", text, 0.1, 20, &ms);
    if (ok) o->dt_s = ms * 1e-3;
    return ok;
  }
}

static int read_option(options *o, int option) {
  switch (option) {
  case 's': return read_scene(o, optarg);
  case 'e': return read_engine(o, optarg);
  case 'c': o->csv = optarg; return -1;
  case 'n': o->reference = false; return -1;
  case 'j': o->json = true; return -1;
  case 'H': o->haptics = true; return -1;
  case 'D': o->device = optarg; return -1;
  case 'h': fputs(HELP, stdout); return APP_OK;
  case '?': return APP_BAD_INPUT;
  default: return read_number(o, option, optarg) ? -1 : APP_BAD_INPUT;
  }
}

static int read_options(int argc, char **argv, options *o) {
  for (int c, code; (c = getopt_long(argc, argv, "", LONG, NULL)) != -1;) {
    code = read_option(o, c);
    if (code >= 0) return code;
  }
  if (!(o->seconds > 0)) o->seconds = o->haptics ? 5 : is_ellipsoid(o) ? 0.5 : 1;
  if (o->device && !o->haptics) return app_usage_error("bench", "--device belongs to --haptics");
  if (is_ellipsoid(o))
    return optind < argc ? app_usage_error("bench", "'%s' is too much", argv[optind]) : -1;
  if (!app_model_argument("bench", argc, argv, o->model, sizeof o->model)) return APP_BAD_INPUT;
  return -1;
}

static double smooth(double x) {
  x = x < 0 ? 0 : x > 1 ? 1 : x;
  return x * x * (3 - 2 * x);
}

// Pose of the scene at a time: 2 mm above the skin, down to depth in 0.4 s, then the slide.
static sonde_pose pose_at(const bench *b, double time_s) {
  const scene *s = b->o->scene;
  if (is_ellipsoid(b->o)) return bench_ellipsoid_pose(&b->o->ellipsoid, time_s);
  double depth = -0.002 + (s->depth_m + 0.002) * smooth(time_s / 0.4);
  double slide = s->slide_m * smooth((time_s - 0.4) / 0.5);
  sonde_pose pose = sonde_site_pose(b->site, depth);
  pose.position.x += slide * b->site->v.x;
  pose.position.y += slide * b->site->v.y;
  pose.position.z += slide * b->site->v.z;
  return pose;
}

// Processor time of this thread: other work on the machine does not count.
static double now(void) { return app_seconds(CLOCK_THREAD_CPUTIME_ID); }

// Moves every node at random by up to a way; scratch: [nodes].
static void disturb(sonde_state *state, double way_m, sonde_vec3 *scratch) {
  uint32_t nodes = sonde_state_model(state)->surface.vertex_count;
  memcpy(scratch, sonde_state_positions(state), nodes * sizeof *scratch);
  unsigned short seed[3] = {0};
  for (uint32_t i = 0; i < nodes; ++i) {
    scratch[i].x += way_m * (2 * erand48(seed) - 1);
    scratch[i].y += way_m * (2 * erand48(seed) - 1);
    scratch[i].z += way_m * (2 * erand48(seed) - 1);
  }
  sonde_state_set(state, scratch, NULL);
}

static uint32_t steps_to(const bench *b, double time_s) {
  return (uint32_t)(time_s / b->o->dt_s + 0.5);
}

// The runs are compared after this many steps: at 0.3 s for the ellipsoid, else at the end.
static uint32_t compared_step(const bench *b) {
  uint32_t held = is_ellipsoid(b->o) ? steps_to(b, 0.3) : b->steps;
  return held < b->steps ? held : b->steps;
}

// Runs the scene from rest, disturbed or not; fills samples when given, and keeps the positions at
// the time of comparison. kept: [nodes].
static void run(const bench *b, sonde_state *state, double way_m, sample *samples,
                sonde_vec3 *kept) {
  uint32_t compared = compared_step(b), disturbed = steps_to(b, 0.05);
  sonde_state_reset(state);
  for (uint32_t k = 0; k < b->steps; ++k) {
    if (way_m > 0 && k == disturbed) disturb(state, way_m, kept);
    sonde_pose pose = pose_at(b, (k + 1) * b->o->dt_s);
    double start = now();
    sonde_step(state, &b->probe, pose);
    double total = now() - start;
    if (k + 1 == compared)
      memcpy(kept, sonde_state_positions(state), b->model->surface.vertex_count * sizeof *kept);
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
  double *list = malloc(b->steps * sizeof *list);
  if (!list) return NAN;
  for (uint32_t k = 0; k < b->steps; ++k)
    memcpy(&list[k], (const char *)&b->samples[k] + offset, sizeof *list);
  double value = app_quantile(list, b->steps, q);
  free(list);
  return value;
}

static double mean_count(const bench *b, size_t offset) {
  double sum = 0;
  for (uint32_t k = 0; k < b->steps; ++k) {
    uint32_t value;
    memcpy(&value, (const char *)&b->samples[k] + offset, sizeof value);
    sum += value;
  }
  return sum / b->steps;
}

// Relative L2 difference of the normal springs' elongations.
static double relative_error(const sonde_model *model, const sonde_vec3 *x, const sonde_vec3 *y) {
  double difference = 0, size = 0;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 n = model->normal[i], r = model->surface.vertices[i];
    double a = n.x * (r.x - x[i].x) + n.y * (r.y - x[i].y) + n.z * (r.z - x[i].z);
    double c = n.x * (r.x - y[i].x) + n.y * (r.y - y[i].y) + n.z * (r.z - y[i].z);
    difference += (a - c) * (a - c);
    size += c * c;
  }
  return size > 0 ? sqrt(difference / size) : NAN;
}

// The world that is timed, or the one solved to the end that it is compared with.
static sonde_world_def world_of(const options *o, bool reference) {
  sonde_world_def def =
      is_ellipsoid(o) ? bench_ellipsoid_world(o->dt_s) : sonde_session_def_default().world;
  def.dt_s = o->dt_s;
  if (o->newton >= 0) def.newton_iterations = (uint32_t)o->newton;
  def.engine = reference ? SONDE_ENGINE_DOUBLE : o->engine;
  def.pcg.max_iterations = 5000;
  if (o->tolerance > 0) def.pcg.relative_residual = o->tolerance;
  if (reference) def.pcg = (sonde_pcg_options){1e-10, 1e-16, 5000};
  if (reference && o->newton_reference) def.newton_iterations = (uint32_t)o->newton_reference;
  if (def.engine == SONDE_ENGINE_FAST) def.threads = (uint32_t)o->threads;
  def.sleep_displacement_m = reference ? 0 : o->sleep_um * 1e-6;
  return def;
}

// Timed runs; the samples of the one with the smallest median stay. Returns false without memory.
static bool time_runs(bench *b, sonde_state *state, sonde_vec3 *kept) {
  sample *scratch = calloc(b->steps, sizeof *scratch);
  double best = INFINITY;
  for (long r = 0; scratch && r < b->o->repeat; ++r) {
    run(b, state, b->o->disturb_nm * 1e-9, scratch, kept);
    sample *other = b->samples;
    b->samples = scratch;
    double median = quantile(b, offsetof(sample, total_s), 0.5);
    if (median < best)
      best = median, scratch = other;
    else
      b->samples = other;
  }
  bool done = scratch != NULL;
  free(scratch);
  return done;
}

static sonde_status measure(bench *b, double *error_ratio, sonde_error *error) {
  sonde_world_def def = world_of(b->o, false), exact = world_of(b->o, true);
  sonde_state *state = NULL, *reference = NULL;
  sonde_status status = sonde_state_create(b->model, &def, &state, error);
  if (!status) status = sonde_state_create(b->model, &exact, &reference, error);
  size_t nodes = b->model->surface.vertex_count;
  sonde_vec3 *kept = calloc(2 * nodes, sizeof *kept);
  *error_ratio = NAN;
  bool done = !status && kept && time_runs(b, state, kept);
  if (done && b->o->reference) {
    run(b, reference, 0, NULL, kept + nodes);
    *error_ratio = relative_error(b->model, kept, kept + nodes);
  }
  if (!status && !done) status = SONDE_MEMORY;
  free(kept);
  sonde_state_destroy(state);
  sonde_state_destroy(reference);
  return status;
}

static sonde_status write_csv(const bench *b, sonde_error *error) {
  sonde_file *file;
  sonde_status status = sonde_file_create(b->o->csv, &file, error);
  if (status) return status;
  sonde_file_printf(file, "step,time_s,step_ms,contact_ms,assembly_ms,solve_ms,update_ms,"
                          "iterations,awake_nodes\n");
  for (uint32_t k = 0; k < b->steps; ++k) {
    const sample *s = &b->samples[k];
    sonde_file_printf(file, "%u,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%u,%u\n", k, (k + 1) * b->o->dt_s,
                      s->total_s * 1e3, s->contact_s * 1e3, s->assembly_s * 1e3, s->solve_s * 1e3,
                      s->update_s * 1e3, s->iterations, s->awake);
  }
  return sonde_file_commit(file, error);
}

// Bytes per second when a block of that size is read over and over: what memory could give at best.
static double bandwidth(double bytes) {
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
  app_json_text("scene", b->o->scene->name);
  app_json_integer("nodes", b->model->surface.vertex_count);
  app_json_real("dt_s", b->o->dt_s);
  app_json_integer("steps", b->steps);
  app_json_real("steps_per_s", 1 / quantile(b, total, 0.5));
  app_json_object("step_ms");
  app_json_real("median", quantile(b, total, 0.5) * 1e3);
  app_json_real("p99", quantile(b, total, 0.99) * 1e3);
  app_json_real("max", quantile(b, total, 1) * 1e3);
  app_json_close();
  app_json_real("iterations", mean_count(b, offsetof(sample, iterations)));
  app_json_real("awake_nodes", mean_count(b, offsetof(sample, awake)));
  app_json_real("bytes_moved", bytes);
  app_json_real("floor_ratio", ratio);
  app_json_real("relative_error", error_ratio);
  app_json_object("stages_ms");
  for (size_t k = 0; k < 4; ++k)
    app_json_real(STAGES[k].name, quantile(b, STAGES[k].offset, 0.5) * 1e3);
  app_json_close();
  app_json_end();
}

static void print_table(const bench *b, double error_ratio) {
  size_t total = offsetof(sample, total_s);
  double bytes, ratio = floor_ratio(b, &bytes);
  printf("scene %s: %u nodes, dt %g ms, %u steps, one core\n", b->o->scene->name,
         b->model->surface.vertex_count, b->o->dt_s * 1e3, b->steps);
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

static sonde_status load(const options *o, sonde_model **model, sonde_error *error) {
  return is_ellipsoid(o) ? bench_ellipsoid_build(&o->ellipsoid, model, error)
                         : sonde_model_load(o->model, model, error);
}

int old_bench(int argc, char **argv);
int old_bench(int argc, char **argv) {
  if (bench_image_asked(argc, argv)) return bench_image(argc, argv);
  options o = {.scene = &SCENES[0],
               .ellipsoid = {7842, 200, 1},
               .engine = SONDE_ENGINE_FAST,
               .newton = -1,
               .sleep_um = 20,
               .dt_s = 1e-3,
               .repeat = 3,
               .threads = 1,
               .reference = true};
  int code = read_options(argc, argv, &o);
  if (code >= 0) return code;
  if (o.haptics)
    return bench_haptics(o.model, o.device ? o.device : "touch", o.seconds, o.json, o.csv);
  bench b = {.o = &o};
  b.steps = steps_to(&b, o.seconds);
  sonde_error error = {0};
  sonde_model *model = NULL;
  double error_ratio = NAN;
  sonde_status status = load(&o, &model, &error);
  if (!status) status = sonde_probe_create(o.scene->probe, &b.probe, &error);
  b.samples = calloc(b.steps, sizeof *b.samples);
  if (!status && b.samples) {
    b.model = model;
    b.site = sonde_model_site(model, 27);
    if (!b.site) b.site = &model->sites[model->site_count / 2];
    status = measure(&b, &error_ratio, &error);
  }
  if (!status && o.csv) status = write_csv(&b, &error);
  if (!status && o.json)
    print_json(&b, error_ratio);
  else if (!status)
    print_table(&b, error_ratio);
  free(b.samples);
  sonde_probe_clear(&b.probe);
  sonde_model_destroy(model);
  return status ? app_fail("bench", &error) : APP_OK;
}
