// What all hardware drivers share: opening, the thread that exchanges forces and poses at 1 kHz,
// and the list of families.
#include "haptics/devices/devices.h"
#include "haptics/devices/pump.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"

#include <dlfcn.h>
#include <string.h>

static const double period_s = 1e-3, reopen_s = 0.25;

static const sonde_device_info builtin[] = {
    {"null", "stands still at one pose", true, "built in; needs no hardware"},
    {"hand", "simulated operator that feels the force", true, "built in; needs no hardware"},
    {"script", "follows a list of poses in time", true, "built in; needs no hardware"},
    {"replay", "plays recorded poses again", true, "built in; needs a recording"},
    {"page", "mouse and keys in the browser", true, "built in; started by `sonde run`"},
};
static const sonde_driver *const drivers[] = {&sonde_driver_openhaptics,
                                              &sonde_driver_forcedimension, &sonde_driver_haply,
                                              &sonde_driver_spacenav, &sonde_driver_gamepad};

sonde_status sonde_library_open(const char *path, const char *const *names,
                                const sonde_symbol *symbols, size_t count, void **library,
                                sonde_error *error) {
  SONDE_ASSERT(names != NULL && names[0] != NULL && library != NULL);
  *library = NULL;
  if (path) *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  for (size_t i = 0; !path && names[i] && !*library; ++i)
    *library = dlopen(names[i], RTLD_NOW | RTLD_LOCAL);
  if (!*library) return sonde_fail(error, SONDE_DEVICE, "library not found: %s", dlerror());
  for (size_t i = 0; i < count; ++i) {
    void *address = dlsym(*library, symbols[i].name);
    memcpy(symbols[i].slot, &address, sizeof address);
    if (address) continue;
    dlclose(*library);
    *library = NULL;
    return sonde_fail(error, SONDE_DEVICE, "the library %s has no function %s",
                      path ? path : names[0], symbols[i].name);
  }
  return SONDE_OK;
}

void sonde_steer(sonde_pose *pose, const double axis[6], double dt_s) {
  SONDE_ASSERT(pose != NULL && dt_s > 0.0);
  double a[6];
  for (int i = 0; i < 6; ++i) {
    double size = clamp(fabs(axis[i]), 0.0, 1.0);
    a[i] = size > 0.05 ? copysign((size - 0.05) / 0.95, axis[i]) : 0.0;
  }
  pose->position = v_madd(pose->position, 0.1 * dt_s, vec3(a[0], a[1], a[2]));
  sonde_quat rotation = {1.0, 0.5 * dt_s * a[3], 0.5 * dt_s * a[4], 0.5 * dt_s * a[5]};
  pose->rotation = q_unit(q_mul(rotation, pose->rotation));
}

sonde_device_open_def sonde_device_open_def_default(void) {
  return (sonde_device_open_def){.version = SONDE_DEF_VERSION};
}

static sonde_device_open_def clean(const sonde_device_open_def *def) {
  sonde_device_open_def c = def ? *def : sonde_device_open_def_default();
  sonde_quat q = c.world_from_base.rotation;
  if (!(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z > 1e-12))
    c.world_from_base.rotation = quat_identity();
  c.world_from_base.rotation = q_unit(c.world_from_base.rotation);
  if (!(c.motion_scale > 0.0)) c.motion_scale = 1.0;
  if (!(c.silence_s > 0.0)) c.silence_s = 0.05;
  if (!c.port) c.port = 10001;
  return c;
}

// One exchange with the driver: newest force out, pose in. A negative answer means that the device
// was lost.
static void exchange(sonde_pump *pump) {
  const sonde_command *command = sonde_mailbox_read(pump->commands);
  sonde_vec3 none = vec3(0, 0, 0);
  sonde_gate_apply(&pump->gate, command != NULL, command ? command->force_n : none,
                   command ? command->torque_n_m : none, period_s);
  sonde_device_sample sample = {{none, quat_identity()}, 0, true};
  int answer =
      pump->driver->exchange(pump->vendor, pump->gate.force_n, pump->gate.torque_n_m, &sample);
  if (answer == 0) return;
  if (answer < 0) {
    pump->driver->close(pump->vendor);
    atomic_store(&pump->connected, false);
    atomic_fetch_add(&pump->losses, 1);
    // whatever comes back starts from no force
    sonde_safety_limits limits = pump->gate.limits;
    sonde_gate_init(&pump->gate, &limits);
    sample = (sonde_device_sample){{none, quat_identity()}, 0, false};
  }
  sonde_device_sample *slot = sonde_mailbox_write_slot(pump->samples);
  *slot = sample;
  sonde_mailbox_publish(pump->samples);
  if (answer > 0) atomic_fetch_add(&pump->exchanges, 1);
}

// After a failure everything is closed again.
static sonde_status bring_up(const sonde_driver *driver, void *vendor,
                             const sonde_device_open_def *def, sonde_error *error) {
  SONDE_ASSERT(vendor != NULL && def != NULL);
  sonde_status status = driver->bind(vendor, def, error);
  if (!status) status = driver->open(vendor, def, error);
  if (status) driver->close(vendor);
  return status;
}

