// Release of a body that lies wholly inside another (docs/scene_theory.md).
//
// The common volume of such a pair is the inner body's own: it has no gradient and no columns. What
// parts the bodies is the depth d, the way of the inner body along the shortest exit n until the
// outer one lies behind it. A spring of the pair's stiffness over the inner body's mean section
// pushes along n, and a damper of RELEASE_S times the stiffness lets it leave at d/RELEASE_S at
// most: what the start stored is dissipated. The law holds until little of d is left.
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"

static const double RELEASE_S = 0.05, LEAST = 0.1; // LEAST in thicknesses of the thinner body
static const double CONTAINED = 0.5;               // least share of a body's volume at rest

// Exit of the inner body.
typedef struct way_out {
  sonde_vec3 direction;  // unit, from the outer body outwards
  double depth_m;        // 0 or less: the bodies are apart along it
  sonde_face_point foot; // on the outer body; of convex pairs none
} way_out;

static sonde_vec3 centre_of(const sonde_scene_state *state, uint32_t b) {
  const sonde_body *body = &state->scene->bodies[b];
  uint32_t count = body->surface.vertex_count;
  if (sonde_body_is_rigid(body)) return state->stage_position[body->first_slot];
  sonde_vec3 sum = vec3(0, 0, 0);
  SONDE_ASSERT(count > 0);
  for (uint32_t i = 0; i < count; ++i)
    sum = v_madd(sum, 1.0 / count, state->surface[state->surface_first[b] + i]);
  return sum;
}

static sonde_pose pose_of(const sonde_scene_state *state, uint32_t b) {
  return (sonde_pose){state->stage_position[state->scene->bodies[b].first_slot],
                      state->stage_rotation[b]};
}

// Of convex bodies by displacement from the last direction; of others along the line to the nearest
// point of the outer surface from the inner body's centre.
static way_out find_way(const sonde_scene_state *state, uint32_t t, uint32_t inner,
                        uint32_t outer) {
  const sonde_touch *touch = &state->scene->touches[t];
  const sonde_body *a = &state->scene->bodies[touch->a], *b = &state->scene->bodies[touch->b];
  way_out way = {.depth_m = 0};
  if (sonde_body_is_convex(a) && sonde_body_is_convex(b)) {
    sonde_depth_result r = sonde_convex_displace(&a->convex, pose_of(state, touch->a), &b->convex,
                                                 pose_of(state, touch->b), state->now.hint[t]);
    way.direction = v_scale(r.direction, inner == touch->a ? -1 : 1);
    way.depth_m = r.depth_m;
    return way;
  }
  sonde_vec3 centre = centre_of(state, inner);
  way.foot = sonde_face_tree_nearest(state->tree[outer], centre);
  way.direction = way.foot.outward;
  double reach = 0;
  for (uint32_t i = 0; i < state->scene->bodies[inner].surface.vertex_count; ++i) {
    sonde_vec3 x = state->surface[state->surface_first[inner] + i];
    reach = fmax(reach, v_dot(v_sub(centre, x), way.direction));
  }
  way.depth_m = way.foot.depth_m + reach;
  return way;
}

static void add_row(sonde_scene_state *state, uint32_t slot, sonde_vec3 g) {
  SONDE_ASSERT(state->row_count < state->row_capacity);
  state->rows[state->row_count] = slot;
  state->g[state->row_count++] = g;
}

// The push acts on one line: through the inner body's centre along the exit.
static bool add_rows(sonde_scene_state *state, uint32_t inner, uint32_t outer, const way_out *way) {
  const sonde_body *in = &state->scene->bodies[inner], *out = &state->scene->bodies[outer];
  uint32_t count = in->surface.vertex_count;
  if (state->row_count + count + 3 > state->row_capacity) {
    state->report.flags |= SONDE_SCENE_CONTACT_FULL;
    return false;
  }
  if (sonde_body_is_rigid(in)) add_row(state, in->first_slot, v_neg(way->direction));
  for (uint32_t i = 0; i < count && !sonde_body_is_rigid(in); ++i)
    add_row(state, in->first_slot + (in->surface_node ? in->surface_node[i] : i),
            v_scale(way->direction, -1.0 / count));
  if (sonde_body_is_rigid(out)) {
    sonde_vec3 arm = v_sub(centre_of(state, inner), state->stage_position[out->first_slot]);
    add_row(state, out->first_slot, way->direction);
    add_row(state, out->first_slot + 1, v_cross(arm, way->direction));
    return true;
  }
  for (int k = 0; k < 3; ++k) {
    uint32_t vertex = out->surface.faces[way->foot.face][k];
    add_row(state, out->first_slot + (out->surface_node ? out->surface_node[vertex] : vertex),
            v_scale(way->direction, way->foot.weight[k]));
  }
  return true;
}

void sonde_release_notice(sonde_scene_state *state, uint32_t t, const sonde_overlap_result *found) {
  const sonde_touch *touch = &state->scene->touches[t];
  for (uint32_t r = 0; r < found->region_count; ++r) {
    const sonde_overlap_region *region = &found->regions[r];
    if (region->entry_count[0] && region->entry_count[1]) continue;
    // A corner too small to count on a large face of the other has one side as well, but no volume.
    int inner = region->entry_count[0] ? 0 : 1;
    uint32_t b = inner ? touch->b : touch->a;
    double whole = 4 * state->section_m2[b] * state->thickness_m[b];
    if (region->volume_m3 < CONTAINED * whole) continue;
    if (!state->now.release[t])
      sonde_scene_note(state, SONDE_SCENE_INSIDE, inner ? touch->b : touch->a,
                       inner ? touch->a : touch->b);
    state->now.release[t] = (uint8_t)(1 + inner);
    return;
  }
}

bool sonde_release_push(sonde_scene_state *state, uint32_t t, bool may_end) {
  const sonde_touch *touch = &state->scene->touches[t];
  SONDE_ASSERT(state->now.release[t] == 1 || state->now.release[t] == 2);
  bool inner_is_a = state->now.release[t] == 1;
  uint32_t inner = inner_is_a ? touch->a : touch->b, outer = inner_is_a ? touch->b : touch->a;
  way_out way = find_way(state, t, inner, outer);
  double thickness = fmin(state->thickness_m[inner], state->thickness_m[outer]);
  if (may_end && way.depth_m < LEAST * thickness) {
    state->now.release[t] = 0;
    return false;
  }
  state->now.pair[t].depth_m = way.depth_m;
  state->now.pair[t].point_count = 1;
  state->found_hint[t] = v_scale(way.direction, inner_is_a ? -1 : 1);
  if (!(way.depth_m > 0)) return true;
  sonde_push *push = sonde_push_new(state, t);
  if (!push || !add_rows(state, inner, outer, &way)) return true;
  push->row_count = state->row_count - push->first_row;
  // The energy law's stiffness is per volume squared.
  double section = state->section_m2[inner];
  push->value = way.depth_m;
  push->stiffness = touch->stiffness * section;
  if (touch->law == SONDE_TOUCH_ENERGY) push->stiffness *= section;
  push->damper = push->stiffness * RELEASE_S;
  // A damper beyond mass over what is left of the step explicitly would turn the motion round.
  const sonde_scene_step *step = &state->scene->step;
  double most = 0.5 * state->scene->bodies[inner].mass.mass_kg / step->dt_s;
  if (step->lambda < 1 && push->damper > most / (1 - step->lambda)) {
    push->damper = most / (1 - step->lambda);
    push->stiffness = push->damper / RELEASE_S;
  }
  return true;
}
