// Builder of the face tree: split at the median centroid along the longest axis.
//
//   split     one node, then its two halves
#include "contact/tree.h"

#include "base/order.h"

typedef struct builder {
  const sonde_mesh *mesh;
  sonde_face_tree *tree;
  sonde_vec3 *centroids;
  sonde_ranked *keys;
} builder;

// The axis along which the centroids of face[from, to) spread most.
static int longest_axis(const builder *b, uint32_t from, uint32_t to) {
  sonde_bounds spread = bounds_none();
  for (uint32_t i = from; i < to; ++i) spread = bounds_add(spread, b->centroids[b->tree->face[i]]);
  sonde_vec3 d = v_sub(spread.high, spread.low);
  int axis = d.y > d.x ? 1 : 0;
  return d.z > v_coordinate(d, axis) ? 2 : axis;
}

static void split(builder *b, uint32_t from, uint32_t to, int depth) {
  SONDE_ASSERT(to > from && depth < TREE_STACK / 4);
  uint32_t *face = b->tree->face;
  tree_node *node = &b->tree->nodes[b->tree->node_count++];
  if (to - from <= TREE_LEAF_FACES) {
    node->first = from;
    node->count = to - from;
    return;
  }
  int axis = longest_axis(b, from, to);
  sonde_sort_along(b->centroids, axis, face + from, to - from, b->keys);
  uint32_t middle = from + (to - from) / 2;
  split(b, from, middle, depth + 1);
  node->first = b->tree->node_count;
  split(b, middle, to, depth + 1);
}

static void build(builder *b) {
  const sonde_mesh *mesh = b->mesh;
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    const uint32_t *v = mesh->faces[f];
    const sonde_vec3 *x = mesh->vertices;
    b->centroids[f] = v_scale(v_add(x[v[0]], v_add(x[v[1]], x[v[2]])), 1.0 / 3.0);
    b->tree->face[f] = f;
  }
  split(b, 0, mesh->face_count, 0);
  SONDE_ASSERT(b->tree->node_count < 2 * mesh->face_count);
  for (uint32_t i = 0; i < mesh->face_count; ++i)
    for (int k = 0; k < 3; ++k) b->tree->corners[i][k] = mesh->faces[b->tree->face[i]][k];
}

static sonde_status check_faces(const sonde_mesh *mesh, sonde_error *error) {
  if (!mesh->face_count) return sonde_fail(error, SONDE_MESH, "a mesh without faces has no tree");
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k)
      if (mesh->faces[f][k] >= mesh->vertex_count)
        return sonde_fail(error, SONDE_MESH, "face %u names vertex %u, expected less than %u", f,
                          mesh->faces[f][k], mesh->vertex_count);
  return SONDE_OK;
}

sonde_status sonde_face_tree_create(const sonde_mesh *mesh, sonde_face_tree **out,
                                    sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && out != NULL);
  *out = NULL;
  sonde_status status = check_faces(mesh, error);
  if (status) return status;
  sonde_face_tree *tree = SONDE_NEW(sonde_face_tree, 1);
  if (!tree) return sonde_fail_memory(error);
  tree->vertex_count = mesh->vertex_count;
  tree->face_count = mesh->face_count;
  tree->corners = sonde_calloc(mesh->face_count, sizeof *tree->corners);
  tree->face = SONDE_NEW(uint32_t, mesh->face_count);
  tree->nodes = SONDE_NEW(tree_node, 2 * (size_t)mesh->face_count);
  builder b = {mesh, tree, SONDE_NEW(sonde_vec3, mesh->face_count),
               SONDE_NEW(sonde_ranked, mesh->face_count)};
  bool room = tree->corners && tree->face && tree->nodes && b.centroids && b.keys;
  if (room) build(&b);
  sonde_free(b.centroids);
  sonde_free(b.keys);
  if (!room) {
    sonde_face_tree_destroy(tree);
    return sonde_fail_memory(error);
  }
  sonde_face_tree_refit(tree, mesh->vertices);
  *out = tree;
  return SONDE_OK;
}

void sonde_face_tree_destroy(sonde_face_tree *tree) {
  if (!tree) return;
  sonde_free(tree->corners);
  sonde_free(tree->face);
  sonde_free(tree->nodes);
  sonde_free(tree);
}
