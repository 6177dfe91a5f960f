// The contact of an engine (docs/world.md): the kernels push a batch of faces or nodes at a time,
// and what these add to nodes is summed up here, in ascending order; then the pushes after a
// solution.
#include "world/batches.h"
#include "world/contact.h"

#include "base/base.h"
#include "geometry/internal.h"

#include <string.h>

static bool by_nodes(const sonde_state *state) {
  return state->def.contact_law == SONDE_CONTACT_NODES;
}

static void set_vector(real to[3], sonde_vec3 a) {
  to[0] = (real)a.x, to[1] = (real)a.y, to[2] = (real)a.z;
}

// The probe as the kernels see it.
static void set_probe(const sonde_state *state, sonde_batches *body, const sonde_box *box,
                      const sonde_motion *motion) {
  sonde_batch_probe *to = &body->probe;
  const sonde_vec3 o = state->origin, spin = motion->spin;
  const double origin[3] = {o.x, o.y, o.z};
  for (int c = 0; c < 3; ++c) sonde_split(origin[c], &to->origin[c], &to->origin_low[c]);
  to->radius = (real)state->ball_radius;
  to->plane_count = state->ball_radius > 0 ? 0 : state->plane_count;
  SONDE_ASSERT(to->plane_count <= SONDE_MAX_PROBE_PLANES);
  for (uint32_t k = 0; k < to->plane_count; ++k) {
    sonde_vec3 slope = plane_slope(state, k);
    double weight = state->plane_weight[k];
    double offset = state->plane_offset[k] - v_dot(state->plane_normal[k], o);
    set_vector(to->plane[k], v_scale(slope, -1));
    to->plane[k][3] = (real)(weight * offset);
    set_vector(to->slope[k], slope);
    to->slope[k][3] = pushes_forward(state, slope) ? (real)(1 / weight) : 0;
  }
  set_vector(to->centre, v_sub(state->ball_centre, o));
  set_vector(to->inward, state->inward);
  set_vector(to->low, v_sub(box->low, o));
  set_vector(to->high, v_sub(box->high, o));
  // Of the probe's point at its origin.
  set_vector(to->velocity, v_add(motion->velocity, v_cross(spin, v_sub(o, motion->origin))));
  set_vector(to->spin, spin);
  to->stiffness = (real)state->def.contact_stiffness_n_m3;
  to->damping = (real)state->def.contact_damping_n_s_m3;
  to->gain = body->step.lambda > 0 ? body->step.reach * to->stiffness + to->damping : 0;
}

// Batches of faces with a corner near the probe. Where all these corners are beyond one of the
// probe's planes, none of their faces can meet it.
static void mark_faces(sonde_batches *body) {
  SONDE_ASSERT(body->near_probe_count <= body->common.batch_count);
  memset(body->face_marked, 0, (body->face_batch_count / 64 + 1) * sizeof *body->face_marked);
  for (uint32_t k = 0; k < body->near_probe_count; ++k) {
    const sonde_rows *rows = &body->rows[body->near_probe[k]];
    const uint32_t *faces = body->face_near + rows->first_face;
    for (uint32_t f = 0; f < rows->face_count; ++f) {
      uint64_t *word = &body->face_marked[faces[f] / 64], bit = (uint64_t)1 << faces[f] % 64;
      uint32_t before = *word & bit ? body->face_code[faces[f]] : UINT32_MAX;
      body->face_code[faces[f]] = before & body->near_code[k];
      *word |= bit;
    }
  }
}

// Where the contact with batch s of nodes is gathered.
static sonde_batch_contact *contact_at(sonde_batches *body, uint32_t s) {
  if (body->contact_of[s] == 0) {
    body->contact_batch[body->contact_count++] = s;
    body->contact_of[s] = body->contact_count;
    memset(&body->contact[body->contact_count - 1], 0, sizeof *body->contact);
  }
  SONDE_ASSERT(body->contact_count <= body->common.batch_count);
  return &body->contact[body->contact_of[s] - 1];
}

