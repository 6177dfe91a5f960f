// The truth beside a picture, as files in a folder.
#ifndef SONDE_APP_IMAGE_TRUTH_H
#define SONDE_APP_IMAGE_TRUTH_H

#include "sonde/sonde.h"

// Writes tissue.png, vessel.png, place.nrrd, displacement.nrrd, velocity.nrrd and labels.csv.
sonde_status image_truth_write(const char *folder, const sonde_echo *echo,
                               const sonde_interior *interior, const sonde_image *image,
                               sonde_error *error);

#endif
