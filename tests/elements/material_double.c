#define SONDE_REAL_DOUBLE
#include "material_batch.h"
