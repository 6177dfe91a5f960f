// Pairs of faces that cover each other along a direction.
#include "contact/overlap.h"

// Faces steeper than this to the view are refused.
#define STEEP 1e-6

view sonde_view_make(sonde_vec3 k, sonde_bounds common) {
  double x = fabs(k.x), y = fabs(k.y), z = fabs(k.z);
  sonde_vec3 least = x <= y && x <= z ? vec3(1, 0, 0) : y <= z ? vec3(0, 1, 0) : vec3(0, 0, 1);
  view w = {.k = k, .origin = v_scale(v_add(common.low, common.high), 0.5)};
  w.u = v_unit(v_cross(least, k), least);
  w.v = v_cross(k, w.u);
  w.abs_u = v_abs(w.u);
  w.abs_v = v_abs(w.v);
  w.abs_k = v_abs(w.k);
  sonde_vec3 half = v_scale(v_sub(common.high, common.low), 0.5);
  w.window.high = vec3(v_dot(half, w.abs_u), v_dot(half, w.abs_v), v_dot(half, w.abs_k));
  w.window.low = v_neg(w.window.high);
  SONDE_ASSERT(w.window.high.x >= 0);
  return w;
}

static sonde_bounds project_node(const view *w, const sonde_bounds *box) {
  sonde_vec3 half = v_scale(v_sub(box->high, box->low), 0.5);
  sonde_vec3 middle = v_sub(v_scale(v_add(box->low, box->high), 0.5), w->origin);
  sonde_vec3 at = vec3(v_dot(middle, w->u), v_dot(middle, w->v), v_dot(middle, w->k));
  sonde_vec3 reach = vec3(v_dot(half, w->abs_u), v_dot(half, w->abs_v), v_dot(half, w->abs_k));
  return (sonde_bounds){v_sub(at, reach), v_add(at, reach)};
}

static bool across(const sonde_bounds *a, const sonde_bounds *b) {
  return a->low.x <= b->high.x && b->low.x <= a->high.x && a->low.y <= b->high.y &&
         b->low.y <= a->high.y;
}

// In the window across; A reaches above its lower end, B below its upper end.
static bool in_window(const view *w, const sonde_bounds *box, bool is_a) {
  if (!across(box, &w->window)) return false;
  return is_a ? box->high.z >= w->window.low.z : box->low.z <= w->window.high.z;
}

static bool covers(const sonde_bounds *a, const sonde_bounds *b) {
  return across(a, b) && a->high.z >= b->low.z;
}

// ---- faces --------------------------------------------------------------------------------

// False when the face cannot matter; *steep when it is almost along the view.
static bool see_face(const view *w, const sonde_face_tree *tree, uint32_t i, bool is_a,
                     seen_face *face, bool *steep) {
  face->face = tree->face[i];
  face->corner = tree->corners[i];
  face->box = bounds_none();
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 x = v_sub(tree->vertices[face->corner[k]], w->origin);
    face->p[k] = vec3(v_dot(x, w->u), v_dot(x, w->v), v_dot(x, w->k));
    face->box = bounds_add(face->box, face->p[k]);
  }
  if (!in_window(w, &face->box, is_a)) return false;
  sonde_vec3 twice = v_cross(v_sub(face->p[1], face->p[0]), v_sub(face->p[2], face->p[0]));
  face->twice_area = twice.z;
  if (fabs(twice.z) > STEEP * v_norm(twice)) return true;
  *steep |= v_norm2(twice) > 0;
  return false;
}

void sonde_seen_weights(const seen_face *face, double u, double v, double weight[3]) {
  SONDE_ASSERT(face->twice_area != 0);
  const sonde_vec3 *p = face->p;
  weight[1] =
      ((u - p[0].x) * (p[2].y - p[0].y) - (v - p[0].y) * (p[2].x - p[0].x)) / face->twice_area;
  weight[2] =
      ((p[1].x - p[0].x) * (v - p[0].y) - (p[1].y - p[0].y) * (u - p[0].x)) / face->twice_area;
  weight[0] = 1 - weight[1] - weight[2];
}

