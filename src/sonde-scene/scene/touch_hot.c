// Contact between any two bodies, every step (docs/scene_theory.md).
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static const sonde_body *body_of(const sonde_scene_state *state, uint32_t b) {
  return &state->scene->bodies[b];
}

// How the slots of a body move a point of a face: a rigid body's centre and spin, or three nodes.
static uint32_t lever(const sonde_scene_state *state, uint32_t b, uint32_t face,
                      const double weight[3], double sign, sonde_grip *grip, int side) {
  SONDE_ASSERT(grip->slot_count <= 3 && face < state->scene->bodies[b].surface.face_count);
  const sonde_body *body = body_of(state, b);
  const uint32_t *vertex = body->surface.faces[face];
  const sonde_vec3 *surface = state->surface + state->surface_first[b];
  sonde_vec3 point = vec3(0, 0, 0);
  for (int k = 0; k < 3; ++k) point = v_madd(point, weight[k], surface[vertex[k]]);
  grip->point[side] = point;
  uint32_t first = grip->slot_count;
  if (sonde_body_is_rigid(body)) {
    grip->slot[first] = body->first_slot;
    grip->weight[first] = sign;
    grip->arm[side] = v_sub(point, state->stage_position[body->first_slot]);
    return first + 1;
  }
  for (uint32_t k = 0; k < 3; ++k) {
    uint32_t node = body->surface_node ? body->surface_node[vertex[k]] : vertex[k];
    grip->slot[first + k] = body->first_slot + node;
    grip->weight[first + k] = sign * weight[k];
  }
  return first + 3;
}

static bool rigid_side(const sonde_scene_state *state, const sonde_grip *grip, int side) {
  const sonde_touch *touch = &state->scene->touches[grip->touch];
  return sonde_body_is_rigid(body_of(state, side ? touch->b : touch->a));
}

// Slots of the two sides: [0, split) move a, the others b.
static uint32_t split_of(const sonde_scene_state *state, const sonde_grip *grip) {
  return rigid_side(state, grip, 0) ? 1 : 3;
}

// What a force at the point is at one of its slots.
static sonde_vec3 part_of(const sonde_grip *grip, uint32_t k, sonde_vec3 force) {
  return v_madd(v_scale(force, grip->weight[k]), -v_dot(grip->tilt[k], force), grip->normal);
}

bool sonde_grip_rows(sonde_scene_state *state, const sonde_grip *grip, sonde_vec3 direction,
                     uint32_t *first, uint32_t *count) {
  uint32_t split = split_of(state, grip), at = *first = state->row_count;
  *count = 0;
  if (at + 8 > state->row_capacity) {
    state->report.flags |= SONDE_SCENE_CONTACT_FULL;
    return false;
  }
  for (uint32_t k = 0; k < grip->slot_count; ++k) {
    int side = k >= split;
    state->rows[at] = grip->slot[k];
    state->g[at++] = part_of(grip, k, direction);
    if (!rigid_side(state, grip, side)) continue;
    state->rows[at] = grip->slot[k] + 1;
    state->g[at++] = v_scale(v_cross(grip->arm[side], direction), grip->weight[k]);
  }
  *count = at - *first;
  state->row_count = at;
  return true;
}

sonde_vec3 sonde_grip_slip(const sonde_scene_state *state, const sonde_grip *grip,
                           const sonde_vec3 *field) {
  uint32_t split = split_of(state, grip);
  sonde_vec3 slip = vec3(0, 0, 0);
  for (uint32_t k = 0; k < grip->slot_count; ++k) {
    int side = k >= split;
    sonde_vec3 v = field[grip->slot[k]];
    if (rigid_side(state, grip, side))
      v = v_add(v, v_cross(field[grip->slot[k] + 1], grip->arm[side]));
    slip = v_madd(v_madd(slip, grip->weight[k], v), -v_dot(v, grip->normal), grip->tilt[k]);
  }
  return slip;
}

