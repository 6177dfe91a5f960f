// The tree of boxes every step: fitting it to moved vertices and the pairs of two trees.
#include "contact/tree.h"

#include "geometry/triangle.h"

#include <string.h>

static void fit_node(sonde_face_tree *tree, uint32_t at) {
  tree_node *node = &tree->nodes[at];
  if (!node->count) {
    node->box = bounds_join(tree->nodes[at + 1].box, tree->nodes[node->first].box);
    return;
  }
  sonde_bounds box = bounds_none();
  for (uint32_t i = node->first; i < node->first + node->count; ++i)
    for (int k = 0; k < 3; ++k) box = bounds_add(box, tree->vertices[tree->corners[i][k]]);
  node->box = box;
}

void sonde_face_tree_refit(sonde_face_tree *tree, const sonde_vec3 *vertices) {
  SONDE_ASSERT(tree != NULL && vertices != NULL);
  tree->vertices = vertices;
  for (uint32_t at = tree->node_count; at-- > 0;) fit_node(tree, at);
}

void sonde_face_tree_refit_part(sonde_face_tree *tree, const sonde_vec3 *vertices,
                                const uint32_t *faces, uint32_t count) {
  SONDE_ASSERT(tree != NULL && vertices != NULL && count <= tree->face_count);
  tree->vertices = vertices;
  for (uint32_t k = 0; k < count; ++k) tree->stale[tree->leaf[faces[k]]] = 1;
  // Children stand behind their parents.
  for (uint32_t at = tree->node_count; at-- > 0;) {
    const tree_node *node = &tree->nodes[at];
    if (!node->count) tree->stale[at] = tree->stale[at + 1] | tree->stale[node->first];
    if (tree->stale[at]) fit_node(tree, at);
  }
  memset(tree->stale, 0, tree->node_count * sizeof *tree->stale);
}

sonde_bounds sonde_face_tree_bounds(const sonde_face_tree *tree) {
  SONDE_ASSERT(tree != NULL && tree->node_count > 0);
  return tree->nodes[0].box;
}

static sonde_bounds face_bounds(const sonde_face_tree *tree, uint32_t i) {
  sonde_bounds box = bounds_none();
  for (int k = 0; k < 3; ++k) box = bounds_add(box, tree->vertices[tree->corners[i][k]]);
  return box;
}

uint32_t sonde_face_tree_pairs(const sonde_face_tree *a, const sonde_face_tree *b, double margin_m,
                               uint32_t (*pairs)[2], uint32_t capacity, uint64_t *work) {
  SONDE_ASSERT(a != NULL && b != NULL && (pairs != NULL || capacity == 0));
  tree_pairs stack = {.depth = 0};
  uint32_t count = 0;
  uint64_t tests = 0;
  tree_push(&stack, 0, 0);
  while (stack.depth) {
    uint32_t at_a = stack.at[--stack.depth][0], at_b = stack.at[stack.depth][1];
    const tree_node *na = &a->nodes[at_a], *nb = &b->nodes[at_b];
    ++tests;
    if (!bounds_meet(&na->box, &nb->box, margin_m)) continue;
    if (tree_open(&stack, a, at_a, b, at_b)) continue;
    for (uint32_t i = na->first; i < na->first + na->count; ++i) {
      sonde_bounds box = face_bounds(a, i);
      for (uint32_t j = nb->first; j < nb->first + nb->count; ++j) {
        sonde_bounds other = face_bounds(b, j);
        ++tests;
        if (!bounds_meet(&box, &other, margin_m)) continue;
        if (count < capacity) {
          pairs[count][0] = a->face[i];
          pairs[count][1] = b->face[j];
        }
        ++count;
      }
    }
  }
  if (work) *work += tests;
  return count;
}

// Whether an edge of a passes through the inside of b, by signs of volumes: its ends lie on
// different sides, and its line passes within the three edges of b.
static bool edges_cross(const sonde_vec3 *x, const uint32_t a[3], const uint32_t b[3]) {
  const sonde_vec3 t[3] = {x[b[0]], x[b[1]], x[b[2]]};
  for (int k = 0; k < 3; ++k) {
    uint32_t p = a[k], q = a[(k + 1) % 3];
    bool touches = p == b[0] || p == b[1] || p == b[2] || q == b[0] || q == b[1] || q == b[2];
    if (touches) continue;
    sonde_vec3 d = v_sub(x[q], x[p]), n = v_cross(v_sub(t[1], t[0]), v_sub(t[2], t[0]));
    if (!(v_dot(n, v_sub(x[p], t[0])) * v_dot(n, v_sub(x[q], t[0])) < 0)) continue;
    int left = 0, right = 0;
    for (int i = 0; i < 3; ++i) {
      double side = v_dot(d, v_cross(v_sub(t[i], x[p]), v_sub(t[(i + 1) % 3], x[p])));
      left += side > 0;
      right += side < 0;
    }
    if (left == 3 || right == 3) return true;
  }
  return false;
}

