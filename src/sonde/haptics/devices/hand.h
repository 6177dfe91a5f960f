// Inside of the simulated operator.
#ifndef SONDE_SRC_HAND_H
#define SONDE_SRC_HAND_H

#include "sonde/haptics_hand.h"

enum { SONDE_HAND_LATENCY = 8 };

typedef struct sonde_hand {
  sonde_hand_def def;
  double dt_s;
  sonde_device goal;     // script of the goals
  uint64_t delay_ticks;  // reaction
  double a[2][2], b[2];  // exact step of (x, v) and of the load f + k goal over a tick
  double phase_rad[3];   // of the tremor
  sonde_vec3 x_m, v_m_s; // at the start of the tick
  sonde_vec3 load_m;     // goal with tremor of the last tick
  sonde_quat rotation;
  sonde_vec3 queue_n[SONDE_HAND_LATENCY + 1]; // forces on their way; [0] acts
} sonde_hand;

void sonde_hand_read(void *self, uint64_t tick, sonde_device_sample *sample);
void sonde_hand_write(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m);

// Kinetic and spring energy, J, about the goal of the last tick. @thread tick
double sonde_hand_energy(const sonde_device *device);
// Where the hand really is, without the rounding of its report.
// @param velocity_m_s may be NULL @return the position; zero for another family @thread tick
sonde_vec3 sonde_hand_position(const sonde_device *device, sonde_vec3 *velocity_m_s);
// @param count receives their number @thread any
const sonde_hand_preset *sonde_hand_presets(uint32_t *count);

#endif
