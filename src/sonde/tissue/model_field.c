// Site parameters carried over the surface: simple kriging of the
// logarithms of k0, xm and the shares of the shear layer.
// covariance: Matern 3/2 with a length of about two site spacings.
// factor:     Cholesky of the sites' covariance.
// interpolate: mean plus weights times covariance at every node.
#include "tissue/model.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static const double LENGTH_M = 0.04, NUGGET = 1e-6;

static double covariance(sonde_vec3 a, sonde_vec3 b) {
  double d = sqrt(3.0) * v_distance(a, b) / LENGTH_M;
  return (1 + d) * exp(-d);
}

// In-place Cholesky of a dense symmetric matrix (lower triangle); false when not definite.
static bool factor(double *a, uint32_t n) {
  for (uint32_t j = 0; j < n; ++j) {
    for (uint32_t i = j; i < n; ++i) {
      double sum = a[i * n + j];
      for (uint32_t k = 0; k < j; ++k) sum -= a[i * n + k] * a[j * n + k];
      if (i == j && !(sum > 0)) return false;
      a[i * n + j] = i == j ? sqrt(sum) : sum / a[j * n + j];
    }
  }
  return true;
}

static void solve(const double *a, uint32_t n, double *x) {
  for (uint32_t i = 0; i < n; ++i) {
    for (uint32_t k = 0; k < i; ++k) x[i] -= a[i * n + k] * x[k];
    x[i] /= a[i * n + i];
  }
  for (uint32_t i = n; i-- > 0;) {
    for (uint32_t k = i + 1; k < n; ++k) x[i] -= a[k * n + i] * x[k];
    x[i] /= a[i * n + i];
  }
}

static double subtract_mean(double *x, uint32_t n) {
  double mean = 0;
  for (uint32_t k = 0; k < n; ++k) mean += x[k] / n;
  for (uint32_t k = 0; k < n; ++k) x[k] -= mean;
  return mean;
}

// What the sites carry, in logarithms.
enum { FIELDS = 4 };

static void logarithms(const sonde_site *site, double ln[FIELDS]) {
  ln[0] = log(site->k0_n_m3);
  ln[1] = log(site->xm_m);
  ln[2] = site->shear_share > 0 ? log(site->shear_share) : 0;
  ln[3] = site->limit_share > 0 ? log(site->limit_share) : 0;
}

static void spread(sonde_model *model, const double *weight, const double mean[FIELDS]) {
  uint32_t sites = model->site_count;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    double ln[FIELDS];
    memcpy(ln, mean, sizeof ln);
    for (uint32_t s = 0; s < sites; ++s) {
      double c = covariance(model->surface.vertices[i], model->sites[s].position_m);
      for (uint32_t f = 0; f < FIELDS; ++f) ln[f] += c * weight[f * sites + s];
    }
    model->k0_n_m3[i] = exp(ln[0]);
    model->xm_m[i] = exp(ln[1]);
    model->shear_share[i] = exp(ln[2]);
    model->limit_share[i] = exp(ln[3]);
  }
}

sonde_status sonde_model_interpolate(sonde_model *model, sonde_error *error) {
  uint32_t n = model->site_count;
  for (uint32_t s = 0; s < n; ++s)
    if (!(model->sites[s].k0_n_m3 > 0) || !(model->sites[s].xm_m > 0))
      return sonde_fail(error, SONDE_ARGUMENT, "site %u has k0 %g and xm %g, expected positive",
                        model->sites[s].id, model->sites[s].k0_n_m3, model->sites[s].xm_m);
  double *matrix = SONDE_NEW(double, (size_t)n *n), *weight = SONDE_NEW(double, FIELDS *(size_t)n);
  double mean[FIELDS];
  sonde_status status = SONDE_OK;
  if (!matrix || !weight) {
    status = sonde_fail_memory(error);
    goto done;
  }
  for (uint32_t a = 0; a < n; ++a) {
    double ln[FIELDS];
    logarithms(&model->sites[a], ln);
    for (uint32_t f = 0; f < FIELDS; ++f) weight[f * n + a] = ln[f];
    for (uint32_t b = 0; b < n; ++b)
      matrix[a * n + b] = covariance(model->sites[a].position_m, model->sites[b].position_m);
    matrix[a * n + a] += NUGGET;
  }
  if (!factor(matrix, n)) {
    status = sonde_fail(error, SONDE_ARGUMENT, "two sites lie at the same place");
    goto done;
  }
  for (uint32_t f = 0; f < FIELDS; ++f) {
    mean[f] = subtract_mean(weight + f * n, n);
    solve(matrix, n, weight + f * n);
  }
  spread(model, weight, mean);
done:
  sonde_free(matrix);
  sonde_free(weight);
  return status;
}