void sonde_grip_spread(const sonde_scene_state *state, const sonde_grip *grip, sonde_vec3 force,
                       sonde_vec3 *field) {
  uint32_t split = split_of(state, grip);
  for (uint32_t k = 0; k < grip->slot_count; ++k) {
    int side = k >= split;
    uint32_t s = grip->slot[k];
    field[s] = v_add(field[s], part_of(grip, k, force));
    if (rigid_side(state, grip, side))
      field[s + 1] = v_madd(field[s + 1], grip->weight[k], v_cross(grip->arm[side], force));
  }
}

sonde_push *sonde_push_new(sonde_scene_state *state, uint32_t t) {
  if (state->push_count == state->push_capacity) {
    state->report.flags |= SONDE_SCENE_CONTACT_FULL;
    return NULL;
  }
  sonde_push *push = &state->pushes[state->push_count++];
  *push = (sonde_push){
      .touch = t, .pulls = t == UINT32_MAX, .first_row = state->row_count, .newtons = 1};
  return push;
}

// A point beside a face, by s along the normal n, moves as if a straight line to it stood on the
// face: v = sum w_k v_k - s sum (v_k.n) grad w_k, with the gradient of the weights across n. A
// force f across n is then f w_k - s (f.grad w_k) n at the nodes: f in all, and the torque of f at
// the point. A face that looks across n, or is smaller than s, cannot carry this couple: there the
// point stays nearer to the face.
static void tilt(const sonde_scene_state *state, uint32_t b, uint32_t face, sonde_vec3 to,
                 sonde_grip *grip, int side) {
  static const double STEEPEST = 1;
  const uint32_t *vertex = body_of(state, b)->surface.faces[face];
  const sonde_vec3 *surface = state->surface + state->surface_first[b];
  sonde_vec3 n = grip->normal, edge[3], gradient[3];
  double aside = v_dot(v_sub(to, grip->point[side]), n), steepest = 0;
  for (int k = 0; k < 3; ++k)
    edge[k] = v_sub(surface[vertex[(k + 2) % 3]], surface[vertex[(k + 1) % 3]]);
  double twice_area = v_dot(v_cross(edge[1], edge[2]), n);
  if (!(fabs(twice_area) > 0)) return;
  for (int k = 0; k < 3; ++k) {
    gradient[k] = v_scale(v_cross(n, edge[k]), 1 / twice_area);
    steepest = fmax(steepest, fabs(aside) * v_norm(gradient[k]));
  }
  if (steepest > STEEPEST) aside *= STEEPEST / steepest;
  uint32_t first = side ? grip->slot_count - 3 : 0;
  for (uint32_t k = 0; k < 3; ++k)
    grip->tilt[first + k] = v_scale(gradient[k], (side ? -1 : 1) * aside);
  grip->point[side] = v_madd(grip->point[side], aside, n);
}

