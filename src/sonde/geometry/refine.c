// Local refinement of a triangle surface by longest-edge closure.
//
// A pass marks every edge longer than 1.42 times the wanted length at its middle. While a face has
// a marked edge but its longest edge is not marked, that one is marked too: every face can then be
// divided without bad angles and without hanging vertices. A face with three marks is split 1:4
// into similar faces, with two or one it is bisected at its longest edge first. Bisecting at the
// longest edge keeps every angle above half the smallest angle of the given mesh (Rosenberg and
// Stenger 1975), however often it is repeated. The vertices of the given mesh keep index and place.
#include "geometry/refine.h"
#include "geometry/internal.h"

#include <string.h>

#define OVERSHOOT 1.42    // an edge is halved only when it is longer than this times the target
#define CREASE_COSINE 0.7 // faces that meet at more than about 45 degrees form a crease
enum { MAX_PASSES = 40, MAX_VERTICES = 2000000 };

// One pass. Edges of a face: side k runs from corner k to corner k + 1.
typedef struct pass {
  const sonde_mesh *mesh;
  sonde_topology topology;
  sonde_vec3 *face_normal;  // [face_count]
  uint32_t (*face_edge)[3]; // [face_count]
  double *length;           // [edge_count]
  uint32_t *middle;         // [edge_count] SONDE_NONE, or the new vertex; 0 while only marked
  uint32_t *work;           // [3 * edge_count + face_count] faces to look at again
  uint32_t work_count, marked;
} pass;

static void push_face(pass *p, uint32_t face) {
  if (face == SONDE_NONE) return;
  SONDE_ASSERT(p->work_count < 3 * p->topology.edge_count + p->mesh->face_count);
  p->work[p->work_count++] = face;
}

static void mark(pass *p, uint32_t edge) {
  if (p->middle[edge] != SONDE_NONE) return;
  p->middle[edge] = 0;
  p->marked++;
  push_face(p, p->topology.edge_faces[edge][0]);
  push_face(p, p->topology.edge_faces[edge][1]);
}

// Side of the face that is longest; the edge number decides between equals, so that both faces
// beside an edge agree.
static int longest_side(const pass *p, uint32_t face) {
  const uint32_t *e = p->face_edge[face];
  int best = 0;
  for (int k = 1; k < 3; ++k)
    if (p->length[e[k]] > p->length[e[best]] ||
        (p->length[e[k]] == p->length[e[best]] && e[k] < e[best]))
      best = k;
  return best;
}

// ---- new vertices -------------------------------------------------------------------------

// Normal at a vertex over those of its faces that do not turn away from `side`. Each face counts
// with the cross product of its sides over the squares of their lengths: exact where the vertices
// lie on a sphere, whatever the sizes of the faces (Max 1999).
static sonde_vec3 side_normal(const pass *p, uint32_t vertex, sonde_vec3 side) {
  const sonde_topology *t = &p->topology;
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t i = t->face_start[vertex]; i < t->face_start[vertex + 1]; ++i) {
    uint32_t f = t->face_list[i];
    if (v_dot(p->face_normal[f], side) <= CREASE_COSINE) continue;
    const uint32_t *v = p->mesh->faces[f];
    int k = v[0] == vertex ? 0 : v[1] == vertex ? 1 : 2;
    sonde_vec3 a = v_sub(p->mesh->vertices[v[(k + 1) % 3]], p->mesh->vertices[vertex]);
    sonde_vec3 b = v_sub(p->mesh->vertices[v[(k + 2) % 3]], p->mesh->vertices[vertex]);
    double lengths2 = v_norm2(a) * v_norm2(b);
    if (lengths2 > 0) sum = v_madd(sum, 1 / lengths2, v_cross(a, b));
  }
  return v_unit(sum, side);
}

