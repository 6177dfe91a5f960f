// Condensation, its inverse, plates.
#include "elements/condense.h"
#include "elements/invert.h"
#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"
#include "sparse/dense.h"

#include <string.h>

void sonde_condensed_destroy(sonde_condensed *c) {
  if (!c) return;
  sonde_free(c->node);
  sonde_free(c->stiffness);
  sonde_free(c->compliance);
  sonde_free(c);
}

// ---- condensation -------------------------------------------------------------------------

sonde_status sonde_condensed_create(const sonde_elastic *e, uint32_t workers,
                                    sonde_condensed **condensed, sonde_condensed_times *times,
                                    sonde_error *error) {
  SONDE_ASSERT(e != NULL && condensed != NULL);
  *condensed = NULL;
  const uint32_t *nodes = e->node + (e->count - e->last_count);
  if (e->last_count == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "expected a solid with nodes to condense on");
  for (uint32_t k = 0; k < e->last_count; ++k)
    if (e->held[nodes[k]])
      return sonde_fail(error, SONDE_ARGUMENT,
                        "node %u is held in some direction, expected free ones", nodes[k]);
  sonde_condensed_times ignored;
  if (!times) times = &ignored;
  double start = sonde_clock_now();
  const size_t side = 3 * (size_t)e->last_count;
  const sonde_symbolic_def def = {.node_count = e->count,
                                  .last_count = e->last_count,
                                  .block = 3,
                                  .points = e->point,
                                  .row_start = e->row_start,
                                  .column = e->column};
  sonde_symbolic *symbolic = NULL;
  sonde_numeric numeric = {0};
  sonde_condensed *c = *condensed = SONDE_NEW(sonde_condensed, 1);
  if (!c) return sonde_fail_memory(error);
  *c = (sonde_condensed){e->last_count, SONDE_NEW(uint32_t, e->last_count),
                         SONDE_NEW(double, side *side), SONDE_NEW(double, side *side)};
  sonde_status status =
      c->node && c->stiffness && c->compliance ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    memcpy(c->node, nodes, e->last_count * sizeof *nodes);
    status = sonde_symbolic_create(&def, &symbolic, error);
  }
  if (!status) status = sonde_numeric_reserve(&numeric, symbolic, error);
  times->analysis_s = sonde_clock_now() - start;
  const sonde_matrix_source source = {.value = e->value};
  if (!status && !sonde_numeric_factor(&numeric, symbolic, &source))
    status = sonde_fail(error, SONDE_CONVERGENCE, "the stiffness is not positive definite");
  const double *lower = status ? NULL : sonde_numeric_condensed(&numeric);
  for (size_t j = 0; j < side && !status; ++j)
    for (size_t i = j; i < side; ++i)
      c->stiffness[i * side + j] = c->stiffness[j * side + i] = lower[j * side + i];
  times->factor_s = sonde_clock_now() - start - times->analysis_s;
  sonde_numeric_clear(&numeric);
  sonde_symbolic_destroy(symbolic);
  if (!status) status = sonde_invert(c->stiffness, 3 * c->count, workers, c->compliance, error);
  times->inverse_s = sonde_clock_now() - start - times->analysis_s - times->factor_s;
  if (status) {
    sonde_condensed_destroy(*condensed);
    *condensed = NULL;
  }
  return status;
}

// ---- contact ------------------------------------------------------------------------------

// Factor of the compliance between some nodes, in all directions, or along one when `along` is
// given. a [n * n], n = count or 3 count.
static bool factor_compliance(const sonde_condensed *c, const uint32_t *places, uint32_t count,
                              const sonde_vec3 *along, double *a) {
  const size_t side = 3 * (size_t)c->count, n = (along ? 1 : 3) * (size_t)count;
  for (size_t p = 0; p < count; ++p)
    for (size_t q = 0; q < count; ++q) {
      SONDE_ASSERT(places[p] < c->count && places[q] < c->count);
      const double *block = c->compliance + 3 * places[p] * side + 3 * (size_t)places[q];
      if (!along)
        for (size_t i = 0; i < 3; ++i)
          for (size_t j = 0; j < 3; ++j) a[(3 * p + i) * n + 3 * q + j] = block[i * side + j];
      else
        a[p * n + q] =
            along->x * v_dot(*along, vec3(block[0], block[1], block[2])) +
            along->y * v_dot(*along, vec3(block[side], block[side + 1], block[side + 2])) +
            along->z *
                v_dot(*along, vec3(block[2 * side], block[2 * side + 1], block[2 * side + 2]));
    }
  return sonde_cholesky(a, (uint32_t)n);
}

static sonde_status fail_singular(sonde_error *error) {
  return sonde_fail(error, SONDE_CONVERGENCE,
                    "the compliance between the touched nodes is not positive definite");
}

static sonde_status check_places(const sonde_condensed *c, const uint32_t *places, uint32_t count,
                                 sonde_error *error) {
  for (uint32_t k = 0; k < count; ++k) {
    bool twice = false;
    for (uint32_t q = 0; q < k; ++q) twice |= places[q] == places[k];
    if (places[k] >= c->count || twice)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "node %u of the footprint is missing or listed twice", k);
  }
  return SONDE_OK;
}

