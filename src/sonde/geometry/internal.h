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
sonde_status sonde_convex_hull_within(const sonde_vec3 *points, uint32_t count, double tolerance_m,
                                      sonde_convex *convex, sonde_error *error);
// Triangulated hull of the points; the mesh is owned by the caller.
sonde_status sonde_hull_mesh(const sonde_vec3 *points, uint32_t count, double tolerance_m,
                             sonde_mesh *hull, sonde_error *error);

// Half sides of the rectangle that a probe's name rect:AxB (mm) asks for; false for other names.
SONDE_LINK bool sonde_probe_rectangle(const char *name, double *half_x_m, double *half_y_m);

// Hill climbing that adds the dot products it evaluated to *work.
SONDE_LINK uint32_t sonde_convex_climb(const sonde_convex *convex, sonde_vec3 direction,
                                       uint32_t start, uint32_t *work);

#endif
