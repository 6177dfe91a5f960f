// The two-layer tissue in batches: what neighbours read of a batch, forces and tangent of its rows,
// and the tangent times a direction. The laws are in tissue/laws.h; a part of kernel.c.
#include "world/batches.h"

// Where batch s is after a step at velocity v: for springs, and for layers.
INLINE void publish_place(sonde_batches *body, uint32_t s, const reals v[3], const reals ue[3]) {
  const reals low[4] = {ue[0], ue[1], ue[2], v[0]}, high[4] = {v[1], v[2], {0}, {0}};
  size_t first = (size_t)s * SONDE_BATCH * SONDE_RECORD;
  write_records(body->record + first, SONDE_RECORD, low);
  write_records(body->record + first + 4, SONDE_RECORD, high);
}

// indentation: where faces are evaluated; unseen: N.x of what was added since.
INLINE void publish_slide(sonde_batches *body, uint32_t s, const reals ue[3], reals indentation,
                          reals unseen) {
  const reals *n = body->model[s].normal;
  reals along = dot(n, ue), slide[4];
  for (int c = 0; c < 3; ++c) slide[c] = ue[c] - along * n[c];
  slide[3] = indentation;
  const reals rest[4] = {unseen, {0}, {0}, {0}};
  real *record = body->slide + (size_t)s * SONDE_BATCH * SONDE_RECORD;
  write_records(record, SONDE_RECORD, slide);
  write_records(record + 4, SONDE_RECORD, rest);
}

INLINE void publish_record(sonde_batches *body, uint32_t s, const reals v[3]) {
  const sonde_batch *at = &body->batch[s];
  real reach = body->law.reach;
  reals ue[3];
  for (int c = 0; c < 3; ++c) ue[c] = at->u[c] + reach * v[c];
  if (body->law.springs) publish_place(body, s, v, ue);
  if (body->law.layered) publish_slide(body, s, ue, -dot(body->model[s].normal, ue), (reals){0});
}

INLINE void publish_direction(sonde_batches *body, uint32_t s, const reals z[3]) {
  const reals *n = body->model[s].normal;
  size_t first = (size_t)s * SONDE_BATCH * SONDE_QUAD;
  const reals all_of_it[4] = {z[0], z[1], z[2], {0}};
  if (body->law.springs || (body->corners_coupled && body->contact_of[s]))
    write_records(body->direction + first, SONDE_QUAD, all_of_it);
  if (!body->law.layered) return;
  reals along = dot(n, z), parts[4];
  for (int c = 0; c < 3; ++c) parts[c] = z[c] - along * n[c];
  parts[3] = along;
  write_records(body->layer_direction + first, SONDE_QUAD, parts);
}

// By what neighbours are coupled.
typedef struct coupled {
  bool springs, layers;
} coupled;

typedef struct node_sum {
  reals force[3], block[6];    // xx xy xz yy yz zz
  reals shear_force, coupling; // along N
  reals slide[3];              // the neighbours' tangential displacements times their weights
  reals pending;               // along N: what neighbours that went on do by the shear layer
} node_sum;

INLINE void add_rank_one(reals block[6], const reals n[3], reals scale, reals flat) {
  reals x = scale * n[0], y = scale * n[1];
  block[0] += x * n[0] + flat;
  block[1] += x * n[1];
  block[2] += x * n[2];
  block[3] += y * n[1] + flat;
  block[4] += y * n[2];
  block[5] += scale * n[2] * n[2] + flat;
}

// The motion of a batch's rows where it is evaluated, and their indentation there.
typedef struct place {
  reals ue[3], ve[3], indentation;
} place;

// The spring-damper of an edge, seen from the row; the neighbour finds the opposite, bit for bit.
INLINE void add_spring(const sonde_batch_law *law, const sonde_slot *slot, reals share,
                       const real *record, const place *at, node_sum *sum,
                       sonde_slot_tangent *tangent) {
  reals d[3], w[3], other[6];
  read_records(record, &tangent->node, other);
  for (int c = 0; c < 3; ++c) {
    d[c] = slot->rest[c] + (other[c] - at->ue[c]);
    w[c] = other[3 + c] - at->ve[c];
  }
  edge_pull edge = pull_edge(&law->edge, share, slot->length, d, w);
  reals steep = law->stiffness_scale * edge.along + law->damping_scale * edge.damper;
  reals flat = law->stiffness_scale * edge.lateral;
  for (int c = 0; c < 3; ++c) {
    sum->force[c] += edge.pull * edge.n[c];
    tangent->n[c] = edge.n[c];
  }
  add_rank_one(sum->block, edge.n, steep, flat);
  tangent->along = steep;
  tangent->lateral = flat;
}

// What a face does along N to the row, and how it couples the row to both neighbours.
typedef struct face_part {
  reals force, before, here;
} face_part;

INLINE face_part shear_face(real scale, const sonde_slot_face *face, reals own, reals before,
                            reals here) {
  const reals s[3] = {own, before, here};
  reals across[3], modulus, beyond;
  reals sum = square_slope(face->cot, s, across);
  shear_modulus(face->shear, face->bend, sum * face->bend, &modulus, &beyond);
  reals flux = across[2] - across[1], steep = beyond * flux;
  return (face_part){.force = modulus * flux,
                     .before = scale * (steep * (across[0] - across[2]) - modulus * face->cot[2]),
                     .here = scale * (steep * (across[1] - across[0]) - modulus * face->cot[1])};
}

