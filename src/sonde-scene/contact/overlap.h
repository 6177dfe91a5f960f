// Memory of an overlap and what its steps share.
#ifndef SONDE_SRC_CONTACT_OVERLAP_H
#define SONDE_SRC_CONTACT_OVERLAP_H

#include "contact/tree.h"

// Coordinates along which faces are compared: u and v across, z along k, from an origin nearby.
typedef struct view {
  sonde_vec3 u, v, k, origin;
  sonde_vec3 abs_u, abs_v, abs_k;
  sonde_bounds window; // in these coordinates: nothing outside matters
} view;

// A face seen along k.
typedef struct seen_face {
  uint32_t face;
  const uint32_t *corner; // its vertices
  sonde_vec3 p[3];        // (u, v, z) of the corners
  double twice_area;      // signed: positive when it looks along k
  sonde_bounds box;
} seen_face;

enum { POLYGON_CORNERS = 16 };

// The part of two faces that cover each other, with the depth z_a - z_b.
typedef struct covered {
  uint32_t count;
  double u[POLYGON_CORNERS], v[POLYGON_CORNERS], depth[POLYGON_CORNERS];
} covered;

// Area, centroid and the second moments about it.
typedef struct moments {
  double area, u, v, uu, uv, vv;
} moments;

// A pair of faces above each other.
typedef struct piece {
  uint32_t face[2];
  double area, depth; // mean
  double weight[2][3];
  int8_t side[2]; // +1 when the face looks along k
  bool crossing;  // the faces touch somewhere in it
  uint32_t part;  // scratch: part of the other side
} piece;

// What one body keeps per face and per vertex; rows are valid where the stamp is the present one.
typedef struct overlap_body {
  uint32_t vertex_room, face_room;
  const sonde_face_tree *tree;
  uint64_t *face_stamp;        // [faces]
  double *net, *scale;         // [faces] covered area inside the other body; size^2 of the face
  uint32_t (*corner)[3];       // [faces]
  sonde_vec3 *area_per_shadow; // [faces] n dA per area seen along k
  uint32_t *region;            // [faces] SONDE_NO_REGION when not touched
  uint32_t *seen, seen_count;  // faces with a valid row
  uint64_t *vertex_stamp;      // [vertices]
  sonde_vec3 *gradient;        // [vertices] of the region at work
  uint32_t *touched;           // [vertices] vertices of the region at work
  uint32_t *order;             // [max_pieces] pieces by the region of this side
  uint32_t *first;             // [max_regions + 2] rows of order
  sonde_overlap_entry *entries;
  uint32_t entry_room, entry_count;
  uint32_t *counted; // [faces] last region that counted the face
} overlap_body;

#define SONDE_NO_REGION UINT32_MAX

// A class of the union-find that a region is made of.
typedef struct overlap_group {
  uint32_t parts[2]; // components of A and of B in it
  bool whole;        // not to be split
  uint32_t region;   // when it is not split
  int split_by;      // 0 or 1: each component of that body is a region; -1: one region
} overlap_group;

struct sonde_overlap {
  void *block; // all arrays below and those of the bodies
  sonde_overlap_config config;
  overlap_body body[2];
  piece *pieces;
  uint32_t piece_count;
  bool steep;   // a face almost along k was met: its shadow says nothing
  bool patient; // goes on all the same
  // Nodes of both union-finds: vertices of A, then of B.
  uint64_t *node_stamp;
  uint32_t *part, *group;     // [nodes] parents: within a body; over both
  uint32_t *part_region;      // [nodes] region of a part's root
  overlap_group *group_facts; // [nodes] at a group's root
  uint64_t stamp, stamp_vertices;
  double volume_m3;
  sonde_overlap_region *regions;
  sonde_overlap_point *points;
  uint32_t *family;       // [max_regions] first region of the same group
  int *split_by;          // [max_regions] as in its group
  uint32_t column_region; // whose columns are being made
  bool layered;           // its columns may have gaps
  double deepest;
  uint32_t region_count, point_count;
  sonde_overlap_result result;
};

typedef void (*sonde_pair_fn)(sonde_overlap *overlap, const view *view, const seen_face *a,
                              const seen_face *b, const covered *polygon, double low);

// View along k with the window around the common part of two boxes.
view sonde_view_make(sonde_vec3 k, sonde_bounds common);
// Calls fn for every pair of faces that cover each other in the window with A above B somewhere;
// low is the least depth before the cut at depth 0. With `marked`, only faces that carry a region.
void sonde_view_pairs(sonde_overlap *overlap, const view *view, bool marked, sonde_pair_fn fn);
moments sonde_covered_moments(const covered *polygon);
// Barycentric weights of a point of the view.
void sonde_seen_weights(const seen_face *face, double u, double v, double weight[3]);

// Classes of touched faces, their regions and gradients.
void sonde_overlap_regions(sonde_overlap *overlap, sonde_vec3 k);
// Region that the part of a piece on one side belongs to; SONDE_NO_REGION when its face is outside.
uint32_t sonde_piece_region(sonde_overlap *overlap, const piece *p, int side);
// Columns of every region along its direction.
void sonde_overlap_columns(sonde_overlap *overlap);

#endif
