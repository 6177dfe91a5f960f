// Kernels of the slicer for one instruction set.
#define SLICE_KERNELS sonde_slice_kernels_avx2
#define SLICE_KERNELS_NAME "avx2"
#include "sweep/slice_kernel.c"
