// Kernels of the slicer for one instruction set.
#define SLICE_KERNELS sonde_slice_kernels_base
#define SLICE_KERNELS_NAME "base"
#include "sweep/slice_kernel.c"
