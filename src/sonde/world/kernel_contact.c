// The contact of a batch of faces or nodes at a time (docs/world.md); a part of kernel.c. Places
// count from the probe's origin, which single precision resolves to some nanometres.
#include "world/batches.h"

#include "base/base.h"

// Of points: place, and velocity against the probe.
typedef struct seen_point {
  reals x[3], v[3];
} seen_point;

INLINE void add_carried(const sonde_batch_probe *probe, const reals x[3], reals v[3]) {
  const real *w = probe->spin;
  for (int c = 0; c < 3; ++c) {
    int i = (c + 1) % 3, j = (c + 2) % 3;
    v[c] -= w[i] * x[j] - w[j] * x[i];
  }
}

// `moved`: with the solution.
INLINE seen_point seen(const sonde_batches *body, uint32_t s, bool moved) {
  const sonde_batch_probe *probe = &body->probe;
  const sonde_rows *rows = &body->rows[s];
  const sonde_batch *at = &body->batch[s];
  real reach = body->step.reach;
  seen_point p;
  for (int c = 0; c < 3; ++c) {
    reals v = moved ? at->ve[c] + at->x[c] : at->ve[c];
    reals small = (rows->place_low[c] - probe->origin_low[c]) + (at->u[c] + reach * v);
    p.x[c] = (rows->place[c] - probe->origin[c]) + small;
    p.v[c] = v - probe->velocity[c];
  }
  add_carried(probe, p.x, p.v);
  return p;
}

// Planes that all of a batch's nodes are beyond, by more than points between them are rounded.
INLINE uint32_t beyond(const sonde_batch_probe *probe, const seen_point *p) {
  const real rounded = (real)1e-6;
  uint32_t code = 0, count = probe->plane_count < 32 ? probe->plane_count : 32;
  for (uint32_t k = 0; k < count; ++k) {
    const real *n = probe->plane[k];
    reals t = n[3] - (n[0] * p->x[0] + n[1] * p->x[1] + n[2] * p->x[2]);
    code |= (uint32_t)(bits(t < -rounded) == (1u << SONDE_BATCH) - 1) << k;
  }
  return code;
}

static void locate(sonde_batches *body) {
  SONDE_ASSERT(body->near_probe_count <= body->common.batch_count);
  for (uint32_t k = 0; k < body->near_probe_count; ++k) {
    size_t first = (size_t)body->near_probe[k] * SONDE_BATCH * SONDE_QUAD;
    seen_point p = seen(body, body->near_probe[k], false);
    const reals x[4] = {p.x[0], p.x[1], p.x[2], all(1)}, v[4] = {p.v[0], p.v[1], p.v[2], {0}};
    write_records(body->probe_place + first, SONDE_QUAD, x);
    write_records(body->probe_motion + first, SONDE_QUAD, v);
    body->near_code[k] = beyond(&body->probe, &p);
  }
}

static void locate_moves(sonde_batches *body) {
  for (uint32_t k = 0; k < body->near_probe_count; ++k) {
    size_t first = (size_t)body->near_probe[k] * SONDE_BATCH * SONDE_QUAD;
    const reals *x = body->batch[body->near_probe[k]].x;
    const reals move[4] = {x[0], x[1], x[2], {0}};
    write_records(body->probe_move + first, SONDE_QUAD, move);
  }
}

// The points are the centres of a face's four congruent parts: the middle one, and one towards each
// corner, 2/3 of its own and 1/6 of the two others.
INLINE void to_points(const reals corner[3], reals point[SONDE_FACE_POINTS]) {
  reals sixth = (corner[0] + corner[1] + corner[2]) * ((real)1 / 6);
  point[0] = sixth + sixth;
  for (int k = 0; k < 3; ++k) point[1 + k] = sixth + (real)0.5 * corner[k];
}

INLINE void to_corners(const reals point[SONDE_FACE_POINTS], reals corner[3]) {
  reals sixth = (point[0] + point[0] + point[1] + point[2] + point[3]) * ((real)1 / 6);
  for (int k = 0; k < 3; ++k) corner[k] = sixth + (real)0.5 * point[1 + k];
}

// The same for vectors, corners as records.
INLINE void vectors_at_points(const real *records, const wholes node[3],
                              reals point[SONDE_FACE_POINTS][3], reals last[3]) {
  reals read[3][4];
  for (int k = 0; k < 3; ++k) read_quads(records, &node[k], read[k]), last[k] = read[k][3];
  for (int c = 0; c < 3; ++c) {
    const reals corner[3] = {read[0][c], read[1][c], read[2][c]};
    reals at[SONDE_FACE_POINTS];
    to_points(corner, at);
    for (int q = 0; q < SONDE_FACE_POINTS; ++q) point[q][c] = at[q];
  }
}

