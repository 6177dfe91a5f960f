// What the contact of every engine shares (docs/world.md): the probe's planes and box, regions of
// the touched skin, force and torque on the probe.
#include "world/contact.h"
#include "world/state.h"

#include "base/base.h"

static const double STEEP_WEIGHT = 4;

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

void sonde_nodes_join(sonde_state *state) {
  const sonde_topology *t = &state->model->topology;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    SONDE_ASSERT(state->share_m3[i] > 0);
    for (uint32_t e = t->start[i]; e < t->start[i + 1] && t->neighbour[e] < i; ++e)
      if (state->share_m3[t->neighbour[e]] > 0) sonde_contact_join(state, i, t->neighbour[e]);
  }
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
  state->touched_count = 0;
  state->contact = (sonde_contact){0};
}

void sonde_contact_clear(sonde_state *state) {
  sonde_contact_forget(state);
  sonde_friction_release(state);
}

// Region of each touched node; parent[] is overwritten by the region's number + node count, so that
// region(i) is parent[i] - nodes.
static void number_regions(sonde_state *state) {
  sonde_contact *contact = &state->contact;
  uint32_t n = state->nodes.count;
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

uint32_t sonde_contact_region_of(const sonde_state *state, uint32_t i) {
  SONDE_ASSERT(state->parent[i] >= state->nodes.count);
  return state->parent[i] - state->nodes.count;
}

// Volume, its rate and the direction k = sum g_i / |sum g_i|: the mean normal of the wetted face.
void sonde_contact_regions(sonde_state *state, const sonde_motion *probe) {
  sonde_contact *contact = &state->contact;
  number_regions(state);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_contact_region *region = &contact->region[sonde_contact_region_of(state, i)];
    sonde_vec3 g = state->gradient[i], arm = v_sub(state->probed[i], probe->origin);
    sonde_vec3 carried = v_add(probe->velocity, v_cross(probe->spin, arm));
    region->volume_m3 += state->share_m3[i];
    region->volume_rate_m3_s += v_dot(g, v_sub(state->velocity[i], carried));
    region->direction = v_add(region->direction, g);
    region->node_count++;
  }
  for (uint32_t r = 0; r < contact->region_count; ++r) {
    sonde_contact_region *region = &contact->region[r];
    region->area_m2 = v_norm(region->direction);
    region->direction = v_unit(region->direction, vec3(0, 0, 0));
  }
}

void sonde_contact_wrench(sonde_state *state, sonde_vec3 origin) {
  sonde_contact *contact = &state->contact;
  contact->force_n = contact->torque_n_m = vec3(0, 0, 0);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_contact_region *region = &contact->region[sonde_contact_region_of(state, i)];
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

// Greatest and least distance from the box around the probe to where the skin that it pushes rests.
bool sonde_contact_is_inside_out(const sonde_state *state, const sonde_probe *probe,
                                 sonde_pose pose) {
  double most = 0, least = INFINITY;
  sonde_box box = sonde_contact_box(probe, pose);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    if (!(v_norm2(state->contact_force[i]) > 0)) continue;
    sonde_vec3 rest = state->nodes.rest[i];
    double distance = v_distance(rest, v_max(box.low, v_min(box.high, rest)));
    most = fmax(most, distance);
    least = fmin(least, distance);
  }
  return most > SONDE_CARRIED_M || (least > SONDE_CAUGHT_M && isfinite(least));
}
