// Strain beside a picture: tracked from two pictures as scanners do it, and as it is.
#ifndef SONDE_APP_IMAGE_STRAIN_H
#define SONDE_APP_IMAGE_STRAIN_H

#include "settled.h"

typedef struct image_strain {
  sonde_echo *echo; // has drawn `image` at the settled state
  const sonde_pathology *pathology;
  const sonde_echo_settings *settings;
  double aperture_m;
  const sonde_image *image;
  // Of the strain along the lines where tissue is drawn and its speckle is found again: the true
  // one's mean, the rms difference of the tracked one, and the share of such places.
  double mean, error, tracked;
} image_strain;

// Presses the probe a little further and writes strain.png, strain_true.png and strain.csv.
sonde_status image_strain_write(const char *folder, settled *s, image_strain *strain,
                                sonde_error *error);

#endif
