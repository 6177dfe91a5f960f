// sonde run: the simulator in real time, with the page or headless with a scripted exam.
//
// parse              the command line
// choose_probes      built-in probes, and a probe file when one is named
// exam_keys          the scripted exam: press, hold, slide, come back, release
// create_device      the page's device, or the script
// create_session     everything that simulates
// run_page           until Ctrl-C
// run_headless       for a time, in real time or in lockstep
// print_summary      what a headless run did
#include "app.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const char help[] =
    "usage: sonde run [MODEL] [OPTIONS]\n"
    "\n"
    "Simulates compression ultrasound of a thigh at 1 kHz and serves the page that shows it.\n"
    "MODEL is a model file; default: the bundled thigh. Ctrl-C stops.\n"
    "\n"
    "  --port N        port of the page on 127.0.0.1; 0: any free one (default 8642)\n"
    "  --headless      no page: a scripted exam at site 27 runs for --seconds\n"
    "  --seconds S     duration of a headless run (default 10)\n"
    "  --lockstep      headless without real time: as fast as it goes, the same every time\n"
    "  --record FILE   record the inputs; `sonde replay FILE` plays them again\n"
    "  --probe NAME    point, linear, square, sphere or a mesh file (default linear)\n"
    "  --case NAME     healthy, partial_mural, acute_occlusive, subacute_occlusive,\n"
    "                  chronic_occlusive (default healthy)\n"
    "  --preset FILE   damping, stiffness and friction (sonde-identify(1)); not with --record\n"
    "  --json          headless: print one JSON object at the end\n"
    "  --help          this text\n";

enum { FIRST_SITE = 27, MAX_PROBES = 16 };

typedef struct settings {
  const char *model, *record, *probe, *pathology, *preset;
  long port;
  double seconds;
  bool headless, lockstep, json, help, timed;
} settings;

// What a headless run saw.
typedef struct summary {
  double wall_s, force_max_n, penetration_max_m, vein_ratio_min;
  double latency_s[2]; // from pose to image: median, 99 %; NaN in lockstep
  uint64_t ticks, images, hash;
  sonde_loop_stats loop;
} summary;

static bool parse_option(int option, settings *s) {
  switch (option) {
  case 'p': return app_parse_integer("run", "--port", optarg, 0, 65535, &s->port);
  case 's':
    s->timed = true;
    return app_parse_real("run", "--seconds", optarg, 0.001, 1e6, &s->seconds);
  case 'H': s->headless = true; return true;
  case 'l': s->lockstep = true; return true;
  case 'j': s->json = true; return true;
  case 'h': s->help = true; return true;
  case 'r': s->record = optarg; return true;
  case 'P': s->probe = optarg; return true;
  case 'e': s->preset = optarg; return true;
  default: s->pathology = optarg; return true;
  }
}

// 0 when the command line is good.
static int parse(int argc, char **argv, settings *s) {
  static const struct option options[] = {{"port", required_argument, NULL, 'p'},
                                          {"seconds", required_argument, NULL, 's'},
                                          {"headless", no_argument, NULL, 'H'},
                                          {"lockstep", no_argument, NULL, 'l'},
                                          {"json", no_argument, NULL, 'j'},
                                          {"help", no_argument, NULL, 'h'},
                                          {"record", required_argument, NULL, 'r'},
                                          {"probe", required_argument, NULL, 'P'},
                                          {"case", required_argument, NULL, 'c'},
                                          {"preset", required_argument, NULL, 'e'},
                                          {NULL, 0, NULL, 0}};
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
    if (option == ':') return app_usage_error("run", "%s needs a value", argv[optind - 1]);
    if (option == '?') return app_usage_error("run", "unknown option '%s'", argv[optind - 1]);
    if (!parse_option(option, s)) return APP_BAD_INPUT;
  }
  if (s->help) return APP_OK;
  if (optind < argc) s->model = argv[optind++];
  if (optind < argc) return app_usage_error("run", "unexpected argument '%s'", argv[optind]);
  if ((s->timed || s->lockstep || s->json) && !s->headless)
    return app_usage_error("run", "--seconds, --lockstep and --json need --headless");
  if (s->preset && s->record) // a recording names the model file, whose law it would replay with
    return app_usage_error("run", "--record keeps no preset: give one of --preset and --record");
  return APP_OK;
}

