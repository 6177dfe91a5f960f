// Which figures one probe and all probes determine, from the curvature at the common optimum.
#include "fit/nearby_refit.h"
#include "sonde/fit_confidence.h"

#include "base/maths.h"

#include <string.h>

enum { FIGURES = 4, SWEEPS = 30 };

// Largest over smallest eigenvalue.
static double condition_of(const double matrix[FIGURES][FIGURES]) {
  double m[FIGURES][FIGURES], least = INFINITY, most = 0;
  memcpy(m, matrix, sizeof m);
  for (int sweep = 0; sweep < SWEEPS; ++sweep)
    for (int p = 0; p < FIGURES; ++p)
      for (int q = p + 1; q < FIGURES; ++q) {
        // One rotation clears entry (p, q) of the symmetric matrix.
        double angle = 0.5 * atan2(2 * m[p][q], m[q][q] - m[p][p]), c = cos(angle), s = sin(angle);
        for (int k = 0; k < FIGURES; ++k) {
          double a = m[k][p], b = m[k][q];
          m[k][p] = c * a - s * b;
          m[k][q] = s * a + c * b;
        }
        for (int k = 0; k < FIGURES; ++k) {
          double a = m[p][k], b = m[q][k];
          m[p][k] = c * a - s * b;
          m[q][k] = s * a + c * b;
        }
      }
  for (int k = 0; k < FIGURES; ++k) {
    least = fmin(least, m[k][k]);
    most = fmax(most, m[k][k]);
  }
  return least > 0 ? most / least : INFINITY;
}

// The combination of parameters that is figure k: ln G, ln gm, mean ln k0, mean ln xm.
static void row_of(const sonde_nearby_refit *a, int k, double *row) {
  uint32_t n = a->parameters, sites = a->refit->sites->count;
  memset(row, 0, n * sizeof *row);
  if (k < 2)
    row[n - 2 + (uint32_t)k] = 1;
  else
    for (uint32_t s = 0; s < sites; ++s) row[(k == 3 ? sites : 0) + s] = 1.0 / sites;
}

sonde_status sonde_fit_identify(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *measurements, const sonde_fit_def *def,
                                const sonde_fit_result *result, const sonde_progress *progress,
                                sonde_fit_identifiability *identifiability, sonde_error *error) {
  sonde_nearby_refit again;
  *identifiability = (sonde_fit_identifiability){0};
  sonde_status status =
      sonde_nearby_refit_create(model, sites, measurements, def, result, &again, error);
  if (status) return status;
  double *row = SONDE_NEW(double, again.parameters);
  if (!row) status = sonde_fail_memory(error);
  uint32_t first = again.plan.probe_count > 1 ? 0 : again.plan.probe_count;
  // The curvature is taken at the common optimum, before any step: there the information of the
  // probes adds up. The last part has the rows of all probes.
  for (uint32_t p = first; p <= again.plan.probe_count && !status; ++p) {
    sonde_fit_part *part = &identifiability->part[identifiability->count++];
    bool all = p == again.plan.probe_count;
    for (uint32_t k = 0; k < again.plan.row_count; ++k)
      again.left_out[k] = !all && again.plan.row_probe[k] != p;
    if (!all) snprintf(part->probe, sizeof part->probe, "%s", again.plan.probe[p]);
    again.refit->left_out = again.left_out;
    again.refit->near = true;
    again.refit->enough = INFINITY; // any promise ends the refit where it begins
    sonde_refit_result found;
    status = sonde_nearby_refit_run(&again, progress, &found, error);
    if (status) break;

    // Deviations and correlations from the curvature.
    double spread[FIGURES][FIGURES];
    bool known = sonde_nearby_refit_factor(&again);
    for (int k = 0; k < FIGURES; ++k) {
      row_of(&again, k, row);
      part->ln_sd[k] = known ? sqrt(sonde_nearby_refit_spread(&again, row)) : INFINITY;
      for (int j = 0; j < FIGURES && known; ++j) {
        row_of(&again, j, row);
        spread[k][j] = 0;
        for (uint32_t i = 0; i < again.parameters; ++i) spread[k][j] += row[i] * again.step[i];
      }
    }
    for (int k = 0; k < FIGURES; ++k)
      for (int j = 0; j < FIGURES; ++j)
        part->correlation[k][j] = known ? spread[k][j] / (part->ln_sd[k] * part->ln_sd[j]) : NAN;
    part->condition = known ? condition_of((const double(*)[FIGURES])part->correlation) : INFINITY;
  }
  sonde_free(row);
  sonde_nearby_refit_clear(&again);
  return status;
}
