// The law FOUNDATION for the fast engine (docs/world.md): a face's four integration points at once,
// each row's terms on its diagonal block.
// at_points: a field of the corners at the points.
// nearest:   plane of each point inside the probe.
// next_side: points that share a plane.
// sample:    depths, shares and gradients.
// apply:     pushes where the nodes are evaluated.
// advance:   pushes at the end of the step by the same linearisation.
// surprise:  the pushes that nodes meet where the solution brings them.
// carry:     what couples the corners of a face, for the solver.
#include "world/contact.h"
#include "world/lanes.h"

#include "base/base.h"
#include "base/vector.h"

typedef double four[SONDE_POINTS];
typedef float four_floats __attribute__((vector_size(16)));
typedef int32_t four_integers __attribute__((vector_size(16)));

// Of the corners at the points.
static const four WEIGHT[3] = {{1.0 / 3, 2.0 / 3, 1.0 / 6, 1.0 / 6},
                               {1.0 / 3, 1.0 / 6, 2.0 / 3, 1.0 / 6},
                               {1.0 / 3, 1.0 / 6, 1.0 / 6, 2.0 / 3}};

typedef struct points {
  four x, y, z;
} points;

INLINE void at_points(const sonde_vec3 corner[3], points *p) {
  for (int q = 0; q < SONDE_POINTS; ++q) {
    p->x[q] = corner[0].x * WEIGHT[0][q] + corner[1].x * WEIGHT[1][q] + corner[2].x * WEIGHT[2][q];
    p->y[q] = corner[0].y * WEIGHT[0][q] + corner[1].y * WEIGHT[1][q] + corner[2].y * WEIGHT[2][q];
    p->z[q] = corner[0].z * WEIGHT[0][q] + corner[1].z * WEIGHT[1][q] + corner[2].z * WEIGHT[2][q];
  }
}

INLINE void field_at(const sonde_vec3 *field, const uint32_t *v, points *p) {
  const sonde_vec3 corner[3] = {field[v[0]], field[v[1]], field[v[2]]};
  at_points(corner, p);
}

