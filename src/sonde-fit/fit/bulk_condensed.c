// What a linear solid costs when it is condensed to its skin, and whether it is the same solid.
#include "sonde/fit_bulk.h"

#include "elements/condense.h"
#include "fit/press.h"
#include "tissue/bulk/bulk.h"

#include "base/clock.h"
#include "base/maths.h"
#include "base/order.h"

#include <string.h>

enum { REPEATS = 15 };

typedef struct contact {
  uint32_t *places; // of the touched nodes in the condensed list
  double *u, *f, *skin_u, *full_f, *full_u;
} contact;

// Forces on the touched nodes and displacements of the skin, many times; medians.
static sonde_status time_contact(const sonde_condensed *c, contact *at, uint32_t count,
                                 sonde_condensed_cost *cost, sonde_error *error) {
  double forces_s[REPEATS], update_s[REPEATS];
  size_t side = 3 * (size_t)c->count;
  sonde_status status = SONDE_OK;
  for (int k = 0; k < REPEATS && !status; ++k) {
    double start = sonde_clock_now();
    status = sonde_condensed_forces(c, at->places, count, at->u, at->f, error);
    forces_s[k] = sonde_clock_now() - start;
    // The compliance is symmetric: its rows are its columns.
    memset(at->skin_u, 0, side * sizeof *at->skin_u);
    for (uint32_t n = 0; n < 3 * count; ++n) {
      const double *row = c->compliance + (3 * (size_t)at->places[n / 3] + n % 3) * side;
      for (size_t i = 0; i < side; ++i) at->skin_u[i] += at->f[n] * row[i];
    }
    update_s[k] = sonde_clock_now() - start - forces_s[k];
  }
  qsort(forces_s, REPEATS, sizeof *forces_s, sonde_compare_reals);
  qsort(update_s, REPEATS, sizeof *update_s, sonde_compare_reals);
  cost->contact_s = forces_s[REPEATS / 2], cost->update_s = update_s[REPEATS / 2];
  return status;
}

// The same displacements imposed on the whole solid.
static sonde_status solve_whole(const sonde_elastic *elastic, const sonde_bonded *bonded,
                                contact *at, double *difference, sonde_error *error) {
  sonde_elastic_scratch *scratch = NULL;
  uint32_t count = bonded->held_count;
  sonde_status status = sonde_elastic_scratch_create(elastic, &scratch, error);
  for (uint32_t k = 0; k < count && !status; ++k)
    for (int c = 0; c < 3; ++c)
      at->full_u[3 * elastic->unknown[bonded->held[k]] + (uint32_t)c] = at->u[3 * k + (uint32_t)c];
  if (!status)
    status =
        sonde_elastic_solve(elastic, scratch, bonded->held, count, at->full_f, at->full_u, error);
  double off2 = 0, all2 = 0;
  for (uint32_t k = 0; k < 3 * count; ++k) {
    double whole = at->full_f[3 * elastic->unknown[bonded->held[k / 3]] + k % 3];
    off2 += (whole - at->f[k]) * (whole - at->f[k]), all2 += whole * whole;
  }
  *difference = sqrt(off2 / all2);
  sonde_elastic_scratch_destroy(scratch);
  return status;
}

static sonde_status measure(sonde_bonded *bonded, double depth_m, uint32_t threads,
                            const sonde_elastic *elastic, contact *at, sonde_condensed_cost *cost,
                            sonde_error *error) {
  sonde_condensed *c = NULL;
  uint32_t count = bonded->held_count;
  double start = sonde_clock_now();
  sonde_status status = sonde_condensed_create(elastic, threads, &c, NULL, error);
  if (status) return status;
  cost->setup_s = sonde_clock_now() - start;
  size_t side = 3 * (size_t)c->count;
  cost->bytes = 2 * (double)side * (double)side * sizeof(double);
  for (uint32_t k = 0; k < count; ++k) {
    uint32_t place = 0;
    while (c->node[place] != bonded->held[k]) ++place;
    at->places[k] = place;
    const double move[3] = {bonded->normal.x, bonded->normal.y, bonded->normal.z};
    for (int i = 0; i < 3; ++i) at->u[3 * k + (uint32_t)i] = -depth_m * move[i];
  }
  status = time_contact(c, at, count, cost, error);
  for (uint32_t k = 0; k < count; ++k)
    cost->force_n -= at->f[3 * k] * bonded->normal.x + at->f[3 * k + 1] * bonded->normal.y +
                     at->f[3 * k + 2] * bonded->normal.z;
  if (!status) status = solve_whole(elastic, bonded, at, &cost->solve_difference, error);
  double engine_n = sonde_bonded_force(bonded, depth_m);
  if (!status && isnan(engine_n))
    status =
        sonde_fail(error, SONDE_CONVERGENCE,
                   "the engine finds no equilibrium of the whole solid at %g mm", 1e3 * depth_m);
  cost->engine_difference = fabs(engine_n / cost->force_n - 1);
  sonde_condensed_destroy(c);
  return status;
}

sonde_status sonde_condensed_measure(const sonde_model *model, const sonde_site *site,
                                     double half_u_m, double half_v_m, double depth_m,
                                     uint32_t threads, sonde_condensed_cost *cost,
                                     sonde_error *error) {
  *cost = (sonde_condensed_cost){0};
  if (model->kind != SONDE_LINEAR_SOLID)
    return sonde_fail(error, SONDE_ARGUMENT, "only a linear solid can be condensed");
  const sonde_bulk *bulk = model->bulk;
  uint32_t skin = model->surface.vertex_count, all = bulk->node_count + bulk->held_count;
  sonde_bulk_elastic solid;
  sonde_status status = sonde_bulk_elastic_create(model, &solid, error);
  if (status) return status;
  contact at = {SONDE_NEW(uint32_t, skin),           SONDE_NEW(double, 3 * (size_t)skin),
                SONDE_NEW(double, 3 * (size_t)skin), SONDE_NEW(double, 3 * (size_t)skin),
                SONDE_NEW(double, 3 * (size_t)all),  SONDE_NEW(double, 3 * (size_t)all)};
  if (!at.places || !at.u || !at.f || !at.skin_u || !at.full_f || !at.full_u)
    status = sonde_fail_memory(error);
  sonde_bonded bonded = {0};
  if (!status)
    status = sonde_bonded_create_on(model, site, half_u_m, half_v_m, 1e-8, 200, &bonded, error);
  if (!status) {
    cost->nodes = bulk->node_count, cost->skin_nodes = skin;
    cost->contact_nodes = bonded.held_count;
    status = measure(&bonded, depth_m, threads, solid.elastic, &at, cost, error);
    sonde_bonded_clear(&bonded);
  }
  sonde_elastic_destroy(solid.elastic);
  void *arrays[] = {at.places, at.u, at.f, at.skin_u, at.full_f, at.full_u};
  for (size_t k = 0; k < SONDE_COUNT_OF(arrays); ++k) sonde_free(arrays[k]);
  return status;
}
