// A volumetric body evaluated by its kernel and handed out node by node.
#define SONDE_REAL_DOUBLE
#include "tissue/bulk/blocks_inside.h"
#include "tissue/bulk/kernel.h"

#include "base/base.h"
#include "base/maths.h"

void sonde_bulk_linearise(sonde_bulk_blocks *blocks, const sonde_vec3 *position,
                          const sonde_vec3 *velocity, const sonde_tissue_scales *scales,
                          sonde_vec3 *force, sonde_vec3 *stiffness_velocity,
                          sonde_block_matrix *matrix) {
  const sonde_bulk *bulk = blocks->model->bulk;
  bulk_tissue *tissue = bulk_of(blocks->tissue);
  uint32_t n = matrix->row_count, pair = 0;
  SONDE_ASSERT(n <= bulk->node_count && sonde_vectors_of(n) == blocks->batch_count);
  for (uint32_t i = 0; i < n; ++i) {
    real *record = blocks->place + (size_t)i * SONDE_RECORD;
    sonde_vec3 u = v_sub(position[i], bulk->node[i]);
    record[0] = u.x, record[1] = u.y, record[2] = u.z;
    record[3] = velocity[i].x, record[4] = velocity[i].y, record[5] = velocity[i].z;
  }
  // The kernel leaves K alone in its blocks; C is damping_s times K.
  const sonde_step_scales step = {.stiffness_scale = 1};
  double scale = scales->stiffness + scales->damping * tissue->damping_s;
  for (uint32_t s = 0; s < blocks->batch_count; ++s) {
    const bulk_batch *fixed = &tissue->batch[s];
    sonde_motion_at at;
    sonde_row_sum sum = {0};
    reals kv[3] = {{0}, {0}, {0}};
    for (uint32_t l = 0; l < SONDE_BATCH; ++l)
      for (int c = 0; c < 3; ++c) {
        const real *record = blocks->place + ((size_t)s * SONDE_BATCH + l) * SONDE_RECORD;
        at.ue[c][l] = record[c], at.ve[c][l] = record[3 + c];
      }
    tissue_evaluate(blocks->tissue, &step, &blocks->rows[s], s, &at, &sum);
    // K v, with the gain that the blocks of neighbours do not hold yet.
    for (uint32_t k = 0; k < fixed->slot_count; ++k) {
      const bulk_slot *slot = &tissue->slot[fixed->first_slot + k];
      reals other[6];
      read_records(blocks->place, &slot->node, other);
      add_full(slot->block, &other[3], kv);
    }
    for (int c = 0; c < 3; ++c) kv[c] *= all(tissue->gain);
    add_symmetric(sum.block, at.ve, kv);
    for (uint32_t l = 0; l < SONDE_BATCH; ++l) {
      uint32_t i = s * SONDE_BATCH + l;
      if (i >= n) break;
      force[i] = vec3(sum.force[0][l], sum.force[1][l], sum.force[2][l]);
      stiffness_velocity[i] = vec3(kv[0][l], kv[1][l], kv[2][l]);
      double own[6];
      for (int c = 0; c < 6; ++c) own[c] = scale * sum.block[c][l];
      sonde_mat3 diagonal = {
          {{own[0], own[1], own[2]}, {own[1], own[3], own[4]}, {own[2], own[4], own[5]}}};
      for (int c = 0; c < 3; ++c) diagonal.m[c][c] += scales->mass * bulk->mass_kg[i];
      matrix->diagonal[i] = diagonal;
      for (uint32_t k = bulk->start[i]; k < bulk->start[i + 1]; ++k) {
        if (bulk->neighbour[k] < i) continue;
        const bulk_slot *slot = &tissue->slot[fixed->first_slot + k - bulk->start[i]];
        double *to = &matrix->upper[pair++].m[0][0];
        for (int e = 0; e < 9; ++e) to[e] = scale * tissue->gain * slot->block[e][l];
      }
    }
  }
  SONDE_ASSERT(pair == matrix->pair_count);
}
