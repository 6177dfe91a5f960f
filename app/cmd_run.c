// sonde run: the simulator in real time, with the page or headless with a scripted exam.
#include "exam_app.h"
#include "exam_common.h"
#include "options.h"
#include "run_device.h"
#include "scanner_choice.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_PROBES = 16 };

typedef struct options {
  const char *model, *record, *probe, *pathology, *preset, *compare;
  const char *trainee, *exams, *cases, *own_cases, *protocols, *course, *scanner;
  const char *igtl, *push, *moduli;
  long port, images_hz;
  double seconds, gel_m3;
  bool headless, lockstep, json, no_gel, circulate, solid;
  sonde_posture posture;
  double valve_leak;
  run_device device;
} options;

static const options DEFAULTS = {.port = 8642,
                                 .images_hz = 50,
                                 .scanner = "venous",
                                 .seconds = 10.0,
                                 .probe = "linear",
                                 .pathology = "healthy",
                                 .gel_m3 = 1e-6 * 10.0,
                                 .device = {.clutch = 1}};

static const char *const POSTURES[SONDE_POSTURE_COUNT + 1] = {"supine", "sitting", "standing"};

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_INTEGER(port, "port", "N", 0, 65535, "port of the page on 127.0.0.1; 0: any free one"),
    OPT_FLAG(headless, "headless", "no page: a scripted exam at site 27 runs for --seconds"),
    OPT_REAL(seconds, "seconds", "S", 0.001, 1e6, 1, "duration of a headless run"),
    OPT_FLAG(lockstep, "lockstep",
             "headless without real time: as fast as it goes, the same every time"),
    OPT_TEXT(record, "record", "FILE",
             "record the inputs for sonde-replay(1); a FILE that is there before becomes FILE.old"),
    OPT_TEXT(probe, "probe", "NAME|FILE",
             "point, linear, square, sphere, or a mesh file in millimetres"),
    OPT_TEXT(pathology, "case", "NAME", APP_CASES),
    OPT_TEXT(preset, "preset", "FILE", "damping, stiffness and friction, see sonde-identify(1)"),
    OPT_TEXT(compare, "compare", "FILE",
             "a second preset, which the controls of the page can change over to"),
    OPT_FLAG(solid, "solid",
             "the hyperelastic solid bears the probe instead of the springs, and moves vessels, "
             "labels and picture (docs/solid.md); it wants a processor more"),
    OPT_TEXT(
        moduli, "moduli", "FILE",
        "materials of the solid, as sonde fit --solid writes them; default those of the study"),
    OPT_TEXT(scanner, "scanner", "NAME|FILE",
             "a scanner that ships (sonde scanner list) or a file; default venous"),
    OPT_INTEGER(images_hz, "images-hz", "N", 1, 50,
                "images per second at most: fewer leave more of a slow processor to the force"),
    OPT_REAL(gel_m3, "gel-ml", "V", 0, 1000, 1e-6,
             "gel spread over the sites at the start; 0: dry skin"),
    OPT_FLAG(no_gel, "no-gel", "no gel is simulated: every line of the image is coupled"),
    OPT_FLAG(circulate, "circulation",
             "pulse, breath, posture and strain move the vessels' pressures"),
    OPT_WORD(posture, "posture", "NAME", POSTURES, "with --circulation"),
    OPT_REAL(valve_leak, "valve-leak", "S", 0, 1, 1,
             "what the veins' valves leave open to blood that falls back, seen by Doppler; default "
             "0, 1: no valve shuts"),
    OPT_TEXT(
        device.name, "device", "NAME",
        "what moves the probe: page, touch, touch_x, premium_1.5, openhaptics, omega.3, "
        "omega.6, falcon, forcedimension, haply, spacenav, gamepad, hand (simulated operator), "
        "script or replay; default page, headless script"),
    OPT_TEXT(device.at, "device-at", "AT",
             "number of a site or name of a landmark where the probe starts; default 27"),
    OPT_INTEGER(device.clutch, "clutch", "N", 0, 32,
                "button that lets the handle move without the probe; 0: none"),
    OPT_REAL(device.force_scale, "force-scale", "X", 1e-3, 10, 1,
             "rendered over tissue force; default from the device's limits: 25 N of tissue are 0.8 "
             "of its peak"),
    OPT_TEXT(device.limits, "limits", "NAME", "render as for this device (docs/haptics.md)"),
    OPT_TEXT(device.from, "from", "FILE", "recording whose poses --device replay plays"),
    OPT_TEXT(device.library, "device-library", "FILE",
             "of the maker's driver, when it is not the usual one"),
    OPT_INTEGER(device.port, "device-port", "N", 1, 65535,
                "of the maker's driver, when it is not the usual one"),
    OPT_TEXT(igtl, "igtl", "[ADDRESS:]PORT",
             "serve pictures, poses and forces by OpenIGTLink (docs/stream_igtl.md), on 127.0.0.1 "
             "unless an address is given; 18944 is its usual port, 0: any free one"),
    OPT_TEXT(push, "push", "HOST:PORT",
             "send the same to a reader that listens itself, again every second until it is there"),
    OPT_TEXT(trainee, "trainee", "NAME",
             "whose exams they are; default: $SONDE_TRAINEE, else as the page says"),
    OPT_TEXT(exams, "exams", "DIR",
             "where exams are kept: recording, data, report and the log of all (exams.sqlite); "
             "default: sonde/exams in $XDG_DATA_HOME or ~/.local/share"),
    OPT_TEXT(cases, "cases", "DIR", "other cases than those that ship"),
    OPT_TEXT(own_cases, "own-cases", "DIR",
             "where the cases made on the page are kept; default: sonde/cases in $XDG_DATA_HOME or "
             "~/.local/share"),
    OPT_TEXT(protocols, "protocols", "DIR", "other protocols than those that ship"),
    OPT_TEXT(course, "course", "DIR", "another course than the one that ships"),
    OPT_FLAG(json, "json", "headless: print one JSON object at the end")};

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
  sonde_session_solid_counts solid;
} summary;

