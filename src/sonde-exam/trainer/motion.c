// Length and smoothness of the probe's path.
#include "trainer/judge.h"

// Grid of 20 Hz; two low-passes of 4 Hz each: a hand's movements stay, its tremor and the sampling
// go. The sample after a pause starts anew: nothing is known of the path between.
static const double GRID_S = 0.05, PAUSE_S = 2, SHARE = 0.7153857; // 1 - exp(-2 pi 4 Hz 0.05 s)

void sonde_motion_feed(sonde_motion *m, double time_s, sonde_vec3 position_m) {
  SONDE_ASSERT(isfinite(time_s) && (!m->started || time_s > m->last_s));
  if (!v_finite(position_m)) return;
  if (m->started && time_s - m->last_s > PAUSE_S) {
    m->path_m += v_distance(position_m, m->last_m);
    m->started = false;
  }
  if (!m->started) {
    m->started = true;
    m->filled = 0;
    m->next_s = m->last_s = time_s;
    m->stage_m[0] = m->stage_m[1] = position_m;
    m->last_m = position_m;
  }
  for (; m->next_s <= time_s; m->next_s += GRID_S) {
    double span_s = time_s - m->last_s;
    double share = span_s > 0 ? clamp((m->next_s - m->last_s) / span_s, 0, 1) : 1;
    sonde_vec3 at_m = v_lerp(m->last_m, position_m, share);

    // One step of the grid: low-pass, length of the path, greatest speed, jerk.
    m->stage_m[0] = v_lerp(m->stage_m[0], at_m, SHARE);
    m->stage_m[1] = v_lerp(m->stage_m[1], m->stage_m[0], SHARE);
    sonde_vec3 now = m->stage_m[1];
    if (m->filled >= 1) {
      double step = v_distance(now, m->before_m[0]);
      m->path_m += step;
      m->speed_peak_m_s = fmax(m->speed_peak_m_s, step / GRID_S);
      m->time_s += GRID_S;
    }
    if (m->filled >= 3) {
      sonde_vec3 inner = v_sub(m->before_m[0], m->before_m[1]);
      sonde_vec3 third = v_sub(v_sub(now, m->before_m[2]), v_scale(inner, 3));
      m->jerk_sum += v_norm2(third) / pow(GRID_S, 5); // |jerk|^2 dt
    }
    m->before_m[2] = m->before_m[1];
    m->before_m[1] = m->before_m[0];
    m->before_m[0] = now;
    if (m->filled < 3) m->filled++;
  }
  m->last_s = time_s;
  m->last_m = position_m;
}

// Log dimensionless jerk since the last press.
static double smoothness(const sonde_motion *m) {
  if (!(m->jerk_sum > 0 && m->speed_peak_m_s > 0)) return (double)NAN;
  double scale = m->time_s * m->time_s * m->time_s / (m->speed_peak_m_s * m->speed_peak_m_s);
  return -log(m->jerk_sum * scale);
}

// The figure falls with the number of movements that it is taken over (by 4 ln of it), so it is
// taken over the approach to each press: who examines more places is not called less smooth.
void sonde_motion_pressed(sonde_motion *m) {
  double approach = smoothness(m);
  if (isfinite(approach)) m->smooth_sum += approach, m->approaches++;
  m->jerk_sum = m->speed_peak_m_s = m->time_s = 0;
}

double sonde_motion_smoothness(const sonde_motion *m) {
  return m->approaches > 0 ? m->smooth_sum / m->approaches : smoothness(m);
}
