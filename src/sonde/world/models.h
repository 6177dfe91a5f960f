// The deformable models that engines are built with: one line each here, in models.cmake and in
// tissue/kinds.c.
#ifndef SONDE_SRC_MODELS_H
#define SONDE_SRC_MODELS_H

#include "world/batches.h"

#include "tissue/kinds.h"
#include "tissue/two_layer/batches.h"
#include "tissue/bulk/batches.h"

// In the order of sonde_family.
#define SONDE_MODELS(X) X(two_layer) X(bulk)

#ifdef SONDE_REAL_DOUBLE
#define SONDE_KERNELS_OF(model, set) sonde_kernels_##model##_##set##_double
#else
#define SONDE_KERNELS_OF(model, set) sonde_kernels_##model##_##set##_float
#endif

#define X(model) extern const sonde_kernels SONDE_KERNELS_OF(model, base);
SONDE_MODELS(X)
#undef X
#ifdef __x86_64__
#define X(model)                                                                                   \
  extern const sonde_kernels SONDE_KERNELS_OF(model, avx2), SONDE_KERNELS_OF(model, avx512);
SONDE_MODELS(X)
#undef X
#endif

// A deformable model in one precision: its layout, and kernels, the widest first.
typedef struct sonde_model_kernels {
  const sonde_tissue_calls *calls;
  const sonde_kernels *kernels[3];
} sonde_model_kernels;

#endif
