// sonde run: the simulator in real time, with the page or headless with a scripted exam.
//
// parse              the command line
// choose_probes      built-in probes, and a probe file when one is named
// load_tissue        presets
// define, create_session   everything that simulates
// run_page, run_desk until Ctrl-C
// run_headless       for a time, in real time or in lockstep
// print_summary      what a headless run did
#include "app.h"
#include "desk.h"
#include "exam_common.h"
#include "run_device.h"

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
    "  --preset FILE   damping, stiffness and friction (sonde-identify(1))\n"
    "  --compare FILE  a second preset, which the page can change over to\n"
    "  --gel-ml V      gel spread over the sites at the start (default 10; 0: dry skin)\n"
    "  --no-gel        no gel is simulated: every line of the image is coupled\n"
    "  --circulation   pulse, breath, posture and strain move the vessels' pressures\n"
    "  --posture NAME  supine, sitting or standing; with --circulation (default supine)\n"
    "  --device NAME   page, touch, touch_x, premium_1.5, omega.3, omega.6, falcon, haply,\n"
    "                  spacenav, gamepad, hand (simulated operator), script or replay\n"
    "                  (default page; headless: script)\n"
    "  --device-at AT  site or landmark where the probe starts (default 27)\n"
    "  --clutch N      button that lets the handle move without the probe; 0: none (default 1)\n"
    "  --force-scale X rendered over tissue force (default: from the device's limits)\n"
    "  --limits NAME   render as for this device (docs/haptics.md)\n"
    "  --from FILE     recording whose poses --device replay plays\n"
    "  --device-library FILE, --device-port N: of the maker's driver, when not the usual ones\n"
    "  --trainee NAME  whose exams they are (default: $SONDE_TRAINEE, else as the page says)\n"
    "  --exams DIR     where exams are kept (default: sonde/exams in $XDG_DATA_HOME or\n"
    "                  ~/.local/share)\n"
    "  --cases DIR, --protocols DIR: other cases and protocols than those that ship\n"
    "  --json          headless: print one JSON object at the end\n"
    "  --help          this text\n";

enum { MAX_PROBES = 16 };

typedef struct settings {
  const char *model, *record, *probe, *pathology, *preset, *compare, *posture;
  const char *trainee, *exams, *cases, *protocols;
  long port;
  double seconds, gel_ml;
  bool headless, lockstep, json, help, timed, no_gel, circulate;
  run_device device;
} settings;

// What a headless run saw.
typedef struct summary {
  double wall_s, force_max_n, rendered_max_n, penetration_max_m, vein_ratio_min, force_scale;
  double gel_volume_m3, gel_coupling;
  uint32_t faults; // latched one after the other
  uint32_t restores;
  sonde_fault fault;
  sonde_device_link link;
  double latency_s[2]; // from pose to image: median, 99 %; NaN in lockstep
  uint64_t ticks, images, hash;
  sonde_loop_stats loop;
} summary;

static bool parse_device(int option, settings *s) {
  run_device *d = &s->device;
  switch (option) {
  case 'D': d->name = optarg; return true;
  case 'A': d->at = optarg; return true;
  case 'L': d->limits = optarg; return true;
  case 'F': d->from = optarg; return true;
  case 'y': d->library = optarg; return true;
  case 'o': return app_parse_integer("run", "--device-port", optarg, 1, 65535, &d->port);
  case 'k': return app_parse_integer("run", "--clutch", optarg, 0, 32, &d->clutch);
  default: return app_parse_real("run", "--force-scale", optarg, 1e-3, 10, &d->force_scale);
  }
}

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
  case 'm': s->compare = optarg; return true;
  case 'g': return app_parse_real("run", "--gel-ml", optarg, 0, 1000, &s->gel_ml);
  case 'n': s->no_gel = true; return true;
  case 'C': s->circulate = true; return true;
  case 'u': s->posture = optarg; return true;
  case 'c': s->pathology = optarg; return true;
  case 't': s->trainee = optarg; return true;
  case 'E': s->exams = optarg; return true;
  case 'a': s->cases = optarg; return true;
  case 'O': s->protocols = optarg; return true;
  default: return parse_device(option, s);
  }
}

