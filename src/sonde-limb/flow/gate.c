// Life of a gate, its settings, and its place in a scene's blood.
#include "flow/gate.h"

#include "base/base.h"

sonde_gate_settings sonde_gate_settings_default(void) {
  return (sonde_gate_settings){
      .z_m = 0.02, .length_m = 3e-3, .angle_rad = SONDE_PI / 3, .scale_m_s = 0.2, .filter_hz = 50};
}

sonde_gate_settings sonde_gate_clean(const sonde_gate_settings *wanted,
                                     const sonde_gate_settings *before) {
  SONDE_ASSERT(wanted && before);
  sonde_gate_settings s = *wanted;
  const struct {
    double *to, from, low, high;
  } NUMBER[] = {{&s.x_m, before->x_m, -0.1, 0.1},
                {&s.z_m, before->z_m, 1e-3, 0.25},
                {&s.length_m, before->length_m, 0.5e-3, 15e-3},
                {&s.steer_rad, before->steer_rad, -0.35, 0.35},
                {&s.angle_rad, before->angle_rad, -1.4, 1.4},
                {&s.scale_m_s, before->scale_m_s, 0.02, 2},
                {&s.baseline, before->baseline, -0.9, 0.9},
                {&s.filter_hz, before->filter_hz, 10, 1000},
                {&s.gain_db, before->gain_db, -30, 30}};
  for (size_t i = 0; i < SONDE_COUNT_OF(NUMBER); ++i) {
    *NUMBER[i].to = clamp_wanted(*NUMBER[i].to, NUMBER[i].from, NUMBER[i].low, NUMBER[i].high);
  }
  return s;
}

sonde_status sonde_gate_create(sonde_gate **out, sonde_error *error) {
  SONDE_ASSERT(out != NULL);
  *out = SONDE_NEW(sonde_gate, 1);
  return *out ? SONDE_OK : sonde_fail_memory(error);
}

void sonde_gate_destroy(sonde_gate *gate) { sonde_free(gate); }
