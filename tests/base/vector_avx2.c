#define VECTOR_TEST vectors_of_avx2
#include "vector_kernel.h"
