// Site parameters over the surface: simple kriging of the logarithms of k0, xm and the shares of
// the shear layer, with a Matern 3/2 covariance of about two site spacings.
#include "tissue/model.h"

#include "base/base.h"
#include "base/maths.h"
#include "sparse/dense.h"

#include <string.h>

enum { FIELDS = 4 }; // ln k0, ln xm, ln share of G, ln share of gm
static const double LENGTH_M = 0.04, NUGGET = 1e-6;

static double covariance(sonde_vec3 a, sonde_vec3 b) {
  double d = sqrt(3.0) * v_distance(a, b) / LENGTH_M;
  return (1 + d) * exp(-d);
}

sonde_status sonde_model_interpolate(sonde_model *model, sonde_error *error) {
  uint32_t n = model->site_count;
  for (uint32_t s = 0; s < n; ++s)
    if (!(model->sites[s].k0_n_m3 > 0) || !(model->sites[s].xm_m > 0))
      return sonde_fail(error, SONDE_ARGUMENT, "site %u has k0 %g and xm %g, expected positive",
                        model->sites[s].id, model->sites[s].k0_n_m3, model->sites[s].xm_m);
  double *matrix = SONDE_NEW(double, (size_t)n *n), *weight = SONDE_NEW(double, FIELDS *(size_t)n);
  double mean[FIELDS] = {0};
  sonde_status status = SONDE_OK;
  if (!matrix || !weight) {
    status = sonde_fail_memory(error);
    goto done;
  }

  // covariance of the sites, and their logarithms less the mean
  for (uint32_t a = 0; a < n; ++a) {
    const sonde_site *site = &model->sites[a];
    weight[0 * n + a] = log(site->k0_n_m3);
    weight[1 * n + a] = log(site->xm_m);
    weight[2 * n + a] = site->shear_share > 0 ? log(site->shear_share) : 0;
    weight[3 * n + a] = site->limit_share > 0 ? log(site->limit_share) : 0;
    for (uint32_t b = 0; b < n; ++b)
      matrix[a * n + b] = covariance(site->position_m, model->sites[b].position_m);
    matrix[a * n + a] += NUGGET;
  }
  if (!sonde_cholesky(matrix, n)) {
    status = sonde_fail(error, SONDE_ARGUMENT, "two sites lie at the same place");
    goto done;
  }
  for (uint32_t f = 0; f < FIELDS; ++f) {
    double *ln = weight + f * n;
    for (uint32_t k = 0; k < n; ++k) mean[f] += ln[k] / n;
    for (uint32_t k = 0; k < n; ++k) ln[k] -= mean[f];
    sonde_cholesky_solve(matrix, n, ln);
  }

  // at every node: mean plus weights times covariance
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    double ln[FIELDS];
    memcpy(ln, mean, sizeof ln);
    for (uint32_t s = 0; s < n; ++s) {
      double c = covariance(model->surface.vertices[i], model->sites[s].position_m);
      for (uint32_t f = 0; f < FIELDS; ++f) ln[f] += c * weight[f * n + s];
    }
    model->k0_n_m3[i] = exp(ln[0]);
    model->xm_m[i] = exp(ln[1]);
    model->shear_share[i] = exp(ln[2]);
    model->limit_share[i] = exp(ln[3]);
    SONDE_ASSERT(model->k0_n_m3[i] >= 0 && model->xm_m[i] >= 0);
  }
done:
  sonde_free(matrix);
  sonde_free(weight);
  return status;
}
