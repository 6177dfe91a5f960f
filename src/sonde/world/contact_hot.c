// Contact of the convex probe with the deformed skin (docs/world.md), every step.
// refit:    boxes of runs of faces; far ones in turn, near ones each step.
// detect:   clips candidate faces, gathers V_i and g_i per node, joins regions by union-find.
// apply:    regions, pushes of the chosen law, terms of the implicit matrix.
// advance:  the pushes at the end of the step by the same linearisation.
// wrench:   force and torque on the probe, region by region.
// carries:  whether the probe holds skin that rests elsewhere.
#include "world/contact.h"
#include "world/state.h"

#include "base/base.h"
#include "geometry/internal.h"

static const double STEEP_WEIGHT = 4;

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
  sonde_vec3 a = state->probed[v[0]], b = state->probed[v[1]], c = state->probed[v[2]];
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
void sonde_contact_join(sonde_state *state, uint32_t a, uint32_t b) {
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
  state->touched[state->touched_count++] = i;
}

// The plane of the depth of a point inside the probe: the least weighted distance. Planes steeper
// than 60 degrees to the beam count four times farther: a probe that sinks in deeper than it is
// wide still pushes back along its face. SONDE_OUTSIDE outside, and where the nearest surface faces
// backwards: skin gets there only when a narrow probe slips through between nodes, and a push from
// there would draw the probe deeper.
static uint16_t nearest_plane(const sonde_state *state, sonde_vec3 x) {
  double least = INFINITY;
  uint32_t best = 0;
  for (uint32_t k = 0; k < state->plane_count; ++k) {
    double t = plane_depth(state, k, x);
    if (t <= 0) return SONDE_OUTSIDE;
    if (t < least) least = t, best = k;
  }
  return pushes_forward(state, plane_slope(state, best)) ? (uint16_t)best : SONDE_OUTSIDE;
}

bool sonde_contact_depth(const sonde_state *state, sonde_vec3 x, double *depth, sonde_vec3 *slope) {
  if (state->ball_radius > 0) {
    sonde_vec3 d = v_sub(state->ball_centre, x);
    double distance2 = v_norm2(d), radius = state->ball_radius;
    if (distance2 >= radius * radius) return false;
    *depth = radius - sqrt(distance2);
    *slope = v_unit(d, v_scale(state->inward, -1));
    return pushes_forward(state, *slope);
  }
  uint16_t plane = nearest_plane(state, x);
  if (plane == SONDE_OUTSIDE) return false;
  *depth = plane_depth(state, plane, x);
  *slope = plane_slope(state, plane);
  return true;
}

// Integration points of a face: the centres of its four congruent parts, each a quarter of the rest
// area. With the rest area as measure the elastic pushes have the energy kappa/2 sum A t^2, whose
// Hessian kappa A (grad t)(grad t)^T is exact.
static const double POINT[SONDE_POINTS][3] = {{1.0 / 3, 1.0 / 3, 1.0 / 3},
                                              {2.0 / 3, 1.0 / 6, 1.0 / 6},
                                              {1.0 / 6, 2.0 / 3, 1.0 / 6},
                                              {1.0 / 6, 1.0 / 6, 2.0 / 3}};

static sonde_vec3 blend(const sonde_vec3 *field, const uint32_t *v, const double *weight) {
  sonde_vec3 sum = v_scale(field[v[0]], weight[0]);
  return v_madd(v_madd(sum, weight[1], field[v[1]]), weight[2], field[v[2]]);
}

// Planes of a face's points, kept for its pushes; true when a point is inside the probe.
static bool find_planes(sonde_state *state, uint32_t face) {
  const uint32_t *v = state->model->surface.faces[face];
  bool inside = false;
  for (int q = 0; q < SONDE_POINTS; ++q) {
    uint16_t plane = nearest_plane(state, blend(state->probed, v, POINT[q]));
    state->point_planes[face][q] = plane;
    inside |= plane != SONDE_OUTSIDE;
  }
  return inside;
}

static void clip_face(sonde_state *state, uint32_t face) {
  const uint32_t *v = state->model->surface.faces[face];
  const sonde_vec3 corners[3] = {state->probed[v[0]], state->probed[v[1]], state->probed[v[2]]};
  sonde_clip_result clip;
  if (!sonde_clip_triangle(state->plane_normal, state->plane_offset, state->plane_count, corners,
                           state->inward, &clip))
    return;
  if (!(clip.area_m2 > 0)) return;
  for (int k = 0; k < 3; ++k) touch(state, v[k]);
  for (int k = 0; k < 3; ++k) {
    state->share_m3[v[k]] += clip.share_m3[k];
    state->gradient[v[k]] = v_add(state->gradient[v[k]], clip.gradient[k]);
  }
  sonde_contact_join(state, v[0], v[1]);
  sonde_contact_join(state, v[1], v[2]);
  state->touched_faces[state->touched_face_count++] = face;
  if (state->def.contact_law == SONDE_CONTACT_FOUNDATION) find_planes(state, face);
  state->contact.area_m2 += clip.area_m2;
  state->contact.volume_m3 += clip.volume_m3;
}

