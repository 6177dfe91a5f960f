// An engine in one precision: layout of a model; cold.
#define SONDE_REAL_DOUBLE
#include "world/batches.c"
