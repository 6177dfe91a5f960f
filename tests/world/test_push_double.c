// The laws of test_push.c for batches of doubles.
#define SONDE_REAL_DOUBLE
#include "test_push.c"
