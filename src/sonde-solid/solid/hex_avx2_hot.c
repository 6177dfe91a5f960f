// Laws and element for one instruction set.
#define HEX_KERNELS sonde_hex_kernels_avx2
#define HEX_NAME "avx2"
#include "hex_kernel.h"