// Offset of the middle of the cubic that leaves both ends at right angles to their normals (the
// edge of a PN triangle): -( ((b - a).na) na + ((a - b).nb) nb ) / 8.
static sonde_vec3 edge_bulge(const pass *p, const uint32_t ends[2], sonde_vec3 side) {
  sonde_vec3 along = v_sub(p->mesh->vertices[ends[1]], p->mesh->vertices[ends[0]]);
  sonde_vec3 na = side_normal(p, ends[0], side), nb = side_normal(p, ends[1], side);
  sonde_vec3 sum = v_scale(na, -v_dot(along, na) / 8);
  return v_madd(sum, v_dot(along, nb) / 8, nb);
}

// ---- new faces ----------------------------------------------------------------------------

static uint32_t face_marks(const pass *p, uint32_t face) {
  uint32_t marks = 0;
  for (int k = 0; k < 3; ++k) marks += p->middle[p->face_edge[face][k]] != SONDE_NONE;
  return marks;
}

static void put(sonde_mesh *out, uint32_t *at, uint32_t a, uint32_t b, uint32_t c) {
  SONDE_ASSERT(*at < out->face_count);
  uint32_t *face = out->faces[(*at)++];
  face[0] = a;
  face[1] = b;
  face[2] = c;
}

// Writes a half (tip, from, to) of a bisected face; cuts it again when its side from->to, which is
// a side of the old face, has a middle.
static void put_half(sonde_mesh *out, uint32_t *at, uint32_t tip, uint32_t from, uint32_t to,
                     uint32_t middle) {
  if (middle == SONDE_NONE) {
    put(out, at, tip, from, to);
    return;
  }
  put(out, at, tip, from, middle);
  put(out, at, tip, middle, to);
}

// Middles of the marked edges on the surface that the normals describe, then the new faces.
static sonde_status build(pass *p, sonde_mesh *out, sonde_error *error) {
  uint32_t vertices = p->mesh->vertex_count, faces = p->mesh->face_count, at = 0;
  if (vertices + p->marked > MAX_VERTICES)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "the wanted edge length asks for more than %d vertices", MAX_VERTICES);
  for (uint32_t f = 0; f < p->mesh->face_count; ++f) faces += face_marks(p, f);
  sonde_status status = sonde_mesh_create(out, vertices + p->marked, faces, error);
  if (status) return status;
  memcpy(out->vertices, p->mesh->vertices, vertices * sizeof *out->vertices);
  for (uint32_t e = 0; e < p->topology.edge_count; ++e) {
    if (p->middle[e] == SONDE_NONE) continue;
    // A crease follows the bulges of both its sides; a boundary edge stays straight across.
    const uint32_t *ends = p->topology.edges[e], *beside = p->topology.edge_faces[e];
    sonde_vec3 middle = v_lerp(p->mesh->vertices[ends[0]], p->mesh->vertices[ends[1]], 0.5);
    sonde_vec3 one = p->face_normal[beside[0]], bulge;
    if (beside[1] == SONDE_NONE) {
      bulge = edge_bulge(p, ends, one);
    } else {
      sonde_vec3 two = p->face_normal[beside[1]];
      bulge = v_dot(one, two) > CREASE_COSINE
                  ? edge_bulge(p, ends, v_unit(v_add(one, two), one))
                  : v_add(edge_bulge(p, ends, one), edge_bulge(p, ends, two));
    }
    p->middle[e] = vertices;
    out->vertices[vertices++] = v_add(middle, bulge);
  }
  for (uint32_t f = 0; f < p->mesh->face_count; ++f) {
    const uint32_t *v = p->mesh->faces[f], *edge = p->face_edge[f];
    uint32_t marks = face_marks(p, f);
    if (marks == 0) {
      put(out, &at, v[0], v[1], v[2]);
      continue;
    }
    int k = longest_side(p, f);
    uint32_t a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3], ab = p->middle[edge[k]];
    uint32_t bc = p->middle[edge[(k + 1) % 3]], ca = p->middle[edge[(k + 2) % 3]];
    SONDE_ASSERT(marks <= 3 && ab != SONDE_NONE);
    if (marks == 3) {
      put(out, &at, a, ab, ca);
      put(out, &at, ab, b, bc);
      put(out, &at, ca, bc, c);
      put(out, &at, ab, bc, ca);
    } else {
      put_half(out, &at, ab, b, c, bc);
      put_half(out, &at, ab, c, a, ca);
    }
  }
  SONDE_ASSERT(vertices == out->vertex_count && at == out->face_count);
  return SONDE_OK;
}

