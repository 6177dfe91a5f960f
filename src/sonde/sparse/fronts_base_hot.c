// Kernels of the multifrontal factor for one instruction set.
#define FRONT_KERNELS sonde_front_kernels_base
#define FRONT_NAME "base"
#include "sparse/fronts_kernel.c"
