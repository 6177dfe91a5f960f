// Columns of a region along its direction, from B's entry faces up to A's exit faces.
//
// The common polygon of two faces is replaced by three points of equal weight with the same area,
// centroid and second moments: they integrate products of two linear functions exactly and lie
// inside every convex polygon, for the ellipse through them is sqrt(2) times the one of its
// standard deviations (Kannan, Lovasz and Simonovits 1995).
#include "contact/overlap.h"

static void emit(sonde_overlap *overlap, const seen_face *a, const seen_face *b, double u, double v,
                 double area) {
  if (overlap->point_count == overlap->config.max_points) {
    overlap->result.flags |= SONDE_OVERLAP_POINTS_FULL;
    return;
  }
  sonde_overlap_point *p = &overlap->points[overlap->point_count++];
  *p = (sonde_overlap_point){a->face, b->face, overlap->column_region, {0}, {0}, area, 0};
  sonde_seen_weights(a, u, v, p->weight_a);
  sonde_seen_weights(b, u, v, p->weight_b);
  double depth = 0;
  for (int k = 0; k < 3; ++k) depth += p->weight_a[k] * a->p[k].z - p->weight_b[k] * b->p[k].z;
  p->depth_m = fmax(depth, 0);
}

static void add_columns(sonde_overlap *overlap, const view *w, const seen_face *a,
                        const seen_face *b, const covered *polygon, double low) {
  (void)w;
  (void)low;
  // The faces bound the region whose columns are made, or they are passed over.
  uint32_t own = overlap->column_region, family = overlap->family[own];
  SONDE_ASSERT(own < overlap->region_count);
  uint32_t region[2] = {overlap->body[0].region[a->face], overlap->body[1].region[b->face]};
  if (overlap->family[region[0]] != family || overlap->family[region[1]] != family) return;
  int split_by = overlap->split_by[own];
  if (split_by >= 0 && region[split_by] != own) return;
  if (a->twice_area < 0 || b->twice_area > 0) {
    overlap->layered = true;
    return;
  }
  moments m = sonde_covered_moments(polygon);
  if (!(m.area > 0)) return;
  for (uint32_t k = 0; k < polygon->count; ++k)
    overlap->deepest = fmax(overlap->deepest, polygon->depth[k]);
  if (overlap->config.points_per_piece == 1) {
    emit(overlap, a, b, m.u, m.v, m.area);
    return;
  }
  // Square root of the second moments; needles have none across.
  double l11 = sqrt(fmax(m.uu, 0)), l21 = l11 > 0 ? m.uv / l11 : 0;
  double l22 = sqrt(fmax(m.vv - l21 * l21, 0));
  static const double turn[3][2] = {{0, 1.4142135623730951},
                                    {1.2247448713915890, -0.70710678118654752},
                                    {-1.2247448713915890, -0.70710678118654752}};
  for (int k = 0; k < 3; ++k)
    emit(overlap, a, b, m.u + l11 * turn[k][0], m.v + l21 * turn[k][0] + l22 * turn[k][1],
         m.area / 3);
}

// ---- gaps ---------------------------------------------------------------------------------

typedef struct column {
  const view *view;
  sonde_vec3 foot, direction;
  double length;
  uint32_t skip; // face that it begins or ends on
} column;

// Whether the face is met strictly inside the column.
static bool face_meets(const sonde_face_tree *tree, uint32_t i, const column *c) {
  sonde_vec3 p[3];
  for (int k = 0; k < 3; ++k) p[k] = v_sub(tree->vertices[tree->corners[i][k]], c->foot);
  double side[3], sum = 0;
  for (int k = 0; k < 3; ++k) {
    side[k] = v_dot(c->direction, v_cross(p[(k + 1) % 3], p[(k + 2) % 3]));
    sum += side[k];
  }
  bool negative = side[0] < 0 || side[1] < 0 || side[2] < 0;
  bool positive = side[0] > 0 || side[1] > 0 || side[2] > 0;
  if (negative == positive || sum == 0) return false;
  double t = 0;
  for (int k = 0; k < 3; ++k) t += side[k] / sum * v_dot(p[k], c->direction);
  return t > 1e-6 * c->length && t < (1 - 1e-6) * c->length;
}