// @param push of the point's region; UINT32_MAX: the column pushes by itself
static void add_column(sonde_scene_state *state, uint32_t t, const sonde_overlap_region *region,
                       const sonde_overlap_point *point, uint32_t region_push) {
  const sonde_touch *touch = &state->scene->touches[t];
  if (state->grip_count == state->grip_capacity) {
    state->report.flags |= SONDE_SCENE_CONTACT_FULL;
    return;
  }
  sonde_grip *grip = &state->grips[state->grip_count];
  memset(grip, 0, sizeof *grip);
  grip->touch = t;
  grip->normal = region->direction;
  grip->slot_count = lever(state, touch->a, point->face_a, point->weight_a, 1, grip, 0);
  grip->slot_count = lever(state, touch->b, point->face_b, point->weight_b, -1, grip, 1);
  // The two ends of a column lie a depth apart, and forces across it would turn the bodies. A rigid
  // body is held at the other's end instead, two bodies of one kind half way.
  bool rigid[2] = {rigid_side(state, grip, 0), rigid_side(state, grip, 1)};
  sonde_vec3 middle = v_lerp(grip->point[0], grip->point[1], 0.5);
  const uint32_t body[2] = {touch->a, touch->b}, face[2] = {point->face_a, point->face_b};
  const double *const weight[2] = {point->weight_a, point->weight_b};
  sonde_vec3 other[2] = {grip->point[1], grip->point[0]};
  for (int s = 0; s < 2; ++s) {
    if (!rigid[s] && !rigid[!s]) tilt(state, body[s], face[s], middle, grip, s);
    if (!rigid[s]) continue;
    grip->point[s] = rigid[!s] ? middle : other[s];
    uint32_t centre = body_of(state, body[s])->first_slot;
    grip->arm[s] = v_sub(grip->point[s], state->stage_position[centre]);
  }
  int side = touch->bond_side;
  const uint32_t *vertex = body_of(state, body[side])->surface.faces[face[side]];
  uint32_t bond = touch->mu_static > 0 ? sonde_bonds_of(state, t) : UINT32_MAX;
  grip->bonded = bond != UINT32_MAX;
  for (int k = 0; k < 3 && grip->bonded; ++k) {
    grip->bond[k] = bond + vertex[k];
    grip->bond_weight[k] = weight[side][k];
  }
  grip->push = region_push;
  grip->share = region_push == UINT32_MAX ? 1 : point->area_m2;
  if (region_push == UINT32_MAX) {
    sonde_push *push = sonde_push_new(state, t);
    if (!push || !sonde_grip_rows(state, grip, grip->normal, &push->first_row, &push->row_count))
      return;
    push->value = point->depth_m;
    push->stiffness = touch->stiffness * point->area_m2;
    push->damper = touch->damping * point->area_m2;
    grip->push = state->push_count - 1;
  }
  state->grip_count++;
}

// Rows of the volume's gradient on one side; eq. (2) keeps only its part along the direction.
// @param scale 1 for the energy law, 1/area for eq. (2)
static bool add_rows(sonde_scene_state *state, uint32_t b, const sonde_overlap_entry *entries,
                     uint32_t count, const sonde_vec3 *along, double scale) {
  SONDE_ASSERT(scale > 0);
  const sonde_body *body = body_of(state, b);
  const sonde_vec3 *surface = state->surface + state->surface_first[b];
  bool rigid = sonde_body_is_rigid(body);
  if (state->row_count + (rigid ? 2 : count) > state->row_capacity) {
    state->report.flags |= SONDE_SCENE_CONTACT_FULL;
    return false;
  }
  sonde_vec3 force = vec3(0, 0, 0), torque = force;
  for (uint32_t e = 0; e < count; ++e) {
    sonde_vec3 g = v_scale(entries[e].gradient_m2, scale);
    if (along) g = v_scale(*along, v_dot(g, *along));
    uint32_t vertex = entries[e].vertex;
    if (rigid) {
      sonde_vec3 arm = v_sub(surface[vertex], state->stage_position[body->first_slot]);
      force = v_add(force, g);
      torque = v_add(torque, v_cross(arm, g));
      continue;
    }
    uint32_t node = body->surface_node ? body->surface_node[vertex] : vertex;
    state->rows[state->row_count] = body->first_slot + node;
    state->g[state->row_count++] = g;
  }
  if (rigid) {
    state->rows[state->row_count] = body->first_slot;
    state->g[state->row_count++] = force;
    state->rows[state->row_count] = body->first_slot + 1;
    state->g[state->row_count++] = torque;
  }
  return true;
}

