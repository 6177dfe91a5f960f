// A set of frames in space with one picture among them.
#ifndef SONDE_APP_STACK_FIGURE_H
#define SONDE_APP_STACK_FIGURE_H

#include "sonde/sonde.h"

// Every step-th frame and the made picture (framed in white, at frame number `place`), from the
// first to the last in a parallel projection that looks along the sweep from the side. PNG.
sonde_status stack_figure(const sonde_sequence *sequence, uint32_t step, double place,
                          const sonde_affine *plane, const sonde_image *picture, const char *path,
                          sonde_error *error);
// The same into an image, which the caller clears.
sonde_status stack_draw(const sonde_sequence *sequence, uint32_t step, double place,
                        const sonde_affine *plane, const sonde_image *picture, sonde_image *figure,
                        sonde_error *error);

#endif
