// The device that sonde run follows.
#include "run_device.h"

#include "app.h"
#include "pose.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef enum kind { PAGE, SCRIPT, HAND, REPLAY, DRIVER } kind;

// A name of --device; limits: its row of the table, NULL for none.
typedef struct family {
  const char *name;
  kind kind;
  const char *driver, *limits;
} family;

static const family families[] = {{"page", PAGE, NULL, NULL},
                                  {"script", SCRIPT, NULL, NULL},
                                  {"replay", REPLAY, NULL, NULL},
                                  {"hand", HAND, NULL, "touch"},
                                  {"openhaptics", DRIVER, "openhaptics", "touch"},
                                  {"touch", DRIVER, "openhaptics", "touch"},
                                  {"touch_x", DRIVER, "openhaptics", "touch_x"},
                                  {"premium_1.5", DRIVER, "openhaptics", "premium_1.5"},
                                  {"forcedimension", DRIVER, "forcedimension", "omega.3"},
                                  {"omega.3", DRIVER, "forcedimension", "omega.3"},
                                  {"omega.6", DRIVER, "forcedimension", "omega.6"},
                                  {"falcon", DRIVER, "forcedimension", "falcon"},
                                  {"haply", DRIVER, "haply", "inverse3"},
                                  {"inverse3", DRIVER, "haply", "inverse3"},
                                  {"spacenav", DRIVER, "spacenav", NULL},
                                  {"gamepad", DRIVER, "gamepad", NULL}};
enum { FAMILIES = sizeof families / sizeof families[0], FIRST_SITE = 27 };

static const family *family_of(const char *name) {
  assert(name != NULL);
  for (size_t i = 0; i < FAMILIES; ++i)
    if (strcmp(families[i].name, name) == 0) return &families[i];
  return NULL;
}

static const sonde_device_limits *limits_of(const run_device *device) {
  const char *name = device->limits ? device->limits : family_of(device->name)->limits;
  return name ? sonde_device_limits_find(name) : NULL;
}

bool run_device_check(run_device *device) {
  if (!device->name) device->name = device->headless ? "script" : "page";
  const family *f = family_of(device->name);
  const char *wrong = NULL;
  if (!f) {
    app_usage_error("run",
                    "unknown device '%s', expected page, touch, touch_x, premium_1.5, openhaptics, "
                    "omega.3, omega.6, falcon, forcedimension, haply, spacenav, gamepad, hand, "
                    "script or replay",
                    device->name);
    return false;
  }
  if (device->limits && !sonde_device_limits_find(device->limits)) {
    app_usage_error("run", "no known limits of a device '%s'; docs/haptics.md lists them",
                    device->limits);
    return false;
  }
  if (f->kind == PAGE && device->headless) wrong = "--device page needs the page: not --headless";
  if (f->kind == DRIVER && device->lockstep) wrong = "--lockstep: a real device needs real time";
  if ((f->kind == REPLAY) != (device->from != NULL))
    wrong = "--device replay and --from belong together";
  if (wrong) app_usage_error("run", "%s", wrong);
  return !wrong;
}

// A landmark has a site's axes: those of the nearest site.
static sonde_status at_landmark(const sonde_model *model, const char *name, sonde_site *site,
                                sonde_error *error) {
  assert(name && site);
  const sonde_landmark *mark = model->anatomy ? sonde_anatomy_landmark(model->anatomy, name) : NULL;
  const sonde_site *near = mark ? sonde_model_site(model, mark->site) : NULL;
  if (!near) {
    return app_error(error, SONDE_NOT_FOUND,
                     "the model %s has neither a site nor a landmark '%.60s'", model->name, name);
  }
  *site = *near;
  site->position_m = mark->skin_m;
  site->normal = mark->normal;
  return SONDE_OK;
}

