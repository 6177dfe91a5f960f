// weighted_row:    scaled derivatives and residual of one measurement.
// add_prior:       the smoothness' normal equations at a standard deviation.
// step_without:    where the linearised optimum goes without one site.
// sonde_refit_choose_smoothness: the prior whose left-out sites are predicted best.
// sandwich:        covariance from the residuals themselves.
// add_prior_spread: what the smoothness adds to it.
// bootstrap:       linearised refits with sites drawn again.
// sonde_refit_confidence: all of it at the optimum.
#include "fit/dense.h"
#include "fit/refit_inside.h"

#include "base/maths.h"
#include "base/random.h"

#include <stdlib.h>
#include <string.h>

enum { DRAWS = 200, BOOTSTRAP_SEED = 1 };
static const double TRIED_SD[SONDE_FIT_TRIED] = {0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2};
static const double NORMAL_95 = 1.959964;

// Derivatives and residual over the standard deviation of the row's error.
static const double *weighted_row(const sonde_refit *r, workspace *w, uint32_t k,
                                  const double *force_n, double *residual) {
  const sonde_fit_plan *plan = r->plan;
  double scale = 1 / sonde_refit_sd_n(r, k);
  SONDE_ASSERT(k < w->rows && scale > 0);
  for (uint32_t a = 0; a < w->n; ++a) w->scaled[a] = scale * w->kept_jacobian[(size_t)k * w->n + a];
  *residual = scale * (force_n[k] - r->m->data[plan->row[k]].force_n);
  return w->scaled;
}

static void add_weighted(double *matrix, double *gradient, uint32_t n, const double *row,
                         double residual, double weight) {
  sonde_add_outer(matrix, n, row, weight);
  for (uint32_t a = 0; a < n; ++a) gradient[a] += weight * row[a] * residual;
}

static void add_prior(const sonde_refit *r, workspace *w, const double *theta, double sd,
                      double *matrix, double *gradient) {
  uint32_t count = r->sites->count;
  for (uint32_t field = 0; field < 2; ++field)
    for (uint32_t s = 0; s < count; ++s) {
      const double *rough = &r->roughness[(size_t)s * count];
      double residual = 0;
      for (uint32_t t = 0; t < count; ++t) residual += rough[t] * theta[field * count + t];
      memset(w->scaled, 0, w->n * sizeof *w->scaled);
      memcpy(w->scaled + field * count, rough, count * sizeof *rough);
      add_weighted(matrix, gradient, w->n, w->scaled, residual, 1 / (sd * sd));
    }
}

// Scratch of the linearised problems.
typedef struct linear {
  uint32_t n;
  double *data, *data_gradient; // of the measurements alone
  double *matrix, *gradient;    // with a prior
  double *factor, *step;
} linear;

static bool linear_create(linear *l, uint32_t n) {
  size_t square = (size_t)n * n;
  *l = (linear){n,
                SONDE_NEW(double, square),
                SONDE_NEW(double, n),
                SONDE_NEW(double, square),
                SONDE_NEW(double, n),
                SONDE_NEW(double, square),
                SONDE_NEW(double, n)};
  return l->data && l->data_gradient && l->matrix && l->gradient && l->factor && l->step;
}

static void linear_clear(linear *l) {
  sonde_free(l->data);
  sonde_free(l->data_gradient);
  sonde_free(l->matrix);
  sonde_free(l->gradient);
  sonde_free(l->factor);
  sonde_free(l->step);
}

static void add_all_rows(const sonde_refit *r, workspace *w, const double *force_n, linear *l) {
  for (uint32_t k = 0; k < w->rows; ++k) {
    if (!sonde_refit_uses(r, k)) continue;
    double residual;
    const double *row = weighted_row(r, w, k, force_n, &residual);
    add_weighted(l->data, l->data_gradient, l->n, row, residual, 1);
  }
}