static void touch_node(sonde_state *state, sonde_batches *body, uint32_t i) {
  uint16_t *rows = &body->touched_rows[i / SONDE_BATCH];
  uint16_t bit = (uint16_t)(1u << i % SONDE_BATCH);
  if (*rows & bit) return;
  *rows |= bit;
  state->parent[i] = i;
}

// What row l of corner k adds to node i.
static void add_corner(sonde_state *state, sonde_batches *body, const sonde_push_corners *from,
                       int k, uint32_t l, uint32_t i) {
  sonde_batch_contact *contact = contact_at(body, i / SONDE_BATCH);
  uint32_t row = i % SONDE_BATCH;
  touch_node(state, body, i);
  state->share_m3[i] += (double)from->share[k][l];
  state->gradient[i] = v_add(state->gradient[i], sonde_batch_vector(from->gradient[k], l));
  for (int c = 0; c < 3; ++c) contact->force[c][row] += from->force[k][c][l];
  for (int c = 0; c < 6; ++c) contact->block[c][row] += from->block[k][c][l];
}

static void add_areas(sonde_state *state, const sonde_push_corners *from, int corners, uint32_t l) {
  state->contact.area_m2 += (double)from->area[l];
  for (int k = 0; k < corners; ++k) state->contact.volume_m3 += (double)from->share[k][l];
}

// Couples the corners v along a slope. In the linear system their own blocks then lack what stands
// for neighbours.
static void add_coupling(sonde_batches *body, const uint32_t v[3], const real n[3],
                         const real between[3]) {
  uint32_t l = body->coupling_count++ % SONDE_BATCH;
  sonde_corner_couplings *to = &body->coupling[(body->coupling_count - 1) / SONDE_BATCH];
  if (l == 0) memset(to, 0, sizeof *to);
  for (int c = 0; c < 3; ++c)
    to->row[c][l] = (whole)v[c], to->slope[c][l] = n[c], to->between[c][l] = between[c];
  for (int c = 0; body->corners_coupled && c < 3; ++c) {
    reals *part = contact_at(body, v[c] / SONDE_BATCH)->neighbours;
    uint32_t row = v[c] % SONDE_BATCH;
    real scale = between[c] + between[(c + 2) % 3];
    real x = scale * n[0], y = scale * n[1], z = scale * n[2];
    part[0][row] += x * n[0], part[1][row] += x * n[1], part[2][row] += x * n[2];
    part[3][row] += y * n[1], part[4][row] += y * n[2], part[5][row] += z * n[2];
  }
}

// One coupling of the whole face where its points push along one slope, else one per point.
static void add_couplings(sonde_batches *body, const sonde_pushed_batch *at,
                          const sonde_push_corners *from, uint32_t l, const uint32_t v[3]) {
  if (!(from->coupled >> l & 1)) return;
  if (from->alike >> l & 1) {
    const real slope[3] = {from->coupling_slope[0][l], from->coupling_slope[1][l],
                           from->coupling_slope[2][l]};
    const real between[3] = {from->between[0][l], from->between[1][l], from->between[2][l]};
    add_coupling(body, v, slope, between);
    return;
  }
  real steep = body->step.stiffness_scale * body->probe.stiffness +
               body->step.damping_scale * body->probe.damping;
  for (int q = 0; q < SONDE_FACE_POINTS; ++q) {
    if (!(at->push[q][l] > 0)) continue;
    const real slope[3] = {at->slope[q][0][l], at->slope[q][1][l], at->slope[q][2][l]};
    real between[3];
    for (int k = 0; k < 3; ++k)
      between[k] = steep * at->area[l] * (q == 1 + (k + 2) % 3 ? (real)1 / 36 : (real)1 / 9);
    add_coupling(body, v, slope, between);
  }
}

static void corners_of(const sonde_batches *body, uint32_t faces, uint32_t l, uint32_t v[3]) {
  for (int k = 0; k < 3; ++k) v[k] = (uint32_t)body->face[faces][k][l];
}

