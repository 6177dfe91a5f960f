/**
 * @file fit_confidence.h
 * What an estimation of stage 3 is worth: data left out, the likelihood of the shear stiffness,
 * what each probe alone determines, other starts. Formulas: docs/estimation.md.
 */
#ifndef SONDE_FIT_CONFIDENCE_H
#define SONDE_FIT_CONFIDENCE_H

#include "sonde/fit.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sonde_hold_out {
  SONDE_HOLD_OUT_SITES, /**< eight scattered parts of the sites in turn */
  SONDE_HOLD_OUT_PROBE, /**< each probe in turn */
  SONDE_HOLD_OUT_DEPTH, /**< the deepest quarter of every curve */
} sonde_hold_out;

/**
 * Refits stage 3 without a part of the measurements, each part in turn, and predicts that part.
 * @param result of sonde_fit() with stages == 3 on the same arguments
 * @param predicted_n [count] NaN for rows that are never left out @thread owner
 */
SONDE_API sonde_status sonde_fit_hold_out(const sonde_model *model, const sonde_site_table *sites,
                                          const sonde_measurements *measurements,
                                          const sonde_fit_def *def, const sonde_fit_result *result,
                                          sonde_hold_out kind, const sonde_progress *progress,
                                          double *predicted_n, sonde_error *error);

/**
 * The same by sites; each part's refit also predicts the measurements `also` at its sites, made
 * with probes that were never fitted.
 * @param predicted_n [measurements->count + also->count]
 * @return ARGUMENT when `also` has a fitted probe @thread owner
 */
SONDE_API sonde_status sonde_fit_hold_out_also(
    const sonde_model *model, const sonde_site_table *sites, const sonde_measurements *measurements,
    const sonde_measurements *also, const sonde_fit_def *def, const sonde_fit_result *result,
    const sonde_progress *progress, double *predicted_n, sonde_error *error);

enum { SONDE_FIT_PROFILE = 9 };
/** How the fit gets worse when the shear stiffness is held and all else is fitted again. */
typedef struct sonde_fit_profile {
  uint32_t count;
  double shear_n_m[SONDE_FIT_PROFILE]; /**< ascending, the estimate in the middle */
  double rise[SONDE_FIT_PROFILE];      /**< 2 (cost - least cost), each by a full refit */
  double quadratic[SONDE_FIT_PROFILE]; /**< the same from the curvature at the optimum alone */
  double estimate_n_m;
  double variance;       /**< of errors over those assumed, from the data */
  double threshold;      /**< rise at the ends of the interval: 3.841 variance */
  double interval_95[2]; /**< N/m, where the likelihood has dropped; NaN beyond the values tried */
} sonde_fit_profile;

/**
 * Profile likelihood of the shear stiffness G at nine values within three standard deviations.
 * @param result of sonde_fit() with stages == 3 on the same arguments; likewise below
 * @return ARGUMENT without stage 3, CANCELLED by progress @thread owner
 */
SONDE_API sonde_status sonde_fit_profile_shear(
    const sonde_model *model, const sonde_site_table *sites, const sonde_measurements *measurements,
    const sonde_fit_def *def, const sonde_fit_result *result, const sonde_progress *progress,
    sonde_fit_profile *profile, sonde_error *error);

/**
 * What some of the measurements determine: deviations of the logarithms of G, gm, and the geometric
 * means of k0 and xm over the sites.
 */
typedef struct sonde_fit_part {
  char probe[24];           /**< the only one that takes part; empty: all */
  double ln_sd[4];          /**< from the curvature, errors as stage 3 assumes them */
  double correlation[4][4]; /**< NaN when a parameter is left open */
  double condition;         /**< of that matrix, largest over smallest eigenvalue */
} sonde_fit_part;

typedef struct sonde_fit_identifiability {
  uint32_t count;
  sonde_fit_part part[SONDE_FIT_PROBES + 1]; /**< each probe alone, then all */
} sonde_fit_identifiability;

/**
 * What each probe alone and all together would determine, by the curvature of the cost at the
 * result's parameters with the result's smoothness. @thread owner
 */
