#define VECTOR_TEST vectors_of_base
#include "vector_kernel.h"
