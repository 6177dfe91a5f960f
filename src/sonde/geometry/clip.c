// Volume between a skin triangle and the far side of a convex body, exactly.
//
// In barycentric coordinates of the triangle every plane of the body is a linear function, given by
// its values at the corners. The triangle is clipped by the planes to a convex polygon. There the
// column along `direction` ends at the first plane that it leaves, so its length is the minimum of
// linear functions t_j = (d_j - n_j.x)/(n_j.direction) over the planes with n_j.direction > 0. The
// polygon is split until one t_j is the minimum on each piece; comparing the corners is enough.
// With the area vector N (|N| the triangle's area, along its outward normal):
//   volume   = (-N . direction) x mean over the triangle of t, 0 outside the polygon
//   gradient = N x mean of phi_i (Hadamard: a surface moved by dx sweeps the volume dx . n dA)
#include "geometry/internal.h"

// Capacities. A triangle that more planes clip or end than fit here is treated as if the planes
// beyond were absent (volume too large by what they would clip); a triangle of the size of the
// body's faces meets a handful.
enum { MAX_CORNERS = 96, MAX_FAR = 192, ARENA_CORNERS = 1024, MAX_PIECES = 96, MAX_SPLITS = 256 };

// Barycentric coordinates of corners 1 and 2; corner 0 has the rest.
typedef struct corner {
  double u, v;
} corner;

// Linear function over the triangle by its values at the three corners.
typedef struct linear {
  double at[3];
} linear;

// The body's planes and the skin triangle, with a ball around the triangle: one product with the
// ball's centre tells most planes from those that may matter.
typedef struct contact {
  const sonde_vec3 *n;
  const double *d;
  uint32_t planes;
  const sonde_vec3 *x; // [3]
  sonde_vec3 direction, centre;
  double radius;
} contact;

// Depth of the ball's centre below a plane; of the corners by below_plane.
static double centre_depth(const contact *c, uint32_t j) {
  return c->d[j] - v_dot(c->n[j], c->centre);
}

// scale times the depth below a plane as a function over the triangle.
static linear below_plane(const contact *c, uint32_t j, double scale) {
  linear f;
  for (int k = 0; k < 3; ++k) f.at[k] = scale * (c->d[j] - v_dot(c->n[j], c->x[k]));
  return f;
}

static double value(const linear *f, corner p) {
  return f->at[0] * (1 - p.u - p.v) + f->at[1] * p.u + f->at[2] * p.v;
}

// Crossing of the side from p to q, where f has the values at_p and at_q of different sign.
static corner crossing(corner p, corner q, double at_p, double at_q) {
  double s = at_p / (at_p - at_q);
  return (corner){p.u + s * (q.u - p.u), p.v + s * (q.v - p.v)};
}

// Keeps the part of the polygon where f <= 0: at most count + 1 corners.
static uint32_t clip_polygon(const corner *in, uint32_t count, const linear *f, corner *out) {
  SONDE_ASSERT(in != out && count > 0 && count < MAX_CORNERS);
  double at[MAX_CORNERS];
  uint32_t kept = 0, changes = 0;
  for (uint32_t k = 0; k < count; ++k) at[k] = value(f, in[k]);
  for (uint32_t k = 0; k < count; ++k)
    changes += (at[k] > 0) != (at[k + 1 < count ? k + 1 : 0] > 0);
  if (changes <= 2) {
    for (uint32_t k = 0; k < count; ++k) {
      uint32_t next = k + 1 < count ? k + 1 : 0;
      if (at[k] <= 0) out[kept++] = in[k];
      if ((at[k] < 0 && at[next] > 0) || (at[k] > 0 && at[next] < 0))
        out[kept++] = crossing(in[k], in[next], at[k], at[next]);
    }
    SONDE_ASSERT(kept <= count + 1);
    return kept;
  }

  // The polygon is so thin that rounding makes f change its sign more than twice around it: only
  // the run of corners with f <= 0 around the lowest one stays.
  uint32_t first = 0;
  for (uint32_t k = 1; k < count; ++k)
    if (at[k] < at[first]) first = k;
  for (uint32_t steps = 1; steps < count; ++steps) {
    uint32_t before = first ? first - 1 : count - 1;
    if (at[before] > 0) break;
    first = before;
  }
  uint32_t before = first ? first - 1 : count - 1;
  if (at[before] > 0 && at[first] < 0)
    out[kept++] = crossing(in[before], in[first], at[before], at[first]);
  for (uint32_t k = first; kept <= count && at[k] <= 0;) {
    uint32_t next = k + 1 < count ? k + 1 : 0;
    out[kept++] = in[k];
    if (at[k] < 0 && at[next] > 0) out[kept++] = crossing(in[k], in[next], at[k], at[next]);
    k = next;
  }
  SONDE_ASSERT(kept <= count + 1);
  return kept;
}

