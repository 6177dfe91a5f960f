// Laws and element for one instruction set.
#define HEX_KERNELS sonde_hex_kernels_base
#define HEX_NAME "base"
#include "hex_kernel.h"
