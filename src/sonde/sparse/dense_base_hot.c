// Dense kernels for one instruction set.
#define DENSE_KERNELS sonde_dense_kernels_base
#define DENSE_NAME "base"
#include "sparse/dense_kernel.h"
