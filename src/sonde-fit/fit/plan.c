// The rows of an estimation by site, probe and depth, and those that take no part.
#include "fit/fit_inside.h"

#include "base/elementary.h"
#include <string.h>

typedef struct sort_key {
  uint32_t site, probe, row;
  double depth_m;
} sort_key;

static int compare_keys(const void *a, const void *b) {
  const sort_key *p = a, *q = b;
  if (p->site != q->site) return p->site < q->site ? -1 : 1;
  if (p->probe != q->probe) return p->probe < q->probe ? -1 : 1;
  int depth = (p->depth_m > q->depth_m) - (p->depth_m < q->depth_m);
  return depth ? depth : (p->row > q->row) - (p->row < q->row);
}

// Fills keys and the probes' mean forces; left_out may be NULL.
static sonde_status make_keys(const sonde_site_table *sites, const sonde_measurements *m,
                              const bool *left_out, sonde_fit_plan *plan, sort_key *keys,
                              sonde_error *error) {
  uint32_t rows_of[SONDE_FIT_PROBES] = {0};
  for (uint32_t i = 0; i < m->count; ++i) {
    if (left_out && left_out[i]) continue;
    const sonde_datum *d = &m->data[i];
    uint32_t site = sonde_site_find(sites, d->site);
    uint32_t probe = sonde_probe_index(plan->probe, &plan->probe_count, d->probe);
    if (site == UINT32_MAX)
      return sonde_fail(error, SONDE_MISMATCH, "measurement %u: site %u is not in the site table",
                        i, d->site);
    if (probe == UINT32_MAX)
      return sonde_fail(error, SONDE_ARGUMENT, "more than %d probes in one set of measurements",
                        SONDE_FIT_PROBES);
    if (!(d->penetration_m >= 0 && d->penetration_m <= 1 && fabs(d->force_n) <= 1e6))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "measurement %u: %g m and %g N, expected 0 to 1 m and at most 1e6 N", i,
                        d->penetration_m, d->force_n);
    keys[plan->row_count++] = (sort_key){site, probe, i, d->penetration_m};
    plan->mean_force_n[probe] += d->force_n;
    ++rows_of[probe];
  }
  for (uint32_t p = 0; p < plan->probe_count; ++p) {
    SONDE_ASSERT(rows_of[p] > 0);
    plan->mean_force_n[p] /= rows_of[p];
  }
  return SONDE_OK;
}

static sonde_status arrange(const sonde_site_table *sites, const sonde_measurements *m,
                            const bool *left_out, sonde_fit_plan *plan, sonde_error *error) {
  *plan = (sonde_fit_plan){0};
  if (!m->count) return sonde_fail(error, SONDE_ARGUMENT, "no measurements, expected at least one");
  sort_key *keys = SONDE_NEW(sort_key, m->count);
  plan->row = SONDE_NEW(uint32_t, m->count);
  plan->row_probe = SONDE_NEW(uint32_t, m->count);
  plan->row_curve = SONDE_NEW(uint32_t, m->count);
  plan->curve_start = SONDE_NEW(uint32_t, m->count + 1);
  plan->curve_site = SONDE_NEW(uint32_t, m->count);
  plan->curve_probe = SONDE_NEW(uint32_t, m->count);
  plan->site_start = SONDE_NEW(uint32_t, m->count + 1);
  plan->site_index = SONDE_NEW(uint32_t, m->count);
  plan->site_deepest_m = SONDE_NEW(double, m->count);
  sonde_status status = keys && (plan->row && plan->row_probe && plan->row_curve &&
                                 plan->curve_start && plan->curve_site && plan->curve_probe &&
                                 plan->site_start && plan->site_index && plan->site_deepest_m)
                            ? SONDE_OK
                            : sonde_fail_memory(error);
  if (!status) status = make_keys(sites, m, left_out, plan, keys, error);
  for (uint32_t p = 0; p < plan->probe_count && !status; ++p) {
    sonde_probe probe;
    status = sonde_probe_create(plan->probe[p], &probe, error);
    if (status) break;
    plan->half_u_m[p] = probe.half_x_m;
    plan->half_v_m[p] = probe.half_y_m;
    if (!probe.rectangular)
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "probe '%s' has no rectangular footprint, expected one that has",
                          plan->probe[p]);
    sonde_probe_clear(&probe);
  }
  if (!status) qsort(keys, plan->row_count, sizeof *keys, compare_keys);
  // Sites and curves begin where the sorted keys change.
  uint32_t curve = UINT32_MAX, site = UINT32_MAX; // wrap to 0 at the first row
  for (uint32_t r = 0; r < plan->row_count && !status; ++r) {
    bool new_site = r == 0 || keys[r].site != keys[r - 1].site;
    if (new_site) {
      plan->site_start[++site] = r;
      plan->site_index[site] = keys[r].site;
    }
    if (new_site || keys[r].probe != keys[r - 1].probe) {
      plan->curve_start[++curve] = r;
      plan->curve_site[curve] = keys[r].site;
      plan->curve_probe[curve] = keys[r].probe;
    } else {
      plan->unsorted_rows += keys[r].row < keys[r - 1].row;
    }
    plan->row[r] = keys[r].row;
    plan->row_probe[r] = keys[r].probe;
    plan->row_curve[r] = curve;
    plan->site_deepest_m[site] = fmax(plan->site_deepest_m[site], keys[r].depth_m);
  }
  if (!status) {
    plan->curve_count = curve + 1;
    SONDE_ASSERT(plan->curve_count <= plan->row_count && curve >= site);
    plan->site_count = site + 1;
    plan->curve_start[plan->curve_count] = plan->site_start[plan->site_count] = plan->row_count;
  }
  sonde_free(keys);
  if (status) sonde_fit_plan_clear(plan);
  return status;
}

