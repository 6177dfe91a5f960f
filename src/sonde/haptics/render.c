// Set-up of the rendering, and the margins of its loop; one tick is in render_hot.c.
#include "sonde/haptics_render.h"

#include "base/base.h"
#include "base/maths.h"
#include "haptics/ranges.h"

sonde_render_def sonde_render_def_default(void) {
  return (sonde_render_def){.version = SONDE_DEF_VERSION,
                            .dt_s = 1e-3,
                            .force_scale = 1.0,
                            .probe_mass_kg = 0.1,
                            .filter_rad_s = 800.0,
                            .controller = true,
                            .controller_max_n_s_m = 30.0,
                            .reserve_j = 2e-5};
}

void sonde_render_init(sonde_render *render, const sonde_render_def *def) {
  SONDE_ASSERT(render != NULL);
  bool usable = def && def->version == SONDE_DEF_VERSION;
  *render = (sonde_render){.def = usable ? *def : sonde_render_def_default()};
  sonde_render_def_clean(&render->def);
  SONDE_ASSERT(!render->started);
}

typedef struct loop_def {
  double mass, damping, stiffness, coupling_damping, dead_s;
} loop_def;

// L = (K + j w B) e^(-j w dead) / (-m w^2 + j w b); dead time: half a tick of the hold and latency.
static void response(const loop_def *loop, double w, double *magnitude, double *phase) {
  double re = -loop->mass * w * w, im = w * loop->damping;
  double kr = loop->stiffness, ki = w * loop->coupling_damping;
  *magnitude = sqrt((kr * kr + ki * ki) / (re * re + im * im));
  // atan2(im, re) lies between pi/2 and pi
  *phase = atan2(ki, kr) - atan2(im, re) - w * loop->dead_s;
}

// Either |L| - 1 or phase + pi.
static double test_value(const loop_def *loop, double w, bool phase) {
  double magnitude, angle;
  response(loop, w, &magnitude, &angle);
  return phase ? angle + SONDE_PI : magnitude - 1.0;
}

// Highest frequency below the Nyquist rate at which the value passes from above to below zero.
static double crossing(const loop_def *loop, bool phase, double nyquist) {
  double high = nyquist, ratio = 1.02;
  while (high > 1e-2 && test_value(loop, high, phase) < 0.0) high /= ratio;
  double low = high;
  high *= ratio;
  for (int i = 0; i < 60; ++i) {
    double middle = 0.5 * (low + high);
    if (test_value(loop, middle, phase) < 0.0)
      high = middle;
    else
      low = middle;
  }
  return low;
}

sonde_render_margins sonde_render_margins_of(const sonde_render_def *def, double mass_kg,
                                             double damping_n_s_m, double latency_s) {
  SONDE_ASSERT(def != NULL && mass_kg > 0.0 && def->dt_s > 0.0);
  loop_def loop = {mass_kg, damping_n_s_m, def->stiffness_n_m, def->damping_n_s_m,
                   0.5 * def->dt_s + latency_s};
  double nyquist = SONDE_PI / def->dt_s, magnitude, phase;
  double needed = 0.5 * def->stiffness_n_m * def->dt_s + def->damping_n_s_m;
  double added = def->controller ? def->controller_max_n_s_m : 0.0;
  sonde_render_margins margins = {.damping_needed_n_s_m = needed};
  margins.passivity = needed > 0.0 ? (damping_n_s_m + added) / needed : (double)INFINITY;
  margins.stiffness = (double)INFINITY;
  margins.phase_rad = SONDE_PI;
  if (!(def->stiffness_n_m > 0.0)) return margins;
  response(&loop, crossing(&loop, false, nyquist), &magnitude, &phase);
  margins.phase_rad = phase + SONDE_PI;
  response(&loop, crossing(&loop, true, nyquist), &magnitude, &phase);
  margins.stiffness = 1.0 / magnitude;
  return margins;
}