sonde_status sonde_mesh_refine(const sonde_mesh *mesh,
                               double (*target)(sonde_vec3 point, void *user), void *user,
                               sonde_mesh *refined, sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && target != NULL && refined != NULL);
  sonde_status status = sonde_mesh_copy(mesh, refined, error);
  if (!status) status = sonde_refine_spread_fans(refined, target, user, error);
  bool done = false;
  for (int k = 0; k < MAX_PASSES && !status && !done; ++k) {
    pass p;
    sonde_mesh finer = {0};
    p = (pass){.mesh = refined};
    status = sonde_topology_build(refined, &p.topology, error);
    if (!status) {
      const sonde_topology *t = &p.topology;
      size_t edges = t->edge_count;
      p.face_normal = SONDE_NEW(sonde_vec3, refined->face_count);
      p.face_edge = sonde_calloc(refined->face_count, sizeof *p.face_edge);
      p.length = SONDE_NEW(double, edges);
      p.middle = SONDE_NEW(uint32_t, edges);
      p.work = SONDE_NEW(uint32_t, 3 * edges + refined->face_count);
      if (!p.face_normal || !p.face_edge || !p.length || !p.middle || !p.work)
        status = sonde_fail_memory(error);
      else {
        for (uint32_t f = 0; f < refined->face_count; ++f)
          p.face_normal[f] = v_unit(sonde_face_cross(refined, f), vec3(0, 0, 0));
        for (uint32_t e = 0; e < edges; ++e) {
          const uint32_t *ends = t->edges[e];
          p.length[e] = v_distance(refined->vertices[ends[0]], refined->vertices[ends[1]]);
          p.middle[e] = SONDE_NONE;
          for (int side = 0; side < 2; ++side) {
            uint32_t f = t->edge_faces[e][side];
            for (int i = 0; f != SONDE_NONE && i < 3; ++i) {
              uint32_t a = refined->faces[f][i], b = refined->faces[f][(i + 1) % 3];
              if ((a == ends[0] && b == ends[1]) || (b == ends[0] && a == ends[1]))
                p.face_edge[f][i] = e;
            }
          }
        }
      }
    }
    // Edges that are longer than the target asks for, then the longest-edge closure.
    SONDE_ASSERT(status || (p.marked == 0 && p.work_count == 0));
    for (uint32_t e = 0; !status && e < p.topology.edge_count; ++e) {
      const uint32_t *v = p.topology.edges[e];
      sonde_vec3 middle = v_lerp(p.mesh->vertices[v[0]], p.mesh->vertices[v[1]], 0.5);
      double wanted = target(middle, user);
      if (!(wanted > 0))
        status = sonde_fail(error, SONDE_ARGUMENT,
                            "the wanted edge length at (%g, %g, %g) m is %g, expected more than 0",
                            middle.x, middle.y, middle.z, wanted);
      else if (p.length[e] > OVERSHOOT * wanted)
        mark(&p, e);
    }
    while (!status && p.work_count) {
      uint32_t face = p.work[--p.work_count];
      mark(&p, p.face_edge[face][longest_side(&p, face)]);
    }
    done = p.marked == 0;
    if (!status && !done) status = build(&p, &finer, error);
    if (!status && !done) {
      sonde_mesh_clear(refined);
      *refined = finer;
    }
    sonde_topology_clear(&p.topology);
    sonde_free(p.face_normal);
    sonde_free(p.face_edge);
    sonde_free(p.length);
    sonde_free(p.middle);
    sonde_free(p.work);
  }
  if (!status && !done)
    status = sonde_fail(error, SONDE_CONVERGENCE, "edges are still too long after %d passes",
                        MAX_PASSES);
  if (status) sonde_mesh_clear(refined);
  return status;
}