// Fills a NULL-terminated list and returns the index of the wanted probe.
static uint32_t choose_probes(const char *wanted, const char *names[MAX_PROBES]) {
  const char *const *built_in = sonde_probe_names();
  uint32_t count = 0, index = UINT32_MAX;
  for (; count < MAX_PROBES - 2 && built_in[count]; ++count) {
    names[count] = built_in[count];
    if (strcmp(wanted, built_in[count]) == 0) index = count;
  }
  if (index == UINT32_MAX) {
    index = count;
    names[count++] = wanted; // a file, or a name that the session will reject
  }
  names[count] = NULL;
  return index;
}

static const sonde_site *first_site(const sonde_model *model) {
  const sonde_site *site = sonde_model_site(model, FIRST_SITE);
  return site || model->site_count == 0 ? site : &model->sites[0];
}

// One round: depth of the probe's face and offset along the leg at a time.
typedef struct exam_step {
  double time_s, depth_m, along_m;
} exam_step;

static const exam_step ROUND[] = {{0.0, -0.010, 0.0}, {0.6, 0.0, 0.0},     {1.8, 0.020, 0.0},
                                  {2.6, 0.020, 0.0},  {3.4, 0.020, 0.008}, {4.2, 0.020, 0.0},
                                  {5.2, -0.010, 0.0}};
enum { ROUND_STEPS = sizeof ROUND / sizeof ROUND[0] };
static const double round_s = 6.0;

// Keys for the whole run, freed by the caller; NULL without memory.
static sonde_script_key *exam_keys(const sonde_site *site, double seconds, uint32_t *count) {
  uint32_t rounds = (uint32_t)(seconds / round_s) + 1;
  sonde_script_key *keys = calloc((size_t)rounds * ROUND_STEPS, sizeof *keys);
  *count = 0;
  for (uint32_t i = 0; keys && i < rounds * ROUND_STEPS; ++i) {
    const exam_step *step = &ROUND[i % ROUND_STEPS];
    sonde_pose pose = sonde_site_pose(site, step->depth_m);
    pose.position.x += step->along_m * site->v.x;
    pose.position.y += step->along_m * site->v.y;
    pose.position.z += step->along_m * site->v.z;
    keys[(*count)++] = (sonde_script_key){i / ROUND_STEPS * round_s + step->time_s, pose};
  }
  return keys;
}

static sonde_status create_device(const settings *s, const sonde_model *model, double dt_s,
                                  sonde_device *device, sonde_error *error) {
  const sonde_site *site = first_site(model);
  if (!site) {
    *error = (sonde_error){.status = SONDE_MISMATCH};
    snprintf(error->message, sizeof error->message,
             "the model %s has no measured site where the probe could start", model->name);
    return error->status;
  }
  if (!s->headless) return sonde_device_page(sonde_site_pose(site, -0.01), dt_s, device, error);
  uint32_t count = 0;
  sonde_script_key *keys = exam_keys(site, s->seconds, &count);
  sonde_status status = sonde_device_script(keys, count, dt_s, device, error);
  free(keys);
  return status;
}

static sonde_status create_session(const settings *s, sonde_model *model, const char *model_path,
                                   sonde_session **session, sonde_error *error) {
  const char *names[MAX_PROBES];
  sonde_session_def def = sonde_session_def_default();
  def.model = model;
  def.model_path = model_path;
  def.record_path = s->record;
  def.probe_names = names;
  def.controls.probe = choose_probes(s->probe, names);
  sonde_preset preset = sonde_preset_default();
  sonde_status status = sonde_pathology_preset(s->pathology, &def.controls.pathology, error);
  if (!status && s->preset) status = sonde_preset_load(s->preset, &preset, error);
  if (!status) status = sonde_preset_apply(&preset, model, &def.world, error);
  sonde_device device = {0};
  if (!status) status = create_device(s, model, def.world.dt_s, &device, error);
  if (!status) status = sonde_session_create(&def, &device, session, error);
  if (device.destroy) device.destroy(device.self); // not moved: creation failed
  return status;
}