// Keeps the part where f >= 0; f is given at the corners.
static void clip(covered *polygon, const double *f) {
  SONDE_ASSERT(polygon->count <= POLYGON_CORNERS);
  covered in = *polygon;
  uint32_t kept = 0;
  for (uint32_t k = 0; k < in.count; ++k) {
    uint32_t next = k + 1 < in.count ? k + 1 : 0;
    if (f[k] >= 0 && kept < POLYGON_CORNERS) {
      polygon->u[kept] = in.u[k];
      polygon->v[kept] = in.v[k];
      polygon->depth[kept++] = in.depth[k];
    }
    bool changes = (f[k] > 0 && f[next] < 0) || (f[k] < 0 && f[next] > 0);
    if (!changes || kept == POLYGON_CORNERS) continue;
    double s = f[k] / (f[k] - f[next]);
    polygon->u[kept] = in.u[k] + s * (in.u[next] - in.u[k]);
    polygon->v[kept] = in.v[k] + s * (in.v[next] - in.v[k]);
    polygon->depth[kept++] = in.depth[k] + s * (in.depth[next] - in.depth[k]);
  }
  polygon->count = kept;
}

static bool within(const sonde_bounds *box, const sonde_bounds *window) {
  return box->low.x >= window->low.x && box->high.x <= window->high.x &&
         box->low.y >= window->low.y && box->high.y <= window->high.y;
}

static void meet(sonde_overlap *overlap, const view *w, const seen_face *a, const seen_face *b,
                 sonde_pair_fn fn) {
  covered polygon;
  double f[POLYGON_CORNERS]; // the function that clips, at the corners
  ++overlap->result.face_pairs;
  // The common polygon of the two faces in the window carries z_a - z_b at its corners.
  bool turned = a->twice_area < 0;
  polygon.count = 3;
  for (int k = 0; k < 3; ++k) {
    const sonde_vec3 *p = &a->p[turned ? 2 - k : k];
    polygon.u[k] = p->x;
    polygon.v[k] = p->y;
    polygon.depth[k] = p->z;
  }
  turned = b->twice_area < 0;
  for (int k = 0; k < 3 && polygon.count; ++k) {
    int next = (k + 1) % 3;
    // The side of B's edge is kept on which the inside of B lies.
    sonde_vec3 p = b->p[turned ? 2 - k : k], q = b->p[turned ? 2 - next : next];
    double du = q.x - p.x, dv = q.y - p.y;
    for (uint32_t i = 0; i < polygon.count; ++i)
      f[i] = du * (polygon.v[i] - p.y) - dv * (polygon.u[i] - p.x);
    clip(&polygon, f);
  }
  if (!within(&a->box, &w->window) && !within(&b->box, &w->window)) {
    for (int side = 0; side < 4 && polygon.count; ++side) {
      const double *at = side < 2 ? polygon.u : polygon.v;
      double least = side < 2 ? w->window.low.x : w->window.low.y;
      double most = side < 2 ? w->window.high.x : w->window.high.y;
      for (uint32_t k = 0; k < polygon.count; ++k) f[k] = side % 2 ? most - at[k] : at[k] - least;
      clip(&polygon, f);
    }
  }
  for (uint32_t k = 0; k < polygon.count; ++k) {
    double weight[3];
    sonde_seen_weights(b, polygon.u[k], polygon.v[k], weight);
    polygon.depth[k] -= weight[0] * b->p[0].z + weight[1] * b->p[1].z + weight[2] * b->p[2].z;
  }
  if (polygon.count < 3) return;
  double low = INFINITY, high = -INFINITY;
  for (uint32_t k = 0; k < polygon.count; ++k) {
    low = fmin(low, polygon.depth[k]);
    high = fmax(high, polygon.depth[k]);
  }
  if (!(high > 0)) return;
  if (low < 0) {
    for (uint32_t k = 0; k < polygon.count; ++k) f[k] = polygon.depth[k];
    clip(&polygon, f);
  }
  if (polygon.count >= 3) fn(overlap, w, a, b, &polygon, low);
}

