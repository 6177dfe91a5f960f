// The contact law at the nodes (docs/world.md): pressure kappa t + mu dt/dt at each node inside the
// probe, times the node's area at rest. Its matrix terms are diagonal.
// touch_range: looks at a run of nodes.
// detect:      runs near the probe; regions join neighbours.
// push_at:     push of one node.
#include "world/contact.h"

#include "base/base.h"

static bool inside_box(const sonde_box *box, sonde_vec3 x) {
  return x.x >= box->low.x && x.x <= box->high.x && x.y >= box->low.y && x.y <= box->high.y &&
         x.z >= box->low.z && x.z <= box->high.z;
}

// The share of the volume is a column of the node's depth; the gradient points out of the tissue.
static void touch_range(sonde_state *state, const sonde_box *box, uint32_t first, uint32_t end) {
  for (uint32_t i = first; i < end; ++i) {
    double depth;
    sonde_vec3 slope;
    if (!inside_box(box, state->probed[i])) continue;
    if (!sonde_contact_depth(state, state->probed[i], &depth, &slope)) continue;
    double area = state->model->area_m2[i];
    state->share_m3[i] = area * depth;
    state->gradient[i] = v_scale(v_unit(slope, state->inward), area);
    state->parent[i] = i;
    state->touched[state->touched_count++] = i;
    state->contact.area_m2 += area;
    state->contact.volume_m3 += area * depth;
  }
}

void sonde_nodes_detect(sonde_state *state, const sonde_box *box) {
  touch_range(state, box, 0, state->model->surface.vertex_count);
  sonde_nodes_join(state);
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

typedef struct pressed_node {
  sonde_vec3 slope;
  double push_n, stiffness_n_m, damping_n_s_m;
} pressed_node;

// The push on node i at x with velocity v.
static bool push_at(const sonde_state *state, uint32_t i, sonde_vec3 x, sonde_vec3 v,
                    const sonde_motion *probe, pressed_node *at) {
  double depth, area = state->model->area_m2[i];
  if (!sonde_contact_depth(state, x, &depth, &at->slope)) return false;
  at->stiffness_n_m = state->def.contact_stiffness_n_m3 * area;
  at->damping_n_s_m = state->def.contact_damping_n_s_m3 * area;
  sonde_vec3 carried = v_add(probe->velocity, v_cross(probe->spin, v_sub(x, probe->origin)));
  double rate = v_dot(at->slope, v_sub(v, carried));
  at->push_n = at->stiffness_n_m * depth + at->damping_n_s_m * rate;
  return at->push_n > 0;
}

static bool push_here(const sonde_state *state, uint32_t i, const sonde_motion *probe,
                      pressed_node *at) {
  return push_at(state, i, state->probed[i], state->velocity[i], probe, at);
}

void sonde_nodes_apply(sonde_state *state, const sonde_motion *probe,
                       const sonde_contact_scales *scales) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    pressed_node at;
    if (!push_here(state, i, probe, &at)) continue;
    double scale = scales->stiffness * at.stiffness_n_m + scales->damping * at.damping_n_s_m;
    state->contact_force[i] = v_scale(at.slope, -at.push_n);
    state->matrix->diagonal[i] = m_add(state->matrix->diagonal[i], m_rank1(at.slope, scale, 0));
  }
}

void sonde_nodes_advance(sonde_state *state, const sonde_motion *probe, double lambda, double h) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    pressed_node at;
    state->contact_force[i] = vec3(0, 0, 0);
    if (!push_here(state, i, probe, &at)) continue;
    double along = lambda * v_dot(at.slope, state->increment[i]);
    double push = at.push_n + along * (lambda * h * at.stiffness_n_m + at.damping_n_s_m);
    if (push > 0) state->contact_force[i] = v_scale(at.slope, -push);
  }
}
