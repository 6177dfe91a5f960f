// Spectrum of a window of echoes and what is read off it.
#ifndef SONDE_SRC_FLOW_SPECTRUM_H
#define SONDE_SRC_FLOW_SPECTRUM_H

#include "base/base.h"
#include "sonde/flow.h"

#include <math.h>

enum { SPECTRUM_MOST = 1024 }; // echoes of a window, and bins

// Echoes of a window.
static inline uint32_t spectrum_window(double pulse_hz) {
  const double pulses = round(SONDE_DOPPLER_WINDOW_S * pulse_hz);
  return (uint32_t)fmin(fmax(pulses, SONDE_DOPPLER_PULSES), SPECTRUM_MOST);
}

// Bins of a spectrum of so many echoes: SONDE_DOPPLER_BINS, twice as many and so on, so that one
// bin is no wider than what the window resolves.
static inline uint32_t spectrum_bins(uint32_t count) {
  uint32_t bins = SONDE_DOPPLER_BINS;
  while (bins < count) bins *= 2;
  return bins;
}

// Power of `count` echoes, at most SPECTRUM_MOST, without their mean under a Hann window and
// weighted by it, by frequency from minus to plus half the pulse rate (hot).
// @param[out] power [spectrum_bins(count)]
void spectrum_take(const double echo[][2], uint32_t count, double *power);
// Mean and edge of what stands out of the noise; 99 % of its power lie below the edge. Bins of no
// power are removed ones, over which the mean goes on evenly. Zeros: nothing stands out (hot).
// @param count echoes of the window @param power [bins], at most SPECTRUM_MOST
// @param velocity [bins] rising
void spectrum_read(uint32_t count, const double *power, const double *velocity, uint32_t bins,
                   double *mean, double *peak);
// Of a spectrum's bins the SONDE_DOPPLER_BINS rows that are shown: each the mean of the bins about
// its middle, those half way to its neighbours shared (hot).
void spectrum_rows(const double *power, uint32_t bins, double row[SONDE_DOPPLER_BINS]);

#endif
