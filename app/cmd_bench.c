// sonde bench: steps per second of the dynamics on named scenes, with the error against the same
// scene solved to the end (every node awake, residual 1e-10) at the same time step.
#include "app.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const char HELP[] =
    "usage: sonde bench [MODEL] [--scene NAME] [options]\n"
    "\n"
    "Times the dynamics step by step on one core and compares the result with a fully\n"
    "converged run of the same scene.\n"
    "\n"
    "  --scene NAME   press  linear probe to 20 mm at the central site in 0.4 s, hold (default)\n"
    "                 point  the same with the point probe\n"
    "                 slide  press to 12 mm, then slide 40 mm along the leg\n"
    "  --seconds S    simulated time, 0.05 to 60; default 1\n"
    "  --dt-ms H      time step, 0.1 to 20; default 1\n"
    "  --repeat N     timed runs, the fastest median is reported; default 3\n"
    "  --csv FILE     write one row per step: time, total and per-stage milliseconds, iterations\n"
    "  --no-reference skip the converged run; relative_error is then null\n"
    "  --json         print one JSON object\n"
    "  --help         this text\n";

typedef struct scene {
  const char *name, *probe;
  double depth_m, slide_m;
} scene;

static const scene SCENES[] = {
    {"press", "linear", 0.020, 0}, {"point", "point", 0.020, 0}, {"slide", "linear", 0.012, 0.040}};

typedef struct options {
  char model[1024];
  const scene *scene;
  double seconds, dt_s;
  long repeat;
  const char *csv;
  bool json, reference;
} options;

