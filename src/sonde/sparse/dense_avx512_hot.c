// Dense kernels for one instruction set.
#define DENSE_KERNELS sonde_dense_kernels_avx512
#define DENSE_NAME "avx512"
#include "sparse/dense_kernel.h"
