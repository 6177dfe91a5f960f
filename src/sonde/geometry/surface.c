// Builder of the surface index: a tree of boxes over the faces, split at the median centroid along
// the longest axis, and the pseudo-normals that tell inside from outside at any closest point.
#include "base/order.h"
#include "geometry/surface.h"

#include <string.h>

typedef struct builder {
  sonde_surface_index *index;
  sonde_vec3 *centroids;
  sonde_ranked *keys;
} builder;

// Appends the node of faces order[from, to) and everything below it.
static void split(builder *b, uint32_t from, uint32_t to, int depth) {
  SONDE_ASSERT(to > from && depth < SURFACE_STACK / 2);
  const sonde_mesh *mesh = &b->index->mesh;
  uint32_t *order = b->index->order;
  surface_node *node = &b->index->nodes[b->index->node_count++];

  // box of the faces, and of their centroids
  sonde_vec3 low = vec3(INFINITY, INFINITY, INFINITY), high = v_neg(low);
  node->low = low;
  node->high = high;
  for (uint32_t i = from; i < to; ++i) {
    low = v_min(low, b->centroids[order[i]]);
    high = v_max(high, b->centroids[order[i]]);
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 corner = mesh->vertices[mesh->faces[order[i]][k]];
      node->low = v_min(node->low, corner);
      node->high = v_max(node->high, corner);
    }
  }
  if (to - from <= SURFACE_LEAF_FACES) {
    node->first = from;
    node->count = to - from;
    return;
  }

  sonde_vec3 spread = v_sub(high, low);
  int axis = spread.y > spread.x ? 1 : 0;
  if (spread.z > v_coordinate(spread, axis)) axis = 2;
  sonde_halve_along(b->centroids, axis, order + from, to - from, SURFACE_LEAF_FACES, b->keys);
  uint32_t middle = from + (to - from) / 2;
  split(b, from, middle, depth + 1);
  node->first = b->index->node_count;
  split(b, middle, to, depth + 1);
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
  builder b = {index, SONDE_NEW(sonde_vec3, mesh->face_count),
               SONDE_NEW(sonde_ranked, mesh->face_count)};
  status = index ? sonde_mesh_copy(mesh, &index->mesh, error) : sonde_fail_memory(error);
  if (!status) {
    index->nodes = SONDE_NEW(surface_node, 2 * (size_t)mesh->face_count);
    index->order = SONDE_NEW(uint32_t, mesh->face_count);
    index->vertex_normal = SONDE_NEW(sonde_vec3, mesh->vertex_count);
    index->face_normal = SONDE_NEW(sonde_vec3, mesh->face_count);
    index->side_normal = sonde_calloc(mesh->face_count, sizeof *index->side_normal);
    if (!b.centroids || !b.keys || !index->nodes || !index->order || !index->vertex_normal ||
        !index->face_normal || !index->side_normal)
      status = sonde_fail_memory(error);
  }
  if (!status) {
    for (uint32_t f = 0; f < mesh->face_count; ++f) {
      const uint32_t *v = mesh->faces[f];
      sonde_vec3 sum =
          v_add(mesh->vertices[v[0]], v_add(mesh->vertices[v[1]], mesh->vertices[v[2]]));
      b.centroids[f] = v_scale(sum, 1.0 / 3.0);
      index->order[f] = f;
    }
    split(&b, 0, mesh->face_count, 0);
    // Unit normals of the faces, their sums over the sides and their angle-weighted sums at
    // vertices.
    SONDE_ASSERT(sides != NULL);
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
        const uint32_t *v = mesh->faces[sides[j].face];
        uint32_t side = 0; // that runs between the two vertices
        while (side < 2 && (v[side] != sides[j].low || v[side + 1] != sides[j].high) &&
               (v[side] != sides[j].high || v[side + 1] != sides[j].low))
          ++side;
        index->side_normal[sides[j].face][side] = sum;
      }
    }
    *out = index;
  } else {
    sonde_surface_index_destroy(index);
  }
  sonde_free(b.centroids);
  sonde_free(b.keys);
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