sonde_status run_device_site(const run_device *device, const sonde_model *model, sonde_site *site,
                             sonde_error *error) {
  char *end = NULL;
  unsigned long id = device->at ? strtoul(device->at, &end, 10) : FIRST_SITE;
  const sonde_site *named = sonde_model_site(model, (uint32_t)id);
  if (device->at && (*device->at == 0 || *end != 0))
    return at_landmark(model, device->at, site, error);
  if (device->at && !named) return at_landmark(model, device->at, site, error);
  if (!named && model->site_count) named = &model->sites[0];
  if (!named) {
    return app_error(error, SONDE_MISMATCH,
                     "the model %s has no measured site where the probe could start", model->name);
  }
  *site = *named;
  return SONDE_OK;
}

void run_device_limits(const run_device *device, sonde_session_def *def) {
  const sonde_device_limits *limits = limits_of(device);
  if (limits) {
    def->limits = sonde_safety_limits_of(limits);
    def->rendering = sonde_render_def_for(limits, def->world.dt_s, device->force_scale);
  } else if (device->force_scale > 0) {
    def->rendering.force_scale = device->force_scale;
  }
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

// The scripted exam for the whole run, or a simulated operator who follows it and holds a handle
// with the limits' motors and encoders; an arm that yields aims deeper.
static sonde_status create_exam(const run_device *device, const sonde_site *site, double dt_s,
                                bool by_hand, sonde_device *out, sonde_error *error) {
  assert(device->seconds > 0);
  const sonde_device_limits *limits = limits_of(device);
  sonde_hand_def hand = sonde_hand_def_default();
  hand.force_limit_n = limits ? limits->force_peak_n : 0;
  hand.resolution_m = limits ? limits->resolution_m : 0;
  double yield_m = by_hand ? 0.8 * hand.force_limit_n / hand.stiffness_n_m : 0;
  uint32_t count = ((uint32_t)(device->seconds / round_s) + 1) * ROUND_STEPS;
  sonde_script_key *keys = calloc(count, sizeof *keys);
  if (!keys) return error->status = SONDE_MEMORY;
  for (uint32_t i = 0; i < count; ++i) {
    const exam_step *step = &ROUND[i % ROUND_STEPS];
    sonde_pose pose = sonde_site_pose(site, step->depth_m + (step->depth_m > 0 ? yield_m : 0));
    keys[i] = (sonde_script_key){i / ROUND_STEPS * round_s + step->time_s,
                                 pose_shift(pose, step->along_m, site->v)};
  }
  sonde_status status = by_hand ? sonde_device_hand(&hand, keys, count, dt_s, out, error)
                                : sonde_device_script(keys, count, dt_s, out, error);
  free(keys);
  return status;
}

sonde_status run_device_create(const run_device *device, const sonde_site *site,
                               const sonde_session_def *def, sonde_device *out,
                               sonde_error *error) {
  const family *f = family_of(device->name);
  assert(f && site && def->world.dt_s > 0);
  sonde_pose start = sonde_site_pose(site, -0.01);
  double dt_s = def->world.dt_s;
  switch (f->kind) {
  case PAGE: return sonde_device_page(start, dt_s, out, error);
  case SCRIPT: return create_exam(device, site, dt_s, false, out, error);
  case HAND: return create_exam(device, site, dt_s, true, out, error);
  case REPLAY: return sonde_device_recording(device->from, out, error);
  default: break;
  }

  // Hardware behind a clutch: a button lets the handle move without the probe.
  sonde_device_open_def open = sonde_device_open_def_default();
  open.library = device->library;
  open.port = (uint16_t)device->port;
  open.world_from_base = sonde_device_base(f->driver, start);
  open.limits = def->limits;
  sonde_clutch_def clutch = sonde_clutch_def_default();
  clutch.world_from_probe = start;
  clutch.buttons = device->clutch ? 1u << (device->clutch - 1) : 0;
  clutch.dt_s = dt_s;
  sonde_device inner = {0};
  sonde_status status = sonde_device_open(f->driver, &open, &inner, error);
  if (!status) status = sonde_device_clutch(&clutch, &inner, out, error);
  if (inner.destroy) inner.destroy(inner.self);
  return status;
}
