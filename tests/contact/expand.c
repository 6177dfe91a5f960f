// Depth of two convex bodies by an expanding polytope inside the set of differences (van den Bergen
// 2001). The face whose plane is nearest to 0 bounds the depth from below, the support along its
// normal from above; as long as they differ the support point is added to the polytope. While 0 is
// still outside, that face has a negative offset and is the one to expand as well.
#include "expand.h"

#include "contact/difference.h"

enum { MAX_POINTS = 256, MAX_FACES = 2 * MAX_POINTS, MAX_EDGES = 3 * MAX_FACES };

typedef struct point {
  sonde_vec3 w, on_a;
} point;

typedef struct facet {
  uint32_t corner[3];
  sonde_vec3 normal;
  double offset;
} facet;

typedef struct polytope {
  difference d;
  double size;
  uint32_t point_count, face_count, edge_count;
  point points[MAX_POINTS];
  facet faces[MAX_FACES];
  uint32_t edges[MAX_EDGES][2];
} polytope;

static bool add_face(polytope *p, uint32_t a, uint32_t b, uint32_t c) {
  SONDE_ASSERT(a < p->point_count && b < p->point_count && c < p->point_count);
  if (p->face_count == MAX_FACES) return false;
  sonde_vec3 x = p->points[a].w, y = v_sub(p->points[b].w, x), z = v_sub(p->points[c].w, x);
  sonde_vec3 n = v_cross(y, z);
  double length = v_norm(n), least = 1e-13 * p->size * (v_norm(y) + v_norm(z));
  facet f = {.corner = {a, b, c}, .offset = INFINITY};
  if (length > least) {
    f.normal = v_scale(n, 1 / length);
    f.offset = v_dot(f.normal, x);
  }
  p->faces[p->face_count++] = f;
  return true;
}

static point support(polytope *p, sonde_vec3 direction) {
  point q;
  q.w = difference_support(&p->d, direction, &q.on_a);
  return q;
}

// The farther of the supports along direction and back, measured from the point x.
static point farther(polytope *p, sonde_vec3 direction, sonde_vec3 x) {
  point there = support(p, direction), back = support(p, v_neg(direction));
  double a = fabs(v_dot(direction, v_sub(there.w, x))),
         b = fabs(v_dot(direction, v_sub(back.w, x)));
  return a >= b ? there : back;
}

static bool begin(polytope *p) {
  point *q = p->points;
  q[0] = support(p, vec3(1, 0, 0));
  q[1] = farther(p, vec3(1, 0, 0), q[0].w);
  sonde_vec3 along = v_unit(v_sub(q[1].w, q[0].w), vec3(1, 0, 0));
  sonde_vec3 least = fabs(along.x) < 0.6 ? vec3(1, 0, 0) : vec3(0, 1, 0);
  q[2] = farther(p, v_unit(v_cross(along, least), least), q[0].w);
  sonde_vec3 normal = v_cross(v_sub(q[1].w, q[0].w), v_sub(q[2].w, q[0].w));
  q[3] = farther(p, v_unit(normal, least), q[0].w);
  double six = v_dot(normal, v_sub(q[3].w, q[0].w));
  if (!(fabs(six) > 1e-14 * p->size * p->size * p->size)) return false;
  if (six > 0) {
    point swap = q[1];
    q[1] = q[2];
    q[2] = swap;
  }
  p->point_count = 4;
  return add_face(p, 0, 1, 2) && add_face(p, 0, 3, 1) && add_face(p, 0, 2, 3) &&
         add_face(p, 1, 3, 2);
}

// Puts the edge into the list, or takes its opposite out.
static bool toggle_edge(polytope *p, uint32_t a, uint32_t b) {
  for (uint32_t e = 0; e < p->edge_count; ++e) {
    if (p->edges[e][0] != b || p->edges[e][1] != a) continue;
    --p->edge_count;
    p->edges[e][0] = p->edges[p->edge_count][0];
    p->edges[e][1] = p->edges[p->edge_count][1];
    return true;
  }
  if (p->edge_count == MAX_EDGES) return false;
  p->edges[p->edge_count][0] = a;
  p->edges[p->edge_count++][1] = b;
  return true;
}