SONDE_API sonde_status sonde_fit_identify(const sonde_model *model, const sonde_site_table *sites,
                                          const sonde_measurements *measurements,
                                          const sonde_fit_def *def, const sonde_fit_result *result,
                                          const sonde_progress *progress,
                                          sonde_fit_identifiability *identifiability,
                                          sonde_error *error);

/** Where other starts end. */
typedef struct sonde_fit_starts {
  uint32_t count;
  uint32_t same;   /**< every parameter within half a standard deviation of the result's */
  uint32_t failed; /**< without an equilibrium at the start, or stopped by max_iterations */
  double least_cost, most_cost; /**< of those that did not fail */
  double farthest_sd;           /**< largest distance of a parameter among the same ones */
} sonde_fit_starts;

/**
 * Fits stage 3 from `count` random points in the logarithms of all parameters, with the result's
 * smoothness: k0 and G over a factor 3 and 5 to both sides of the generic start, xm from 1.1 to 4
 * times the deepest measurement, gm from 0.4 to 4; besides, every site differs by up to 1.6 in k0
 * and 1.2 in xm. Depends only on the arguments. @thread owner
 */
SONDE_API sonde_status sonde_fit_random_starts(
    const sonde_model *model, const sonde_site_table *sites, const sonde_measurements *measurements,
    const sonde_fit_def *def, const sonde_fit_result *result, uint32_t count, uint64_t seed,
    const sonde_progress *progress, sonde_fit_starts *starts, sonde_error *error);

typedef enum sonde_layer {
  SONDE_LAYER_LIMIT,      /**< the model's: q = G g/(1 - (g/gm)^2), g the slope of the skin */
  SONDE_LAYER_TENSION,    /**< "T": a membrane of tension T + k e, e = sqrt(1 + g^2) - 1 */
  SONDE_LAYER_STIFFENING, /**< "J": T + k e (1 + c e^2) */
  SONDE_FIT_LAYERS,
} sonde_layer;

/** Stage 3 with another law of the layer between neighbours. */
typedef struct sonde_fit_layer {
  sonde_layer kind;
  uint32_t parameters;
  bool converged;
  double cost;        /**< as in sonde_fit_result */
  double tension_n_m; /**< T, or G of the model's own law */
  double second;      /**< k in N/m, or gm */
  double stiffening;  /**< c of J, else 0 */
  double smoothness_sd, shear_smoothness_sd;
  sonde_error_report seen, one_out; /**< of fitted rows; of sites left out (linearised) */
  sonde_error_report also;          /**< of measurements that were never fitted */
} sonde_fit_layer;

/**
 * Fits stage 3 with the model's own law of the layer, with pre-tension ("T") and with pre-tension
 * and stiffening ("J"), each with fields, smoothness and equilibria of its own, the skin moving
 * along its normals. Only the first is a law of the dynamic model. docs/estimation.md.
 * @param also measurements with other probes that are predicted only; may be NULL
 * @param layers [SONDE_FIT_LAYERS] @thread owner
 */
SONDE_API sonde_status sonde_fit_layers(const sonde_model *model, const sonde_site_table *sites,
                                        const sonde_measurements *measurements,
                                        const sonde_measurements *also, const sonde_fit_def *def,
                                        const sonde_fit_result *result,
                                        const sonde_progress *progress, sonde_fit_layer *layers,
                                        sonde_error *error);

enum { SONDE_FIT_EXPONENTS = 3 };
/** Stage 3 with springs of one exponent n = 1, 2, 3. */
typedef struct sonde_fit_exponent {
  double exponent;
  double mae_percent;      /**< mean over the probes of MAE over the probe's mean force */
  double held_out_percent; /**< the same, each site predicted without its own rows (linearised) */
  bool converged;
} sonde_fit_exponent;

/**
 * Fits all three stages with each exponent and keeps the result with the least held-out error; its
 * law has that exponent. docs/estimation.md.
 * @param def stages and normal_exponent are not used
 * @param tried [SONDE_FIT_EXPONENTS] in the order n = 1, 2, 3
 * @return as sonde_fit() @thread owner
 */
SONDE_API sonde_status sonde_fit_exponents(const sonde_model *model, const sonde_site_table *sites,
                                           const sonde_measurements *measurements,
                                           const sonde_fit_def *def, const sonde_progress *progress,
                                           sonde_fit_exponent *tried, sonde_fit_result *result,
                                           sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
