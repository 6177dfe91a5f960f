#define VECTOR_TEST vectors_of_avx512
#include "vector_kernel.h"
