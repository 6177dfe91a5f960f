// A volumetric body in an engine's kernels: forces and tangent of springs and tetrahedra at the
// rows of a batch. The laws are in tissue/laws.h and elements/material.h, formulas in
// docs/bulk.md.
#ifndef SONDE_SRC_BULK_KERNEL_H
#define SONDE_SRC_BULK_KERNEL_H

#include "elements/material.h"
#include "tissue/bulk/batches.h"

INLINE bulk_tissue *bulk_of(sonde_tissue *tissue) { return (bulk_tissue *)(void *)tissue; }

// Neighbours read displacement, velocity and direction only, which the engine publishes.
INLINE void tissue_publish(sonde_tissue *data, uint32_t s, const sonde_motion_at *at) {
  (void)data, (void)s, (void)at;
}
INLINE void tissue_publish_move(sonde_tissue *data, uint32_t s, const sonde_motion_at *before,
                                const sonde_motion_at *at, const reals x[3]) {
  (void)data, (void)s, (void)before, (void)at, (void)x;
}
INLINE void tissue_publish_direction(sonde_tissue *data, uint32_t s, const reals z[3]) {
  (void)data, (void)s, (void)z;
}

// out += m x of a symmetric block and of a full one.
INLINE void add_symmetric(const reals m[6], const reals x[3], reals out[3]) {
  out[0] += m[0] * x[0] + m[1] * x[1] + m[2] * x[2];
  out[1] += m[1] * x[0] + m[3] * x[1] + m[4] * x[2];
  out[2] += m[2] * x[0] + m[4] * x[1] + m[5] * x[2];
}
INLINE void add_full(const reals m[9], const reals x[3], reals out[3]) {
  for (int i = 0; i < 3; ++i) out[i] += m[3 * i] * x[0] + m[3 * i + 1] * x[1] + m[3 * i + 2] * x[2];
}

// The spring of a slot: its pull on the row, its part of K_ii and its block K_ij.
INLINE void add_slot_spring(const bulk_spring *spring, const sonde_motion_at *at,
                            const reals other[6], reals force[3], reals own[6], reals block[9]) {
  reals d[3];
  for (int c = 0; c < 3; ++c) d[c] = spring->rest[c] + (other[c] - at->ue[c]);
  edge_pull edge = pull_biphasic(&spring->law, spring->length, d);
  for (int c = 0; c < 3; ++c) force[c] += edge.pull * edge.n[c];
  sonde_add_rank_one(own, edge.n, edge.along, edge.lateral);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      block[3 * i + j] = -edge.along * edge.n[i] * edge.n[j] - (i == j ? edge.lateral : all(0));
}

// Block K_ok of a tetrahedron's corners o and k, with gradients g and cofactor products c = C g:
// V (mu g_o.g_k I + bulk c_o c_k^T + pressure [du x F (g_o x g_k)]).
INLINE void solid_block(reals scale, reals mu, reals bulk, reals pressure, const reals f[9],
                        const reals g[2][3], const reals c[2][3], reals block[9]) {
  reals across[3], w[3], flat = scale * mu * dot(g[0], g[1]);
  for (int i = 0; i < 3; ++i) {
    int a = (i + 1) % 3, b = (i + 2) % 3;
    across[i] = g[0][a] * g[1][b] - g[0][b] * g[1][a];
  }
  for (int i = 0; i < 3; ++i) w[i] = scale * pressure * dot(&f[3 * i], across);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      block[3 * i + j] = scale * bulk * c[0][i] * c[1][j] + (i == j ? flat : all(0));
  block[1] += w[2], block[2] -= w[1], block[3] -= w[2];
  block[5] += w[0], block[6] += w[1], block[7] -= w[0];
}

// A tetrahedron at each row: force of the exact stress, and a tangent that is never negative: what
// the pressure adds is held below what would turn a shear stiffness round.
INLINE void add_corner(bulk_tissue *tissue, const bulk_batch *fixed, const bulk_corner *corner,
                       const sonde_motion_at *at, reals force[3], reals own[6]) {
  reals f[9] = {all(1), {0}, {0}, {0}, all(1), {0}, {0}, {0}, all(1)}, p[9], c[9];
  reals g[4][3], cg[4][3];
  for (int i = 0; i < 3; ++i) g[3][i] = all(0);
  for (int k = 0; k < 3; ++k) {
    reals other[6];
    read_records(tissue->common.published[0].place, &corner->node[k], other);
    for (int i = 0; i < 3; ++i) {
      reals apart = other[i] - at->ue[i];
      g[k][i] = corner->gradient[k][i];
      g[3][i] -= g[k][i];
      for (int j = 0; j < 3; ++j) f[3 * i + j] += apart * corner->gradient[k][j];
    }
  }
  reals mu = corner->mu, lambda = corner->lambda, volume = corner->volume;
  material_stress(SONDE_NEO_HOOKEAN, mu, lambda, f, p);
  for (int i = 0; i < 3; ++i) force[i] -= volume * dot(&p[3 * i], g[3]);

  reals growth = cofactors(f, c) - 1, bulk = lambda + mu, pressure = bulk * growth - mu;
  // The largest stretch is at most the root of the largest row's times the largest column's sum.
  reals row = all(0), column = all(0), inverse;
  for (int i = 0; i < 3; ++i) {
    reals along = all(0), down = all(0);
    for (int j = 0; j < 3; ++j) {
      along += larger(f[3 * i + j], -f[3 * i + j]);
      down += larger(f[3 * j + i], -f[3 * j + i]);
    }
    row = larger(row, along), column = larger(column, down);
  }
  root_and_inverse(row * column, &inverse);
  pressure = larger(smaller(pressure, mu * inverse), -mu * inverse);
  for (int k = 0; k < 4; ++k)
    for (int i = 0; i < 3; ++i) cg[k][i] = dot(&c[3 * i], g[k]);
  for (int k = 0; k < 4; ++k) {
    const reals pair[2][3] = {{g[3][0], g[3][1], g[3][2]}, {g[k][0], g[k][1], g[k][2]}};
    const reals turned[2][3] = {{cg[3][0], cg[3][1], cg[3][2]}, {cg[k][0], cg[k][1], cg[k][2]}};
    reals block[9];
    solid_block(volume, mu, bulk, pressure, f, pair, turned, block);
    if (k == 3) {
      own[0] += block[0], own[1] += block[1], own[2] += block[2];
      own[3] += block[4], own[4] += block[5], own[5] += block[8];
      continue;
    }
    for (int l = 0; l < SONDE_BATCH; ++l) {
      bulk_slot *slot = &tissue->slot[fixed->first_slot + (uint32_t)corner->slot[k][l]];
      for (int e = 0; e < 9; ++e) slot->block[e][l] += block[e][l];
    }
  }
}

