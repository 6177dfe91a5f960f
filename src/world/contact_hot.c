// Contact of the convex probe with the deformed skin (physics.md 2c), every step.
// refit:    boxes of runs of faces; far ones in turn, near ones each step.
// detect:   clips candidate faces, gathers V_i and g_i per node, joins regions by union-find.
// apply:    regions, pushes of eq. (2), terms of the implicit matrix.
// advance:  the pushes at the end of the step by the same linearisation.
// wrench:   force and torque on the probe, region by region.
#include "world/state.h"

#include "base/base.h"
#include "base/maths.h"

static sonde_vec3 v_min(sonde_vec3 a, sonde_vec3 b) {
  return vec3(a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z);
}
static sonde_vec3 v_max(sonde_vec3 a, sonde_vec3 b) {
  return vec3(a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y, a.z > b.z ? a.z : b.z);
}
static bool overlap(const sonde_box *a, const sonde_box *b) {
  return a->low.x <= b->high.x && b->low.x <= a->high.x && a->low.y <= b->high.y &&
         b->low.y <= a->high.y && a->low.z <= b->high.z && b->low.z <= a->high.z;
}
static sonde_box grown(sonde_box box, double margin) {
  sonde_vec3 m = vec3(margin, margin, margin);
  return (sonde_box){v_sub(box.low, m), v_add(box.high, m)};
}

static sonde_box face_box(const sonde_state *state, uint32_t face) {
  const uint32_t *v = state->model->surface.faces[face];
  sonde_vec3 a = state->position[v[0]], b = state->position[v[1]], c = state->position[v[2]];
  return (sonde_box){v_min(v_min(a, b), c), v_max(v_max(a, b), c)};
}

static void refit(sonde_state *state, uint32_t block) {
  uint32_t first = block * SONDE_FACES_PER_BLOCK, end = first + SONDE_FACES_PER_BLOCK;
  if (end > state->model->surface.face_count) end = state->model->surface.face_count;
  sonde_box box = face_box(state, state->face_order[first]);
  for (uint32_t k = first + 1; k < end; ++k) {
    sonde_box face = face_box(state, state->face_order[k]);
    box.low = v_min(box.low, face.low);
    box.high = v_max(box.high, face.high);
  }
  state->boxes[block] = box;
}

static uint32_t root(sonde_state *state, uint32_t i) {
  while (state->parent[i] != i) {
    state->parent[i] = state->parent[state->parent[i]];
    i = state->parent[i];
  }
  return i;
}

// The smaller index becomes the root: regions are numbered by their first node.
static void join(sonde_state *state, uint32_t a, uint32_t b) {
  uint32_t x = root(state, a), y = root(state, b);
  if (x < y)
    state->parent[y] = x;
  else
    state->parent[x] = y;
}

static void touch(sonde_state *state, uint32_t i) {
  const sonde_vec3 *g = &state->gradient[i];
  if (state->share_m3[i] != 0 || g->x != 0 || g->y != 0 || g->z != 0) return;
  state->parent[i] = i;
  state->overlap[i] = m_zero();
  state->touched[state->touched_count++] = i;
}

static void touch_pair(sonde_state *state, uint32_t e) {
  if (state->has_pair[e]) return;
  state->has_pair[e] = 1;
  state->pair_overlap[e] = m_zero();
  state->touched_edges[state->touched_edge_count++] = e;
}

// Adds one clipped face. With m = n/(n.e), e against the columns, the energy kappa/2 times the
// integral of t^2 over the footprint has the gradient kappa V_i m per node and, to first order in
// t, the Hessian kappa (integral phi_i phi_j) m m^T.
static void add_face(sonde_state *state, uint32_t face, const sonde_vec3 corners[3],
                     const sonde_clip_result *clip) {
  const uint32_t *v = state->model->surface.faces[face];
  sonde_vec3 area = v_cross(v_sub(corners[1], corners[0]), v_sub(corners[2], corners[0]));
  double facing = -v_dot(area, state->inward);
  // Faces that turn away or stand on edge carry volume but cannot push.
  sonde_vec3 m = facing > 0.05 * v_norm(area) ? v_neg(state->inward) : vec3(0, 0, 0);
  for (int k = 0; k < 3; ++k) {
    touch(state, v[k]);
    touch_pair(state, state->face_edges[face][k]);
  }
  for (int k = 0; k < 3; ++k) {
    uint32_t i = v[k], e = state->face_edges[face][k];
    state->share_m3[i] += clip->share_m3[k];
    state->gradient[i] = v_add(state->gradient[i], clip->gradient[k]);
    state->push_m3[i] += clip->push_m3[k];
    state->lift[i] = v_madd(state->lift[i], clip->push_m3[k], m);
    state->overlap[i] = m_add(state->overlap[i], m_rank1(m, clip->overlap_m2[k], 0));
    state->pair_overlap[e] = m_add(state->pair_overlap[e], m_rank1(m, clip->overlap_m2[3 + k], 0));
  }
  join(state, v[0], v[1]);
  join(state, v[1], v[2]);
  state->contact.area_m2 += clip->area_m2;
  state->contact.volume_m3 += clip->volume_m3;
}

