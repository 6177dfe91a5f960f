// The two-layer tissue in one precision: its layout.
#define SONDE_REAL_DOUBLE
#include "tissue/two_layer/layout.c"
