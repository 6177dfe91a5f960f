// Kernels of the slicer for one instruction set.
#define SLICE_KERNELS sonde_slice_kernels_avx512
#define SLICE_KERNELS_NAME "avx512"
#include "sweep/slice_kernel.c"
