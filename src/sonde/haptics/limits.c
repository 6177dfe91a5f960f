// What haptic devices can do, and the safety limits that follow from it.
#include "sonde/haptics_render.h"

#include "base/base.h"
#include "haptics/bounds.h"

#include <math.h>
#include <string.h>

// Peak force, stiffness, damping and radius are the working values of CHAI3D's drivers where it has
// the device; the other sources are named per row. Values without a public source are 0.
static const sonde_device_limits table[] = {
    {"touch", "3D Systems Touch", 3.3, 0.88, 400.0, 4.0, 0.045, 0.075, 55e-6,
     "CHAI3D CPhantomDevices; continuous force as the driver reports it; mass and resolution: data "
     "sheet, not verified"},
    {"touch_x", "3D Systems Touch X (Phantom Desktop)", 7.9, 1.75, 1000.0, 5.0, 0.045, 0.100, 23e-6,
     "CHAI3D CPhantomDevices; continuous force, mass and resolution: data sheet, not verified"},
    {"premium_1.5", "PHANToM Premium 1.5 6DOF", 8.5, 1.4, 800.0, 5.0, 0.075, 0.120, 30e-6,
     "CHAI3D CPhantomDevices; continuous force, mass and resolution: data sheet, not verified"},
    {"omega.3", "Force Dimension omega.3", 12.0, 12.0, 5000.0, 40.0, 0.0, 0.075, 10e-6,
     "CHAI3D CDeltaDevices; continuous force and resolution: data sheet, not verified"},
    {"omega.6", "Force Dimension omega.6", 12.0, 12.0, 5000.0, 40.0, 0.0, 0.075, 10e-6,
     "CHAI3D CDeltaDevices; continuous force and resolution: data sheet, not verified"},
    {"inverse3", "Haply Inverse3", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
     "no public source found: sizing assumes 3 N, 400 N/m, 4 N s/m"},
    {"falcon", "Novint Falcon", 8.0, 0.0, 3000.0, 20.0, 0.0, 0.040, 0.0,
     "CHAI3D CDeltaDevices; continuous force not found"},
};

const sonde_device_limits *sonde_device_limits_list(uint32_t *count) {
  SONDE_ASSERT(count != NULL);
  *count = SONDE_COUNT_OF(table);
  return table;
}

const sonde_device_limits *sonde_device_limits_find(const char *name) {
  SONDE_ASSERT(name != NULL);
  for (size_t i = 0; i < SONDE_COUNT_OF(table); ++i)
    if (strcmp(table[i].name, name) == 0) return &table[i];
  return NULL;
}

static double known_or(double value, double fallback) { return value > 0.0 ? value : fallback; }

sonde_safety_limits sonde_safety_limits_of(const sonde_device_limits *limits) {
  SONDE_ASSERT(limits != NULL);
  double peak = known_or(limits->force_peak_n, 3.0);
  sonde_safety_limits safety = sonde_safety_limits_default();
  safety.force_n = 0.8 * peak;
  safety.torque_n_m = 0.0; // the wrists of these devices are passive, or barely driven
  safety.slew_n_s = peak / 4e-3;
  safety.continuous_n = fmin(known_or(limits->force_continuous_n, 0.25 * peak), safety.force_n);
  safety.velocity_m_s = 1.0;
  safety.impulse_n_s = 0.5 * peak;
  safety.stale_s = 0.03;
  return safety;
}

sonde_render_def sonde_render_def_for(const sonde_device_limits *limits, double dt_s,
                                      double force_scale) {
  SONDE_ASSERT(limits != NULL && dt_s > 0.0);
  double peak = known_or(limits->force_peak_n, 3.0);
  sonde_render_def def = sonde_render_def_default();
  def.dt_s = dt_s;
  def.force_scale = force_scale > 0.0 ? force_scale : 0.8 * peak / 25.0;
  def.stiffness_n_m = 0.5 * known_or(limits->stiffness_n_m, 400.0);
  def.damping_n_s_m = 0.5 * known_or(limits->damping_n_s_m, 4.0);
  def.controller_max_n_s_m = fmin(0.5 * known_or(limits->mass_kg, 0.1) / dt_s, 30.0);
  return def;
}