static const struct option OPTIONS[] = {{"port", required_argument, NULL, 'p'},
                                        {"seconds", required_argument, NULL, 's'},
                                        {"headless", no_argument, NULL, 'H'},
                                        {"lockstep", no_argument, NULL, 'l'},
                                        {"json", no_argument, NULL, 'j'},
                                        {"help", no_argument, NULL, 'h'},
                                        {"record", required_argument, NULL, 'r'},
                                        {"probe", required_argument, NULL, 'P'},
                                        {"case", required_argument, NULL, 'c'},
                                        {"preset", required_argument, NULL, 'e'},
                                        {"compare", required_argument, NULL, 'm'},
                                        {"gel-ml", required_argument, NULL, 'g'},
                                        {"no-gel", no_argument, NULL, 'n'},
                                        {"circulation", no_argument, NULL, 'C'},
                                        {"posture", required_argument, NULL, 'u'},
                                        {"device", required_argument, NULL, 'D'},
                                        {"device-at", required_argument, NULL, 'A'},
                                        {"limits", required_argument, NULL, 'L'},
                                        {"from", required_argument, NULL, 'F'},
                                        {"device-library", required_argument, NULL, 'y'},
                                        {"device-port", required_argument, NULL, 'o'},
                                        {"clutch", required_argument, NULL, 'k'},
                                        {"trainee", required_argument, NULL, 't'},
                                        {"exams", required_argument, NULL, 'E'},
                                        {"cases", required_argument, NULL, 'a'},
                                        {"protocols", required_argument, NULL, 'O'},
                                        {"force-scale", required_argument, NULL, 'x'},
                                        {NULL, 0, NULL, 0}};

static const char *const POSTURES[SONDE_POSTURE_COUNT] = {"supine", "sitting", "standing"};

// SONDE_POSTURE_COUNT for a name that is none.
static sonde_posture posture_of(const char *name) {
  int k = 0;
  while (name && k < SONDE_POSTURE_COUNT && strcmp(name, POSTURES[k]) != 0) ++k;
  return (sonde_posture)k;
}

// 0 when the options go together.
static int check(settings *s) {
  if ((s->timed || s->lockstep || s->json) && !s->headless)
    return app_usage_error("run", "--seconds, --lockstep and --json need --headless");
  if (s->compare && !s->preset)
    return app_usage_error("run", "--compare needs a --preset to compare with");
  if (posture_of(s->posture) == SONDE_POSTURE_COUNT)
    return app_usage_error("run", "unknown posture '%s', expected supine, sitting or standing",
                           s->posture);
  s->device.headless = s->headless;
  s->device.lockstep = s->lockstep;
  s->device.seconds = s->headless ? s->seconds : 3600.0;
  return run_device_check(&s->device) ? APP_OK : APP_BAD_INPUT;
}

// 0 when the command line is good.
static int parse(int argc, char **argv, settings *s) {
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":h", OPTIONS, NULL)) != -1) {
    if (option == ':') return app_usage_error("run", "%s needs a value", argv[optind - 1]);
    if (option == '?') return app_usage_error("run", "unknown option '%s'", argv[optind - 1]);
    if (!parse_option(option, s)) return APP_BAD_INPUT;
  }
  if (s->help) return APP_OK;
  if (optind < argc) s->model = argv[optind++];
  if (optind < argc) return app_usage_error("run", "unexpected argument '%s'", argv[optind]);
  return check(s);
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

static sonde_status load_tissue(const settings *s, sonde_session_def *def, sonde_error *error) {
  const char *const paths[SONDE_SESSION_PRESETS] = {s->preset, s->compare};
  sonde_status status = SONDE_OK;
  for (int k = 0; k < SONDE_SESSION_PRESETS && paths[k] && !status; ++k)
    status = sonde_preset_load(paths[k], &def->presets[def->preset_count++], error);
  return status;
}