// Whom frames go to by OpenIGTLink; NULL: nobody.
static sonde_igtl_server *listeners = NULL;

static void post_frame(void *user, const sonde_frame *frame) {
  (void)sonde_igtl_post(user, frame); // without memory this frame is not sent
}

// Serves what --igtl and --push say; every image of the sessions goes there.
static sonde_status serve_igtl(const options *s, sonde_session_def *def, sonde_error *error) {
  char address[64];
  sonde_igtl_def igtl = {.push = s->push, .listen = s->igtl};
  if (s->igtl) {
    const char *colon = strrchr(s->igtl, ':'), *number = colon ? colon + 1 : s->igtl;
    char *end;
    const long port = strtol(number, &end, 10);
    if (number[0] < '0' || number[0] > '9' || *end || port > 65535 ||
        (colon && (size_t)(colon - s->igtl) >= sizeof address))
      return app_error(error, SONDE_ARGUMENT,
                       "--igtl expects a port from 0 to 65535 or ADDRESS:PORT, found '%s'",
                       s->igtl);
    if (colon) {
      snprintf(address, sizeof address, "%.*s", (int)(colon - s->igtl), s->igtl);
      igtl.address = address;
    }
    igtl.port = (uint16_t)port;
  }
  sonde_status status = sonde_igtl_start(&igtl, &listeners, error);
  if (status) return status;
  def->watch = post_frame;
  def->watch_user = listeners;
  // To stderr: the only line on stdout is the JSON object.
  if (s->igtl)
    fprintf(stderr, "OpenIGTLink on %s port %u\n", igtl.address ? igtl.address : "127.0.0.1",
            (unsigned)sonde_igtl_port(listeners));
  return SONDE_OK;
}

static int check(void *from) {
  static char leg[4096];
  options *s = from;
  if ((app_option_given("seconds") || s->lockstep || s->json) && !s->headless)
    return app_usage_error("run", "--seconds, --lockstep and --json need --headless");
  if (s->moduli && !s->solid) return app_usage_error("run", "--moduli goes with --solid");
  if (s->preset && s->solid)
    return app_usage_error("run", "--solid goes without --preset, which is of the springs");
  if (s->compare && !s->preset)
    return app_usage_error("run", "--compare needs a --preset to compare with");
  // A page practises on a whole leg; a place that is named and recorded poses are the thigh's.
  if (!s->model && !s->headless && !s->device.at && !s->device.from &&
      app_bundled_leg(leg, sizeof leg))
    s->model = leg;
  s->device.headless = s->headless;
  s->device.lockstep = s->lockstep;
  s->device.seconds = s->headless ? s->seconds : 3600.0;
  return run_device_check(&s->device) ? APP_OK : APP_BAD_INPUT;
}