static void with_prior(const sonde_refit *r, workspace *w, const double *theta, double sd,
                       linear *l) {
  memcpy(l->matrix, l->data, (size_t)l->n * l->n * sizeof *l->matrix);
  memcpy(l->gradient, l->data_gradient, l->n * sizeof *l->gradient);
  add_prior(r, w, theta, sd, l->matrix, l->gradient);
}

// Step from theta to the optimum of everything but one site's measurements.
static bool step_without(const sonde_refit *r, workspace *w, const double *force_n, uint32_t site,
                         linear *l) {
  SONDE_ASSERT(site < r->plan->site_count);
  memcpy(l->factor, l->matrix, (size_t)l->n * l->n * sizeof *l->factor);
  memcpy(l->step, l->gradient, l->n * sizeof *l->step);
  for (uint32_t k = r->plan->site_start[site]; k < r->plan->site_start[site + 1]; ++k) {
    double residual;
    const double *row = weighted_row(r, w, k, force_n, &residual);
    if (sonde_refit_uses(r, k)) add_weighted(l->factor, l->step, l->n, row, residual, -1);
  }
  if (!sonde_cholesky(l->factor, l->n)) return false;
  for (uint32_t a = 0; a < l->n; ++a) l->step[a] = -l->step[a];
  sonde_cholesky_solve(l->factor, l->n, l->step);
  return true;
}

// Mean error of the left-out sites in percent; their forces go to one_out_n by sorted row.
static double leave_out(const sonde_refit *r, workspace *w, const double *force_n, linear *l,
                        double *one_out_n) {
  double sum = 0, count = 0;
  for (uint32_t s = 0; s < r->plan->site_count; ++s) {
    if (!step_without(r, w, force_n, s, l)) return INFINITY;
    for (uint32_t k = r->plan->site_start[s]; k < r->plan->site_start[s + 1]; ++k) {
      if (!sonde_refit_uses(r, k)) continue;
      const double *row = &w->kept_jacobian[(size_t)k * w->n];
      double change = 0, mean_n = r->plan->mean_force_n[r->plan->row_probe[k]];
      for (uint32_t a = 0; a < w->n; ++a) change += row[a] * l->step[a];
      one_out_n[k] = force_n[k] + change;
      sum += fabs(one_out_n[k] - r->m->data[r->plan->row[k]].force_n) / mean_n;
      ++count;
    }
  }
  return 100 * sum / count;
}

sonde_status sonde_refit_choose_smoothness(sonde_refit *r, workspace *w, const double *theta,
                                           const double *force_n, sonde_error *error) {
  linear l;
  double *one_out_n = SONDE_NEW(double, w->rows), least = INFINITY;
  sonde_status status = linear_create(&l, w->n) && one_out_n ? SONDE_OK : sonde_fail_memory(error);
  if (status) goto done;
  add_all_rows(r, w, force_n, &l);
  for (int k = 0; k < SONDE_FIT_TRIED; ++k) {
    with_prior(r, w, theta, TRIED_SD[k], &l);
    double percent = leave_out(r, w, force_n, &l, one_out_n);
    if (percent < least) r->smoothness_sd = TRIED_SD[k];
    least = fmin(least, percent);
    if (!r->confidence) continue;
    r->confidence->tried_count = SONDE_FIT_TRIED;
    r->confidence->tried_sd[k] = TRIED_SD[k];
    r->confidence->tried_percent[k] = percent;
  }
done:
  linear_clear(&l);
  sonde_free(one_out_n);
  return status;
}

// Covariance H^-1 (sum r^2/(1 - h)^2 J J^T) H^-1: the spread of the residuals as they are, whatever
// their standard deviations were assumed to be; h is the leverage. factor: Cholesky of H.
static void sandwich(const sonde_refit *r, workspace *w, const double *force_n, linear *l,
                     double *covariance) {
  uint32_t n = l->n;
  for (uint32_t k = 0; k < w->rows; ++k) {
    if (!sonde_refit_uses(r, k)) continue;
    double residual, leverage = 0;
    const double *row = weighted_row(r, w, k, force_n, &residual);
    memcpy(l->step, row, n * sizeof *l->step);
    sonde_cholesky_solve(l->factor, n, l->step);
    for (uint32_t a = 0; a < n; ++a) leverage += row[a] * l->step[a];
    SONDE_ASSERT(leverage >= 0);
    double room = fmax(1 - leverage, 0.2);
    sonde_add_outer(covariance, n, l->step, residual * residual / (room * room));
  }
}

