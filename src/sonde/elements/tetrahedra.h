// Tetrahedral meshes of what closed surfaces enclose.
#ifndef SONDE_SRC_TETRAHEDRA_H
#define SONDE_SRC_TETRAHEDRA_H

#include "base/link.h"
#include "sonde/geometry.h"

// Nodes come in three runs: the free ones of the boundary, those of the inner surface, which bone
// holds, and those inside the solid. Released by sonde_tetrahedra_clear().
typedef struct sonde_tetrahedra {
  uint32_t node_count, count;
  uint32_t surface_count; // free nodes of the outer surface: 0 .. surface_count - 1
  uint32_t held_count;    // nodes of the inner surface: surface_count .. + held_count - 1
  sonde_vec3 *node;       // [node_count]
  uint32_t (*corner)[4];  // [count] positively oriented: (b-a) x (c-a) . (d-a) > 0
  // Closed, outward; its vertices are the first surface_count + held_count nodes. The faces of the
  // outer surface come first, outer_face_count of them.
  sonde_mesh boundary;
  uint32_t outer_face_count;
} sonde_tetrahedra;

// How long the edges are. Each member is a length in metres but growth; 0 means the default.
typedef struct sonde_tetrahedra_def {
  double edge_m; // about the mean edge at the surface; no default
  double growth; // by so much the edges grow per metre of depth; default 0.4
  // Points of finer edges, NULL: none. Beyond fine_reach_m of them edges grow as with depth.
  const sonde_vec3 *fine;
  uint32_t fine_count;
  double fine_edge_m, fine_reach_m;
} sonde_tetrahedra_def;

// Fills the space inside `outer` and outside `inner` (NULL: all of it) with tetrahedra that share
// whole faces, by isosurface stuffing of a graded body-centred lattice (Labelle and Shewchuk 2007).
// Nodes of the boundary lie on the surfaces; sharp creases are chamfered by less than an edge.
// docs/elements.md.
// @return SONDE_ARGUMENT for bad lengths, or edges that ask for over 4 million cells; SONDE_MESH
//   for a surface that is open, points inwards, crosses itself or is too thin for the edges
// @thread owner
sonde_status sonde_tetrahedralise(const sonde_mesh *outer, const sonde_mesh *inner,
                                  const sonde_tetrahedra_def *def, sonde_tetrahedra *tetrahedra,
                                  sonde_error *error);
void sonde_tetrahedra_clear(sonde_tetrahedra *tetrahedra); // NULL is ignored

// Measures of a mesh.
typedef struct sonde_tetrahedra_report {
  double smallest_dihedral_rad, largest_dihedral_rad;
  double smallest_volume_m3, volume_m3;
  double mean_edge_m;   // of the outer boundary
  double off_surface_m; // farthest of the boundary's nodes and face centres from the surfaces
} sonde_tetrahedra_report;
// @param outer,inner as in sonde_tetrahedralise(); outer NULL: off_surface_m is 0
// @thread owner
sonde_status sonde_tetrahedra_inspect(const sonde_tetrahedra *tetrahedra, const sonde_mesh *outer,
                                      const sonde_mesh *inner, sonde_tetrahedra_report *report,
                                      sonde_error *error);

#endif
