// Contact zero and tare of each curve, eliminated from the normal equations.
#include "fit/refit_offset.h"

#include "base/maths.h"

#include <string.h>

sonde_status sonde_offsets_create(const sonde_refit *r, sonde_offsets **offsets,
                                  sonde_error *error) {
  const double sd[OFFSETS] = {r->def->zero_sd_m, r->def->tare_sd_n};
  uint32_t curves = r->plan->curve_count, rows = r->plan->row_count;
  *offsets = NULL;
  if (!(sd[OFFSET_ZERO] > 0 || sd[OFFSET_TARE] > 0)) return SONDE_OK;
  sonde_offsets *o = *offsets = SONDE_NEW(sonde_offsets, 1);
  if (!o) return sonde_fail_memory(error);
  for (int k = 0; k < OFFSETS; ++k) o->precision[k] = sd[k] > 0 ? 1 / (sd[k] * sd[k]) : INFINITY;
  o->now = sonde_calloc(curves, sizeof *o->now);
  o->kept = sonde_calloc(curves, sizeof *o->kept);
  o->inverse = sonde_calloc(curves, sizeof *o->inverse);
  o->gradient = sonde_calloc(curves, sizeof *o->gradient);
  o->slope_n_m = SONDE_NEW(double, rows);
  o->kept_slope_n_m = SONDE_NEW(double, rows);
  o->coupling = SONDE_NEW(double, (size_t)curves *OFFSETS *sonde_refit_parameters(r));
  bool ok = o->now && o->kept && o->inverse && o->gradient && o->slope_n_m && o->kept_slope_n_m &&
            o->coupling;
  return ok ? SONDE_OK : sonde_fail_memory(error);
}

void sonde_offsets_destroy(sonde_offsets *o) {
  if (!o) return;
  sonde_free(o->now);
  sonde_free(o->kept);
  sonde_free(o->inverse);
  sonde_free(o->gradient);
  sonde_free(o->slope_n_m);
  sonde_free(o->kept_slope_n_m);
  sonde_free(o->coupling);
  sonde_free(o);
}

void sonde_offsets_set(sonde_refit *r, const sonde_curve_fit *curves) {
  for (uint32_t c = 0; r->offsets && c < r->plan->curve_count; ++c) {
    r->offsets->now[c][OFFSET_ZERO] = r->offsets->kept[c][OFFSET_ZERO] = curves[c].zero_m;
    r->offsets->now[c][OFFSET_TARE] = r->offsets->kept[c][OFFSET_TARE] = curves[c].tare_n;
  }
}

double sonde_offsets_depth(const sonde_refit *r, uint32_t row) {
  SONDE_ASSERT(row < r->plan->row_count);
  double depth_m = r->m->data[r->plan->row[row]].penetration_m;
  if (!r->offsets) return depth_m;
  return fmax(depth_m - r->offsets->now[r->plan->row_curve[row]][OFFSET_ZERO], 0);
}

double sonde_offsets_tare(const sonde_refit *r, uint32_t row) {
  return r->offsets ? r->offsets->now[r->plan->row_curve[row]][OFFSET_TARE] : 0;
}

double sonde_offsets_cost(const sonde_refit *r) {
  const sonde_offsets *o = r->offsets;
  double cost = 0;
  for (uint32_t c = 0; o && c < r->plan->curve_count; ++c)
    for (int k = 0; k < OFFSETS; ++k)
      if (isfinite(o->precision[k])) cost += 0.5 * o->precision[k] * o->now[c][k] * o->now[c][k];
  return cost;
}

