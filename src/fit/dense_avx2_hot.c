// Product of dense matrices for one instruction set.
#define DENSE_KERNELS sonde_dense_kernels_avx2
#define DENSE_NAME "avx2"
#include "fit/dense_kernel.h"
