/**
 * @file haptics_devices.h
 * Hardware: drivers whose vendor libraries are opened at run time, and the gate on their side.
 */
#ifndef SONDE_HAPTICS_DEVICES_H
#define SONDE_HAPTICS_DEVICES_H

#include "sonde/haptics.h"

#ifdef __cplusplus
extern "C" {
#endif

/** How to open a driver; zero means default. */
typedef struct sonde_device_open_def {
  uint32_t version;           /**< SONDE_DEF_VERSION, from sonde_device_open_def_default() */
  const char *library;        /**< path of the vendor's library; NULL: its usual names */
  uint16_t port;              /**< haply: of its service on this machine; default 10001 */
  sonde_pose world_from_base; /**< the device's frame; a zero rotation is none */
  double motion_scale;        /**< metres of the probe per metre of the handle; default 1 */
  sonde_safety_limits limits; /**< of the gate on the driver's side; force_n 0: defaults */
  double silence_s;           /**< without a pose for so long: not present; default 0.05 */
} sonde_device_open_def;

/** All zero but the version. @thread any */
SONDE_API sonde_device_open_def sonde_device_open_def_default(void);

/**
 * Opens openhaptics, forcedimension, haply, spacenav or gamepad and starts its thread: it exchanges
 * force and pose with the vendor at 1 kHz and meets the tick through mailboxes only. A device that
 * is lost (present: false) is opened again every quarter of a second.
 * spacenav and gamepad steer: their deflection is the speed of the pose, from the base on.
 * @param def NULL: the default
 * @return SONDE_DEVICE with the reason in one sentence, SONDE_ARGUMENT for another name
 * @thread owner
 */
SONDE_API sonde_status sonde_device_open(const char *name, const sonde_device_open_def *def,
                                         sonde_device *device, sonde_error *error);

/** Frame of a driver's device on a table in front of its user, at a probe: to the right is the
 *  probe's x, up is away from the skin, towards the user is the probe's y. Its origin is at the
 *  probe's. @return world_from_base; for another name as for openhaptics @thread any */
SONDE_API sonde_pose sonde_device_base(const char *name, sonde_pose world_from_probe);

/** How a handle takes hold of the probe; zero means default. */
typedef struct sonde_clutch_def {
  uint32_t version;            /**< SONDE_DEF_VERSION, from sonde_clutch_def_default() */
  sonde_pose world_from_probe; /**< where the probe is at the start; a zero rotation is none */
  uint32_t buttons; /**< while one of them is pressed the probe stays where it is; 0: never */
  double ramp_s;    /**< the force comes back within so long; default 0.1 */
  double dt_s;      /**< a tick; default 1e-3 */
} sonde_clutch_def;

/** All zero but the version. @thread any */
SONDE_API sonde_clutch_def sonde_clutch_def_default(void);

/**
 * A device with a clutch around another one, `inner`, which is moved into it: the handle takes hold
 * of the probe wherever the handle is - at the start, when the buttons are released and when a lost
 * device comes back - and moves it from there as it moves itself. A handle with little room reaches
 * everything in strokes, and no hold ever moves the probe. Forces go to the handle as they are,
 * none while it does not hold the probe.
 * @param inner zeroed; on failure it stays the caller's
 * @return SONDE_ARGUMENT, SONDE_MEMORY @thread owner
 */
SONDE_API sonde_status sonde_device_clutch(const sonde_clutch_def *def, sonde_device *inner,
                                           sonde_device *device, sonde_error *error);

/** Counters of an opened driver. */
typedef struct sonde_device_link {
  uint64_t exchanges; /**< poses that the vendor delivered */
  uint64_t losses;    /**< times that the device was lost */
  bool connected;
} sonde_device_link;
/** Of a driver, also behind a clutch; zeros for other devices. @thread any */
SONDE_API sonde_device_link sonde_device_link_of(const sonde_device *device);

/** Built-in families, then the drivers, each with the reason why it is there or not.
 *  @param probe false: only looks for the libraries; true: opens each device for a moment
 *  @param[out] info [capacity] @return their number, at most capacity @thread owner */
SONDE_API uint32_t sonde_devices_find(bool probe, sonde_device_info *info, uint32_t capacity);

/** The last gate, on the driver's side of the mailbox: it goes on when the simulation does not.
 * Held by value in the driver's state, as sonde_safety is; its members are there to be read. */
typedef struct sonde_gate {
  sonde_safety_limits limits;
  double age_s; /**< since the newest command */
  sonde_vec3 wanted_n, wanted_n_m, force_n, torque_n_m;
} sonde_gate;

/** @param limits NULL: the defaults @thread owner */
SONDE_API void sonde_gate_init(sonde_gate *gate, const sonde_safety_limits *limits);
/** One exchange. A command is held for 15 ms and then fades to zero within 30 ms more; one with a
 *  number that is not finite counts as none. The result, within norm and slew, is in gate->force_n.
 *  @param fresh a command came since the last call @thread owner: the driver's */
SONDE_API void sonde_gate_apply(sonde_gate *gate, bool fresh, sonde_vec3 force_n,
                                sonde_vec3 torque_n_m, double dt_s);

#ifdef __cplusplus
}
#endif
#endif