// Everything but the probes and the model.
static sonde_status define(const settings *s, sonde_session_def *def, sonde_error *error) {
  *def = sonde_session_def_default();
  def->record_path = s->record;
  def->controls.gel = !s->no_gel;
  def->gel_m3 = 1e-6 * s->gel_ml;
  def->circulate = s->circulate;
  def->controls.posture = posture_of(s->posture);
  run_device_limits(&s->device, def);
  sonde_status status = sonde_pathology_preset(s->pathology, &def->controls.pathology, error);
  return status ? status : load_tissue(s, def, error);
}

static sonde_status make_device(const void *user, const sonde_site *start,
                                const sonde_session_def *def, sonde_device *device,
                                sonde_error *error) {
  return run_device_create(&((const settings *)user)->device, start, def, device, error);
}

static sonde_status create_session(const settings *s, const sonde_model *model,
                                   sonde_session_def *def, sonde_session **session,
                                   sonde_error *error) {
  sonde_site site;
  sonde_device device = {0};
  sonde_status status = run_device_site(&s->device, model, &site, error);
  if (!status) status = make_device(s, &site, def, &device, error);
  if (!status) status = sonde_session_create(def, &device, session, error);
  if (device.destroy) device.destroy(device.self); // not moved: creation failed
  return status;
}

static void sleep_s(double seconds) {
  struct timespec pause = {(time_t)seconds, (long)(1e9 * fmod(seconds, 1.0))};
  nanosleep(&pause, NULL);
}

// Who reads an address can take part.
static void announce(const char *learner, const char *teacher) {
  printf("Sonde is running: %s  (Ctrl-C stops)\n", learner);
  printf("For a teacher:    %s\n", teacher);
  fflush(stdout);
}

// Free practice only, recorded.
static sonde_status run_page(const settings *s, const sonde_session_def *session_def,
                             sonde_session *session, sonde_error *error) {
  sonde_page_server *server = NULL;
  sonde_page_def def = {.port = (uint16_t)s->port,
                        .model_path = session_def->model_path,
                        .force_limit_n = session_def->limits.force_n};
  app_catch_interrupt();
  sonde_status status = sonde_page_start(&def, session, &server, error);
  if (status) return status;
  status = sonde_session_start(session, error);
  if (!status) {
    char learner[SONDE_PAGE_ADDRESS], teacher[SONDE_PAGE_ADDRESS];
    sonde_page_address(server, false, learner);
    sonde_page_address(server, true, teacher);
    announce(learner, teacher);
    while (!app_interrupted()) sleep_s(0.1);
  }
  sonde_page_stop(server);
  sonde_session_stop(session);
  return status;
}

// Where exams are kept when the command line does not say.
static void exams_directory(const settings *s, char *path, size_t size) {
  const char *data = getenv("XDG_DATA_HOME"), *home = getenv("HOME");
  if (s->exams)
    snprintf(path, size, "%s", s->exams);
  else if (data && data[0])
    snprintf(path, size, "%s/sonde/exams", data);
  else
    snprintf(path, size, "%s/.local/share/sonde/exams", home && home[0] ? home : "/tmp");
}

// Practice, exams and replays.
static sonde_status run_desk(const settings *s, const sonde_model *model,
                             const sonde_session_def *session_def, sonde_error *error) {
  char exams[4096];
  exam_library library = exam_library_find(s->cases, s->protocols);
  const char *named = getenv("SONDE_TRAINEE");
  exams_directory(s, exams, sizeof exams);
  desk_def def = {.model = model,
                  .model_path = session_def->model_path,
                  .bundled_path = library.has_bundled ? library.bundled : NULL,
                  .cases = library.cases,
                  .protocols = library.protocols,
                  .exams = exams,
                  .trainee = s->trainee ? s->trainee
                             : named    ? named
                                        : "",
                  .practice = *session_def,
                  .port = (uint16_t)s->port,
                  .force_limit_n = session_def->limits.force_n,
                  .make_device = make_device,
                  .user = s,
                  .device_name = s->device.name};
  desk *d = NULL;
  app_catch_interrupt();
  sonde_status status = run_device_site(&s->device, model, &def.start, error);
  if (!status) status = desk_create(&def, &d, error);
  if (status) return status;
  char learner[SONDE_PAGE_ADDRESS], teacher[SONDE_PAGE_ADDRESS];
  desk_address(d, false, learner);
  desk_address(d, true, teacher);
  announce(learner, teacher);
  while (!app_interrupted()) {
    desk_turn(d);
    sleep_s(0.01);
  }
  return desk_destroy(d, error);
}

