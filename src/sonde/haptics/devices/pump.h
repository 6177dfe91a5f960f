// What all hardware drivers share: a thread that exchanges force and pose with the vendor, and the
// mailboxes between it and the tick.
#ifndef SONDE_SRC_PUMP_H
#define SONDE_SRC_PUMP_H

#include "sonde/haptics_devices.h"

#include "base/mailbox.h"

#include <pthread.h>
#include <stdatomic.h>

// A vendor, in the device's frame and metres. Only the owner before the thread runs, then only the
// thread, calls these.
typedef struct sonde_driver {
  const char *name, *description;
  sonde_quat user_from_device; // user: x to the right, y up, z towards whoever sits before it
  size_t bytes;                // of its state, which begins zeroed
  // Finds the vendor's library or service without touching the device, then opens the device; a
  // reason of one sentence in error.
  sonde_status (*bind)(void *self, const sonde_device_open_def *def, sonde_error *error);
  sonde_status (*open)(void *self, const sonde_device_open_def *def, sonde_error *error);
  // Force out, pose in. 1: a pose, 0: none yet, -1: the device is lost.
  int (*exchange)(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                  sonde_device_sample *sample);
  // After either of them, whether it succeeded or failed half-way.
  void (*close)(void *self);
} sonde_driver;

extern const sonde_driver sonde_driver_openhaptics, sonde_driver_forcedimension, sonde_driver_haply,
    sonde_driver_spacenav, sonde_driver_gamepad;

typedef struct sonde_command {
  sonde_vec3 force_n, torque_n_m;
} sonde_command;

typedef struct sonde_pump {
  const sonde_driver *driver;
  void *vendor;
  char library[512];
  sonde_device_open_def def; // def.library points at the copy above
  sonde_mailbox *samples, *commands;
  sonde_gate gate;
  pthread_t thread;
  bool running;
  atomic_bool stop, connected;
  _Atomic uint64_t exchanges, losses;
  // tick
  sonde_device_sample last;
  uint64_t silent_ticks;
} sonde_pump;

// Hot: the tick's side.
void sonde_pump_read(void *self, uint64_t tick, sonde_device_sample *sample);
void sonde_pump_write(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m);

// One function of a vendor's library: where its address goes.
typedef struct sonde_symbol {
  const char *name;
  void *slot; // address of a function pointer
} sonde_symbol;

// Opens the given path or the first of the NULL-terminated names, then fills all slots.
// DEVICE: what dlopen or dlsym said. *library must be closed by dlclose.
sonde_status sonde_library_open(const char *path, const char *const *names,
                                const sonde_symbol *symbols, size_t count, void **library,
                                sonde_error *error);

// Steering: a deflection in [-1, 1] per axis moves the pose; dead zone 0.05, 0.1 m/s, 1 rad/s.
void sonde_steer(sonde_pose *pose, const double axis[6], double dt_s);

#endif
