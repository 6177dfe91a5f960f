// Displacement of the tissue around the vessels: a rest point is warped to where the walls near it
// leave room, moved by the field, and the field's bends are smoothed at the walls
// (docs/interior_theory.md). The inverse is exact in a lumen and iterated elsewhere.
#include "base/base.h"
#include "interior/vessels.h"

static const double least_share = 1e-9;
static const double probing_m = 1e-6, longest_m = 4e-3; // of a step of Newton's
static const double least_volume = 1e-3;                // of the derivative
static const double good_enough_m = 1e-6;               // of an inverse

// A wall in whose reach a point lies.
typedef struct near_wall {
  const sonde_vessel_state *vessel;
  sonde_vec3 across; // axis of the cross-section beside the flat one
  double a, b;       // of the point at rest along both axes from the vessel's centre, m
  double weight;     // 1 on the wall, 0 beyond its reach
  double share; // 1 on the wall, 0 on another; o beyond its reach, o the product of 1 - w of the
                // others
} near_wall;

// The walls that reach a rest point, and what each counts there.
static uint32_t find_walls(const sonde_vessel_state *near, uint32_t count, sonde_vec3 rest,
                           near_wall wall[SONDE_VESSELS]) {
  SONDE_ASSERT(count <= SONDE_VESSELS && (count == 0 || near != NULL));
  uint32_t kept = 0;
  for (uint32_t k = 0; k < count; ++k) {
    const sonde_vessel_state *v = &near[k];
    near_wall *w = &wall[kept];
    *w = (near_wall){.vessel = v, .across = v_cross(v->axis, v->flat_axis)};
    sonde_vec3 d = v_sub(rest, v->rest_centre_m);
    w->a = v_dot(d, v->flat_axis), w->b = v_dot(d, w->across);
    double t = fmax((sqrt(w->a * w->a + w->b * w->b) / v->rest_radius_m - 1) / sonde_wall_reach, 0);
    w->weight = v->coupling * (1 - t) * (1 - t) * (1 + 2 * t);
    kept += t < 1 && v->coupling > 0;
  }
  for (uint32_t k = 0; k < kept; ++k) {
    double others = 1;
    for (uint32_t j = 0; j < kept; ++j)
      if (j != k) others *= 1 - wall[j].weight;
    wall[k].share = others / fmax(others + (1 - wall[k].weight) * (1 - others), least_share);
  }
  return kept;
}

sonde_vec3 sonde_vessels_warp(const sonde_vessel_state *near, uint32_t count, sonde_vec3 rest) {
  near_wall wall[SONDE_VESSELS];
  uint32_t kept = find_walls(near, count, rest, wall);
  sonde_vec3 at = rest;
  for (const near_wall *w = wall; w < wall + kept; ++w) {
    const sonde_vessel_state *v = w->vessel;
    double x = w->a, y = w->b;
    sonde_vessel_warp(v, &x, &y);
    at = v_madd(at, w->share,
                v_madd(v_scale(v->flat_axis, v->coupling * (x - w->a)), v->coupling * (y - w->b),
                       w->across));
  }
  return at;
}

// The motion along a vessel stays the field's.
sonde_vec3 sonde_vessels_smooth(const sonde_vessel_state *near, uint32_t count, sonde_vec3 rest,
                                sonde_vec3 warped, sonde_vec3 moved) {
  near_wall wall[SONDE_VESSELS];
  uint32_t kept = find_walls(near, count, rest, wall);
  sonde_vec3 at = moved;
  for (const near_wall *w = wall; w < wall + kept; ++w) {
    const sonde_vessel_state *v = w->vessel;
    sonde_vec3 d = v_sub(warped, v->rest_centre_m), bend = v_sub(v->centre_m, moved);
    double a = v_dot(d, v->flat_axis), b = v_dot(d, w->across);
    sonde_vessel_tissue(v, &a, &b);
    bend = v_madd(v_madd(bend, a, v->flat_axis), b, w->across);
    bend = v_madd(bend, -v_dot(bend, v->axis), v->axis);
    at = v_madd(at, w->weight * w->share, v_scale(bend, v->tissue_smoothing));
  }
  return at;
}

uint32_t sonde_vessels_near(const sonde_interior *in, sonde_vec3 rest, double s,
                            sonde_vessel_state near[SONDE_VESSELS]) {
  uint32_t count = 0;
  for (uint32_t which = 0; which < 2; ++which) count += sonde_vessel_at(in, which, s, &near[count]);
  for (uint64_t left = sonde_vessels_reaching(in, rest, s); left != 0; left &= left - 1) {
    const uint32_t which = 2 + (uint32_t)__builtin_ctzll(left);
    const double along = sonde_vessel_along(in, which, rest, s);
    if (sonde_vessel_reaches(in, which, along, rest, 0))
      count += sonde_vessel_at(in, which, along, &near[count]);
  }
  return count;
}

sonde_wall_steps sonde_vessels_trace(const sonde_interior *in, const sonde_vessel_state *near,
                                     uint32_t count, sonde_vec3 rest) {
  sonde_wall_steps c = {.warped_m = sonde_vessels_warp(near, count, rest)};
  c.moved_m = v_add(c.warped_m, sonde_interior_field(in, c.warped_m));
  c.smoothed_m = sonde_vessels_smooth(near, count, rest, c.warped_m, c.moved_m);
  return c;
}

