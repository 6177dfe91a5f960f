// Stage 3's normal equations: weights of rows, what is known beforehand.
#include "fit/bordered.h"
#include "sparse/dense.h"
#include "fit/refit_inside.h"
#include "fit/refit_offset.h"

#include "base/maths.h"

#include <string.h>

// Of the logarithm of a site's share of the shear layer: a leg varies by so much around its mean.
static const double SHARE_SD = 0.3;
// Of the mean of these logarithms: nothing, so that G and gm are the leg's geometric means.
static const double MEAN_SD = 3e-3;
// Of one probe's fit: sqrt(G/k0), over which a dent dies away, and gm, with the standard deviations
// of their logarithms (of G/k0): about the bundled thigh's 8.3 mm and 1.10, generously.
static const double DENT_LENGTH_M = 8.3e-3, DENT_SD = 0.5, LIMIT_MIDDLE = 1.1, LIMIT_SD = 0.2;
enum { CHUNK = 64 };

bool sonde_normal_create(sonde_normal *normal, uint32_t n) {
  *normal = (sonde_normal){n, SONDE_NEW(double, (size_t)n *n), SONDE_NEW(double, n)};
  return normal->matrix && normal->gradient;
}

void sonde_normal_free(sonde_normal *normal) {
  sonde_free(normal->matrix);
  sonde_free(normal->gradient);
  *normal = (sonde_normal){0};
}

void sonde_normal_clear(sonde_normal *normal) {
  memset(normal->matrix, 0, (size_t)normal->n * normal->n * sizeof *normal->matrix);
  memset(normal->gradient, 0, normal->n * sizeof *normal->gradient);
}

void sonde_normal_copy(const sonde_normal *from, sonde_normal *to) {
  SONDE_ASSERT(from->n == to->n);
  memcpy(to->matrix, from->matrix, (size_t)from->n * from->n * sizeof *from->matrix);
  memcpy(to->gradient, from->gradient, from->n * sizeof *from->gradient);
}

void sonde_normal_add(const sonde_normal *other, double times, sonde_normal *normal) {
  SONDE_ASSERT(other->n == normal->n);
  uint32_t n = normal->n;
  for (uint32_t i = 0; i < n; ++i) {
    const double *from = other->matrix + (size_t)i * n;
    double *to = normal->matrix + (size_t)i * n;
    for (uint32_t j = 0; j <= i; ++j) to[j] += times * from[j];
    normal->gradient[i] += times * other->gradient[i];
  }
}

void sonde_normal_add_rows(sonde_normal *normal, const double *rows, uint32_t count,
                           const double *residual, const double *weight) {
  sonde_add_outers(normal->matrix, normal->n, rows, count, weight);
  for (uint32_t k = 0; k < count; ++k)
    for (uint32_t a = 0; a < normal->n; ++a)
      normal->gradient[a] += weight[k] * rows[(size_t)k * normal->n + a] * residual[k];
}

bool sonde_normal_solve(const sonde_normal *normal, double damping, double *factor, double *step) {
  uint32_t n = normal->n;
  SONDE_ASSERT(n > 0 && damping >= 0);
  memcpy(factor, normal->matrix, (size_t)n * n * sizeof *factor);
  for (uint32_t j = 0; j < n; ++j) factor[(size_t)j * n + j] *= 1 + damping;
  if (!sonde_cholesky(factor, n)) return false;
  for (uint32_t i = 0; i < n; ++i) step[i] = -normal->gradient[i];
  sonde_cholesky_solve(factor, n, step);
  return true;
}

// In newtons.
static double loss_scale(const sonde_refit *r, uint32_t row) {
  double mean_n = r->plan->mean_force_n[r->plan->row_probe[row]], scale = r->def->loss_scale;
  return r->def->weights == SONDE_WEIGHTS_RELATIVE ? scale * mean_n : scale;
}

sonde_refit_row sonde_refit_weigh(const sonde_refit *r, uint32_t row, double force_n) {
  double sd_n = sonde_refit_sd_n(r, row), weight;
  SONDE_ASSERT(row < r->plan->row_count && sd_n > 0);
  double error_n = force_n + sonde_offsets_tare(r, row) - r->m->data[r->plan->row[row]].force_n;
  double loss = sonde_loss(r->def->loss, loss_scale(r, row) / sd_n, error_n / sd_n, &weight);
  return (sonde_refit_row){error_n, weight / (sd_n * sd_n), loss};
}

