// Stiffness of footprints with its derivatives, and the fit of moduli to it.
#include "elements/moduli.h"
#include "elements/condense.h"
#include "base/base.h"
#include "base/maths.h"
#include "base/parallel.h"
#include "sparse/dense.h"

#include <string.h>

enum { GROUPS = 8, ROUNDS = 20 };  // the skin counts as a group
static const double CLOSE = 1e-6;  // change of ln E that ends the fit
static const double FLAT = 1e-5;   // share of the misfit whose loss ends it
static const double LONGEST = 1.5; // step of ln E

typedef struct fit {
  sonde_elastic *elastic;
  double poisson;
  const uint32_t *group;
  uint32_t group_count, unknowns;
  const sonde_bonded_footprint *footprints;
  uint32_t count, workers;
  bool all_last;                   // the footprints' nodes are those that the solid numbers last
  sonde_condensed *condensed;      // on these nodes, with the moduli at hand
  sonde_elastic_scratch **scratch; // [workers]
  double **vectors;                // [workers] force and displacement
  double *young;                   // [tetrahedra]
  double *stiffness;               // [count]
  double (*slope)[GROUPS];         // [count] by ln E
} fit;

// Forces f [3 count] of a footprint's nodes at unit depth, from the condensed compliance.
static sonde_status find_forces(const fit *t, const sonde_bonded_footprint *p, double *f,
                                sonde_error *error) {
  const uint32_t first = t->elastic->count - t->elastic->last_count;
  uint32_t *places = SONDE_NEW(uint32_t, p->count);
  double *x = SONDE_NEW(double, 3 * (size_t)p->count);
  sonde_status status = places && x ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t k = 0; k < p->count && !status; ++k) {
    places[k] = t->elastic->unknown[p->nodes[k]] - first;
    x[3 * k] = p->inward.x, x[3 * k + 1] = p->inward.y, x[3 * k + 2] = p->inward.z;
  }
  if (!status) status = sonde_condensed_forces(t->condensed, places, p->count, x, x, error);
  for (uint32_t k = 0; k < p->count && !status; ++k)
    memcpy(f + 3 * (size_t)(first + places[k]), x + 3 * (size_t)k, 3 * sizeof *x);
  sonde_free(places);
  sonde_free(x);
  return status;
}

// The work of a unit depth is the stiffness, and so are their derivatives.
static sonde_status measure_footprint(void *user, uint32_t worker, uint32_t item,
                                      const atomic_bool *stop, sonde_error *error) {
  const fit *t = user;
  (void)stop;
  const sonde_elastic *e = t->elastic;
  const sonde_bonded_footprint *p = &t->footprints[item];
  const size_t n = 3 * (size_t)e->count;
  double *f = t->vectors[worker], *u = f + n;
  memset(f, 0, 2 * n * sizeof *f);
  sonde_status status = SONDE_OK;
  if (t->condensed) {
    // Under known forces the factor needs a few steps only.
    status = find_forces(t, p, f, error);
    if (!status) status = sonde_elastic_solve(e, t->scratch[worker], NULL, 0, f, u, error);
  } else {
    for (uint32_t k = 0; k < p->count; ++k) {
      double *to = u + 3 * (size_t)e->unknown[p->nodes[k]];
      to[0] = p->inward.x, to[1] = p->inward.y, to[2] = p->inward.z;
    }
    status = sonde_elastic_solve(e, t->scratch[worker], p->nodes, p->count, f, u, error);
  }
  t->stiffness[item] = sonde_dot(f, u, (uint32_t)n);
  if (!status) sonde_elastic_sensitivity(e, u, t->group, t->group_count, t->slope[item]);
  return status;
}

// Stiffnesses and slopes with the moduli exp(x); the sum of weighted squares.
static sonde_status evaluate(fit *t, const double *x, double *misfit, sonde_error *error) {
  bool skin = t->unknowns > t->group_count;
  for (uint32_t k = 0; k < t->elastic->mesh->count; ++k) t->young[k] = exp(x[t->group[k]]);
  sonde_status status =
      sonde_elastic_set(t->elastic, t->young, t->poisson, skin ? exp(x[t->group_count]) : 0, error);
  if (!status)
    status =
        sonde_parallel_run(t->count, t->workers, measure_footprint, t, NULL, "footprints", error);
  sonde_condensed_destroy(t->condensed);
  t->condensed = NULL;
  *misfit = 0;
  for (uint32_t k = 0; k < t->count && !status; ++k) {
    double off = t->stiffness[k] - t->footprints[k].stiffness_n_m;
    *misfit += t->footprints[k].weight_m2 * off * off;
  }
  return status;
}

