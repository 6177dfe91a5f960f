/**
 * @file fit_sample.h
 * One specimen between two plates: a table of force against compression, and the spring
 * F(s) = K s/(1 - (s/x_m)^n) fitted to it; n by the error on data that were left out. docs/fit.md.
 */
#ifndef SONDE_FIT_SAMPLE_H
#define SONDE_FIT_SAMPLE_H

#include "sonde/fit_plausible.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sonde_sample {
  uint32_t count;
  double *compression_m; /**< [count] ascending */
  double *force_n;       /**< [count] */
  double area_m2;        /**< of the specimen's cross-section; 0: not known */
  double height_m;       /**< 0: not known */
} sonde_sample;

/**
 * Reads a table with a column compression, penetration or displacement and a column load or force,
 * each with its unit, as in `Compression (mm)` or `force_n`. Lines before the header may say
 * `Diameter: 50mm`, `Height: 30mm`. Rows are sorted by compression; those below 0 are left out.
 * @return FORMAT naming file and line @thread owner
 */
SONDE_API sonde_status sonde_sample_load(const char *path, sonde_sample *sample,
                                         sonde_error *error);
SONDE_API void sonde_sample_clear(sonde_sample *sample); /**< @thread owner */

/** The spring of one exponent. n = 1: the paper's f = x/(a x + b), a = -1/(K x_m), b = 1/K. */
typedef struct sonde_sample_law {
  double exponent;         /**< n */
  double stiffness_n_m;    /**< K */
  double asymptote_m;      /**< x_m */
  double mae_n, rms_n;     /**< of the fit */
  double mae_percent;      /**< of the mean force */
  double rms_percent;      /**< of the largest force */
  double held_out_percent; /**< MAE over the mean force in four fifths of the compression from 0:
                                each fifth predicted by a fit to the rest of the table; the
                                deepest is in every fit, since the law does not extrapolate */
  bool converged;
} sonde_sample_law;

/**
 * Fits the spring by least squares of the force.
 * @param exponent n in (0, 8], or 0: estimated too, between 0.2 and 8
 * @return ARGUMENT with fewer than 10 rows, an exponent outside these, or no force @thread any
 */
SONDE_API sonde_status sonde_fit_sample(const sonde_sample *sample, double exponent,
                                        sonde_sample_law *law, sonde_error *error);
/** Examines the course of the force: rising, one phase, stiffening. Adds to doubts. @thread any */
SONDE_API sonde_status sonde_sample_examine(const sonde_sample *sample, sonde_doubts *doubts,
                                            sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
