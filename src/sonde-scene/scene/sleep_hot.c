// Nodes at rest of anchored tissues sleep, and whole bodies of the other kinds with all that they
// touch (docs/scene_theory.md).
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
  if (body->motion != SONDE_BODY_FREE || state->now.asleep[body - state->scene->bodies])
    return false;
  return (sonde_body_is_rigid(body) || !body->held[k]) && is_awake(state, body->first_slot + k);
}

void sonde_sleep_list(sonde_scene_state *state) {
  const sonde_scene *scene = state->scene;
  uint32_t face = 0;
  state->listed = true;
  state->active_row_count = state->active_pair_count = 0;
  for (uint32_t b = 0; b < scene->body_count; ++b) {
    const sonde_body *body = &scene->bodies[b];
    for (uint32_t k = 0; k < body->slot_count; ++k)
      if (moves(state, body, k))
        state->active_rows[state->active_row_count++] = body->first_slot + k;
    uint32_t last = b + 1 < scene->body_count ? body[1].first_pair : scene->pair_count;
    for (uint32_t e = body->first_pair; e < last && !body->model; ++e)
      if (moves(state, body, scene->pairs[e][0] - body->first_slot) &&
          moves(state, body, scene->pairs[e][1] - body->first_slot))
        state->active_pairs[state->active_pair_count++] = e;
    if (!body->model) continue;
    // The waking part of a tissue: its nodes, the sleepers beside them, their springs and faces.
    const sonde_model *model = body->model;
    bool free = body->motion == SONDE_BODY_FREE;
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
      if (first && second && free && !body->held[end[0]] && !body->held[end[1]])
        state->active_pairs[state->active_pair_count++] = body->first_pair + e;
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
  memcpy(state->moving, state->active_rows, state->active_row_count * sizeof *state->moving);
  state->moving_count = state->active_row_count;
  for (uint32_t b = 0; b < scene->body_count; ++b) {
    if (scene->bodies[b].motion != SONDE_BODY_DRIVEN) continue;
    state->moving[state->moving_count++] = scene->bodies[b].first_slot;
    state->moving[state->moving_count++] = scene->bodies[b].first_slot + 1;
  }
}

// A tissue whose forces are 0 where it starts sleeps from the start.
void sonde_sleep_start(sonde_scene_state *state) {
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (!may_sleep(state, body)) continue;
    bool still = !(v_norm2(body->velocity_m_s) + v_norm2(body->spin_rad_s) > 0);
    bool weighs = body->sags && v_norm2(state->scene->gravity_m_s2) > 0;
    double load2 = 0;
    for (uint32_t i = 0; i < body->node_count; ++i) load2 += v_norm2(body->load_n[i]);
    if (still && !weighs && !(load2 > 0) && !(body->model->law.edge_pretension_n > 0))
      memset(state->now.calm + body->first_slot, CALM, body->node_count);
  }
}

void sonde_sleep_begin(sonde_scene_state *state) {
  bool any = state->scene->step.sleep_m > 0 && state->scene->step.lambda > 0;
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (any) continue;
    state->listed &= !state->now.asleep[b] && !body->model;
    state->now.asleep[b] = 0;
    if (body->model) memset(state->now.calm + body->first_slot, 0, body->node_count);
  }
  if (!state->listed) sonde_sleep_list(state);
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

static void rest_nodes(sonde_scene_state *state) {
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
        if (calm[t->neighbour[k]] >= CALM) {
          calm[t->neighbour[k]] = 0;
          state->listed = false;
        }
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
      else if (++calm[i] >= CALM) {
        state->now.velocity[s] = state->now.increment[s] = vec3(0, 0, 0);
        state->listed = false;
      }
    }
    // Sleepers beside waking nodes are tried in turn: their neighbours may have crept away from
    // where the sleepers found balance.
    for (uint32_t r = 0; r < part->rim_count; ++r) {
      uint32_t i = part->rim[r];
      bool tried = (i + state->now.head->tick) % TRIAL_PERIOD == 0;
      if (!tried || calm[i] < CALM) continue;
      calm[i] = CALM - 1;
      state->listed = false;
    }
  }
}

// ---- bodies

// A body is slow when it would creep sleep_m in this time, and sleeps after as long.
static const double STILL_BODY_S = 0.2;

bool sonde_body_rests(const sonde_scene_state *state, uint32_t b) {
  const sonde_body *body = &state->scene->bodies[b];
  if (body->motion == SONDE_BODY_FIXED || state->now.asleep[b]) return true;
  const sonde_vec3 *v = state->now.velocity + body->first_slot;
  return body->motion == SONDE_BODY_DRIVEN && !(v_norm2(v[0]) + v_norm2(v[1]) > 0);
}

static void wake(sonde_scene_state *state, uint32_t b) {
  state->now.asleep[b] = 0;
  state->now.calm_s[b] = 0;
  state->listed = false;
}

