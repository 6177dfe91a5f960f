/**
 * @file fit_solid.h
 * The moduli of muscle, fat and skin of the hyperelastic solid (solid.h), fitted to what a robot
 * measured, and forces that they predict. docs/solid.md, docs/solid_theory.md.
 */
#ifndef SONDE_FIT_SOLID_H
#define SONDE_FIT_SOLID_H

#include "sonde/fit.h"
#include "sonde/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sonde_fit_solid_def {
  uint32_t version;              /**< SONDE_DEF_VERSION, from sonde_fit_solid_def_default() */
  sonde_equilibrium_def contact; /**< of all probes: bonded, the default, flat or rounded; its
                                    layers are what is believed beforehand (muscle 3 kPa, fat 1.6
                                    kPa, skin 30 kPa, exponents 8, 9, 8, K = 24 mu) and where the
                                    search begins; the ratios K/mu stay */
  sonde_hexes_def mesh;          /**< its footprint is that of each probe */
  double ln_shear_sd;            /**< how loosely it is believed: of ln mu; 1 */
  double ln_exponent_sd;         /**< of the logarithm of the exponents; 0.3 */
  double relative_sd;            /**< what no solid explains, over the force; all rows of a curve
                                      share it; 0.02 */
  double force_sd_n;             /**< noise of the sensor; 0.01 N */
  double zero_sd_m, tare_sd_n;   /**< of each curve's contact zero and tare; 0: not estimated */
  uint32_t max_steps;            /**< of Levenberg-Marquardt; 12 */
  uint32_t threads;              /**< 0: one per online core */
} sonde_fit_solid_def;
SONDE_API sonde_fit_solid_def sonde_fit_solid_def_default(void); /**< @thread any */

/** What was found; sonde_fit_solid_result_clear(). */
typedef struct sonde_fit_solid_result {
  sonde_hyperelastic layer[SONDE_SOLID_LAYERS];
  sonde_moduli_certainty certainty;
  double start_rms, rms;   /**< of ln(model/measured) over the rows */
  uint32_t row_count;      /**< rows that count; of the others no equilibrium was found */
  uint32_t steps, trials;  /**< of Levenberg-Marquardt */
  bool converged;          /**< the last step was small */
  uint32_t curve_count;    /**< by site, then probe */
  sonde_curve_fit *curves; /**< [curve_count] site, probe, count, zero_m, tare_n */
} sonde_fit_solid_result;
SONDE_API void sonde_fit_solid_result_clear(sonde_fit_solid_result *result); /**< @thread owner */

/**
 * Fits shear modulus and exponent of each layer by Levenberg-Marquardt in their logarithms: least
 * sum over the curves of the mean square of (F - measured)/sd, and of the squares of what is
 * believed beforehand. Derivatives are those of sonde_equilibrium_change().
 * @param model with a bone; its layers count, its springs do not
 * @param[out] fitted_n [measurements.count] what the fit says of each row, contact zero and tare
 *   included; NaN without equilibrium
 * @return ARGUMENT, MISMATCH for bad tables; CONVERGENCE when no row has an equilibrium; CANCELLED
 * @thread owner
 */
SONDE_API sonde_status sonde_fit_solid(const sonde_model *model, const sonde_site_table *sites,
                                       const sonde_measurements *measurements,
                                       const sonde_fit_solid_def *def,
                                       const sonde_progress *progress,
                                       sonde_fit_solid_result *result, double *fitted_n,
                                       sonde_error *error);

/**
 * Forces of the solid with the layers of def->contact, row by row.
 * @param[out] predicted_n [measurements.count] NaN where no equilibrium was found
 * @return as sonde_fit_solid() @thread owner
 */
SONDE_API sonde_status sonde_predict_solid(const sonde_model *model, const sonde_site_table *sites,
                                           const sonde_measurements *measurements,
                                           const sonde_fit_solid_def *def,
                                           const sonde_progress *progress, double *predicted_n,
                                           sonde_error *error);

/** Root mean square of ln(model/measured) over the rows where both are positive. @thread any */
SONDE_API double sonde_ln_rms(const sonde_datum *data, const double *model_n, uint32_t count);

/**
 * Rows of some sites, of every curve at most `depths` that are spread over it, its deepest among
 * them.
 * @param site [site_count] ids; NULL: all
 * @param depths 0: all rows
 * @param[out] some sonde_measurements_clear(); ARGUMENT for a site without rows @thread owner
 */
SONDE_API sonde_status sonde_measurements_select(const sonde_measurements *measurements,
                                                 const sonde_site_table *sites,
                                                 const uint32_t *site, uint32_t site_count,
                                                 uint32_t depths, sonde_measurements *some,
                                                 sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