sonde_box sonde_contact_box(const sonde_probe *probe, sonde_pose pose) {
  sonde_mat3 r = q_matrix(pose.rotation);
  sonde_box box = {vec3(INFINITY, INFINITY, INFINITY), vec3(-INFINITY, -INFINITY, -INFINITY)};
  for (uint32_t k = 0; k < probe->body.hull.vertex_count; ++k) {
    sonde_vec3 p = v_add(m_mul_v(r, probe->body.hull.vertices[k]), pose.position);
    box.low = v_min(box.low, p);
    box.high = v_max(box.high, p);
  }
  return box;
}

void sonde_contact_place(sonde_state *state, const sonde_probe *probe, sonde_pose pose) {
  const sonde_convex *body = &probe->body;
  SONDE_ASSERT(body->plane_count <= SONDE_MAX_PROBE_PLANES);
  sonde_mat3 r = q_matrix(pose.rotation);
  state->inward = m_mul_v(r, vec3(0, 0, 1));
  state->origin = pose.position;
  state->ball_radius = state->def.contact_law == SONDE_CONTACT_NODES ? probe->ball_radius_m : 0;
  state->ball_centre = v_madd(pose.position, -probe->ball_radius_m, state->inward);
  state->plane_count = state->ball_radius > 0 ? 0 : body->plane_count;
  for (uint32_t k = 0; k < state->plane_count; ++k) {
    state->plane_normal[k] = m_mul_v(r, body->plane_normal[k]);
    state->plane_offset[k] = body->plane_offset_m[k] + v_dot(state->plane_normal[k], pose.position);
    state->plane_weight[k] = body->plane_normal[k].z > 0.5 ? 1 : STEEP_WEIGHT;
  }
}

void sonde_contact_forget(sonde_state *state) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    state->share_m3[i] = 0;
    state->gradient[i] = state->contact_force[i] = vec3(0, 0, 0);
  }
  state->touched_count = state->touched_face_count = 0;
  state->term_count = 0;
  state->contact = (sonde_contact){0};
}

