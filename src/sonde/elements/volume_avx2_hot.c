// Kernels of the volume for one instruction set.
#define VOLUME_KERNELS sonde_elastic_volume_kernels_avx2
#define VOLUME_NAME "avx2"
#include "elements/volume_kernel.h"
