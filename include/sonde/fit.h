/**
 * @file fit.h
 * Measurement and site tables, error statistics, estimation in up to three stages, prediction of
 * the measurements by a model. Formulas: docs/estimation.md.
 */
#ifndef SONDE_FIT_H
#define SONDE_FIT_H

#include "sonde/tissue.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Measured sites. */
typedef struct sonde_site_table {
  uint32_t count;
  sonde_site *sites;   /**< [count] k0 and xm are 0: not fitted */
  double *fat_depth_m; /**< [count] fat thickness; NaN where the file has none */
} sonde_site_table;

/** Force against penetration, one row per robot step; released by sonde_measurements_clear(). */
typedef struct sonde_measurements {
  uint32_t count;
  sonde_datum *data;           /**< [count] */
  sonde_vec3 *position_m;      /**< [count] of the site */
  sonde_vec3 *normal;          /**< [count] outward, unit */
  char remark[160];            /**< saved as a first line '# ...' when not empty; not read back */
  double *scatter_n;           /**< [count] standard deviation of the mean of repeats; NULL: none */
  uint32_t *line;              /**< [count] of the file that it was read from; NULL: none */
  uint32_t repeats, unloading; /**< most repeats of a curve; rows of unloading, left out */
} sonde_measurements;

/**
 * Reads `site,x_mm,y_mm,z_mm,nx,ny,nz,ux,uy,uz,vx,vy,vz[,fat_mm]`. Columns are found by name in any
 * order, others are ignored; '#' starts a comment line; CRLF is accepted. Normals are made unit, u
 * and v orthonormal to them.
 * @return SONDE_FORMAT naming file, line, column and what was expected; SONDE_IO
 * @thread owner
 */
SONDE_API sonde_status sonde_site_table_load(const char *path, sonde_site_table *table,
                                             sonde_error *error);
/** Writes these columns atomically. @thread owner */
SONDE_API sonde_status sonde_site_table_save(const char *path, const sonde_site_table *table,
                                             sonde_error *error);
SONDE_API void sonde_site_table_clear(sonde_site_table *table); /**< @thread owner */
/**
 * Whether every site lies within tolerance_m (e.g. 5 mm) of the model's skin, with a normal at most
 * 30 degrees off the skin's. @return MISMATCH naming the first that does not @thread any
 */
SONDE_API sonde_status sonde_sites_check_on_surface(const sonde_model *model,
                                                    const sonde_site_table *sites,
                                                    double tolerance_m, sonde_error *error);

/**
 * Reads `site,probe,x_mm,y_mm,z_mm,nx,ny,nz,penetration_mm,force_n` under the same rules. Probes
 * must be built-in names or rect:AxB. Rejects NaN, negative penetrations, repeated (site, probe,
 * penetration) and a negative mean force; rows may stand in any order. A column `phase` (loading or
 * unloading) keeps the rows of loading; with a column `repeat` (a number) the repeats of a curve
 * become their mean.
 * @param sites NULL, or the sites that may occur: a missing one is SONDE_FORMAT, one that lies
 *   elsewhere (more than 5 mm away) is SONDE_MISMATCH
 * @thread owner
 */
SONDE_API sonde_status sonde_measurements_load(const char *path, const sonde_site_table *sites,
                                               sonde_measurements *measurements,
                                               sonde_error *error);
/** Writes the same columns atomically: 4 decimals of mm and N, 6 of normals. @thread owner */
SONDE_API sonde_status sonde_measurements_save(const char *path,
                                               const sonde_measurements *measurements,
                                               sonde_error *error);
SONDE_API void sonde_measurements_clear(sonde_measurements *measurements); /**< @thread owner */

/** Of the error e = model - measurement; rows whose model value is not finite are left out. */
typedef struct sonde_error_statistics {
  uint32_t count;
  double mae_n;        /**< mean |e| */
  double sd_n;         /**< standard deviation of e about its mean (divided by count) */
  double rmse_n;       /**< sqrt(mean e^2) */
  double mean_force_n; /**< of the measurements */
  double mae_percent;  /**< 100 mae / mean force */
  double bias_n;       /**< mean e */
  double sd_abs_n;     /**< standard deviation of |e| */
  double median_abs_n; /**< of |e| */
  double p95_abs_n;    /**< 95th percentile of |e|, linear between ranks */
  double max_abs_n;
} sonde_error_statistics;

enum { SONDE_FIT_PROBES = 8 };

