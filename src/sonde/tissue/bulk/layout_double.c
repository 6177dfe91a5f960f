// A volumetric body in one precision: its layout.
#define SONDE_REAL_DOUBLE
#include "tissue/bulk/layout.c"
