// The two-layer tissue in an engine's kernels: what neighbours read of a batch, forces and tangent
// of its rows, and the tangent times a direction. The laws are in tissue/laws.h.
#ifndef SONDE_SRC_TWO_LAYER_KERNEL_H
#define SONDE_SRC_TWO_LAYER_KERNEL_H

#include "tissue/two_layer/batches.h"

INLINE two_layer *two_layer_of(sonde_tissue *tissue) { return (two_layer *)(void *)tissue; }

// indentation: where faces are evaluated; unseen: N.x of what was added since.
INLINE void publish_slide(two_layer *tissue, uint32_t s, const reals ue[3], reals indentation,
                          reals unseen) {
  const reals *n = tissue->batch[s].normal;
  reals along = dot(n, ue), slide[4];
  for (int c = 0; c < 3; ++c) slide[c] = ue[c] - along * n[c];
  slide[3] = indentation;
  const reals rest[4] = {unseen, {0}, {0}, {0}};
  real *record = tissue->common.published[1].place + (size_t)s * SONDE_BATCH * SONDE_RECORD;
  write_records(record, SONDE_RECORD, slide);
  write_records(record + 4, SONDE_RECORD, rest);
}

INLINE void tissue_publish(sonde_tissue *data, uint32_t s, const sonde_motion_at *at) {
  two_layer *tissue = two_layer_of(data);
  if (tissue->layered)
    publish_slide(tissue, s, at->ue, -dot(tissue->batch[s].normal, at->ue), (reals){0});
}

INLINE void tissue_publish_move(sonde_tissue *data, uint32_t s, const sonde_motion_at *before,
                                const sonde_motion_at *at, const reals x[3]) {
  two_layer *tissue = two_layer_of(data);
  const reals *n = tissue->batch[s].normal;
  if (tissue->layered) publish_slide(tissue, s, at->ue, -dot(n, before->ue), dot(n, x));
}

INLINE void tissue_publish_direction(sonde_tissue *data, uint32_t s, const reals z[3]) {
  two_layer *tissue = two_layer_of(data);
  if (!tissue->layered) return;
  const reals *n = tissue->batch[s].normal;
  reals along = dot(n, z), parts[4];
  for (int c = 0; c < 3; ++c) parts[c] = z[c] - along * n[c];
  parts[3] = along;
  write_records(data->published[1].direction + (size_t)s * SONDE_BATCH * SONDE_QUAD, SONDE_QUAD,
                parts);
}

// By what neighbours are coupled.
typedef struct coupled {
  bool springs, layers;
} coupled;

// What slots add up to at a batch's rows.
typedef struct node_sum {
  reals shear_force, coupling; // along N
  reals slide[3];              // the neighbours' tangential displacements times their weights
  reals pending;               // along N: what neighbours that went on do by the shear layer
} node_sum;

// The spring-damper of an edge, seen from the row; the neighbour finds the opposite, bit for bit.
INLINE void add_spring(const two_layer *tissue, const sonde_step_scales *step,
                       const two_layer_slot *slot, reals share, const sonde_motion_at *at,
                       sonde_row_sum *sum, two_layer_tangent *tangent) {
  reals d[3], w[3], other[6];
  read_records(tissue->common.published[0].place, &tangent->node, other);
  for (int c = 0; c < 3; ++c) {
    d[c] = slot->rest[c] + (other[c] - at->ue[c]);
    w[c] = other[3 + c] - at->ve[c];
  }
  edge_pull edge = pull_edge(&tissue->edge, share, slot->length, d, w);
  reals steep = step->stiffness_scale * edge.along + step->damping_scale * edge.damper;
  reals flat = step->stiffness_scale * edge.lateral;
  for (int c = 0; c < 3; ++c) {
    sum->force[c] += edge.pull * edge.n[c];
    tangent->n[c] = edge.n[c];
  }
  sonde_add_rank_one(sum->block, edge.n, steep, flat);
  tangent->along = steep;
  tangent->lateral = flat;
}

// What a face does along N to the row, and how it couples the row to both neighbours.
typedef struct face_part {
  reals force, before, here;
} face_part;

