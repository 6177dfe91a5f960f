// Stiffness of footprints with its derivatives, and the fit of moduli to it.
#include "elements/moduli.h"
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
  sonde_elastic_scratch **scratch; // [workers]
  double **vectors;                // [workers] force and displacement
  double *young;                   // [tetrahedra]
  double *stiffness;               // [count]
  double (*slope)[GROUPS];         // [count] by ln E
} fit;

// The work of a unit depth is the stiffness, and so are their derivatives.
static sonde_status measure_footprint(void *user, uint32_t worker, uint32_t item,
                                      const atomic_bool *stop, sonde_error *error) {
  const fit *t = user;
  (void)stop;
  const sonde_elastic *e = t->elastic;
  const sonde_bonded_footprint *p = &t->footprints[item];
  const size_t n = 3 * (size_t)e->count;
  double *f = t->vectors[worker], *u = f + n, sum = 0;
  memset(f, 0, 2 * n * sizeof *f);
  for (uint32_t k = 0; k < p->count; ++k) {
    double *to = u + 3 * (size_t)e->unknown[p->nodes[k]];
    to[0] = p->inward.x, to[1] = p->inward.y, to[2] = p->inward.z;
  }
  sonde_status status = sonde_elastic_solve(e, t->scratch[worker], p->nodes, p->count, f, u, error);
  for (uint32_t k = 0; k < p->count && !status; ++k) {
    const double *from = f + 3 * (size_t)e->unknown[p->nodes[k]];
    sum += v_dot(p->inward, vec3(from[0], from[1], from[2]));
  }
  t->stiffness[item] = sum;
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
