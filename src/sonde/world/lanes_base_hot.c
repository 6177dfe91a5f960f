// Kernels of the fast engine for one instruction set.
#define SONDE_KERNELS sonde_lane_kernels_base
#define SONDE_KERNELS_NAME "base"
#include "world/lanes_kernel.c"
