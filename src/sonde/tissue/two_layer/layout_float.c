// The two-layer tissue in one precision: its layout.
#include "tissue/two_layer/layout.c"
