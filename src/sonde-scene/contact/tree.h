// Layout of the face tree and of the list of sorted boxes.
#ifndef SONDE_SRC_CONTACT_TREE_H
#define SONDE_SRC_CONTACT_TREE_H

#include "base/base.h"
#include "base/maths.h"
#include "contact/contact.h"

enum { TREE_LEAF_FACES = 4, TREE_STACK = 160 };

// A box of the tree. A leaf has count > 0 faces from `first`; an inner node has its children at
// index + 1 and at `first`. Children stand behind their parent.
typedef struct tree_node {
  sonde_bounds box;
  uint32_t first, count;
} tree_node;

struct sonde_face_tree {
  uint32_t vertex_count, face_count, node_count;
  const sonde_vec3 *vertices; // borrowed
  uint32_t (*corners)[3];     // [face_count] in leaf order
  uint32_t *face;             // [face_count] the mesh's number of each
  tree_node *nodes;           // [node_count]
  uint32_t *leaf;             // [face_count] node of the mesh's face
  uint8_t *stale;             // [node_count] scratch of a partial fit
};

struct sonde_sweep {
  uint32_t capacity, count;
  uint32_t *order; // [capacity] boxes by their lower x at the last call
};

static inline sonde_vec3 v_low(sonde_vec3 a, sonde_vec3 b) {
  return vec3(a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z);
}
static inline sonde_vec3 v_high(sonde_vec3 a, sonde_vec3 b) {
  return vec3(a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y, a.z > b.z ? a.z : b.z);
}
static inline sonde_vec3 v_abs(sonde_vec3 a) { return vec3(fabs(a.x), fabs(a.y), fabs(a.z)); }
static inline sonde_bounds bounds_none(void) {
  return (sonde_bounds){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}
static inline sonde_bounds bounds_join(sonde_bounds a, sonde_bounds b) {
  return (sonde_bounds){v_low(a.low, b.low), v_high(a.high, b.high)};
}
static inline sonde_bounds bounds_add(sonde_bounds a, sonde_vec3 p) {
  return (sonde_bounds){v_low(a.low, p), v_high(a.high, p)};
}
static inline sonde_bounds bounds_common(sonde_bounds a, sonde_bounds b) {
  return (sonde_bounds){v_high(a.low, b.low), v_low(a.high, b.high)};
}
static inline bool bounds_meet(const sonde_bounds *a, const sonde_bounds *b, double margin) {
  return a->low.x - margin <= b->high.x && b->low.x - margin <= a->high.x &&
         a->low.y - margin <= b->high.y && b->low.y - margin <= a->high.y &&
         a->low.z - margin <= b->high.z && b->low.z - margin <= a->high.z;
}
static inline double bounds_size(const sonde_bounds *a) {
  sonde_vec3 d = v_sub(a->high, a->low);
  return d.x + d.y + d.z;
}

// Pairs of nodes still to be compared.
typedef struct tree_pairs {
  uint32_t depth;
  uint32_t at[TREE_STACK][2];
} tree_pairs;

static inline void tree_push(tree_pairs *stack, uint32_t a, uint32_t b) {
  SONDE_ASSERT(stack->depth < TREE_STACK);
  stack->at[stack->depth][0] = a;
  stack->at[stack->depth++][1] = b;
}

// Replaces a pair by two with the children of its larger node; false when both are leaves.
static inline bool tree_open(tree_pairs *stack, const sonde_face_tree *a, uint32_t at_a,
                             const sonde_face_tree *b, uint32_t at_b) {
  const tree_node *na = &a->nodes[at_a], *nb = &b->nodes[at_b];
  if (na->count && nb->count) return false;
  if (!na->count && (nb->count || bounds_size(&na->box) >= bounds_size(&nb->box))) {
    tree_push(stack, na->first, at_b);
    tree_push(stack, at_a + 1, at_b);
  } else {
    tree_push(stack, at_a, nb->first);
    tree_push(stack, at_a, at_b + 1);
  }
  return true;
}

#endif