INLINE void vectors_to_corners(const reals point[SONDE_FACE_POINTS][3], reals corner[3][3]) {
  for (int c = 0; c < 3; ++c) {
    const reals at[SONDE_FACE_POINTS] = {point[0][c], point[1][c], point[2][c], point[3][c]};
    reals to[3];
    to_corners(at, to);
    for (int k = 0; k < 3; ++k) corner[k][c] = to[k];
  }
}

// Of `count` points per row: how deep they are, along which slope, by how much the slope is
// scaled.
typedef struct depths {
  wholes inside[SONDE_FACE_POINTS], plane[SONDE_FACE_POINTS];
  reals depth[SONDE_FACE_POINTS], slope[SONDE_FACE_POINTS][3], unit[SONDE_FACE_POINTS];
} depths;

INLINE bool in_any(const wholes inside[], int count) {
  wholes any = inside[0];
  for (int q = 1; q < count; ++q) any |= inside[q];
  return bits(any) != 0;
}

// Where the nearest surface faces backwards the point counts as outside: skin gets there only when
// a narrow probe slips through between nodes, and a push from there would draw the probe deeper.
// inside[]: on entry the points that count.
INLINE bool least_depth(const sonde_batch_probe *probe, int count, const seen_point *points,
                        depths *to) {
  for (int q = 0; q < count; ++q) to->depth[q] = all((real)1e30), to->plane[q] = (wholes){0};
  for (uint32_t k = 0; k < probe->plane_count; ++k) {
    const real *n = probe->plane[k];
    for (int q = 0; q < count; ++q) {
      const reals *x = points[q].x;
      reals t = n[3] - (n[0] * x[0] + n[1] * x[1] + n[2] * x[2]);
      wholes closer = t < to->depth[q];
      to->inside[q] &= t > 0;
      to->depth[q] = pick(closer, t, to->depth[q]);
      to->plane[q] = (closer & (whole)k) | (~closer & to->plane[q]);
    }
    if (!in_any(to->inside, count)) return false;
  }
  for (int q = 0; q < count; ++q) {
    reals slope[4];
    read_quads(&probe->slope[0][0], &to->plane[q], slope);
    for (int c = 0; c < 3; ++c) to->slope[q][c] = slope[c];
    to->unit[q] = slope[3];
    to->inside[q] &= slope[3] > 0;
    to->depth[q] = pick(to->inside[q], to->depth[q], all(0));
  }
  return in_any(to->inside, count);
}

INLINE bool ball_depth(const sonde_batch_probe *probe, const seen_point *point, depths *to) {
  reals d[3];
  for (int c = 0; c < 3; ++c) d[c] = probe->centre[c] - point->x[c];
  reals d2 = dot(d, d), safe = larger(d2, all((real)1e-12)), inverse;
  root_and_inverse(safe, &inverse);
  inverse = inverse * ((real)1.5 - (real)0.5 * safe * inverse * inverse);
  reals short_of = probe->radius * probe->radius - d2, forward = all(0);
  for (int c = 0; c < 3; ++c) {
    to->slope[0][c] = d[c] * inverse;
    forward += to->slope[0][c] * probe->inward[c];
  }
  to->unit[0] = all(1);
  to->inside[0] &= (short_of > 0) & (forward <= (real)1e-9);
  to->plane[0] = (wholes){0};
  reals depth = short_of / (probe->radius + safe * inverse);
  to->depth[0] = pick(to->inside[0], depth, all(0));
  return in_any(to->inside, 1);
}

INLINE bool node_depth(const sonde_batch_probe *probe, const seen_point *point, depths *to) {
  to->inside[0] = (wholes){0} == (wholes){0};
  for (int c = 0; c < 3; ++c)
    to->inside[0] &= (point->x[c] >= probe->low[c]) & (point->x[c] <= probe->high[c]);
  if (!in_any(to->inside, 1)) return false;
  return probe->radius > 0 ? ball_depth(probe, point, to) : least_depth(probe, 1, point, to);
}

INLINE reals push_at(const sonde_batch_probe *probe, reals area, const depths *by, int q,
                     const seen_point *point) {
  return contact_push(probe->stiffness, probe->damping, area, by->depth[q],
                      dot(by->slope[q], point->v), by->inside[q]);
}

// A point's part of the matrix along its slope.
INLINE reals steepness(const sonde_batches *body, reals area, reals push) {
  const sonde_step_scales *step = &body->step;
  const sonde_batch_probe *probe = &body->probe;
  real scale = step->stiffness_scale * probe->stiffness + step->damping_scale * probe->damping;
  return pick(push > 0, scale * area, all(0));
}