// The damped step from the slopes at hand; false when they say nothing.
static bool find_step(const fit *t, double damping, double step[GROUPS]) {
  const uint32_t n = t->unknowns;
  double a[GROUPS * GROUPS] = {0};
  memset(step, 0, GROUPS * sizeof *step);
  for (uint32_t k = 0; k < t->count; ++k) {
    const double weight = t->footprints[k].weight_m2, *s = t->slope[k];
    for (uint32_t i = 0; i < n; ++i) {
      step[i] -= weight * s[i] * (t->stiffness[k] - t->footprints[k].stiffness_n_m);
      for (uint32_t j = 0; j < n; ++j) a[i * n + j] += weight * s[i] * s[j];
    }
  }
  for (uint32_t i = 0; i < n; ++i) a[i * n + i] *= 1 + damping;
  if (!sonde_cholesky(a, n)) return false;
  sonde_cholesky_solve(a, n, step);
  for (uint32_t i = 0; i < n; ++i) step[i] = clamp(step[i], -LONGEST, LONGEST);
  return true;
}

static sonde_status minimise(fit *t, double *x, sonde_moduli_result *result, sonde_error *error) {
  double damping = 1e-4, trial[GROUPS], step[GROUPS], misfit;
  sonde_status status = evaluate(t, x, &result->misfit, error);
  result->rounds = 0, result->change = INFINITY;
  while (!status && result->change > CLOSE && result->rounds < ROUNDS) {
    if (!find_step(t, damping, step))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "the footprints say nothing about some of the moduli");
    double change = 0;
    for (uint32_t i = 0; i < t->unknowns; ++i) {
      trial[i] = x[i] + step[i];
      change = fmax(change, fabs(step[i]));
    }
    status = evaluate(t, trial, &misfit, error);
    ++result->rounds, result->change = change;
    if (status) break;
    if (misfit <= result->misfit) {
      if (misfit > (1 - FLAT) * result->misfit) result->change = 0;
      memcpy(x, trial, t->unknowns * sizeof *x);
      result->misfit = misfit, damping /= 10;
    } else if (change > CLOSE) {
      // Back to where the slopes were better known.
      status = evaluate(t, x, &misfit, error);
      damping = fmax(10 * damping, 1e-3);
    }
  }
  return status;
}

sonde_status sonde_moduli_fit(sonde_elastic *e, double poisson, const uint32_t *group,
                              uint32_t group_count, const sonde_bonded_footprint *footprints,
                              uint32_t count, uint32_t workers, double *young_pa, double *skin_n_m,
                              sonde_moduli_result *result, sonde_error *error) {
  SONDE_ASSERT(e != NULL && group != NULL && footprints != NULL && young_pa != NULL);
  SONDE_ASSERT(skin_n_m != NULL && result != NULL);
  if (group_count < 1 || group_count >= GROUPS || count < 1)
    return sonde_fail(error, SONDE_ARGUMENT, "%u groups, %u footprints: expected 1 to %d and some",
                      group_count, count, GROUPS - 1);
  fit t = {.elastic = e,
           .poisson = poisson,
           .group = group,
           .group_count = group_count,
           .unknowns = group_count + (*skin_n_m > 0),
           .footprints = footprints,
           .count = count,
           .workers = sonde_parallel_workers(workers, count)};
  t.all_last = e->last_count > 0;
  for (uint32_t k = 0; k < count; ++k)
    for (uint32_t i = 0; i < footprints[k].count; ++i) {
      uint32_t node = footprints[k].nodes[i];
      if (node >= e->mesh->node_count || e->held[node])
        return sonde_fail(error, SONDE_ARGUMENT, "node %u of footprint %u is missing or held", node,
                          k);
      if (e->unknown[node] < e->count - e->last_count) t.all_last = false;
    }
  double x[GROUPS] = {0};
  t.scratch = SONDE_NEW(sonde_elastic_scratch *, t.workers);
  t.vectors = SONDE_NEW(double *, t.workers);
  t.young = SONDE_NEW(double, e->mesh->count);
  t.stiffness = SONDE_NEW(double, count);
  t.slope = (double(*)[GROUPS])sonde_calloc(count, sizeof *t.slope);
  bool all = t.scratch && t.vectors && t.young && t.stiffness && t.slope;
  sonde_status status = all ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t w = 0; w < t.workers && !status; ++w) {
    status = sonde_elastic_scratch_create(e, &t.scratch[w], error);
    if (!status && !(t.vectors[w] = SONDE_NEW(double, 6 * (size_t)e->count)))
      status = sonde_fail_memory(error);
  }
  for (uint32_t i = 0; i < t.unknowns && !status; ++i) {
    x[i] = log(i < group_count ? young_pa[i] : *skin_n_m);
    if (!isfinite(x[i]))
      status = sonde_fail(error, SONDE_ARGUMENT, "modulus %u: expected a positive start", i);
  }
  if (!status) status = minimise(&t, x, result, error);
  for (uint32_t i = 0; i < group_count && !status; ++i) young_pa[i] = exp(x[i]);
  if (!status && t.unknowns > group_count) *skin_n_m = exp(x[group_count]);
  if (!status && result->stiffness)
    memcpy(result->stiffness, t.stiffness, count * sizeof *t.stiffness);
  for (uint32_t w = 0; w < t.workers; ++w) {
    if (t.scratch) sonde_elastic_scratch_destroy(t.scratch[w]);
    if (t.vectors) sonde_free(t.vectors[w]);
  }
  void *parts[] = {t.scratch, t.vectors, t.young, t.stiffness, t.slope};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  return status;
}
