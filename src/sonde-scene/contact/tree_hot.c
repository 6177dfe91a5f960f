// The tree of boxes every step: fitting it to moved vertices and the pairs of two trees.
#include "contact/tree.h"

void sonde_face_tree_refit(sonde_face_tree *tree, const sonde_vec3 *vertices) {
  SONDE_ASSERT(tree != NULL && vertices != NULL);
  tree->vertices = vertices;
  for (uint32_t at = tree->node_count; at-- > 0;) {
    tree_node *node = &tree->nodes[at];
    if (!node->count) {
      node->box = bounds_join(tree->nodes[at + 1].box, tree->nodes[node->first].box);
      continue;
    }
    sonde_bounds box = bounds_none();
    for (uint32_t i = node->first; i < node->first + node->count; ++i)
      for (int k = 0; k < 3; ++k) box = bounds_add(box, vertices[tree->corners[i][k]]);
    node->box = box;
  }
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
