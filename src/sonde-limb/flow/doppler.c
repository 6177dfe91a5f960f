// Pulsed Doppler of a gate on a vessel: scatterers that move with the blood, their summed echo from
// pulse to pulse, its spectrum (docs/flow_theory.md). Aliasing, the spread of the spectrum by the
// beam's width and the filling of the window follow from the scatterers' motion.
#include "sonde/flow.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"
#include "flow/spectrum.h"

#include <string.h>

enum { SCATTERERS = 260, BINS = SONDE_DOPPLER_BINS };
static const double sound_m_s = 1540, beyond_beam = 3, spare_m = 1.2e-3;

typedef struct scatterer {
  double along_m, across_m, beside_m; // the vessel; in the beam's plane; out of it
  double ring;                        // of the radius, in rings
  double echo[2];
} scatterer;

struct sonde_doppler {
  sonde_doppler_def def;
  uint64_t drawn;                // random numbers so far
  double reach_m;                // scatterers live so far on either side along the vessel
  double blood;                  // root mean square of the blood's echo
  double ring[SONDE_FLOW_RINGS]; // share of each ring in the gate, by power
  uint64_t pulses;
  double echo[SPECTRUM_MOST][2]; // of the last pulses, pulse p at p % SPECTRUM_MOST
  scatterer at[SCATTERERS];
};

sonde_doppler_def sonde_doppler_def_default(void) {
  return (sonde_doppler_def){.frequency_hz = 5e6,
                             .pulse_hz = 2500,
                             .angle_rad = SONDE_PI / 3,
                             .gate_m = 3e-3,
                             .beam_m = 0.45e-3,
                             .half_short_m = 4.5e-3,
                             .half_long_m = 4.5e-3,
                             .clutter_db = 30,
                             .noise_db = -12,
                             .filter_hz = 20};
}

double sonde_doppler_limit(const sonde_doppler_def *def) {
  SONDE_ASSERT(def && def->frequency_hz > 0);
  return sound_m_s * def->pulse_hz / (4 * def->frequency_hz * fabs(cos(def->angle_rad)));
}

// Places in the lumen and along it, each with the power that beam and gate give it, by ring.
static void weigh_rings(sonde_doppler *d) {
  enum { PLACES = 40 };
  const sonde_doppler_def *def = &d->def;
  const double cosine = cos(def->angle_rad), sine = sin(def->angle_rad);
  double sum = 0;
  for (int n = 0; n < PLACES * PLACES * PLACES; ++n) {
    const double u = (n % PLACES + 0.5) / PLACES * 2 - 1;
    const double v = (n / PLACES % PLACES + 0.5) / PLACES * 2 - 1;
    const double along = d->reach_m * ((n / (PLACES * PLACES) + 0.5) / PLACES * 2 - 1);
    const double radius = sqrt(u * u + v * v), across = u * def->half_short_m;
    const double z = along * cosine + across * sine, x = along * sine - across * cosine;
    if (radius >= 1 || fabs(z) > 0.5 * def->gate_m) continue;
    const double power =
        exp(-pow(x / def->beam_m, 2) - pow(v * def->half_long_m / (2 * def->beam_m), 2));
    const double at = radius * (SONDE_FLOW_RINGS - 1);
    const int k = (int)at;
    d->ring[k] += (1 - (at - k)) * power, d->ring[k + 1] += (at - k) * power, sum += power;
  }
  for (int k = 0; k < SONDE_FLOW_RINGS && sum > 0; ++k) d->ring[k] /= sum;
}

double sonde_doppler_truth(const sonde_doppler *d, const double profile_m_s[SONDE_FLOW_RINGS]) {
  SONDE_ASSERT(d && profile_m_s);
  double mean = 0;
  for (int k = 0; k < SONDE_FLOW_RINGS; ++k) mean += d->ring[k] * profile_m_s[k];
  return mean;
}

