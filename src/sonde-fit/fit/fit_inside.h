// Shared inside the fit room: tables, footprints and the force of the simplified interaction.
#ifndef SONDE_SRC_FIT_INSIDE_H
#define SONDE_SRC_FIT_INSIDE_H

#include "base/base.h"
#include "sonde/fit.h"

// How far a site may lie from the skin.
#define SONDE_SITE_TOLERANCE_M 5e-3

// The def with its loss scale filled in.
sonde_fit_def sonde_fit_def_complete(const sonde_fit_def *def);

// Index of a site id in the table; UINT32_MAX when absent.
uint32_t sonde_site_find(const sonde_site_table *table, uint32_t id);
// Empty table with room for some rows; count stays 0.
sonde_status sonde_measurements_create(sonde_measurements *m, uint32_t room, sonde_error *error);

// Index of a probe name, added when new; UINT32_MAX when SONDE_FIT_PROBES are in use.
uint32_t sonde_probe_index(char probe[][24], uint32_t *count, const char *name);

// Rows of the measurements in the order (site index, probe, penetration), cut into curves (one site
// and probe) and sites.
typedef struct sonde_fit_plan {
  uint32_t row_count;
  uint32_t *row;        // [row_count] index into the measurements
  uint32_t probe_count; // distinct probes, order of first appearance
  char probe[SONDE_FIT_PROBES][24];
  double half_u_m[SONDE_FIT_PROBES], half_v_m[SONDE_FIT_PROBES];
  double mean_force_n[SONDE_FIT_PROBES];
  uint32_t *row_probe; // [row_count] of the sorted rows
  uint32_t *row_curve; // [row_count]
  uint32_t curve_count;
  uint32_t *curve_start;                   // [curve_count + 1] sorted rows
  uint32_t *curve_site;                    // [curve_count] site index
  uint32_t *curve_probe;                   // [curve_count]
  uint32_t site_count;                     // measured sites
  uint32_t *site_start;                    // [site_count + 1] sorted rows
  uint32_t *site_index;                    // [site_count] index into the site table
  double *site_deepest_m;                  // [site_count] largest penetration
  uint32_t unsorted_rows;                  // that stood before a shallower one of their curve
  uint32_t excluded_curves, excluded_rows; // left out: row_count + excluded_rows measurements
} sonde_fit_plan;

// Which of the measured sites a curve is of.
static inline uint32_t sonde_plan_site_of(const sonde_fit_plan *plan, uint32_t curve) {
  uint32_t at = 0;
  while (plan->site_index[at] != plan->curve_site[curve]) ++at;
  return at;
}

enum { SONDE_FIT_LEAST_STEPS = 3 }; // positive penetrations of a curve that can be fitted

// Sorts and checks the measurements for a prediction: every row counts.
// @return ARGUMENT for a probe without rectangular footprint
sonde_status sonde_fit_plan_create_all(const sonde_site_table *sites, const sonde_measurements *m,
                                       sonde_fit_plan *plan, sonde_error *error);
// The same for a fit: curves of fewer than SONDE_FIT_LEAST_STEPS steps or without a positive mean
// force are left out and counted, with one warning per reason; so is said when one probe is left.
// @return ARGUMENT also when no curve remains
sonde_status sonde_fit_plan_create(const sonde_site_table *sites, const sonde_measurements *m,
                                   sonde_fit_plan *plan, sonde_error *error);
void sonde_fit_plan_clear(sonde_fit_plan *plan);

// How much of a node's cell counts.
typedef enum sonde_coverage {
  SONDE_COVERAGE_CLIPPED, // the part under the rectangle, of every touched node
  SONDE_COVERAGE_CELLS,   // the whole cell of every held node, as in the full model
} sonde_coverage;

// The skin under a rectangle that moves rigidly along -normal.
typedef struct sonde_footprint {
  uint32_t node_count;
  uint32_t *node;    // nodes that carry the normal law
  double *weight_m2; // their areas
  double *cosine;    // rest normal . site normal
  uint32_t held_count;
  uint32_t *held; // nodes moved with the probe: more than half of the cell covered
  uint32_t edge_count;
  uint32_t *edge; // edges from a held node to one that stays
  double *rest_m; // their rest lengths
  double *rise_m; // held minus outer end along the normal, negated: (x_out - x_held) . n
} sonde_footprint;

sonde_status sonde_footprint_create(const sonde_model *model, const sonde_site *site,
                                    double half_u_m, double half_v_m, sonde_coverage coverage,
                                    sonde_footprint *footprint, sonde_error *error);
void sonde_footprint_clear(sonde_footprint *footprint);
// Area of the skin under the rectangle.
sonde_status sonde_footprint_area(const sonde_model *model, const sonde_site *site, double half_u_m,
                                  double half_v_m, double *area_m2, sonde_error *error);

// Force along the normal of the edges at depth x for unit stiffness, and of a unit pre-tension.
// psi(x) = (l - L)(x + h)/l, l = sqrt(L^2 + 2 h x + x^2), h the rise: with h = 0 it is
// (sqrt(L^2 + x^2) - L) x/sqrt(L^2 + x^2) of docs/fit.md. Shortened edges keep the share
// compression.
void sonde_footprint_edges(const sonde_footprint *footprint, double x, double compression,
                           double *per_stiffness_m, double *per_tension);

// Force of the simplified interaction with the model's parameters at its nodes.
double sonde_footprint_force(const sonde_footprint *footprint, const sonde_model *model, double x);

// Measurements of both tables, the first ones first; released by sonde_free(both->data). ARGUMENT
// when a probe occurs in both.
sonde_status sonde_measurements_join(const sonde_measurements *m, const sonde_measurements *also,
                                     sonde_measurements *both, sonde_error *error);

void sonde_fit_confidence_clear(sonde_fit_confidence *confidence);

#endif