static void clip_face(sonde_state *state, uint32_t face, uint32_t planes) {
  const uint32_t *v = state->model->surface.faces[face];
  const sonde_vec3 corners[3] = {state->position[v[0]], state->position[v[1]],
                                 state->position[v[2]]};
  sonde_clip_result clip;
  if (!sonde_clip_triangle(state->plane_normal, state->plane_offset, planes, corners, state->inward,
                           state->wall_factor, &clip))
    return;
  if (clip.area_m2 > 0) add_face(state, face, corners, &clip);
}

// Planes of the probe in the world frame and its box.
static sonde_box place_probe(sonde_state *state, const sonde_probe *probe, sonde_pose pose) {
  const sonde_convex *body = &probe->body;
  SONDE_ASSERT(body->plane_count <= state->plane_capacity);
  sonde_mat3 r = q_matrix(pose.rotation);
  for (uint32_t k = 0; k < body->plane_count; ++k) {
    state->plane_normal[k] = m_mul_v(r, body->plane_normal[k]);
    state->plane_offset[k] = body->plane_offset_m[k] + v_dot(state->plane_normal[k], pose.position);
  }
  sonde_box box = {vec3(INFINITY, INFINITY, INFINITY), vec3(-INFINITY, -INFINITY, -INFINITY)};
  for (uint32_t k = 0; k < body->hull.vertex_count; ++k) {
    sonde_vec3 p = v_add(m_mul_v(r, body->hull.vertices[k]), pose.position);
    box.low = v_min(box.low, p);
    box.high = v_max(box.high, p);
  }
  return box;
}

static void forget(sonde_state *state) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    state->share_m3[i] = state->push_m3[i] = state->push_n[i] = 0;
    state->pushed[i] = 0;
    state->gradient[i] = state->lift[i] = state->contact_force[i] = vec3(0, 0, 0);
  }
  for (uint32_t k = 0; k < state->touched_edge_count; ++k)
    state->has_pair[state->touched_edges[k]] = 0;
  state->touched_count = state->touched_edge_count = 0;
  state->term_count = 0;
  state->contact = (sonde_contact){0};
}

void sonde_contact_clear(sonde_state *state) {
  forget(state);
  for (uint32_t b = 0; b < state->block_count; ++b) refit(state, b);
}

// Touched nodes in ascending order, so that every later sum has one order (insertion sort over
// nearly sorted runs would be quadratic: shell sort).
static void sort_touched(sonde_state *state) {
  uint32_t *list = state->touched, count = state->touched_count;
  for (uint32_t gap = count / 2; gap > 0; gap /= 2)
    for (uint32_t k = gap; k < count; ++k) {
      uint32_t value = list[k], at = k;
      for (; at >= gap && list[at - gap] > value; at -= gap) list[at] = list[at - gap];
      list[at] = value;
    }
}

static void clip_block(sonde_state *state, uint32_t block, const sonde_box *box, uint32_t planes) {
  uint32_t end = (block + 1) * SONDE_FACES_PER_BLOCK;
  if (end > state->model->surface.face_count) end = state->model->surface.face_count;
  for (uint32_t k = block * SONDE_FACES_PER_BLOCK; k < end; ++k) {
    sonde_box face = face_box(state, state->face_order[k]);
    if (overlap(&face, box)) clip_face(state, state->face_order[k], planes);
  }
}

// Skin beside the probe's walls does not press on its face: points deeper than three times their
// distance to a wall are left out. Where the skin lies so deep in the probe on average that this
// would let it through, every point presses again.
static void choose_wall_factor(sonde_state *state, const sonde_probe *probe) {
  double deepest = 0, width = fmin(probe->half_x_m, probe->half_y_m);
  for (uint32_t r = 0; r < state->contact.region_count; ++r)
    deepest = fmax(deepest, state->contact.region[r].depth_max_m);
  if (deepest > 0.5 * width)
    state->wall_factor = 1e6;
  else if (deepest < 0.25 * width)
    state->wall_factor = 3;
}