typedef struct sample {
  double total_s, contact_s, assembly_s, solve_s, update_s;
  uint32_t iterations, awake;
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

static int read_options(int argc, char **argv, options *o) {
  static const struct option LONG[] = {{"scene", required_argument, NULL, 's'},
                                       {"seconds", required_argument, NULL, 't'},
                                       {"dt-ms", required_argument, NULL, 'd'},
                                       {"repeat", required_argument, NULL, 'r'},
                                       {"csv", required_argument, NULL, 'c'},
                                       {"no-reference", no_argument, NULL, 'n'},
                                       {"json", no_argument, NULL, 'j'},
                                       {"help", no_argument, NULL, 'h'},
                                       {NULL, 0, NULL, 0}};
  double ms;
  for (int c; (c = getopt_long(argc, argv, "", LONG, NULL)) != -1;) switch (c) {
    case 's':
      o->scene = find_scene(optarg);
      if (!o->scene)
        return app_usage_error("bench", "unknown scene '%s', expected press, point or slide",
                               optarg);
      break;
    case 't':
      if (!app_parse_real("bench", "--seconds", optarg, 0.05, 60, &o->seconds))
        return APP_BAD_INPUT;
      break;
    case 'd':
      if (!app_parse_real("bench", "--dt-ms", optarg, 0.1, 20, &ms)) return APP_BAD_INPUT;
      o->dt_s = ms * 1e-3;
      break;
    case 'r':
      if (!app_parse_integer("bench", "--repeat", optarg, 1, 1000, &o->repeat))
        return APP_BAD_INPUT;
      break;
    case 'c': o->csv = optarg; break;
    case 'n': o->reference = false; break;
    case 'j': o->json = true; break;
    case 'h': fputs(HELP, stdout); return APP_OK;
    default: return APP_BAD_INPUT;
    }
  if (argc - optind > 1)
    return app_usage_error("bench", "one model expected, '%s' is too much", argv[optind + 1]);
  char searched[1024];
  if (optind < argc)
    snprintf(o->model, sizeof o->model, "%s", argv[optind]);
  else if (!app_bundled_model(o->model, sizeof o->model, searched, sizeof searched))
    return app_usage_error("bench", "no bundled model found (looked at %s)", searched);
  return -1;
}

static double smooth(double x) {
  x = x < 0 ? 0 : x > 1 ? 1 : x;
  return x * x * (3 - 2 * x);
}

// Pose of the scene at a time: 2 mm above the skin, down to depth in 0.4 s, then the slide.
static sonde_pose pose_at(const bench *b, double time_s) {
  const scene *s = b->o->scene;
  double depth = -0.002 + (s->depth_m + 0.002) * smooth(time_s / 0.4);
  double slide = s->slide_m * smooth((time_s - 0.4) / 0.5);
  sonde_pose pose = sonde_site_pose(b->site, depth);
  pose.position.x += slide * b->site->v.x;
  pose.position.y += slide * b->site->v.y;
  pose.position.z += slide * b->site->v.z;
  return pose;
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// Runs the scene from rest; fills samples when given.
static void run(const bench *b, sonde_state *state, sample *samples) {
  sonde_state_reset(state);
  for (uint32_t k = 0; k < b->steps; ++k) {
    sonde_pose pose = pose_at(b, (k + 1) * b->o->dt_s);
    double start = now();
    sonde_step(state, &b->probe, pose);
    double total = now() - start;
    if (!samples) continue;
    sonde_stage_times t = sonde_state_times(state);
    samples[k] = (sample){total,
                          t.contact_s,
                          t.assembly_s,
                          t.solve_s,
                          t.update_s,
                          sonde_state_solver(state).iterations,
                          sonde_state_awake(state)};
  }
}

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// Order statistic of one field of the samples.
static double quantile(const bench *b, size_t offset, double q) {
  double *list = malloc(b->steps * sizeof *list);
  if (!list) return NAN;
  for (uint32_t k = 0; k < b->steps; ++k)
    memcpy(&list[k], (const char *)&b->samples[k] + offset, sizeof *list);
  qsort(list, b->steps, sizeof *list, by_value);
  double value = list[(size_t)(q * (b->steps - 1) + 0.5)];
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

static sonde_status measure(bench *b, double *error_ratio, sonde_error *error) {
  sonde_world_def def = sonde_world_def_default();
  def.dt_s = b->o->dt_s;
  sonde_state *state = NULL, *reference = NULL;
  sonde_status status = sonde_state_create(b->model, &def, &state, error);
  def.sleep_displacement_m = 0;
  def.pcg = (sonde_pcg_options){1e-10, 1e-16, 5000};
  if (!status) status = sonde_state_create(b->model, &def, &reference, error);
  sample *scratch = calloc(b->steps, sizeof *scratch);
  double best = INFINITY;
  for (long r = 0; !status && scratch && r < b->o->repeat; ++r) {
    run(b, state, scratch);
    sample *kept = b->samples;
    b->samples = scratch;
    double median = quantile(b, offsetof(sample, total_s), 0.5);
    if (median < best)
      best = median, scratch = kept;
    else
      b->samples = kept;
  }
  *error_ratio = NAN;
  if (!status && b->o->reference) {
    run(b, reference, NULL);
    *error_ratio =
        relative_error(b->model, sonde_state_positions(state), sonde_state_positions(reference));
  }
  free(scratch);
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

static const struct {
  const char *name;
  size_t offset;
} STAGES[] = {{"contact", offsetof(sample, contact_s)},
              {"assembly", offsetof(sample, assembly_s)},
              {"solve", offsetof(sample, solve_s)},
              {"update", offsetof(sample, update_s)}};

static void print_json(const bench *b, double error_ratio) {
  size_t total = offsetof(sample, total_s);
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
  app_json_real("relative_error", error_ratio);
  app_json_object("stages_ms");
  for (size_t k = 0; k < 4; ++k)
    app_json_real(STAGES[k].name, quantile(b, STAGES[k].offset, 0.5) * 1e3);
  app_json_close();
  app_json_end();
}

static void print_table(const bench *b, double error_ratio) {
  size_t total = offsetof(sample, total_s);
  printf("scene %s: %u nodes, dt %g ms, %u steps, one core\n", b->o->scene->name,
         b->model->surface.vertex_count, b->o->dt_s * 1e3, b->steps);
  printf("  step      median %8.4f ms   p99 %8.4f ms   max %8.4f ms   %8.0f steps/s\n",
         quantile(b, total, 0.5) * 1e3, quantile(b, total, 0.99) * 1e3, quantile(b, total, 1) * 1e3,
         1 / quantile(b, total, 0.5));
  for (size_t k = 0; k < 4; ++k)
    printf("  %-9s median %8.4f ms   p99 %8.4f ms\n", STAGES[k].name,
           quantile(b, STAGES[k].offset, 0.5) * 1e3, quantile(b, STAGES[k].offset, 0.99) * 1e3);
  printf("  iterations %.1f   awake nodes %.0f   relative error ",
         mean_count(b, offsetof(sample, iterations)), mean_count(b, offsetof(sample, awake)));
  if (isnan(error_ratio))
    printf("not measured\n");
  else
    printf("%.2g\n", error_ratio);
}

int cmd_bench(int argc, char **argv) {
  options o = {.scene = &SCENES[0], .seconds = 1, .dt_s = 1e-3, .repeat = 3, .reference = true};
  int code = read_options(argc, argv, &o);
  if (code >= 0) return code;
  bench b = {.o = &o, .steps = (uint32_t)(o.seconds / o.dt_s + 0.5)};
  sonde_error error = {0};
  sonde_model *model = NULL;
  double error_ratio = NAN;
  sonde_status status = sonde_model_load(o.model, &model, &error);
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