void sonde_contact_clear(sonde_state *state) {
  sonde_contact_forget(state);
  sonde_friction_release(state);
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

static void clip_block(sonde_state *state, uint32_t block, const sonde_box *box) {
  uint32_t first = block * SONDE_FACES_PER_BLOCK, end = first + SONDE_FACES_PER_BLOCK;
  if (end > state->model->surface.face_count) end = state->model->surface.face_count;
  for (uint32_t k = first; k < end; ++k) {
    sonde_box face = face_box(state, state->face_order[k]);
    if (overlap(&face, box)) clip_face(state, state->face_order[k]);
  }
}

// Boxes of runs of faces: a node moves less than 1 mm per tick, so that those farther from the
// probe than that times the period may be old.
static void search_blocks(sonde_state *state, const sonde_probe *probe, const sonde_box *box) {
  sonde_box near = probe ? grown(*box, 1e-3 * SONDE_REFIT_PERIOD) : *box;
  uint32_t turn = (uint32_t)(state->tick % SONDE_REFIT_PERIOD);
  for (uint32_t b = 0; b < state->block_count; ++b) {
    bool close = overlap(&state->boxes[b], &near);
    if (close || b % SONDE_REFIT_PERIOD == turn) refit(state, b);
    if (close && overlap(&state->boxes[b], box)) clip_block(state, b, box);
  }
}

void sonde_contact_detect(sonde_state *state, const sonde_probe *probe, sonde_pose pose) {
  sonde_contact_forget(state);
  sonde_box box = {vec3(INFINITY, INFINITY, INFINITY), vec3(-INFINITY, -INFINITY, -INFINITY)};
  if (probe) {
    box = sonde_contact_box(probe, pose);
    sonde_contact_place(state, probe, pose);
  }
  if (state->def.contact_law == SONDE_CONTACT_NODES) {
    if (probe) sonde_nodes_detect(state, &box);
  } else {
    search_blocks(state, probe, &box);
  }
  sort_touched(state);
  sonde_contact_wake(state);
}

void sonde_contact_wake(sonde_state *state) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    state->lists_stale |= !state->awake[state->touched[k]];
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
  sonde_vec3 arm = v_sub(state->probed[i], probe->origin);
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

void sonde_contact_regions(sonde_state *state, const sonde_motion *probe) {
  number_regions(state);
  sum_regions(state, probe);
}

// The push acts against the slope of the depth: out of the probe.
static void spread_push(sonde_state *state, const uint32_t *v, const double *weight,
                        sonde_vec3 slope, double push) {
  for (int k = 0; k < 3; ++k)
    state->contact_force[v[k]] = v_madd(state->contact_force[v[k]], -push * weight[k], slope);
}

static void add_point_terms(sonde_state *state, uint32_t face, const double *weight,
                            sonde_vec3 slope, double scale) {
  const uint32_t *v = state->model->surface.faces[face];
  for (int k = 0; k < 3; ++k) {
    uint32_t i = v[k], e = state->model->face_edge[face][(k + 2) % 3]; // of k and k + 1
    state->matrix->diagonal[i] =
        m_add(state->matrix->diagonal[i], m_rank1(slope, scale * weight[k] * weight[k], 0));
    state->matrix->upper[e] =
        m_add(state->matrix->upper[e], m_rank1(slope, scale * weight[k] * weight[(k + 1) % 3], 0));
  }
}

// A point of a face inside the probe: pressure kappa t + mu dt/dt times its area, never a pull,
// with dt/dt = slope . relative velocity.
typedef struct pressed_point {
  sonde_vec3 slope;
  double push_n, stiffness_n_m, damping_n_s_m;
} pressed_point;

static bool pressed_at(const sonde_state *state, uint32_t face, int point,
                       const sonde_motion *probe, pressed_point *at) {
  const uint32_t *v = state->model->surface.faces[face];
  const double *weight = POINT[point];
  uint16_t plane = state->point_planes[face][point];
  if (plane == SONDE_OUTSIDE) return false;
  sonde_vec3 x = blend(state->probed, v, weight);
  double area = state->model->face_area_m2[face] / SONDE_POINTS;
  at->slope = plane_slope(state, plane);
  at->stiffness_n_m = state->def.contact_stiffness_n_m3 * area;
  at->damping_n_s_m = state->def.contact_damping_n_s_m3 * area;
  sonde_vec3 carried = v_add(probe->velocity, v_cross(probe->spin, v_sub(x, probe->origin)));
  double rate = v_dot(at->slope, v_sub(blend(state->velocity, v, weight), carried));
  at->push_n = at->stiffness_n_m * plane_depth(state, plane, x) + at->damping_n_s_m * rate;
  return at->push_n > 0;
}

static void press_point(sonde_state *state, uint32_t face, int point, const sonde_motion *probe,
                        const sonde_contact_scales *scales) {
  pressed_point at;
  if (!pressed_at(state, face, point, probe, &at)) return;
  const double *weight = POINT[point];
  spread_push(state, state->model->surface.faces[face], weight, at.slope, at.push_n);
  double scale = scales->stiffness * at.stiffness_n_m + scales->damping * at.damping_n_s_m;
  add_point_terms(state, face, weight, at.slope, scale);
}

static void apply_foundation(sonde_state *state, const sonde_motion *probe,
                             const sonde_contact_scales *scales) {
  for (uint32_t k = 0; k < state->touched_face_count; ++k)
    for (int q = 0; q < SONDE_POINTS; ++q)
      press_point(state, state->touched_faces[k], q, probe, scales);
}

// Packs w_i k of one region behind the ones before.
static void pack_region(sonde_state *state, uint32_t r, uint32_t *used, sonde_rank_one *term) {
  const sonde_contact_region *region = &state->contact.region[r];
  term->count = 0;
  term->rows = state->lumped_rows + *used;
  term->g = state->lumped + *used;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    if (region_of(state, i) != r) continue;
    double weight = v_dot(state->gradient[i], region->direction) / region->area_m2;
    state->lumped_rows[*used] = i;
    state->lumped[*used] = v_scale(region->direction, weight);
    (*used)++;
    term->count++;
  }
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
    pack_region(state, r, &used, term);
    term->scale = region->area_m2 * (scales->stiffness * kappa + scales->damping * mu);
    for (uint32_t k = 0; k < term->count; ++k) {
      uint32_t i = term->rows[k];
      double weight = v_dot(term->g[k], region->direction);
      state->contact_force[i] = v_scale(region->direction, -weight * push);
    }
  }
}

void sonde_contact_apply(sonde_state *state, const sonde_motion *probe,
                         const sonde_contact_scales *scales) {
  sonde_contact_regions(state, probe);
  if (state->def.contact_law == SONDE_CONTACT_VOLUME)
    apply_lumped(state, scales);
  else if (state->def.contact_law == SONDE_CONTACT_NODES)
    sonde_nodes_apply(state, probe, scales);
  else
    apply_foundation(state, probe, scales);
}