void sonde_contact_detect(sonde_state *state, const sonde_probe *probe, sonde_pose pose) {
  if (probe) choose_wall_factor(state, probe);
  forget(state);
  sonde_box box = {vec3(INFINITY, INFINITY, INFINITY), vec3(-INFINITY, -INFINITY, -INFINITY)};
  if (probe) box = place_probe(state, probe, pose);
  // A node moves less than 1 mm per tick: far boxes may be SONDE_REFIT_PERIOD ticks old.
  sonde_box near = probe ? grown(box, 2e-3 * SONDE_REFIT_PERIOD) : box;
  state->inward = q_rotate(pose.rotation, vec3(0, 0, 1));
  uint32_t turn = (uint32_t)(state->tick % SONDE_REFIT_PERIOD);
  for (uint32_t b = 0; b < state->block_count; ++b) {
    bool close = overlap(&state->boxes[b], &near);
    if (close || b % SONDE_REFIT_PERIOD == turn) refit(state, b);
    if (close && overlap(&state->boxes[b], &box))
      clip_block(state, b, &box, probe->body.plane_count);
  }
  sort_touched(state);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    state->awake[state->touched[k]] = 1;
    state->calm[state->touched[k]] = 0;
  }
}

// Region of each touched node; parent[] is overwritten by the region's number + node count, so that
// region(i) is parent[i] - nodes.
static void number_regions(sonde_state *state) {
  sonde_contact *contact = &state->contact;
  uint32_t n = state->model->surface.vertex_count;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k], r = state->parent[i];
    // Ascending order: every smaller node already carries its region's number.
    while (r < n && state->parent[r] != r) r = state->parent[r];
    if (r >= n) {
      state->parent[i] = r;
      continue;
    }
    if (r != i) continue;
    uint32_t number = contact->region_count;
    if (number == SONDE_MAX_REGIONS) {
      state->flags |= SONDE_FLAG_CONTACT_FULL;
      number--;
    } else {
      contact->region_count++;
    }
    state->parent[i] = n + number;
  }
}

static uint32_t region_of(const sonde_state *state, uint32_t i) {
  SONDE_ASSERT(state->parent[i] >= state->model->surface.vertex_count);
  return state->parent[i] - state->model->surface.vertex_count;
}

// Velocity of a node relative to the probe's point at the same place.
static sonde_vec3 relative_velocity(const sonde_state *state, uint32_t i,
                                    const sonde_motion *probe) {
  sonde_vec3 arm = v_sub(state->position[i], probe->origin);
  sonde_vec3 carried = v_add(probe->velocity, v_cross(probe->spin, arm));
  return v_sub(state->velocity[i], carried);
}

// Volume, its rate and the direction k = sum g_i / |sum g_i|: the mean normal of the wetted face.
static void sum_regions(sonde_state *state, const sonde_motion *probe) {
  sonde_contact *contact = &state->contact;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_contact_region *region = &contact->region[region_of(state, i)];
    sonde_vec3 g = state->gradient[i];
    region->volume_m3 += state->share_m3[i];
    region->volume_rate_m3_s += v_dot(g, relative_velocity(state, i, probe));
    region->direction = v_add(region->direction, g);
    region->node_count++;
  }
  for (uint32_t r = 0; r < contact->region_count; ++r) {
    sonde_contact_region *region = &contact->region[r];
    region->area_m2 = v_norm(region->direction);
    region->direction = v_unit(region->direction, vec3(0, 0, 0));
  }
}

static double projected_area(const sonde_state *state, uint32_t i,
                             const sonde_contact_region *region) {
  double area = v_dot(state->gradient[i], region->direction);
  return area > 0 ? area : 0;
}

// The force on the node is along `direction` (against the probe's push); push counts along the
// columns.
static void set_force(sonde_state *state, uint32_t i, sonde_vec3 force) {
  double push = v_dot(force, state->inward);
  state->push_n[i] = push > 0 ? push : 0;
  state->contact_force[i] = push > 0 ? force : vec3(0, 0, 0);
}

// Direction in which a node is pushed, scaled to 1 along the columns.
static sonde_vec3 push_direction(const sonde_state *state, uint32_t i) {
  return state->push_m3[i] > 0 ? v_scale(state->lift[i], 1 / state->push_m3[i]) : vec3(0, 0, 0);
}

static double damped_area(const sonde_state *state, uint32_t i) {
  double area = -v_dot(state->gradient[i], state->inward);
  return area > 0 ? area : 0;
}