INLINE void tissue_evaluate(sonde_tissue *data, const sonde_step_scales *step,
                            const sonde_rows *rows, uint32_t s, const sonde_motion_at *at,
                            sonde_row_sum *sum) {
  bulk_tissue *tissue = bulk_of(data);
  const bulk_batch *fixed = &tissue->batch[s];
  const real *places = data->published[0].place;
  bulk_slot *slot = tissue->slot + fixed->first_slot;
  const real damping = tissue->damping_s;
  reals own[6], moved[3], drag[3] = {{0}, {0}, {0}};
  for (int c = 0; c < 6; ++c) own[c] = tissue->constant ? fixed->own[c] : all(0);
  if (!tissue->constant) {
    const reals none[9] = {{0}};
    for (uint32_t k = 0; k < fixed->slot_count; ++k)
      __builtin_memcpy(slot[k].block, none, sizeof none);
    for (uint32_t k = 0; tissue->springs && k < fixed->slot_count; ++k) {
      reals other[6];
      read_records(places, &slot[k].node, other);
      add_slot_spring(&tissue->spring[fixed->first_slot + k], at, other, sum->force, own,
                      slot[k].block);
    }
    for (uint32_t k = 0; tissue->solid && k < fixed->corner_count; ++k)
      add_corner(tissue, fixed, &tissue->corner[fixed->first_corner + k], at, sum->force, own);
  }
  // Dampers; with a constant stiffness all of the force.
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    reals other[6];
    read_records(places, &slot[k].node, other);
    for (int c = 0; c < 3; ++c)
      moved[c] = damping * other[3 + c] + (tissue->constant ? other[c] : all(0));
    add_full(slot[k].block, moved, drag);
  }
  for (int c = 0; c < 3; ++c)
    moved[c] = damping * at->ve[c] + (tissue->constant ? at->ue[c] : all(0));
  add_symmetric(own, moved, drag);
  real scale = tissue->gain * (step->stiffness_scale + damping * step->damping_scale);
  for (int c = 0; c < 3; ++c) sum->force[c] = tissue->gain * (sum->force[c] - drag[c]);
  for (int c = 0; c < 6; ++c) sum->block[c] += scale * own[c];
  for (int c = 0; c < 6; c += c == 0 ? 3 : 2) sum->block[c] += step->mass_scale * rows->mass;
}

INLINE void tissue_multiply(sonde_tissue *data, const sonde_step_scales *step, uint32_t s,
                            reals q[3]) {
  const bulk_tissue *tissue = bulk_of(data);
  const bulk_batch *fixed = &tissue->batch[s];
  reals out[3] = {{0}, {0}, {0}};
  for (uint32_t k = fixed->first_slot; k < fixed->first_slot + fixed->slot_count; ++k) {
    reals p[4];
    read_quads(data->published[0].direction, &tissue->slot[k].node, p);
    add_full(tissue->slot[k].block, p, out);
  }
  real scale = tissue->gain * (step->stiffness_scale + tissue->damping_s * step->damping_scale);
  for (int c = 0; c < 3; ++c) q[c] += scale * out[c];
}

INLINE uint32_t tissue_slots(sonde_tissue *data, uint32_t s) {
  return bulk_of(data)->batch[s].slot_count;
}

INLINE reals tissue_unseen(sonde_tissue *data, const sonde_rows *rows, uint32_t s,
                           const reals u[3]) {
  (void)rows, (void)u;
  return all(bulk_of(data)->batch[s].bend);
}

INLINE void tissue_bound(sonde_tissue *data, uint32_t s, real h, const reals u[3], reals move[3],
                         reals v[3]) {
  (void)data, (void)s, (void)h, (void)u, (void)move, (void)v;
}

#endif
