// Edges, neighbours and faces around each vertex of a triangle surface.
//
//   collect_edges     distinct edges with the faces beside them, from the sorted half edges
//   fill_neighbours   vertex rows of neighbours and edges; ascending because edges are sorted
//   fill_faces        vertex rows of faces
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

static sonde_status allocate(sonde_topology *topology, const sonde_mesh *mesh, uint32_t edges,
                             sonde_error *error) {
  size_t rows = mesh->vertex_count + (size_t)1, sides = 2 * (size_t)edges;
  topology->vertex_count = mesh->vertex_count;
  topology->edge_count = edges;
  topology->edges = sonde_calloc(edges, sizeof *topology->edges);
  topology->edge_faces = sonde_calloc(edges, sizeof *topology->edge_faces);
  topology->start = SONDE_NEW(uint32_t, rows);
  topology->neighbour = SONDE_NEW(uint32_t, sides);
  topology->neighbour_edge = SONDE_NEW(uint32_t, sides);
  topology->face_start = SONDE_NEW(uint32_t, rows);
  topology->face_list = SONDE_NEW(uint32_t, 3 * (size_t)mesh->face_count);
  if (topology->edges && topology->edge_faces && topology->start && topology->neighbour &&
      topology->neighbour_edge && topology->face_start && topology->face_list)
    return SONDE_OK;
  return sonde_fail_memory(error);
}

static bool same_edge(const sonde_half_edge *a, const sonde_half_edge *b) {
  return a->low == b->low && a->high == b->high;
}

// Counts distinct edges; refuses what an edge table cannot hold.
static sonde_status count_edges(const sonde_half_edge *sides, size_t count, uint32_t *edges,
                                sonde_error *error) {
  *edges = 0;
  for (size_t i = 0; i < count; ++i) {
    if (sides[i].low == sides[i].high)
      return sonde_fail(error, SONDE_MESH, "face %u uses vertex %u twice", sides[i].face,
                        sides[i].low);
    if (i >= 2 && same_edge(&sides[i - 2], &sides[i]))
      return sonde_fail(error, SONDE_MESH,
                        "more than two faces meet at the edge of vertices %u and %u", sides[i].low,
                        sides[i].high);
    if (i == 0 || !same_edge(&sides[i - 1], &sides[i])) ++*edges;
  }
  return SONDE_OK;
}

static void collect_edges(sonde_topology *topology, const sonde_half_edge *sides, size_t count) {
  uint32_t e = 0;
  for (size_t i = 0; i < count; ++i) {
    if (i > 0 && same_edge(&sides[i - 1], &sides[i])) {
      SONDE_ASSERT(e > 0);
      topology->edge_faces[e - 1][1] = sides[i].face;
      continue;
    }
    topology->edges[e][0] = sides[i].low;
    topology->edges[e][1] = sides[i].high;
    topology->edge_faces[e][0] = sides[i].face;
    topology->edge_faces[e][1] = SONDE_NONE;
    ++e;
  }
  SONDE_ASSERT(e == topology->edge_count);
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

static void fill_neighbours(sonde_topology *topology) {
  uint32_t *start = topology->start;
  for (uint32_t e = 0; e < topology->edge_count; ++e)
    for (int k = 0; k < 2; ++k) start[topology->edges[e][k] + 1]++;
  accumulate(start, topology->vertex_count);
  for (uint32_t e = 0; e < topology->edge_count; ++e)
    for (int k = 0; k < 2; ++k) {
      uint32_t slot = start[topology->edges[e][k]]++;
      topology->neighbour[slot] = topology->edges[e][1 - k];
      topology->neighbour_edge[slot] = e;
    }
  rewind_rows(start, topology->vertex_count);
}

static void fill_faces(sonde_topology *topology, const sonde_mesh *mesh) {
  uint32_t *start = topology->face_start;
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k) start[mesh->faces[f][k] + 1]++;
  accumulate(start, topology->vertex_count);
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k) topology->face_list[start[mesh->faces[f][k]]++] = f;
  rewind_rows(start, topology->vertex_count);
}

sonde_status sonde_topology_build(const sonde_mesh *mesh, sonde_topology *topology,
                                  sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && topology != NULL);
  *topology = (sonde_topology){0};
  sonde_half_edge *sides = NULL;
  uint32_t edges = 0;
  size_t count = 3 * (size_t)mesh->face_count;
  sonde_status status = sonde_half_edges_sort(mesh, &sides, error);
  if (!status) status = count_edges(sides, count, &edges, error);
  if (!status) status = allocate(topology, mesh, edges, error);
  if (!status) {
    collect_edges(topology, sides, count);
    fill_neighbours(topology);
    fill_faces(topology, mesh);
  } else {
    sonde_topology_clear(topology);
  }
  sonde_free(sides);
  return status;
}
