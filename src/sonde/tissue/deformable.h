// What an engine and a deformable model know of each other (docs/tissue.md, "A model of one's
// own"), in the precision of base/batch.h. A model is a folder of this room: a sonde_tissue_calls,
// and a kernel.h of inlined functions, which the engine's kernels are compiled with.
#ifndef SONDE_SRC_DEFORMABLE_H
#define SONDE_SRC_DEFORMABLE_H

#include "base/batch.h"
#include "tissue/nodes.h"

// Numbers of a step. With y the change of ve, the linear system is
// (mass_scale M + damping_scale C + stiffness_scale K) y = force_scale F - mass_scale M (ve - v).
typedef struct sonde_step_scales {
  real dt, lambda;
  real reach; // how far ve takes a node: lambda dt
  real force_scale, mass_scale, damping_scale, stiffness_scale;
} sonde_step_scales;

// A batch of nodes at rest. Rows beyond `used` have no area, mass 1, and are in no box.
typedef struct sonde_rows {
  reals place[3], area, mass;
  reals yield;        // 1 over the least stiffness of the springs that hold a node alone; model's
  reals place_low[3]; // what the precision leaves of `place`
  uint32_t used;      // rows that are nodes, from the front
  uint32_t first_near, near_count; // batches that share an edge with this one
  uint32_t first_face, face_count; // batches of faces with a corner in this one, for the contact
} sonde_rows;

// What neighbours read of every row, either NULL: a record [rows][8] of the place where forces are
// evaluated, and [rows][4] of the direction of the conjugate gradients.
typedef struct sonde_published {
  real *place, *direction;
} sonde_published;
enum { SONDE_PUBLISHED = 2 };

// The motion of a batch's rows where forces are evaluated: displacement and velocity.
typedef struct sonde_motion_at {
  reals ue[3], ve[3];
} sonde_motion_at;

// What a model finds at a batch's rows: forces; the diagonal blocks of
// mass_scale M + damping_scale C + stiffness_scale K, xx xy xz yy yz zz; and what neighbours that
// moved since they published a place do to a row, by the blocks between them.
typedef struct sonde_row_sum {
  reals force[3], block[6], pending[3];
} sonde_row_sum;

typedef struct sonde_layout sonde_layout;
#define sonde_tissue_calls BY_REAL(sonde_tissue_calls)
typedef struct sonde_tissue_calls sonde_tissue_calls;

// A model's data of one body in one precision; the first member of a model's own struct.
typedef struct sonde_tissue {
  const sonde_tissue_calls *calls;
  // [0]: u + reach ve, ve and z themselves, by the engine; [1]: by the model
  sonde_published published[SONDE_PUBLISHED];
  bool reads_rows; // neighbours read published[0]
  bool is_stiff;   // springs outweigh masses: sweeps from batch to batch would need many
  // Of a body whose stiffness K is constant and whose masses are left out: the displacements
  // [3 rows][batches][3] by a unit force along each axis of each row, K^-1. NULL: not known.
  const reals *compliance;
  real gain, damping_s; // of such a body: the present K over that of `compliance`; C over K
  // Vectors that a slot's evaluation, and its product with a direction, read and write at least.
  uint32_t evaluated_per_slot, multiplied_per_slot;
} sonde_tissue;

// How an engine lays a body out.
struct sonde_layout {
  sonde_nodes nodes;
  uint32_t batch_count, part_count, seen_count;
  const uint32_t *part_batch; // [parts + 1] first batches
  const uint32_t *seen_at;    // [rows] where the other part sees a row
};

// Which part a row belongs to.
static inline uint32_t sonde_part_of(const sonde_layout *layout, uint32_t row) {
  return layout->part_count > 1 && row / SONDE_BATCH >= layout->part_batch[1];
}

// Where row i reads what row j has published.
static inline whole sonde_seen_from(const sonde_layout *layout, uint32_t i, uint32_t j) {
  return (whole)(sonde_part_of(layout, i) == sonde_part_of(layout, j) ? j : layout->seen_at[j]);
}

// Rows that are published: a body's own and those that parts see of each other.
static inline size_t sonde_published_rows(const sonde_layout *layout) {
  return (size_t)layout->batch_count * SONDE_BATCH + layout->seen_count;
}

struct sonde_tissue_calls {
  // Fills `yield` of rows[]; published[1] where the model uses it.
  sonde_status (*create)(const sonde_model *model, const sonde_layout *layout,
                         const sonde_step_scales *step, sonde_rows *rows, sonde_tissue **tissue,
                         sonde_error *error);
  void (*destroy)(sonde_tissue *tissue);
  // Takes over the springs of a model with the same mesh. @thread tick
  void (*tune)(sonde_tissue *tissue, const sonde_model *tuned, const sonde_step_scales *step,
               sonde_rows *rows);
};

// Vectors for so many numbers.
static inline uint32_t sonde_vectors_of(uint32_t count) {
  return (count + SONDE_BATCH - 1) / SONDE_BATCH;
}

// block += scale N N^T + flat I.
INLINE void sonde_add_rank_one(reals block[6], const reals n[3], reals scale, reals flat) {
  reals x = scale * n[0], y = scale * n[1];
  block[0] += x * n[0] + flat;
  block[1] += x * n[1];
  block[2] += x * n[2];
  block[3] += y * n[1] + flat;
  block[4] += y * n[2];
  block[5] += scale * n[2] * n[2] + flat;
}

#endif
