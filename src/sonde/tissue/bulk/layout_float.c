// A volumetric body in one precision: its layout.
#include "tissue/bulk/layout.c"
