// Inside of the geometry room: what its files share and nobody else needs.
#ifndef SONDE_SRC_GEOMETRY_INTERNAL_H
#define SONDE_SRC_GEOMETRY_INTERNAL_H

#include "base/link.h"
#include "base/base.h"
#include "base/maths.h"
#include "sonde/geometry.h"

#include <stdarg.h>

#define SONDE_NONE UINT32_MAX

// One side of a face: the edge low < high as the face runs through it.
typedef struct sonde_half_edge {
  uint32_t low, high, face;
  uint32_t forward; // 1 when the face runs from low to high
} sonde_half_edge;

// All 3*face_count half edges ordered by (low, high, face); freed by sonde_free.
// SONDE_MESH when a face names a missing vertex.
sonde_status sonde_half_edges_sort(const sonde_mesh *mesh, sonde_half_edge **sorted,
                                   sonde_error *error);

// Twice the area vector of a face: (b - a) x (c - a).
static inline sonde_vec3 sonde_face_cross(const sonde_mesh *mesh, uint32_t face) {
  const uint32_t *f = mesh->faces[face];
  sonde_vec3 a = mesh->vertices[f[0]];
  return v_cross(v_sub(mesh->vertices[f[1]], a), v_sub(mesh->vertices[f[2]], a));
}

// Angle at a between the directions to b and c, in [0, pi].
static inline double sonde_corner_angle(sonde_vec3 a, sonde_vec3 b, sonde_vec3 c) {
  sonde_vec3 u = v_sub(b, a), w = v_sub(c, a);
  return atan2(v_norm(v_cross(u, w)), v_dot(u, w));
}

// Edge between two vertices; SONDE_NONE when there is none.
static inline uint32_t sonde_topology_edge(const sonde_topology *t, uint32_t a, uint32_t b) {
  for (uint32_t k = t->start[a]; k < t->start[a + 1]; ++k)
    if (t->neighbour[k] == b) return t->neighbour_edge[k];
  return SONDE_NONE;
}

// ---- files --------------------------------------------------------------------------------

// Growing mesh that a reader fills.
typedef struct sonde_mesh_builder {
  sonde_mesh mesh;
  uint32_t vertex_room, face_room;
  double scale;
} sonde_mesh_builder;

// False when out of memory or when the mesh has sonde_limits_mesh.most_items of them.
bool sonde_builder_vertex(sonde_mesh_builder *builder, sonde_vec3 point);
bool sonde_builder_face(sonde_mesh_builder *builder, uint32_t a, uint32_t b, uint32_t c);

// Bytes of a text file and the place where reading stands.
typedef struct sonde_text {
  const char *path, *begin, *at, *end;
  uint32_t line;
} sonde_text;

