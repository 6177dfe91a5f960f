// The contact of 16 faces or nodes at a time (docs/world.md); part of lanes_kernel.c. Places count
// from the probe's origin, which single precision resolves to some nanometres.
// seen:          a slice's nodes from the probe, where they are evaluated or go.
// beyond, locate, hand_on: what the faces read.
// to_points, to_corners: from the corners of a face to its four points, and back.
// least_depth:   the plane of the least weighted distance of points inside the probe.
// push_at:       pushes of points inside; never a pull.
// press_faces, press_nodes: where the nodes are evaluated, and their part of the matrix.
// meet_faces, meet_nodes:   where the solution brings them.
// carry:         the ties' part of a product, for the solver.
#include "world/lanes_vector.h"

#include "base/base.h"

// Of points: place, and velocity against the probe.
typedef struct seen_point {
  sonde_lane x[3], v[3];
} seen_point;

INLINE void add_carried(const sonde_lane_probe *probe, const sonde_lane x[3], sonde_lane v[3]) {
  const float *w = probe->spin;
  for (int c = 0; c < 3; ++c) {
    int i = (c + 1) % 3, j = (c + 2) % 3;
    v[c] -= w[i] * x[j] - w[j] * x[i];
  }
}

// `moved`: with the solution.
INLINE seen_point seen(const sonde_lanes *lanes, uint32_t s, bool moved) {
  const sonde_lane_probe *probe = &lanes->probe;
  const sonde_slice_model *fixed = &lanes->model[s];
  const sonde_slice *at = &lanes->slice[s];
  float h = lanes->law.dt;
  seen_point p;
  for (int c = 0; c < 3; ++c) {
    sonde_lane v = moved ? at->ve[c] + at->x[c] : at->ve[c];
    sonde_lane small = (fixed->place_low[c] - probe->origin_low[c]) + (at->u[c] + h * v);
    p.x[c] = (fixed->place[c] - probe->origin[c]) + small;
    p.v[c] = v - probe->velocity[c];
  }
  add_carried(probe, p.x, p.v);
  return p;
}

// Planes that all of a slice's nodes are beyond, by more than points between them are rounded.
INLINE uint32_t beyond(const sonde_lane_probe *probe, const seen_point *p) {
  const float rounded = 1e-6f;
  uint32_t code = 0, count = probe->plane_count < 32 ? probe->plane_count : 32;
  for (uint32_t k = 0; k < count; ++k) {
    const float *n = probe->plane[k];
    sonde_lane t = n[3] - (n[0] * p->x[0] + n[1] * p->x[1] + n[2] * p->x[2]);
    code |= (uint32_t)(bits(t < -rounded) == 0xffff) << k;
  }
  return code;
}

static void locate(sonde_lanes *lanes) {
  SONDE_ASSERT(lanes->near_probe_count <= lanes->slice_count);
  for (uint32_t k = 0; k < lanes->near_probe_count; ++k) {
    size_t first = (size_t)lanes->near_probe[k] * SONDE_LANES * SONDE_QUAD;
    seen_point p = seen(lanes, lanes->near_probe[k], false);
    const sonde_lane x[4] = {p.x[0], p.x[1], p.x[2], all(1)}, v[4] = {p.v[0], p.v[1], p.v[2], {0}};
    write_records(lanes->probe_place + first, SONDE_QUAD, x);
    write_records(lanes->probe_motion + first, SONDE_QUAD, v);
    lanes->near_code[k] = beyond(&lanes->probe, &p);
  }
}

static void hand_on(sonde_lanes *lanes) {
  for (uint32_t k = 0; k < lanes->near_probe_count; ++k) {
    size_t first = (size_t)lanes->near_probe[k] * SONDE_LANES * SONDE_QUAD;
    const sonde_lane *x = lanes->slice[lanes->near_probe[k]].x;
    const sonde_lane way[4] = {x[0], x[1], x[2], {0}};
    write_records(lanes->probe_way + first, SONDE_QUAD, way);
  }
}

