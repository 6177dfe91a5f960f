// Inside of the device families: what each one keeps, and its hot functions.
#ifndef SONDE_SRC_DEVICES_H
#define SONDE_SRC_DEVICES_H

#include "sonde/haptics.h"

#include "base/mailbox.h"

typedef struct sonde_null_device {
  sonde_pose pose;
} sonde_null_device;

// One key with the slope of its position (m/s).
typedef struct sonde_script_knot {
  double time_s;
  sonde_pose pose;
  sonde_vec3 slope_m_s;
} sonde_script_knot;

typedef struct sonde_script_device {
  double dt_s;
  uint32_t count;
  uint32_t span; // last interval used: knots span, span+1
  sonde_script_knot *knots;
} sonde_script_device;

typedef struct sonde_replay_device {
  uint64_t count;
  sonde_device_sample *samples;
} sonde_replay_device;

// goal -> leader (bounded speed) -> middle -> pose (two equal first-order lags)
typedef struct sonde_page_device {
  sonde_mailbox *goals; // sonde_pose
  sonde_pose goal, leader, middle, pose;
  double reach_m, rotation_rad, share; // per tick
} sonde_page_device;

// The handle holds the probe while `holds`: probe = offset + handle, turned by grip.
typedef struct sonde_clutch_device {
  sonde_device inner;
  uint32_t buttons;
  sonde_pose probe;
  sonde_vec3 offset_m;
  sonde_quat grip;
  double gain, gain_step; // of the force; per tick
  bool holds;
} sonde_clutch_device;

void sonde_clutch_read(void *self, uint64_t tick, sonde_device_sample *sample);
void sonde_clutch_write(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m);

// Force is not rendered anywhere by the built-in families.
void sonde_device_write_nothing(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m);
void sonde_null_read(void *self, uint64_t tick, sonde_device_sample *sample);
void sonde_script_read(void *self, uint64_t tick, sonde_device_sample *sample);
void sonde_replay_read(void *self, uint64_t tick, sonde_device_sample *sample);
void sonde_page_read(void *self, uint64_t tick, sonde_device_sample *sample);

#endif