static void look(sonde_session *session, summary *seen) {
  sonde_frame frame;
  if (!sonde_session_frame(session, &frame)) return;
  seen->force_max_n = fmax(seen->force_max_n, frame.snapshot.force_normal_n);
  seen->penetration_max_m = fmax(seen->penetration_max_m, frame.snapshot.penetration_m);
  seen->vein_ratio_min = fmin(seen->vein_ratio_min, frame.snapshot.vein_area_ratio);
  sonde_vec3 f = frame.snapshot.rendered_force_n;
  seen->rendered_max_n = fmax(seen->rendered_max_n, sqrt(f.x * f.x + f.y * f.y + f.z * f.z));
  seen->restores = frame.snapshot.restores;
  seen->gel_volume_m3 = frame.snapshot.gel_volume_m3;
  seen->gel_coupling = frame.snapshot.gel_coupling;
}

// Nobody is there to press a button: a device that came back is taken up again, softly.
static void watch(sonde_session *session, summary *seen) {
  sonde_fault fault = sonde_session_fault(session);
  seen->faults += fault && !seen->fault;
  seen->fault = fault;
  if (seen->fault != SONDE_FAULT_DEVICE_LOST ||
      !sonde_device_link_of(sonde_session_device(session)).connected)
    return;
  sonde_session_controls controls = sonde_session_controls_now(session);
  controls.resume++;
  sonde_session_control(session, &controls);
}

static void run_lockstep(const settings *s, double dt_s, sonde_session *session,
                         const sonde_progress *progress, summary *seen) {
  uint64_t ticks = (uint64_t)llround(s->seconds / dt_s);
  for (uint64_t i = 0; i < ticks; ++i) {
    sonde_session_tick(session);
    look(session, seen);
    watch(session, seen);
    double fraction = (double)(i + 1) / (double)ticks;
    if (i % 100 == 99 && !progress->report(fraction, "lockstep", progress->user)) break;
  }
}

static sonde_status run_realtime(const settings *s, sonde_session *session,
                                 const sonde_progress *progress, summary *seen,
                                 sonde_error *error) {
  sonde_status status = sonde_session_start(session, error);
  if (status) return status;
  double start_s = app_seconds(CLOCK_MONOTONIC), passed_s = 0.0;
  while (passed_s < s->seconds &&
         progress->report(passed_s / s->seconds, "real time", progress->user)) {
    look(session, seen);
    watch(session, seen);
    sleep_s(fmin(0.01, s->seconds - passed_s));
    passed_s = app_seconds(CLOCK_MONOTONIC) - start_s;
  }
  sonde_session_stop(session);
  look(session, seen);
  return SONDE_OK;
}

