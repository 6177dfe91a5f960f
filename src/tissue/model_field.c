// Site parameters carried over the surface: simple kriging of ln k0 and ln xm.
// covariance: Matern 3/2 with a length of about two site spacings.
// factor:     Cholesky of the sites' covariance.
// interpolate: mean plus weights times covariance at every node.
#include "tissue/model.h"

#include "base/base.h"
#include "base/maths.h"

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

static void spread(sonde_model *model, const double *wk, double mean_k, const double *wx,
                   double mean_x) {
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    double ln_k = mean_k, ln_x = mean_x;
    for (uint32_t s = 0; s < model->site_count; ++s) {
      double c = covariance(model->surface.vertices[i], model->sites[s].position_m);
      ln_k += c * wk[s];
      ln_x += c * wx[s];
    }
    model->k0_n_m3[i] = exp(ln_k);
    model->xm_m[i] = exp(ln_x);
  }
}

sonde_status sonde_model_interpolate(sonde_model *model, sonde_error *error) {
  uint32_t n = model->site_count;
  for (uint32_t s = 0; s < n; ++s)
    if (!(model->sites[s].k0_n_m3 > 0) || !(model->sites[s].xm_m > 0))
      return sonde_fail(error, SONDE_ARGUMENT, "site %u has k0 %g and xm %g, expected positive",
                        model->sites[s].id, model->sites[s].k0_n_m3, model->sites[s].xm_m);
  double *matrix = SONDE_NEW(double, (size_t)n *n);
  double *k = SONDE_NEW(double, n), *x = SONDE_NEW(double, n);
  sonde_status status = SONDE_OK;
  if (!matrix || !k || !x) {
    status = sonde_fail_memory(error);
    goto done;
  }
  for (uint32_t a = 0; a < n; ++a) {
    for (uint32_t b = 0; b < n; ++b)
      matrix[a * n + b] = covariance(model->sites[a].position_m, model->sites[b].position_m);
    matrix[a * n + a] += NUGGET;
    k[a] = log(model->sites[a].k0_n_m3);
    x[a] = log(model->sites[a].xm_m);
  }
  if (!factor(matrix, n)) {
    status = sonde_fail(error, SONDE_ARGUMENT, "two sites lie at the same place");
    goto done;
  }
  double mean_k = subtract_mean(k, n), mean_x = subtract_mean(x, n);
  solve(matrix, n, k);
  solve(matrix, n, x);
  spread(model, k, mean_k, x, mean_x);
done:
  sonde_free(matrix);
  sonde_free(k);
  sonde_free(x);
  return status;
}
