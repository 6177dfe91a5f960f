// What the data say about the parameters of stage 3: smoothness by left-out sites, sandwich
// covariance, bootstrap over sites, all linearised at the optimum.
#include "sparse/dense.h"
#include "fit/refit_inside.h"

#include "base/maths.h"
#include "base/order.h"
#include "base/random.h"

#include <string.h>

enum { DRAWS = 200, BOOTSTRAP_SEED = 1 };
static const double TRIED_SD[SONDE_FIT_TRIED] = {0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2};
static const double NORMAL_95 = 1.959964;

// Scratch of the linearised problems.
typedef struct linear {
  uint32_t n, site_count;
  sonde_normal *site; // [site_count] of one site's measurements
  sonde_normal data;  // of all measurements
  sonde_normal whole; // with a prior
  sonde_normal part;  // of some sites, with a prior
  double *factor, *step;
  double *forward, *turned; // [most_rows * n] of one site or batch
  double *within;           // [most_rows^2] of one site
  double *error_n;          // [most_rows] of one site
} linear;

static uint32_t most_rows(const sonde_fit_plan *plan) {
  uint32_t most = 1;
  for (uint32_t s = 0; s < plan->site_count; ++s) {
    uint32_t rows = plan->site_start[s + 1] - plan->site_start[s];
    if (rows > most) most = rows;
  }
  return most;
}

static bool linear_create(linear *l, uint32_t n, const sonde_fit_plan *plan) {
  uint32_t sites = plan->site_count;
  size_t rows = most_rows(plan);
  *l = (linear){.n = n, .site_count = sites};
  l->forward = SONDE_NEW(double, rows *n);
  l->turned = SONDE_NEW(double, rows *n);
  l->within = SONDE_NEW(double, rows *rows);
  l->error_n = SONDE_NEW(double, rows);
  l->site = SONDE_NEW(sonde_normal, sites);
  l->factor = SONDE_NEW(double, (size_t)n *n);
  l->step = SONDE_NEW(double, n);
  bool ok = l->forward && l->turned && l->within && l->error_n && l->site && l->factor && l->step &&
            sonde_normal_create(&l->data, n) && sonde_normal_create(&l->whole, n) &&
            sonde_normal_create(&l->part, n);
  for (uint32_t s = 0; s < sites && ok; ++s) ok = sonde_normal_create(&l->site[s], n);
  return ok;
}

static void linear_clear(linear *l) {
  for (uint32_t s = 0; l->site && s < l->site_count; ++s) sonde_normal_free(&l->site[s]);
  sonde_normal_free(&l->data);
  sonde_normal_free(&l->whole);
  sonde_normal_free(&l->part);
  sonde_free(l->site);
  sonde_free(l->factor);
  sonde_free(l->step);
  sonde_free(l->forward);
  sonde_free(l->turned);
  sonde_free(l->within);
  sonde_free(l->error_n);
}

static void add_sites(const sonde_refit *r, const sonde_refit_workspace *w, const double *force_n,
                      linear *l) {
  const uint32_t *start = r->plan->site_start;
  for (uint32_t s = 0; s < l->site_count; ++s) {
    (void)sonde_refit_add_rows(r, start[s], start[s + 1], force_n, w->kept_jacobian, &l->site[s]);
    sonde_normal_add(&l->site[s], 1, &l->data);
  }
}

static void with_prior(const sonde_refit *r, sonde_refit_workspace *w, const double *theta,
                       sonde_smoothness smoothness, linear *l) {
  sonde_normal_copy(&l->data, &l->whole);
  (void)sonde_refit_add_prior(r, theta, smoothness, w->line, &l->whole);
}