static bool blocked(sonde_overlap *overlap, const sonde_face_tree *tree, const column *c) {
  uint32_t stack[TREE_STACK], depth = 0;
  stack[depth++] = 0;
  while (depth) {
    const tree_node *node = &tree->nodes[stack[--depth]];
    uint32_t at = (uint32_t)(node - tree->nodes);
    ++overlap->result.box_tests;
    // The box is compared with the column in the axes of the view.
    const view *w = c->view;
    sonde_vec3 half = v_scale(v_sub(node->box.high, node->box.low), 0.5);
    sonde_vec3 middle = v_sub(v_scale(v_add(node->box.low, node->box.high), 0.5), c->foot);
    double z = v_dot(middle, w->k), reach = v_dot(half, w->abs_k);
    if (!(fabs(v_dot(middle, w->u)) <= v_dot(half, w->abs_u) &&
          fabs(v_dot(middle, w->v)) <= v_dot(half, w->abs_v) && z + reach >= 0 &&
          z - reach <= c->length))
      continue;
    if (!node->count) {
      SONDE_ASSERT(depth + 2 <= TREE_STACK);
      stack[depth++] = node->first;
      stack[depth++] = at + 1;
      continue;
    }
    for (uint32_t i = node->first; i < node->first + node->count; ++i)
      if (tree->face[i] != c->skip && face_meets(tree, i, c)) return true;
  }
  return false;
}

void sonde_overlap_columns(sonde_overlap *overlap) {
  if (overlap->config.points_per_piece == UINT32_MAX) return;
  for (uint32_t k = 0; k < overlap->region_count; ++k) {
    sonde_overlap_region *r = &overlap->regions[k];
    r->first_point = overlap->point_count;
    if (!r->entry_count[0] || !r->entry_count[1]) continue;
    // The columns run within the common box of the vertices that bound the region.
    sonde_bounds ends[2];
    for (int side = 0; side < 2; ++side) {
      const overlap_body *b = &overlap->body[side];
      ends[side] = bounds_none();
      for (uint32_t i = 0; i < r->entry_count[side]; ++i)
        ends[side] =
            bounds_add(ends[side], b->tree->vertices[b->entries[r->first_entry[side] + i].vertex]);
    }
    sonde_bounds box = bounds_common(ends[0], ends[1]);
    if (box.low.x > box.high.x || box.low.y > box.high.y || box.low.z > box.high.z) continue;
    view w = sonde_view_make(r->direction, box);
    overlap->column_region = k;
    overlap->layered = false;
    overlap->deepest = 0;
    sonde_view_pairs(overlap, &w, true, add_columns);
    if (overlap->layered) {
      // A column that passes through another face joins two parts of the common volume across a
      // gap: it is dropped.
      uint32_t whole = r->first_point;
      overlap->deepest = 0;
      for (uint32_t i = r->first_point; i < overlap->point_count; ++i) {
        const sonde_overlap_point *p = &overlap->points[i];
        const sonde_face_tree *above = overlap->body[0].tree, *below = overlap->body[1].tree;
        const uint32_t *corner = overlap->body[1].corner[p->face_b];
        column c = {.view = &w, .direction = r->direction, .length = p->depth_m, .skip = p->face_b};
        for (int e = 0; e < 3; ++e)
          c.foot = v_madd(c.foot, p->weight_b[e], below->vertices[corner[e]]);
        if (blocked(overlap, below, &c)) continue;
        c.skip = p->face_a;
        if (blocked(overlap, above, &c)) continue;
        overlap->deepest = fmax(overlap->deepest, p->depth_m);
        overlap->points[whole++] = *p;
      }
      overlap->point_count = whole;
    }
    r->point_count = overlap->point_count - r->first_point;
    if (r->point_count) r->depth_m = overlap->deepest;
  }
}
