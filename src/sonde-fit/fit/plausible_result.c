// The result of a fit judged against known ranges.
#include "fit/plausible.h"
#include "fit/fit_inside.h"

#include "base/maths.h"

#include <string.h>

enum { QUARTERS = 4 };
static const double MOST_THROUGH_M = 2; // no body is thicker

typedef struct quarter {
  double error_n, force_n;
  uint32_t count;
} quarter;

// Thickness of the body below a site, and of the tissue: to the bone when there is one.
static void judge_geometry(const sonde_model *model, const sonde_surface_index *skin,
                           const sonde_measurements *m, const sonde_site *site,
                           sonde_doubts *doubts) {
  const sonde_datum *row = NULL;
  sonde_surface_point far;
  double deepest_m = 0;
  for (uint32_t i = 0; i < m->count; ++i)
    if (m->data[i].site == site->id && m->data[i].penetration_m > deepest_m)
      deepest_m = m->data[i].penetration_m, row = &m->data[i];
  if (!row) return;
  sonde_vec3 in = v_neg(site->normal), from = v_madd(site->position_m, 6e-3, in);
  if (!sonde_surface_raycast(skin, from, in, MOST_THROUGH_M, &far)) return;
  double through_m = v_distance(site->position_m, far.point_m), bone_m = through_m;
  uint32_t near = v_nearest(model->surface.vertices, model->surface.vertex_count, site->position_m);
  if (model->femur.vertex_count) bone_m = model->bone_depth_m[near];
  SONDE_ASSERT(through_m > 0);
  sonde_doubt_grade grade;
  sonde_doubt *d = NULL;
  if (!sonde_plausible(QUANTITY_SHARE, row->penetration_m / through_m, &grade))
    d = sonde_doubt_add(doubts, "deeper_than_the_body", grade, m, row);
  if (d)
    snprintf(d->sentence, sizeof d->sentence,
             "a penetration of %.3g mm where the body is %.3g mm thick, expected at most %.0f %% "
             "of it",
             1e3 * row->penetration_m, 1e3 * through_m,
             100 * sonde_plausible_range_of(QUANTITY_SHARE)->high);
  SONDE_ASSERT(bone_m > 0);
  double share = site->xm_m / bone_m;
  const sonde_plausible_range *r = sonde_plausible_range_of(QUANTITY_ASYMPTOTE);
  if (sonde_plausible(QUANTITY_ASYMPTOTE, share, &grade)) return;
  d = sonde_doubt_add(doubts, "asymptote", SONDE_DOUBT_WARNING, m, row);
  if (!d) return;
  d->line = 0; // of the whole curve
  snprintf(d->sentence, sizeof d->sentence,
           "the asymptote x_m is %.3g mm in %.3g mm of tissue, expected %g to %g times as much: %s",
           1e3 * site->xm_m, 1e3 * bone_m, r->low, r->high,
           share > r->high ? "the curve hardly stiffens" : "the depths may be in another unit");
}

sonde_status sonde_fit_examine(const sonde_model *model, const sonde_measurements *m,
                               const sonde_fit_result *result, sonde_doubts *doubts,
                               sonde_error *error) {
  sonde_surface_index *skin;
  sonde_status status = sonde_surface_index_create(&model->surface, &skin, error);
  if (status) return status;
  const sonde_error_report *report = &result->stage3; // the only stage that follows the forces
  for (uint32_t p = 0; p < report->probe_count; ++p) {
    quarter part[QUARTERS];
    double worst = 0;
    int at = 0;
    memset(part, 0, sizeof part);
    // Errors and forces by quarters of the probe's deepest penetration.
    double deepest_m = 0;
    for (uint32_t i = 0; i < m->count; ++i)
      if (strcmp(m->data[i].probe, report->probe[p]) == 0)
        deepest_m = fmax(deepest_m, m->data[i].penetration_m);
    for (uint32_t i = 0; i < m->count && deepest_m > 0; ++i) {
      const sonde_datum *row = &m->data[i];
      if (strcmp(row->probe, report->probe[p]) != 0 || !isfinite(result->model_n[i])) continue;
      int q = (int)(QUARTERS * row->penetration_m / deepest_m);
      quarter *to = &part[q < QUARTERS ? q : QUARTERS - 1];
      to->error_n += result->model_n[i] - row->force_n;
      to->force_n += row->force_n;
      to->count++;
    }
    for (int q = 0; q < QUARTERS; ++q) {
      double bias = part[q].force_n > 0 ? part[q].error_n / part[q].force_n : 0;
      if (fabs(bias) > fabs(worst)) worst = bias, at = q;
    }
    sonde_doubt_grade grade;
    if (sonde_plausible(QUANTITY_BIAS, worst, &grade)) continue;
    sonde_doubt *d = sonde_doubt_add(doubts, "residuals_with_depth", SONDE_DOUBT_WARNING, m, NULL);
    if (!d) continue;
    const sonde_plausible_range *r = sonde_plausible_range_of(QUANTITY_BIAS);
    snprintf(d->sentence, sizeof d->sentence,
             "residuals of probe %s run with depth: the model is %+.0f %% off in quarter %d of the "
             "depths, expected within %.0f %%: contact zero, tare, or a law that does not fit",
             report->probe[p], 100 * worst, at + 1, 100 * r->high);
  }
  for (uint32_t s = 0; s < result->site_count; ++s)
    judge_geometry(model, skin, m, &result->sites[s], doubts);
  sonde_surface_index_destroy(skin);
  return SONDE_OK;
}
