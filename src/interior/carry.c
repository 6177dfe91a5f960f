// Tissue around the vessels: what the solid knows nothing of.
//
// sonde_interior_displacement  field and vessels; zero outside and in bone
// sonde_interior_displacements the same for many points
// sonde_interior_rest_point    inverse: exact in a lumen, iterated elsewhere
// sonde_vessels_move           the same from a known field and the vessels' states
// pull                         where one vessel wants a point, and how firmly
// combine, combine_two         several vessels: each is exact on its own wall
#include "base/base.h"
#include "interior/interior.h"

static const double reach = 3.0; // rest radii over which a wall's motion fades

typedef struct pulled {
  double weight;
  sonde_vec3 move;
} pulled;

// Offsets in the cross-section go to the ellipse (and its area-preserving surroundings); the motion
// along the vessel stays the field's.
static pulled pull(const sonde_vessel_state *v, sonde_vec3 rest, sonde_vec3 field) {
  pulled none = {0, field};
  sonde_vec3 d = v_sub(rest, v->rest_centre_m), across = v_cross(v->axis, v->flat_axis);
  double a = v_dot(d, v->flat_axis), b = v_dot(d, across), a1 = a, b1 = b;
  double t = (sqrt(a * a + b * b) / v->rest_radius_m - 1) / reach;
  double engaged = clamp(fabs(1 - v->area_ratio) / sonde_engaged_loss, 0, 1);
  if (t >= 1 || !(engaged > 0)) return none;
  t = fmax(t, 0);
  sonde_vessel_carry(v, &a1, &b1);
  sonde_vec3 move = v_sub(v->centre_m, v->rest_centre_m);
  move = v_madd(v_madd(move, a1 - a, v->flat_axis), b1 - b, across);
  move = v_madd(move, v_dot(v_sub(field, move), v->axis), v->axis);
  return (pulled){engaged * (1 - t) * (1 - t) * (1 + 2 * t), move};
}

static sonde_vec3 combine_two(sonde_vec3 field, pulled a, pulled b) {
  double both = 1 - a.weight * b.weight;
  if (!(both > 1e-9)) return a.move;
  double wa = a.weight * (1 - b.weight) / both, wb = b.weight * (1 - a.weight) / both;
  sonde_vec3 u = v_madd(field, wa, v_sub(a.move, field));
  return v_madd(u, wb, v_sub(b.move, field));
}

// Weights w_k prod (1 - w_j), j not k, over their sum with prod (1 - w_j): for two vessels the same
// as above.
static sonde_vec3 combine(sonde_vec3 field, const pulled *p, uint32_t count) {
  double sum = 1, share[SONDE_VESSELS];
  for (uint32_t k = 0; k < count; ++k) sum *= 1 - p[k].weight;
  for (uint32_t k = 0; k < count; ++k) {
    share[k] = p[k].weight;
    for (uint32_t j = 0; j < count; ++j)
      if (j != k) share[k] *= 1 - p[j].weight;
    sum += share[k];
  }
  sonde_vec3 u = field;
  if (!(sum > 1e-9)) return p[0].move;
  for (uint32_t k = 0; k < count; ++k) u = v_madd(u, share[k] / sum, v_sub(p[k].move, field));
  return u;
}

sonde_vec3 sonde_vessels_move(const sonde_vessel_state *near, uint32_t count, sonde_vec3 rest,
                              sonde_vec3 field) {
  SONDE_ASSERT(count <= SONDE_VESSELS);
  pulled p[SONDE_VESSELS + 2];
  uint32_t kept = 0;
  for (uint32_t k = 0; k < count; ++k) {
    p[kept] = pull(&near[k], rest, field);
    if (p[kept].weight > 0) ++kept;
  }
  if (kept > 2) return combine(field, p, kept);
  for (uint32_t k = kept; k < 2; ++k) p[k] = (pulled){0, field};
  return combine_two(field, p[0], p[1]);
}

static sonde_vec3 displace(const sonde_interior *in, sonde_vec3 rest, double s) {
  sonde_vessel_state near[SONDE_VESSELS];
  uint32_t count = 0;
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    if (which < 2 || sonde_vessel_reaches(in, which, s, rest, 0))
      count += sonde_vessel_at(in, which, s, &near[count]);
  return sonde_vessels_move(near, count, rest, sonde_interior_field(in, rest));
}

sonde_vec3 sonde_interior_displacement(const sonde_interior *in, sonde_vec3 rest) {
  SONDE_ASSERT(in != NULL);
  sonde_column_point at;
  if (!in->ready || !sonde_interior_locate(in, rest, &at)) return vec3(0, 0, 0);
  if (at.depth_m < 0 || at.r <= in->bone_radius_m) return vec3(0, 0, 0);
  return displace(in, rest, at.s);
}

void sonde_interior_displacements(const sonde_interior *in, uint32_t count, const sonde_vec3 *rest,
                                  sonde_vec3 *out) {
  SONDE_ASSERT(in != NULL && (count == 0 || (rest != NULL && out != NULL)));
  for (uint32_t i = 0; i < count; ++i) out[i] = sonde_interior_displacement(in, rest[i]);
}

// The rest point when `point` lies in the lumen of the vessel, whose map is known both ways.
static bool within_lumen(const sonde_interior *in, uint32_t which, sonde_vec3 point, double s,
                         sonde_vec3 *rest) {
  sonde_vessel_state v;
  if (!sonde_vessel_at(in, which, s, &v) || fabs(1 - v.area_ratio) < sonde_engaged_loss)
    return false;
  sonde_vec3 d = v_sub(point, v.centre_m), across = v_cross(v.axis, v.flat_axis);
  double a = v_dot(d, v.flat_axis) / v.half_short_m, b = v_dot(d, across) / v.half_long_m;
  if (a * a + b * b > 1) return false;
  *rest = v_madd(v_madd(v.rest_centre_m, a * v.rest_radius_m, v.flat_axis), b * v.rest_radius_m,
                 across);
  *rest = v_madd(*rest, v_dot(d, v.axis), v.axis);
  return true;
}

// Fixed point q <- q - (q + u(q) - p); a step that does not shrink the mismatch is halved.
static sonde_vec3 invert(const sonde_interior *in, sonde_vec3 point, sonde_vec3 guess) {
  sonde_vec3 q = guess, best = guess;
  double damping = 1, least = INFINITY;
  for (int i = 0; i < 60; ++i) {
    sonde_column_point at;
    (void)sonde_interior_locate(in, q, &at);
    sonde_vec3 miss = v_sub(v_add(q, displace(in, q, at.s)), point);
    double size = v_norm(miss);
    if (size < least)
      least = size, best = q;
    else
      damping *= 0.5;
    if (size < 1e-7) break;
    q = v_madd(q, -damping, miss);
  }
  return best;
}

sonde_vec3 sonde_interior_rest_point(const sonde_interior *in, sonde_vec3 point) {
  SONDE_ASSERT(in != NULL);
  if (!in->ready) return point;
  sonde_column_point at;
  sonde_vec3 bare = sonde_interior_invert(in, point, point, 40, NULL), rest;
  (void)sonde_interior_locate(in, bare, &at);
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    if (within_lumen(in, which, point, at.s, &rest)) return rest;
  rest = invert(in, point, bare);
  bool within = sonde_interior_locate(in, rest, &at);
  return within && at.depth_m >= -1e-6 ? rest : point;
}
