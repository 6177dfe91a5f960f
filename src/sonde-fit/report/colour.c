// companded: linear light to the value of a screen.
// pack:      three values to "#rrggbb".
#include "report/colour.h"

#include "base/maths.h"

const char *sonde_palette(uint32_t index) {
  static const char *const PALETTE[SONDE_PALETTE] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                     "#e69f00", "#56b4e9", "#000000", "#777777"};
  return PALETTE[index % SONDE_PALETTE];
}

static double companded(double linear) {
  double c = clamp(linear, 0, 1);
  return c <= 0.0031308 ? 12.92 * c : 1.055 * pow(c, 1 / 2.4) - 0.055;
}

// Oklab (Ottosson 2020): cube roots of cone responses l, m, s are linear in (L, a, b).
bool sonde_colour_oklch(double lightness, double chroma, double hue_rad, double rgb[3]) {
  double a = chroma * cos(hue_rad), b = chroma * sin(hue_rad);
  double l = lightness + 0.3963377774 * a + 0.2158037573 * b;
  double m = lightness - 0.1055613458 * a - 0.0638541728 * b;
  double s = lightness - 0.0894841775 * a - 1.2914855480 * b;
  l = l * l * l, m = m * m * m, s = s * s * s;
  const double linear[3] = {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
                            -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
                            -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
  bool inside = true;
  for (int i = 0; i < 3; ++i) {
    inside = inside && linear[i] > -1e-3 && linear[i] < 1.001;
    rgb[i] = companded(linear[i]);
  }
  return inside;
}

static sonde_colour pack(const double rgb[3]) {
  sonde_colour colour;
  unsigned part[3];
  for (int i = 0; i < 3; ++i) {
    SONDE_ASSERT(rgb[i] >= 0 && rgb[i] <= 1.0001);
    part[i] = (unsigned)(clamp(rgb[i], 0, 1) * 255 + 0.5) & 0xffu;
  }
  snprintf(colour.s, sizeof colour.s, "#%02x%02x%02x", part[0], part[1], part[2]);
  return colour;
}

// Lightness and hue grow evenly and chroma is constant: every step is equally long in Oklab.
sonde_colour sonde_colour_sequential(double t, double shade) {
  double rgb[3], at = clamp(t, 0, 1);
  SONDE_ASSERT(shade > 0 && shade <= 1);
  sonde_colour_oklch((0.32 + 0.62 * at) * shade, 0.105 * shade, (282 - 174 * at) * (SONDE_PI / 180),
                     rgb);
  return pack(rgb);
}

sonde_colour sonde_colour_diverging(double t) {
  double rgb[3], size = fabs(clamp(t, -1, 1));
  double hue_rad = (t < 0 ? 250 : 55) * (SONDE_PI / 180);
  sonde_colour_oklch(0.985 - 0.42 * size, 0.14 * size, hue_rad, rgb);
  return pack(rgb);
}