// The points are the centres of a face's four congruent parts: the middle one, and one towards each
// corner, 2/3 of its own and 1/6 of the two others.
INLINE void to_points(const sonde_lane corner[3], sonde_lane point[SONDE_FACE_POINTS]) {
  sonde_lane sixth = (corner[0] + corner[1] + corner[2]) * (1.0f / 6);
  point[0] = sixth + sixth;
  for (int k = 0; k < 3; ++k) point[1 + k] = sixth + 0.5f * corner[k];
}

INLINE void to_corners(const sonde_lane point[SONDE_FACE_POINTS], sonde_lane corner[3]) {
  sonde_lane sixth = (point[0] + point[0] + point[1] + point[2] + point[3]) * (1.0f / 6);
  for (int k = 0; k < 3; ++k) corner[k] = sixth + 0.5f * point[1 + k];
}

// The same for vectors, corners as records.
INLINE void vectors_at_points(const float *records, const sonde_lane_index node[3],
                              sonde_lane point[SONDE_FACE_POINTS][3], sonde_lane last[3]) {
  sonde_lane read[3][4];
  for (int k = 0; k < 3; ++k) read_quads(records, &node[k], read[k]), last[k] = read[k][3];
  for (int c = 0; c < 3; ++c) {
    const sonde_lane corner[3] = {read[0][c], read[1][c], read[2][c]};
    sonde_lane at[SONDE_FACE_POINTS];
    to_points(corner, at);
    for (int q = 0; q < SONDE_FACE_POINTS; ++q) point[q][c] = at[q];
  }
}

INLINE void vectors_to_corners(const sonde_lane point[SONDE_FACE_POINTS][3],
                               sonde_lane corner[3][3]) {
  for (int c = 0; c < 3; ++c) {
    const sonde_lane at[SONDE_FACE_POINTS] = {point[0][c], point[1][c], point[2][c], point[3][c]};
    sonde_lane to[3];
    to_corners(at, to);
    for (int k = 0; k < 3; ++k) corner[k][c] = to[k];
  }
}

// Of `count` points per lane: how deep they are, along which slope, by how much the slope is
// scaled.
typedef struct depths {
  sonde_lane_index inside[SONDE_FACE_POINTS], plane[SONDE_FACE_POINTS];
  sonde_lane depth[SONDE_FACE_POINTS], slope[SONDE_FACE_POINTS][3], unit[SONDE_FACE_POINTS];
} depths;

INLINE bool in_any(const sonde_lane_index inside[], int count) {
  sonde_lane_index any = inside[0];
  for (int q = 1; q < count; ++q) any |= inside[q];
  return bits(any) != 0;
}

// Where the nearest surface faces backwards the point counts as outside: skin gets there only when
// a narrow probe slips through between nodes, and a push from there would draw the probe deeper.
// inside[]: on entry the points that count.
INLINE bool least_depth(const sonde_lane_probe *probe, int count, const seen_point *points,
                        depths *to) {
  for (int q = 0; q < count; ++q) to->depth[q] = all(1e30f), to->plane[q] = (sonde_lane_index){0};
  for (uint32_t k = 0; k < probe->plane_count; ++k) {
    const float *n = probe->plane[k];
    for (int q = 0; q < count; ++q) {
      const sonde_lane *x = points[q].x;
      sonde_lane t = n[3] - (n[0] * x[0] + n[1] * x[1] + n[2] * x[2]);
      sonde_lane_index closer = t < to->depth[q];
      to->inside[q] &= t > 0;
      to->depth[q] = pick(closer, t, to->depth[q]);
      to->plane[q] = (closer & (int32_t)k) | (~closer & to->plane[q]);
    }
    if (!in_any(to->inside, count)) return false;
  }
  for (int q = 0; q < count; ++q) {
    sonde_lane slope[4];
    read_quads(&probe->slope[0][0], &to->plane[q], slope);
    for (int c = 0; c < 3; ++c) to->slope[q][c] = slope[c];
    to->unit[q] = slope[3];
    to->inside[q] &= slope[3] > 0;
    to->depth[q] = pick(to->inside[q], to->depth[q], all(0));
  }
  return in_any(to->inside, count);
}