sonde_status sonde_doppler_create(const sonde_doppler_def *def, sonde_doppler **out,
                                  sonde_error *error) {
  SONDE_ASSERT(def && out);
  const sonde_bounded LIMIT[] = {{"frequency", def->frequency_hz, 1e6, 2e7},
                                 {"pulse repetition", def->pulse_hz, 500, 2e4},
                                 {"angle", def->angle_rad, 0, SONDE_PI},
                                 {"gate", def->gate_m, 0.2e-3, 0.05},
                                 {"beam", def->beam_m, 0.1e-3, 5e-3},
                                 {"lumen's short half axis", def->half_short_m, 0.2e-3, 0.03},
                                 {"lumen's long half axis", def->half_long_m, 0.2e-3, 0.03},
                                 {"filter", def->filter_hz, 0, def->pulse_hz / 4}};
  *out = NULL;
  sonde_status status = sonde_bounded_check(LIMIT, SONDE_COUNT_OF(LIMIT), error);
  if (status) return status;
  if (fabs(cos(def->angle_rad)) < 0.05)
    return sonde_fail(
        error, SONDE_ARGUMENT,
        "angle: expected less than 87 degrees between beam and flow, across it nothing "
        "is measured");
  sonde_doppler *d = SONDE_NEW(sonde_doppler, 1);
  if (!d) return sonde_fail_memory(error);
  d->def = *def;
  // The gate and the beam cut this much out of the vessel.
  double sine = fmax(sin(def->angle_rad), 0.1);
  d->reach_m = beyond_beam * def->beam_m / sine + 0.5 * def->gate_m + spare_m;
  double power = 0;
  for (int i = 0; i < SCATTERERS; ++i) {
    scatterer *s = &d->at[i];
    double r = sqrt(sonde_random_uniform(def->seed, d->drawn++)),
           angle = 2 * SONDE_PI * sonde_random_uniform(def->seed, d->drawn++);
    s->ring = r * (SONDE_FLOW_RINGS - 1);
    s->across_m = def->half_short_m * r * cos(angle);
    s->beside_m = def->half_long_m * r * sin(angle);
    s->along_m = d->reach_m * (2 * sonde_random_uniform(def->seed, d->drawn++) - 1);
    for (int c = 0; c < 2; ++c) s->echo[c] = sonde_random_normal(def->seed, d->drawn++);
    // Mean square of the weight, once for all: scatterers are renewed in kind.
    double x = s->along_m * sin(def->angle_rad) - s->across_m * cos(def->angle_rad);
    double z = s->along_m * cos(def->angle_rad) + s->across_m * sin(def->angle_rad);
    double w = exp(-0.5 * (pow(x / def->beam_m, 2) + pow(s->beside_m / (2 * def->beam_m), 2)));
    power += fabs(z) < 0.5 * def->gate_m ? 2 * w * w : 0;
  }
  d->blood = sqrt(fmax(power, 1));
  weigh_rings(d);
  *out = d;
  return SONDE_OK;
}

void sonde_doppler_destroy(sonde_doppler *doppler) { sonde_free(doppler); }

