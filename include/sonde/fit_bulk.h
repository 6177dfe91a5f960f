/**
 * @file fit_bulk.h
 * Volumetric models of the thigh, fitted to the measurements by a few moduli: earlier systems'
 * models beside the two-layer one. Formulas: docs/bulk.md.
 */
#ifndef SONDE_FIT_BULK_H
#define SONDE_FIT_BULK_H

#include "sonde/fit.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_BULK_PARAMETERS = 6 };

typedef struct sonde_fit_bulk_def {
  uint32_t version;      /**< SONDE_DEF_VERSION, from sonde_fit_bulk_def_default() */
  sonde_model_kind kind; /**< a volumetric one; default linear solid */
  double edge_m;         /**< mean edge of the mesh at the skin; default 15 mm */
  double fine_edge_m;    /**< within fine_reach_m of a measured site; default 5 mm */
  double fine_reach_m;   /**< default 5 mm */
  double growth;         /**< of the edges per metre of depth; default 1 */
  double poisson;        /**< of solids; default 0.45 */
  uint32_t sites;        /**< that the moduli are sought on, spread over the skin; default 8 */
  uint32_t depths;       /**< of each of their curves; default 3 */
  uint32_t max_steps;    /**< of Levenberg-Marquardt; default 12 */
  uint32_t threads;      /**< 0, the default: one per online core */
} sonde_fit_bulk_def;

SONDE_API sonde_fit_bulk_def sonde_fit_bulk_def_default(void); /**< @thread any */

/** What was found. */
typedef struct sonde_fit_bulk_result {
  uint32_t parameter_count;
  const char *parameter[SONDE_BULK_PARAMETERS]; /**< names with units */
  double value[SONDE_BULK_PARAMETERS];
  double start_cost, cost; /**< half the sum of squares over the sought rows, N^2 */
  uint32_t steps, trials;
  bool converged;
  uint32_t node_count, skin_nodes, element_count;
  double worst_dihedral_rad;
  double mesh_s, fit_s, predict_s; /**< wall time */
  sonde_error_report all;          /**< every measurement, predicted by the model */
} sonde_fit_bulk_result;

/**
 * Fills the skin of `def` (outside its bone) with tetrahedra, seeks the kind's moduli by
 * Levenberg-Marquardt in their logarithms on some sites, and scales them once by all measurements.
 * A footprint is bonded, as in sonde_predict().
 * @param def as for sonde_model_build(); its skin and femur are those that the solid lies between
 * @param[out] model owned by the caller
 * @param[out] predicted_n [measurements.count] forces of the model; NaN without equilibrium
 * @return ARGUMENT, MESH as sonde_model_build(); CANCELLED
 * @thread owner
 */
SONDE_API sonde_status sonde_fit_bulk(const sonde_model_def *def, const sonde_site_table *sites,
                                      const sonde_measurements *measurements,
                                      const sonde_fit_bulk_def *options,
                                      const sonde_progress *progress, sonde_model **model,
                                      sonde_fit_bulk_result *result, double *predicted_n,
                                      sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