INLINE bool ball_depth(const sonde_lane_probe *probe, const seen_point *point, depths *to) {
  sonde_lane d[3];
  for (int c = 0; c < 3; ++c) d[c] = probe->centre[c] - point->x[c];
  sonde_lane d2 = dot(d, d), safe = larger(d2, all(1e-12f)), inverse = inverse_root(safe);
  inverse = inverse * (1.5f - 0.5f * safe * inverse * inverse);
  sonde_lane short_of = probe->radius * probe->radius - d2, forward = all(0);
  for (int c = 0; c < 3; ++c) {
    to->slope[0][c] = d[c] * inverse;
    forward += to->slope[0][c] * probe->inward[c];
  }
  to->unit[0] = all(1);
  to->inside[0] &= (short_of > 0) & (forward <= 1e-9f);
  to->plane[0] = (sonde_lane_index){0};
  sonde_lane depth = short_of / (probe->radius + safe * inverse);
  to->depth[0] = pick(to->inside[0], depth, all(0));
  return in_any(to->inside, 1);
}

INLINE bool node_depth(const sonde_lane_probe *probe, const seen_point *point, depths *to) {
  to->inside[0] = (sonde_lane_index){0} == (sonde_lane_index){0};
  for (int c = 0; c < 3; ++c)
    to->inside[0] &= (point->x[c] >= probe->low[c]) & (point->x[c] <= probe->high[c]);
  if (!in_any(to->inside, 1)) return false;
  return probe->radius > 0 ? ball_depth(probe, point, to) : least_depth(probe, 1, point, to);
}

INLINE sonde_lane push_at(const sonde_lane_probe *probe, sonde_lane area, const depths *by, int q,
                          const seen_point *point) {
  sonde_lane rate = dot(by->slope[q], point->v);
  sonde_lane push = area * (probe->stiffness * by->depth[q] + probe->damping * rate);
  return pick(by->inside[q] & (push > 0), push, all(0));
}

// A point's part of the matrix along its slope.
INLINE sonde_lane steepness(const sonde_lanes *lanes, sonde_lane area, sonde_lane push) {
  const sonde_lane_law *law = &lanes->law;
  const sonde_lane_probe *probe = &lanes->probe;
  float scale = law->stiffness_scale * probe->stiffness + law->damping_scale * probe->damping;
  return pick(push > 0, scale * area, all(0));
}

INLINE void square(const sonde_lane n[3], sonde_lane scale, sonde_lane block[6]) {
  sonde_lane x = scale * n[0], y = scale * n[1];
  block[0] = x * n[0], block[1] = x * n[1], block[2] = x * n[2];
  block[3] = y * n[1], block[4] = y * n[2], block[5] = scale * n[2] * n[2];
}

// Couplings of the corners: the product of the weights of both at each point.
INLINE void tie_corners(const depths *by, const sonde_lane steep[SONDE_FACE_POINTS],
                        sonde_press_corners *to) {
  sonde_lane_index tied = {0}, alike = ~tied, plane = by->plane[0];
  for (int c = 0; c < 3; ++c) to->tie_slope[c] = by->slope[0][c];
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    sonde_lane_index on = steep[q] > 0, first = on & ~tied;
    tied |= on;
    plane = (first & by->plane[q]) | (~first & plane);
    alike &= ~on | (by->plane[q] == plane);
    for (int c = 0; c < 3; ++c) to->tie_slope[c] = pick(first, by->slope[q][c], to->tie_slope[c]);
  }
  for (int k = 0; k < 3; ++k) {
    sonde_lane both = steep[0] + steep[1 + k] + steep[1 + (k + 1) % 3];
    to->tie[k] = both * (1.0f / 9) + steep[1 + (k + 2) % 3] * (1.0f / 36);
  }
  to->tied = bits(tied);
  to->alike = bits(alike);
}