moments sonde_covered_moments(const covered *p) {
  SONDE_ASSERT(p->count >= 3 && p->count <= POLYGON_CORNERS);
  moments m = {0};
  double su = 0, sv = 0;
  for (uint32_t k = 2; k < p->count; ++k) {
    double au = p->u[k - 1] - p->u[0], av = p->v[k - 1] - p->v[0];
    double bu = p->u[k] - p->u[0], bv = p->v[k] - p->v[0];
    double area = 0.5 * (au * bv - av * bu);
    m.area += area;
    su += area * (au + bu) / 3;
    sv += area * (av + bv) / 3;
    m.uu += area * (au * au + bu * bu + au * bu) / 6;
    m.vv += area * (av * av + bv * bv + av * bv) / 6;
    m.uv += area * (2 * au * av + 2 * bu * bv + au * bv + av * bu) / 12;
  }
  if (!(m.area > 0)) return (moments){0};
  double u = su / m.area, v = sv / m.area;
  m.uu = m.uu / m.area - u * u;
  m.vv = m.vv / m.area - v * v;
  m.uv = m.uv / m.area - u * v;
  m.u = p->u[0] + u;
  m.v = p->v[0] + v;
  return m;
}

// ---- trees --------------------------------------------------------------------------------

static uint32_t see_leaf(sonde_overlap *overlap, const view *w, int body, const tree_node *node,
                         bool marked, seen_face seen[TREE_LEAF_FACES]) {
  const overlap_body *b = &overlap->body[body];
  uint32_t count = 0;
  SONDE_ASSERT(node->count <= TREE_LEAF_FACES);
  for (uint32_t i = node->first; i < node->first + node->count; ++i) {
    uint32_t face = b->tree->face[i];
    if (marked && (b->face_stamp[face] != overlap->stamp || b->region[face] == SONDE_NO_REGION))
      continue;
    count += see_face(w, b->tree, i, body == 0, &seen[count], &overlap->steep);
  }
  return count;
}

void sonde_view_pairs(sonde_overlap *overlap, const view *w, bool marked, sonde_pair_fn fn) {
  const sonde_face_tree *a = overlap->body[0].tree, *b = overlap->body[1].tree;
  SONDE_ASSERT(a != NULL && b != NULL);
  tree_pairs stack = {.depth = 0};
  tree_push(&stack, 0, 0);
  while (stack.depth && (marked || overlap->patient || !overlap->steep)) {
    uint32_t at_a = stack.at[--stack.depth][0], at_b = stack.at[stack.depth][1];
    const tree_node *na = &a->nodes[at_a], *nb = &b->nodes[at_b];
    ++overlap->result.box_tests;
    sonde_bounds box_a = project_node(w, &na->box);
    if (!in_window(w, &box_a, true)) continue;
    sonde_bounds box_b = project_node(w, &nb->box);
    if (!in_window(w, &box_b, false) || !covers(&box_a, &box_b)) continue;
    if (tree_open(&stack, a, at_a, b, at_b)) continue;
    // The faces of two leaves are compared one by one.
    seen_face seen_a[TREE_LEAF_FACES], seen_b[TREE_LEAF_FACES];
    uint32_t count_a = see_leaf(overlap, w, 0, na, marked, seen_a);
    uint32_t count_b = count_a ? see_leaf(overlap, w, 1, nb, marked, seen_b) : 0;
    for (uint32_t i = 0; i < count_a; ++i)
      for (uint32_t j = 0; j < count_b; ++j)
        if (covers(&seen_a[i].box, &seen_b[j].box)) meet(overlap, w, &seen_a[i], &seen_b[j], fn);
  }
}