static bool expand(polytope *p, point q) {
  if (p->point_count == MAX_POINTS || p->face_count + 16 > MAX_FACES) return false;
  uint32_t added = p->point_count++;
  p->points[added] = q;
  // Faces that the new point sees are removed; the edges around them remain in the list.
  uint32_t kept = 0;
  bool room = true;
  p->edge_count = 0;
  for (uint32_t f = 0; f < p->face_count; ++f) {
    const facet *face = &p->faces[f];
    if (v_dot(face->normal, q.w) > face->offset + 1e-14 * p->size)
      for (int k = 0; k < 3; ++k)
        room &= toggle_edge(p, face->corner[k], face->corner[(k + 1) % 3]);
    else
      p->faces[kept++] = *face;
  }
  p->face_count = kept;
  for (uint32_t e = 0; e < p->edge_count && room; ++e)
    room = add_face(p, p->edges[e][0], p->edges[e][1], added);
  SONDE_ASSERT(p->face_count <= MAX_FACES);
  return room && p->face_count > 0;
}

// Point of A above the foot of 0 on the face.
static sonde_vec3 point_of_a(const polytope *p, const facet *f) {
  const point *q[3];
  for (int k = 0; k < 3; ++k) q[k] = &p->points[f->corner[k]];
  sonde_vec3 foot = v_scale(f->normal, f->offset), sum = vec3(0, 0, 0);
  double weight[3], total = 0;
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 x = v_sub(q[(k + 1) % 3]->w, foot), y = v_sub(q[(k + 2) % 3]->w, foot);
    weight[k] = clamp(v_dot(f->normal, v_cross(x, y)), 0, INFINITY);
    total += weight[k];
  }
  for (int k = 0; k < 3; ++k)
    sum = v_madd(sum, total > 0 ? weight[k] / total : 1.0 / 3, q[k]->on_a);
  return sum;
}

sonde_depth_result convex_expand(const sonde_convex *a, sonde_pose world_from_a,
                                 const sonde_convex *b, sonde_pose world_from_b,
                                 double tolerance_m) {
  SONDE_ASSERT(a->hull.vertex_count > 0 && b->hull.vertex_count > 0);
  polytope p = {.d = difference_make(a, world_from_a, b, world_from_b)};
  p.size = a->radius_m + b->radius_m;
  sonde_depth_result r = {0};
  double tolerance = fmax(tolerance_m, 1e-12 * p.size), upper = INFINITY;
  if (!begin(&p)) return r;
  facet best = p.faces[0];
  sonde_vec3 on_a = point_of_a(&p, &best);
  for (bool going = true; going;) {
    // The face with the least offset bounds the depth from below.
    const facet *face = &p.faces[0];
    SONDE_ASSERT(p.face_count > 0);
    for (uint32_t f = 1; f < p.face_count; ++f)
      if (p.faces[f].offset < face->offset) face = &p.faces[f];
    point q = support(&p, face->normal);
    double reach = v_dot(face->normal, q.w);
    ++r.iterations;
    r.converged = reach - face->offset <= tolerance;
    if (reach < upper || r.converged) {
      upper = reach;
      best = *face;
      on_a = point_of_a(&p, face);
    }
    going = upper > 0 && !r.converged && expand(&p, q);
  }
  r.overlap = upper > 0;
  r.support_calls = p.d.work;
  if (!r.overlap)
    return (sonde_depth_result){.iterations = r.iterations, .support_calls = p.d.work};
  r.depth_m = upper;
  r.direction = q_rotate(world_from_a.rotation, best.normal);
  r.point_a_m = pose_apply(world_from_a, on_a);
  return r;
}