// Eq. (2) on the node's own share: (kappa V_i + mu dV_i/dt) along its direction, never a pull.
static void apply_node(sonde_state *state, uint32_t i, const sonde_motion *probe,
                       const sonde_contact_scales *scales) {
  double kappa = state->def.contact_stiffness_n_m3, mu = state->def.contact_damping_n_s_m3;
  sonde_vec3 d = push_direction(state, i);
  double area = damped_area(state, i);
  double rate = area * v_dot(d, relative_velocity(state, i, probe));
  double push = d.x != 0 || d.y != 0 || d.z != 0 ? kappa * state->push_m3[i] + mu * rate : 0;
  state->pushed[i] = push > 0;
  set_force(state, i, v_scale(d, push > 0 ? -push : 0));
  if (!state->pushed[i]) return;
  sonde_mat3 stiffness = m_scale(state->overlap[i], kappa);
  sonde_mat3 damping = m_rank1(d, mu * area, 0);
  state->matrix->diagonal[i] =
      m_add(state->matrix->diagonal[i],
            m_add(m_scale(stiffness, scales->stiffness), m_scale(damping, scales->damping)));
  state->product[i] = v_add(state->product[i], m_mul_v(stiffness, state->velocity[i]));
}

// Terms of a pair of neighbours under the probe.
static void apply_pair(sonde_state *state, uint32_t e, const sonde_contact_scales *scales) {
  uint32_t i = state->model->topology.edges[e][0], j = state->model->topology.edges[e][1];
  if (!state->pushed[i] || !state->pushed[j]) return;
  sonde_mat3 stiffness = m_scale(state->pair_overlap[e], state->def.contact_stiffness_n_m3);
  state->matrix->upper[e] = m_add(state->matrix->upper[e], m_scale(stiffness, scales->stiffness));
  state->product[i] = v_add(state->product[i], m_mul_v(stiffness, state->velocity[j]));
  state->product[j] = v_add(state->product[j], m_mul_v(stiffness, state->velocity[i]));
}

// Each node carries eq. (2) on its own share V_i. The shares add up to the volume, so that the
// force along the columns is eq. (2) of the whole volume wherever no node is clamped; without
// damping the forces have an energy (see add_face).
static void apply_shared(sonde_state *state, const sonde_motion *probe,
                         const sonde_contact_scales *scales) {
  for (uint32_t k = 0; k < state->touched_count; ++k)
    apply_node(state, state->touched[k], probe, scales);
  for (uint32_t k = 0; k < state->touched_edge_count; ++k)
    apply_pair(state, state->touched_edges[k], scales);
}

// Packs w_i k of one region behind the ones before; returns sum w_i k.v_i.
static double pack_region(sonde_state *state, uint32_t r, uint32_t *used, sonde_rank_one *term) {
  const sonde_contact_region *region = &state->contact.region[r];
  double speed = 0;
  term->count = 0;
  term->rows = state->lumped_rows + *used;
  term->g = state->lumped + *used;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    if (region_of(state, i) != r) continue;
    double weight = v_dot(state->gradient[i], region->direction) / region->area_m2;
    state->lumped_rows[*used] = i;
    state->lumped[*used] = v_scale(region->direction, weight);
    speed += v_dot(state->lumped[*used], state->velocity[i]);
    (*used)++;
    term->count++;
  }
  return speed;
}

// One force per region spread by projected area w_i = g_i.k / A; the Jacobian is the rank-one term
// kappa A (w k)(w k)^T.
static void apply_lumped(sonde_state *state, const sonde_contact_scales *scales) {
  double kappa = state->def.contact_stiffness_n_m3, mu = state->def.contact_damping_n_s_m3;
  uint32_t used = 0;
  for (uint32_t r = 0; r < state->contact.region_count; ++r) {
    const sonde_contact_region *region = &state->contact.region[r];
    double push = kappa * region->volume_m3 + mu * region->volume_rate_m3_s;
    if (!(push > 0) || !(region->area_m2 > 0)) continue;
    sonde_rank_one *term = &state->term[state->term_count++];
    double speed = pack_region(state, r, &used, term);
    term->scale = region->area_m2 * (scales->stiffness * kappa + scales->damping * mu);
    for (uint32_t k = 0; k < term->count; ++k) {
      uint32_t i = term->rows[k];
      double weight = v_dot(term->g[k], region->direction);
      set_force(state, i, v_scale(region->direction, -weight * push));
      state->product[i] = v_madd(state->product[i], kappa * region->area_m2 * speed, term->g[k]);
    }
  }
}

