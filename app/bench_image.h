// The echographic image's benchmark: sonde bench --scene image.
#ifndef SONDE_BENCH_IMAGE_H
#define SONDE_BENCH_IMAGE_H

#include <stdbool.h>

// True when the command line asks for this scene.
bool bench_image_asked(int argc, char **argv);
int bench_image(int argc, char **argv);

#endif
