// The contact of the fast engine (docs/world.md): the kernels press 16 faces or nodes at a time,
// and what these add to nodes is summed up here, in ascending order.
// set_probe:    the probe as the kernels see it.
// find_near:    slices of nodes near the probe.
// mark_faces:   slices of faces with a corner in such slices.
// press_at:     where the contact with a slice of nodes is gathered.
// touch:        a node that the probe touches.
// add_faces, add_nodes: what a pressed slice adds.
// add_ties:     what couples the corners of a face.
// list_touched: touched nodes, ascending.
// detect, meet: a Newton iteration's contact before and after the solution.
#include "world/contact.h"
#include "world/lanes.h"

#include "base/base.h"

#include <string.h>

static bool by_nodes(const sonde_state *state) {
  return state->def.contact_law == SONDE_CONTACT_NODES;
}

static void set_vector(float to[3], sonde_vec3 a) {
  to[0] = (float)a.x, to[1] = (float)a.y, to[2] = (float)a.z;
}

static void set_planes(const sonde_state *state, sonde_lane_probe *to) {
  SONDE_ASSERT(state->plane_count <= SONDE_MAX_PROBE_PLANES);
  to->plane_count = state->plane_count;
  for (uint32_t k = 0; k < state->plane_count; ++k) {
    sonde_vec3 slope = plane_slope(state, k);
    double weight = state->plane_weight[k];
    double offset = state->plane_offset[k] - v_dot(state->plane_normal[k], state->origin);
    set_vector(to->plane[k], v_scale(slope, -1));
    to->plane[k][3] = (float)(weight * offset);
    set_vector(to->slope[k], slope);
    to->slope[k][3] = pushes_forward(state, slope) ? (float)(1 / weight) : 0;
  }
}

static void set_probe(sonde_state *state, const sonde_box *box, const sonde_motion *motion) {
  sonde_lane_probe *to = &state->lanes->probe;
  const sonde_vec3 o = state->origin, turn = motion->spin;
  const double origin[3] = {o.x, o.y, o.z};
  for (int c = 0; c < 3; ++c) sonde_split(origin[c], &to->origin[c], &to->origin_low[c]);
  to->radius = (float)state->ball_radius;
  to->plane_count = 0;
  if (!(state->ball_radius > 0)) set_planes(state, to);
  set_vector(to->centre, v_sub(state->ball_centre, o));
  set_vector(to->inward, state->inward);
  set_vector(to->low, v_sub(box->low, o));
  set_vector(to->high, v_sub(box->high, o));
  // Of the probe's point at its origin.
  set_vector(to->velocity, v_add(motion->velocity, v_cross(turn, v_sub(o, motion->origin))));
  set_vector(to->spin, turn);
  to->stiffness = (float)state->def.contact_stiffness_n_m3;
  to->damping = (float)state->def.contact_damping_n_s_m3;
}

static void forget_near(sonde_lanes *lanes) {
  for (uint32_t k = 0; k < lanes->near_probe_count; ++k) {
    float *first = lanes->probe_place + (size_t)lanes->near_probe[k] * SONDE_LANES * SONDE_QUAD;
    for (int l = 0; l < SONDE_LANES; ++l) first[l * SONDE_QUAD + 3] = 0;
  }
  lanes->near_probe_count = 0;
}

// With a node in the probe's box, which for pushes on faces grows by one and a half of their edges,
// so that all corners of a face that meets the probe are among them.
static void find_near(sonde_state *state, const sonde_box *box) {
  float low[3], high[3];
  set_vector(low, box->low);
  set_vector(high, box->high);
  state->lanes->kernels->near(state->lanes, low, high, by_nodes(state) ? 0 : 1.5f);
}