// Energy law: u = V and g = dV/dx. Eq. (2): F = kappa V along the direction, shared by projected
// area; with u = V/area and stiffness kappa * area its slope is the rank-one one of
// docs/scene_theory.md.
static uint32_t add_region(sonde_scene_state *state, uint32_t t, const sonde_overlap_result *found,
                           const sonde_overlap_region *region) {
  const sonde_touch *touch = &state->scene->touches[t];
  bool energy = touch->law == SONDE_TOUCH_ENERGY;
  double area = region->area_m2;
  sonde_push *push = area > 0 ? sonde_push_new(state, t) : NULL;
  if (!push) return UINT32_MAX;
  if (energy) push->newtons = area;
  push->value = energy ? region->volume_m3 : region->volume_m3 / area;
  push->stiffness = energy ? touch->stiffness : touch->stiffness * area;
  push->damper = energy ? touch->damping : touch->damping * area;
  const sonde_vec3 *along = energy ? NULL : &region->direction;
  const uint32_t bodies[2] = {touch->a, touch->b};
  for (int s = 0; s < 2; ++s)
    if (!add_rows(state, bodies[s], found->entries[s] + region->first_entry[s],
                  region->entry_count[s], along, energy ? 1 : 1 / area)) {
      push->stiffness = push->damper = 0;
      break;
    }
  push->row_count = state->row_count - push->first_row;
  return state->push_count - 1;
}

static void find_touch(sonde_scene_state *state, uint32_t t, bool start) {
  const sonde_touch *touch = &state->scene->touches[t];
  sonde_pair_measure *pair = &state->now.pair[t];
  // Large faces of rigid bodies are pushed at three columns per piece, others at one.
  bool rigid = sonde_body_is_rigid(body_of(state, touch->a)) &&
               sonde_body_is_rigid(body_of(state, touch->b));
  sonde_overlap *overlap = state->overlap[rigid && touch->law == SONDE_TOUCH_FOUNDATION];
  if (!sonde_overlap_compute(overlap, state->tree[touch->a], state->tree[touch->b],
                             state->now.hint[t]))
    return;
  const sonde_overlap_result *found = sonde_overlap_get(overlap);
  state->report.contact_tests += found->box_tests + found->face_pairs;
  if (found->flags) state->report.flags |= SONDE_SCENE_CONTACT_FULL;
  pair->volume_m3 = found->volume_m3;
  pair->region_count = found->region_count;
  pair->point_count = found->point_count;
  // The columns of a body that is inside out say nothing: they are left out.
  bool sound = sonde_trouble_overlap(state, t, found, start);
  if (start && sound) sonde_release_notice(state, t, found);
  if (!sound) return;
  if (state->now.release[t] && sonde_release_push(state, t, start)) return;
  // The direction of the largest region is where the next search starts.
  double most = 0;
  for (uint32_t r = 0; r < found->region_count; ++r)
    if (found->regions[r].volume_m3 > most) {
      most = found->regions[r].volume_m3;
      state->found_hint[t] = found->regions[r].direction;
    }
  for (uint32_t r = 0; r < found->region_count; ++r) {
    const sonde_overlap_region *region = &found->regions[r];
    uint32_t push = UINT32_MAX, before = state->grip_count;
    pair->area_m2 += region->area_m2;
    if (region->depth_m > pair->depth_m) pair->depth_m = region->depth_m;
    if (touch->law != SONDE_TOUCH_FOUNDATION) {
      push = add_region(state, t, found, region);
      if (push == UINT32_MAX) continue;
    }
    for (uint32_t k = 0; k < region->point_count; ++k)
      add_column(state, t, region, &found->points[region->first_point + k], push);
    if (push == UINT32_MAX) continue;
    // The region's push is shared out over its columns by their area, in newtons per unit of f.
    double area = 0, newtons = state->pushes[push].newtons;
    for (uint32_t k = before; k < state->grip_count; ++k) area += state->grips[k].share;
    for (uint32_t k = before; k < state->grip_count; ++k)
      state->grips[k].share *= area > 0 ? newtons / area : 0;
  }
}

void sonde_touch_forget(sonde_scene_state *state) {
  state->listed = false;
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    state->fitted[b] = false;
    state->moved_count[b] = UINT32_MAX;
  }
}