// The sums of the points' shares, gradients, pushes and blocks at the corners.
INLINE void press_points(const sonde_lanes *lanes, const seen_point *points, const depths *by,
                         sonde_pressed_slice *at, sonde_press_corners *to) {
  sonde_lane share[4], force[4][3], gradient[4][3], block[6][4], steep[4], square_of[6],
      count = {0};
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    at->push[q] = push_at(&lanes->probe, at->area, by, q, &points[q]);
    steep[q] = steepness(lanes, at->area, at->push[q]);
    share[q] = at->area * by->depth[q];
    sonde_lane outward = pick(by->inside[q], at->area * by->unit[q], all(0));
    count += pick(by->inside[q], at->area, all(0));
    for (int c = 0; c < 3; ++c) {
      at->slope[q][c] = by->slope[q][c];
      force[q][c] = -at->push[q] * by->slope[q][c];
      gradient[q][c] = outward * by->slope[q][c];
    }
    square(by->slope[q], steep[q], square_of);
    for (int c = 0; c < 6; ++c) block[c][q] = square_of[c];
  }
  to->area = count;
  to_corners(share, to->share);
  vectors_to_corners(gradient, to->gradient);
  vectors_to_corners(force, to->force);
  for (int c = 0; c < 6; ++c) {
    sonde_lane corner[3];
    to_corners(block[c], corner);
    for (int k = 0; k < 3; ++k) to->block[k][c] = corner[k];
  }
  tie_corners(by, steep, to);
}

static bool press_faces(const sonde_lanes *lanes, uint32_t index, sonde_pressed_slice *at,
                        sonde_press_corners *to) {
  const sonde_lane_index *node = lanes->face[index];
  sonde_lane x[4][3], v[4][3], near[3], unused[3];
  SONDE_ASSERT(index < lanes->face_slice_count);
  seen_point points[SONDE_FACE_POINTS];
  depths by;
  vectors_at_points(lanes->probe_place, node, x, near);
  at->area = lanes->point_area[index];
  sonde_lane_index counts = (near[0] * near[1] * near[2] * at->area) > 0;
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    by.inside[q] = counts;
    for (int c = 0; c < 3; ++c) points[q].x[c] = x[q][c];
  }
  if (!least_depth(&lanes->probe, SONDE_FACE_POINTS, points, &by)) return false;
  vectors_at_points(lanes->probe_motion, node, v, unused);
  for (int q = 0; q < SONDE_FACE_POINTS; ++q)
    for (int c = 0; c < 3; ++c) points[q].v[c] = v[q][c];
  press_points(lanes, points, &by, at, to);
  at->index = index;
  at->inside = bits(by.inside[0] | by.inside[1] | by.inside[2] | by.inside[3]);
  return true;
}

static bool press_nodes(const sonde_lanes *lanes, uint32_t index, sonde_pressed_slice *at,
                        sonde_press_corners *to) {
  seen_point point = seen(lanes, index, false);
  depths by;
  if (!node_depth(&lanes->probe, &point, &by)) return false;
  SONDE_ASSERT(index < lanes->slice_count);
  at->index = index;
  at->inside = bits(by.inside[0]);
  at->area = lanes->model[index].area;
  at->push[0] = push_at(&lanes->probe, at->area, &by, 0, &point);
  to->share[0] = at->area * by.depth[0];
  to->area = pick(by.inside[0], at->area, all(0));
  for (int c = 0; c < 3; ++c) {
    at->slope[0][c] = by.slope[0][c];
    to->gradient[0][c] = to->area * by.unit[0] * by.slope[0][c];
    to->force[0][c] = -at->push[0] * by.slope[0][c];
  }
  square(by.slope[0], steepness(lanes, at->area, at->push[0]), to->block[0]);
  return true;
}

// What a point's push is at the end of the step by the linear system.
INLINE sonde_lane push_after(const sonde_lanes *lanes, const sonde_pressed_slice *at, int q,
                             const sonde_lane way[3]) {
  const sonde_lane_probe *probe = &lanes->probe;
  float gain = lanes->law.dt * probe->stiffness + probe->damping;
  sonde_lane end = at->push[q] + gain * at->area * dot(at->slope[q], way);
  return pick((at->push[q] > 0) & (end > 0), end, all(0));
}

INLINE void go_on(const sonde_lanes *lanes, const sonde_lane way[3], seen_point *point) {
  sonde_lane step[3];
  for (int c = 0; c < 3; ++c) {
    step[c] = lanes->law.dt * way[c];
    point->x[c] += step[c];
    point->v[c] += way[c];
  }
  add_carried(&lanes->probe, step, point->v);
}

