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
  uint32_t version;          /**< SONDE_DEF_VERSION, from sonde_fit_bulk_def_default() */
  sonde_model_kind kind;     /**< a volumetric one; default linear solid */
  double edge_m;             /**< mean edge of the mesh at the skin; 0, the default: 15 mm, of a
                                  condensed solid 20 mm */
  double fine_edge_m;        /**< within fine_reach_m of a measured site; 0: 5 mm or 10 mm */
  double fine_reach_m;       /**< default 5 mm */
  double growth;             /**< of the edges per metre of depth; default 1 */
  double poisson;            /**< of solids; default 0.45 */
  uint32_t sites;            /**< that the moduli are sought on, spread over the skin; default 8 */
  uint32_t depths;           /**< of each of their curves; default 3 */
  uint32_t max_steps;        /**< of Levenberg-Marquardt; default 12 */
  const sonde_model *layers; /**< whose depths of fat and muscle count; NULL: the definition's */
  uint32_t threads;          /**< 0, the default: one per online core */
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

/** The volumetric model of a definition with the kind's default moduli: the mesh alone.
 * @return as sonde_fit_bulk() @thread owner */
SONDE_API sonde_status sonde_bulk_model(const sonde_model_def *def,
                                        const sonde_fit_bulk_def *options, sonde_model **model,
                                        sonde_error *error);

/** A linear solid condensed to the nodes of its skin (Bro-Nielsen and Cotin 1996): K* = K_ss - K_si
 * K_ii^-1 K_is and its inverse, computed beforehand. */
typedef struct sonde_condensed_cost {
  uint32_t nodes, skin_nodes, contact_nodes;
  double setup_s;           /**< wall time of condensing and inverting */
  double bytes;             /**< of K* and its inverse */
  double contact_s;         /**< forces that move the touched nodes, median */
  double update_s;          /**< displacements of all nodes of the skin under them, median */
  double force_n;           /**< on the footprint along the inward normal */
  double solve_difference;  /**< of the forces from those of the whole solid's factor, relative */
  double engine_difference; /**< of force_n from the engine's equilibrium of the same model,
                               relative */
} sonde_condensed_cost;

/**
 * What condensation costs for a footprint that is bonded to the skin at a site and moved in.
 * @param model a linear solid of at most 2,500 nodes of the skin
 * @return ARGUMENT for another kind or a larger skin; CONVERGENCE; MEMORY @thread owner
 */
SONDE_API sonde_status sonde_condensed_measure(const sonde_model *model, const sonde_site *site,
                                               double half_u_m, double half_v_m, double depth_m,
                                               uint32_t threads, sonde_condensed_cost *cost,
                                               sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
