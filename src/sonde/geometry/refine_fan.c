// Fans of slivers, tiled anew before a refinement.
//
// A vertex with very many faces, such as the centre of a flat cap, has faces too thin for any
// refinement that keeps them. The faces around it are replaced by rings of growing edge length
// between the fan's border and its centre. The new vertices lie on the old faces; border and centre
// stay. Edges grow by up to half from ring to ring while the wanted length allows.
#include "geometry/refine.h"
#include "geometry/internal.h"

#include <string.h>

enum { FAN_FACES = 24, CENTRE_FACES = 9, RING_LEAST = 6 };
#define RING_GROWTH 1.5
#define RING_HEIGHT 0.87 // height of an equilateral triangle

typedef struct ring {
  uint32_t count;
  uint32_t *vertex;
  double scale; // 1 at the border, 0 at the centre
} ring;

typedef struct fan {
  const sonde_mesh *mesh;
  sonde_mesh_builder *builder;
  uint32_t centre, count;
  uint32_t *border; // [count + 1], closed
  double *along;    // [count + 1] length of the border up to each vertex
  double radius;    // mean distance of the border from the centre
  target_fn target;
  void *user;
} fan;

// Border of the fan in order, with its length up to each vertex and its mean distance from the
// centre. It runs so that the centre is on its left, seen from outside. False when the fan is not
// closed. `follower` has SONDE_NONE at every vertex.
static bool walk_border(fan *f, const sonde_topology *t, uint32_t *follower) {
  const sonde_vec3 *x = f->mesh->vertices;
  uint32_t first = SONDE_NONE, at;
  for (uint32_t i = t->face_start[f->centre]; i < t->face_start[f->centre + 1]; ++i) {
    const uint32_t *v = f->mesh->faces[t->face_list[i]];
    int k = v[0] == f->centre ? 0 : v[1] == f->centre ? 1 : 2;
    follower[v[(k + 1) % 3]] = v[(k + 2) % 3];
    first = v[(k + 1) % 3];
  }
  at = first;
  for (uint32_t i = 0; i < f->count; ++i, at = follower[at]) {
    if (at == SONDE_NONE || (i > 0 && at == first)) return false;
    f->border[i] = at;
  }
  f->border[f->count] = first;
  f->radius = f->along[0] = 0;
  for (uint32_t i = 0; i < f->count && at == first; ++i) {
    f->along[i + 1] = f->along[i] + v_distance(x[f->border[i]], x[f->border[i + 1]]);
    f->radius += v_distance(x[f->border[i]], x[f->centre]) / f->count;
  }
  return at == first;
}

// Point at a length along the border, drawn towards the centre.
static sonde_vec3 ring_point(const fan *f, double length, double scale, uint32_t *piece) {
  const sonde_vec3 *x = f->mesh->vertices;
  while (*piece + 1 < f->count && f->along[*piece + 1] < length) ++*piece;
  double from = f->along[*piece], to = f->along[*piece + 1];
  double s = to > from ? clamp((length - from) / (to - from), 0, 1) : 0;
  sonde_vec3 p = v_lerp(x[f->border[*piece]], x[f->border[*piece + 1]], s);
  return v_lerp(x[f->centre], p, scale);
}

