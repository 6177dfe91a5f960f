// Dense kernels for one instruction set.
#define DENSE_KERNELS sonde_dense_kernels_avx2
#define DENSE_NAME "avx2"
#include "sparse/dense_kernel.h"