// Slices of faces with a corner near the probe. Where all these corners are beyond one of the
// probe's planes, none of their faces can meet it.
static void mark_faces(sonde_lanes *lanes) {
  SONDE_ASSERT(lanes->near_probe_count <= lanes->slice_count);
  memset(lanes->face_marked, 0, (lanes->face_slice_count / 64 + 1) * sizeof *lanes->face_marked);
  for (uint32_t k = 0; k < lanes->near_probe_count; ++k) {
    const sonde_slice_model *fixed = &lanes->model[lanes->near_probe[k]];
    const uint32_t *faces = lanes->face_near + fixed->first_face;
    for (uint32_t f = 0; f < fixed->face_count; ++f) {
      uint64_t *word = &lanes->face_marked[faces[f] / 64], bit = (uint64_t)1 << faces[f] % 64;
      uint32_t before = *word & bit ? lanes->face_code[faces[f]] : UINT32_MAX;
      lanes->face_code[faces[f]] = before & lanes->near_code[k];
      *word |= bit;
    }
  }
}

static sonde_slice_press *press_at(sonde_lanes *lanes, uint32_t s) {
  if (lanes->press_of[s] == 0) {
    lanes->pressed[lanes->press_count++] = s;
    lanes->press_of[s] = lanes->press_count;
    memset(&lanes->press[lanes->press_count - 1], 0, sizeof *lanes->press);
  }
  SONDE_ASSERT(lanes->press_count <= lanes->slice_count);
  return &lanes->press[lanes->press_of[s] - 1];
}

static void touch(sonde_state *state, uint32_t i) {
  uint16_t *rows = &state->lanes->touched_rows[i / SONDE_LANES];
  uint16_t bit = (uint16_t)(1u << i % SONDE_LANES);
  if (*rows & bit) return;
  *rows |= bit;
  state->parent[i] = i;
}

// What lane l of corner k adds to node i.
static void add_corner(sonde_state *state, const sonde_press_corners *from, int k, uint32_t l,
                       uint32_t i) {
  sonde_slice_press *press = press_at(state->lanes, i / SONDE_LANES);
  uint32_t row = i % SONDE_LANES;
  touch(state, i);
  state->share_m3[i] += (double)from->share[k][l];
  state->gradient[i] = v_add(state->gradient[i], sonde_lane_vector(from->gradient[k], l));
  for (int c = 0; c < 3; ++c) press->force[c][row] += from->force[k][c][l];
  for (int c = 0; c < 6; ++c) press->block[c][row] += from->block[k][c][l];
}

static void add_areas(sonde_state *state, const sonde_press_corners *from, int corners,
                      uint32_t l) {
  state->contact.area_m2 += (double)from->area[l];
  for (int k = 0; k < corners; ++k) state->contact.volume_m3 += (double)from->share[k][l];
}

// The part of node i's row that stands for its neighbours along the slope n.
static void add_tied(sonde_lanes *lanes, uint32_t i, const float n[3], float scale) {
  sonde_slice_press *press = press_at(lanes, i / SONDE_LANES);
  uint32_t row = i % SONDE_LANES;
  float x = scale * n[0], y = scale * n[1], z = scale * n[2];
  press->tied[0][row] += x * n[0], press->tied[1][row] += x * n[1];
  press->tied[2][row] += x * n[2], press->tied[3][row] += y * n[1];
  press->tied[4][row] += y * n[2], press->tied[5][row] += z * n[2];
}

static void add_tie(sonde_lanes *lanes, const uint32_t v[3], const float slope[3],
                    const float tie[3]) {
  uint32_t l = lanes->tie_count++ % SONDE_LANES;
  sonde_press_ties *to = &lanes->tie[(lanes->tie_count - 1) / SONDE_LANES];
  if (l == 0) memset(to, 0, sizeof *to);
  for (int c = 0; c < 3; ++c)
    to->row[c][l] = (int32_t)v[c], to->slope[c][l] = slope[c], to->tie[c][l] = tie[c];
  for (int c = 0; lanes->tied && c < 3; ++c)
    add_tied(lanes, v[c], slope, tie[c] + tie[(c + 2) % 3]);
}

