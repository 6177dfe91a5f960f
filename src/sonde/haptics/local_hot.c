// The local model of a slow scene.
//
// Along the normal the tissue answers like eq. (1), F = k0 x / (1 - x/xm). From a depth x where it
// gives F with the slope K, the increment for d more is K d / (1 - d/(xm - x)) exactly. The room
// xm - x follows from what is known there: K x/F = 1/(1 - x/xm), so that room = x/(K x/F - 1). A
// slope below F/x, a tissue that softens, has no room to speak of: the increment is then K d.
//
// K and a damping B are measured by recursive least squares from the differences between two
// answers, dF = K d + B dv, forgetting at a rate of one half per 3 answers: no extra solve of the
// scene.
#include "base/base.h"
#include "base/maths.h"
#include "sonde/haptics_local.h"

static const double forget = 0.6, noise_n2 = 1e-4;
static const double stiffness_max = 2e4, damping_max = 200.0;

sonde_local_def sonde_local_def_default(void) {
  return (sonde_local_def){SONDE_DEF_VERSION, 1e-3, 1e-2, 300.0, 0.02};
}

static double within(double value, double low, double high, double fallback) {
  return value >= low && value <= high ? value : fallback;
}

static void start_contact(sonde_local *local) {
  local->stiffness_n_m = local->def.stiffness_n_m;
  local->across_n_m = 0.5 * local->def.stiffness_n_m;
  local->damping_n_s_m = 0.0;
  local->depth_m = 0.0;
  local->room_m = (double)INFINITY;
  local->spread[0] = 1e6;
  local->spread[1] = 0.0;
  local->spread[2] = 1e2;
}

void sonde_local_init(sonde_local *local, const sonde_local_def *def) {
  SONDE_ASSERT(local != NULL);
  sonde_local_def d = sonde_local_def_default(), c = def && def->version == d.version ? *def : d;
  c.dt_s = within(c.dt_s, 1e-5, 0.1, d.dt_s);
  c.period_s = within(c.period_s, 1e-3, 0.2, d.period_s);
  c.stiffness_n_m = within(c.stiffness_n_m, 1.0, 1e4, d.stiffness_n_m);
  c.fade_s = within(c.fade_s, 1e-3, 1.0, d.fade_s);
  *local = (sonde_local){.def = c};
  start_contact(local);
}

static void measure(sonde_local *local, double d, double dv, double df) {
  double *p = local->spread;
  double g0 = p[0] * d + p[1] * dv, g1 = p[1] * d + p[2] * dv;
  double total = forget * noise_n2 + d * g0 + dv * g1;
  if (fabs(d) < 2e-5 && fabs(dv) < 2e-3) return; // nothing to learn from: the probe rests
  double error = df - local->stiffness_n_m * d - local->damping_n_s_m * dv;
  g0 /= total;
  g1 /= total;
  local->stiffness_n_m = clamp(local->stiffness_n_m + g0 * error, 0.0, stiffness_max);
  local->damping_n_s_m = clamp(local->damping_n_s_m + g1 * error, 0.0, damping_max);
  double h0 = p[0] * d + p[1] * dv, h1 = p[1] * d + p[2] * dv;
  p[0] = fmin((p[0] - g0 * h0) / forget, 1e6);
  p[1] = (p[1] - g0 * h1) / forget;
  p[2] = fmin((p[2] - g1 * h1) / forget, 1e2);
  p[1] = clamp(p[1], -sqrt(p[0] * p[2]), sqrt(p[0] * p[2]));
}

static sonde_vec3 across(sonde_vec3 a, sonde_vec3 normal) {
  return v_madd(a, -v_dot(a, normal), normal);
}

