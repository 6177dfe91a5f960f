/**
 * @file fit_distribution.h
 * Maximum-likelihood fits of three symmetric distributions to a sample, e.g. of errors.
 */
#ifndef SONDE_FIT_DISTRIBUTION_H
#define SONDE_FIT_DISTRIBUTION_H

#include "sonde/base.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sonde_distribution_kind {
  SONDE_NORMAL,  /**< place mean, scale standard deviation */
  SONDE_LAPLACE, /**< place median, scale mean distance from it */
  SONDE_STUDENT, /**< place and scale of Student's t with `freedom` degrees */
  SONDE_DISTRIBUTIONS
} sonde_distribution_kind;

typedef struct sonde_distribution {
  sonde_distribution_kind kind;
  double place, scale;
  double freedom; /**< Student only, within [0.5, 200] */
  double log_likelihood, aic;
} sonde_distribution;

/** "normal", "Laplace" or "Student t". @thread any */
SONDE_API const char *sonde_distribution_name(sonde_distribution_kind kind);
/** Density at x. @thread any */
SONDE_API double sonde_distribution_density(const sonde_distribution *d, double x);
/** Fits one kind. @param sorted ascending, finite @return false for fewer than 8 values or no
 * spread @thread any */
SONDE_API bool sonde_distribution_fit(sonde_distribution_kind kind, const double *sorted,
                                      uint32_t count, sonde_distribution *d);

#ifdef __cplusplus
}
#endif
#endif