// Both layers around the rows of a batch. A slot's coupling is of its own face and the next one's;
// the face of the first slot goes round to the slot `turn` - 1. All faces are evaluated at one
// state, or their corners would feel forces that do not cancel: what neighbours have moved since
// counts by the matrix.
INLINE void add_layers(sonde_batches *body, const sonde_batch_model *fixed, reals own,
                       node_sum *sum) {
  real scale = body->law.stiffness_scale;
  sonde_slot_layer *slot = body->slot_layer + fixed->first_slot;
  const sonde_slot_face *face = body->slot_face + fixed->first_slot;
  reals other[6], before, moved_before, open = {0}, round = {0};
  read_records(body->slide, &fixed->last, other);
  before = other[3], moved_before = other[4];
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    read_records(body->slide, &slot[k].node, other);
    face_part part = shear_face(scale, &face[k], own, before, other[3]);
    for (int c = 0; c < 3; ++c) sum->slide[c] += slot[k].weight * other[c];
    sum->shear_force += part.force;
    sum->coupling += part.before + part.here;
    sum->pending += part.before * moved_before + part.here * other[4];
    if (k == 0)
      round = part.before;
    else
      slot[k - 1].coupling = open + (part.before + pick(fixed->turn == (whole)k, round, all(0)));
    open = part.here;
    before = other[3], moved_before = other[4];
  }
  uint32_t count = fixed->slot_count;
  if (count > 0) slot[count - 1].coupling = open + pick(fixed->turn == (whole)count, round, all(0));
}

INLINE void add_anchor(const sonde_batch_law *law, const sonde_batch_model *fixed, const place *at,
                       node_sum *sum) {
  const reals *n = fixed->normal;
  reals s = at->indentation, rate = dot(n, at->ve);
  anchor_push anchor =
      push_anchor(&law->anchor, fixed->k0, fixed->xm, fixed->limit, fixed->area, s, rate);
  reals push = anchor.push + sum->shear_force;
  reals inplane = law->inplane * fixed->weight, hold = anchor.tangent + inplane;
  if (law->layered) project(n, sum->slide);
  for (int c = 0; c < 3; ++c)
    sum->force[c] += push * n[c] - hold * (at->ue[c] + s * n[c]) -
                     anchor.tangent_damper * (at->ve[c] - rate * n[c]) +
                     law->inplane * sum->slide[c];
  reals flat = law->stiffness_scale * hold + law->damping_scale * anchor.tangent_damper;
  reals steep = law->stiffness_scale * anchor.slope * fixed->area +
                law->damping_scale * anchor.damper - sum->coupling;
  add_rank_one(sum->block, n, steep - flat, flat + law->mass_scale * fixed->mass);
}

// Forces and diagonal blocks of a batch's springs, the blocks of its edges.
INLINE void add_springs(sonde_batches *body, const sonde_batch_model *fixed, coupled by,
                        const place *at, node_sum *sum) {
  uint32_t first = fixed->first_slot, sound = fixed->whole_count;
  for (uint32_t k = first; by.springs && k < first + fixed->slot_count; ++k)
    add_spring(&body->law, &body->slot[k], k < first + sound ? all(1) : body->share[k],
               body->record, at, sum, &body->tangent[k]);
  if (by.layers) add_layers(body, fixed, at->indentation, sum);
  add_anchor(&body->law, fixed, at, sum);
}

// q += A p without the diagonal blocks.
INLINE void multiply_batch(sonde_batches *body, const sonde_batch_model *fixed, coupled by,
                           reals q[3]) {
  uint32_t first = fixed->first_slot;
  reals along = {0}, slide[3] = {{0}, {0}, {0}};
  for (uint32_t k = first; k < first + fixed->slot_count; ++k) {
    reals p[4];
    if (by.springs) {
      const sonde_slot_tangent *tangent = &body->tangent[k];
      read_quads(body->direction, &tangent->node, p);
      reals pull = tangent->along * dot(tangent->n, p);
      for (int c = 0; c < 3; ++c) q[c] -= pull * tangent->n[c] + tangent->lateral * p[c];
    }
    if (!by.layers) continue;
    const sonde_slot_layer *layer = &body->slot_layer[k];
    read_quads(body->layer_direction, &layer->node, p);
    along += layer->coupling * p[3];
    for (int c = 0; c < 3; ++c) slide[c] += layer->weight * p[c];
  }
  if (!by.layers) return;
  project(fixed->normal, slide);
  real inplane = body->law.stiffness_scale * body->law.inplane;
  for (int c = 0; c < 3; ++c) q[c] += along * fixed->normal[c] - inplane * slide[c];
}

// What the linear system does not see of the move d that x makes: an edge of length L that is left
// sideways by d pulls by k d^2/2L, and the normal springs' slope changes. As an impulse, like the
// residual.
INLINE reals unseen_by_tangent(const sonde_batch_law *law, const sonde_batch_model *fixed,
                               const sonde_batch *at) {
  real reach = law->reach;
  reals moved2 = reach * reach * dot(at->x, at->x);
  reals gap = 1 + dot(fixed->normal, at->u) / fixed->xm;
  gap = larger(gap, all((real)0.05));
  reals slope = fixed->k0 * fixed->area / (fixed->xm * gap * gap * gap);
  return law->force_scale * moved2 * (law->edge.stiffness * fixed->bend + slope);
}