sonde_vec3 sonde_vessels_displace(const sonde_interior *in, sonde_vec3 rest, double s) {
  sonde_vessel_state near[SONDE_VESSELS];
  uint32_t count = sonde_vessels_near(in, rest, s, near);
  return v_sub(sonde_vessels_trace(in, near, count, rest).smoothed_m, rest);
}

sonde_vec3 sonde_interior_displacement(const sonde_interior *in, sonde_vec3 rest) {
  SONDE_ASSERT(in != NULL);
  sonde_column_point at;
  if (!in->ready || !sonde_interior_locate(in, rest, &at)) return vec3(0, 0, 0);
  if (at.depth_m < 0 || sonde_interior_in_bone(in, rest, &at)) return vec3(0, 0, 0);
  return sonde_vessels_displace(in, rest, at.s);
}

void sonde_interior_displacements(const sonde_interior *in, uint32_t count, const sonde_vec3 *rest,
                                  sonde_vec3 *out) {
  SONDE_ASSERT(in != NULL && (count == 0 || (rest != NULL && out != NULL)));
  for (uint32_t i = 0; i < count; ++i) out[i] = sonde_interior_displacement(in, rest[i]);
}

static sonde_vec3 miss_at(const sonde_interior *in, sonde_vec3 rest, sonde_vec3 point) {
  sonde_column_point at;
  (void)sonde_interior_locate(in, rest, &at);
  return v_sub(v_add(rest, sonde_vessels_displace(in, rest, at.s)), point);
}

// Newton's steps, halved until they shrink the miss; where none does, or the map's derivative is no
// use, a part of the miss. Returns what is left of it.
static double invert(const sonde_interior *in, sonde_vec3 point, sonde_vec3 *rest) {
  sonde_vec3 q = *rest, miss = miss_at(in, q, point);
  double size = v_norm(miss);
  for (int i = 0; i < 40 && size > 1e-7; ++i) {
    sonde_vec3 slope[3], step = v_neg(miss);
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 probe =
          vec3(k == 0 ? probing_m : 0, k == 1 ? probing_m : 0, k == 2 ? probing_m : 0);
      slope[k] = v_scale(v_sub(miss_at(in, v_add(q, probe), point), miss), 1 / probing_m);
    }
    sonde_vec3 cross = v_cross(slope[1], slope[2]);
    double volume = v_dot(slope[0], cross);
    if (volume > least_volume)
      step = v_scale(vec3(v_dot(miss, cross), v_dot(miss, v_cross(slope[2], slope[0])),
                          v_dot(miss, v_cross(slope[0], slope[1]))),
                     -1 / volume);
    double share = fmin(1, longest_m / fmax(v_norm(step), 1e-12));
    sonde_vec3 next = q, left = miss;
    for (int half = 0; half < 8; ++half, share *= 0.5) {
      next = v_madd(q, share, step), left = miss_at(in, next, point);
      if (v_norm(left) < size) break;
    }
    if (!(v_norm(left) < size)) break;
    q = next, miss = left, size = v_norm(left);
  }
  *rest = q;
  return size;
}

sonde_vec3 sonde_interior_rest_point(const sonde_interior *in, sonde_vec3 point) {
  SONDE_ASSERT(in != NULL);
  if (!in->ready) return point;
  sonde_column_point at;
  sonde_vec3 rest = sonde_interior_invert(in, point, point, 40, NULL);
  (void)sonde_interior_locate(in, rest, &at);
  // In a lumen the map across is known both ways; along the vessel the field moves the point.
  for (uint32_t which = 0; which < in->vessel_count; ++which) {
    sonde_vessel_state v;
    const double along = sonde_vessel_along(in, which, rest, at.s);
    if (!sonde_vessel_at(in, which, along, &v) || v.coupling < 1 || v.tissue_smoothing < 1)
      continue;
    sonde_vec3 d = v_sub(point, v.centre_m), across = v_cross(v.axis, v.flat_axis);
    double a = v_dot(d, v.flat_axis) / v.half_short_m, b = v_dot(d, across) / v.half_long_m;
    if (a * a + b * b > 1) continue;
    rest = v_madd(v_madd(v.rest_centre_m, a * v.rest_radius_m, v.flat_axis), b * v.rest_radius_m,
                  across);
    rest = v_madd(rest, v_dot(d, v.axis), v.axis);
    for (int i = 0; i < 6; ++i)
      rest = v_madd(rest, -v_dot(miss_at(in, rest, point), v.axis), v.axis);
    return rest;
  }
  double left = invert(in, point, &rest);
  // The map has one inverse, but Newton's way to it may be barred by a layer that is squeezed thin:
  // other starts are positions along the column that the tissue may have come from.
  enum { STARTS = 12 };
  (void)sonde_interior_locate(in, point, &at);
  sonde_vec3 out = v_add(v_scale(in->e1, cos(at.theta)), v_scale(in->e2, sin(at.theta)));
  for (int k = 0; k < STARTS && left > good_enough_m; ++k) {
    double r = at.bone_m + (at.radius_m - at.bone_m) * (k + 0.5) / STARTS;
    sonde_vec3 start = v_madd(point, r - at.r, out);
    double got = invert(in, point, &start);
    if (got < left) left = got, rest = start;
  }
  bool within = sonde_interior_locate(in, rest, &at);
  return within && at.depth_m >= -1e-6 ? rest : point;
}