// Of a tissue the waking vertices, and those that fell asleep since the last search.
void sonde_touch_surface(sonde_scene_state *state, uint32_t b, const sonde_vec3 *position,
                         const sonde_quat *rotation) {
  const sonde_body *body = &state->scene->bodies[b];
  sonde_vec3 *surface = state->surface + state->surface_first[b];
  const sonde_vec3 *slot = position + body->first_slot;
  if (!body->model || state->moved_count[b] == UINT32_MAX) {
    sonde_surface_at(state, b, position, rotation, surface);
    return;
  }
  SONDE_ASSERT(!body->surface_node);
  const uint32_t *moved = state->moved_faces + state->face_first[b];
  for (uint32_t k = 0; k < 3 * state->moved_count[b]; ++k) {
    uint32_t i = body->surface.faces[moved[k / 3]][k % 3];
    surface[i] = slot[i];
  }
  for (uint32_t r = 0; r < state->part[b].row_count; ++r)
    surface[state->part[b].rows[r]] = slot[state->part[b].rows[r]];
}

// Surface and tree of a body at the stage.
static void fit(sonde_scene_state *state, uint32_t b) {
  const sonde_vec3 *surface = state->surface + state->surface_first[b];
  const sonde_tissue_part *part = &state->part[b];
  uint32_t *moved = state->moved_faces + state->face_first[b];
  bool whole = !state->scene->bodies[b].model || state->moved_count[b] == UINT32_MAX;
  sonde_touch_surface(state, b, state->stage_position, state->stage_rotation);
  if (whole)
    sonde_face_tree_refit(state->tree[b], surface);
  else {
    sonde_face_tree_refit_part(state->tree[b], surface, moved, state->moved_count[b]);
    sonde_face_tree_refit_part(state->tree[b], surface, part->faces, part->face_count);
  }
  if (!state->scene->bodies[b].model) return;
  memcpy(moved, part->faces, part->face_count * sizeof *moved);
  state->moved_count[b] = part->face_count;
}

void sonde_touch_find(sonde_scene_state *state, bool start) {
  const sonde_scene *scene = state->scene;
  state->push_count = state->grip_count = 0;
  state->row_count = state->bulk_row_capacity;
  sonde_pins_push(state);
  sonde_creases_push(state);
  if (!scene->touch_count && !scene->self_nodes) return;
  for (uint32_t k = 0; k < state->near_touch_count; ++k)
    if (!sonde_touch_rests(state, state->near_touch[k]))
      state->now.pair[state->near_touch[k]] = (sonde_pair_measure){0};
  state->near_touch_count = 0;
  // The trees of what moves are fitted; a fixed body's tree was fitted when the state was made.
  for (uint32_t b = 0; b < scene->body_count; ++b) {
    if (!state->tree[b]) continue;
    if (scene->bodies[b].motion != SONDE_BODY_FIXED &&
        !(state->fitted[b] && state->now.asleep[b])) {
      state->fitted[b] = state->now.asleep[b];
      fit(state, b);
    }
    state->bounds[b] = sonde_face_tree_bounds(state->tree[b]);
  }
  sonde_selves_push(state);
  uint32_t count = sonde_sweep_pairs(state->sweep, state->bounds, scene->body_count, state->near,
                                     state->near_capacity, NULL);
  SONDE_ASSERT(count <= state->near_capacity);
  for (uint32_t k = 0; k < count; ++k) {
    uint32_t t = state->touch_of[state->near[k][0] * scene->body_count + state->near[k][1]];
    if (!t || sonde_touch_rests(state, t - 1)) continue;
    state->near_touch[state->near_touch_count++] = t - 1;
    state->found_hint[t - 1] = vec3(0, 0, 0);
    find_touch(state, t - 1, start);
  }
  // What is no longer near another is out of it.
  for (uint32_t t = 0; t < scene->touch_count && start; ++t)
    if (state->now.release[t] && !state->now.pair[t].region_count) state->now.release[t] = 0;
  state->report.touch_points = state->grip_count;
  for (uint32_t k = 0; k < state->grip_count; ++k) sonde_grip_begin(state, &state->grips[k]);
}