void sonde_contact_apply(sonde_state *state, const sonde_motion *probe,
                         const sonde_contact_scales *scales) {
  number_regions(state);
  sum_regions(state, probe);
  if (state->def.contact_law == SONDE_CONTACT_LUMPED)
    apply_lumped(state, scales);
  else
    apply_shared(state, probe, scales);
}

// lambda dx of a node: what the scheme's force evaluation sees of the step.
static sonde_vec3 seen_move(const sonde_state *state, uint32_t i, double lambda, double h) {
  return v_scale(v_madd(state->velocity[i], lambda, state->increment[i]), lambda * h);
}

static void advance_shared(sonde_state *state, double lambda, double h) {
  double kappa = state->def.contact_stiffness_n_m3, mu = state->def.contact_damping_n_s_m3;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_vec3 d = push_direction(state, i);
    double damping = mu * damped_area(state, i) * lambda * v_dot(d, state->increment[i]);
    sonde_vec3 elastic = m_mul_v(state->overlap[i], seen_move(state, i, lambda, h));
    state->change[i] = v_madd(v_scale(elastic, kappa), damping, d);
  }
  for (uint32_t k = 0; k < state->touched_edge_count; ++k) {
    uint32_t e = state->touched_edges[k];
    uint32_t i = state->model->topology.edges[e][0], j = state->model->topology.edges[e][1];
    if (!state->pushed[i] || !state->pushed[j]) continue;
    sonde_mat3 stiffness = m_scale(state->pair_overlap[e], kappa);
    state->change[i] = v_add(state->change[i], m_mul_v(stiffness, seen_move(state, j, lambda, h)));
    state->change[j] = v_add(state->change[j], m_mul_v(stiffness, seen_move(state, i, lambda, h)));
  }
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    if (state->pushed[i]) set_force(state, i, v_sub(state->contact_force[i], state->change[i]));
  }
}

// Linear change of the lumped force when its weighted point moves by dx at dv.
static double push_change(const sonde_state *state, double area, double dx, double dv,
                          double lambda) {
  return area * lambda *
         (state->def.contact_stiffness_n_m3 * dx + state->def.contact_damping_n_s_m3 * dv);
}

static void advance_lumped(sonde_state *state, double lambda, double h) {
  for (uint32_t t = 0; t < state->term_count; ++t) {
    const sonde_rank_one *term = &state->term[t];
    const sonde_contact_region *region = &state->contact.region[region_of(state, term->rows[0])];
    double dx = 0, dv = 0, push = 0;
    for (uint32_t k = 0; k < term->count; ++k) {
      double change = v_dot(term->g[k], state->increment[term->rows[k]]);
      dv += change;
      dx += h * (v_dot(term->g[k], state->velocity[term->rows[k]]) + lambda * change);
      push -= v_dot(region->direction, state->contact_force[term->rows[k]]);
    }
    push += push_change(state, region->area_m2, dx, dv, lambda);
    if (push < 0) push = 0;
    for (uint32_t k = 0; k < term->count; ++k)
      set_force(state, term->rows[k], v_scale(term->g[k], -push));
  }
}

void sonde_contact_advance(sonde_state *state, double lambda, double h) {
  if (state->def.contact_law == SONDE_CONTACT_LUMPED)
    advance_lumped(state, lambda, h);
  else
    advance_shared(state, lambda, h);
}

void sonde_contact_wrench(sonde_state *state, sonde_vec3 origin) {
  sonde_contact *contact = &state->contact;
  contact->force_n = contact->torque_n_m = vec3(0, 0, 0);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_contact_region *region = &contact->region[region_of(state, i)];
    sonde_vec3 f = state->contact_force[i], arm = v_sub(state->position[i], origin);
    contact->force_n = v_sub(contact->force_n, f);
    contact->torque_n_m = v_sub(contact->torque_n_m, v_cross(arm, f));
    region->force_n += state->push_n[i];
    region->centre_m = v_madd(region->centre_m, state->push_n[i], state->position[i]);
    double area = projected_area(state, i, region);
    double depth = area > 0 ? state->share_m3[i] / area : 0;
    if (depth > region->depth_max_m) region->depth_max_m = depth;
  }
  for (uint32_t r = 0; r < contact->region_count; ++r)
    if (contact->region[r].force_n > 0)
      contact->region[r].centre_m =
          v_scale(contact->region[r].centre_m, 1.0 / contact->region[r].force_n);
}
