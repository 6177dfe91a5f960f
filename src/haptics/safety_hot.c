// The last gate before a hand: nothing passes that is too large, too sudden or not a number.
//
// Healthy: wanted -> norm limit -> soft-start gain -> slew limit. The norm ball is convex and both
// the last rendered force and the gained, limited one lie in it, so the slew-limited point between
// them does too: both limits hold at every tick. Fault: what was rendered last fades in equal steps
// to exactly zero within fade_s, whatever the simulation says.
//
// limited:     vector cut to a norm.
// slewed:      a step of bounded length towards a target.
// apply_fade:  one tick of a latched fault.
// apply_force: one healthy tick.
#include "sonde/haptics.h"

#include "base/base.h"
#include "base/maths.h"

static sonde_vec3 limited(sonde_vec3 wanted, double limit, bool *acted) {
  double norm = v_norm(wanted);
  if (norm <= limit) return wanted;
  *acted = true;
  // a huge vector whose squared norm overflows still has a direction
  if (!isfinite(norm)) {
    double largest = fmax(fabs(wanted.x), fmax(fabs(wanted.y), fabs(wanted.z)));
    wanted = v_scale(wanted, 1.0 / largest);
    norm = v_norm(wanted);
  }
  return v_scale(wanted, limit / norm);
}

static sonde_vec3 slewed(sonde_vec3 last, sonde_vec3 target, double reach, bool *acted) {
  sonde_vec3 change = v_sub(target, last);
  double norm = v_norm(change);
  if (norm <= reach) return target;
  *acted = true;
  return v_madd(last, reach / norm, change);
}

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
}

static void apply_fade(sonde_safety *safety, double dt_s) {
  double step = safety->limits.fade_s > 0.0 ? dt_s / safety->limits.fade_s : 1.0;
  // a remainder of rounding is zero, so that the last tick of the fade is exact
  safety->gain = safety->gain > step * (1.0 + 1e-9) ? safety->gain - step : 0.0;
  safety->force_n = v_scale(safety->fade_force_n, safety->gain);
  safety->torque_n_m = v_scale(safety->fade_torque_n_m, safety->gain);
}

static void apply_force(sonde_safety *safety, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                        double dt_s) {
  const sonde_safety_limits *limits = &safety->limits;
  bool acted = false;
  double step = limits->soft_start_s > 0.0 ? dt_s / limits->soft_start_s : 1.0;
  safety->gain = fmin(1.0, safety->gain + step);
  force_n = v_scale(limited(force_n, limits->force_n, &acted), safety->gain);
  torque_n_m = v_scale(limited(torque_n_m, limits->torque_n_m, &acted), safety->gain);
  double reach_n = limits->slew_n_s * dt_s;
  double reach_n_m = limits->force_n > 0.0 ? reach_n * limits->torque_n_m / limits->force_n : 0.0;
  safety->force_n = slewed(safety->force_n, force_n, reach_n, &acted);
  safety->torque_n_m = slewed(safety->torque_n_m, torque_n_m, reach_n_m, &acted);
  safety->limited_ticks += acted;
}

void sonde_safety_apply(sonde_safety *safety, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                        double dt_s) {
  SONDE_ASSERT(dt_s > 0.0);
  if (!v_finite(force_n) || !v_finite(torque_n_m))
    sonde_safety_trip(safety, SONDE_FAULT_NON_FINITE);
  if (safety->fault == SONDE_FAULT_NONE)
    apply_force(safety, force_n, torque_n_m, dt_s);
  else
    apply_fade(safety, dt_s);
  SONDE_ASSERT(v_finite(safety->force_n) && v_finite(safety->torque_n_m));
}
