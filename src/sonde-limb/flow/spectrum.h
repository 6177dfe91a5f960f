// Spectrum of a window of echoes and what is read off it.
#ifndef SONDE_SRC_FLOW_SPECTRUM_H
#define SONDE_SRC_FLOW_SPECTRUM_H

#include "base/base.h"
#include "sonde/flow.h"

// Power of `count` echoes, at most SONDE_DOPPLER_BINS, without their mean under a Hann window and
// weighted by it, by frequency from minus to plus half the pulse rate (hot).
void spectrum_take(const double echo[][2], uint32_t count, double power[SONDE_DOPPLER_BINS]);
// Mean and edge of what stands out of the noise; bins of no power are removed ones. Zeros: nothing
// does (hot).
// @param velocity [SONDE_DOPPLER_BINS] rising
void spectrum_read(const double power[SONDE_DOPPLER_BINS],
                   const double velocity[SONDE_DOPPLER_BINS], double *mean, double *peak);

#endif
