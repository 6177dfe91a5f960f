// Memory of the face tree and of the list of sorted boxes. The tree is split at the median centroid
// along the axis on which the centroids spread most.
#include "contact/tree.h"

#include "base/order.h"

typedef struct builder {
  sonde_face_tree *tree;
  sonde_vec3 *centroids;
  sonde_ranked *keys;
} builder;

// The node of face[from, to), then the nodes of its two halves.
static void split(builder *b, uint32_t from, uint32_t to, int depth) {
  SONDE_ASSERT(to > from && depth < TREE_STACK / 4);
  uint32_t *face = b->tree->face;
  tree_node *node = &b->tree->nodes[b->tree->node_count++];
  if (to - from <= TREE_LEAF_FACES) {
    node->first = from;
    node->count = to - from;
    for (uint32_t i = from; i < to; ++i) b->tree->leaf[face[i]] = b->tree->node_count - 1;
    return;
  }
  sonde_bounds spread = bounds_none();
  for (uint32_t i = from; i < to; ++i) spread = bounds_add(spread, b->centroids[face[i]]);
  sonde_vec3 d = v_sub(spread.high, spread.low);
  int axis = d.y > d.x ? 1 : 0;
  if (d.z > v_coordinate(d, axis)) axis = 2;
  sonde_halve_along(b->centroids, axis, face + from, to - from, TREE_LEAF_FACES, b->keys);
  uint32_t middle = from + (to - from) / 2;
  split(b, from, middle, depth + 1);
  node->first = b->tree->node_count;
  split(b, middle, to, depth + 1);
}

sonde_status sonde_face_tree_create(const sonde_mesh *mesh, sonde_face_tree **out,
                                    sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && out != NULL);
  *out = NULL;
  uint32_t faces = mesh->face_count;
  if (!faces) return sonde_fail(error, SONDE_MESH, "a mesh without faces has no tree");
  for (uint32_t i = 0; i < 3 * faces; ++i)
    if (mesh->faces[i / 3][i % 3] >= mesh->vertex_count)
      return sonde_fail(error, SONDE_MESH, "face %u names vertex %u, expected less than %u", i / 3,
                        mesh->faces[i / 3][i % 3], mesh->vertex_count);
  sonde_face_tree *tree = SONDE_NEW(sonde_face_tree, 1);
  if (!tree) return sonde_fail_memory(error);
  tree->vertex_count = mesh->vertex_count;
  tree->face_count = faces;
  tree->corners = sonde_calloc(faces, sizeof *tree->corners);
  tree->face = SONDE_NEW(uint32_t, faces);
  tree->nodes = SONDE_NEW(tree_node, 2 * (size_t)faces);
  tree->leaf = SONDE_NEW(uint32_t, faces);
  tree->stale = SONDE_NEW(uint8_t, 2 * (size_t)faces);
  builder b = {tree, SONDE_NEW(sonde_vec3, faces), SONDE_NEW(sonde_ranked, faces)};
  bool room = tree->corners && tree->face && tree->nodes && tree->leaf && tree->stale &&
              b.centroids && b.keys;
  if (room) {
    for (uint32_t f = 0; f < faces; ++f) {
      const uint32_t *v = mesh->faces[f];
      const sonde_vec3 *x = mesh->vertices;
      b.centroids[f] = v_scale(v_add(x[v[0]], v_add(x[v[1]], x[v[2]])), 1.0 / 3.0);
      tree->face[f] = f;
    }
    split(&b, 0, faces, 0);
    SONDE_ASSERT(tree->node_count < 2 * faces);
    for (uint32_t i = 0; i < faces; ++i)
      for (int k = 0; k < 3; ++k) tree->corners[i][k] = mesh->faces[tree->face[i]][k];
    sonde_face_tree_refit(tree, mesh->vertices);
    *out = tree;
  }
  sonde_free(b.centroids);
  sonde_free(b.keys);
  if (room) return SONDE_OK;
  sonde_face_tree_destroy(tree);
  return sonde_fail_memory(error);
}

void sonde_face_tree_destroy(sonde_face_tree *tree) {
  if (!tree) return;
  sonde_free(tree->corners);
  sonde_free(tree->face);
  sonde_free(tree->nodes);
  sonde_free(tree->leaf);
  sonde_free(tree->stale);
  sonde_free(tree);
}

sonde_status sonde_sweep_create(uint32_t capacity, sonde_sweep **out, sonde_error *error) {
  SONDE_ASSERT(out != NULL);
  *out = NULL;
  sonde_sweep *sweep = SONDE_NEW(sonde_sweep, 1);
  if (!sweep) return sonde_fail_memory(error);
  sweep->capacity = capacity;
  sweep->order = SONDE_NEW(uint32_t, capacity);
  if (!sweep->order) {
    sonde_free(sweep);
    return sonde_fail_memory(error);
  }
  *out = sweep;
  return SONDE_OK;
}

void sonde_sweep_destroy(sonde_sweep *sweep) {
  if (!sweep) return;
  SONDE_ASSERT(sweep->count <= sweep->capacity);
  sonde_free(sweep->order);
  sonde_free(sweep);
}
