// What a state of the solid does to points of the leg, for one state after another.
#ifndef SONDE_SRC_INSIDE_H
#define SONDE_SRC_INSIDE_H

#include "equilibrium.h"

// What a point shares in: corners of hexahedra (8 hexahedron + corner).
typedef struct sonde_tissue_shares {
  uint32_t count, corner[8];
  double weight[8];
} sonde_tissue_shares;

// Of a point at rest: they stay from state to state. @param tissue of sonde_equilibrium_tissue()
sonde_tissue_shares sonde_solid_tissue_shares(const sonde_interior_tissue *tissue,
                                              sonde_vec3 rest_m);
sonde_vec3 sonde_solid_tissue_moved(const sonde_interior_tissue *tissue,
                                    const sonde_tissue_shares *shares);
// Another state of the solid that it was made of: displacements [node_count]. Of the equilibrium
// only what does not move is read. Allocates nothing.
void sonde_solid_tissue_fill(sonde_interior_tissue *tissue, const sonde_equilibrium *equilibrium,
                             const sonde_vec3 *moved);

#endif
