// Volumetric models: making one from a model of the skin and tetrahedra, and the stiffness between
// its nodes. Formulas: docs/bulk.md.
#ifndef SONDE_SRC_BULK_H
#define SONDE_SRC_BULK_H

#include "base/link.h"
#include "elements/elastic.h"
#include "sonde/tissue.h"

// Defaults of a kind: moduli of a thigh, incompressible within a part of a hundred.
SONDE_LINK sonde_bulk_law sonde_bulk_law_default(sonde_model_kind kind);

// Turns a model whose skin is the outer boundary of `solid`, vertex for vertex in any order, into a
// volumetric one: an element is fat where its middle is less deep than the fat/muscle interface
// below the nearest node of the skin.
// @return ARGUMENT for a law out of range or a two-layer kind, MISMATCH for another skin
// @thread owner
sonde_status sonde_model_fill(sonde_model *model, const sonde_tetrahedra *solid,
                              sonde_model_kind kind, const sonde_bulk_law *law, sonde_error *error);
// How the tetrahedra of a model are to be; lengths in m, as in sonde_tetrahedra_def.
typedef struct sonde_bulk_mesh {
  double edge_m, growth, fine_edge_m, fine_reach_m; // fine at every site of the model
} sonde_bulk_mesh;

// Fills the space between the definition's skin and bone with tetrahedra and makes a volumetric
// model on their boundary. A bone that reaches the skin's cut ends is shortened along itself.
// @param layers whose depths of fat and muscle count; NULL: those of the definition's interfaces
// @param[out] worst_rad smallest dihedral angle; may be NULL
// @return ARGUMENT without a bone or for a law out of range; MESH
// @thread owner
SONDE_LINK sonde_status sonde_bulk_build(const sonde_model_def *def, const sonde_bulk_mesh *mesh,
                                         const sonde_model *layers, sonde_model_kind kind,
                                         const sonde_bulk_law *law, sonde_model **model,
                                         double *worst_rad, sonde_error *error);
// The same body and law with a mesh that is fine (2 mm) at a place of its skin, coarse elsewhere.
// @param[out] local owned by the caller @thread owner
SONDE_LINK sonde_status sonde_bulk_refine_at(const sonde_model *model, sonde_vec3 place_m,
                                             sonde_model **local, sonde_error *error);

// Another law for a volumetric model; states that were made before keep theirs. @thread owner
SONDE_LINK sonde_status sonde_model_set_bulk_law(sonde_model *model, const sonde_bulk_law *law,
                                                 sonde_error *error);
// Masses, areas, shortest edges and neighbours from nodes and elements. @thread owner
sonde_status sonde_bulk_derive(sonde_bulk *bulk, const sonde_model *model, sonde_error *error);
void sonde_bulk_destroy(sonde_bulk *bulk);

// Of the spring along an edge.
typedef struct sonde_bulk_spring {
  double stiffness_n_m, steep_n_m, knee; // knee: a strain
} sonde_bulk_spring;

// What couples a moving node with its neighbours, held ones too.
typedef struct sonde_bulk_graph {
  uint32_t *start, *neighbour; // [node_count + 1], [start[node_count]]
  sonde_bulk_spring *spring;   // likewise; NULL without springs
  sonde_mat3 *block;           // likewise, K_ij of a linear solid; NULL for others
  sonde_mat3 *own;             // [node_count] K_ii at rest
  double *compliance; // [3 node_count][3 node_count] of a condensed solid, (K*)^-1; else NULL
} sonde_bulk_graph;
sonde_status sonde_bulk_graph_create(const sonde_model *model, sonde_bulk_graph *graph,
                                     sonde_error *error);
void sonde_bulk_graph_clear(sonde_bulk_graph *graph);
// Elastic energy of the moving nodes' places, J. @thread any
double sonde_bulk_graph_energy(const sonde_model *model, const sonde_bulk_graph *graph,
                               const sonde_vec3 *position);

// The elastic solid of a linear or condensed model, its skin last, for condensing.
typedef struct sonde_bulk_elastic {
  sonde_tetrahedra mesh; // borrows the model's arrays
  sonde_elastic *elastic;
} sonde_bulk_elastic;
// @return ARGUMENT for a skin of more than 2,500 nodes; CONVERGENCE @thread owner
SONDE_LINK sonde_status sonde_bulk_elastic_create(const sonde_model *model,
                                                  sonde_bulk_elastic *solid, sonde_error *error);
// K* into the blocks of a condensed model's graph, whose neighbours are there, and its inverse.
// @thread owner
sonde_status sonde_bulk_condense(const sonde_model *model, sonde_bulk_graph *graph,
                                 sonde_error *error);
// Masses and neighbours of a condensed model from those of the whole solid. @thread owner
sonde_status sonde_bulk_derive_skin(sonde_bulk *bulk, const sonde_model *model, sonde_error *error);

// Whether tetrahedra of a kind carry stress themselves.
bool sonde_bulk_is_solid(const sonde_model *model);
// Volume of a tetrahedron and the gradients of its shape functions.
double sonde_bulk_gradients(const sonde_bulk *bulk, uint32_t element, sonde_vec3 gradient[4]);
// Lame's constants of a tetrahedron, Pa.
void sonde_bulk_solid(const sonde_model *model, uint32_t element, double *mu, double *lambda);

#endif
