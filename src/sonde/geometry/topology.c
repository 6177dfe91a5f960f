// Edges, neighbours and faces around each vertex of a triangle surface.
#include "geometry/internal.h"

void sonde_topology_clear(sonde_topology *topology) {
  if (!topology) return;
  sonde_free(topology->edges);
  sonde_free(topology->start);
  sonde_free(topology->neighbour);
  sonde_free(topology->neighbour_edge);
  sonde_free(topology->face_start);
  sonde_free(topology->face_list);
  sonde_free(topology->edge_faces);
  *topology = (sonde_topology){0};
}

static bool same_edge(const sonde_half_edge *a, const sonde_half_edge *b) {
  return a->low == b->low && a->high == b->high;
}

// Turns counts held in start[v + 1] into row starts.
static void accumulate(uint32_t *start, uint32_t rows) {
  for (uint32_t v = 0; v < rows; ++v) start[v + 1] += start[v];
}

// After filling, start[v] has moved to the end of its row: shift the table back.
static void rewind_rows(uint32_t *start, uint32_t rows) {
  for (uint32_t v = rows; v > 0; --v) start[v] = start[v - 1];
  start[0] = 0;
}

sonde_status sonde_topology_build(const sonde_mesh *mesh, sonde_topology *topology,
                                  sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && topology != NULL);
  *topology = (sonde_topology){0};
  sonde_half_edge *sides = NULL;
  uint32_t edges = 0, vertices = mesh->vertex_count;
  size_t count = 3 * (size_t)mesh->face_count, rows = vertices + (size_t)1;
  sonde_status status = sonde_half_edges_sort(mesh, &sides, error);

  // number of distinct edges; at most two faces beside each
  for (size_t i = 0; i < count && !status; ++i) {
    if (sides[i].low == sides[i].high)
      status = sonde_fail(error, SONDE_MESH, "face %u uses vertex %u twice", sides[i].face,
                          sides[i].low);
    else if (i >= 2 && same_edge(&sides[i - 2], &sides[i]))
      status = sonde_fail(error, SONDE_MESH,
                          "more than two faces meet at the edge of vertices %u and %u",
                          sides[i].low, sides[i].high);
    else if (i == 0 || !same_edge(&sides[i - 1], &sides[i]))
      ++edges;
  }
  if (status) {
    sonde_free(sides);
    return status;
  }
  sonde_topology *t = topology;
  t->vertex_count = vertices;
  t->edge_count = edges;
  t->edges = sonde_calloc(edges, sizeof *t->edges);
  t->edge_faces = sonde_calloc(edges, sizeof *t->edge_faces);
  t->start = SONDE_NEW(uint32_t, rows);
  t->neighbour = SONDE_NEW(uint32_t, 2 * (size_t)edges);
  t->neighbour_edge = SONDE_NEW(uint32_t, 2 * (size_t)edges);
  t->face_start = SONDE_NEW(uint32_t, rows);
  t->face_list = SONDE_NEW(uint32_t, count);
  if (!t->edges || !t->edge_faces || !t->start || !t->neighbour || !t->neighbour_edge ||
      !t->face_start || !t->face_list) {
    sonde_topology_clear(topology);
    sonde_free(sides);
    return sonde_fail_memory(error);
  }

  // edges with the faces beside them
  uint32_t last = SONDE_NONE;
  for (size_t i = 0; i < count; ++i) {
    if (i > 0 && same_edge(&sides[i - 1], &sides[i])) {
      t->edge_faces[last][1] = sides[i].face;
      continue;
    }
    ++last;
    t->edges[last][0] = sides[i].low;
    t->edges[last][1] = sides[i].high;
    t->edge_faces[last][0] = sides[i].face;
    t->edge_faces[last][1] = SONDE_NONE;
  }
  SONDE_ASSERT(last + 1 == edges);
  sonde_free(sides);

  // neighbours and edges of each vertex; ascending because the edges are sorted
  for (uint32_t e = 0; e < edges; ++e)
    for (int k = 0; k < 2; ++k) t->start[t->edges[e][k] + 1]++;
  accumulate(t->start, vertices);
  for (uint32_t e = 0; e < edges; ++e)
    for (int k = 0; k < 2; ++k) {
      uint32_t slot = t->start[t->edges[e][k]]++;
      t->neighbour[slot] = t->edges[e][1 - k];
      t->neighbour_edge[slot] = e;
    }
  rewind_rows(t->start, vertices);

  // faces of each vertex
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k) t->face_start[mesh->faces[f][k] + 1]++;
  accumulate(t->face_start, vertices);
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k) t->face_list[t->face_start[mesh->faces[f][k]]++] = f;
  rewind_rows(t->face_start, vertices);
  return SONDE_OK;
}