static double along_rows(const sonde_scene_state *state, const sonde_push *push,
                         const sonde_vec3 *field) {
  double sum = 0;
  for (uint32_t k = push->first_row; k < push->first_row + push->row_count; ++k)
    sum += v_dot(state->g[k], field[state->rows[k]]);
  return sum;
}

void sonde_touch_evaluate(sonde_scene_state *state, double moved_s) {
  SONDE_ASSERT(moved_s >= 0);
  for (uint32_t k = 0; k < state->push_count; ++k) {
    sonde_push *push = &state->pushes[k];
    double rate = along_rows(state, push, state->stage_velocity);
    push->force = push->stiffness * push->value + push->damper * rate;
    // An attachment may pull; a contact's damping never does.
    push->dropped = !push->pulls && !(push->force > 0);
    if (push->dropped) push->force = 0;
    push->end_force = push->force;
    push->end_value = push->value;
  }
  for (uint32_t k = 0; k < state->grip_count; ++k)
    sonde_grip_evaluate(state, &state->grips[k], moved_s);
}

static void add_term(sonde_scene_state *state, double scale, uint32_t first, uint32_t count) {
  SONDE_ASSERT(first + count <= state->row_capacity);
  if (!(scale > 0)) return;
  if (state->term_count == state->term_capacity) {
    state->report.flags |= SONDE_SCENE_CONTACT_FULL;
    return;
  }
  state->terms[state->term_count++] =
      (sonde_rank_one){scale, count, state->rows + first, state->g + first};
}

void sonde_touch_gather(sonde_scene_state *state, const sonde_tissue_scales *scales) {
  // Sums at slots that do not move are not read.
  for (uint32_t r = 0; r < state->active_row_count; ++r) {
    uint32_t i = state->active_rows[r];
    state->contact_force[i] = state->contact_product[i] = vec3(0, 0, 0);
  }
  state->term_count = state->bulk_terms;
  uint32_t rows = state->row_count;
  for (uint32_t k = 0; k < state->push_count; ++k) {
    const sonde_push *push = &state->pushes[k];
    if (push->dropped) continue;
    double kv = push->stiffness * along_rows(state, push, state->stage_velocity);
    for (uint32_t r = push->first_row; r < push->first_row + push->row_count; ++r) {
      uint32_t s = state->rows[r];
      state->contact_force[s] = v_madd(state->contact_force[s], -push->force, state->g[r]);
      state->contact_product[s] = v_madd(state->contact_product[s], kv, state->g[r]);
    }
    add_term(state, scales->damping * push->damper + scales->stiffness * push->stiffness,
             push->first_row, push->row_count);
  }
  for (uint32_t k = 0; k < state->grip_count; ++k) {
    const sonde_grip *grip = &state->grips[k];
    if (!grip->term_count || state->pushes[grip->push].dropped) continue;
    sonde_grip_spread(state, grip, grip->force, state->contact_force);
    sonde_vec3 slip = sonde_grip_slip(state, grip, state->stage_velocity);
    double scale = scales->damping * grip->damper + scales->stiffness * grip->stiffness;
    // A bond resists along its tangents.
    for (uint32_t i = 0; i < grip->term_count; ++i) {
      sonde_vec3 t = grip->tangent[i];
      uint32_t first, count;
      sonde_grip_spread(state, grip, v_scale(t, grip->stiffness * v_dot(slip, t)),
                        state->contact_product);
      if (scale > 0 && sonde_grip_rows(state, grip, t, &first, &count))
        add_term(state, scale, first, count);
    }
  }
  state->row_count = rows; // rows of tangents are made anew by the next gathering
}

