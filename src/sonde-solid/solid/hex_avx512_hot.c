// Laws and element for one instruction set.
#define HEX_KERNELS sonde_hex_kernels_avx512
#define HEX_NAME "avx512"
#include "hex_kernel.h"