static void *thread_main(void *self) {
  sonde_pump *pump = self;
  struct sched_param param = {.sched_priority = 41}; // when allowed, just above the tick
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &param);
  double due_s = sonde_clock_now(), retry_s = 0.0;
  while (!atomic_load(&pump->stop)) {
    if (atomic_load(&pump->connected)) {
      exchange(pump);
      retry_s = sonde_clock_now() + reopen_s;
    } else if (sonde_clock_now() >= retry_s) {
      if (bring_up(pump->driver, pump->vendor, &pump->def, NULL) == SONDE_OK)
        atomic_store(&pump->connected, true);
      retry_s = sonde_clock_now() + reopen_s;
    }
    due_s = fmax(due_s + period_s, sonde_clock_now()); // no burst after a stall
    sonde_clock_sleep_until(due_s);
  }
  return NULL;
}

static void destroy(void *self) {
  sonde_pump *pump = self;
  if (!pump) return;
  atomic_store(&pump->stop, true);
  if (pump->running) pthread_join(pump->thread, NULL);
  if (pump->vendor && atomic_load(&pump->connected)) {
    sonde_device_sample last;
    pump->driver->exchange(pump->vendor, vec3(0, 0, 0), vec3(0, 0, 0), &last);
    pump->driver->close(pump->vendor);
  }
  sonde_mailbox_destroy(pump->samples);
  sonde_mailbox_destroy(pump->commands);
  sonde_free(pump->vendor);
  sonde_free(pump);
}

static const sonde_driver *find_driver(const char *name) {
  for (size_t i = 0; i < SONDE_COUNT_OF(drivers); ++i)
    if (strcmp(drivers[i]->name, name) == 0) return drivers[i];
  return NULL;
}

sonde_status sonde_device_open(const char *name, const sonde_device_open_def *def,
                               sonde_device *device, sonde_error *error) {
  SONDE_ASSERT(name != NULL && device != NULL);
  *device = (sonde_device){0};
  const sonde_driver *driver = find_driver(name);
  if (!driver)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "no driver '%s', expected openhaptics, forcedimension, haply, spacenav or "
                      "gamepad",
                      name);
  if (def) {
    sonde_status status = sonde_def_check(name, def->version, error);
    if (status) return status;
  }
  sonde_pump *pump = SONDE_NEW(sonde_pump, 1);
  if (!pump) return sonde_fail_memory(error);
  pump->vendor = sonde_calloc(1, driver->bytes);
  pump->driver = driver;
  pump->def = clean(def);
  if (def && def->library) {
    snprintf(pump->library, sizeof pump->library, "%s", def->library);
    pump->def.library = pump->library;
  }
  pump->last.world_from_probe = pump->def.world_from_base;
  sonde_gate_init(&pump->gate, pump->def.limits.force_n > 0.0 ? &pump->def.limits : NULL);
  sonde_status status = pump->vendor ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_mailbox_create(sizeof(sonde_device_sample), &pump->samples, error);
  if (!status) status = sonde_mailbox_create(sizeof(sonde_command), &pump->commands, error);
  if (!status) status = bring_up(driver, pump->vendor, &pump->def, error);
  if (!status) {
    atomic_store(&pump->connected, true);
    pump->running = pthread_create(&pump->thread, NULL, thread_main, pump) == 0;
    if (!pump->running)
      status = sonde_fail(error, SONDE_MEMORY, "%s: its thread could not be started", driver->name);
  }
  if (status) {
    destroy(pump);
    return status;
  }
  *device = (sonde_device){driver->name, pump, sonde_pump_read, sonde_pump_write, destroy};
  return SONDE_OK;
}

sonde_pose sonde_device_base(const char *name, sonde_pose probe) {
  SONDE_ASSERT(name != NULL);
  const sonde_driver *driver = find_driver(name);
  sonde_quat device = driver ? driver->user_from_device : quat_identity();
  const sonde_quat probe_from_user = {0.70710678118654752, -0.70710678118654752, 0, 0}; // y -> -z
  return (sonde_pose){probe.position,
                      q_unit(q_mul(probe.rotation, q_mul(probe_from_user, device)))};
}

sonde_device_link sonde_device_link_of(const sonde_device *device) {
  SONDE_ASSERT(device != NULL);
  if (device->read == sonde_clutch_read)
    return sonde_device_link_of(&((const sonde_clutch_device *)device->self)->inner);
  if (device->read != sonde_pump_read) return (sonde_device_link){0};
  const sonde_pump *pump = device->self;
  return (sonde_device_link){.exchanges = atomic_load(&pump->exchanges),
                             .losses = atomic_load(&pump->losses),
                             .connected = atomic_load(&pump->connected)};
}

uint32_t sonde_devices_find(bool probe, sonde_device_info *info, uint32_t capacity) {
  SONDE_ASSERT(info != NULL);
  uint32_t count = 0;
  for (size_t i = 0; i < SONDE_COUNT_OF(builtin) && count < capacity; ++i)
    info[count++] = builtin[i];
  for (size_t i = 0; i < SONDE_COUNT_OF(drivers) && count < capacity; ++i) {
    const sonde_driver *driver = drivers[i];
    sonde_device_info *line = &info[count++];
    *line = (sonde_device_info){driver->name, driver->description, false, ""};
    sonde_device_open_def def = clean(NULL);
    sonde_error error = {0};
    void *vendor = sonde_calloc(1, driver->bytes);
    sonde_status status = vendor ? SONDE_OK : sonde_fail_memory(&error);
    if (!status)
      status = probe ? bring_up(driver, vendor, &def, &error) : driver->bind(vendor, &def, &error);
    if (vendor) driver->close(vendor);
    sonde_free(vendor);
    line->available = !status;
    const char *found = probe ? "the device answered" : "found; --probe opens the device";
    snprintf(line->reason, sizeof line->reason, "%.159s", status ? error.message : found);
  }
  return count;
}
