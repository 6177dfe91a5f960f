/**
 * @file fit_report.h
 * The report of an estimation: one self-contained HTML page with figures and tables. What it shows
 * and how: docs/report.md.
 */
#ifndef SONDE_FIT_REPORT_H
#define SONDE_FIT_REPORT_H

#include "sonde/fit.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_REPORT_STAGES = 6 };

/** Forces of one estimated model, for one row of the table of stages. */
typedef struct sonde_report_stage {
  const char *name;      /**< e.g. "stage 3, full model" */
  uint32_t parameters;   /**< 0: not shown */
  const double *model_n; /**< [measurements.count] NaN where the model has no force */
  bool is_main;          /**< the figures show this one; the last stage when none is */
} sonde_report_stage;

/** A value with its intervals (95 %); NaN where there is none. */
typedef struct sonde_report_interval {
  double value;
  double lower, upper;                     /**< from the covariance or the profile */
  double bootstrap_lower, bootstrap_upper; /**< from the bootstrap */
} sonde_report_interval;

/** Interval without bounds. @thread any */
SONDE_API sonde_report_interval sonde_report_value(double value);

/** A parameter of the whole model. */
typedef struct sonde_report_parameter {
  const char *name, *unit;
  sonde_report_interval estimate; /**< in `unit` */
  const char *note;
} sonde_report_parameter;

/** The parameters of one site. */
typedef struct sonde_report_site {
  uint32_t site; /**< id */
  sonde_report_interval k0_n_m3, xm_m;
  sonde_report_interval shear_n_m, shear_limit; /**< shown when positive */
} sonde_report_site;

/** Profile likelihood of one parameter. */
typedef struct sonde_report_profile {
  const char *name, *unit;
  uint32_t count;
  const double *x;         /**< [count] ascending, in `unit` */
  const double *rise;      /**< [count] 2 (cost - least cost); NaN where not found */
  const double *quadratic; /**< [count] the same from the covariance alone; may be NULL */
  double estimate;
  double threshold; /**< rise at the bounds of the 95 % interval; 0: 3.841 (chi^2, 1 degree) */
} sonde_report_profile;

/** How well some data determine a parameter. */
typedef struct sonde_report_identifiability {
  const char *parameter; /**< rows of one parameter stand together */
  const char *data;      /**< e.g. "point only" */
  double relative_sd;    /**< 0.1 is 10 %; NaN or infinite: not determined */
} sonde_report_identifiability;

/** Errors on data that the estimation did not see. */
typedef struct sonde_report_holdout {
  const char *left_out; /**< what was left out */
  const char *probe;
  double mae_n, sd_n;
  double percent;          /**< MAE over the mean force of the same data */
  double training_percent; /**< of the data that were seen; NaN: not known */
} sonde_report_holdout;

typedef struct sonde_report_timing {
  const char *name;
  double seconds;
} sonde_report_timing;

/**
 * What the page tells. All pointers are borrowed; what is NULL or 0 is left out without a trace,
 * names may hold any UTF-8 text. Nothing else enters: equal reports give equal bytes.
 */
typedef struct sonde_fit_report {
  const char *title;        /**< NULL: "Estimation report" */
  const char *provenance;   /**< of the data; a text with "synthetic" or "computed" is repeated as
                                 a remark; NULL: the model's */
  const char *command_line; /**< that made it */
  const char *version;      /**< of the program */
  const char *date;         /**< as shown */

  const sonde_model *model;       /**< with the main stage's parameters: maps, sites */
  const sonde_site_table *sites;  /**< fat thickness, places; NULL: the model's sites */
  const sonde_measurements *data; /**< stages and figures of errors need it */

  const sonde_report_stage *stages; /**< [stage_count] */
  uint32_t stage_count;             /**< at most SONDE_REPORT_STAGES */
  const double *band_n; /**< [data.count] half width of the main stage's 95 % prediction band */

  const sonde_report_parameter *parameters; /**< [parameter_count] */
  uint32_t parameter_count;
  const sonde_report_site *site_parameters; /**< [site_parameter_count] */
  uint32_t site_parameter_count;
  const char *const *correlation_names; /**< [correlation_count] */
  const double *correlation;            /**< [correlation_count^2] row-major; NaN: unknown */
  uint32_t correlation_count;
  const sonde_report_profile *profiles; /**< [profile_count] */
  uint32_t profile_count;
  const sonde_report_identifiability *identifiability; /**< [identifiability_count] */
  uint32_t identifiability_count;
  const sonde_report_holdout *holdouts; /**< [holdout_count] */
  uint32_t holdout_count;
  const sonde_report_timing *timings; /**< [timing_count] */
  uint32_t timing_count;
  const char *const *notes; /**< [note_count] remarks and warnings */
  uint32_t note_count;
} sonde_fit_report;

/**
 * Writes `directory`/index.html, complete or not at all; the directory is made when it is missing
 * (its parent must exist).
 * @return ARGUMENT for too many stages, a stage without name or forces, forces without data, sites
 *   or probes beyond SONDE_FIT_PROBES; IO naming the file; MEMORY
 * @thread owner
 */
SONDE_API sonde_status sonde_fit_report_write(const sonde_fit_report *report, const char *directory,
                                              sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
