// Inner loops of the image for one instruction set.
#define SONDE_KERNELS sonde_echo_kernels_sse4
#define SONDE_KERNELS_NAME "sse4"
#include "echo/kernel.c"
