// Kernels of the volume for one instruction set.
#define VOLUME_KERNELS sonde_elastic_volume_kernels_avx512
#define VOLUME_NAME "avx512"
#include "elements/volume_kernel.h"
