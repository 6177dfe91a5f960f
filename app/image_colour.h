// Colour Doppler over a picture of `sonde image`.
#ifndef SONDE_APP_IMAGE_COLOUR_H
#define SONDE_APP_IMAGE_COLOUR_H

#include "app.h"
#include "settled.h"

// What is asked for.
typedef struct image_colour {
  bool on, power;    // power: how much moves instead of how fast
  double scale_m_s;  // velocity along the beam that is not folded yet; NaN: the fastest blood's
  double steer_rad;  // NaN: as the vessels need it, on a flat face
  double box_m[4];   // left, right, top, bottom; NaN: all of the picture
  double at_s;       // time since the heart's first beat
  double squeeze_s;  // the calf is squeezed; NaN: never
  const char *cells; // file for the truth of each cell
} image_colour;

enum { IMAGE_VESSELS = 64 };

// What came out: velocities along the beam, of the cells in colour against those of the blood.
typedef struct image_colour_result {
  double limit_m_s, steer_rad, frame_s; // frame_s: processor time of one frame of colour
  uint32_t blood, shown, beside;        // cells with blood; of them in colour; others in colour
  double error_m_s;                     // root mean square over the former, folds aside
  double mean_m_s[IMAGE_VESSELS];       // of the vessels, on their way
} image_colour_result;

// Draws the picture with its colour and a bar, and writes it; results to JSON or as text. Aperture
// and radius (0: flat) are the face's.
sonde_status image_colour_draw(const image_colour *of, const settled *s, const sonde_echo *echo,
                               const sonde_image *image, double aperture_m, double radius_m,
                               double frequency_hz, uint64_t seed, const char *path,
                               image_colour_result *result, sonde_error *error);
void image_colour_tell(const image_colour_result *result, const settled *s, bool json);

#endif
