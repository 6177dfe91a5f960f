// Set-up of the safety limiter; one tick of it is in safety_hot.c.
#include "sonde/haptics.h"

#include "base/maths.h"

#include "base/base.h"

static const char *const fault_text[] = {
#define SONDE_FAULT_TEXT(name, text) text,
    SONDE_FAULT_LIST(SONDE_FAULT_TEXT)
#undef SONDE_FAULT_TEXT
};
_Static_assert(SONDE_COUNT_OF(fault_text) == SONDE_FAULT_COUNT, "one sentence per fault");

const char *sonde_fault_text(sonde_fault fault) {
  return (unsigned)fault < SONDE_FAULT_COUNT ? fault_text[fault] : "unknown fault";
}

sonde_safety_limits sonde_safety_limits_default(void) {
  return (sonde_safety_limits){.force_n = 40.0,
                               .torque_n_m = 2.0,
                               .slew_n_s = 2000.0,
                               .fade_s = 0.02,
                               .soft_start_s = 0.1,
                               .stale_s = 0.25,
                               .thermal_s = 5.0};
}

static double limit_or(double value, double fallback) {
  return isfinite(value) && value >= 0.0 ? value : fallback;
}

void sonde_safety_init(sonde_safety *safety, const sonde_safety_limits *limits) {
  SONDE_ASSERT(safety != NULL);
  sonde_safety_limits d = sonde_safety_limits_default();
  *safety = (sonde_safety){.limits = d};
  if (!limits) return;
  safety->limits = (sonde_safety_limits){
      .force_n = limit_or(limits->force_n, d.force_n),
      .torque_n_m = limit_or(limits->torque_n_m, d.torque_n_m),
      .slew_n_s = limit_or(limits->slew_n_s, d.slew_n_s),
      .fade_s = limit_or(limits->fade_s, d.fade_s),
      .soft_start_s = limit_or(limits->soft_start_s, d.soft_start_s),
      .stale_s = limit_or(limits->stale_s, d.stale_s),
      .continuous_n = limit_or(limits->continuous_n, 0.0),
      .thermal_s = limits->thermal_s > 0.0 ? limit_or(limits->thermal_s, d.thermal_s) : d.thermal_s,
      .velocity_m_s = limit_or(limits->velocity_m_s, 0.0),
      .impulse_n_s = limit_or(limits->impulse_n_s, 0.0),
  };
  SONDE_ASSERT(safety->gain <= 0.0 && safety->fault == SONDE_FAULT_NONE);
}