// One of the whole face where its points push along one slope, else one per point.
static void add_ties(sonde_lanes *lanes, const sonde_pressed_slice *at,
                     const sonde_press_corners *from, uint32_t l, const uint32_t v[3]) {
  if (!(from->tied >> l & 1)) return;
  if (from->alike >> l & 1) {
    const float slope[3] = {from->tie_slope[0][l], from->tie_slope[1][l], from->tie_slope[2][l]};
    const float tie[3] = {from->tie[0][l], from->tie[1][l], from->tie[2][l]};
    add_tie(lanes, v, slope, tie);
    return;
  }
  float steep = lanes->law.stiffness_scale * lanes->probe.stiffness +
                lanes->law.damping_scale * lanes->probe.damping;
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    if (!(at->push[q][l] > 0)) continue;
    const float slope[3] = {at->slope[q][0][l], at->slope[q][1][l], at->slope[q][2][l]};
    float tie[3];
    for (int k = 0; k < 3; ++k)
      tie[k] = steep * at->area[l] * (q == 1 + (k + 2) % 3 ? 1.0f / 36 : 1.0f / 9);
    add_tie(lanes, v, slope, tie);
  }
}

static void corners_of(const sonde_lanes *lanes, uint32_t faces, uint32_t l, uint32_t v[3]) {
  for (int k = 0; k < 3; ++k) v[k] = (uint32_t)lanes->face[faces][k][l];
}

static void add_faces(sonde_state *state, const sonde_pressed_slice *at,
                      const sonde_press_corners *from) {
  for (uint32_t rest = at->inside; rest; rest &= rest - 1) {
    uint32_t l = (uint32_t)__builtin_ctz(rest), v[3];
    corners_of(state->lanes, at->index, l, v);
    for (int k = 0; k < 3; ++k) add_corner(state, from, k, l, v[k]);
    sonde_contact_join(state, v[0], v[1]);
    sonde_contact_join(state, v[1], v[2]);
    add_areas(state, from, 3, l);
    add_ties(state->lanes, at, from, l, v);
  }
}

static void add_nodes(sonde_state *state, const sonde_pressed_slice *at,
                      const sonde_press_corners *from) {
  for (uint32_t rest = at->inside; rest; rest &= rest - 1) {
    uint32_t l = (uint32_t)__builtin_ctz(rest);
    add_corner(state, from, 0, l, at->index * SONDE_LANES + l);
    add_areas(state, from, 1, l);
  }
}

static void press_slice(sonde_state *state, uint32_t index) {
  sonde_lanes *lanes = state->lanes;
  sonde_pressed_slice *at = &lanes->pressed_slice[lanes->pressed_slice_count];
  bool nodes = by_nodes(state);
  if (!(nodes ? lanes->kernels->press_nodes : lanes->kernels->press_faces)(lanes, index, at,
                                                                           lanes->press_corners))
    return;
  lanes->pressed_slice_count++;
  (nodes ? add_nodes : add_faces)(state, at, lanes->press_corners);
}

static void press_near(sonde_state *state) {
  sonde_lanes *lanes = state->lanes;
  if (by_nodes(state)) {
    for (uint32_t k = 0; k < lanes->near_probe_count; ++k) press_slice(state, lanes->near_probe[k]);
    return;
  }
  lanes->kernels->locate(lanes);
  mark_faces(lanes);
  for (uint32_t word = 0; word <= lanes->face_slice_count / 64; ++word)
    for (uint64_t rest = lanes->face_marked[word]; rest; rest &= rest - 1) {
      uint32_t index = word * 64 + (uint32_t)__builtin_ctzll(rest);
      if (lanes->face_code[index] == 0) press_slice(state, index);
    }
}