INLINE face_part shear_face(real scale, const two_layer_face *face, reals own, reals before,
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
INLINE void add_layers(two_layer *tissue, real scale, const two_layer_batch *fixed, reals own,
                       node_sum *sum) {
  const real *slides = tissue->common.published[1].place;
  two_layer_coupling *slot = tissue->slot_layer + fixed->first_slot;
  const two_layer_face *face = tissue->slot_face + fixed->first_slot;
  reals other[6], before, moved_before, open = {0}, round = {0};
  read_records(slides, &fixed->last, other);
  before = other[3], moved_before = other[4];
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    read_records(slides, &slot[k].node, other);
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

INLINE void add_anchor(const two_layer *tissue, const sonde_step_scales *step,
                       const two_layer_batch *fixed, const sonde_rows *rows,
                       const sonde_motion_at *at, reals s, node_sum *around, sonde_row_sum *sum) {
  const reals *n = fixed->normal;
  reals rate = dot(n, at->ve);
  anchor_push anchor =
      push_anchor(&tissue->anchor, fixed->k0, fixed->xm, fixed->limit, rows->area, s, rate);
  reals push = anchor.push + around->shear_force;
  reals inplane = tissue->inplane * fixed->weight, hold = anchor.tangent + inplane;
  if (tissue->layered) project(n, around->slide);
  for (int c = 0; c < 3; ++c) {
    sum->force[c] += push * n[c] - hold * (at->ue[c] + s * n[c]) -
                     anchor.tangent_damper * (at->ve[c] - rate * n[c]) +
                     tissue->inplane * around->slide[c];
    sum->pending[c] = around->pending * n[c];
  }
  reals flat = step->stiffness_scale * hold + step->damping_scale * anchor.tangent_damper;
  reals steep = step->stiffness_scale * anchor.slope * rows->area +
                step->damping_scale * anchor.damper - around->coupling;
  sonde_add_rank_one(sum->block, n, steep - flat, flat + step->mass_scale * rows->mass);
}

INLINE void evaluate_batch(two_layer *tissue, const sonde_step_scales *step, coupled by,
                           const sonde_rows *rows, uint32_t s, const sonde_motion_at *at,
                           sonde_row_sum *sum) {
  const two_layer_batch *fixed = &tissue->batch[s];
  uint32_t first = fixed->first_slot, sound = fixed->whole_count;
  node_sum around = {{0}, {0}, {{0}}, {0}};
  reals indentation = -dot(fixed->normal, at->ue);
  for (uint32_t k = first; by.springs && k < first + fixed->slot_count; ++k)
    add_spring(tissue, step, &tissue->slot[k], k < first + sound ? all(1) : tissue->share[k], at,
               sum, &tissue->tangent[k]);
  if (by.layers) add_layers(tissue, step->stiffness_scale, fixed, indentation, &around);
  add_anchor(tissue, step, fixed, rows, at, indentation, &around, sum);
}

INLINE void tissue_evaluate(sonde_tissue *data, const sonde_step_scales *step,
                            const sonde_rows *rows, uint32_t s, const sonde_motion_at *at,
                            sonde_row_sum *sum) {
  two_layer *tissue = two_layer_of(data);
  if (tissue->springs && tissue->layered)
    evaluate_batch(tissue, step, (coupled){true, true}, rows, s, at, sum);
  else if (tissue->layered)
    evaluate_batch(tissue, step, (coupled){false, true}, rows, s, at, sum);
  else
    evaluate_batch(tissue, step, (coupled){true, false}, rows, s, at, sum);
}

INLINE void multiply_batch(const two_layer *tissue, const sonde_step_scales *step, coupled by,
                           uint32_t s, reals q[3]) {
  const two_layer_batch *fixed = &tissue->batch[s];
  uint32_t first = fixed->first_slot;
  reals along = {0}, slide[3] = {{0}, {0}, {0}};
  for (uint32_t k = first; k < first + fixed->slot_count; ++k) {
    reals p[4];
    if (by.springs) {
      const two_layer_tangent *tangent = &tissue->tangent[k];
      read_quads(tissue->common.published[0].direction, &tangent->node, p);
      reals pull = tangent->along * dot(tangent->n, p);
      for (int c = 0; c < 3; ++c) q[c] -= pull * tangent->n[c] + tangent->lateral * p[c];
    }
    if (!by.layers) continue;
    const two_layer_coupling *layer = &tissue->slot_layer[k];
    read_quads(tissue->common.published[1].direction, &layer->node, p);
    along += layer->coupling * p[3];
    for (int c = 0; c < 3; ++c) slide[c] += layer->weight * p[c];
  }
  if (!by.layers) return;
  project(fixed->normal, slide);
  real inplane = step->stiffness_scale * tissue->inplane;
  for (int c = 0; c < 3; ++c) q[c] += along * fixed->normal[c] - inplane * slide[c];
}

INLINE void tissue_multiply(sonde_tissue *data, const sonde_step_scales *step, uint32_t s,
                            reals q[3]) {
  const two_layer *tissue = two_layer_of(data);
  if (tissue->springs && tissue->layered)
    multiply_batch(tissue, step, (coupled){true, true}, s, q);
  else if (tissue->layered)
    multiply_batch(tissue, step, (coupled){false, true}, s, q);
  else
    multiply_batch(tissue, step, (coupled){true, false}, s, q);
}

INLINE uint32_t tissue_slots(sonde_tissue *data, uint32_t s) {
  return two_layer_of(data)->batch[s].slot_count;
}

// An edge of length L that is left sideways by d pulls by k d^2/2L, and the normal springs' slope
// changes.
INLINE reals tissue_unseen(sonde_tissue *data, const sonde_rows *rows, uint32_t s,
                           const reals u[3]) {
  const two_layer *tissue = two_layer_of(data);
  const two_layer_batch *fixed = &tissue->batch[s];
  reals gap = 1 + dot(fixed->normal, u) / fixed->xm;
  gap = larger(gap, all((real)0.05));
  reals slope = fixed->k0 * rows->area / (fixed->xm * gap * gap * gap);
  return tissue->edge.stiffness * fixed->bend + slope;
}

// Keeps the indentation below x_m: at most 95 % of the remaining gap per step.
INLINE void tissue_bound(sonde_tissue *data, uint32_t s, real h, const reals u[3], reals move[3],
                         reals v[3]) {
  const two_layer_batch *fixed = &two_layer_of(data)->batch[s];
  reals gap = (real)0.95 * (fixed->xm + dot(fixed->normal, u));
  reals over = -dot(fixed->normal, move) - larger(gap, all(0));
  over = larger(over, all(0));
  for (int c = 0; c < 3; ++c) {
    move[c] += over * fixed->normal[c];
    v[c] += over * fixed->normal[c] / h;
  }
}

#endif
