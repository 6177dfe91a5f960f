// Tetrahedra of a pair of TetGen files, as a body of springs.
//
// Every tetrahedron shares E V/L^2 out to each of its edges of length L (Van Gelder 1998). Then
// sum k L^2 = 6 E V, which for edges without a preferred direction is an isotropic solid with
// Poisson's ratio 1/4 and modulus E.
#include "scene/lattice.h"

#include "base/bounds.h"
#include "base/maths.h"

#include <stdlib.h>
#include <string.h>

typedef struct text {
  char *bytes;
  const char *at;
  char path[1024];
  int line;
} text;

typedef struct tetrahedra {
  uint32_t node_count, count, first; // first: the number of the first node in the files
  sonde_vec3 *node;
  uint32_t (*corner)[4];
} tetrahedra;

static bool next_number(text *t, double *value) {
  for (;; ++t->at) {
    if (*t->at == '#')
      while (*t->at && *t->at != '\n') ++t->at;
    if (*t->at == '\n') ++t->line;
    if (!*t->at || !strchr(" \t\r\n", *t->at)) break;
  }
  const char *end = t->at;
  *value = sonde_parse_real(t->at, &end);
  bool good = end != t->at && isfinite(*value);
  t->at = end;
  return good;
}

// A whole number within [low, high].
static bool next_count(text *t, double low, double high, uint32_t *value) {
  double number;
  if (!next_number(t, &number) || number != floor(number) || number < low || number > high)
    return false;
  *value = (uint32_t)number;
  return true;
}

static void skip_line(text *t) {
  while (*t->at && *t->at != '\n') ++t->at;
}

static sonde_status wrong(const text *t, const char *expected, sonde_error *error) {
  return sonde_fail(error, SONDE_FORMAT, "%s:%d: expected %s", t->path, t->line, expected);
}

static sonde_status read_nodes(text *t, double unit_m, tetrahedra *tets, sonde_error *error) {
  if (!next_count(t, 4, 200000, &tets->node_count)) return wrong(t, "4 to 200000 nodes", error);
  skip_line(t);
  tets->node = SONDE_NEW(sonde_vec3, tets->node_count);
  if (!tets->node) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < tets->node_count; ++i) {
    uint32_t index;
    double x, y, z;
    if (!next_count(t, 0, 4e9, &index)) return wrong(t, "the number of a node", error);
    if (i == 0) tets->first = index;
    if (index != tets->first + i || tets->first > 1) return wrong(t, "nodes in order", error);
    if (!next_number(t, &x) || !next_number(t, &y) || !next_number(t, &z))
      return wrong(t, "three coordinates", error);
    if (!(fmax(fabs(x), fmax(fabs(y), fabs(z))) * unit_m <= SONDE_FARTHEST_M))
      return wrong(t, "three coordinates within 10 km", error);
    tets->node[i] = v_scale(vec3(x, y, z), unit_m);
    skip_line(t);
  }
  return SONDE_OK;
}

static double six_volumes(const tetrahedra *tets, const uint32_t c[4]) {
  SONDE_ASSERT(tets->node);
  const sonde_vec3 *x = tets->node;
  return v_dot(v_cross(v_sub(x[c[1]], x[c[0]]), v_sub(x[c[2]], x[c[0]])), v_sub(x[c[3]], x[c[0]]));
}

static sonde_status read_elements(text *t, tetrahedra *tets, sonde_error *error) {
  if (!next_count(t, 1, 2e6, &tets->count)) return wrong(t, "1 to 2000000 tetrahedra", error);
  skip_line(t);
  tets->corner = sonde_calloc(tets->count, sizeof *tets->corner);
  if (!tets->corner) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < tets->count; ++i) {
    uint32_t *c = tets->corner[i], number;
    if (!next_count(t, 0, 4e9, &number)) return wrong(t, "the number of a tetrahedron", error);
    for (int k = 0; k < 4; ++k) {
      if (!next_count(t, tets->first, tets->first + tets->node_count - 1, &c[k]))
        return wrong(t, "the number of a node", error);
      c[k] -= tets->first;
    }
    double volume = six_volumes(tets, c);
    if (volume < 0) { // keep corners right-handed
      uint32_t swap = c[0];
      c[0] = c[1], c[1] = swap;
    }
    if (!(fabs(volume) > 1e-24)) return wrong(t, "a tetrahedron with a volume", error);
    skip_line(t);
  }
  return SONDE_OK;
}

typedef struct record {
  uint32_t key[3]; // sorted corners of an edge (then UINT32_MAX) or a face
  uint32_t face[3];
  double stiffness;
} record;

static int compare(const void *a, const void *b) {
  const record *p = a, *q = b;
  for (int k = 0; k < 3; ++k)
    if (p->key[k] != q->key[k]) return p->key[k] < q->key[k] ? -1 : 1;
  return p->stiffness < q->stiffness ? -1 : p->stiffness > q->stiffness;
}

static void sort_key(uint32_t key[3]) {
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2 - i; ++j)
      if (key[j] > key[j + 1]) {
        uint32_t swap = key[j];
        key[j] = key[j + 1], key[j + 1] = swap;
      }
}

static bool same(const record *a, const record *b) {
  return memcmp(a->key, b->key, sizeof a->key) == 0;
}

