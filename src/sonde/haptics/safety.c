// Set-up of the safety limiter; one tick of it is in safety_hot.c.
#include "sonde/haptics.h"

#include "base/base.h"
#include "haptics/ranges.h"

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

void sonde_safety_init(sonde_safety *safety, const sonde_safety_limits *limits) {
  SONDE_ASSERT(safety != NULL);
  *safety = (sonde_safety){.limits = limits ? *limits : sonde_safety_limits_default()};
  sonde_limits_clean(&safety->limits);
  SONDE_ASSERT(safety->gain <= 0.0 && safety->fault == SONDE_FAULT_NONE);
}
