// Kernels of one precision for one instruction set.
#define SONDE_REAL_DOUBLE
#define SONDE_KERNELS sonde_kernels_base
#define SONDE_KERNELS_NAME "base"
#include "world/kernel.c"
