// Builder of the surface index: a tree of boxes over the faces, split at the median centroid along
// the longest axis, and the pseudo-normals that tell inside from outside at any closest point.
//
//   split            one node of the tree, then its two halves
//   fill_normals     face, side and angle-weighted vertex normals
#include "base/order.h"
#include "geometry/surface.h"

#include <string.h>

typedef struct builder {
  sonde_surface_index *index;
  sonde_vec3 *centroids;
  sonde_ranked *keys;
} builder;

static void grow_box(sonde_vec3 *low, sonde_vec3 *high, sonde_vec3 p) {
  *low = vec3(fmin(low->x, p.x), fmin(low->y, p.y), fmin(low->z, p.z));
  *high = vec3(fmax(high->x, p.x), fmax(high->y, p.y), fmax(high->z, p.z));
}

static void measure(const builder *b, uint32_t from, uint32_t to, surface_node *node,
                    sonde_vec3 *spread) {
  sonde_vec3 low = vec3(INFINITY, INFINITY, INFINITY), high = v_neg(low);
  node->low = low;
  node->high = high;
  for (uint32_t i = from; i < to; ++i) {
    uint32_t face = b->index->order[i];
    grow_box(&low, &high, b->centroids[face]);
    for (int k = 0; k < 3; ++k)
      grow_box(&node->low, &node->high, b->index->mesh.vertices[b->index->mesh.faces[face][k]]);
  }
  *spread = v_sub(high, low);
}

// Appends the node of faces order[from, to) and everything below it.
static void split(builder *b, uint32_t from, uint32_t to, int depth) {
  SONDE_ASSERT(to > from && depth < SURFACE_STACK / 2);
  uint32_t *order = b->index->order;
  surface_node *node = &b->index->nodes[b->index->node_count++];
  sonde_vec3 spread;
  measure(b, from, to, node, &spread);
  if (to - from <= SURFACE_LEAF_FACES) {
    node->first = from;
    node->count = to - from;
    return;
  }
  int axis = spread.y > spread.x ? 1 : 0;
  if (spread.z > v_coordinate(spread, axis)) axis = 2;
  sonde_sort_along(b->centroids, axis, order + from, to - from, b->keys);
  uint32_t middle = from + (to - from) / 2;
  split(b, from, middle, depth + 1);
  node->first = b->index->node_count;
  split(b, middle, to, depth + 1);
}

static sonde_status build_tree(sonde_surface_index *index, sonde_error *error) {
  const sonde_mesh *mesh = &index->mesh;
  builder b = {index, SONDE_NEW(sonde_vec3, mesh->face_count),
               SONDE_NEW(sonde_ranked, mesh->face_count)};
  sonde_status status = SONDE_OK;
  if (b.centroids && b.keys) {
    for (uint32_t f = 0; f < mesh->face_count; ++f) {
      const uint32_t *v = mesh->faces[f];
      sonde_vec3 sum =
          v_add(mesh->vertices[v[0]], v_add(mesh->vertices[v[1]], mesh->vertices[v[2]]));
      b.centroids[f] = v_scale(sum, 1.0 / 3.0);
      index->order[f] = f;
    }
    split(&b, 0, mesh->face_count, 0);
  } else {
    status = sonde_fail_memory(error);
  }
  sonde_free(b.centroids);
  sonde_free(b.keys);
  return status;
}

// The side of a face that runs between these two vertices.
static int side_of(const uint32_t face[3], uint32_t low, uint32_t high) {
  for (int k = 0; k < 2; ++k) {
    uint32_t a = face[k], b = face[k + 1];
    if ((a == low && b == high) || (a == high && b == low)) return k;
  }
  return 2;
}

static void fill_normals(sonde_surface_index *index, const sonde_half_edge *sides) {
  const sonde_mesh *mesh = &index->mesh;
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    const uint32_t *v = mesh->faces[f];
    index->face_normal[f] = v_unit(sonde_face_cross(mesh, f), vec3(0, 0, 0));
    for (int k = 0; k < 3; ++k) {
      double angle = sonde_corner_angle(mesh->vertices[v[k]], mesh->vertices[v[(k + 1) % 3]],
                                        mesh->vertices[v[(k + 2) % 3]]);
      sonde_vec3 *normal = &index->vertex_normal[v[k]];
      *normal = v_madd(*normal, angle, index->face_normal[f]);
    }
  }
  size_t count = 3 * (size_t)mesh->face_count, next;
  for (size_t i = 0; i < count; i = next) {
    sonde_vec3 sum = vec3(0, 0, 0);
    for (next = i; next < count; ++next) {
      if (sides[next].low != sides[i].low || sides[next].high != sides[i].high) break;
      sum = v_add(sum, index->face_normal[sides[next].face]);
    }
    for (size_t j = i; j < next; ++j) {
      uint32_t face = sides[j].face;
      index->side_normal[face][side_of(mesh->faces[face], sides[j].low, sides[j].high)] = sum;
    }
  }
}

static sonde_status allocate(sonde_surface_index *index, const sonde_mesh *mesh,
                             sonde_error *error) {
  sonde_status status = sonde_mesh_copy(mesh, &index->mesh, error);
  if (status) return status;
  index->nodes = SONDE_NEW(surface_node, 2 * (size_t)mesh->face_count);
  index->order = SONDE_NEW(uint32_t, mesh->face_count);
  index->vertex_normal = SONDE_NEW(sonde_vec3, mesh->vertex_count);
  index->face_normal = SONDE_NEW(sonde_vec3, mesh->face_count);
  index->side_normal = sonde_calloc(mesh->face_count, sizeof *index->side_normal);
  if (index->nodes && index->order && index->vertex_normal && index->face_normal &&
      index->side_normal)
    return SONDE_OK;
  return sonde_fail_memory(error);
}

sonde_status sonde_surface_index_create(const sonde_mesh *mesh, sonde_surface_index **out,
                                        sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && out != NULL);
  *out = NULL;
  if (!mesh->face_count) return sonde_fail(error, SONDE_MESH, "a mesh without faces has no index");
  sonde_half_edge *sides = NULL;
  sonde_status status = sonde_half_edges_sort(mesh, &sides, error);
  if (status) return status;
  sonde_surface_index *index = SONDE_NEW(sonde_surface_index, 1);
  status = index ? allocate(index, mesh, error) : sonde_fail_memory(error);
  if (!status) status = build_tree(index, error);
  if (!status) {
    fill_normals(index, sides);
    *out = index;
  } else {
    sonde_surface_index_destroy(index);
  }
  sonde_free(sides);
  return status;
}

void sonde_surface_index_destroy(sonde_surface_index *index) {
  if (!index) return;
  sonde_mesh_clear(&index->mesh);
  sonde_free(index->nodes);
  sonde_free(index->order);
  sonde_free(index->vertex_normal);
  sonde_free(index->face_normal);
  sonde_free(index->side_normal);
  sonde_free(index);
}
