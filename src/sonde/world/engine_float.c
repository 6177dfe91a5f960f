// An engine in one precision: layout of a model; cold.
#include "world/batches.c"
