// Normal, Laplace and Student's t distributions of greatest likelihood.
#include "sonde/fit_distribution.h"

#include "base/base.h"
#include "base/maths.h"

static const double LEAST_FREEDOM = 0.5, MOST_FREEDOM = 200;
enum { STUDENT_STEPS = 400, GOLDEN_STEPS = 40, LEAST_COUNT = 8 };

const char *sonde_distribution_name(sonde_distribution_kind kind) {
  static const char *const NAMES[SONDE_DISTRIBUTIONS] = {"normal", "Laplace", "Student t"};
  SONDE_ASSERT(kind < SONDE_DISTRIBUTIONS);
  return NAMES[kind];
}

// What does not depend on the value, so that a sample pays for it once.
static double log_factor(const sonde_distribution *d) {
  double nu = d->freedom;
  switch (d->kind) {
  case SONDE_NORMAL: return -log(d->scale) - 0.5 * log(2 * SONDE_PI);
  case SONDE_LAPLACE: return -log(2 * d->scale);
  default:
    return lgamma(0.5 * (nu + 1)) - lgamma(0.5 * nu) - 0.5 * log(nu * SONDE_PI) - log(d->scale);
  }
}

static double log_shape(const sonde_distribution *d, double x) {
  double z = (x - d->place) / d->scale;
  switch (d->kind) {
  case SONDE_NORMAL: return -0.5 * z * z;
  case SONDE_LAPLACE: return -fabs(z);
  default: return -0.5 * (d->freedom + 1) * log1p(z * z / d->freedom);
  }
}

double sonde_distribution_density(const sonde_distribution *d, double x) {
  SONDE_ASSERT(d->scale > 0);
  return exp(log_factor(d) + log_shape(d, x));
}

static void likelihood(sonde_distribution *d, const double *x, uint32_t count) {
  double sum = 0;
  for (uint32_t i = 0; i < count; ++i) sum += log_shape(d, x[i]);
  d->log_likelihood = count * log_factor(d) + sum;
  d->aic = 2 * (d->kind == SONDE_STUDENT ? 3 : 2) - 2 * d->log_likelihood;
}

// Place, scale and likelihood at given degrees of freedom, by expectation and maximisation.
// t is a normal with gamma distributed precision: w is the expected precision of each value.
// Dividing by sum w instead of the count has the same fixed point and gets there much sooner.
static double student_at(const double *sorted, uint32_t count, double log_freedom,
                         sonde_distribution *d) {
  d->freedom = exp(log_freedom);
  for (int i = 0; i < STUDENT_STEPS; ++i) {
    double weights = 0, first = 0, squares = 0;
    double nu = d->freedom, old_place = d->place, old_scale = d->scale;
    for (uint32_t k = 0; k < count; ++k) {
      double x = sorted[k], z = (x - old_place) / old_scale, w = (nu + 1) / (nu + z * z);
      weights += w;
      first += w * x;
      squares += w * (x - old_place) * (x - old_place);
    }
    SONDE_ASSERT(weights > 0);
    double shift = first / weights - old_place;
    double variance = squares / weights - shift * shift;
    d->place += shift;
    d->scale = sqrt(variance > 0 ? variance : 0);
    double moved = fabs(shift) + fabs(d->scale - old_scale);
    if (!(d->scale > 0) || moved < 1e-10 * d->scale) break;
  }
  if (!(d->scale > 0)) return -INFINITY;
  likelihood(d, sorted, count);
  return d->log_likelihood;
}

bool sonde_distribution_fit(sonde_distribution_kind kind, const double *sorted, uint32_t count,
                            sonde_distribution *d) {
  *d = (sonde_distribution){.kind = kind};
  if (count < LEAST_COUNT || !(sorted[count - 1] > sorted[0])) return false;
  SONDE_ASSERT(isfinite(sorted[0]) && isfinite(sorted[count - 1]));
  double sum = 0;
  if (kind == SONDE_LAPLACE) { // the median and the mean deviation from it
    d->place = 0.5 * (sorted[(count - 1) / 2] + sorted[count / 2]);
    for (uint32_t i = 0; i < count; ++i) sum += fabs(sorted[i] - d->place);
    d->scale = sum / count;
  } else { // the mean and the standard deviation
    double squares = 0;
    for (uint32_t i = 0; i < count; ++i) sum += sorted[i];
    d->place = sum / count;
    for (uint32_t i = 0; i < count; ++i) squares += (sorted[i] - d->place) * (sorted[i] - d->place);
    d->scale = sqrt(squares / count);
  }
  if (kind == SONDE_STUDENT) {
    // Golden section over the logarithm of the degrees of freedom.
    static const double GOLDEN = 0.61803398874989485;
    double low = log(LEAST_FREEDOM), high = log(MOST_FREEDOM);
    sonde_distribution left = *d, right = *d;
    double a = high - GOLDEN * (high - low), b = low + GOLDEN * (high - low);
    double at_a = student_at(sorted, count, a, &left), at_b = student_at(sorted, count, b, &right);
    for (int i = 0; i < GOLDEN_STEPS; ++i) {
      if (at_a >= at_b) {
        high = b, b = a, at_b = at_a, right = left;
        a = high - GOLDEN * (high - low);
        at_a = student_at(sorted, count, a, &left);
      } else {
        low = a, a = b, at_a = at_b, left = right;
        b = low + GOLDEN * (high - low);
        at_b = student_at(sorted, count, b, &right);
      }
    }
    SONDE_ASSERT(high >= low);
    *d = at_a >= at_b ? left : right;
  }
  if (!(d->scale > 0)) return false;
  likelihood(d, sorted, count);
  return isfinite(d->log_likelihood);
}