INLINE void square(const reals n[3], reals scale, reals block[6]) {
  reals x = scale * n[0], y = scale * n[1];
  block[0] = x * n[0], block[1] = x * n[1], block[2] = x * n[2];
  block[3] = y * n[1], block[4] = y * n[2], block[5] = scale * n[2] * n[2];
}

// Couplings of the corners: the product of the weights of both at each point.
INLINE void find_couplings(const depths *by, const reals steep[SONDE_FACE_POINTS],
                           sonde_push_corners *to) {
  wholes coupled_rows = {0}, alike = ~coupled_rows, plane = by->plane[0];
  for (int c = 0; c < 3; ++c) to->coupling_slope[c] = by->slope[0][c];
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    wholes on = steep[q] > 0, first = on & ~coupled_rows;
    coupled_rows |= on;
    plane = (first & by->plane[q]) | (~first & plane);
    alike &= ~on | (by->plane[q] == plane);
    for (int c = 0; c < 3; ++c)
      to->coupling_slope[c] = pick(first, by->slope[q][c], to->coupling_slope[c]);
  }
  for (int k = 0; k < 3; ++k) {
    reals both = steep[0] + steep[1 + k] + steep[1 + (k + 1) % 3];
    to->between[k] = both * ((real)1 / 9) + steep[1 + (k + 2) % 3] * ((real)1 / 36);
  }
  to->coupled = bits(coupled_rows);
  to->alike = bits(alike);
}

// The sums of the points' shares, gradients, pushes and blocks at the corners.
INLINE void push_points(const sonde_batches *body, const seen_point *points, const depths *by,
                        sonde_pushed_batch *at, sonde_push_corners *to) {
  reals share[4], force[4][3], gradient[4][3], block[6][4], steep[4], square_of[6], count = {0};
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    at->push[q] = push_at(&body->probe, at->area, by, q, &points[q]);
    steep[q] = steepness(body, at->area, at->push[q]);
    share[q] = at->area * by->depth[q];
    reals outward = pick(by->inside[q], at->area * by->unit[q], all(0));
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
    reals corner[3];
    to_corners(block[c], corner);
    for (int k = 0; k < 3; ++k) to->block[k][c] = corner[k];
  }
  find_couplings(by, steep, to);
}

static bool push_faces(const sonde_batches *body, uint32_t index, sonde_pushed_batch *at,
                       sonde_push_corners *to) {
  const wholes *node = body->face[index];
  reals x[4][3], v[4][3], near[3], unused[3];
  SONDE_ASSERT(index < body->face_batch_count);
  seen_point points[SONDE_FACE_POINTS];
  depths by;
  vectors_at_points(body->probe_place, node, x, near);
  at->area = body->point_area[index];
  wholes counts = (near[0] * near[1] * near[2] * at->area) > 0;
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    by.inside[q] = counts;
    for (int c = 0; c < 3; ++c) points[q].x[c] = x[q][c];
  }
  if (!least_depth(&body->probe, SONDE_FACE_POINTS, points, &by)) return false;
  vectors_at_points(body->probe_motion, node, v, unused);
  for (int q = 0; q < SONDE_FACE_POINTS; ++q)
    for (int c = 0; c < 3; ++c) points[q].v[c] = v[q][c];
  push_points(body, points, &by, at, to);
  at->index = index;
  at->inside = bits(by.inside[0] | by.inside[1] | by.inside[2] | by.inside[3]);
  return true;
}

static bool push_nodes(const sonde_batches *body, uint32_t index, sonde_pushed_batch *at,
                       sonde_push_corners *to) {
  seen_point point = seen(body, index, false);
  depths by;
  if (!node_depth(&body->probe, &point, &by)) return false;
  SONDE_ASSERT(index < body->common.batch_count);
  at->index = index;
  at->inside = bits(by.inside[0]);
  at->area = body->rows[index].area;
  at->push[0] = push_at(&body->probe, at->area, &by, 0, &point);
  to->share[0] = at->area * by.depth[0];
  to->area = pick(by.inside[0], at->area, all(0));
  for (int c = 0; c < 3; ++c) {
    at->slope[0][c] = by.slope[0][c];
    to->gradient[0][c] = to->area * by.unit[0] * by.slope[0][c];
    to->force[0][c] = -at->push[0] * by.slope[0][c];
  }
  square(by.slope[0], steepness(body, at->area, at->push[0]), to->block[0]);
  return true;
}

