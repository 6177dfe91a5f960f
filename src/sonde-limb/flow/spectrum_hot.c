// The spectrum of a window of pulses, its noise, mean and edge (docs/flow_theory.md).
#include "flow/spectrum.h"

#include "base/maths.h"

enum { BINS = SONDE_DOPPLER_BINS };

void spectrum_take(const double echo[][2], uint32_t count, double power[BINS]) {
  SONDE_ASSERT(echo && count > 0 && count <= BINS);
  double cosine[BINS], sine[BINS], window[BINS], heard[BINS][2], wall[2] = {0, 0}, sum = 0;
  for (int k = 0; k < BINS; ++k)
    cosine[k] = cos(2 * SONDE_PI * k / BINS), sine[k] = sin(2 * SONDE_PI * k / BINS);
  // What does not move is the echoes' mean under the weights.
  for (uint32_t n = 0; n < count; ++n) {
    window[n] = 0.5 - 0.5 * (count == BINS ? cosine[n] : cos(2 * SONDE_PI * n / count));
    sum += window[n];
    for (int c = 0; c < 2; ++c) wall[c] += window[n] * echo[n][c];
  }
  for (uint32_t n = 0; n < count; ++n)
    for (int c = 0; c < 2; ++c) heard[n][c] = window[n] * (echo[n][c] - wall[c] / sum);
  for (int b = 0; b < BINS; ++b) {
    const unsigned f = (unsigned)(b + BINS / 2) % BINS;
    double part[2] = {0, 0};
    for (uint32_t n = 0; n < count; ++n) {
      const unsigned turn = f * n % BINS;
      part[0] += heard[n][0] * cosine[turn] + heard[n][1] * sine[turn];
      part[1] += heard[n][1] * cosine[turn] - heard[n][0] * sine[turn];
    }
    power[b] = part[0] * part[0] + part[1] * part[1];
  }
}

void spectrum_read(const double power[BINS], const double velocity[BINS], double *mean,
                   double *peak) {
  SONDE_ASSERT(power && velocity && mean && peak);
  double sorted[BINS], above[BINS], whole = 0, moment = 0;
  int kept = 0;
  for (int b = 0; b < BINS; ++b) {
    if (!(power[b] > 0)) continue;
    int i = kept++;
    for (; i > 0 && sorted[i - 1] > power[b]; --i) sorted[i] = sorted[i - 1];
    sorted[i] = power[b];
  }
  *mean = *peak = 0;
  if (kept == 0) return;
  // The lower third is noise, whose power is spread exponentially: its mean is the 33 % quantile
  // over 0.405. One bin in 8,000 of noise reaches nine times the mean.
  const double noise = sorted[kept / 3] / 0.405;
  for (int b = 0; b < BINS; ++b) {
    above[b] = fmax(power[b] - 9 * noise, 0);
    whole += above[b], moment += above[b] * velocity[b];
  }
  if (!(whole > 12 * noise)) return; // nothing but noise: no flow beyond the filter
  *mean = moment / whole;
  // The edge on the side of the mean, from outside: neighbours above the noise, since one bin may
  // be.
  const int from = *mean < 0 ? 1 : BINS - 2, step = *mean < 0 ? 1 : -1;
  double passed = 0;
  for (int b = from; b + step > 0 && b + step < BINS - 1; b += step) {
    if (passed > 0 || (above[b] > 0 && above[b + step] > 0)) passed += above[b];
    *peak = velocity[b];
    if (passed > 0.01 * whole) return;
  }
  *peak = *mean;
}