// The same point at the end of the step: the linearised push with the step's own moves.
static void advance_point(sonde_state *state, uint32_t face, int point, const sonde_motion *probe,
                          double lambda, double h) {
  const uint32_t *v = state->model->surface.faces[face];
  pressed_point at;
  if (!pressed_at(state, face, point, probe, &at)) return;
  double along = lambda * v_dot(at.slope, blend(state->increment, v, POINT[point]));
  double push = at.push_n + along * (lambda * h * at.stiffness_n_m + at.damping_n_s_m);
  if (push > 0) spread_push(state, v, POINT[point], at.slope, push);
}

static void advance_foundation(sonde_state *state, const sonde_motion *probe, double lambda,
                               double h) {
  for (uint32_t k = 0; k < state->touched_count; ++k)
    state->contact_force[state->touched[k]] = vec3(0, 0, 0);
  for (uint32_t k = 0; k < state->touched_face_count; ++k)
    for (int q = 0; q < SONDE_POINTS; ++q)
      advance_point(state, state->touched_faces[k], q, probe, lambda, h);
}

// Linear change of the lumped force when its weighted point changes its velocity by lambda dv.
static double push_change(const sonde_state *state, double area, double dv, double lambda,
                          double h) {
  return area * lambda * dv *
         (state->def.contact_stiffness_n_m3 * lambda * h + state->def.contact_damping_n_s_m3);
}

static void advance_lumped(sonde_state *state, double lambda, double h) {
  for (uint32_t t = 0; t < state->term_count; ++t) {
    const sonde_rank_one *term = &state->term[t];
    const sonde_contact_region *region = &state->contact.region[region_of(state, term->rows[0])];
    double dv = 0, push = 0;
    for (uint32_t k = 0; k < term->count; ++k) {
      dv += v_dot(term->g[k], state->increment[term->rows[k]]);
      push -= v_dot(region->direction, state->contact_force[term->rows[k]]);
    }
    push += push_change(state, region->area_m2, dv, lambda, h);
    if (push < 0) push = 0;
    for (uint32_t k = 0; k < term->count; ++k)
      state->contact_force[term->rows[k]] = v_scale(term->g[k], -push);
  }
}

void sonde_contact_advance(sonde_state *state, const sonde_motion *probe, double lambda, double h) {
  if (state->def.contact_law == SONDE_CONTACT_VOLUME)
    advance_lumped(state, lambda, h);
  else if (state->def.contact_law == SONDE_CONTACT_NODES)
    sonde_nodes_advance(state, probe, lambda, h);
  else
    advance_foundation(state, probe, lambda, h);
}

void sonde_contact_wrench(sonde_state *state, sonde_vec3 origin) {
  sonde_contact *contact = &state->contact;
  contact->force_n = contact->torque_n_m = vec3(0, 0, 0);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_contact_region *region = &contact->region[region_of(state, i)];
    sonde_vec3 f = state->contact_force[i], arm = v_sub(state->probed[i], origin);
    contact->force_n = v_sub(contact->force_n, f);
    contact->torque_n_m = v_sub(contact->torque_n_m, v_cross(arm, f));
    double push = -v_dot(f, region->direction);
    if (!(push > 0)) push = 0;
    region->force_n += push;
    region->centre_m = v_madd(region->centre_m, push, state->probed[i]);
    double area = v_dot(state->gradient[i], region->direction);
    double depth = area > 0 ? state->share_m3[i] / area : 0;
    if (depth > region->depth_max_m) region->depth_max_m = depth;
  }
  for (uint32_t r = 0; r < contact->region_count; ++r)
    if (contact->region[r].force_n > 0)
      contact->region[r].centre_m =
          v_scale(contact->region[r].centre_m, 1.0 / contact->region[r].force_n);
}

static double distance_to_box(const sonde_box *box, sonde_vec3 p) {
  return v_norm(v_sub(p, v_max(box->low, v_min(box->high, p))));
}

// Greatest and least distance from the box around the probe to where the skin that it pushes rests.
bool sonde_contact_carries(const sonde_state *state, const sonde_probe *probe, sonde_pose pose) {
  double most = 0, least = INFINITY;
  sonde_box box = sonde_contact_box(probe, pose);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    if (!(v_norm2(state->contact_force[i]) > 0)) continue;
    double distance = distance_to_box(&box, state->model->surface.vertices[i]);
    most = fmax(most, distance);
    least = fmin(least, distance);
  }
  return most > SONDE_CARRIED_M || (least > SONDE_CAUGHT_M && isfinite(least));
}
