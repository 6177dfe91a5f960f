// Velocity profiles: a parabola, and Womersley's of a pulse (docs/flow_theory.md).
#include "sonde/flow.h"

#include "base/base.h"
#include "base/maths.h"
#include "flow/blood.h"

#include <complex.h>

void sonde_flow_steady(double mean_m_s, double profile_m_s[SONDE_FLOW_RINGS]) {
  SONDE_ASSERT(isfinite(mean_m_s));
  for (int k = 0; k < SONDE_FLOW_RINGS; ++k) {
    double r = (double)k / (SONDE_FLOW_RINGS - 1);
    profile_m_s[k] = 2 * mean_m_s * (1 - r * r);
  }
}

void sonde_flow_follow(double profile_m_s[SONDE_FLOW_RINGS], double radius_m, double mean_m_s,
                       double dt_s) {
  SONDE_ASSERT(profile_m_s && radius_m > 0 && dt_s > 0 && isfinite(mean_m_s));
  // Balance of the ring between r - h/2 and r + h/2 in units of the radius, times r h: the step
  // matrix is the same for the velocities before and for a push of 1 on every ring.
  enum { INNER = SONDE_FLOW_RINGS - 1 }; // at the wall blood stands
  const double h = 1.0 / INNER, spread = BLOOD_M2_S * dt_s / (radius_m * radius_m);
  double above[INNER], before[INNER], push[INNER], moved = 0, pushed = 0;
  for (int k = 0; k < INNER; ++k) {
    const double volume = k ? k * h * h : h * h / 8;
    const double inside = k ? spread * (k - 0.5) : 0, outside = spread * (k + 0.5);
    const double part = k ? inside / above[k - 1] : 0;
    above[k] = volume + inside + outside - (k ? part * spread * (k - 0.5) : 0);
    before[k] = volume * profile_m_s[k] + (k ? part * before[k - 1] : 0);
    push[k] = volume + (k ? part * push[k - 1] : 0);
  }
  for (int k = INNER; k-- > 0;) {
    const double outside = spread * (k + 0.5);
    before[k] = (before[k] + (k + 1 < INNER ? outside * before[k + 1] : 0)) / above[k];
    push[k] = (push[k] + (k + 1 < INNER ? outside * push[k + 1] : 0)) / above[k];
    // Weights of rings that are linear in between.
    const double weight = k ? 2 * k * h * h : h * h / 3;
    moved += weight * before[k], pushed += weight * push[k];
  }
  for (int k = 0; k < INNER; ++k)
    profile_m_s[k] = before[k] + (mean_m_s - moved) / pushed * push[k];
  profile_m_s[INNER] = 0;
}

// The unit number at an angle, and a quotient: those of C differ in their last bits between
// libraries.
static double complex at_angle(double angle_rad) { return cos(angle_rad) + I * sin(angle_rad); }
static double complex over(double complex a, double complex b) {
  return a * conj(b) / (creal(b) * creal(b) + cimag(b) * cimag(b));
}

// Bessel functions of the first kind, orders 0 and 1, by their series: |z| <= 20 or so.
static void bessel(double complex z, double complex *j0, double complex *j1) {
  double complex square = -0.25 * z * z, term = 1;
  *j0 = *j1 = 0;
  for (int k = 0; k < 80; ++k) {
    *j0 += term;
    *j1 += term / (k + 1);
    term *= square / ((k + 1.0) * (k + 1.0));
  }
  *j1 *= 0.5 * z;
}

void sonde_flow_pulsed(const double *mean_m_s, uint32_t samples, double radius_m, double rate_hz,
                       double phase, double profile_m_s[SONDE_FLOW_RINGS]) {
  SONDE_ASSERT(mean_m_s && samples >= 2 * SONDE_FLOW_HARMONICS && radius_m > 0 && rate_hz > 0);
  for (int h = 0; h < SONDE_FLOW_HARMONICS; ++h) {
    // Fourier coefficient of the mean velocity, at the phase.
    double complex c = 0;
    for (uint32_t i = 0; i < samples; ++i)
      c += mean_m_s[i] * at_angle(-2 * SONDE_PI * h * ((double)i / samples - phase));
    c *= (h ? 2.0 : 1.0) / samples;
    if (h == 0) {
      sonde_flow_steady(creal(c), profile_m_s);
      continue;
    }
    double alpha = radius_m * sqrt(2 * SONDE_PI * rate_hz * h / BLOOD_M2_S);
    double complex lambda = alpha * at_angle(0.75 * SONDE_PI), j0, j1, inner, unused;
    bessel(lambda, &j0, &j1);
    double complex below = j0 - over(2 * j1, lambda);
    for (int k = 0; k < SONDE_FLOW_RINGS; ++k) {
      bessel(lambda * k / (SONDE_FLOW_RINGS - 1), &inner, &unused);
      profile_m_s[k] += creal(over(c * (j0 - inner), below));
    }
  }
}