sonde_status sonde_fit_plan_create_all(const sonde_site_table *sites, const sonde_measurements *m,
                                       sonde_fit_plan *plan, sonde_error *error) {
  sonde_status status = arrange(sites, m, NULL, plan, error);
  if (!status && plan->unsorted_rows)
    sonde_log(SONDE_LOG_INFO, "%u measurements stood out of order of penetration and were sorted",
              plan->unsorted_rows);
  return status;
}

// ---- what a fit leaves out ----------------------------------------------------------------

typedef enum reason { FIT, TOO_SHORT, NO_FORCE, REASONS } reason;

sonde_status sonde_fit_plan_create(const sonde_site_table *sites, const sonde_measurements *m,
                                   sonde_fit_plan *plan, sonde_error *error) {
  sonde_status status = sonde_fit_plan_create_all(sites, m, plan, error);
  if (status) return status;
  sonde_fit_plan excluded = {0};
  bool *left_out = SONDE_NEW(bool, m->count);
  if (left_out) {
    // Marks the rows of unfit curves; the counts go to `excluded`.
    uint32_t curves[REASONS] = {0}, rows[REASONS] = {0};
    const sonde_datum *first[REASONS] = {NULL};
    for (uint32_t c = 0; c < plan->curve_count; ++c) {
      uint32_t start = plan->curve_start[c], end = plan->curve_start[c + 1], steps = 0;
      double force_n = 0;
      for (uint32_t r = start; r < end; ++r) {
        const sonde_datum *d = &m->data[plan->row[r]];
        steps += d->penetration_m > 0;
        force_n += d->force_n;
      }
      reason why = steps < SONDE_FIT_LEAST_STEPS ? TOO_SHORT : force_n > 0 ? FIT : NO_FORCE;
      if (!curves[why]++) first[why] = &m->data[plan->row[start]];
      rows[why] += end - start;
      for (uint32_t r = start; r < end && why != FIT; ++r) left_out[plan->row[r]] = true;
    }
    for (int why = TOO_SHORT; why < REASONS; ++why) {
      if (!curves[why]) continue;
      char text[64] = "their mean force is not positive";
      if (why == TOO_SHORT)
        snprintf(text, sizeof text, "fewer than %d steps", SONDE_FIT_LEAST_STEPS);
      sonde_log(SONDE_LOG_WARNING,
                "%u curves (%u rows) are left out: %s; the first is site %u, probe %s", curves[why],
                rows[why], text, first[why]->site, first[why]->probe);
      excluded.excluded_curves += curves[why];
      excluded.excluded_rows += rows[why];
    }
    SONDE_ASSERT(excluded.excluded_rows <= m->count);
    if (excluded.excluded_rows == m->count) {
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "none of the %u curves can be fitted, expected at least one of %d steps "
                          "with a positive mean force",
                          excluded.excluded_curves, SONDE_FIT_LEAST_STEPS);
    } else if (excluded.excluded_rows) {
      sonde_fit_plan_clear(plan);
      status = arrange(sites, m, left_out, plan, error);
      plan->excluded_curves = excluded.excluded_curves;
      plan->excluded_rows = excluded.excluded_rows;
    }
  } else {
    status = sonde_fail_memory(error);
  }
  sonde_free(left_out);
  if (status) sonde_fit_plan_clear(plan);
  if (!status && plan->probe_count == 1)
    sonde_log(SONDE_LOG_WARNING,
              "one probe only (%s): edge stiffness, or shear layer, and local springs are not told "
              "apart; stage 3 keeps the layer near a thigh's",
              plan->probe[0]);
  return status;
}

void sonde_fit_plan_clear(sonde_fit_plan *plan) {
  sonde_free(plan->row);
  sonde_free(plan->row_probe);
  sonde_free(plan->row_curve);
  sonde_free(plan->curve_start);
  sonde_free(plan->curve_site);
  sonde_free(plan->curve_probe);
  sonde_free(plan->site_start);
  sonde_free(plan->site_index);
  sonde_free(plan->site_deepest_m);
  *plan = (sonde_fit_plan){0};
}
