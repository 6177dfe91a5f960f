// Kernels of one precision for one instruction set.
#define SONDE_KERNELS sonde_kernels_avx512
#define SONDE_KERNELS_NAME "avx512"
#include "world/kernel.c"