void sonde_offsets_eliminate(sonde_refit *r, const double *force_n, const double *jacobian,
                             sonde_normal *normal) {
  sonde_offsets *o = r->offsets;
  if (!o) return;
  uint32_t n = normal->n;
  SONDE_ASSERT(n == sonde_refit_parameters(r) && force_n && jacobian);
  o->fall = 0;
  for (uint32_t c = 0; c < r->plan->curve_count; ++c) {
    double *b = o->coupling + (size_t)c * OFFSETS * n, *g = o->gradient[c], own[3] = {0};
    memset(b, 0, OFFSETS * n * sizeof *b);
    for (int k = 0; k < OFFSETS; ++k)
      g[k] = isfinite(o->precision[k]) ? o->precision[k] * o->now[c][k] : 0;
    for (uint32_t k = r->plan->curve_start[c]; k < r->plan->curve_start[c + 1]; ++k) {
      if (!sonde_refit_uses(r, k)) continue;
      sonde_refit_row row = sonde_refit_weigh(r, k, force_n[k]);
      // A probe above the skin feels nothing, wherever the zero is.
      bool slides = sonde_offsets_depth(r, k) > 0 && isfinite(o->precision[OFFSET_ZERO]);
      const double slope[OFFSETS] = {[OFFSET_ZERO] = slides ? -o->kept_slope_n_m[k] : 0,
                                     [OFFSET_TARE] = isfinite(o->precision[OFFSET_TARE])};
      own[0] += row.weight * slope[0] * slope[0];
      own[1] += row.weight * slope[0] * slope[1];
      own[2] += row.weight * slope[1] * slope[1];
      for (uint32_t s = 0; s < OFFSETS; ++s) {
        double w = row.weight * slope[s];
        g[s] += w * row.error_n;
        for (uint32_t i = 0; i < n && w != 0; ++i) b[s * n + i] += w * jacobian[(size_t)k * n + i];
      }
    }
    for (int k = 0; k < OFFSETS; ++k) own[2 * k] += isfinite(o->precision[k]) ? o->precision[k] : 1;
    double determinant = own[0] * own[2] - own[1] * own[1], *a = o->inverse[c];
    SONDE_ASSERT(determinant > 0);
    a[0] = own[2] / determinant;
    a[1] = -own[1] / determinant;
    a[2] = own[0] / determinant;
    // With A the curve's own equations, B their coupling and g their gradient: matrix - B^T A^-1 B,
    // gradient - B^T A^-1 g.
    double ag[OFFSETS] = {a[0] * g[0] + a[1] * g[1], a[1] * g[0] + a[2] * g[1]};
    o->fall += 0.5 * (g[0] * ag[0] + g[1] * ag[1]);
    for (uint32_t i = 0; i < n; ++i) {
      double x = b[i], y = b[n + i], ax = a[0] * x + a[1] * y, ay = a[1] * x + a[2] * y;
      normal->gradient[i] -= x * ag[0] + y * ag[1];
      double *row = normal->matrix + (size_t)i * n;
      for (uint32_t j = 0; j <= i; ++j) row[j] -= ax * b[j] + ay * b[n + j];
    }
  }
}

void sonde_offsets_try(sonde_refit *r, const double *step, double share) {
  sonde_offsets *o = r->offsets;
  uint32_t n = sonde_refit_parameters(r);
  SONDE_ASSERT(step && share > 0 && share <= 1);
  for (uint32_t c = 0; o && c < r->plan->curve_count; ++c) {
    const double *b = o->coupling + (size_t)c * OFFSETS * n, *a = o->inverse[c];
    double x = o->gradient[c][0], y = o->gradient[c][1];
    for (uint32_t i = 0; i < n; ++i) x += b[i] * step[i], y += b[n + i] * step[i];
    o->now[c][0] = o->kept[c][0] - share * (a[0] * x + a[1] * y);
    o->now[c][1] = o->kept[c][1] - share * (a[1] * x + a[2] * y);
  }
}

void sonde_offsets_accept(sonde_refit *r) {
  sonde_offsets *o = r->offsets;
  if (!o) return;
  memcpy(o->kept, o->now, r->plan->curve_count * sizeof *o->now);
  double *swap = o->kept_slope_n_m;
  o->kept_slope_n_m = o->slope_n_m;
  o->slope_n_m = swap;
}

void sonde_offsets_return(sonde_refit *r) {
  if (r->offsets)
    memcpy(r->offsets->now, r->offsets->kept, r->plan->curve_count * sizeof *r->offsets->now);
}
