// The last gate before a hand: nothing passes that is too large, too sudden or not a number.
//
// Healthy: wanted -> norm limit -> soft-start gain -> slew limit. The norm ball is convex and both
// the last rendered force and the gained, limited one lie in it, so the slew-limited point between
// them does too: both limits hold at every tick. Fault: what was rendered last fades in equal steps
// to exactly zero within fade_s, whatever the simulation says.
//
// Heat. The motors' heat follows (f / continuous)^2 with a time constant. Between 0.8 and 1 of what
// the continuous force leads to, the norm limit falls from force_n to continuous_n: at rest there
// it stays, since a force above it would raise the heat further.
#include "sonde/haptics.h"

#include "base/base.h"
#include "base/maths.h"
#include "haptics/bounds.h"

void sonde_safety_trip(sonde_safety *safety, sonde_fault fault) {
  if (fault == SONDE_FAULT_NONE || safety->fault != SONDE_FAULT_NONE) return;
  SONDE_ASSERT(v_finite(safety->force_n) && v_finite(safety->torque_n_m));
  safety->fault = fault;
  safety->gain = 1.0;
  safety->fade_force_n = safety->force_n;
  safety->fade_torque_n_m = safety->torque_n_m;
}

void sonde_safety_resume(sonde_safety *safety) {
  safety->fault = SONDE_FAULT_NONE;
  safety->gain = 0.0;
  safety->impulse_n_s = 0.0;
  safety->placed = false; // where the device went meanwhile is no motion
}

// The leak of the impulse, 0.1 s, lets a short push pass.
void sonde_safety_motion(sonde_safety *safety, sonde_vec3 position_m, double dt_s) {
  SONDE_ASSERT(dt_s > 0.0);
  if (!v_finite(position_m)) return;
  sonde_vec3 moved = v_sub(position_m, safety->position_m);
  bool known = safety->placed;
  safety->position_m = position_m;
  safety->placed = true;
  if (!known) return;
  const sonde_safety_limits *limits = &safety->limits;
  double along = v_dot(safety->force_n, moved), distance = v_norm(moved);
  double push = along > 0.0 ? along / distance : 0.0;
  safety->impulse_n_s += dt_s * (push - safety->impulse_n_s / 0.1);
  safety->impulse_n_s = fmax(safety->impulse_n_s, 0.0);
  if (limits->velocity_m_s > 0.0 && distance > limits->velocity_m_s * dt_s)
    sonde_safety_trip(safety, SONDE_FAULT_VELOCITY);
  if (limits->impulse_n_s > 0.0 && safety->impulse_n_s > limits->impulse_n_s)
    sonde_safety_trip(safety, SONDE_FAULT_IMPULSE);
}

void sonde_safety_apply(sonde_safety *safety, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                        double dt_s) {
  SONDE_ASSERT(dt_s > 0.0);
  if (!v_finite(force_n) || !v_finite(torque_n_m))
    sonde_safety_trip(safety, SONDE_FAULT_NON_FINITE);
  // A hot motor is held to what it can give for long.
  const sonde_safety_limits *limits = &safety->limits;
  double cap = limits->force_n;
  if (limits->continuous_n > 0.0) {
    double load = v_norm2(safety->force_n) / (limits->continuous_n * limits->continuous_n);
    double share = fmin(dt_s / limits->thermal_s, 1.0);
    safety->heat += share * (load - safety->heat);
    double cool = clamp(5.0 * (1.0 - safety->heat), 0.0, 1.0);
    cap = fmin(limits->force_n,
               limits->continuous_n + cool * fmax(limits->force_n - limits->continuous_n, 0.0));
  }
  if (safety->fault == SONDE_FAULT_NONE) {
    bool acted = false;
    double step = limits->soft_start_s > 0.0 ? dt_s / limits->soft_start_s : 1.0;
    safety->gain = fmin(1.0, safety->gain + step);
    force_n = v_scale(sonde_bound_norm(force_n, cap, &acted), safety->gain);
    torque_n_m = v_scale(sonde_bound_norm(torque_n_m, limits->torque_n_m, &acted), safety->gain);
    double reach_n = limits->slew_n_s * dt_s;
    double reach_n_m = limits->force_n > 0.0 ? reach_n * limits->torque_n_m / limits->force_n : 0.0;
    safety->force_n = sonde_bound_step(safety->force_n, force_n, reach_n, &acted);
    safety->torque_n_m = sonde_bound_step(safety->torque_n_m, torque_n_m, reach_n_m, &acted);
    safety->limited_ticks += acted;
  } else {
    double step = safety->limits.fade_s > 0.0 ? dt_s / safety->limits.fade_s : 1.0;
    // a remainder of rounding is zero, so that the last tick of the fade is exact
    safety->gain = safety->gain > step * (1.0 + 1e-9) ? safety->gain - step : 0.0;
    safety->force_n = v_scale(safety->fade_force_n, safety->gain);
    safety->torque_n_m = v_scale(safety->fade_torque_n_m, safety->gain);
  }
  SONDE_ASSERT(v_finite(safety->force_n) && v_finite(safety->torque_n_m));
}
