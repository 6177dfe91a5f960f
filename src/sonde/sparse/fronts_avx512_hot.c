// Kernels of the multifrontal factor for one instruction set.
#define FRONT_KERNELS sonde_front_kernels_avx512
#define FRONT_NAME "avx512"
#include "sparse/fronts_kernel.c"