// Rows that do not take part get no weight.
double sonde_refit_add_rows(const sonde_refit *r, uint32_t first, uint32_t end,
                            const double *force_n, const double *jacobian, sonde_normal *normal) {
  double loss = 0, error[CHUNK], weight[CHUNK];
  for (uint32_t from = first; from < end; from += CHUNK) {
    uint32_t count = end - from < CHUNK ? end - from : CHUNK;
    for (uint32_t k = 0; k < count; ++k) {
      error[k] = weight[k] = 0;
      if (!sonde_refit_uses(r, from + k)) continue;
      sonde_refit_row row = sonde_refit_weigh(r, from + k, force_n[from + k]);
      error[k] = row.error_n;
      weight[k] = row.weight;
      loss += row.loss;
    }
    if (normal)
      sonde_normal_add_rows(normal, jacobian + (size_t)from * normal->n, count, error, weight);
  }
  return loss;
}

static uint32_t field_rows(const sonde_refit *r) {
  uint32_t shares = r->fields - 2;
  return r->fields * r->sites->count + shares * (r->sites->count + 1);
}

uint32_t sonde_refit_prior_rows(const sonde_refit *r) {
  return field_rows(r) + (r->plan->probe_count == 1 && !r->membrane ? 2 : 0);
}

double sonde_refit_prior_row(const sonde_refit *r, sonde_smoothness s, uint32_t k, double *row,
                             double *target) {
  uint32_t count = r->sites->count, field = k / count, at = k % count;
  SONDE_ASSERT(k < sonde_refit_prior_rows(r));
  memset(row, 0, sonde_refit_parameters(r) * sizeof *row);
  *target = 0;
  if (k >= field_rows(r)) { // ln G - mean ln k0, then ln gm
    bool limit = k > field_rows(r);
    row[sonde_refit_parameters(r) - (limit ? 1 : 2)] = 1;
    for (uint32_t t = 0; t < count && !limit; ++t) row[t] = -1.0 / count;
    *target = limit ? log(LIMIT_MIDDLE) : 2 * log(DENT_LENGTH_M);
    double sd = limit ? LIMIT_SD : DENT_SD;
    return 1 / (sd * sd);
  }
  uint32_t last = field_rows(r) - k; // the means of the shares come last
  if (r->fields > 2 && last <= r->fields - 2) {
    for (uint32_t t = 0; t < count; ++t) row[(r->fields - last) * count + t] = 1.0 / count;
    return 1 / (MEAN_SD * MEAN_SD);
  }
  if (field >= r->fields) {
    row[(field - r->fields + 2) * count + at] = 1;
    return 1 / (SHARE_SD * SHARE_SD);
  }
  double sd = field < 2 ? s.normal_sd : s.shear_sd;
  memcpy(row + field * count, &r->roughness[(size_t)at * count], count * sizeof *row);
  return 1 / (sd * sd);
}

double sonde_refit_add_prior(const sonde_refit *r, const double *theta, sonde_smoothness s,
                             double *row, sonde_normal *normal) {
  uint32_t n = sonde_refit_parameters(r), count = r->sites->count;
  double cost = 0;
  SONDE_ASSERT(!normal || normal->n == n);
  for (uint32_t k = 0; k < sonde_refit_prior_rows(r); ++k) {
    double target, weight = sonde_refit_prior_row(r, s, k, row, &target), residual = -target;
    // A row has entries in one field, or anywhere.
    uint32_t begin = 0, end = n, field = k / count, last = field_rows(r) - k;
    if (k < field_rows(r)) {
      bool mean = r->fields > 2 && last <= r->fields - 2;
      if (mean) field = r->fields - last;
      begin = (mean || field < r->fields ? field : field - r->fields + 2) * count;
      end = begin + count;
    }
    for (uint32_t t = begin; t < end; ++t) residual += row[t] * theta[t];
    cost += 0.5 * weight * residual * residual;
    for (uint32_t i = begin; normal && i < end; ++i) {
      double scaled = weight * row[i];
      normal->gradient[i] += scaled * residual;
      for (uint32_t j = begin; j <= i; ++j) normal->matrix[(size_t)i * n + j] += scaled * row[j];
    }
  }
  SONDE_ASSERT(isfinite(cost));
  return cost;
}
