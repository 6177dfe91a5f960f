// Kernels over batches of eight tetrahedra, for one instruction set each; all give the same bits.
#ifndef SONDE_SRC_VOLUME_KERNELS_H
#define SONDE_SRC_VOLUME_KERNELS_H

#include "elements/kinds.h"

#include <stdint.h>

enum { SONDE_VOLUME_BATCH = 8 };

typedef struct sonde_elastic_volume_batch {
  double gradient[12][SONDE_VOLUME_BATCH]; // 3 corner + axis; those of no tetrahedron are 0
  double volume[SONDE_VOLUME_BATCH], mu[SONDE_VOLUME_BATCH];
  uint32_t corner[4][SONDE_VOLUME_BATCH];
} sonde_elastic_volume_batch;

typedef struct sonde_elastic_volume_kernels {
  const char *name;
  // Relative growth of volume at displacements u, and its change under d.
  void (*growth)(const sonde_elastic_volume_batch *batch, uint32_t count,
                 sonde_elastic_material law, const double *u, double *growth);
  void (*growth_change)(const sonde_elastic_volume_batch *batch, uint32_t count,
                        sonde_elastic_material law, const double *u, const double *d,
                        double *change);
  // Adds forces of the shape change and of a pressure (tension positive) to f; returns the energy
  // of the shape change.
  double (*forces)(const sonde_elastic_volume_batch *batch, uint32_t count,
                   sonde_elastic_material law, const double *u, const double *pressure, double *f);
  void (*tangent)(const sonde_elastic_volume_batch *batch, uint32_t count,
                  sonde_elastic_material law, const double *u, const double *d,
                  const double *pressure, const double *pressure_change, double *df);
} sonde_elastic_volume_kernels;

extern const sonde_elastic_volume_kernels sonde_elastic_volume_kernels_base;
#ifdef __x86_64__
extern const sonde_elastic_volume_kernels sonde_elastic_volume_kernels_avx2,
    sonde_elastic_volume_kernels_avx512;
#endif

#endif