bool sonde_sleep_wake_bodies(sonde_scene_state *state) {
  const sonde_scene *scene = state->scene;
  bool woke = false;
  for (uint32_t k = 0; k < state->near_touch_count; ++k) {
    const sonde_touch *touch = &scene->touches[state->near_touch[k]];
    bool sleeps = state->now.asleep[touch->a] || state->now.asleep[touch->b];
    if (!sleeps || !state->now.pair[state->near_touch[k]].region_count) continue;
    woke = true;
    wake(state, state->now.asleep[touch->a] ? touch->a : touch->b);
  }
  // Bodies that rest with one that woke wake as well.
  for (bool more = woke || scene->pin_count; more;) {
    more = false;
    for (uint32_t t = 0; t < scene->touch_count; ++t) {
      uint32_t a = scene->touches[t].a, b = scene->touches[t].b;
      if (!state->now.pair[t].region_count || state->now.asleep[a] == state->now.asleep[b])
        continue;
      uint32_t sleeper = state->now.asleep[a] ? a : b, other = sleeper == a ? b : a;
      if (scene->bodies[other].motion != SONDE_BODY_FREE) continue;
      wake(state, sleeper);
      more = true;
    }
    for (uint32_t k = 0; k < scene->pin_count; ++k) {
      uint32_t a = scene->pins[k].end[0].body, b = scene->pins[k].end[1].body;
      if (a == UINT32_MAX || b == UINT32_MAX || state->now.asleep[a] == state->now.asleep[b])
        continue;
      uint32_t sleeper = state->now.asleep[a] ? a : b, other = sleeper == a ? b : a;
      if (sonde_body_rests(state, other)) continue;
      wake(state, sleeper);
      more = woke = true;
    }
  }
  if (woke) sonde_sleep_list(state);
  return woke;
}

static uint32_t group_of(const uint32_t *group, uint32_t b) {
  while (group[b] != b) b = group[b];
  return b;
}

// Bodies that touch each other fall asleep together, when all are slow and something that does not
// move holds them: what drifts freely keeps its momentum. Tissues and moving bodies keep awake what
// they touch.
static void rest_bodies(sonde_scene_state *state, double h) {
  const sonde_scene *scene = state->scene;
  uint32_t *group = state->island, bodies = scene->body_count;
  double still = scene->step.sleep_m / STILL_BODY_S;
  for (uint32_t b = 0; b < bodies; ++b) {
    const sonde_body *body = &scene->bodies[b];
    group[b] = b;
    if (body->motion != SONDE_BODY_FREE || body->model || state->now.asleep[b]) continue;
    const sonde_vec3 *v = state->now.velocity + body->first_slot;
    bool rigid = sonde_body_is_rigid(body);
    double fastest = rigid ? v_norm(v[0]) + state->reach_m[b] * v_norm(v[1]) : 0;
    for (uint32_t i = 0; i < body->node_count && !rigid; ++i) fastest = fmax(fastest, v_norm(v[i]));
    state->now.calm_s[b] = fastest <= still ? state->now.calm_s[b] + h : 0;
  }
  for (uint32_t k = 0; k < state->near_touch_count; ++k) {
    const sonde_touch *touch = &scene->touches[state->near_touch[k]];
    uint32_t a = group_of(group, touch->a), b = group_of(group, touch->b);
    if (!state->now.pair[state->near_touch[k]].region_count) continue;
    if (scene->bodies[touch->a].motion == SONDE_BODY_FREE &&
        scene->bodies[touch->b].motion == SONDE_BODY_FREE)
      group[a > b ? a : b] = a > b ? b : a;
  }
  for (uint32_t k = 0; k < scene->pin_count; ++k) {
    uint32_t p = scene->pins[k].end[0].body, q = scene->pins[k].end[1].body;
    if (p == UINT32_MAX || q == UINT32_MAX || scene->bodies[p].motion != SONDE_BODY_FREE ||
        scene->bodies[q].motion != SONDE_BODY_FREE)
      continue;
    uint32_t a = group_of(group, p), b = group_of(group, q);
    group[a > b ? a : b] = a > b ? b : a;
  }
  bool *keeps = state->keeps_awake, *held = state->is_held;
  for (uint32_t b = 0; b < bodies; ++b) keeps[b] = held[b] = false;
  for (uint32_t b = 0; b < bodies; ++b) {
    const sonde_body *body = &scene->bodies[b];
    uint32_t root = group_of(group, b);
    if (body->motion != SONDE_BODY_FREE) continue;
    keeps[root] |= body->model || state->now.calm_s[b] < STILL_BODY_S;
    held[root] |= !state->loose[b];
  }
  for (uint32_t k = 0; k < state->near_touch_count; ++k) {
    const sonde_touch *touch = &scene->touches[state->near_touch[k]];
    bool free_a = scene->bodies[touch->a].motion == SONDE_BODY_FREE;
    bool free_b = scene->bodies[touch->b].motion == SONDE_BODY_FREE;
    if (!state->now.pair[state->near_touch[k]].region_count || (free_a && free_b)) continue;
    uint32_t root = group_of(group, free_a ? touch->a : touch->b);
    bool rests = sonde_body_rests(state, free_a ? touch->b : touch->a);
    keeps[root] |= !rests;
    held[root] |= rests;
  }
  for (uint32_t k = 0; k < 2 * scene->pin_count; ++k) {
    uint32_t b = scene->pins[k / 2].end[k % 2].body, other = scene->pins[k / 2].end[1 - k % 2].body;
    if (b == UINT32_MAX || other == UINT32_MAX || scene->bodies[b].motion != SONDE_BODY_FREE ||
        scene->bodies[other].motion == SONDE_BODY_FREE)
      continue;
    uint32_t root = group_of(group, b);
    bool rests = sonde_body_rests(state, other);
    keeps[root] |= !rests;
    held[root] |= rests;
  }
  for (uint32_t b = 0; b < bodies; ++b) {
    const sonde_body *body = &scene->bodies[b];
    uint32_t root = group_of(group, b);
    if (body->motion != SONDE_BODY_FREE || state->now.asleep[b] || keeps[root] || !held[root])
      continue;
    state->now.asleep[b] = 1;
    state->listed = false;
    size_t bytes = body->slot_count * sizeof(sonde_vec3);
    memset(state->now.velocity + body->first_slot, 0, bytes);
    memset(state->now.increment + body->first_slot, 0, bytes);
  }
}

void sonde_sleep_rest(sonde_scene_state *state, double h) {
  rest_nodes(state);
  if (state->scene->step.sleep_m > 0 && state->scene->step.lambda > 0) rest_bodies(state, h);
}