INLINE double sum(const four a, const four b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

// Coordinates from the probe's origin, which single precision resolves to 4 nm.
INLINE four_floats from(const four x, double origin) {
  return (four_floats){(float)(x[0] - origin), (float)(x[1] - origin), (float)(x[2] - origin),
                       (float)(x[3] - origin)};
}

// The plane of the least weighted distance, -1 outside and where it faces backwards.
INLINE bool nearest(const sonde_state *state, const points *at, int32_t plane[SONDE_POINTS]) {
  four_floats x = from(at->x, state->origin.x), y = from(at->y, state->origin.y);
  four_floats z = from(at->z, state->origin.z);
  four_floats least = {INFINITY, INFINITY, INFINITY, INFINITY};
  four_integers inside = {-1, -1, -1, -1}, best = inside;
  for (uint32_t k = 0; k < state->plane_count; ++k) {
    const float *n = state->plane_lane[k];
    four_floats t = n[3] - (n[0] * x + n[1] * y + n[2] * z);
    four_integers closer = t < least;
    inside &= t > 0;
    if (!(inside[0] | inside[1] | inside[2] | inside[3])) return false;
    least = (four_floats)((closer & (four_integers)t) | (~closer & (four_integers)least));
    best = (closer & (int32_t)k) | (~closer & best);
  }
  best |= ~inside;
  bool any = false;
  for (int q = 0; q < SONDE_POINTS; ++q) {
    plane[q] = best[q];
    if (best[q] >= 0 && !pushes_forward(state, plane_slope(state, (uint32_t)best[q])))
      plane[q] = -1;
    any |= plane[q] >= 0;
  }
  return any;
}

// The next point from *q on that shows a plane not seen before; side: 1 for its points.
INLINE bool next_side(const int32_t plane[SONDE_POINTS], int *q, four side) {
  for (; *q < SONDE_POINTS; ++*q) {
    bool seen = plane[*q] < 0;
    for (int p = 0; p < *q; ++p) seen |= plane[p] == plane[*q];
    if (seen) continue;
    for (int p = 0; p < SONDE_POINTS; ++p) side[p] = plane[p] == plane[*q];
    return true;
  }
  return false;
}

INLINE void depth_at(const sonde_state *state, uint32_t plane, const points *x, four depth) {
  sonde_vec3 n = state->plane_normal[plane];
  double weight = state->plane_weight[plane], offset = state->plane_offset[plane];
  for (int q = 0; q < SONDE_POINTS; ++q)
    depth[q] = weight * (offset - (n.x * x->x[q] + n.y * x->y[q] + n.z * x->z[q]));
}

// One plane's part of a face.
INLINE void sample_side(sonde_state *state, const uint32_t *v, double area, sonde_vec3 slope,
                        const four depth, const four side) {
  const four one = {1, 1, 1, 1};
  sonde_vec3 outward = v_scale(v_unit(slope, state->inward), area);
  for (int k = 0; k < 3; ++k) {
    state->share_m3[v[k]] += area * sum(WEIGHT[k], depth);
    state->gradient[v[k]] = v_madd(state->gradient[v[k]], sum(WEIGHT[k], side), outward);
  }
  state->contact.area_m2 += area * sum(one, side);
  state->contact.volume_m3 += area * sum(one, depth);
}

void sonde_faces_sample(sonde_state *state, uint32_t face) {
  const uint32_t *v = state->model->surface.faces[face];
  SONDE_ASSERT(state->touched_face_count < state->model->surface.face_count);
  sonde_pressed_face *at = &state->lanes->pressed_face[state->touched_face_count];
  points x;
  field_at(state->probed, v, &x);
  if (!nearest(state, &x, at->plane)) return;
  for (int k = 0; k < 3; ++k) sonde_contact_touch(state, v[k]);
  for (int q = 0; q < SONDE_POINTS; ++q) at->depth[q] = at->push[q] = 0;
  four side, depth;
  for (int q = 0; next_side(at->plane, &q, side); ++q) {
    uint32_t plane = (uint32_t)at->plane[q];
    depth_at(state, plane, &x, depth);
    for (int p = 0; p < SONDE_POINTS; ++p) at->depth[p] += depth[p] *= side[p];
    sample_side(state, v, state->model->face_area_m2[face] / SONDE_POINTS,
                plane_slope(state, plane), depth, side);
  }
  sonde_contact_join(state, v[0], v[1]);
  sonde_contact_join(state, v[1], v[2]);
  state->touched_faces[state->touched_face_count++] = face;
}

// Rate of the depth of points that move at v while the probe moves.
INLINE void rate_of(sonde_vec3 slope, const points *x, const points *v, const sonde_motion *probe,
                    four rate) {
  sonde_vec3 w = probe->spin, o = probe->origin, u = probe->velocity;
  for (int q = 0; q < SONDE_POINTS; ++q) {
    sonde_vec3 arm = vec3(x->x[q] - o.x, x->y[q] - o.y, x->z[q] - o.z);
    sonde_vec3 carried = v_add(u, v_cross(w, arm));
    rate[q] = v_dot(slope, v_sub(vec3(v->x[q], v->y[q], v->z[q]), carried));
  }
}

// Stiffness and damper of a point of a face.
INLINE void point_law(const sonde_state *state, uint32_t face, double *stiffness, double *damping) {
  double area = state->model->face_area_m2[face] / SONDE_POINTS;
  *stiffness = state->def.contact_stiffness_n_m3 * area;
  *damping = state->def.contact_damping_n_s_m3 * area;
}

// Pushes of one plane's points; never a pull.
INLINE void push_side(const four depth, const four rate, double stiffness, double damping,
                      const four side, four push) {
  for (int q = 0; q < SONDE_POINTS; ++q) {
    double p = stiffness * depth[q] + damping * rate[q];
    push[q] = p > 0 ? p * side[q] : 0;
  }
}

// scale: of the points that push.
static void add_tie(sonde_lanes *lanes, const uint32_t *v, sonde_vec3 slope, double scale,
                    const four pushes) {
  sonde_press_tie *tie = &lanes->tie[lanes->tie_count++];
  const double n[3] = {slope.x, slope.y, slope.z};
  for (int c = 0; c < 3; ++c) {
    four both;
    for (int q = 0; q < SONDE_POINTS; ++q) both[q] = WEIGHT[(c + 1) % 3][q] * pushes[q];
    tie->row[c] = v[c];
    tie->slope[c] = (float)n[c];
    tie->tie[c] = (float)(scale * sum(WEIGHT[c], both));
  }
}

static void apply_face(sonde_state *state, uint32_t k, const sonde_motion *probe,
                       const sonde_contact_scales *scales) {
  const uint32_t *v = state->model->surface.faces[state->touched_faces[k]];
  sonde_pressed_face *at = &state->lanes->pressed_face[k];
  points x, speed;
  double stiffness, damping;
  four side, rate, push;
  field_at(state->probed, v, &x);
  field_at(state->velocity, v, &speed);
  point_law(state, state->touched_faces[k], &stiffness, &damping);
  double scale = scales->stiffness * stiffness + scales->damping * damping;
  for (int q = 0; next_side(at->plane, &q, side); ++q) {
    sonde_vec3 slope = plane_slope(state, (uint32_t)at->plane[q]);
    rate_of(slope, &x, &speed, probe, rate);
    push_side(at->depth, rate, stiffness, damping, side, push);
    for (int p = 0; p < SONDE_POINTS; ++p) at->push[p] += push[p], side[p] = push[p] > 0;
    for (int c = 0; c < 3; ++c) {
      sonde_vec3 *force = &state->contact_force[v[c]];
      sonde_mat3 *block = &state->matrix->diagonal[v[c]];
      *force = v_madd(*force, -sum(WEIGHT[c], push), slope);
      *block = m_add(*block, m_rank1(slope, scale * sum(WEIGHT[c], side), 0));
    }
    add_tie(state->lanes, v, slope, scale, side);
  }
}

void sonde_faces_apply(sonde_state *state, const sonde_motion *probe,
                       const sonde_contact_scales *scales) {
  SONDE_ASSERT(scales->stiffness > 0);
  state->lanes->tie_count = 0;
  for (uint32_t k = 0; k < state->touched_face_count; ++k) apply_face(state, k, probe, scales);
}

static void advance_face(sonde_state *state, uint32_t k, double h) {
  const uint32_t *v = state->model->surface.faces[state->touched_faces[k]];
  const sonde_pressed_face *at = &state->lanes->pressed_face[k];
  double stiffness, damping;
  four side, push;
  point_law(state, state->touched_faces[k], &stiffness, &damping);
  double gain = h * stiffness + damping;
  for (int q = 0; next_side(at->plane, &q, side); ++q) {
    sonde_vec3 slope = plane_slope(state, (uint32_t)at->plane[q]);
    double way[3];
    for (int c = 0; c < 3; ++c) way[c] = gain * v_dot(slope, state->increment[v[c]]);
    for (int p = 0; p < SONDE_POINTS; ++p) {
      double end =
          at->push[p] + way[0] * WEIGHT[0][p] + way[1] * WEIGHT[1][p] + way[2] * WEIGHT[2][p];
      push[p] = at->push[p] > 0 && end > 0 ? end * side[p] : 0;
    }
    for (int c = 0; c < 3; ++c)
      state->contact_force[v[c]] = v_madd(state->contact_force[v[c]], -sum(WEIGHT[c], push), slope);
  }
}

void sonde_faces_advance(sonde_state *state, double h) {
  SONDE_ASSERT(h > 0);
  for (uint32_t k = 0; k < state->touched_count; ++k)
    state->contact_force[state->touched[k]] = vec3(0, 0, 0);
  for (uint32_t k = 0; k < state->touched_face_count; ++k) advance_face(state, k, h);
}

// Takes a face's pushes where the nodes go from right[].
static void meet_face(sonde_state *state, uint32_t face, const sonde_motion *probe, double h) {
  const uint32_t *v = state->model->surface.faces[face];
  double stiffness, damping;
  sonde_vec3 place[3], motion[3];
  points x, speed;
  int32_t plane[SONDE_POINTS];
  four side, depth, rate, push;
  for (int k = 0; k < 3; ++k) {
    place[k] = v_madd(state->probed[v[k]], h, state->increment[v[k]]);
    motion[k] = v_add(state->velocity[v[k]], state->increment[v[k]]);
  }
  at_points(place, &x);
  if (!nearest(state, &x, plane)) return;
  at_points(motion, &speed);
  point_law(state, face, &stiffness, &damping);
  for (int q = 0; next_side(plane, &q, side); ++q) {
    sonde_vec3 slope = plane_slope(state, (uint32_t)plane[q]);
    depth_at(state, (uint32_t)plane[q], &x, depth);
    rate_of(slope, &x, &speed, probe, rate);
    push_side(depth, rate, stiffness, damping, side, push);
    for (int c = 0; c < 3; ++c)
      state->right[v[c]] = v_madd(state->right[v[c]], sum(WEIGHT[c], push), slope);
  }
}

double sonde_faces_surprise(sonde_state *state, const sonde_motion *probe, double h) {
  double sum2 = 0;
  for (uint32_t k = 0; k < state->touched_count; ++k)
    state->right[state->touched[k]] = state->contact_force[state->touched[k]];
  for (uint32_t k = 0; k < state->touched_face_count; ++k)
    meet_face(state, state->touched_faces[k], probe, h);
  for (uint32_t k = 0; k < state->touched_count; ++k)
    sum2 += v_norm2(state->right[state->touched[k]]);
  return sum2;
}

// The ties' part of the rows for the directions at hand.
void sonde_faces_carry(sonde_lanes *lanes) {
  for (uint32_t k = 0; k < lanes->press_count; ++k)
    for (int c = 0; c < 3; ++c) lanes->press[k].carry[c] = (sonde_lane){0};
  for (uint32_t k = 0; k < lanes->tie_count; ++k) {
    const sonde_press_tie *tie = &lanes->tie[k];
    float along[3];
    for (int c = 0; c < 3; ++c) {
      const float *z = lanes->direction + (size_t)tie->row[c] * SONDE_QUAD;
      along[c] = tie->slope[0] * z[0] + tie->slope[1] * z[1] + tie->slope[2] * z[2];
    }
    float part[3];
    for (int c = 0; c < 3; ++c) part[c] = tie->tie[c] * (along[c] - along[(c + 1) % 3]);
    for (int c = 0; c < 3; ++c) {
      uint32_t s = tie->row[c] / SONDE_LANES, l = tie->row[c] % SONDE_LANES;
      SONDE_ASSERT(lanes->press_of[s] > 0);
      sonde_slice_press *press = &lanes->press[lanes->press_of[s] - 1];
      float push = part[c] - part[(c + 2) % 3];
      for (int d = 0; d < 3; ++d) press->carry[d][l] += push * tie->slope[d];
    }
  }
}