static void meet_faces(const sonde_lanes *lanes, const sonde_pressed_slice *at, bool surprise,
                       sonde_meet_corners *to) {
  const sonde_lane_index *node = lanes->face[at->index];
  sonde_lane way[4][3], force[4][3], x[4][3], v[4][3], unused[3];
  vectors_at_points(lanes->probe_way, node, way, unused);
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    sonde_lane end = push_after(lanes, at, q, way[q]);
    for (int c = 0; c < 3; ++c) force[q][c] = -end * at->slope[q][c];
  }
  vectors_to_corners(force, to->force);
  if (!surprise) return;
  seen_point points[SONDE_FACE_POINTS];
  depths by;
  vectors_at_points(lanes->probe_place, node, x, unused);
  vectors_at_points(lanes->probe_motion, node, v, unused);
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    by.inside[q] = at->area > 0;
    for (int c = 0; c < 3; ++c) points[q].x[c] = x[q][c], points[q].v[c] = v[q][c];
    go_on(lanes, way[q], &points[q]);
  }
  if (least_depth(&lanes->probe, SONDE_FACE_POINTS, points, &by))
    for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
      sonde_lane met = push_at(&lanes->probe, at->area, &by, q, &points[q]);
      for (int c = 0; c < 3; ++c) force[q][c] += met * by.slope[q][c];
    }
  vectors_to_corners(force, to->surprise);
}

static void meet_nodes(const sonde_lanes *lanes, const sonde_pressed_slice *at, bool surprise,
                       sonde_meet_corners *to) {
  const sonde_lane *way = lanes->slice[at->index].x;
  sonde_lane end = push_after(lanes, at, 0, way);
  for (int c = 0; c < 3; ++c) to->force[0][c] = to->surprise[0][c] = -end * at->slope[0][c];
  if (!surprise) return;
  seen_point point = seen(lanes, at->index, true);
  depths by;
  if (!node_depth(&lanes->probe, &point, &by)) return;
  sonde_lane met = push_at(&lanes->probe, at->area, &by, 0, &point);
  for (int c = 0; c < 3; ++c) to->surprise[0][c] += met * by.slope[0][c];
}

// What a group of ties makes of vectors, corner by corner: with ties in the system the diagonal
// blocks have the corners' own part.
INLINE void carry_ties(const sonde_press_ties *tie, const float *vectors, bool tied,
                       sonde_quad pushes[3][SONDE_LANES]) {
  sonde_lane along[3];
  for (int c = 0; c < 3; ++c) {
    sonde_lane z[4];
    read_quads(vectors, &tie->row[c], z);
    along[c] = dot(tie->slope, z);
  }
  for (int c = 0; c < 3; ++c) {
    int i = (c + 1) % 3, j = (c + 2) % 3;
    sonde_lane own = tied ? all(0) : along[c];
    sonde_lane push = tie->tie[c] * (own - along[i]) + tie->tie[j] * (own - along[j]);
    const sonde_lane out[4] = {
        push * tie->slope[0], push * tie->slope[1], push * tie->slope[2], {0}};
    write_records((float *)pushes[c], SONDE_QUAD, out);
  }
}

static void carry(sonde_lanes *lanes, const float *vectors) {
  sonde_quad pushes[3][SONDE_LANES];
  for (uint32_t k = 0; k < lanes->press_count; ++k)
    for (int l = 0; l < SONDE_LANES; ++l) lanes->press[k].carry[l] = (sonde_quad){0};
  for (uint32_t k = 0; k < lanes->tie_count; ++k) {
    const sonde_press_ties *tie = &lanes->tie[k / SONDE_LANES];
    uint32_t l = k % SONDE_LANES;
    if (l == 0) carry_ties(tie, vectors, lanes->tied, pushes);
    for (uint32_t c = 0; c < 3; ++c) {
      uint32_t row = (uint32_t)tie->row[c][l], at = lanes->press_of[row / SONDE_LANES];
      SONDE_ASSERT(at > 0);
      lanes->press[at - 1].carry[row % SONDE_LANES] += pushes[c][l];
    }
  }
}