static void push_batch(sonde_state *state, sonde_batches *body, uint32_t index) {
  const sonde_kernels *kernels = body->kernels;
  sonde_pushed_batch *at = &body->pushed[body->pushed_count];
  const sonde_push_corners *from = body->push_corners;
  bool nodes = by_nodes(state);
  if (!(nodes ? kernels->push_nodes : kernels->push_faces)(body, index, at, body->push_corners))
    return;
  body->pushed_count++;
  for (uint32_t rest = at->inside; rest; rest &= rest - 1) {
    uint32_t l = (uint32_t)__builtin_ctz(rest), v[3];
    if (nodes) {
      add_corner(state, body, from, 0, l, at->index * SONDE_BATCH + l);
      add_areas(state, from, 1, l);
      continue;
    }
    corners_of(body, at->index, l, v);
    for (int k = 0; k < 3; ++k) add_corner(state, body, from, k, l, v[k]);
    sonde_contact_join(state, v[0], v[1]);
    sonde_contact_join(state, v[1], v[2]);
    add_areas(state, from, 3, l);
    add_couplings(body, at, from, l, v);
  }
}

// The law VOLUME: faces of a batch clipped by the probe, exactly.
static void clip_batch(sonde_state *state, sonde_batches *body, uint32_t index) {
  for (uint32_t l = 0; l < SONDE_BATCH; ++l) {
    sonde_clip_result clip;
    sonde_vec3 corner[3];
    uint32_t v[3];
    if (!(body->point_area[index][l] > 0)) continue;
    corners_of(body, index, l, v);
    for (int k = 0; k < 3; ++k) { // where the node is evaluated
      const uint32_t lane = v[k] % SONDE_BATCH;
      const sonde_batch *at = &body->batch[v[k] / SONDE_BATCH];
      const sonde_vec3 x = v_add(state->nodes.rest[v[k]], sonde_batch_vector(at->u, lane));
      corner[k] = v_madd(x, (double)body->step.reach, sonde_batch_vector(at->ve, lane));
    }
    if (!sonde_clip_triangle(state->plane_normal, state->plane_offset, state->plane_count, corner,
                             state->inward, &clip) ||
        !(clip.area_m2 > 0))
      continue;
    for (int k = 0; k < 3; ++k) {
      touch_node(state, body, v[k]);
      contact_at(body, v[k] / SONDE_BATCH);
      state->share_m3[v[k]] += clip.share_m3[k];
      state->gradient[v[k]] = v_add(state->gradient[v[k]], clip.gradient[k]);
    }
    sonde_contact_join(state, v[0], v[1]);
    sonde_contact_join(state, v[1], v[2]);
    state->contact.area_m2 += clip.area_m2;
    state->contact.volume_m3 += clip.volume_m3;
  }
}

// One force per region spread by projected area w_i = g_i.k / A; its matrix is the rank-one term
// kappa A (w k)(w k)^T, of which the rows' own blocks hold their part.
static void push_regions(sonde_state *state, sonde_batches *body) {
  double kappa = state->def.contact_stiffness_n_m3, mu = state->def.contact_damping_n_s_m3;
  uint32_t used = 0;
  for (uint32_t r = 0; r < state->contact.region_count; ++r) {
    const sonde_contact_region *region = &state->contact.region[r];
    double push = kappa * region->volume_m3 + mu * region->volume_rate_m3_s;
    if (!(push > 0) || !(region->area_m2 > 0)) continue;
    sonde_region_push *to = &body->region_push[body->region_push_count++];
    to->region = r, to->first = used, to->push_n = push;
    to->scale = region->area_m2 * ((double)body->step.stiffness_scale * kappa +
                                   (double)body->step.damping_scale * mu);
    to->gain = region->area_m2 * (double)body->probe.gain;
    for (uint32_t k = 0; k < state->touched_count; ++k) {
      uint32_t i = state->touched[k], row = i % SONDE_BATCH;
      if (sonde_contact_region_of(state, i) != r) continue;
      double weight = v_dot(state->gradient[i], region->direction) / region->area_m2;
      sonde_vec3 g = v_scale(region->direction, weight);
      sonde_batch_contact *contact = contact_at(body, i / SONDE_BATCH);
      const double n[3] = {g.x, g.y, g.z};
      for (int c = 0, at = 0; c < 3; ++c) {
        contact->force[c][row] -= (real)(push * n[c]);
        for (int d = c; d < 3; ++d, ++at)
          contact->block[at][row] += (real)(to->scale * n[c] * n[d]);
      }
      body->region_row[used] = i;
      body->region_weight[used++] = g;
    }
    to->count = used - to->first;
  }
}

