// The material's functions over a batch: every lane gets a deformation gradient and a change of it.
#include "elements/material.h"

void BY_REAL(material_batch)(sonde_elastic_material law, double mu, double lambda, const double *f,
                             const double *df, double *out);

// f, df [SONDE_BATCH][9]; out [SONDE_BATCH][19]: energy, stress, its change.
void BY_REAL(material_batch)(sonde_elastic_material law, double mu, double lambda, const double *f,
                             const double *df, double *out) {
  reals x[9], dx[9], p[9], dp[9], m = all((real)mu), l = all((real)lambda);
  for (int k = 0; k < 9; ++k)
    for (int i = 0; i < SONDE_BATCH; ++i)
      x[k][i] = (real)f[9 * i + k], dx[k][i] = (real)df[9 * i + k];
  reals energy = material_energy(law, m, l, x);
  material_stress(law, m, l, x, p);
  material_tangent(law, m, l, x, dx, dp);
  for (int i = 0; i < SONDE_BATCH; ++i) {
    out[19 * i] = (double)energy[i];
    for (int k = 0; k < 9; ++k) {
      out[19 * i + 1 + k] = (double)p[k][i];
      out[19 * i + 10 + k] = (double)dp[k][i];
    }
  }
}