uint32_t sonde_touch_predict(sonde_scene_state *state) {
  uint32_t dropped = 0;
  for (uint32_t k = 0; k < state->push_count; ++k) {
    sonde_push *push = &state->pushes[k];
    double displacement = along_rows(state, push, state->move);
    push->end_value = push->value + displacement;
    if (push->dropped) continue;
    push->end_force = push->force + push->stiffness * displacement +
                      push->damper * along_rows(state, push, state->gain);
    if (push->end_force >= 0 || push->pulls) continue;
    push->dropped = true;
    push->end_force = 0;
    ++dropped;
  }
  for (uint32_t k = 0; k < state->grip_count; ++k) sonde_grip_predict(state, &state->grips[k]);
  return dropped;
}

void sonde_touch_finish(sonde_scene_state *state, double h) {
  SONDE_ASSERT(h > 0);
  for (uint32_t b = 0; b < state->scene->body_count; ++b)
    if (!state->now.asleep[b]) state->now.self_j[b] = 0;
  // Forces and torques about the world's origin follow from the rows of a's and b's slots.
  for (uint32_t k = 0; k < state->push_count; ++k) {
    const sonde_push *push = &state->pushes[k];
    double stored_m = fmax(push->end_value, 0);
    double energy_j = 0.5 * push->stiffness * stored_m * stored_m;
    if (push->touch == UINT32_MAX && !push->pulls) state->now.self_j[push->body] += energy_j;
    if (push->touch == UINT32_MAX) continue;
    const sonde_touch *touch = &state->scene->touches[push->touch];
    sonde_pair_measure *pair = &state->now.pair[push->touch];
    const sonde_body *a = body_of(state, touch->a), *b = body_of(state, touch->b);
    pair->normal_n += push->end_force * push->newtons;
    pair->energy_j += energy_j;
    for (uint32_t r = push->first_row; r < push->first_row + push->row_count; ++r) {
      uint32_t s = state->rows[r];
      sonde_vec3 force = v_scale(state->g[r], -push->end_force);
      bool of_a = s >= a->first_slot && s - a->first_slot < a->slot_count;
      const sonde_body *body = of_a ? a : b;
      sonde_vec3 *torque = of_a ? &pair->torque_n_m : &pair->torque_b_n_m;
      if (sonde_body_is_rigid(body) && s == body->first_slot + 1) {
        *torque = v_add(*torque, force);
        continue;
      }
      *torque = v_add(*torque, v_cross(state->stage_position[s], force));
      if (of_a) pair->force_n = v_add(pair->force_n, force);
    }
  }
  for (uint32_t k = 0; k < state->grip_count; ++k) {
    const sonde_grip *grip = &state->grips[k];
    if (state->pushes[grip->push].dropped) continue;
    sonde_pair_measure *pair = &state->now.pair[grip->touch];
    sonde_vec3 f = grip->end_force;
    pair->friction_n = v_add(pair->friction_n, f);
    pair->torque_n_m = v_add(pair->torque_n_m, v_cross(grip->point[0], f));
    pair->torque_b_n_m = v_sub(pair->torque_b_n_m, v_cross(grip->point[1], f));
  }
  for (uint32_t t = 0; t < state->scene->touch_count; ++t) {
    if (state->now.pair[t].region_count) continue;
    state->now.hint[t] = state->now.entry[t] = vec3(0, 0, 0);
    state->now.deep[t] = 0;
  }
  for (uint32_t k = 0; k < state->near_touch_count; ++k) {
    uint32_t t = state->near_touch[k];
    state->now.pair[t].force_n = v_add(state->now.pair[t].force_n, state->now.pair[t].friction_n);
    state->now.hint[t] = state->found_hint[t];
    if (state->now.pair[t].region_count) sonde_trouble_direction(state, t);
  }
  sonde_bonds_advance(state, h);
}