// Faces that stand alone, over the nodes that they use.
static sonde_status add_skin(record *faces, uint32_t count, sonde_body *body, sonde_error *error) {
  SONDE_ASSERT(!body->surface_node);
  uint32_t used = 0, vertices = 0;
  for (uint32_t i = 0; i < count; ++i) {
    bool alone = (i == 0 || !same(&faces[i], &faces[i - 1])) &&
                 (i + 1 == count || !same(&faces[i], &faces[i + 1]));
    if (alone) faces[used++] = faces[i];
  }
  uint32_t *number = SONDE_NEW(uint32_t, body->node_count);
  body->surface_node = SONDE_NEW(uint32_t, body->node_count);
  if (!number || !body->surface_node) {
    sonde_free(number);
    return sonde_fail_memory(error);
  }
  for (uint32_t i = 0; i < used; ++i)
    for (int k = 0; k < 3; ++k) number[faces[i].face[k]] = 1;
  for (uint32_t i = 0; i < body->node_count; ++i)
    if (number[i]) {
      body->surface_node[vertices] = i;
      number[i] = vertices++;
    }
  sonde_status status = sonde_mesh_create(&body->surface, vertices, used, error);
  for (uint32_t i = 0; i < used && !status; ++i)
    for (int k = 0; k < 3; ++k) body->surface.faces[i][k] = number[faces[i].face[k]];
  for (uint32_t i = 0; i < vertices && !status; ++i)
    body->surface.vertices[i] = body->node[body->surface_node[i]];
  sonde_free(number);
  return status;
}

static sonde_status build(const tetrahedra *tets, sonde_solid solid, sonde_body *body,
                          sonde_error *error) {
  static const int EDGE[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
  static const int FACE[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  SONDE_ASSERT(tets->count > 0 && tets->node_count >= 4);
  record *edges = SONDE_NEW(record, 6 * (size_t)tets->count);
  record *faces = SONDE_NEW(record, 4 * (size_t)tets->count);
  sonde_status status = edges && faces ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t t = 0; t < tets->count && !status; ++t) {
    const uint32_t *c = tets->corner[t];
    double volume = six_volumes(tets, c) / 6;
    for (uint32_t e = 0; e < 6; ++e) {
      uint32_t a = c[EDGE[e][0]], b = c[EDGE[e][1]];
      record *r = &edges[6 * t + e];
      r->key[0] = a, r->key[1] = b, r->key[2] = UINT32_MAX;
      sort_key(r->key);
      r->stiffness = solid.youngs_pa * volume / v_norm2(v_sub(tets->node[a], tets->node[b]));
    }
    for (uint32_t f = 0; f < 4; ++f) {
      record *r = &faces[4 * t + f];
      for (int k = 0; k < 3; ++k) r->face[k] = r->key[k] = c[FACE[f][k]];
      sort_key(r->key);
      r->stiffness = t;
    }
  }
  if (!status) {
    qsort(edges, 6 * (size_t)tets->count, sizeof *edges, compare);
    qsort(faces, 4 * (size_t)tets->count, sizeof *faces, compare);
    // Springs from the sorted records of edges, masses from the tetrahedra.
    uint32_t used = 0;
    for (uint32_t i = 0; i < 6 * tets->count; ++i) {
      if (used && same(&edges[used - 1], &edges[i]))
        edges[used - 1].stiffness += edges[i].stiffness;
      else
        edges[used++] = edges[i];
    }
    status = sonde_body_allocate(body, tets->node_count, used, error);
  }
  for (uint32_t e = 0; e < body->spring_count && !status; ++e) {
    uint32_t a = body->pairs[e][0] = edges[e].key[0], b = body->pairs[e][1] = edges[e].key[1];
    double k = edges[e].stiffness;
    body->spring[e] =
        (sonde_spring){v_distance(tets->node[a], tets->node[b]), k, k * solid.damping_s};
  }
  if (!status) memcpy(body->node, tets->node, tets->node_count * sizeof *tets->node);
  for (uint32_t t = 0; t < tets->count && !status; ++t)
    for (int k = 0; k < 4; ++k)
      body->node_mass_kg[tets->corner[t][k]] +=
          solid.density_kg_m3 * six_volumes(tets, tets->corner[t]) / 24;
  if (!status) status = add_skin(faces, 4 * tets->count, body, error);
  for (uint32_t i = 0; i < body->node_count && !status; ++i)
    if (!(body->node_mass_kg[i] > 0))
      status = sonde_fail(error, SONDE_MESH, "node %u belongs to no tetrahedron", i + tets->first);
  sonde_free(edges);
  sonde_free(faces);
  return status;
}

static sonde_status open_text(const sonde_scene_source *source, const char *name,
                              const char *ending, text *t, sonde_error *error) {
  char file[600];
  snprintf(file, sizeof file, "%s%s", name, ending);
  sonde_source_path(source, file, t->path, sizeof t->path);
  size_t count;
  sonde_status status =
      sonde_bounded_load_text(t->path, &sonde_limits_mesh, &t->bytes, &count, error);
  t->at = t->bytes;
  t->line = 1;
  return status;
}

void sonde_read_tetrahedra(const sonde_scene_source *source, sonde_place at, const char *name,
                           sonde_solid solid, sonde_body *body) {
  text nodes = {0}, elements = {0};
  tetrahedra tets = {0};
  sonde_error error = {0};
  double unit_mm = sonde_read_real(source->reader, at, "unit_mm", 1e-6, 1e6, 1);
  sonde_status status = open_text(source, name, ".node", &nodes, &error);
  if (!status) status = open_text(source, name, ".ele", &elements, &error);
  if (!status) status = read_nodes(&nodes, unit_mm * 1e-3, &tets, &error);
  if (!status) status = read_elements(&elements, &tets, &error);
  if (!status) status = build(&tets, solid, body, &error);
  if (status) sonde_reader_pass(source->reader, at, &error);
  sonde_free(nodes.bytes);
  sonde_free(elements.bytes);
  sonde_free(tets.node);
  sonde_free(tets.corner);
}