// Let e = r + J d be the errors after the full step d, S = J H^-1 J^T and W the weights of a site's
// rows: the step without them leaves the errors (1 - S W)^-1 e = W^-1 (W^-1 - S)^-1 e there, by
// Woodbury's formula. l->error_n receives them in the order of the rows that take part.
static bool without_site(const sonde_refit *r, const sonde_refit_workspace *w,
                         const double *force_n, uint32_t site, linear *l) {
  uint32_t rows = 0, n = l->n, at = 0;
  const uint32_t *start = r->plan->site_start + site;
  for (uint32_t k = start[0]; k < start[1]; ++k) rows += sonde_refit_uses(r, k);
  if (rows == 0) return true;

  // Slopes to l->forward, errors after the full step to l->error_n, 1/weight to the diagonal.
  memset(l->within, 0, (size_t)rows * rows * sizeof *l->within);
  for (uint32_t k = start[0]; k < start[1]; ++k) {
    if (!sonde_refit_uses(r, k)) continue;
    const double *slope = &w->kept_jacobian[(size_t)k * n];
    sonde_refit_row row = sonde_refit_weigh(r, k, force_n[k]);
    double error_n = row.error_n;
    for (uint32_t a = 0; a < n; ++a) error_n += slope[a] * l->step[a];
    l->error_n[at] = error_n;
    l->within[(size_t)at * rows + at] = 1 / row.weight;
    memcpy(&l->forward[(size_t)at++ * n], slope, n * sizeof *slope);
  }
  SONDE_ASSERT(at == rows);

  sonde_transpose(l->forward, rows, l->n, l->turned);
  sonde_cholesky_forward_many(l->factor, l->n, l->turned, rows);
  const sonde_product spread = {.c = l->within,
                                .c_row = rows,
                                .a = l->turned,
                                .a_row = 1,
                                .a_step = rows,
                                .b = l->turned,
                                .b_row = rows,
                                .rows = rows,
                                .columns = rows,
                                .depth = l->n,
                                .subtract = true};
  sonde_multiply(&spread);
  if (!sonde_cholesky(l->within, rows)) return false;
  sonde_cholesky_solve(l->within, rows, l->error_n);
  at = 0;
  for (uint32_t k = start[0]; k < start[1]; ++k)
    if (sonde_refit_uses(r, k)) l->error_n[at++] /= sonde_refit_weigh(r, k, force_n[k]).weight;
  return true;
}

// Mean error of the left-out sites in percent; their forces go to one_out_n by sorted row.
static double leave_out(const sonde_refit *r, const sonde_refit_workspace *w, const double *force_n,
                        linear *l, double *one_out_n) {
  double sum = 0, count = 0;
  if (!sonde_normal_solve(&l->whole, 0, l->factor, l->step)) return INFINITY;
  for (uint32_t s = 0; s < l->site_count; ++s) {
    uint32_t at = 0;
    if (!without_site(r, w, force_n, s, l)) return INFINITY;
    for (uint32_t k = r->plan->site_start[s]; k < r->plan->site_start[s + 1]; ++k) {
      if (!sonde_refit_uses(r, k)) continue;
      one_out_n[k] = r->m->data[r->plan->row[k]].force_n + l->error_n[at];
      sum += fabs(l->error_n[at++]) / r->plan->mean_force_n[r->plan->row_probe[k]];
      ++count;
    }
  }
  return 100 * sum / count;
}

// Which of the two standard deviations is varied.
enum { BOTH, SHEAR_ONLY, NORMAL_ONLY, PASSES };

sonde_status sonde_refit_choose_smoothness(sonde_refit *r, sonde_refit_workspace *w,
                                           const double *theta, const double *force_n,
                                           sonde_error *error) {
  linear l;
  double *one_out_n = SONDE_NEW(double, w->rows), least = INFINITY;
  sonde_smoothness best = r->smoothness;
  bool ok = linear_create(&l, w->n, r->plan) && one_out_n;
  sonde_status status = ok ? SONDE_OK : sonde_fail_memory(error);
  if (status) goto done;
  add_sites(r, w, force_n, &l);
  for (int pass = 0; pass < (r->fields > 2 ? PASSES : SHEAR_ONLY); ++pass)
    for (int k = 0; k < SONDE_FIT_TRIED; ++k) {
      sonde_smoothness trial = r->smoothness;
      if (pass != SHEAR_ONLY) trial.normal_sd = TRIED_SD[k];
      if (pass != NORMAL_ONLY) trial.shear_sd = TRIED_SD[k];
      with_prior(r, w, theta, trial, &l);
      double percent = leave_out(r, w, force_n, &l, one_out_n);
      if (pass == BOTH && r->confidence) {
        r->confidence->tried_count = SONDE_FIT_TRIED;
        r->confidence->tried_sd[k] = TRIED_SD[k];
        r->confidence->tried_percent[k] = percent;
      }
      if (percent < least) best = trial;
      least = fmin(least, percent);
      if (k == SONDE_FIT_TRIED - 1) r->smoothness = best;
    }
done:
  linear_clear(&l);
  sonde_free(one_out_n);
  return status;
}

