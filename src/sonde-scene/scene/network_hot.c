// Springs of surfaces and lattices, and the bulk of a closed surface (docs/scene_theory.md).
#include "scene/state.h"

#include "base/base.h"
#include "base/maths.h"

typedef struct evaluation {
  const sonde_vec3 *x, *v;
  sonde_tissue_scales scale;
  sonde_vec3 *force, *product;
  sonde_mat3 *diagonal, *upper; // NULL: forces only
} evaluation;

static inline void add_block(sonde_mat3 *m, const sonde_mat3 *block) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m->m[r][c] += block->m[r][c];
}

// H = k nn^T + max(0, T/l)(I - nn^T): without the geometric part in compression it stays positive
// semidefinite; the force is exact.
static inline void add_spring(const evaluation *at, const uint32_t pair[2],
                              const sonde_spring *spring, uint32_t e) {
  uint32_t i = pair[0], j = pair[1];
  sonde_vec3 d = v_sub(at->x[j], at->x[i]), w = v_sub(at->v[j], at->v[i]);
  double length = v_norm(d), shortest = 0.05 * spring->rest_m;
  if (length < shortest) length = shortest;
  double inverse = 1.0 / length;
  sonde_vec3 n = v_scale(d, inverse);
  double tension = spring->stiffness_n_m * (length - spring->rest_m), closing = v_dot(n, w);
  double pull = tension + spring->damper_n_s_m * closing;
  at->force[i] = v_madd(at->force[i], pull, n);
  at->force[j] = v_madd(at->force[j], -pull, n);
  if (!at->diagonal) return;
  double lateral = tension > 0 ? tension * inverse : 0, along = spring->stiffness_n_m - lateral;
  sonde_vec3 kv = v_madd(v_scale(w, lateral), along * closing, n);
  at->product[i] = v_sub(at->product[i], kv);
  at->product[j] = v_add(at->product[j], kv);
  sonde_mat3 block =
      m_rank1(n, at->scale.stiffness * along + at->scale.damping * spring->damper_n_s_m,
              at->scale.stiffness * lateral);
  add_block(&at->diagonal[i], &block);
  add_block(&at->diagonal[j], &block);
  at->upper[e] = m_scale(block, -1.0);
}

static double face_volume(const sonde_body *body, const sonde_vec3 *x, uint32_t f,
                          sonde_vec3 gradient[3]) {
  const uint32_t *face = body->surface.faces[f];
  uint32_t n[3];
  sonde_vec3 p[3], origin = x[body->surface_node ? body->surface_node[0] : 0];
  for (int k = 0; k < 3; ++k) {
    n[k] = body->surface_node ? body->surface_node[face[k]] : face[k];
    p[k] = v_sub(x[n[k]], origin);
  }
  for (int k = 0; k < 3; ++k)
    gradient[k] = v_scale(v_cross(p[(k + 1) % 3], p[(k + 2) % 3]), 1.0 / 6);
  return v_dot(p[0], v_cross(p[1], p[2])) / 6;
}

double sonde_network_volume(const sonde_body *body, const sonde_vec3 *position) {
  SONDE_ASSERT(body->surface.face_count > 0);
  double volume = 0;
  sonde_vec3 gradient[3];
  for (uint32_t f = 0; f < body->surface.face_count; ++f)
    volume += face_volume(body, position, f, gradient);
  return volume;
}

// Energy B (V - V0)^2/2: forces -B (V - V0) dV/dx and the term B dV/dx dV/dx^T. The gradients sum
// to zero over a closed surface, whatever the origin of the tetrahedra.
static void add_bulk(sonde_scene_state *state, const sonde_body *body,
                     const sonde_tissue_scales *scales) {
  uint32_t nodes = body->node_count, first = state->bulk_row_count;
  SONDE_ASSERT(first + nodes <= state->bulk_row_capacity);
  SONDE_ASSERT(state->term_count < state->term_capacity);
  sonde_vec3 *g = state->g + first;
  const sonde_vec3 *x = state->stage_position + body->first_slot;
  for (uint32_t i = 0; i < nodes; ++i) {
    g[i] = vec3(0, 0, 0);
    state->rows[first + i] = body->first_slot + i;
  }
  double volume = 0, rate = 0;
  for (uint32_t f = 0; f < body->surface.face_count; ++f) {
    sonde_vec3 gradient[3];
    volume += face_volume(body, x, f, gradient);
    for (int k = 0; k < 3; ++k) {
      uint32_t v = body->surface.faces[f][k], i = body->surface_node ? body->surface_node[v] : v;
      g[i] = v_add(g[i], gradient[k]);
    }
  }
  double push = -body->bulk_n_m5 * (volume - body->rest_volume_m3);
  for (uint32_t i = 0; i < nodes; ++i)
    rate += v_dot(g[i], state->stage_velocity[body->first_slot + i]);
  for (uint32_t i = 0; i < nodes; ++i) {
    uint32_t s = body->first_slot + i;
    state->force[s] = v_madd(state->force[s], push, g[i]);
    state->product[s] = v_madd(state->product[s], body->bulk_n_m5 * rate, g[i]);
  }
  state->terms[state->term_count++] =
      (sonde_rank_one){body->bulk_n_m5 * scales->stiffness, nodes, state->rows + first, g};
  state->bulk_row_count = first + nodes;
}

void sonde_network_linearise(sonde_scene_state *state, uint32_t b,
                             const sonde_tissue_scales *scales) {
  const sonde_body *body = &state->scene->bodies[b];
  uint32_t first = body->first_slot;
  bool implicit = scales->stiffness > 0 || scales->damping > 0;
  evaluation at = {.x = state->stage_position + first,
                   .v = state->stage_velocity + first,
                   .scale = *scales,
                   .force = state->force + first,
                   .product = state->product + first};
  if (implicit) {
    at.diagonal = state->matrix->diagonal + first;
    at.upper = state->matrix->upper + body->first_pair;
  }
  for (uint32_t i = 0; i < body->node_count; ++i) {
    at.force[i] = at.product[i] = vec3(0, 0, 0);
    state->matrix->diagonal[first + i] = m_diag(scales->mass * body->node_mass_kg[i]);
  }
  for (uint32_t e = 0; e < body->spring_count; ++e)
    add_spring(&at, body->pairs[e], &body->spring[e], e);
  if (body->bulk_n_m5 > 0) add_bulk(state, body, scales);
}

double sonde_network_energy(const sonde_body *body, const sonde_vec3 *position) {
  SONDE_ASSERT(body && position);
  double energy = 0;
  for (uint32_t e = 0; e < body->spring_count; ++e) {
    const uint32_t *pair = body->pairs[e];
    double stretch = v_distance(position[pair[0]], position[pair[1]]) - body->spring[e].rest_m;
    energy += 0.5 * body->spring[e].stiffness_n_m * stretch * stretch;
  }
  for (uint32_t k = 0; k < body->crease_count; ++k) {
    sonde_vec3 gradient[4];
    double bent =
        sonde_crease_angle(&body->crease[k], position, gradient) - body->crease[k].rest_rad;
    energy += 0.5 * body->crease[k].stiffness_n_m * bent * bent;
  }
  if (body->bulk_n_m5 > 0) {
    double change = sonde_network_volume(body, position) - body->rest_volume_m3;
    energy += 0.5 * body->bulk_n_m5 * change * change;
  }
  return energy;
}
