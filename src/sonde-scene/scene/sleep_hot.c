// Nodes at rest of anchored tissues sleep (docs/scene_theory.md).
//
// A tissue's node falls asleep when for CALM steps it was slow and the forces on it, contact
// then stays where it is, and its neighbours feel its springs. What touches others never sleeps.
#include "scene/state.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

enum { CALM = 20, TRIAL_PERIOD = 32 };
static const double STILL_S = 10e-3; // a node is slow when it would creep sleep_m in this time

static bool may_sleep(const sonde_scene_state *state, const sonde_body *body) {
  return body->model && state->scene->step.sleep_m > 0 && state->scene->step.lambda > 0;
}

static bool is_awake(const sonde_scene_state *state, uint32_t slot) {
  return state->now.calm[slot] < CALM;
}

static bool moves(const sonde_scene_state *state, const sonde_body *body, uint32_t k) {
  if (body->motion != SONDE_BODY_FREE) return false;
  return (sonde_body_is_rigid(body) || !body->held[k]) && is_awake(state, body->first_slot + k);
}

void sonde_sleep_list(sonde_scene_state *state) {
  const sonde_scene *scene = state->scene;
  uint32_t face = 0;
  state->active_row_count = state->active_pair_count = 0;
  for (uint32_t b = 0; b < scene->body_count; ++b) {
    const sonde_body *body = &scene->bodies[b];
    for (uint32_t k = 0; k < body->slot_count; ++k)
      if (moves(state, body, k))
        state->active_rows[state->active_row_count++] = body->first_slot + k;
    uint32_t last = b + 1 < scene->body_count ? body[1].first_pair : scene->pair_count;
    for (uint32_t e = body->first_pair; e < last; ++e)
      if (moves(state, body, scene->pairs[e][0] - body->first_slot) &&
          moves(state, body, scene->pairs[e][1] - body->first_slot))
        state->active_pairs[state->active_pair_count++] = e;
    if (!body->model) continue;
    // The waking part of a tissue: its nodes, the sleepers beside them, their springs and faces.
    const sonde_model *model = body->model;
    const uint8_t *calm = state->now.calm + body->first_slot;
    uint32_t *rows = state->part_rows + body->first_slot, *rim = state->part_rim + body->first_slot;
    uint32_t *edges = state->part_edges + body->first_pair, *faces = state->part_faces + face;
    sonde_tissue_part part = {.rows = rows, .rim = rim, .edges = edges, .faces = faces};
    uint8_t *in_rim = state->in_rim + body->first_slot;
    memset(in_rim, 0, body->node_count);
    for (uint32_t i = 0; i < body->node_count; ++i)
      if (calm[i] < CALM) rows[part.row_count++] = i;
    for (uint32_t e = 0; e < model->topology.edge_count; ++e) {
      const uint32_t *end = model->topology.edges[e];
      bool first = calm[end[0]] < CALM, second = calm[end[1]] < CALM;
      if (!first && !second) continue;
      edges[part.edge_count++] = e;
      uint32_t other = first ? end[1] : end[0];
      if ((first && second) || in_rim[other]) continue;
      in_rim[other] = 1;
      rim[part.rim_count++] = other;
    }
    for (uint32_t f = 0; f < model->surface.face_count; ++f) {
      const uint32_t *v = model->surface.faces[f];
      if (calm[v[0]] < CALM || calm[v[1]] < CALM || calm[v[2]] < CALM) faces[part.face_count++] = f;
    }
    state->part[b] = part;
    face += body->surface.face_count;
  }
  SONDE_ASSERT(state->active_row_count <= scene->slot_count);
}

void sonde_sleep_begin(sonde_scene_state *state) {
  bool any = false;
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (!body->model) continue;
    any = true;
    if (!may_sleep(state, body)) memset(state->now.calm + body->first_slot, 0, body->node_count);
  }
  if (any) sonde_sleep_list(state);
}

bool sonde_sleep_wake_touched(sonde_scene_state *state) {
  bool woke = false;
  for (uint32_t k = 0; k < state->push_count; ++k) {
    const sonde_push *push = &state->pushes[k];
    for (uint32_t r = push->first_row; r < push->first_row + push->row_count; ++r) {
      woke |= !is_awake(state, state->rows[r]);
      state->now.calm[state->rows[r]] = 0;
    }
  }
  if (woke) sonde_sleep_list(state);
  return woke;
}

void sonde_sleep_rest(sonde_scene_state *state) {
  double displacement = state->scene->step.sleep_m, still = displacement / STILL_S;
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    const sonde_model *model = body->model;
    const sonde_tissue_part *part = &state->part[b];
    if (!may_sleep(state, body)) continue;
    uint8_t *calm = state->now.calm + body->first_slot;
    for (uint32_t r = 0; r < part->row_count; ++r) {
      uint32_t i = part->rows[r], s = body->first_slot + i;
      double speed = v_norm(state->now.velocity[s]);
      const sonde_topology *t = &model->topology;
      for (uint32_t k = t->start[i]; k < t->start[i + 1] && speed > 2 * still; ++k)
        if (calm[t->neighbour[k]] >= CALM) calm[t->neighbour[k]] = 0;
      // The unbalanced force would move the node by (normal, tangent) against its anchors.
      sonde_vec3 n = model->normal[i], f = v_add(state->force[s], state->contact_force[s]);
      double along = v_dot(n, f), area = model->area_m2[i];
      double across = v_norm(v_madd(f, -along, n));
      SONDE_ASSERT(area > 0);
      double normal = along / (model->k0_n_m3[i] * area);
      double tangent = across > 0 ? across / (model->law.tangential_stiffness_n_m3 * area) : 0;
      bool at_rest = speed <= still && sqrt(normal * normal + tangent * tangent) <= displacement;
      if (!body->held[i] && !at_rest)
        calm[i] = 0;
      else if (++calm[i] >= CALM)
        state->now.velocity[s] = state->now.increment[s] = vec3(0, 0, 0);
    }
    // Sleepers beside waking nodes are tried in turn: their neighbours may have crept away from
    // where the sleepers found balance.
    for (uint32_t r = 0; r < part->rim_count; ++r) {
      uint32_t i = part->rim[r];
      bool tried = (i + state->now.head->tick) % TRIAL_PERIOD == 0;
      if (tried && calm[i] >= CALM) calm[i] = CALM - 1;
    }
  }
}