static sonde_status make_device(const void *user, const sonde_site *start,
                                const sonde_session_def *def, sonde_device *device,
                                sonde_error *error) {
  return run_device_create(&((const options *)user)->device, start, def, device, error);
}

static void sleep_s(double seconds) {
  assert(seconds >= 0);
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
static sonde_status run_page(const options *s, const sonde_session_def *session_def,
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

// Practice, exams and replays.
static sonde_status run_exams(const options *s, const sonde_model *model,
                              const sonde_session_def *session_def, sonde_error *error) {
  char exams[4096], own_cases[4096];
  exam_library library = exam_library_find(s->cases, s->protocols);
  const char *named = getenv("SONDE_TRAINEE"), *trainee = s->trainee ? s->trainee : named;
  app_data_home(s->exams, "exams", exams, sizeof exams);
  app_data_home(s->own_cases, "cases", own_cases, sizeof own_cases);
  exam_app_def def = {.model = model,
                      .model_path = session_def->model_path,
                      .bundled_path = library.has_bundled ? library.bundled : NULL,
                      .cases = library.cases,
                      .own_cases = own_cases,
                      .protocols = library.protocols,
                      .course = s->course           ? s->course
                                : library.course[0] ? library.course
                                                    : NULL,
                      .exams = exams,
                      .trainee = trainee ? trainee : "",
                      .practice = *session_def,
                      .port = (uint16_t)s->port,
                      .force_limit_n = session_def->limits.force_n,
                      .make_device = make_device,
                      .user = s,
                      .device_name = s->device.name};
  exam_app *app = NULL;
  app_catch_interrupt();
  sonde_status status = run_device_site(&s->device, model, &def.start, error);
  if (!status) status = exam_app_create(&def, &app, error);
  if (status) return status;
  char learner[SONDE_PAGE_ADDRESS], teacher[SONDE_PAGE_ADDRESS];
  exam_app_address(app, false, learner);
  exam_app_address(app, true, teacher);
  announce(learner, teacher);
  while (!app_interrupted()) {
    exam_app_turn(app);
    sleep_s(0.01);
  }
  return exam_app_destroy(app, error);
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

// How the solid kept up.
static void print_solid(const summary *seen, bool json) {
  const sonde_session_solid_counts *c = &seen->solid;
  // Of passes and places, in processors.
  const double share = ((double)c->passes * c->pass_mean_s + c->build_s) / seen->wall_s;
  if (!json) {
    printf("\nsolid: %llu passes of %.1f ms, %u late, %u places, %.2f of a processor; "
           "%llu ticks in the skin without a place",
           (unsigned long long)c->passes, 1e3 * c->pass_mean_s, c->late, c->places, share,
           (unsigned long long)c->ticks_without_place);
    return;
  }
  app_json_object("solid");
  app_json("passes:%lu passes_late:%u pass_mean_ms:%g pass_max_ms:%g factors:%lu places:%u "
           "places_refused:%u ticks_without_place:%lu places_s:%g hand_over_max_n:%g core_share:%g "
           "images_per_s:%g",
           c->passes, c->late, 1e3 * c->pass_mean_s, 1e3 * c->pass_most_s, c->factors, c->places,
           c->refused, c->ticks_without_place, c->build_s, c->handed_over_n, share,
           (double)seen->images / seen->wall_s);
  app_json_close();
}

static void print_summary(const options *s, const summary *seen) {
  if (s->json) {
    char hash[20];
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)seen->hash);
    app_json_begin();
    app_json("ticks:%lu deadline_misses:%lu images:%lu", seen->ticks, seen->loop.deadline_misses,
             seen->images);
    if (isfinite(seen->latency_s[0])) {
      app_json_object("pose_to_image_ms");
      app_json("median:%g p99:%g", 1e3 * seen->latency_s[0], 1e3 * seen->latency_s[1]);
      app_json_close();
    }
    app_json("hash:%s wall_s:%g tick_mean_ms:%g tick_max_ms:%g realtime_priority:%hhd "
             "memory_locked:%hhd device:%s force_scale:%g force_max_n:%g rendered_force_max_n:%g "
             "faults:%u fault:%s taken_off:%u",
             hash, seen->wall_s, 1e3 * seen->loop.compute_mean_s, 1e3 * seen->loop.compute_max_s,
             seen->loop.realtime_priority, seen->loop.memory_locked, s->device.name,
             seen->force_scale, seen->force_max_n, seen->rendered_max_n, seen->faults,
             sonde_fault_text(seen->fault), seen->restores);
    if (seen->link.exchanges) {
      app_json("device_exchanges:%lu device_losses:%lu", seen->link.exchanges, seen->link.losses);
    }
    if (s->solid) print_solid(seen, true);
    app_json("tissue:%s", s->solid ? "solid" : "springs");
    if (isfinite(seen->gel_volume_m3)) {
      app_json("gel_ml:%g gel_coupling:%g", 1e6 * seen->gel_volume_m3, seen->gel_coupling);
    }
    app_json("penetration_max_mm:%g vein_area_ratio_min:%g", 1e3 * seen->penetration_max_m,
             seen->vein_ratio_min);
    if (listeners) {
      const sonde_igtl_counts sent = sonde_igtl_counted(listeners);
      app_json_object("igtl");
      app_json("frames:%lu clients:%u sent:%lu replaced:%lu", sent.frames, sent.joined, sent.sent,
               sent.replaced);
      app_json_close();
    }
    if (s->record) app_json_text("recording", s->record);
    app_json_end();
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
  if (s->solid) print_solid(seen, false);
  printf("\nstate hash %016llx\n", (unsigned long long)seen->hash);
  if (seen->loop.priority_note[0]) printf("note: %s\n", seen->loop.priority_note);
  if (seen->restores)
    printf(
        "the probe was led through the leg %u times: it was taken off until it had left the leg, "
        "with no force and no image\n",
        seen->restores);
  if (listeners) {
    const sonde_igtl_counts sent = sonde_igtl_counted(listeners);
    printf("OpenIGTLink: %llu frames, %u clients, %llu sent, %llu replaced by newer ones\n",
           (unsigned long long)sent.frames, sent.joined, (unsigned long long)sent.sent,
           (unsigned long long)sent.replaced);
  }
  if (s->record) printf("recorded to %s\n", s->record);
}

// The session from beginning to end; errors of the recording come at the end.
static int simulate(const options *s, const sonde_model *model, sonde_session_def *def) {
  sonde_error error = {0};
  sonde_session *session = NULL;
  summary seen = {0};
  sonde_site site;
  sonde_device device = {0};
  sonde_status status = run_device_site(&s->device, model, &site, &error);
  if (!status) status = make_device(s, &site, def, &device, &error);
  if (!status) status = sonde_session_create(def, &device, &session, &error);
  if (device.destroy) device.destroy(device.self); // not moved: creation failed
  if (!status && s->headless) {
    // With a script or a hand, for a time: in real time, or tick by tick as fast as it goes.
    assert(s->seconds > 0);
    sonde_progress progress = app_progress();
    double start_s = app_seconds(CLOCK_MONOTONIC);
    seen = (summary){.vein_ratio_min = INFINITY, .gel_volume_m3 = NAN};
    status = s->lockstep ? SONDE_OK : sonde_session_start(session, &error);
    if (s->lockstep) {
      double dt_s = sonde_session_def_default().world.dt_s;
      uint64_t ticks = (uint64_t)llround(s->seconds / dt_s);
      for (uint64_t i = 0; i < ticks; ++i) {
        sonde_session_tick(session);
        look(session, &seen);
        watch(session, &seen);
        double fraction = (double)(i + 1) / (double)ticks;
        if (i % 100 == 99 && !progress.report(fraction, "lockstep", progress.user)) break;
      }
    } else if (!status) {
      double begin_s = app_seconds(CLOCK_MONOTONIC), passed_s = 0.0;
      while (passed_s < s->seconds &&
             progress.report(passed_s / s->seconds, "real time", progress.user)) {
        look(session, &seen);
        watch(session, &seen);
        sleep_s(fmin(0.01, s->seconds - passed_s));
        passed_s = app_seconds(CLOCK_MONOTONIC) - begin_s;
      }
      sonde_session_stop(session);
      look(session, &seen);
    }
    app_progress_end();
    seen.wall_s = app_seconds(CLOCK_MONOTONIC) - start_s;
    seen.ticks = sonde_session_ticks(session);
    seen.images = sonde_session_images(session);
    seen.latency_s[0] = sonde_session_latency(session, 0.5);
    seen.latency_s[1] = sonde_session_latency(session, 0.99);
    seen.link = sonde_device_link_of(sonde_session_device(session));
    seen.hash = sonde_session_hash(session);
    seen.loop = sonde_session_loop(session);
    seen.solid = sonde_session_solid_count(session);
  } else if (!status)
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

static int run(void *from) {
  const options *s = from;
  assert(s->model && s->probe);
  const char *names[MAX_PROBES];
  sonde_error error = {0};
  sonde_model *model = NULL;
  sonde_session_def def;
  if (sonde_limb_model_load(s->model, &model, &error)) return app_fail("run", &error);
  char *absolute = realpath(s->model, NULL);
  int code = APP_OK;
  // Everything of the session but its model. names: filled with the probes, ended by NULL.
  def = sonde_session_def_default();
  def.record_path = s->record;
  def.controls.gel = !s->no_gel;
  def.gel_m3 = s->gel_m3;
  def.ticks_per_image = (uint32_t)lround(1 / (def.world.dt_s * (double)s->images_hz));
  sonde_scanner scanner;
  sonde_session_solid solid = sonde_session_solid_default();
  def.circulate = s->circulate || !s->headless; // the page has buttons for posture and strain
  def.controls.posture = s->posture;
  def.circulation.valve_leak = s->valve_leak;
  run_device_limits(&s->device, &def);

  // The built-in probes, and the wanted one when it is a file or a name that will be refused.
  const char *const *built_in = sonde_probe_names();
  uint32_t count = 0, wanted = UINT32_MAX;
  for (; count < MAX_PROBES - 2 && built_in[count]; ++count) {
    names[count] = built_in[count];
    if (strcmp(s->probe, built_in[count]) == 0) wanted = count;
  }
  if (wanted == UINT32_MAX) {
    wanted = count;
    names[count++] = s->probe;
  }
  names[count] = NULL;
  def.probe_names = names;
  def.controls.probe = wanted;

  // State of the vein, and the presets that the page can change over between.
  const char *const presets[SONDE_SESSION_PRESETS] = {s->preset, s->compare};
  sonde_status status = sonde_pathology_preset(s->pathology, &def.controls.pathology, &error);
  if (!status && s->scanner) {
    status = scanner_choose(s->scanner, &scanner, &error);
    def.scanner = &scanner, def.controls.echo = scanner.settings;
  }
  if (!status && s->solid) {
    def.solid = &solid;
    if (s->moduli) status = sonde_moduli_load(s->moduli, solid.layer, &error);
  }
  for (int k = 0; k < SONDE_SESSION_PRESETS && presets[k] && !status; ++k)
    status = sonde_preset_load(presets[k], &def.presets[def.preset_count++], &error);
  if (!status && (s->igtl || s->push)) status = serve_igtl(s, &def, &error);
  if (status) {
    code = app_fail("run", &error);
  } else {
    def.model = model;
    def.model_path = absolute ? absolute : s->model;
    if (s->headless || s->record)
      code = simulate(s, model, &def);
    else if (run_exams(s, model, &def, &error))
      code = app_fail("run", &error);
  }
  sonde_igtl_stop(listeners);
  free(absolute);
  sonde_model_destroy(model);
  return code;
}

const app_command cmd_run = {
    .verb = "run",
    .summary = "simulate in real time and serve the page",
    .usage = "[MODEL] [options]\n"
             "[MODEL] --headless [--seconds S] [--lockstep] [--json] [options]",
    .text = "Simulates compression ultrasound of a leg at 1 kHz and serves the page that shows it "
            "on 127.0.0.1. Ctrl-C stops.",
    .tail =
        "In the page it is the bundled leg, from groin to ankle, unless --device-at or --from name "
        "places of the thigh.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .check = check,
    .run = run};
