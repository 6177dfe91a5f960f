// Kernels of the multifrontal solver for one instruction set.
#define FRONTAL_KERNELS sonde_frontal_kernels_base
#define FRONTAL_NAME "base"
#include "sparse/frontal_kernel.h"