// Skips blanks; false at the end of the line.
bool sonde_text_more(sonde_text *text);
// Moves behind the line end; false at the end of the file.
bool sonde_text_next_line(sonde_text *text);
// Moves to the next line with a token on it, from a line start; false at the end of the file.
bool sonde_text_skip_blank_lines(sonde_text *text);
// Copies the next token of the line (cut at size - 1); empty at the end of the line.
void sonde_text_word(sonde_text *text, char *word, size_t size);
// Reads a finite number; false leaves the place at the offending token.
bool sonde_text_real(sonde_text *text, double *value);
// Status with "path:line: expected <what>, found <token>".
sonde_status sonde_text_expected(sonde_text *text, sonde_error *error, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

sonde_status sonde_ply_read(const char *path, const char *bytes, size_t count,
                            sonde_mesh_builder *builder, sonde_error *error);
sonde_status sonde_obj_read(const char *path, const char *bytes, size_t count,
                            sonde_mesh_builder *builder, sonde_error *error);
sonde_status sonde_stl_read(const char *path, const char *bytes, size_t count,
                            sonde_mesh_builder *builder, sonde_error *error);

// ---- convex bodies ------------------------------------------------------------------------

// Hull that may leave points up to about tolerance_m outside; 0 is the exact hull.
SONDE_LINK sonde_status sonde_convex_hull_within(const sonde_vec3 *points, uint32_t count,
                                                 double tolerance_m, sonde_convex *convex,
                                                 sonde_error *error);
// Triangulated hull of the points; the mesh is owned by the caller.
sonde_status sonde_hull_mesh(const sonde_vec3 *points, uint32_t count, double tolerance_m,
                             sonde_mesh *hull, sonde_error *error);

// Half sides of the rectangle that a probe's name rect:AxB (mm) asks for; false for other names.
SONDE_LINK bool sonde_probe_rectangle(const char *name, double *half_x_m, double *half_y_m);

// Hill climbing that adds the dot products it evaluated to *work.
SONDE_LINK uint32_t sonde_convex_climb(const sonde_convex *convex, sonde_vec3 direction,
                                       uint32_t start, uint32_t *work);

// Clips one skin triangle by a convex body and integrates the columns between skin and body.
// Inside tissue lies below the triangle (opposite its outward normal); from each clipped skin
// point a column runs along `direction` (unit, into the tissue) until it leaves the body. Volume,
// shares and gradient are exact for the piecewise linear depth. docs/world.md. Summed over a
// surface they are the common volume and its derivative when no column enters the body below the
// skin: for a box, along its beam axis.
// @param planes_n,planes_d the body's planes in the frame of the triangle's points
// @param corners three vertices, counter-clockwise from outside
// @return false when nothing is clipped (result zeroed)
// @thread tick (no allocation)
bool sonde_clip_triangle(const sonde_vec3 *planes_n, const double *planes_d, uint32_t plane_count,
                         const sonde_vec3 corners[3], sonde_vec3 direction,
                         sonde_clip_result *result);
// Farthest vertex along a direction, climbing from `start` (0 when unknown). @thread tick
uint32_t sonde_convex_support(const sonde_convex *convex, sonde_vec3 direction, uint32_t start);
// Convex hull of a point cloud (>= 4 points not in one plane, else SONDE_MESH). @thread owner
sonde_status sonde_convex_hull(const sonde_vec3 *points, uint32_t count, sonde_convex *convex,
                               sonde_error *error);
// From a closed convex mesh. @return SONDE_MESH when open or not convex (1e-8). @thread owner
sonde_status sonde_convex_create(const sonde_mesh *mesh, sonde_convex *convex, sonde_error *error);
SONDE_LINK void sonde_convex_clear(sonde_convex *convex); // @thread owner
// Area of the mesh vertex cells (a third of each face) covered by the rectangle |u|<=hu, |v|<=hv
// around `centre`, seen along the normal: exact clipping of each face's cell share. Faces whose
// normal turns away from `normal`, or farther than `reach_m` along it, do not count.
// @param covered_m2 [vertex_count] receives the covered area per vertex (sum = covered area)
// @thread owner
SONDE_LINK void sonde_mesh_footprint(const sonde_mesh *mesh, sonde_vec3 centre, sonde_vec3 normal,
                                     sonde_vec3 u, sonde_vec3 v, double hu_m, double hv_m,
                                     double reach_m, double *covered_m2);
// Distance from a closed surface, negative inside. @thread any (read only)
double sonde_surface_signed_distance(const sonde_surface_index *index, sonde_vec3 query);
// Refines where `target` asks for shorter edges, without hanging vertices. An edge is halved while
// it is longer than 1.42 times the target at its middle: halving a shorter one would overshoot.
// Longest edges go first, so that no angle falls below half the smallest given; slivers around a
// vertex with more than 24 faces (a flat cap's centre) are first replaced by rings of faces. New
// vertices lie on the smooth surface of the vertex normals (PN-triangle edges); creases above 45
// degrees stay sharp. Vertices of `mesh` keep index and place. docs/geometry.md.
// @param target returns the wanted edge length (m) at a point, more than 0
// @return SONDE_ARGUMENT for a target that is not positive or asks for over 2 million vertices;
//         SONDE_MESH when an edge has more than two faces
// @thread owner
sonde_status sonde_mesh_refine(const sonde_mesh *mesh,
                               double (*target)(sonde_vec3 point, void *user), void *user,
                               sonde_mesh *refined, sonde_error *error);
SONDE_LINK sonde_status sonde_topology_build(const sonde_mesh *mesh, sonde_topology *topology,
                                             sonde_error *error); // @thread owner
SONDE_LINK void sonde_topology_clear(sonde_topology *topology);   // @thread owner

#endif