// l->turned = H^-1 of `count` rows in l->forward, and these themselves become H^-1 of them.
static void solve_rows(linear *l, uint32_t count) {
  sonde_transpose(l->forward, count, l->n, l->turned);
  sonde_cholesky_solve_many(l->factor, l->n, l->turned, count);
  sonde_transpose(l->turned, l->n, count, l->forward);
}

// Covariance H^-1 (sum (w r)^2/(1 - h)^2 J J^T) H^-1: the spread of the residuals as they are,
// whatever their standard deviations were assumed to be; h is the leverage. factor: Cholesky of H.
static void sandwich(const sonde_refit *r, const sonde_refit_workspace *w, const double *force_n,
                     linear *l, double *covariance) {
  uint32_t n = l->n, most = most_rows(r->plan);
  for (uint32_t from = 0; from < w->rows; from += most) {
    uint32_t count = w->rows - from < most ? w->rows - from : most;
    memcpy(l->forward, &w->kept_jacobian[(size_t)from * n], (size_t)count * n * sizeof *l->forward);
    solve_rows(l, count);
    for (uint32_t k = 0; k < count; ++k) {
      sonde_refit_row row = sonde_refit_weigh(r, from + k, force_n[from + k]);
      const double *slope = &w->kept_jacobian[(size_t)(from + k) * n];
      double leverage = 0;
      for (uint32_t a = 0; a < n; ++a)
        leverage += row.weight * slope[a] * l->forward[(size_t)k * n + a];
      double pull = row.weight * row.error_n / fmax(1 - leverage, 0.2);
      l->error_n[k] = sonde_refit_uses(r, from + k) ? pull * pull : 0;
    }
    sonde_add_outers(covariance, n, l->forward, count, l->error_n);
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

// Parameter k as a part of ln G, ln gm, mean ln k0 or mean ln xm; -1: of none.
static int figure_of(const sonde_refit *r, uint32_t k) {
  uint32_t sites = r->sites->count, n = sonde_refit_parameters(r);
  if (k >= n - 2) return (int)(k - (n - 2));
  return k < sites ? 2 : k < 2 * sites ? 3 : -1;
}

// Sites with replacement, one step of the linearised problem each: intervals of ln G and ln gm.
static void bootstrap(const sonde_refit *r, sonde_refit_workspace *w, const double *theta,
                      linear *l, sonde_fit_confidence *c) {
  double drawn[2][DRAWS];
  uint32_t count = 0, sites = l->site_count, n = l->n;
  for (uint32_t d = 0; d < DRAWS; ++d) {
    sonde_normal_clear(&l->part);
    for (uint32_t s = 0; s < sites; ++s) {
      uint64_t number = sonde_random_bits(BOOTSTRAP_SEED, (uint64_t)d * sites + s);
      sonde_normal_add(&l->site[number % sites], 1, &l->part);
    }
    (void)sonde_refit_add_prior(r, theta, r->smoothness, w->line, &l->part);
    if (!sonde_normal_solve(&l->part, 0, l->factor, l->step)) continue;
    drawn[0][count] = theta[n - 2] + l->step[n - 2];
    drawn[1][count++] = theta[n - 1] + l->step[n - 1];
  }
  for (int k = 0; k < 2 && count > 0; ++k) {
    qsort(drawn[k], count, sizeof drawn[k][0], sonde_compare_reals);
    double *out = k ? c->limit_95 : c->shear_95;
    out[0] = exp(drawn[k][(uint32_t)(0.025 * count)]);
    out[1] = exp(drawn[k][count - 1 - (uint32_t)(0.025 * count)]);
  }
}

static void fill(const sonde_refit *r, sonde_refit_workspace *w, const double *covariance,
                 sonde_fit_confidence *c) {
  uint32_t n = w->n, sites = r->sites->count;
  for (uint32_t s = 0; s < sites; ++s) {
    c->ln_k0_sd[s] = sqrt(lower(covariance, n, s, s));
    c->ln_xm_sd[s] = sqrt(lower(covariance, n, sites + s, sites + s));
    for (uint32_t k = 0; k < 2; ++k) {
      double *to = k ? c->ln_site_limit_sd : c->ln_site_shear_sd;
      memset(w->line, 0, n * sizeof *w->line);
      w->line[n - 2 + k] = 1;
      if (r->fields > 2) w->line[(2 + k) * sites + s] = 1;
      to[s] = sqrt(variance_of(covariance, n, w->line));
    }
  }
  c->ln_shear_sd = sqrt(lower(covariance, n, n - 2, n - 2));
  c->ln_limit_sd = sqrt(lower(covariance, n, n - 1, n - 1));
  // Correlation of ln G, ln gm and the means of ln k0 and ln xm.
  double spread[4][4] = {{0}};
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = 0; j < n; ++j) {
      int a = figure_of(r, i), b = figure_of(r, j);
      if (a < 0 || b < 0) continue;
      double share = (a > 1 ? 1.0 / sites : 1) * (b > 1 ? 1.0 / sites : 1);
      spread[a][b] += share * lower(covariance, n, i, j);
    }
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < 4; ++b)
      c->correlation[a][b] = spread[a][b] / sqrt(spread[a][a] * spread[b][b]);
  for (uint32_t k = 0; k < w->rows; ++k)
    c->band_n[r->plan->row[k]] =
        NORMAL_95 * sqrt(variance_of(covariance, n, &w->kept_jacobian[(size_t)k * n]));
}

