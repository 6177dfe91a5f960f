// The simulated operator: one tick.
#include "haptics/devices/hand.h"

#include "base/base.h"
#include "base/maths.h"

static double tremor(const sonde_hand *hand, int axis, double time_s) {
  double w = 2.0 * SONDE_PI * hand->def.tremor_hz, p = hand->phase_rad[axis];
  return hand->def.tremor_m * (0.7 * sin(w * time_s + p) + 0.3 * sin(1.618 * w * time_s + 2.0 * p));
}

static double reported(double x_m, double resolution_m) {
  return resolution_m > 0.0 ? resolution_m * floor(x_m / resolution_m + 0.5) : x_m;
}

// The load of a tick is the goal at its start, held: the step is then exact.
void sonde_hand_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  sonde_hand *hand = self;
  SONDE_ASSERT(hand->def.mass_kg > 0.0);
  if (tick > 0) {
    // The arm makes its exact step under the force that acted over the last tick.
    double k = hand->def.stiffness_n_m;
    double *x = &hand->x_m.x, *v = &hand->v_m_s.x;
    const double *f = &hand->queue_n[0].x, *held = &hand->load_m.x;
    for (int i = 0; i < 3; ++i) {
      double load = f[i] + k * held[i], x0 = x[i], v0 = v[i];
      x[i] = hand->a[0][0] * x0 + hand->a[0][1] * v0 + hand->b[0] * load;
      v[i] = hand->a[1][0] * x0 + hand->a[1][1] * v0 + hand->b[1] * load;
    }
    for (uint32_t i = 0; i < hand->def.latency_ticks; ++i) hand->queue_n[i] = hand->queue_n[i + 1];
  }
  sonde_device_sample goal;
  uint64_t late = tick > hand->delay_ticks ? tick - hand->delay_ticks : 0;
  hand->goal.read(hand->goal.self, late, &goal);
  double time_s = (double)tick * hand->dt_s;
  hand->load_m =
      v_add(goal.world_from_probe.position,
            vec3(tremor(hand, 0, time_s), tremor(hand, 1, time_s), tremor(hand, 2, time_s)));
  hand->rotation = goal.world_from_probe.rotation;
  double r = hand->def.resolution_m;
  sonde_vec3 seen =
      vec3(reported(hand->x_m.x, r), reported(hand->x_m.y, r), reported(hand->x_m.z, r));
  *sample = (sonde_device_sample){{seen, hand->rotation}, 0, true};
  SONDE_ASSERT(v_finite(hand->x_m));
}

void sonde_hand_write(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m) {
  sonde_hand *hand = self;
  (void)torque_n_m; // the wrist is stiff: the rotation follows the goal
  SONDE_ASSERT(v_finite(force_n));
  double limit = hand->def.force_limit_n, norm = v_norm(force_n);
  if (limit > 0.0 && norm > limit) force_n = v_scale(force_n, limit / norm);
  hand->queue_n[hand->def.latency_ticks] = force_n;
}

sonde_vec3 sonde_hand_position(const sonde_device *device, sonde_vec3 *velocity_m_s) {
  SONDE_ASSERT(device != NULL);
  if (velocity_m_s) *velocity_m_s = vec3(0, 0, 0);
  if (device->read != sonde_hand_read) return vec3(0, 0, 0);
  const sonde_hand *hand = device->self;
  if (velocity_m_s) *velocity_m_s = hand->v_m_s;
  return hand->x_m;
}

double sonde_hand_energy(const sonde_device *device) {
  SONDE_ASSERT(device != NULL);
  if (device->read != sonde_hand_read) return 0.0;
  const sonde_hand *hand = device->self;
  return 0.5 * hand->def.mass_kg * v_norm2(hand->v_m_s) +
         0.5 * hand->def.stiffness_n_m * v_norm2(v_sub(hand->load_m, hand->x_m));
}