static sonde_vec3 evaluate(const sonde_local *local, sonde_vec3 at_m, sonde_vec3 velocity_m_s) {
  sonde_vec3 n = local->normal, moved = v_sub(at_m, local->at_m);
  if (!(v_norm2(n) > 0.0)) return vec3(0, 0, 0);
  double d = -v_dot(moved, n), dv = -v_dot(v_sub(velocity_m_s, local->speed_m_s), n);
  double stiffer = 1.0 - fmin(d, 0.5 * local->room_m) / local->room_m;
  double rise = local->stiffness_n_m * d / fmax(stiffer, 0.5) + local->damping_n_s_m * dv;
  double along = v_norm(local->force_n) + rise;
  if (along <= 0.0) return vec3(0, 0, 0);
  return v_madd(v_scale(n, along), -local->across_n_m, across(moved, n));
}

// A new answer does not step the force: the difference to the old model at that tick is an offset
// that is blended out over a period.
void sonde_local_feed(sonde_local *local, sonde_vec3 at_m, sonde_vec3 velocity_m_s,
                      sonde_vec3 force_n) {
  SONDE_ASSERT(local->def.period_s > 0.0);
  if (!v_finite(at_m) || !v_finite(velocity_m_s) || !v_finite(force_n)) return;
  bool touched = v_norm2(local->normal) > 0.0;
  double now_n = v_norm(force_n);
  sonde_vec3 n = now_n > 1e-6 ? v_scale(force_n, 1.0 / now_n) : vec3(0, 0, 0);
  sonde_vec3 moved = v_sub(at_m, local->at_m), gained = v_sub(force_n, local->force_n);
  sonde_vec3 faster = v_sub(velocity_m_s, local->speed_m_s);
  if (!touched) start_contact(local);
  if (now_n > 1e-6 && local->answers > 0) {
    double d = -v_dot(moved, n);
    local->depth_m = fmax(local->depth_m + d, 0.0);
    if (touched) {
      measure(local, d, -v_dot(faster, n), v_dot(gained, n));
      // The slope of the spring across the normal counts from moves of 10 um on.
      sonde_vec3 aside = across(moved, n);
      double m2 = v_norm2(aside), weight = m2 / (m2 + 1e-7);
      if (!(m2 < 1e-10)) {
        double slope = clamp(-v_dot(aside, across(gained, n)) / m2, 0.0, stiffness_max);
        local->across_n_m += 0.5 * weight * (slope - local->across_n_m);
      }
    }
    double bend = local->stiffness_n_m * local->depth_m / now_n - 1.0;
    local->room_m = bend > 1e-3 ? local->depth_m / bend : (double)INFINITY;
  }
  local->at_m = at_m;
  local->speed_m_s = velocity_m_s;
  local->force_n = force_n;
  local->normal = n;
  local->answers++;
  local->age_s = 0.0;
  // the output of the last tick goes on from where it is
  local->offset_n = v_sub(local->output_n, evaluate(local, local->last_m, local->velocity_m_s));
}

// Without answers the model extrapolates for two periods and then decays.
sonde_vec3 sonde_local_force(sonde_local *local, sonde_vec3 position_m) {
  const sonde_local_def *def = &local->def;
  SONDE_ASSERT(def->dt_s > 0.0 && def->period_s > 0.0);
  if (!local->placed) local->last_m = position_m;
  local->placed = true;
  sonde_vec3 velocity = v_scale(v_sub(position_m, local->last_m), 1.0 / def->dt_s);
  local->velocity_m_s = v_lerp(local->velocity_m_s, velocity, def->dt_s / (def->dt_s + 3e-3));
  local->last_m = position_m;
  local->age_s += def->dt_s;
  double left = fmax(0.0, 1.0 - local->age_s / def->period_s);
  sonde_vec3 force =
      v_madd(evaluate(local, position_m, local->velocity_m_s), left, local->offset_n);
  double late_s = local->age_s - 2.0 * def->period_s;
  if (late_s > 0.0) force = v_scale(force, exp(-late_s / def->fade_s));
  local->output_n = local->answers ? force : vec3(0, 0, 0);
  return local->output_n;
}