static double now_s(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void sleep_s(double seconds) {
  struct timespec pause = {(time_t)seconds, (long)(1e9 * fmod(seconds, 1.0))};
  nanosleep(&pause, NULL);
}

static sonde_status run_page(const settings *s, const char *model_path, sonde_session *session,
                             sonde_error *error) {
  sonde_page_server *server = NULL;
  sonde_page_def def = {.port = (uint16_t)s->port, .model_path = model_path};
  app_catch_interrupt();
  sonde_status status = sonde_page_start(&def, session, &server, error);
  if (status) return status;
  status = sonde_session_start(session, error);
  if (!status) {
    printf("Sonde is running: http://127.0.0.1:%u/  (Ctrl-C stops)\n",
           (unsigned)sonde_page_port(server));
    fflush(stdout);
    while (!app_interrupted()) sleep_s(0.1);
  }
  sonde_page_stop(server);
  sonde_session_stop(session);
  return status;
}

static void look(sonde_session *session, summary *seen) {
  sonde_frame frame;
  if (!sonde_session_frame(session, &frame)) return;
  seen->force_max_n = fmax(seen->force_max_n, frame.snapshot.force_normal_n);
  seen->penetration_max_m = fmax(seen->penetration_max_m, frame.snapshot.penetration_m);
  seen->vein_ratio_min = fmin(seen->vein_ratio_min, frame.snapshot.vein_area_ratio);
}

static void run_lockstep(const settings *s, double dt_s, sonde_session *session,
                         const sonde_progress *progress, summary *seen) {
  uint64_t ticks = (uint64_t)llround(s->seconds / dt_s);
  for (uint64_t i = 0; i < ticks; ++i) {
    sonde_session_tick(session);
    look(session, seen);
    double fraction = (double)(i + 1) / (double)ticks;
    if (i % 100 == 99 && !progress->report(fraction, "lockstep", progress->user)) break;
  }
}

static sonde_status run_realtime(const settings *s, sonde_session *session,
                                 const sonde_progress *progress, summary *seen,
                                 sonde_error *error) {
  sonde_status status = sonde_session_start(session, error);
  if (status) return status;
  double start_s = now_s(), passed_s = 0.0;
  while (passed_s < s->seconds &&
         progress->report(passed_s / s->seconds, "real time", progress->user)) {
    look(session, seen);
    sleep_s(fmin(0.01, s->seconds - passed_s));
    passed_s = now_s() - start_s;
  }
  sonde_session_stop(session);
  look(session, seen);
  return SONDE_OK;
}

static sonde_status run_headless(const settings *s, sonde_session *session, summary *seen,
                                 sonde_error *error) {
  sonde_progress progress = app_progress();
  sonde_status status = SONDE_OK;
  *seen = (summary){.vein_ratio_min = INFINITY};
  double start_s = now_s();
  if (s->lockstep)
    run_lockstep(s, sonde_session_def_default().world.dt_s, session, &progress, seen);
  else
    status = run_realtime(s, session, &progress, seen, error);
  app_progress_end();
  seen->wall_s = now_s() - start_s;
  seen->ticks = sonde_session_ticks(session);
  seen->images = sonde_session_images(session);
  seen->latency_s[0] = sonde_session_latency(session, 0.5);
  seen->latency_s[1] = sonde_session_latency(session, 0.99);
  seen->hash = sonde_session_hash(session);
  seen->loop = sonde_session_loop(session);
  return status;
}

static void print_json(const settings *s, const summary *seen) {
  char hash[20];
  snprintf(hash, sizeof hash, "%016llx", (unsigned long long)seen->hash);
  app_json_begin();
  app_json_integer("ticks", (long long)seen->ticks);
  app_json_integer("deadline_misses", (long long)seen->loop.deadline_misses);
  app_json_integer("images", (long long)seen->images);
  if (isfinite(seen->latency_s[0])) {
    app_json_object("pose_to_image_ms");
    app_json_real("median", 1e3 * seen->latency_s[0]);
    app_json_real("p99", 1e3 * seen->latency_s[1]);
    app_json_close();
  }
  app_json_text("hash", hash);
  app_json_real("wall_s", seen->wall_s);
  app_json_real("tick_mean_ms", 1e3 * seen->loop.compute_mean_s);
  app_json_real("tick_max_ms", 1e3 * seen->loop.compute_max_s);
  app_json_bool("realtime_priority", seen->loop.realtime_priority);
  app_json_bool("memory_locked", seen->loop.memory_locked);
  app_json_real("force_max_n", seen->force_max_n);
  app_json_real("penetration_max_mm", 1e3 * seen->penetration_max_m);
  app_json_real("vein_area_ratio_min", seen->vein_ratio_min);
  if (s->record) app_json_text("recording", s->record);
  app_json_end();
}

static void print_summary(const settings *s, const summary *seen) {
  if (s->json) {
    print_json(s, seen);
    return;
  }
  printf("%llu ticks and %llu images in %.2f s, %llu deadline misses\n",
         (unsigned long long)seen->ticks, (unsigned long long)seen->images, seen->wall_s,
         (unsigned long long)seen->loop.deadline_misses);
  if (isfinite(seen->latency_s[0]))
    printf("from pose to image %.1f ms, 99 %% within %.1f ms\n", 1e3 * seen->latency_s[0],
           1e3 * seen->latency_s[1]);
  printf("force up to %.1f N at up to %.1f mm", seen->force_max_n, 1e3 * seen->penetration_max_m);
  if (isfinite(seen->vein_ratio_min))
    printf(", vein down to %.0f %% of its area", 100.0 * seen->vein_ratio_min);
  printf("\nstate hash %016llx\n", (unsigned long long)seen->hash);
  if (seen->loop.priority_note[0]) printf("note: %s\n", seen->loop.priority_note);
  if (s->record) printf("recorded to %s\n", s->record);
}

// The session from beginning to end; errors of the recording come at the end.
static int simulate(const settings *s, sonde_model *model, const char *model_path) {
  sonde_error error = {0};
  sonde_session *session = NULL;
  summary seen = {0};
  sonde_status status = create_session(s, model, model_path, &session, &error);
  if (!status && s->headless)
    status = run_headless(s, session, &seen, &error);
  else if (!status)
    status = run_page(s, model_path, session, &error);
  sonde_error late = {0};
  sonde_status closed = sonde_session_destroy(session, &late);
  if (!status && closed) {
    status = closed;
    error = late;
  }
  if (status) return app_fail("run", &error);
  if (s->headless) print_summary(s, &seen);
  return APP_OK;
}

int cmd_run(int argc, char **argv) {
  settings s = {.port = 8642, .seconds = 10.0, .probe = "linear", .pathology = "healthy"};
  int code = parse(argc, argv, &s);
  if (code != APP_OK) return code;
  if (s.help) {
    fputs(help, stdout);
    return APP_OK;
  }
  char bundled[4096], searched[4096];
  if (!s.model) {
    if (!app_bundled_model(bundled, sizeof bundled, searched, sizeof searched))
      return app_usage_error("run", "the bundled model was not found (searched %s)", searched);
    s.model = bundled;
  }
  sonde_error error = {0};
  sonde_model *model = NULL;
  if (sonde_model_load(s.model, &model, &error)) return app_fail("run", &error);
  char *absolute = realpath(s.model, NULL);
  code = simulate(&s, model, absolute ? absolute : s.model);
  free(absolute);
  sonde_model_destroy(model);
  return code;
}
