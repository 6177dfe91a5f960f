// The spectrum of a window of pulses, its noise, mean and edge (docs/flow_theory.md).
#include "flow/spectrum.h"

#include "base/maths.h"

void spectrum_take(const double echo[][2], uint32_t count, double *power) {
  SONDE_ASSERT(echo && power && count > 0 && count <= SPECTRUM_MOST);
  const uint32_t bins = spectrum_bins(count);
  double part[SPECTRUM_MOST][2], turn[SPECTRUM_MOST / 2][2], weight[SPECTRUM_MOST];
  double wall[2] = {0, 0}, sum = 0;
  for (uint32_t k = 0; k < bins / 2; ++k)
    turn[k][0] = cos(2 * SONDE_PI * k / bins), turn[k][1] = -sin(2 * SONDE_PI * k / bins);
  // What does not move is the echoes' mean under the weights.
  for (uint32_t n = 0; n < count; ++n) {
    weight[n] = 0.5 - 0.5 * cos(2 * SONDE_PI * n / count);
    sum += weight[n];
    for (int c = 0; c < 2; ++c) wall[c] += weight[n] * echo[n][c];
  }
  // Echo n to the place whose bits are those of n the other way round, for the transform below.
  uint32_t bits = 0;
  while (1u << bits < bins) ++bits;
  for (uint32_t n = 0; n < bins; ++n) {
    uint32_t place = 0;
    for (uint32_t b = 0; b < bits; ++b) place |= (n >> b & 1) << (bits - 1 - b);
    for (int c = 0; c < 2; ++c)
      part[place][c] = n < count ? weight[n] * (echo[n][c] - wall[c] / sum) : 0;
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

void spectrum_read(uint32_t count, const double *power, const double *velocity, uint32_t bins,
                   double *mean, double *peak) {
  SONDE_ASSERT(power && velocity && mean && peak && count > 0 && bins > 4 && bins <= SPECTRUM_MOST);
  double above[SPECTRUM_MOST], blood[SPECTRUM_MOST], whole = 0, greatest = 0;
  const int most = (int)bins;
  int kept = 0;
  for (int b = 0; b < most; ++b) kept += power[b] > 0, greatest = fmax(greatest, power[b]);
  *mean = *peak = 0;
  if (kept == 0) return;
  // Halving an interval finds the power below which a third of the kept bins lie, to a
  // thousand-millionth of the greatest.
  double low_power = 0, quantile = greatest;
  for (int k = 0; k < 30; ++k) {
    const double middle = 0.5 * (low_power + quantile);
    int below = 0;
    for (int b = 0; b < most; ++b) below += power[b] > 0 && power[b] < middle;
    if (3 * below > kept)
      quantile = middle;
    else
      low_power = middle;
  }
  // The lower third is noise, whose power is spread exponentially: its mean is the 33 % quantile
  // over 0.405. One bin in 8,000 of noise reaches nine times the mean.
  const double noise = quantile / 0.405;
  for (int b = 0; b < most; ++b) {
    above[b] = fmax(power[b] - 9 * noise, 0), blood[b] = power[b] > 0 ? power[b] - noise : 0;
    whole += above[b];
  }
  if (!(whole > 12 * noise)) return; // nothing but noise: no flow beyond the filter
  // Blood is what lies between the outermost neighbours above the noise and, below it, as far from
  // them as the window spreads it.
  const int each = (int)lround(fmax((double)bins / count, 1)); // what the window tells apart
  int from = most, to = -1;
  for (int b = 0; b + 1 < most; ++b)
    if (above[b] > 0 && above[b + 1] > 0) from = from < b ? from : b, to = b + 1;
  from = from < 2 * each ? 0 : from - 2 * each,
  to = to < most - 2 * each ? to + 2 * each : most - 1;
  // What the wall filter took of it goes on evenly from one edge of the filter to the other.
  for (int low = 0, high; low < most; low = high + 1) {
    for (high = low; high < most && !(power[high] > 0);) ++high;
    if (high == low) continue;
    double edge[2] = {0, 0};
    for (int k = 0; k < each; ++k) {
      edge[0] += low - 1 - k >= 0 ? blood[low - 1 - k] / each : 0;
      edge[1] += high + k < most ? blood[high + k] / each : 0;
    }
    for (int b = low; b < high; ++b)
      blood[b] = edge[0] + (edge[1] - edge[0]) * (b - low + 1) / (high - low + 1);
  }
  double sum = 0, moment = 0;
  for (int b = from; b <= to; ++b) sum += blood[b], moment += blood[b] * velocity[b];
  if (!(sum > 0)) return;
  *mean = moment / sum;
  // The edge on the side of the mean, from outside: neighbours above the noise, since one bin may
  // be.
  const double beyond = 0.01;
  const int outside = *mean < 0 ? 1 : most - 2, step = *mean < 0 ? 1 : -1;
  double passed = 0;
  *peak = *mean;
  for (int b = outside; b + step > 0 && b + step < most - 1 && !(passed > beyond * whole);
       b += step) {
    if (passed > 0 || (above[b] > 0 && above[b + step] > 0)) passed += above[b];
    if (passed > beyond * whole) *peak = velocity[b];
  }
}

void spectrum_rows(const double *power, uint32_t bins, double row[SONDE_DOPPLER_BINS]) {
  SONDE_ASSERT(power && row && bins % SONDE_DOPPLER_BINS == 0);
  const int each = (int)bins / SONDE_DOPPLER_BINS;
  for (int r = 0; r < SONDE_DOPPLER_BINS; ++r) {
    row[r] = 0;
    for (int k = -each / 2; k <= each / 2; ++k)
      row[r] += (each > 1 && 2 * abs(k) == each ? 0.5 : 1) *
                power[(r * each + k + (int)bins) % (int)bins] / each;
  }
}
