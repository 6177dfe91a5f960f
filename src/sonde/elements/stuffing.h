// What the two files of the mesher share.
#ifndef SONDE_SRC_STUFFING_H
#define SONDE_SRC_STUFFING_H

#include "elements/tetrahedra.h"
#include "base/base.h"
#include "base/maths.h"

// The solid: inside the outer and outside the inner surface.
typedef struct sonde_solid_domain {
  sonde_surface_index *outer, *inner; // inner may be NULL
} sonde_solid_domain;

// Distance from the solid's surface, negative inside; *on_inner tells whether that is the inner
// one.
double sonde_domain_distance(const sonde_solid_domain *domain, sonde_vec3 p, bool *on_inner);
// The nearest point of one of the surfaces.
sonde_vec3 sonde_domain_nearest(const sonde_solid_domain *domain, sonde_vec3 p, bool on_inner);

// Where a node may go.
typedef enum sonde_node_kind {
  SONDE_NODE_INSIDE,
  SONDE_NODE_OUTER,
  SONDE_NODE_INNER
} sonde_node_kind;

// Tetrahedra around each node: list[start[i]] .. list[start[i + 1] - 1] at node i.
typedef struct sonde_around {
  uint32_t *start, *list;
} sonde_around;
// Release both by sonde_free, after a failure, too.
sonde_status sonde_around_find(const uint32_t (*corner)[4], uint32_t count, uint32_t node_count,
                               sonde_around *around, sonde_error *error);

// Smallest sine of the six dihedral angles; not positive for a tetrahedron that is inside out.
double sonde_dihedral_sine(const sonde_vec3 p[4]);
// The smallest such sine of the tetrahedra around a node; *which is the worst of them.
double sonde_worst_sine(const sonde_vec3 *node, const uint32_t (*corner)[4],
                        const sonde_around *around, uint32_t at, uint32_t *which);
// Moves nodes where that makes the worst of the tetrahedra around them better; nodes of a surface
// move along it. @thread owner
sonde_status sonde_tetrahedra_smooth(sonde_tetrahedra *t, const uint8_t *kind,
                                     const sonde_solid_domain *domain, sonde_error *error);

#endif
