#include "material_batch.h"