/** The statistics per probe (in order of first appearance) and pooled. */
typedef struct sonde_error_report {
  sonde_error_statistics all, probes[SONDE_FIT_PROBES];
  uint32_t probe_count;
  char probe[SONDE_FIT_PROBES][24];
  uint32_t left_out; /**< rows without a finite model value */
} sonde_error_report;

/** Compares model forces [count] with measured ones. @thread any */
SONDE_API sonde_status sonde_error_statistics_of(const double *model_n, const double *measured_n,
                                                 uint32_t count, sonde_error_statistics *statistics,
                                                 sonde_error *error);
/** The same per probe. @return ARGUMENT when there are too many probes @thread any */
SONDE_API sonde_status sonde_error_report_of(const sonde_datum *data, const double *model_n,
                                             uint32_t count, sonde_error_report *report,
                                             sonde_error *error);

/* ---- estimation -------------------------------------------------------------------------- */

typedef enum sonde_fit_weights {
  SONDE_WEIGHTS_ABSOLUTE, /**< residuals in newtons */
  SONDE_WEIGHTS_RELATIVE, /**< divided by the probe's mean force */
} sonde_fit_weights;

typedef enum sonde_fit_loss {
  SONDE_LOSS_SQUARES,
  SONDE_LOSS_HUBER,   /**< quadratic up to loss_scale, then straight */
  SONDE_LOSS_STUDENT, /**< ln(1 + r^2/(nu scale^2)), nu = 3 */
} sonde_fit_loss;

typedef struct sonde_fit_def {
  uint32_t stages;            /**< 1, 2 or 3; default 2 */
  sonde_fit_weights weights;  /**< default absolute */
  sonde_fit_loss loss;        /**< default squares */
  double loss_scale;          /**< N, or a fraction with relative weights; default 0.5 / 0.05 */
  uint32_t max_iterations;    /**< default 400 */
  bool fit_pretension;        /**< also estimate T0 >= 0 (stage 2); default false */
  bool cold_start;            /**< stage 2 from one generic start instead of stage 1 */
  uint64_t cold_seed;         /**< not 0: ln k0, ln(xm - deepest), ln k_s start random, sd 1.5 */
  double kept_edge_n_m;       /**< edge stiffness of a stage 3 model; default 0 */
  double normal_exponent;     /**< of the normal springs of stage 3: 1, 2 (default) or 3 */
  double smoothness_sd;       /**< of ln k0 and ln xm per site spacing; 0 (default): by leave-out */
  double shear_smoothness_sd; /**< of ln G and ln gm; 0 (default): by leave-out, or the same when
                                   smoothness_sd is given */
  double zero_sd_m;           /**< sd of each curve's contact zero; 0 (default): not estimated */
  double tare_sd_n;           /**< likewise, of the force that the sensor reads in the air */
  bool uniform_shear;         /**< one G and gm for the whole skin; default false */
  uint32_t threads;           /**< of stage 3; 0 (default): one per online core */
} sonde_fit_def;

SONDE_API sonde_fit_def sonde_fit_def_default(void); /**< @thread any */

/** Eq. (1) of one site and probe: F = A k0 s/(1 - s/xm), A the nominal footprint area. */
typedef struct sonde_curve_fit {
  uint32_t site;
  char probe[24];
  uint32_t count, iterations;
  double k0_n_m3, xm_m, mae_n;
  double zero_m, tare_n; /**< estimated by stage 3 when asked for; else 0 */
  bool converged;
} sonde_curve_fit;

/**
 * Fits eq. (1) to one curve by Levenberg-Marquardt in logarithms. docs/estimation.md.
 * @param start NULL for the closed-form start, else (k0, xm)
 * @return ARGUMENT with fewer than 3 points or no positive penetration @thread any
 */
SONDE_API sonde_status sonde_fit_curve(const double *penetration_m, const double *force_n,
                                       uint32_t count, double area_m2, double guard,
                                       const sonde_fit_def *def, const double start[2],
                                       sonde_curve_fit *fit, sonde_error *error);

enum { SONDE_FIT_TRIED = 7 };
/** How far stage 3 is to be trusted; intervals are estimate +- 1.96 sd in the logarithms. */
typedef struct sonde_fit_confidence {
  double smoothness_sd; /**< of ln k0 and ln xm per site spacing, chosen by leaving sites out */
  double shear_smoothness_sd; /**< of ln G and ln gm, likewise */
  uint32_t tried_count;       /**< 0 when the smoothness was given */
  double tried_sd[SONDE_FIT_TRIED], tried_percent[SONDE_FIT_TRIED]; /**< error of sites left out */
  double *ln_k0_sd, *ln_xm_sd;                                      /**< [site_count] */
  double *ln_site_shear_sd, *ln_site_limit_sd; /**< [site_count] of G and gm there */
  double ln_shear_sd, ln_limit_sd;             /**< of the leg's */
  double correlation[4][4];                    /**< of ln G, ln gm, mean ln k0, mean ln xm */
  double shear_95[2], limit_95[2];             /**< bootstrap over sites, N/m and slope */
  double *band_n;    /**< [measurements.count] half width of the force's 95 % band */
  double *one_out_n; /**< [measurements.count] force with its site left out (linearised) */
  sonde_error_report one_out;
} sonde_fit_confidence;