void sonde_doppler_pulse(sonde_doppler *d, const double profile_m_s[SONDE_FLOW_RINGS]) {
  const sonde_doppler_def *def = &d->def;
  double cosine = cos(def->angle_rad), sine = sin(def->angle_rad), dt = 1 / def->pulse_hz;
  double wave = 4 * SONDE_PI * def->frequency_hz / sound_m_s, sum[2] = {0, 0};
  SONDE_ASSERT(profile_m_s != NULL);
  for (int i = 0; i < SCATTERERS; ++i) {
    scatterer *s = &d->at[i];
    int k = (int)fmin(s->ring, SONDE_FLOW_RINGS - 2);
    double share = s->ring - k;
    s->along_m += dt * ((1 - share) * profile_m_s[k] + share * profile_m_s[k + 1]);
    // What leaves at one end enters as new blood at the other.
    if (fabs(s->along_m) > d->reach_m) {
      s->along_m -= copysign(2 * d->reach_m, s->along_m);
      for (int c = 0; c < 2; ++c) s->echo[c] = sonde_random_normal(def->seed, d->drawn++);
    }
    double z = s->along_m * cosine + s->across_m * sine; // along the beam, towards the probe
    double x = s->along_m * sine - s->across_m * cosine;
    if (fabs(z) > 0.5 * def->gate_m) continue;
    double w = exp(-0.5 * (pow(x / def->beam_m, 2) + pow(s->beside_m / (2 * def->beam_m), 2)));
    double c = w * cos(wave * z), q = w * sin(wave * z);
    sum[0] += c * s->echo[0] - q * s->echo[1];
    sum[1] += c * s->echo[1] + q * s->echo[0];
  }
  double noise = pow(10, def->noise_db / 20) / sqrt(2), wall = pow(10, def->clutter_db / 20);
  double *echo = d->echo[d->pulses++ % SPECTRUM_MOST];
  for (int c = 0; c < 2; ++c)
    echo[c] =
        sum[c] / d->blood + noise * sonde_random_normal(def->seed, d->drawn++) + (c ? 0 : wall);
}

// The last echoes in the order of time.
static void hear(const sonde_doppler *d, uint32_t count, double (*echo)[2]) {
  for (uint32_t n = 0; n < count; ++n)
    memcpy(echo[n], d->echo[(d->pulses - count + n) % SPECTRUM_MOST], sizeof echo[n]);
}

void sonde_doppler_read(const sonde_doppler *d, sonde_doppler_spectrum *out) {
  SONDE_ASSERT(d && out);
  *out = (sonde_doppler_spectrum){.mean_m_s = 0};
  const double limit = sonde_doppler_limit(&d->def);
  for (int b = 0; b < BINS; ++b) out->velocity_m_s[b] = limit * (b - BINS / 2) / (BINS / 2);
  const uint32_t count = spectrum_window(d->def.pulse_hz);
  if (d->pulses < count) return;
  double echo[SPECTRUM_MOST][2], power[SPECTRUM_MOST], kept[SPECTRUM_MOST], velocity[SPECTRUM_MOST];
  hear(d, count, echo);
  spectrum_take(echo, count, power);
  // Towards the probe is a positive shift; away from it the spectrum is turned round.
  const bool away = cos(d->def.angle_rad) < 0;
  const int bins = (int)spectrum_bins(count);
  for (int b = 0; b < bins; ++b) {
    const int shift = b - bins / 2;
    const bool passed = abs(shift) * d->def.pulse_hz / bins >= fmax(d->def.filter_hz, 0);
    kept[b] = passed ? power[away ? (bins - b) % bins : b] : 0;
    velocity[b] = limit * shift / (bins / 2);
  }
  spectrum_read(count, kept, velocity, (uint32_t)bins, &out->mean_m_s, &out->peak_m_s);
  spectrum_rows(kept, (uint32_t)bins, out->power);
}

double sonde_doppler_phase_velocity(const sonde_doppler *d) {
  SONDE_ASSERT(d != NULL);
  if (d->pulses < BINS) return 0;
  double echo[BINS][2], wall[2] = {0, 0}, real = 0, imaginary = 0;
  hear(d, BINS, echo);
  // The walls do not move: their echo is the mean.
  for (int n = 0; n < BINS; ++n)
    for (int c = 0; c < 2; ++c) wall[c] += echo[n][c] / BINS;
  for (int n = 0; n < BINS; ++n)
    for (int c = 0; c < 2; ++c) echo[n][c] -= wall[c];
  for (int n = 1; n < BINS; ++n) {
    const double *p = echo[n - 1], *q = echo[n];
    real += p[0] * q[0] + p[1] * q[1], imaginary += p[0] * q[1] - p[1] * q[0];
  }
  double away = cos(d->def.angle_rad) < 0 ? -1 : 1;
  return away * sonde_doppler_limit(&d->def) * atan2(imaginary, real) / SONDE_PI;
}
