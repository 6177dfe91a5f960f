// Inner loops of the image for one instruction set.
#define SONDE_KERNELS sonde_echo_kernels_base
#define SONDE_KERNELS_NAME "base"
#include "echo/kernel.c"