sonde_status sonde_condensed_forces(const sonde_condensed *c, const uint32_t *places,
                                    uint32_t count, const double *u, double *f,
                                    sonde_error *error) {
  SONDE_ASSERT(c != NULL && places != NULL && u != NULL && f != NULL);
  sonde_status status = check_places(c, places, count, error);
  if (status) return status;
  const size_t n = 3 * (size_t)count;
  double *a = SONDE_NEW(double, n *n);
  if (!a) return sonde_fail_memory(error);
  if (count && !factor_compliance(c, places, count, NULL, a)) {
    status = fail_singular(error);
  } else if (count) {
    memmove(f, u, n * sizeof *f);
    sonde_cholesky_solve(a, (uint32_t)n, f);
  }
  sonde_free(a);
  return status;
}

// A plate at work: arrays of the footprint's nodes.
typedef struct contact {
  const sonde_condensed *c;
  const sonde_plate *plate;
  double depth;
  double *a, *x;       // [9 count^2], [3 count]
  uint32_t *places;    // [count] of the touched ones
  uint32_t *touched;   // [count] their index in the footprint
  bool *active, *kept; // [count]
  double *force;       // [count] along the plate's way
} contact;

static double way_of(const contact *t, uint32_t k) {
  return t->depth - (t->plate->gap_m ? t->plate->gap_m[k] : 0);
}

// Forces when exactly the active nodes are held to the plate.
static bool hold_active(contact *t) {
  const sonde_plate *p = t->plate;
  uint32_t count = 0;
  for (uint32_t k = 0; k < p->count; ++k)
    if (t->active[k]) t->places[count] = p->places[k], t->touched[count++] = k;
  memset(t->force, 0, p->count * sizeof *t->force);
  if (count == 0) return true;
  if (!factor_compliance(t->c, t->places, count, p->bonded ? NULL : &p->inward, t->a)) return false;
  for (uint32_t k = 0; k < count; ++k) {
    double way = way_of(t, t->touched[k]);
    if (!p->bonded)
      t->x[k] = way;
    else
      t->x[3 * k] = way * p->inward.x, t->x[3 * k + 1] = way * p->inward.y,
               t->x[3 * k + 2] = way * p->inward.z;
  }
  sonde_cholesky_solve(t->a, (p->bonded ? 3 : 1) * count, t->x);
  for (uint32_t k = 0; k < count; ++k)
    t->force[t->touched[k]] =
        p->bonded ? v_dot(p->inward, vec3(t->x[3 * k], t->x[3 * k + 1], t->x[3 * k + 2])) : t->x[k];
  return true;
}

// Moves nodes in and out of contact: those that the plate pulls come off, those that it would pass
// touch. Returns whether any did.
static bool update_active(contact *t) {
  const sonde_plate *p = t->plate;
  const size_t side = 3 * (size_t)t->c->count;
  const double n[3] = {p->inward.x, p->inward.y, p->inward.z};
  bool changed = false;
  for (uint32_t k = 0; k < p->count; ++k) {
    t->kept[k] = t->active[k] && t->force[k] >= 0;
    if (t->active[k] || way_of(t, k) <= 0) continue;
    double moved = 0;
    for (uint32_t q = 0; q < p->count; ++q)
      for (size_t i = 0; i < 3 && t->force[q] != 0; ++i)
        for (size_t j = 0; j < 3; ++j)
          moved += n[i] * n[j] * t->force[q] *
                   t->c->compliance[(3 * p->places[k] + i) * side + 3 * p->places[q] + j];
    t->kept[k] = moved < way_of(t, k) * (1 - 1e-12);
  }
  for (uint32_t k = 0; k < p->count; ++k) {
    changed |= t->kept[k] != t->active[k];
    t->active[k] = t->kept[k];
  }
  return changed;
}

sonde_status sonde_condensed_press(const sonde_condensed *c, const sonde_plate *p,
                                   const double *depth_m, uint32_t depth_count, double *force_n,
                                   double *node_force, sonde_error *error) {
  SONDE_ASSERT(c != NULL && p != NULL && depth_m != NULL && force_n != NULL);
  enum { CHANGES = 60 };
  const size_t n = p->count;
  contact t = {.c = c,
               .plate = p,
               .a = SONDE_NEW(double, (p->bonded ? 9 : 1) * n * n),
               .x = SONDE_NEW(double, 3 * n),
               .places = SONDE_NEW(uint32_t, n),
               .touched = SONDE_NEW(uint32_t, n),
               .active = SONDE_NEW(bool, n),
               .kept = SONDE_NEW(bool, n),
               .force = SONDE_NEW(double, n)};
  bool all = t.a && t.x && t.places && t.touched && t.active && t.kept && t.force;
  sonde_status status =
      all ? check_places(c, p->places, p->count, error) : sonde_fail_memory(error);
  for (uint32_t d = 0; d < depth_count && !status; ++d) {
    t.depth = depth_m[d];
    for (uint32_t k = 0; k < p->count; ++k) t.active[k] = way_of(&t, k) > 0;
    int changes = 0;
    do {
      if (!hold_active(&t)) status = fail_singular(error);
    } while (!status && !p->bonded && update_active(&t) && ++changes < CHANGES);
    if (changes == CHANGES)
      status =
          sonde_fail(error, SONDE_CONVERGENCE,
                     "the touched nodes still change after %d rounds at %g m", CHANGES, t.depth);
    force_n[d] = 0;
    for (uint32_t k = 0; k < p->count && !status; ++k) force_n[d] += t.force[k];
    if (node_force && !status) memcpy(node_force + d * n, t.force, n * sizeof *node_force);
  }
  void *parts[] = {t.a, t.x, t.places, t.touched, t.active, t.kept, t.force};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  return status;
}
