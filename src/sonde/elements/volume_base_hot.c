// Kernels of the volume for one instruction set.
#define VOLUME_KERNELS sonde_elastic_volume_kernels_base
#define VOLUME_NAME "base"
#include "elements/volume_kernel.h"