// What a point's push is at the end of the step by the linear system.
INLINE reals push_after(const sonde_batches *body, const sonde_pushed_batch *at, int q,
                        const reals move[3]) {
  const sonde_batch_probe *probe = &body->probe;
  reals end = at->push[q] + probe->gain * at->area * dot(at->slope[q], move);
  return pick((at->push[q] > 0) & (end > 0), end, all(0));
}

INLINE void go_on(const sonde_batches *body, const reals move[3], seen_point *point) {
  reals step[3];
  for (int c = 0; c < 3; ++c) {
    step[c] = body->step.reach * move[c];
    point->x[c] += step[c];
    point->v[c] += move[c];
  }
  add_carried(&body->probe, step, point->v);
}

static void advance_faces(const sonde_batches *body, const sonde_pushed_batch *at, bool surprise,
                          sonde_advance_corners *to) {
  const wholes *node = body->face[at->index];
  reals move[4][3], force[4][3], x[4][3], v[4][3], unused[3];
  vectors_at_points(body->probe_move, node, move, unused);
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    reals end = push_after(body, at, q, move[q]);
    for (int c = 0; c < 3; ++c) force[q][c] = -end * at->slope[q][c];
  }
  vectors_to_corners(force, to->force);
  if (!surprise) return;
  seen_point points[SONDE_FACE_POINTS];
  depths by;
  vectors_at_points(body->probe_place, node, x, unused);
  vectors_at_points(body->probe_motion, node, v, unused);
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    by.inside[q] = at->area > 0;
    for (int c = 0; c < 3; ++c) points[q].x[c] = x[q][c], points[q].v[c] = v[q][c];
    go_on(body, move[q], &points[q]);
  }
  if (least_depth(&body->probe, SONDE_FACE_POINTS, points, &by))
    for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
      reals met = push_at(&body->probe, at->area, &by, q, &points[q]);
      for (int c = 0; c < 3; ++c) force[q][c] += met * by.slope[q][c];
    }
  vectors_to_corners(force, to->surprise);
}

static void advance_nodes(const sonde_batches *body, const sonde_pushed_batch *at, bool surprise,
                          sonde_advance_corners *to) {
  const reals *move = body->batch[at->index].x;
  reals end = push_after(body, at, 0, move);
  for (int c = 0; c < 3; ++c) to->force[0][c] = to->surprise[0][c] = -end * at->slope[0][c];
  if (!surprise) return;
  seen_point point = seen(body, at->index, true);
  depths by;
  if (!node_depth(&body->probe, &point, &by)) return;
  reals met = push_at(&body->probe, at->area, &by, 0, &point);
  for (int c = 0; c < 3; ++c) to->surprise[0][c] += met * by.slope[0][c];
}

// What a batch of corner couplings makes of vectors, corner by corner: with these in the system the
// diagonal blocks have the corners' own part.
INLINE void couple_batch(const sonde_corner_couplings *coupling, const real *vectors,
                         bool coupled_corners, quad pushes[3][SONDE_BATCH]) {
  reals along[3];
  for (int c = 0; c < 3; ++c) {
    reals z[4];
    read_quads(vectors, &coupling->row[c], z);
    along[c] = dot(coupling->slope, z);
  }
  for (int c = 0; c < 3; ++c) {
    int i = (c + 1) % 3, j = (c + 2) % 3;
    reals own = coupled_corners ? all(0) : along[c];
    reals push = coupling->between[c] * (own - along[i]) + coupling->between[j] * (own - along[j]);
    const reals out[4] = {
        push * coupling->slope[0], push * coupling->slope[1], push * coupling->slope[2], {0}};
    write_records((real *)pushes[c], SONDE_QUAD, out);
  }
}

static void couple_corners(sonde_batches *body, const real *vectors) {
  quad pushes[3][SONDE_BATCH];
  for (uint32_t k = 0; k < body->contact_count; ++k)
    for (int l = 0; l < SONDE_BATCH; ++l) body->contact[k].product[l] = (quad){0};
  for (uint32_t k = 0; k < body->coupling_count; ++k) {
    const sonde_corner_couplings *coupling = &body->coupling[k / SONDE_BATCH];
    uint32_t l = k % SONDE_BATCH;
    if (l == 0) couple_batch(coupling, vectors, body->corners_coupled, pushes);
    for (uint32_t c = 0; c < 3; ++c) {
      uint32_t row = (uint32_t)coupling->row[c][l], at = body->contact_of[row / SONDE_BATCH];
      SONDE_ASSERT(at > 0);
      body->contact[at - 1].product[row % SONDE_BATCH] += pushes[c][l];
    }
  }
}