// ---- column ends --------------------------------------------------------------------------

typedef struct columns {
  uint32_t count;
  linear length[MAX_FAR]; // of the column, if this plane were the only one
} columns;

// Collects the planes whose column is somewhere shorter than the least of all longest columns:
// the others end nowhere first. Drops what a later, lower bound has made superfluous when full.
static void find_far_planes(const contact *c, const corner *polygon, uint32_t count, columns *far) {
  SONDE_ASSERT(count >= 3);
  double least[MAX_FAR], bound = INFINITY;
  far->count = 0;
  for (uint32_t j = 0; j < c->planes; ++j) {
    // No column in the ball ends sooner at this plane than one of the bound's length.
    double along = v_dot(c->n[j], c->direction);
    if (along <= 1e-9 || centre_depth(c, j) - c->radius >= bound * along) continue;

    // shortest and longest column that this plane would end
    linear t = below_plane(c, j, 1 / along);
    double low = value(&t, polygon[0]), high = low;
    for (uint32_t k = 1; k < count; ++k) {
      double length = value(&t, polygon[k]);
      low = length < low ? length : low;
      high = length > high ? length : high;
    }
    if (low >= bound) continue;
    bound = high < bound ? high : bound;

    if (far->count == MAX_FAR) {
      uint32_t kept = 0;
      for (uint32_t k = 0; k < MAX_FAR; ++k) {
        if (least[k] > bound) continue;
        least[kept] = least[k];
        far->length[kept++] = far->length[k];
      }
      far->count = kept;
    }
    if (far->count == MAX_FAR) continue;
    least[far->count] = low;
    far->length[far->count++] = t;
  }
  uint32_t kept = 0;
  for (uint32_t k = 0; k < far->count; ++k)
    if (least[k] <= bound) far->length[kept++] = far->length[k];
  far->count = kept;
}

// ---- pieces -------------------------------------------------------------------------------

// Polygons of the pieces still to be done, one behind the other.
typedef struct pieces {
  corner corners[ARENA_CORNERS];
  uint32_t used, count;
  uint32_t size[MAX_PIECES], plane[MAX_PIECES];
} pieces;

// Integrals over the triangle as means: its area counts as 1.
typedef struct integrals {
  double phi[3], t_phi[3], area, deepest;
} integrals;

// Replaces the top piece by the part where `lower` is not below its plane and, on top of it, the
// part where it is. False when there is no room.
static bool split_top(pieces *stack, const columns *far, uint32_t lower) {
  uint32_t top = stack->count - 1, size = stack->size[top], plane = stack->plane[top];
  corner *base = stack->corners + stack->used - size;
  if (stack->count == MAX_PIECES || size + 2 > MAX_CORNERS) return false;
  if (stack->used + size + 2 > ARENA_CORNERS) return false;
  linear more, less;
  for (int k = 0; k < 3; ++k) {
    less.at[k] = far->length[lower].at[k] - far->length[plane].at[k];
    more.at[k] = -less.at[k];
  }
  corner old[MAX_CORNERS];
  for (uint32_t k = 0; k < size; ++k) old[k] = base[k];
  uint32_t above = clip_polygon(old, size, &more, base);
  if (above < 3) above = 0;
  uint32_t below = clip_polygon(old, size, &less, base + above);
  if (above) {
    stack->size[top] = above;
    stack->count++;
  }
  stack->size[stack->count - 1] = below;
  stack->plane[stack->count - 1] = lower;
  stack->used += above + below - size;
  return true;
}

