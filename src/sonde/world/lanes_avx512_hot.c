// Kernels of the fast engine for one instruction set.
#define SONDE_KERNELS sonde_lane_kernels_avx512
#define SONDE_KERNELS_NAME "avx512"
#include "world/lanes_kernel.c"
