// The numbers of a scanner, their ranges and the plain scanner.
#include "base/base.h"
#include "echo/echo.h"

#include <stddef.h>

#define NUMBER(key, low, high, plain, si, member)                                                  \
  { key, low, high, plain, si, offsetof(sonde_scanner, member) }
static const sonde_scanner_number numbers[] = {
    NUMBER("frequency_mhz", 1, 12, 7.5, 1e6, settings.frequency_hz),
    NUMBER("depth_mm", 20, 150, 70, 1e-3, settings.depth_m),
    NUMBER("focus_mm", 5, 150, 25, 1e-3, settings.focus_m),
    NUMBER("gain_db", -30, 30, 0, 1, settings.gain_db),
    NUMBER("dynamic_range_db", 30, 90, 60, 1, settings.dynamic_range_db),
    NUMBER("tgc_db_per_cm", -50, 50, 0, 1e2, settings.tgc_db_per_m),
    NUMBER("aperture_mm", 0, 200, 0, 1e-3, aperture_m),
    NUMBER("radius_mm", 0, 1000, 0, 1e-3, radius_m),
    NUMBER("transmit_f", 1, 10, 2.5, 1, transmit_f),
    NUMBER("receive_f", 1, 10, 2, 1, receive_f),
    NUMBER("pulse_wavelengths", 0.8, 4, 1.1, 1, pulse_wavelengths),
    NUMBER("sound_speeds", 0, 1, 0, 1, sound_speeds),
    NUMBER("looks", 1, SONDE_MOST_LOOKS, 1, 1, looks),
    NUMBER("look_deg", 0, 20, 0, SONDE_PI / 180, look_rad),
    NUMBER("noise_db", -150, 0, -118, 1, noise_db),
    NUMBER("compensation_db", 20, 150, 112, 1, compensation_db),
    NUMBER("haze_db", -90, -10, -90, 1, haze_db),
    NUMBER("ghost_db", -90, 0, -90, 1, ghost_db),
    NUMBER("white_db", 0, 80, 40, 1, white_db),
    NUMBER("map_gamma", 0.3, 4, 1, 1, map_gamma),
    NUMBER("map_knee", 0, 1, 0, 1, map_knee),
    NUMBER("filter", 0, 1, 0, 1, filter),
    NUMBER("filter_mm", 0.1, 2, 0.5, 1e-3, filter_m),
    NUMBER("sharpening", 0, 2, 0, 1, sharpening),
    NUMBER("persistence", 0, 0.9, 0, 1, persistence),
    NUMBER("cubic", 0, 1, 0, 1, cubic),
};
#undef NUMBER
// Every member is a double: a number, or one of the sliders, which stand at 0 in the plain scanner.
_Static_assert((SONDE_COUNT_OF(numbers) + SONDE_SCANNER_SLIDERS) * sizeof(double) ==
                   sizeof(sonde_scanner),
               "a row for every number");

const sonde_scanner_number *sonde_scanner_numbers(uint32_t *count) {
  SONDE_ASSERT(count != NULL);
  *count = SONDE_COUNT_OF(numbers);
  return numbers;
}

sonde_status sonde_scanner_take(sonde_echo *echo, const sonde_scanner *scanner,
                                sonde_error *error) {
  sonde_scanner plain = {0};
  for (size_t k = 0; k < SONDE_COUNT_OF(numbers); ++k) {
    const sonde_scanner_number *n = &numbers[k];
    *(double *)(void *)((char *)&plain + n->offset) = n->plain * n->si;
  }
  echo->scanner = scanner ? *scanner : plain;
  echo->bare = true;
  for (size_t k = 0; k < SONDE_COUNT_OF(numbers); ++k) {
    const sonde_scanner_number *n = &numbers[k];
    const double value = *(const double *)(const void *)((const char *)&echo->scanner + n->offset);
    const double slack = 1e-9 * (n->high - n->low) * n->si;
    if (!(value >= n->low * n->si - slack && value <= n->high * n->si + slack))
      return sonde_fail(error, SONDE_ARGUMENT, "%s of the scanner is %g, expected %g to %g", n->key,
                        value / n->si, n->low, n->high);
    // Of beam and receiver the plain chain takes every value; scan conversion is a later stage.
    const bool of_display = n->offset >= offsetof(sonde_scanner, looks) &&
                            n->offset != offsetof(sonde_scanner, noise_db) &&
                            n->offset != offsetof(sonde_scanner, compensation_db) &&
                            n->offset != offsetof(sonde_scanner, white_db) &&
                            n->offset != offsetof(sonde_scanner, cubic) &&
                            n->offset != offsetof(sonde_scanner, filter_m);
    if (of_display && fabs(value - n->plain * n->si) > 0) echo->bare = false;
  }
  for (int k = 0; k < SONDE_SCANNER_SLIDERS; ++k)
    if (!(fabs(echo->scanner.slider_db[k]) <= 12))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "slider %d of the scanner is %g dB, expected -12 to 12", k + 1,
                        echo->scanner.slider_db[k]);
  echo->looks = (uint32_t)(echo->scanner.looks + 0.5);
  // The grey map: a power, mixed with a smooth step, which has more contrast in the middle.
  const double knee = echo->scanner.map_knee;
  for (int k = 0; k <= SONDE_MAP_STEPS; ++k) {
    const double x = (double)k / SONDE_MAP_STEPS;
    echo->map[k] =
        (float)(255 * ((1 - knee) * pow(x, echo->scanner.map_gamma) + knee * x * x * (3 - 2 * x)));
  }
  return SONDE_OK;
}
