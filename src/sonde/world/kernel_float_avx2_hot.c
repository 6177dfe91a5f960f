// Kernels of one precision for one instruction set.
#define SONDE_KERNELS sonde_kernels_avx2
#define SONDE_KERNELS_NAME "avx2"
#include "world/kernel.c"
