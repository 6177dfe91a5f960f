// The spectrum of a window of pulses, its noise, mean and edge (docs/flow_theory.md).
#include "flow/spectrum.h"

#include "base/maths.h"

void spectrum_take(const double echo[][2], uint32_t count, double *power) {
  SONDE_ASSERT(echo && power && count > 0 && count <= SPECTRUM_MOST);
  const uint32_t bins = spectrum_bins(count);
  double part[SPECTRUM_MOST][2], turn[SPECTRUM_MOST / 2][2], wall[2] = {0, 0}, sum = 0;
  for (uint32_t k = 0; k < bins / 2; ++k) {
    turn[k][0] = cos(2 * SONDE_PI * k / bins), turn[k][1] = -sin(2 * SONDE_PI * k / bins);
  }
  // What does not move is the echoes' mean under the weights.
  for (uint32_t n = 0; n < count; ++n) {
    const double weight = 0.5 - 0.5 * cos(2 * SONDE_PI * n / count);
    sum += weight;
    for (int c = 0; c < 2; ++c) wall[c] += weight * echo[n][c];
  }
  // Echo n to the place whose bits are those of n the other way round, for the transform below.
  uint32_t bits = 0;
  while (1u << bits < bins) ++bits;
  for (uint32_t n = 0; n < bins; ++n) {
    uint32_t place = 0;
    for (uint32_t b = 0; b < bits; ++b) place |= (n >> b & 1) << (bits - 1 - b);
    const double weight = n < count ? 0.5 - 0.5 * cos(2 * SONDE_PI * n / count) : 0;
    for (int c = 0; c < 2; ++c)
      part[place][c] = n < count ? weight * (echo[n][c] - wall[c] / sum) : 0;
  }
  // Cooley and Tukey: transforms of twice the length from pairs.
  for (uint32_t half = 1; half < bins; half *= 2)
    for (uint32_t first = 0; first < bins; first += 2 * half)
      for (uint32_t k = 0; k < half; ++k) {
        double *low = part[first + k], *high = part[first + k + half];
        const double *by = turn[k * (bins / 2 / half)];
        const double re = by[0] * high[0] - by[1] * high[1], im = by[0] * high[1] + by[1] * high[0];
        high[0] = low[0] - re, high[1] = low[1] - im;
        low[0] += re, low[1] += im;
      }
  for (uint32_t b = 0; b < bins; ++b) {
    const double *at = part[(b + bins / 2) % bins];
    power[b] = at[0] * at[0] + at[1] * at[1];
  }
}

void spectrum_read(const double *power, const double *velocity, uint32_t bins, double *mean,
                   double *peak) {
  SONDE_ASSERT(power && velocity && mean && peak && bins > 4 && bins <= SPECTRUM_MOST);
  double sorted[SPECTRUM_MOST], above[SPECTRUM_MOST], whole = 0, moment = 0;
  const int count = (int)bins;
  int kept = 0;
  for (int b = 0; b < count; ++b) {
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
  for (int b = 0; b < count; ++b) {
    above[b] = fmax(power[b] - 9 * noise, 0);
    whole += above[b], moment += above[b] * velocity[b];
  }
  if (!(whole > 12 * noise)) return; // nothing but noise: no flow beyond the filter
  *mean = moment / whole;
  // The edge on the side of the mean, from outside: neighbours above the noise, since one bin may
  // be.
  const int from = *mean < 0 ? 1 : count - 2, step = *mean < 0 ? 1 : -1;
  double passed = 0;
  for (int b = from; b + step > 0 && b + step < count - 1; b += step) {
    if (passed > 0 || (above[b] > 0 && above[b + step] > 0)) passed += above[b];
    *peak = velocity[b];
    if (passed > 0.01 * whole) return;
  }
  *peak = *mean;
}
