// The echographic image's benchmark: sonde bench --scene image.
#ifndef SONDE_BENCH_IMAGE_H
#define SONDE_BENCH_IMAGE_H

#include "options.h"

// The form of sonde bench for this scene.
extern const app_command bench_image;

#endif
