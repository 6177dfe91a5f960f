// Kernels of the multifrontal solver for one instruction set.
#define FRONTAL_KERNELS sonde_frontal_kernels_avx2
#define FRONTAL_NAME "avx2"
#include "sparse/frontal_kernel.h"