// Copies all but the faces around the centre; in their place come rings from the border inwards,
// then the few faces around the centre. False: no memory.
static bool tile_fan(fan *f, uint32_t *one, uint32_t *two) {
  const sonde_mesh *mesh = f->mesh;
  for (uint32_t v = 0; v < mesh->vertex_count; ++v)
    if (!sonde_builder_vertex(f->builder, mesh->vertices[v])) return false;
  for (uint32_t i = 0; i < mesh->face_count; ++i) {
    const uint32_t *v = mesh->faces[i];
    if (v[0] == f->centre || v[1] == f->centre || v[2] == f->centre) continue;
    if (!sonde_builder_face(f->builder, v[0], v[1], v[2])) return false;
  }
  memcpy(one, f->border, f->count * sizeof *one);
  ring outer = {f->count, one, 1};
  while (outer.count > CENTRE_FACES) {
    ring inner = {.vertex = outer.vertex == one ? two : one};
    // Ring inside the outer one: its edges grow by up to half while the wanted length allows. Where
    // it does not let the rings shrink, the radius does. False: no memory.
    SONDE_ASSERT(outer.count > CENTRE_FACES && inner.vertex != outer.vertex);
    double perimeter = f->along[f->count], edge = outer.scale * perimeter / outer.count;
    double wanted = RING_GROWTH * edge;
    uint32_t piece = 0;
    for (uint32_t k = 0; k < outer.count; ++k) {
      sonde_vec3 p = ring_point(f, perimeter * k / outer.count, outer.scale, &piece);
      double asked = f->target(p, f->user);
      if (asked < wanted) wanted = asked;
    }
    if (!(wanted > edge)) wanted = edge;
    double step = RING_HEIGHT * (edge + wanted) / 2 / f->radius;
    inner.scale = fmax(outer.scale - step, 0.45 * outer.scale);
    SONDE_ASSERT(inner.scale > 0 && inner.scale < 1);
    double count = round(inner.scale * perimeter / wanted);
    inner.count = (uint32_t)clamp(count, RING_LEAST, outer.count);

    double spacing = perimeter / inner.count;
    piece = 0;
    for (uint32_t k = 0; k < inner.count; ++k) {
      inner.vertex[k] = f->builder->mesh.vertex_count;
      sonde_vec3 p = ring_point(f, (k + 0.5) * spacing, inner.scale, &piece);
      if (!sonde_builder_vertex(f->builder, p)) return false;
    }

    // faces between the two rings, always taking the shorter diagonal
    for (uint32_t i = 0, k = 0; i < outer.count || k < inner.count;) {
      const sonde_vec3 *x = f->builder->mesh.vertices;
      uint32_t o = outer.vertex[i % outer.count], o_next = outer.vertex[(i + 1) % outer.count];
      uint32_t n = inner.vertex[k % inner.count], n_next = inner.vertex[(k + 1) % inner.count];
      bool outwards = k == inner.count || (i < outer.count && v_distance(x[o_next], x[n]) <=
                                                                  v_distance(x[o], x[n_next]));
      if (!(outwards ? sonde_builder_face(f->builder, o, o_next, n)
                     : sonde_builder_face(f->builder, n_next, n, o)))
        return false;
      if (outwards)
        ++i;
      else
        ++k;
    }
    outer = inner;
  }
  for (uint32_t k = 0; k < outer.count; ++k)
    if (!sonde_builder_face(f->builder, outer.vertex[k], outer.vertex[(k + 1) % outer.count],
                            f->centre))
      return false;
  return true;
}

sonde_status sonde_refine_spread_fans(sonde_mesh *mesh, target_fn target, void *user,
                                      sonde_error *error) {
  sonde_status status = SONDE_OK;
  uint32_t vertices = mesh->vertex_count;
  for (uint32_t v = 0; v < vertices && !status;) {
    sonde_topology t;
    status = sonde_topology_build(mesh, &t, error);
    if (status) return status;
    while (v < vertices && t.face_start[v + 1] - t.face_start[v] <= FAN_FACES) ++v;
    if (v < vertices) {
      const uint32_t centre = v++;
      sonde_mesh_builder builder = {.scale = 1};
      uint32_t count = t.face_start[centre + 1] - t.face_start[centre];
      SONDE_ASSERT(count > FAN_FACES);
      fan f = {mesh, &builder, centre, count, NULL, NULL, 0, target, user};
      f.border = SONDE_NEW(uint32_t, count + (size_t)1);
      f.along = SONDE_NEW(double, count + (size_t)1);
      uint32_t *one = SONDE_NEW(uint32_t, count), *two = SONDE_NEW(uint32_t, count);
      uint32_t *follower = SONDE_NEW(uint32_t, mesh->vertex_count);
      bool ok = f.border && f.along && one && two && follower;
      for (uint32_t i = 0; i < mesh->vertex_count && ok; ++i) follower[i] = SONDE_NONE;
      if (ok && walk_border(&f, &t, follower)) {
        ok = tile_fan(&f, one, two);
        if (ok) {
          sonde_mesh_clear(mesh);
          *mesh = builder.mesh;
          builder.mesh = (sonde_mesh){0};
        }
      }
      sonde_mesh_clear(&builder.mesh);
      sonde_free(f.border);
      sonde_free(f.along);
      sonde_free(one);
      sonde_free(two);
      sonde_free(follower);
      status = ok ? SONDE_OK : sonde_fail_memory(error);
    }
    sonde_topology_clear(&t);
  }
  return status;
}
