// Kernels of volume_kernels.h, included once for each instruction set.
#define SONDE_REAL_DOUBLE
#include "elements/material.h"
#include "elements/volume_kernels.h"
#include "base/base.h"

// Gradient of a displacement field.
INLINE void displacement_gradient(const sonde_elastic_volume_batch *b, const double *u,
                                  reals h[9]) {
  for (int k = 0; k < 9; ++k) h[k] = all(0);
  for (int a = 0; a < 4; ++a)
    for (int i = 0; i < 3; ++i) {
      reals x;
      for (int l = 0; l < SONDE_BATCH; ++l) x[l] = u[3 * (size_t)b->corner[a][l] + (size_t)i];
      for (int j = 0; j < 3; ++j) h[3 * i + j] += x * *(const reals *)b->gradient[3 * a + j];
    }
}

INLINE void deformation(const sonde_elastic_volume_batch *b, const double *u, reals f[9]) {
  displacement_gradient(b, u, f);
  for (int k = 0; k < 9; k += 4) f[k] += all(1);
}

// dJ = c : dF; returns J - 1.
INLINE reals growth_of(sonde_elastic_material law, const reals f[9], reals c[9]) {
  if (law == SONDE_NEO_HOOKEAN) return cofactors(f, c) - 1;
  for (int k = 0; k < 9; ++k) c[k] = all(k % 4 == 0);
  return f[0] + f[4] + f[8] - 3;
}

// Adds V P g to the forces of the corners.
INLINE void add_forces(const sonde_elastic_volume_batch *b, const reals p[9], double *f) {
  const reals volume = *(const reals *)b->volume;
  for (int a = 0; a < 4; ++a)
    for (int i = 0; i < 3; ++i) {
      const reals *g = (const reals *)b->gradient + 3 * a;
      reals force = volume * (p[3 * i] * g[0] + p[3 * i + 1] * g[1] + p[3 * i + 2] * g[2]);
      for (int l = 0; l < SONDE_BATCH; ++l) f[3 * (size_t)b->corner[a][l] + (size_t)i] += force[l];
    }
}

static void growth(const sonde_elastic_volume_batch *batch, uint32_t count,
                   sonde_elastic_material law, const double *u, double *out) {
  SONDE_ASSERT(u != NULL && out != NULL);
  for (uint32_t k = 0; k < count; ++k) {
    reals f[9], c[9];
    deformation(&batch[k], u, f);
    ((reals *)out)[k] = growth_of(law, f, c);
  }
}

static void growth_change(const sonde_elastic_volume_batch *batch, uint32_t count,
                          sonde_elastic_material law, const double *u, const double *d,
                          double *out) {
  SONDE_ASSERT(u != NULL && d != NULL && out != NULL);
  for (uint32_t k = 0; k < count; ++k) {
    reals f[9], df[9], c[9];
    deformation(&batch[k], u, f);
    displacement_gradient(&batch[k], d, df);
    (void)growth_of(law, f, c);
    ((reals *)out)[k] = product_of(c, df);
  }
}

static double forces(const sonde_elastic_volume_batch *batch, uint32_t count,
                     sonde_elastic_material law, const double *u, const double *pressure,
                     double *out) {
  SONDE_ASSERT(u != NULL && pressure != NULL && out != NULL);
  wide_sum energy = all(0);
  for (uint32_t k = 0; k < count; ++k) {
    reals f[9], p[9], c[9], mu = *(const reals *)batch[k].mu;
    deformation(&batch[k], u, f);
    energy += *(const reals *)batch[k].volume * material_energy(law, mu, all(0), f);
    material_stress(law, mu, all(0), f, p);
    (void)growth_of(law, f, c);
    for (int i = 0; i < 9; ++i) p[i] += ((const reals *)pressure)[k] * c[i];
    add_forces(&batch[k], p, out);
  }
  return total(energy);
}

static void tangent(const sonde_elastic_volume_batch *batch, uint32_t count,
                    sonde_elastic_material law, const double *u, const double *d,
                    const double *pressure, const double *pressure_change, double *out) {
  SONDE_ASSERT(u != NULL && d != NULL && pressure != NULL && out != NULL);
  for (uint32_t k = 0; k < count; ++k) {
    reals f[9], df[9], dp[9], c[9];
    deformation(&batch[k], u, f);
    displacement_gradient(&batch[k], d, df);
    material_tangent(law, *(const reals *)batch[k].mu, all(0), f, df, dp);
    (void)growth_of(law, f, c);
    for (int i = 0; i < 9; ++i) dp[i] += ((const reals *)pressure_change)[k] * c[i];
    if (law == SONDE_NEO_HOOKEAN) add_cofactor_change(f, df, ((const reals *)pressure)[k], dp);
    add_forces(&batch[k], dp, out);
  }
}

const sonde_elastic_volume_kernels VOLUME_KERNELS = {VOLUME_NAME, growth, growth_change, forces,
                                                     tangent};
