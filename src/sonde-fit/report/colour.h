// Colours of the figures: a palette that the colour-blind can tell apart, and scales whose steps
// look equal.
#ifndef SONDE_SRC_REPORT_COLOUR_H
#define SONDE_SRC_REPORT_COLOUR_H

#include "base/base.h"

// "#rrggbb", by value.
typedef struct sonde_colour {
  char s[8];
} sonde_colour;

enum { SONDE_PALETTE = 8 };

// Colours of Okabe and Ito without their yellow, which is lost on white.
const char *sonde_palette(uint32_t index);
// From dark blue (0) over green to light yellow (1), equal steps in Oklab; shade in (0, 1] darkens.
sonde_colour sonde_colour_sequential(double t, double shade);
// From blue (-1) over near white (0) to orange (1), symmetric in lightness.
sonde_colour sonde_colour_diverging(double t);
// Oklab lightness, hue (rad) and chroma to sRGB in [0, 1]; false when outside what screens show.
bool sonde_colour_oklch(double lightness, double chroma, double hue_rad, double rgb[3]);

#endif
