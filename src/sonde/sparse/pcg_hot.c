// Preconditioned conjugate gradients with the operator's vectors in rows of one or three numbers.
#include "sparse/pcg.h"

#include "base/base.h"
#include "base/vector.h"

#include "base/elementary.h"

INLINE double dot(const sonde_operator *a, const double *x, const double *y, uint32_t width) {
  double sum = 0;
  for (uint32_t k = 0; k < a->count; ++k) {
    size_t at = width * (size_t)(a->rows ? a->rows[k] : k);
    double part = x[at] * y[at];
    for (uint32_t c = 1; c < width; ++c) part += x[at + c] * y[at + c];
    sum += part;
  }
  return sum;
}

// y = x + scale * z
INLINE void add(const sonde_operator *a, const double *x, double scale, const double *z, double *y,
                uint32_t width) {
  for (uint32_t k = 0; k < a->count; ++k) {
    size_t at = width * (size_t)(a->rows ? a->rows[k] : k);
    for (uint32_t c = 0; c < width; ++c) y[at + c] = x[at + c] + scale * z[at + c];
  }
}

// x += alpha p, r -= alpha q in one pass; returns r.r.
INLINE double advance(const sonde_operator *a, double alpha, const sonde_pcg_vectors *v, double *x,
                      uint32_t width) {
  double sum = 0;
  for (uint32_t k = 0; k < a->count; ++k) {
    size_t at = width * (size_t)(a->rows ? a->rows[k] : k);
    double part = 0;
    for (uint32_t c = 0; c < width; ++c) {
      x[at + c] = x[at + c] + alpha * v->p[at + c];
      double r = v->r[at + c] = v->r[at + c] - alpha * v->q[at + c];
      part = c ? part + r * r : r * r;
    }
    sum += part;
  }
  return sum;
}

double sonde_dot(const double *x, const double *y, uint32_t count) {
  const sonde_operator all = {.count = count, .width = 1};
  return dot(&all, x, y, 1);
}

INLINE sonde_pcg_result solve(const sonde_operator *a, const double *b, double *x,
                              const sonde_pcg_vectors *v, const sonde_pcg_goal *goal,
                              uint32_t width) {
  // The first residual, which is the right-hand side where x is zero.
  if (goal->from_zero) {
    add(a, b, 0, b, v->r, width);
  } else {
    a->multiply(a->user, x, v->q);
    if (b)
      add(a, b, -1, v->q, v->r, width);
    else
      add(a, v->q, -2, v->q, v->r, width);
  }
  double rr = dot(a, v->r, v->r, width), rz = 0;
  sonde_pcg_result result = {.residual = sqrt(rr)};
  result.reference = b ? sqrt(dot(a, b, b, width)) : result.residual;
  double target = fmax(goal->relative * result.reference, goal->absolute);
  bool hopeless = false;
  while (result.residual > target && result.iterations < goal->max_iterations && !hopeless) {
    // The direction is conjugate to the earlier ones.
    double before = rz;
    rz = a->precondition(a->user, v->r, v->z);
    if (result.iterations)
      add(a, v->z, rz / before, v->p, v->p, width);
    else
      add(a, v->z, 0, v->z, v->p, width);
    // The step to the least energy along it.
    a->multiply(a->user, v->p, v->q);
    double curvature = dot(a, v->p, v->q, width);
    if (!(curvature > 0)) break;
    double last = rr;
    rr = advance(a, rz / curvature, v, x, width);
    result.residual = sqrt(rr);
    result.iterations++;
    hopeless = goal->foresee &&
               rr * pow(rr / last, goal->max_iterations - result.iterations) > target * target;
  }
  result.converged = result.residual <= target;
  return result;
}

sonde_pcg_result sonde_pcg(const sonde_operator *a, const double *b, double *x,
                           const sonde_pcg_vectors *vectors, const sonde_pcg_goal *goal) {
  SONDE_ASSERT(goal->relative >= 0 && goal->absolute >= 0);
  SONDE_ASSERT((a->width == 1 || a->width == 3) && (b || !goal->from_zero));
  return a->width == 1 ? solve(a, b, x, vectors, goal, 1) : solve(a, b, x, vectors, goal, 3);
}