static sonde_status run_headless(const settings *s, sonde_session *session, summary *seen,
                                 sonde_error *error) {
  sonde_progress progress = app_progress();
  sonde_status status = SONDE_OK;
  *seen = (summary){.vein_ratio_min = INFINITY, .gel_volume_m3 = NAN};
  double start_s = app_seconds(CLOCK_MONOTONIC);
  if (s->lockstep)
    run_lockstep(s, sonde_session_def_default().world.dt_s, session, &progress, seen);
  else
    status = run_realtime(s, session, &progress, seen, error);
  app_progress_end();
  seen->wall_s = app_seconds(CLOCK_MONOTONIC) - start_s;
  seen->ticks = sonde_session_ticks(session);
  seen->images = sonde_session_images(session);
  seen->latency_s[0] = sonde_session_latency(session, 0.5);
  seen->latency_s[1] = sonde_session_latency(session, 0.99);
  seen->link = sonde_device_link_of(sonde_session_device(session));
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
  app_json_text("device", s->device.name);
  app_json_real("force_scale", seen->force_scale);
  app_json_real("force_max_n", seen->force_max_n);
  app_json_real("rendered_force_max_n", seen->rendered_max_n);
  app_json_integer("faults", seen->faults);
  app_json_text("fault", sonde_fault_text(seen->fault));
  app_json_integer("taken_off", seen->restores);
  if (seen->link.exchanges) {
    app_json_integer("device_exchanges", (long long)seen->link.exchanges);
    app_json_integer("device_losses", (long long)seen->link.losses);
  }
  if (isfinite(seen->gel_volume_m3)) {
    app_json_real("gel_ml", 1e6 * seen->gel_volume_m3);
    app_json_real("gel_coupling", seen->gel_coupling);
  }
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
  printf("tissue force up to %.1f N at up to %.1f mm", seen->force_max_n,
         1e3 * seen->penetration_max_m);
  if (isfinite(seen->vein_ratio_min))
    printf(", vein down to %.0f %% of its area", 100.0 * seen->vein_ratio_min);
  printf("\nrendered force up to %.2f N: tissue force times %.3f", seen->rendered_max_n,
         seen->force_scale);
  if (seen->faults) printf("; %u faults, now: %s", seen->faults, sonde_fault_text(seen->fault));
  if (seen->link.exchanges)
    printf("\ndevice %s: %llu exchanges, lost %llu times", s->device.name,
           (unsigned long long)seen->link.exchanges, (unsigned long long)seen->link.losses);
  printf("\nstate hash %016llx\n", (unsigned long long)seen->hash);
  if (seen->loop.priority_note[0]) printf("note: %s\n", seen->loop.priority_note);
  if (seen->restores)
    printf(
        "the probe was led through the leg %u times: it was taken off until it had left the leg, "
        "with no force and no image\n",
        seen->restores);
  if (s->record) printf("recorded to %s\n", s->record);
}

// The session from beginning to end; errors of the recording come at the end.
static int simulate(const settings *s, const sonde_model *model, sonde_session_def *def) {
  sonde_error error = {0};
  sonde_session *session = NULL;
  summary seen = {0};
  sonde_status status = create_session(s, model, def, &session, &error);
  if (!status && s->headless)
    status = run_headless(s, session, &seen, &error);
  else if (!status)
    status = run_page(s, def, session, &error);
  sonde_error late = {0};
  sonde_status closed = sonde_session_destroy(session, &late);
  if (!status && closed) {
    status = closed;
    error = late;
  }
  if (status) return app_fail("run", &error);
  seen.force_scale = def->rendering.force_scale;
  if (s->headless) print_summary(s, &seen);
  return APP_OK;
}

static int run(const settings *s, const sonde_model *model, const char *model_path) {
  const char *names[MAX_PROBES];
  sonde_error error = {0};
  sonde_session_def def;
  if (define(s, &def, &error)) return app_fail("run", &error);
  def.model = model;
  def.model_path = model_path;
  def.probe_names = names;
  def.controls.probe = choose_probes(s->probe, names);
  def.circulate = s->circulate || !s->headless; // the page has buttons for posture and strain
  if (s->headless || s->record) return simulate(s, model, &def);
  return run_desk(s, model, &def, &error) ? app_fail("run", &error) : APP_OK;
}

int old_run(int argc, char **argv);
int old_run(int argc, char **argv) {
  settings s = {.port = 8642,
                .seconds = 10.0,
                .probe = "linear",
                .pathology = "healthy",
                .posture = "supine",
                .gel_ml = 10.0,
                .device = {.clutch = 1}};
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
  code = run(&s, model, absolute ? absolute : s.model);
  free(absolute);
  sonde_model_destroy(model);
  return code;
}