static void find_pushes(sonde_state *state, sonde_batches *body) {
  if (by_nodes(state)) {
    for (uint32_t k = 0; k < body->near_probe_count; ++k)
      push_batch(state, body, body->near_probe[k]);
    return;
  }
  body->kernels->locate(body);
  mark_faces(body);
  for (uint32_t word = 0; word <= body->face_batch_count / 64; ++word)
    for (uint64_t rest = body->face_marked[word]; rest; rest &= rest - 1) {
      uint32_t index = word * 64 + (uint32_t)__builtin_ctzll(rest);
      if (body->face_code[index] != 0) continue;
      if (state->def.contact_law == SONDE_CONTACT_VOLUME)
        clip_batch(state, body, index);
      else
        push_batch(state, body, index);
    }
}

void sonde_batches_detect(sonde_state *state, sonde_batches *body, const sonde_probe *probe,
                          sonde_pose pose, const sonde_motion *motion) {
  double reach = state->def.implicitness * state->def.dt_s;
  // Nothing is touched, nothing is near.
  sonde_contact_forget(state);
  for (uint32_t k = 0; k < body->near_probe_count; ++k) {
    real *first = body->probe_place + (size_t)body->near_probe[k] * SONDE_BATCH * SONDE_QUAD;
    for (int l = 0; l < SONDE_BATCH; ++l) first[l * SONDE_QUAD + 3] = 0;
    body->touched_rows[body->near_probe[k]] = 0;
  }
  for (uint32_t k = 0; k < body->contact_count; ++k) body->contact_of[body->contact_batch[k]] = 0;
  body->contact_count = body->coupling_count = body->pushed_count = body->near_probe_count = 0;
  body->region_push_count = 0;
  if (!probe) return;
  // Batches with a node in the probe's box, which for pushes on faces grows by one and a half of
  // their edges, so that all corners of a face that meets the probe are among them.
  sonde_box box = sonde_contact_box(probe, pose);
  real low[3], high[3];
  set_vector(low, box.low);
  set_vector(high, box.high);
  body->kernels->near(body, low, high, by_nodes(state) ? 0 : (real)1.5);
  sonde_contact_place(state, probe, pose);
  set_probe(state, body, &box, motion);
  find_pushes(state, body);
  // The touched nodes, ascending as the batches near the probe are; where they are evaluated, and
  // their velocities.
  for (uint32_t k = 0; k < body->near_probe_count; ++k) {
    uint32_t s = body->near_probe[k];
    const sonde_batch *at = &body->batch[s];
    for (uint32_t rest = body->touched_rows[s]; rest; rest &= rest - 1) {
      uint32_t l = (uint32_t)__builtin_ctz(rest), i = s * SONDE_BATCH + l;
      state->touched[state->touched_count++] = i;
      state->velocity[i] = sonde_batch_vector(at->ve, l);
      state->position[i] = v_add(state->nodes.rest[i], sonde_batch_vector(at->u, l));
      state->probed[i] = v_madd(state->position[i], reach, state->velocity[i]);
    }
  }
  SONDE_ASSERT(state->touched_count <= body->common.node_count);
  if (by_nodes(state)) sonde_nodes_join(state);
  sonde_contact_regions(state, motion);
  if (state->def.contact_law == SONDE_CONTACT_VOLUME) push_regions(state, body);
}

