// The two-layer tissue: forces and linearisation at a state, over an active part of the mesh.
#ifndef SONDE_SRC_TWO_LAYER_H
#define SONDE_SRC_TWO_LAYER_H

#include "base/link.h"
#include "sonde/sparse.h"
#include "sonde/tissue.h"

// The part of the mesh that takes part in an evaluation; a NULL part means all.
// Edges are those with at least one row among `rows`; their other ends, in `rim`, are held.
typedef struct sonde_tissue_part {
  const uint32_t *rows;
  uint32_t row_count;
  const uint32_t *rim;
  uint32_t rim_count;
  const uint32_t *edges;
  uint32_t edge_count;
  const uint32_t *faces; // with at least one row among their corners
  uint32_t face_count;
} sonde_tissue_part;

// Scratch of an evaluation, per node.
typedef struct sonde_tissue_node {
  double indentation_m, rate_m_s; // s = N.(X - x) and its rate
  double shear_n_m;               // the shear layer's stiffness at the node, scaled
  sonde_vec3 slide_m, slide_m_s;  // displacement and velocity less their parts along N
  sonde_vec3 pull_n, drag_n_s;    // of the in-plane layer, before the part along N is taken out
  double inplane_n_m;             // its stiffness at the node, scaled
  bool is_row;                    // of the evaluated part
} sonde_tissue_node;

// A x = b of the implicit step (docs/world.md): A = mass_scale*M + damping_scale*C +
// stiffness_scale*K, and the product K v0 for the right-hand side. Scales of zero leave terms out.
typedef struct sonde_tissue_scales {
  double mass, damping, stiffness;
} sonde_tissue_scales;

// Fills force[] (elastic and damping forces of the tissue on its nodes), stiffness_velocity[]
// (K v) and the matrix. All rows of the part are overwritten; rows outside are untouched in
// `matrix`' upper blocks; `scratch` has one entry per node.
// @thread tick (no allocation)
SONDE_LINK void sonde_tissue_linearise(const sonde_model *model, const sonde_tissue_part *part,
                                       const sonde_vec3 *position, const sonde_vec3 *velocity,
                                       const sonde_tissue_scales *scales, sonde_vec3 *force,
                                       sonde_vec3 *stiffness_velocity, sonde_block_matrix *matrix,
                                       sonde_tissue_node *scratch);

// G (N/m) and gm of a face: the law's times the mean share of its corners. @thread tick
void sonde_tissue_face_law(const sonde_model *model, uint32_t f, double *shear_n_m, double *limit);

// Whether a law couples neighbours over faces.
static inline bool sonde_tissue_is_layered(const sonde_surface_law *law) {
  return law->shear_stiffness_n_m > 0 || law->inplane_stiffness_n_m > 0;
}

// Total elastic energy of all springs (J); tests and line searches.
SONDE_LINK double sonde_tissue_energy(const sonde_model *model, const sonde_vec3 *position);

// Energy per area of a normal spring (sonde_normal_pressure()) at indentation s. @thread any
double sonde_normal_energy(double exponent, double k0_n_m3, double xm_m, double guard, double s_m);
// Energy per area of the shear layer. @thread any
double sonde_shear_energy(double shear_n_m, double limit, double g);
#endif
