// The gate on the driver's side: norm, slew and the watchdog over the simulation.
//
// A command that grows old is scaled by 1 - (age - hold)/fade, hence zero at hold + fade = 45 ms.
// The slew limit acts after that; it may not delay the fade, so it is widened to the step that the
// fade takes from the largest force.
#include "base/base.h"
#include "haptics/bounds.h"
#include "sonde/haptics_devices.h"

static const double hold_s = 0.015, watchdog_fade_s = 0.03;

void sonde_gate_init(sonde_gate *gate, const sonde_safety_limits *limits) {
  SONDE_ASSERT(gate != NULL);
  sonde_safety safety; // takes over its check of the limits
  sonde_safety_init(&safety, limits);
  *gate = (sonde_gate){.limits = safety.limits, .age_s = 1.0};
}

void sonde_gate_apply(sonde_gate *gate, bool fresh, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                      double dt_s) {
  SONDE_ASSERT(dt_s > 0.0);
  const sonde_safety_limits *limits = &gate->limits;
  gate->age_s += dt_s;
  if (fresh && v_finite(force_n) && v_finite(torque_n_m)) {
    gate->age_s = 0.0;
    gate->wanted_n = force_n;
    gate->wanted_n_m = torque_n_m;
  }
  bool acted = false;
  double left = clamp(1.0 - (gate->age_s - hold_s) / watchdog_fade_s, 0.0, 1.0);
  sonde_vec3 force = v_scale(sonde_bound_norm(gate->wanted_n, limits->force_n, &acted), left);
  sonde_vec3 torque = v_scale(sonde_bound_norm(gate->wanted_n_m, limits->torque_n_m, &acted), left);
  double rate = fmax(limits->slew_n_s, limits->force_n / watchdog_fade_s);
  double share = limits->force_n > 0.0 ? limits->torque_n_m / limits->force_n : 0.0;
  gate->force_n = sonde_bound_step(gate->force_n, force, rate * dt_s, &acted);
  gate->torque_n_m = sonde_bound_step(gate->torque_n_m, torque, rate * share * dt_s, &acted);
  SONDE_ASSERT(v_finite(gate->force_n) && v_finite(gate->torque_n_m));
}
