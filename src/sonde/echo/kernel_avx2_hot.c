// Inner loops of the image for one instruction set.
#define SONDE_KERNELS sonde_echo_kernels_avx2
#define SONDE_KERNELS_NAME "avx2"
#include "echo/kernel.c"