// The smoothness holds the fields only as far as it is true: its own spread counts too.
static void add_prior_spread(const sonde_refit *r, linear *l, double *covariance) {
  uint32_t count = r->sites->count, n = l->n;
  double weight = 1 / (r->smoothness_sd * r->smoothness_sd);
  SONDE_ASSERT(2 * count < n && isfinite(weight));
  for (uint32_t field = 0; field < 2; ++field)
    for (uint32_t s = 0; s < count; ++s) {
      memset(l->step, 0, n * sizeof *l->step);
      memcpy(l->step + field * count, &r->roughness[(size_t)s * count], count * sizeof *l->step);
      sonde_cholesky_solve(l->factor, n, l->step);
      sonde_add_outer(covariance, n, l->step, weight);
    }
}

static double lower(const double *a, uint32_t n, uint32_t i, uint32_t j) {
  return i >= j ? a[(size_t)i * n + j] : a[(size_t)j * n + i];
}

// Variance of a linear combination.
static double variance_of(const double *covariance, uint32_t n, const double *row) {
  double sum = 0;
  for (uint32_t i = 0; i < n; ++i) {
    double inner = 0.5 * covariance[(size_t)i * n + i] * row[i];
    for (uint32_t j = 0; j < i; ++j) inner += covariance[(size_t)i * n + j] * row[j];
    sum += 2 * inner * row[i];
  }
  return fmax(sum, 0);
}

static void correlate(const double *covariance, uint32_t n, uint32_t sites,
                      double correlation[4][4]) {
  double c[4][4] = {{0}};
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = 0; j < n; ++j) {
      uint32_t a = i < sites ? 2 : i < 2 * sites ? 3 : i - 2 * sites;
      uint32_t b = j < sites ? 2 : j < 2 * sites ? 3 : j - 2 * sites;
      double share = (a > 1 ? 1.0 / sites : 1) * (b > 1 ? 1.0 / sites : 1);
      c[a][b] += share * lower(covariance, n, i, j);
    }
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < 4; ++b) correlation[a][b] = c[a][b] / sqrt(c[a][a] * c[b][b]);
}