bool sonde_face_tree_crosses(const sonde_face_tree *tree, uint32_t count, uint32_t faces[2]) {
  tree_pairs stack = {.depth = 0};
  SONDE_ASSERT(tree != NULL && faces != NULL);
  tree_push(&stack, 0, 0);
  while (stack.depth) {
    uint32_t at_a = stack.at[--stack.depth][0], at_b = stack.at[stack.depth][1];
    const tree_node *na = &tree->nodes[at_a], *nb = &tree->nodes[at_b];
    if (!bounds_meet(&na->box, &nb->box, 0)) continue;
    if (tree_open(&stack, tree, at_a, tree, at_b)) continue;
    for (uint32_t i = na->first; i < na->first + na->count; ++i)
      for (uint32_t j = nb->first; j < nb->first + nb->count; ++j) {
        const uint32_t *a = tree->corners[i], *b = tree->corners[j];
        sonde_bounds box = face_bounds(tree, i), other = face_bounds(tree, j);
        int common = 0;
        for (int k = 0; k < 9; ++k) common += a[k / 3] == b[k % 3];
        if (tree->face[i] >= tree->face[j] || tree->face[j] >= count || common > 1 ||
            !bounds_meet(&box, &other, 0))
          continue;
        if (!edges_cross(tree->vertices, a, b) && !edges_cross(tree->vertices, b, a)) continue;
        faces[0] = tree->face[i], faces[1] = tree->face[j];
        return true;
      }
  }
  return false;
}

static double box_distance2(const sonde_bounds *box, sonde_vec3 p) {
  double x = fmax(fmax(box->low.x - p.x, p.x - box->high.x), 0);
  double y = fmax(fmax(box->low.y - p.y, p.y - box->high.y), 0);
  double z = fmax(fmax(box->low.z - p.z, p.z - box->high.z), 0);
  return x * x + y * y + z * z;
}

uint32_t sonde_face_tree_within(const sonde_face_tree *tree, sonde_vec3 from, double reach_m,
                                uint32_t *faces, uint32_t capacity) {
  SONDE_ASSERT(tree != NULL && tree->node_count > 0 && reach_m >= 0);
  uint32_t stack[TREE_STACK], depth = 0, count = 0;
  stack[depth++] = 0;
  while (depth) {
    uint32_t at = stack[--depth];
    const tree_node *node = &tree->nodes[at];
    if (box_distance2(&node->box, from) > reach_m * reach_m) continue;
    if (!node->count) {
      SONDE_ASSERT(depth + 2 <= TREE_STACK);
      stack[depth++] = node->first;
      stack[depth++] = at + 1;
      continue;
    }
    for (uint32_t i = node->first; i < node->first + node->count; ++i) {
      sonde_bounds box = face_bounds(tree, i);
      if (box_distance2(&box, from) > reach_m * reach_m) continue;
      if (count < capacity) faces[count] = tree->face[i];
      ++count;
    }
  }
  return count;
}

// Branch and bound over the tree. Of faces equally near, as at an edge, the one that looks most
// along the line tells inside from outside.
sonde_face_point sonde_face_tree_nearest(const sonde_face_tree *tree, sonde_vec3 from) {
  SONDE_ASSERT(tree != NULL && tree->node_count > 0);
  sonde_face_point best = {.depth_m = INFINITY};
  double least2 = INFINITY, steepest = 0;
  uint32_t stack[TREE_STACK], depth = 0;
  stack[depth++] = 0;
  while (depth) {
    uint32_t at = stack[--depth];
    const tree_node *node = &tree->nodes[at];
    if (box_distance2(&node->box, from) > least2 * (1 + 1e-9)) continue;
    if (!node->count) {
      // The nearer child is looked at first.
      bool second = box_distance2(&tree->nodes[node->first].box, from) <
                    box_distance2(&tree->nodes[at + 1].box, from);
      SONDE_ASSERT(depth + 2 <= TREE_STACK);
      stack[depth++] = second ? at + 1 : node->first;
      stack[depth++] = second ? node->first : at + 1;
      continue;
    }
    for (uint32_t i = node->first; i < node->first + node->count; ++i) {
      const sonde_vec3 *x = tree->vertices;
      const uint32_t *v = tree->corners[i];
      double w[3];
      sonde_triangle_closest(from, x[v[0]], x[v[1]], x[v[2]], w);
      sonde_vec3 point = vec3(0, 0, 0);
      for (int k = 0; k < 3; ++k) point = v_madd(point, w[k], x[v[k]]);
      sonde_vec3 way = v_sub(point, from);
      sonde_vec3 normal = v_cross(v_sub(x[v[1]], x[v[0]]), v_sub(x[v[2]], x[v[0]]));
      normal = v_unit(normal, vec3(0, 0, 1));
      double distance = v_norm(way), along = v_dot(way, normal);
      double steep = distance > 0 ? fabs(along) / distance : 1;
      bool nearer = v_norm2(way) < least2 * (1 - 1e-9);
      if (!nearer && !(v_norm2(way) <= least2 * (1 + 1e-9) && steep > steepest)) continue;
      least2 = v_norm2(way);
      steepest = steep;
      best = (sonde_face_point){tree->face[i], {w[0], w[1], w[2]}, distance, normal};
      if (along < 0) best.depth_m = -distance;
      if (distance > 0) best.outward = v_scale(way, (along < 0 ? -1 : 1) / distance);
    }
  }
  return best;
}