/** What an estimation found. */
typedef struct sonde_fit_result {
  uint32_t curve_count;
  sonde_curve_fit *curves; /**< stage 1, [curve_count] by site, then probe */
  uint32_t site_count;
  sonde_site *sites;     /**< [site_count] input sites with k0 and xm of the last stage */
  sonde_surface_law law; /**< the model's law with what the last stage estimated */
  uint32_t stage1_parameters, stage2_parameters; /**< 2 per curve; 2 per site + k_s (+ T0) */
  uint32_t parameters; /**< of the last stage; 3: 4 per site (2 with a uniform shear layer) + 2 */
  sonde_error_report stage1; /**< interaction "independent" */
  sonde_error_report stage2; /**< interaction "simplified"; zero counts when stages == 1 */
  sonde_error_report stage3; /**< interaction "full"; zero counts when stages < 3 */
  double *model_n;           /**< [measurements.count] forces of the last stage */
  uint32_t iterations, stage2_iterations; /**< of the last stage, of stage 2 */
  bool converged, stage2_converged;
  double cost, start_cost;  /**< half the sum of losses at the last stage's end and start; the start
                                 of stage 3 counts every fourth depth only, its end all */
  sonde_site *stage2_sites; /**< [site_count] with k0 and xm of stage 2; NULL when stages < 3 */
  sonde_surface_law stage2_law; /**< of stage 2, without shear layer */
  double stage2_edge_n_m;       /**< k_s of stage 2; the law of stage 3 has kept_edge_n_m */
  double edge_sd_log;           /**< standard deviation of ln k_s (Schur complement); 0 if none */
  double *stage_n[3];           /**< [measurements.count] forces of each stage; NULL when not run */
  double seconds[3];            /**< wall time of each stage */
  sonde_fit_confidence confidence; /**< of stage 3; NULL arrays before */
} sonde_fit_result;

/**
 * Stage 1 per curve; then one (k0, xm) per site for all its probes, without edges (stages == 1) or
 * with the simplified interaction and a uniform edge stiffness (2); then the refit on the full
 * equilibrium with a uniform shear layer and smooth site parameters (3); see docs/estimation.md.
 * @param model gives the refined skin, its normals and the law (guard, compression); unchanged
 * @return CANCELLED by progress; ARGUMENT for a probe without rectangular footprint or a curve of
 *   fewer than 3 points
 * @thread owner
 */
SONDE_API sonde_status sonde_fit(const sonde_model *model, const sonde_site_table *sites,
                                 const sonde_measurements *measurements, const sonde_fit_def *def,
                                 const sonde_progress *progress, sonde_fit_result *result,
                                 sonde_error *error);
SONDE_API void sonde_fit_result_clear(sonde_fit_result *result); /**< @thread owner */

/* ---- prediction -------------------------------------------------------------------------- */

typedef enum sonde_interaction {
  SONDE_INTERACTION_SIMPLIFIED, /**< neighbours of the footprint stay at rest */
  SONDE_INTERACTION_FULL,       /**< static equilibrium of the whole surface */
} sonde_interaction;

typedef struct sonde_predict_def {
  sonde_interaction interaction;
  double relative_residual; /**< of the equilibrium; default 1e-6 */
  uint32_t max_iterations;  /**< Newton iterations per depth; default 200 */
  uint32_t threads;         /**< 0: one per online core */
} sonde_predict_def;

SONDE_API sonde_predict_def sonde_predict_def_default(void); /**< @thread any */

/**
 * The model's force for each measurement, footprint bonded; the same for any number of threads.
 * @param predicted_n [count] NaN where the equilibrium was not found
 * @return CANCELLED by progress @thread owner
 */
SONDE_API sonde_status sonde_predict(const sonde_model *model, const sonde_site_table *sites,
                                     const sonde_measurements *measurements,
                                     const sonde_predict_def *def, const sonde_progress *progress,
                                     double *predicted_n, sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