sonde_status sonde_refit_confidence(sonde_refit *r, sonde_refit_workspace *w, const double *theta,
                                    const double *force_n, sonde_error *error) {
  sonde_fit_confidence *c = r->confidence;
  linear l;
  c->smoothness_sd = r->smoothness.normal_sd;
  c->shear_smoothness_sd = r->smoothness.shear_sd;
  double *covariance = SONDE_NEW(double, (size_t)w->n * w->n);
  double *one_out_n = SONDE_NEW(double, w->rows);
  c->ln_k0_sd = SONDE_NEW(double, r->sites->count);
  c->ln_xm_sd = SONDE_NEW(double, r->sites->count);
  c->ln_site_shear_sd = SONDE_NEW(double, r->sites->count);
  c->ln_site_limit_sd = SONDE_NEW(double, r->sites->count);
  c->band_n = SONDE_NEW(double, r->m->count);
  c->one_out_n = SONDE_NEW(double, r->m->count);
  bool ok = linear_create(&l, w->n, r->plan) && covariance && one_out_n && c->ln_k0_sd &&
            c->ln_xm_sd && c->ln_site_shear_sd && c->ln_site_limit_sd && c->band_n && c->one_out_n;
  sonde_status status = ok ? SONDE_OK : sonde_fail_memory(error);
  if (status) goto done;
  for (uint32_t k = 0; k < r->m->count; ++k) c->one_out_n[k] = c->band_n[k] = NAN;
  for (uint32_t k = 0; k < w->rows; ++k) one_out_n[k] = NAN;
  add_sites(r, w, force_n, &l);
  with_prior(r, w, theta, r->smoothness, &l);
  (void)leave_out(r, w, force_n, &l, one_out_n);
  for (uint32_t k = 0; k < w->rows; ++k) c->one_out_n[r->plan->row[k]] = one_out_n[k];
  bootstrap(r, w, theta, &l, c);
  if (!sonde_normal_solve(&l.whole, 0, l.factor, l.step)) {
    status = sonde_fail(error, SONDE_CONVERGENCE, "the parameters are not determined by the data");
    goto done;
  }
  sandwich(r, w, force_n, &l, covariance);
  // The prior holds the fields only as far as it is true: its own spread counts too.
  uint32_t most = most_rows(r->plan), rows = sonde_refit_prior_rows(r);
  for (uint32_t from = 0; from < rows; from += most) {
    uint32_t count = rows - from < most ? rows - from : most;
    for (uint32_t k = 0; k < count; ++k)
      l.error_n[k] = sonde_refit_prior_row(r, r->smoothness, from + k, &l.forward[(size_t)k * w->n],
                                           &(double){0});
    solve_rows(&l, count);
    sonde_add_outers(covariance, w->n, l.forward, count, l.error_n);
  }
  fill(r, w, covariance, c);
  status = sonde_error_report_of(r->m->data, c->one_out_n, r->m->count, &c->one_out, error);
done:
  linear_clear(&l);
  sonde_free(covariance);
  sonde_free(one_out_n);
  return status;
}
