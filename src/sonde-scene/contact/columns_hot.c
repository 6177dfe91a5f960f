// Columns of a region along its direction, from B's entry faces up to A's exit faces.
//
// The common polygon of two faces is replaced by three points of equal weight with the same area,
// centroid and second moments: they integrate products of two linear functions exactly and lie
// inside every convex polygon, for the ellipse through them is sqrt(2) times the one of its
// standard deviations (Kannan, Lovasz and Simonovits 1995).
//
//   region_box       of the common part of a region's touched faces
//   emit             points of one polygon
//   add_columns      a pair of faces above each other
//   blocked          does another face lie in between?
//   drop_blocked     keeps the columns without a gap
#include "contact/overlap.h"

static sonde_bounds region_box(const sonde_overlap *overlap, const sonde_overlap_region *r) {
  sonde_bounds box[2];
  for (int side = 0; side < 2; ++side) {
    const overlap_body *b = &overlap->body[side];
    box[side] = bounds_none();
    for (uint32_t i = 0; i < r->entry_count[side]; ++i)
      box[side] =
          bounds_add(box[side], b->tree->vertices[b->entries[r->first_entry[side] + i].vertex]);
  }
  return bounds_common(box[0], box[1]);
}

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

// Whether the faces bound the region whose columns are made.
static bool belongs(const sonde_overlap *overlap, const seen_face *a, const seen_face *b) {
  uint32_t own = overlap->column_region;
  SONDE_ASSERT(own < overlap->region_count);
  uint32_t ra = overlap->body[0].region[a->face], rb = overlap->body[1].region[b->face];
  uint32_t family = overlap->family[own];
  if (overlap->family[ra] != family || overlap->family[rb] != family) return false;
  if (overlap->split_by[own] == 0) return ra == own;
  return overlap->split_by[own] == 1 ? rb == own : true;
}

static void add_columns(sonde_overlap *overlap, const view *w, const seen_face *a,
                        const seen_face *b, const covered *polygon, double low) {
  (void)w;
  (void)low;
  if (!belongs(overlap, a, b)) return;
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

static bool box_meets(const sonde_bounds *box, const column *c) {
  const view *w = c->view;
  sonde_vec3 half = v_scale(v_sub(box->high, box->low), 0.5);
  sonde_vec3 middle = v_sub(v_scale(v_add(box->low, box->high), 0.5), c->foot);
  double z = v_dot(middle, w->k), reach = v_dot(half, w->abs_k);
  return fabs(v_dot(middle, w->u)) <= v_dot(half, w->abs_u) &&
         fabs(v_dot(middle, w->v)) <= v_dot(half, w->abs_v) && z + reach >= 0 &&
         z - reach <= c->length;
}

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
    if (!box_meets(&node->box, c)) continue;
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

// A column that passes through another face joins two parts of the common volume across a gap.
static void drop_blocked(sonde_overlap *overlap, const view *w, const sonde_overlap_region *r) {
  uint32_t kept = r->first_point;
  for (uint32_t i = r->first_point; i < overlap->point_count; ++i) {
    const sonde_overlap_point *p = &overlap->points[i];
    const overlap_body *b = &overlap->body[1];
    column c = {.view = w, .direction = r->direction, .length = p->depth_m, .skip = p->face_b};
    for (int k = 0; k < 3; ++k)
      c.foot = v_madd(c.foot, p->weight_b[k], b->tree->vertices[b->corner[p->face_b][k]]);
    if (blocked(overlap, b->tree, &c)) continue;
    c.skip = p->face_a;
    if (blocked(overlap, overlap->body[0].tree, &c)) continue;
    overlap->points[kept++] = *p;
  }
  overlap->point_count = kept;
}

void sonde_overlap_columns(sonde_overlap *overlap) {
  if (overlap->config.points_per_piece == UINT32_MAX) return;
  for (uint32_t k = 0; k < overlap->region_count; ++k) {
    sonde_overlap_region *r = &overlap->regions[k];
    r->first_point = overlap->point_count;
    if (!r->entry_count[0] || !r->entry_count[1]) continue;
    sonde_bounds box = region_box(overlap, r);
    if (box.low.x > box.high.x || box.low.y > box.high.y || box.low.z > box.high.z) continue;
    view w = sonde_view_make(r->direction, box);
    overlap->column_region = k;
    overlap->layered = false;
    overlap->deepest = 0;
    sonde_view_pairs(overlap, &w, true, add_columns);
    if (overlap->layered) drop_blocked(overlap, &w, r);
    r->point_count = overlap->point_count - r->first_point;
    if (overlap->layered) overlap->deepest = 0;
    for (uint32_t i = 0; i < r->point_count && overlap->layered; ++i)
      overlap->deepest = fmax(overlap->deepest, overlap->points[r->first_point + i].depth_m);
    if (r->point_count) r->depth_m = overlap->deepest;
  }
}
