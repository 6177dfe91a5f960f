// Kernels of the multifrontal factor for one instruction set.
#define FRONT_KERNELS sonde_front_kernels_avx2
#define FRONT_NAME "avx2"
#include "sparse/fronts_kernel.c"
