// A volumetric body for an engine that keeps a matrix of blocks, such as a scene's: forces and
// tangent of the body's own kernel (kernel.h, through tissue/deformable.h) in double precision,
// handed out node by node.
#ifndef SONDE_SRC_BULK_BLOCKS_H
#define SONDE_SRC_BULK_BLOCKS_H

#include "tissue/nodes.h"
#include "tissue/two_layer/linearise.h"

typedef struct sonde_bulk_blocks sonde_bulk_blocks;

// @param model borrowed; its nodes lie where the body is at rest @thread owner
SONDE_LINK sonde_status sonde_bulk_blocks_create(const sonde_model *model,
                                                 sonde_bulk_blocks **blocks, sonde_error *error);
SONDE_LINK void sonde_bulk_blocks_destroy(sonde_bulk_blocks *blocks);
// Pairs of moving nodes that forces couple, i < j in ascending order: how many, and, where `pairs`
// is not NULL, which. @thread any
SONDE_LINK uint32_t sonde_node_pairs(const sonde_nodes *nodes, uint32_t (*pairs)[2]);

// As sonde_tissue_linearise, of all moving nodes; the pairs of `matrix` are those above.
// @thread tick
SONDE_LINK void sonde_bulk_linearise(sonde_bulk_blocks *blocks, const sonde_vec3 *position,
                                     const sonde_vec3 *velocity, const sonde_tissue_scales *scales,
                                     sonde_vec3 *force, sonde_vec3 *stiffness_velocity,
                                     sonde_block_matrix *matrix);
// Elastic energy, J. @thread any
SONDE_LINK double sonde_bulk_energy(const sonde_bulk_blocks *blocks, const sonde_vec3 *position);

#endif