void sonde_batches_couple(sonde_batches *body, const real *vectors) {
  body->kernels->couple_corners(body, vectors);
  for (uint32_t k = 0; k < body->region_push_count; ++k) {
    const sonde_region_push *push = &body->region_push[k];
    double sum = 0;
    for (uint32_t j = push->first; j < push->first + push->count; ++j) {
      const real *z = vectors + (size_t)body->region_row[j] * SONDE_QUAD;
      sum += v_dot(body->region_weight[j], vec3((double)z[0], (double)z[1], (double)z[2]));
    }
    for (uint32_t j = push->first; j < push->first + push->count; ++j) {
      uint32_t row = body->region_row[j];
      const real *z = vectors + (size_t)row * SONDE_QUAD;
      sonde_vec3 g = body->region_weight[j];
      double own = v_dot(g, vec3((double)z[0], (double)z[1], (double)z[2]));
      sonde_vec3 taken = v_scale(g, push->scale * (own - sum));
      quad *to = &contact_at(body, row / SONDE_BATCH)->product[row % SONDE_BATCH];
      (*to)[0] += (real)taken.x, (*to)[1] += (real)taken.y, (*to)[2] += (real)taken.z;
    }
  }
}

// The forces of regions at the end of the step; the direction and its spread stay.
static void advance_regions(sonde_state *state, const sonde_batches *body) {
  for (uint32_t k = 0; k < body->region_push_count; ++k) {
    const sonde_region_push *push = &body->region_push[k];
    double faster = 0;
    for (uint32_t j = push->first; j < push->first + push->count; ++j) {
      uint32_t i = body->region_row[j];
      faster += v_dot(body->region_weight[j],
                      sonde_batch_vector(body->batch[i / SONDE_BATCH].x, i % SONDE_BATCH));
    }
    double end = fmax(push->push_n + push->gain * faster, 0);
    for (uint32_t j = push->first; j < push->first + push->count; ++j)
      state->contact_force[body->region_row[j]] = v_scale(body->region_weight[j], -end);
  }
}

double sonde_batches_advance_contact(sonde_state *state, sonde_batches *body, bool surprise) {
  const sonde_kernels *kernels = body->kernels;
  bool nodes = by_nodes(state);
  double sum2 = 0;
  SONDE_ASSERT(body->pushed_count == 0 || state->touched_count > 0);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    state->contact_force[i] = state->surprise[i] = vec3(0, 0, 0);
  }
  if (state->def.contact_law == SONDE_CONTACT_VOLUME) {
    advance_regions(state, body);
    return body->region_push_count > 0 ? INFINITY : 0; // what the law meets there is not known
  }
  if (!nodes) kernels->locate_moves(body);
  for (uint32_t k = 0; k < body->pushed_count; ++k) {
    const sonde_pushed_batch *at = &body->pushed[k];
    const sonde_advance_corners *from = body->advance_corners;
    (nodes ? kernels->advance_nodes : kernels->advance_faces)(body, at, surprise,
                                                              body->advance_corners);
    for (uint32_t rest = at->inside; rest; rest &= rest - 1) {
      uint32_t l = (uint32_t)__builtin_ctz(rest), v[3] = {at->index * SONDE_BATCH + l};
      if (!nodes) corners_of(body, at->index, l, v);
      for (int c = 0; c < (nodes ? 1 : 3); ++c) {
        sonde_vec3 *force = &state->contact_force[v[c]], *off = &state->surprise[v[c]];
        *force = v_add(*force, sonde_batch_vector(from->force[c], l));
        if (surprise) *off = v_add(*off, sonde_batch_vector(from->surprise[c], l));
      }
    }
  }
  for (uint32_t k = 0; surprise && k < state->touched_count; ++k)
    sum2 += v_norm2(state->surprise[state->touched[k]]);
  return sum2;
}