// Slices near the probe are in ascending order.
static void list_touched(sonde_state *state) {
  const sonde_lanes *lanes = state->lanes;
  for (uint32_t k = 0; k < lanes->near_probe_count; ++k) {
    uint32_t s = lanes->near_probe[k];
    for (uint32_t rest = lanes->touched_rows[s]; rest; rest &= rest - 1)
      state->touched[state->touched_count++] = s * SONDE_LANES + (uint32_t)__builtin_ctz(rest);
  }
  SONDE_ASSERT(state->touched_count <= lanes->node_count);
}

// Where the touched nodes are evaluated, and their velocities.
static void publish_touched(sonde_state *state) {
  const sonde_lanes *lanes = state->lanes;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k], l = i % SONDE_LANES;
    const sonde_slice *at = &lanes->slice[i / SONDE_LANES];
    sonde_vec3 v = sonde_lane_vector(at->ve, l), u = sonde_lane_vector(at->u, l);
    state->velocity[i] = v;
    state->position[i] = v_add(state->model->surface.vertices[i], u);
    state->probed[i] = v_madd(state->position[i], state->def.dt_s, v);
  }
}

static void clear_press(sonde_lanes *lanes) {
  for (uint32_t k = 0; k < lanes->press_count; ++k) lanes->press_of[lanes->pressed[k]] = 0;
  for (uint32_t k = 0; k < lanes->near_probe_count; ++k)
    lanes->touched_rows[lanes->near_probe[k]] = 0;
  lanes->press_count = lanes->tie_count = lanes->pressed_slice_count = 0;
}

void sonde_press_detect(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                        const sonde_motion *motion) {
  sonde_contact_forget(state);
  forget_near(state->lanes);
  sonde_box box = {vec3(0, 0, 0), vec3(0, 0, 0)};
  if (probe) {
    box = sonde_contact_box(probe, pose);
    find_near(state, &box);
  }
  clear_press(state->lanes);
  if (!probe) return;
  sonde_contact_place(state, probe, pose);
  set_probe(state, &box, motion);
  press_near(state);
  list_touched(state);
  publish_touched(state);
  if (by_nodes(state)) sonde_nodes_join(state);
  sonde_contact_wake(state);
  sonde_contact_regions(state, motion);
}

// The pushes after the solution, and their surprise, of one pressed slice.
static void meet_slice(sonde_state *state, const sonde_pressed_slice *at, bool surprise) {
  const sonde_lanes *lanes = state->lanes;
  const sonde_meet_corners *from = lanes->meet_corners;
  int corners = by_nodes(state) ? 1 : 3;
  (by_nodes(state) ? lanes->kernels->meet_nodes : lanes->kernels->meet_faces)(lanes, at, surprise,
                                                                              lanes->meet_corners);
  for (uint32_t rest = at->inside; rest; rest &= rest - 1) {
    uint32_t l = (uint32_t)__builtin_ctz(rest), v[3] = {at->index * SONDE_LANES + l};
    if (corners == 3) corners_of(lanes, at->index, l, v);
    for (int k = 0; k < corners; ++k) {
      sonde_vec3 *force = &state->contact_force[v[k]], *right = &state->right[v[k]];
      *force = v_add(*force, sonde_lane_vector(from->force[k], l));
      if (surprise) *right = v_add(*right, sonde_lane_vector(from->surprise[k], l));
    }
  }
}

double sonde_press_meet(sonde_state *state, bool surprise) {
  const sonde_lanes *lanes = state->lanes;
  double sum2 = 0;
  SONDE_ASSERT(lanes->pressed_slice_count == 0 || state->touched_count > 0);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    state->contact_force[i] = state->right[i] = vec3(0, 0, 0);
  }
  if (!by_nodes(state)) lanes->kernels->hand_on(state->lanes);
  for (uint32_t k = 0; k < lanes->pressed_slice_count; ++k)
    meet_slice(state, &lanes->pressed_slice[k], surprise);
  for (uint32_t k = 0; surprise && k < state->touched_count; ++k)
    sum2 += v_norm2(state->right[state->touched[k]]);
  return sum2;
}