static int compare(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// One draw: sites with replacement, one step of the linearised problem; ln G and ln gm.
static bool draw_sites(const sonde_refit *r, workspace *w, const double *theta,
                       const double *force_n, uint32_t draw, linear *l, double *out) {
  uint32_t sites = r->plan->site_count, n = l->n;
  memset(l->matrix, 0, (size_t)n * n * sizeof *l->matrix);
  memset(l->gradient, 0, n * sizeof *l->gradient);
  for (uint32_t s = 0; s < sites; ++s) {
    uint64_t number = sonde_random_bits(BOOTSTRAP_SEED, (uint64_t)draw * sites + s);
    uint32_t site = (uint32_t)(number % sites);
    for (uint32_t k = r->plan->site_start[site]; k < r->plan->site_start[site + 1]; ++k) {
      double residual;
      const double *row = weighted_row(r, w, k, force_n, &residual);
      if (sonde_refit_uses(r, k)) add_weighted(l->matrix, l->gradient, n, row, residual, 1);
    }
  }
  add_prior(r, w, theta, r->smoothness_sd, l->matrix, l->gradient);
  if (!sonde_cholesky(l->matrix, n)) return false;
  for (uint32_t a = 0; a < n; ++a) l->step[a] = -l->gradient[a];
  sonde_cholesky_solve(l->matrix, n, l->step);
  out[0] = theta[n - 2] + l->step[n - 2];
  out[1] = theta[n - 1] + l->step[n - 1];
  return true;
}

static void bootstrap(const sonde_refit *r, workspace *w, const double *theta,
                      const double *force_n, linear *l, sonde_fit_confidence *c) {
  double drawn[2][DRAWS], one[2];
  uint32_t count = 0;
  for (uint32_t d = 0; d < DRAWS; ++d) {
    if (!draw_sites(r, w, theta, force_n, d, l, one)) continue;
    drawn[0][count] = one[0];
    drawn[1][count++] = one[1];
  }
  for (int k = 0; k < 2 && count > 0; ++k) {
    qsort(drawn[k], count, sizeof drawn[k][0], compare);
    double *out = k ? c->limit_95 : c->shear_95;
    out[0] = exp(drawn[k][(uint32_t)(0.025 * count)]);
    out[1] = exp(drawn[k][count - 1 - (uint32_t)(0.025 * count)]);
  }
}

static void fill(const sonde_refit *r, workspace *w, const double *covariance,
                 sonde_fit_confidence *c) {
  uint32_t n = w->n, sites = r->sites->count;
  for (uint32_t s = 0; s < sites; ++s) {
    c->ln_k0_sd[s] = sqrt(lower(covariance, n, s, s));
    c->ln_xm_sd[s] = sqrt(lower(covariance, n, sites + s, sites + s));
  }
  c->ln_shear_sd = sqrt(lower(covariance, n, n - 2, n - 2));
  c->ln_limit_sd = sqrt(lower(covariance, n, n - 1, n - 1));
  correlate(covariance, n, sites, c->correlation);
  for (uint32_t k = 0; k < w->rows; ++k)
    c->band_n[r->plan->row[k]] =
        NORMAL_95 * sqrt(variance_of(covariance, n, &w->kept_jacobian[(size_t)k * n]));
}

static bool allocate(const sonde_refit *r, sonde_fit_confidence *c) {
  c->ln_k0_sd = SONDE_NEW(double, r->sites->count);
  c->ln_xm_sd = SONDE_NEW(double, r->sites->count);
  c->band_n = SONDE_NEW(double, r->m->count);
  c->one_out_n = SONDE_NEW(double, r->m->count);
  for (uint32_t k = 0; c->one_out_n && c->band_n && k < r->m->count; ++k)
    c->one_out_n[k] = c->band_n[k] = NAN;
  return c->ln_k0_sd && c->ln_xm_sd && c->band_n && c->one_out_n;
}

sonde_status sonde_refit_confidence(sonde_refit *r, workspace *w, const double *theta,
                                    const double *force_n, sonde_error *error) {
  sonde_fit_confidence *c = r->confidence;
  linear l;
  c->smoothness_sd = r->smoothness_sd;
  double *covariance = SONDE_NEW(double, (size_t)w->n * w->n);
  double *one_out_n = SONDE_NEW(double, w->rows);
  bool ok = linear_create(&l, w->n) && covariance && one_out_n && allocate(r, c);
  sonde_status status = ok ? SONDE_OK : sonde_fail_memory(error);
  if (status) goto done;
  add_all_rows(r, w, force_n, &l);
  with_prior(r, w, theta, r->smoothness_sd, &l);
  (void)leave_out(r, w, force_n, &l, one_out_n);
  for (uint32_t k = 0; k < w->rows; ++k) c->one_out_n[r->plan->row[k]] = one_out_n[k];
  memcpy(l.factor, l.matrix, (size_t)w->n * w->n * sizeof *l.factor);
  if (!sonde_cholesky(l.factor, w->n)) {
    status = sonde_fail(error, SONDE_CONVERGENCE, "the parameters are not determined by the data");
    goto done;
  }
  sandwich(r, w, force_n, &l, covariance);
  add_prior_spread(r, &l, covariance);
  fill(r, w, covariance, c);
  bootstrap(r, w, theta, force_n, &l, c);
  status = sonde_error_report_of(r->m->data, c->one_out_n, r->m->count, &c->one_out, error);
done:
  linear_clear(&l);
  sonde_free(covariance);
  sonde_free(one_out_n);
  return status;
}