// Splits the polygon into pieces with one lowest plane each and integrates over every piece.
static void integrate_pieces(const columns *far, const corner *polygon, uint32_t count,
                             integrals *sum) {
  SONDE_ASSERT(far->count > 0 && count >= 3);
  pieces stack;
  double slack = 0;
  for (uint32_t k = 0; k < count; ++k) {
    stack.corners[k] = polygon[k];
    slack = fmax(slack, 1e-12 * fabs(value(&far->length[0], polygon[k])));
  }
  stack.used = stack.size[0] = count;
  stack.plane[0] = 0;
  stack.count = 1;
  uint32_t splits = 0;
  while (stack.count) {
    // Where two planes are equal within rounding, each may look lower than the other for ever.
    uint32_t top = stack.count - 1, size = stack.size[top], plane = stack.plane[top];
    const corner *piece = stack.corners + stack.used - size;
    SONDE_ASSERT(plane < far->count && size <= MAX_CORNERS);
    uint32_t lower = plane; // lies lowest below `plane` at a corner
    double deepest = slack;
    double present[MAX_CORNERS];
    for (uint32_t k = 0; k < size; ++k) present[k] = value(&far->length[plane], piece[k]);
    for (uint32_t j = 0; j < far->count; ++j)
      for (uint32_t k = 0; k < size; ++k) {
        double below = present[k] - value(&far->length[j], piece[k]);
        if (below > deepest) {
          deepest = below;
          lower = j;
        }
      }
    if (lower != plane && splits++ < MAX_SPLITS && split_top(&stack, far, lower)) continue;

    const linear *t = &far->length[plane];
    for (uint32_t k = 0; k < size; ++k) {
      double length = value(t, piece[k]);
      sum->deepest = length > sum->deepest ? length : sum->deepest;
    }
    // t times a shape function is quadratic on a piece: the rule of the three edge middles is exact
    // on each triangle of its fan. The weight is twice a triangle's area in barycentric
    // coordinates, so that the whole skin triangle weighs 1.
    for (uint32_t k = 2; k < size; ++k) {
      const corner p[3] = {piece[0], piece[k - 1], piece[k]};
      double weight = (p[1].u - p[0].u) * (p[2].v - p[0].v) - (p[1].v - p[0].v) * (p[2].u - p[0].u);
      double third = weight / 3;
      for (int side = 0; side < 3; ++side) {
        corner q = p[(side + 1) % 3];
        corner middle = {0.5 * (p[side].u + q.u), 0.5 * (p[side].v + q.v)};
        double length = third * value(t, middle), rest = 1 - middle.u - middle.v;
        sum->phi[0] += third * rest;
        sum->phi[1] += third * middle.u;
        sum->phi[2] += third * middle.v;
        sum->t_phi[0] += length * rest;
        sum->t_phi[1] += length * middle.u;
        sum->t_phi[2] += length * middle.v;
      }
      sum->area += weight;
    }
    stack.used -= size;
    stack.count--;
  }
}

bool sonde_clip_triangle(const sonde_vec3 *planes_n, const double *planes_d, uint32_t plane_count,
                         const sonde_vec3 corners[3], sonde_vec3 direction,
                         sonde_clip_result *result) {
  *result = (sonde_clip_result){0};

  // ball around the triangle, a little larger than it has to be, to be safe from rounding
  sonde_vec3 centre = v_scale(v_add(corners[0], v_add(corners[1], corners[2])), 1.0 / 3.0);
  double radius2 = 0;
  for (int k = 0; k < 3; ++k) radius2 = fmax(radius2, v_norm2(v_sub(corners[k], centre)));
  contact c = {
      planes_n, planes_d, plane_count, corners, direction, centre, 1.000001 * sqrt(radius2)};

  // polygon of the part of the triangle inside all planes
  corner one[MAX_CORNERS], two[MAX_CORNERS];
  one[0] = (corner){0, 0};
  one[1] = (corner){1, 0};
  one[2] = (corner){0, 1};
  corner *polygon = one, *other = two;
  uint32_t count = 3;
  for (uint32_t j = 0; j < plane_count; ++j) {
    if (centre_depth(&c, j) >= c.radius) continue;
    linear f = below_plane(&c, j, -1);
    if (f.at[0] <= 0 && f.at[1] <= 0 && f.at[2] <= 0) continue;
    if (f.at[0] >= 0 && f.at[1] >= 0 && f.at[2] >= 0) return false;
    if (count + 1 >= MAX_CORNERS) continue;
    count = clip_polygon(polygon, count, &f, other);
    if (count < 3) return false;
    corner *swap = polygon;
    polygon = other;
    other = swap;
  }
  SONDE_ASSERT(count <= MAX_CORNERS);

  // lengths of the columns from the polygon to the far side of the body
  columns far;
  find_far_planes(&c, polygon, count, &far);
  if (!far.count) return false;
  integrals sum = {0};
  integrate_pieces(&far, polygon, count, &sum);
  if (!(sum.area > 0)) return false;

  // volume, its share per corner and its gradient
  sonde_vec3 area =
      v_scale(v_cross(v_sub(corners[1], corners[0]), v_sub(corners[2], corners[0])), 0.5);
  double facing = -v_dot(area, direction);
  for (int k = 0; k < 3; ++k) {
    result->share_m3[k] = facing * sum.t_phi[k];
    result->gradient[k] = v_scale(area, sum.phi[k]);
    result->volume_m3 += result->share_m3[k];
  }
  result->area_m2 = v_norm(area) * sum.area;
  result->depth_max_m = sum.deepest;
  return true;
}
