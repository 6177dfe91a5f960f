// An engine's data: the nodes of a body in batches along the space-filling curve of the model's
// numbering, one vector per quantity and batch, in the precision of base/batch.h. Displacements are
// relative to the rest positions, so that a float resolves 1 nm.
#ifndef SONDE_SRC_BATCHES_H
#define SONDE_SRC_BATCHES_H

#include "world/batch_parts.h"
#include "world/engine.h"

// Two parts of a large body, halves of its batches, are stepped beside each other. Within a part
// batches see what those before them moved; of the other part they see the rows that they touch as
// these were when the kernel began, copied behind the body's own rows.
enum { SONDE_PARTS = 2, SONDE_PART_NODES = 16384 };

// What a kernel sums up over the rows of a part.
typedef struct sonde_batch_sums {
  double residual2;                // r.r; of sweeps as each batch found it
  double far2;                     // of the batches that is_near leaves out
  double force2;                   // (force_scale F)^2
  double product;                  // r.z
  sonde_vec3 reaction_n, holder_n; // sums of the tissue's forces: on all rows, on held ones
  uint32_t slots;
} sonde_batch_sums;

typedef struct sonde_batches sonde_batches;

// Kernels of one instruction set, the first ones over one part; every set gives the same bits.
#define sonde_kernels BY_REAL(sonde_kernels)
typedef struct sonde_kernels {
  const char *name;
  // r of the law's linear system, matrix. `sweep`: x = D^-1 r batch by batch, and each sees where
  // those before it went; else the matrix is symmetric, x = 0, z = D^-1 r
  void (*linearise)(sonde_batches *body, uint32_t part, bool sweep, sonde_batch_sums *sums);
  void (*sweep)(sonde_batches *body, uint32_t part, sonde_batch_sums *sums); // x += D^-1 r
  // r after the sweeps, z = D^-1 r
  void (*restart)(sonde_batches *body, uint32_t part, sonde_batch_sums *sums);
  // w = A z, the first time q; returns z.w
  double (*multiply)(sonde_batches *body, uint32_t part, bool first);
  // p = z + beta p, q = w + beta q, x += alpha p, r -= alpha q, z = D^-1 r. The first time p = z.
  void (*advance)(sonde_batches *body, uint32_t part, bool first, real alpha, real beta,
                  sonde_batch_sums *sums);
  // Square of what x leaves unbalanced, see kernel.c
  double (*bend)(sonde_batches *body, uint32_t part);
  void (*record)(sonde_batches *body, uint32_t s);    // what neighbours read of batch s at ve
  void (*accept)(sonde_batches *body, uint32_t part); // ve += x, records
  // u, v at the end with ve + x, ve and records for the next step; not finite: NaN
  double (*update)(sonde_batches *body, uint32_t part);
  // near_probe: batches with a node in the box, which grows by `edges` times their reach
  void (*near)(sonde_batches *body, const real low[3], const real high[3], real edges);
  // Nodes of these batches from the probe, for their faces; near_code
  void (*locate)(sonde_batches *body);
  void (*locate_moves)(sonde_batches *body); // and their solution
  // Pushes where the nodes are evaluated; false where none of the batch is inside.
  bool (*push_faces)(const sonde_batches *body, uint32_t index, sonde_pushed_batch *at,
                     sonde_push_corners *to);
  bool (*push_nodes)(const sonde_batches *body, uint32_t index, sonde_pushed_batch *at,
                     sonde_push_corners *to);
  void (*advance_faces)(const sonde_batches *body, const sonde_pushed_batch *at, bool surprise,
                        sonde_advance_corners *to);
  void (*advance_nodes)(const sonde_batches *body, const sonde_pushed_batch *at, bool surprise,
                        sonde_advance_corners *to);
  // What the corner couplings take from the product of the matrix with vectors [rows][4], into
  // product[] of contact[]: from that of whole rows, or, where they are coupled, of what
  // neighbours[] leaves of them
  void (*couple_corners)(sonde_batches *body, const real *vectors);
} sonde_kernels;

// One force on many rows: of the law VOLUME, whose matrix is scale (w k)(w k)^T.
typedef struct sonde_region_push {
  uint32_t region, first, count; // of region_row[] and region_weight[]
  double push_n, scale, gain;    // force; of the matrix; of the force by the rows' mean velocity
} sonde_region_push;

// Scratch of steps of a body whose compliance is known (respond.c). Of more touched nodes than it
// has room for, the step is solved with the masses by conjugate gradients.
enum { SONDE_RESPONSE_NODES = 192 };
typedef struct sonde_response {
  uint32_t most, count;       // touched nodes: room; of which `stiffness` is
  bool changed;               // since the last solution
  uint32_t *row;              // [most] these
  double *stiffness, *matrix; // [3 most][3 most]
  double *way, *move, *push;  // [3 most]
} sonde_response;

struct sonde_batches {
  sonde_engine_data common;
  void *block;
  uint32_t face_batch_count, near_total, face_total;
  const uint32_t *face_order; // [faces] of the state: batches of faces follow it
  sonde_step_scales step;
  const sonde_kernels *kernels;
  sonde_nodes nodes;
  sonde_tissue *tissue;   // the deformable model's data
  sonde_rows *rows;       // [batches]
  sonde_batch_boxes *box; // [batches / SONDE_BATCH]
  sonde_batch *batch;
  reals *free; // [batches] of double engines: 1, 0 for held rows
  bool holds;  // some row is held
  // contact
  sonde_batch_contact *contact; // of touched batches, which contact_of counts from 1
  uint32_t *contact_of;         // [batches] 0: not touched
  uint32_t *contact_batch;      // those batches
  uint32_t contact_count;
  sonde_corner_couplings *coupling; // [4 faces / SONDE_BATCH]
  uint32_t coupling_count;
  sonde_region_push region_push[SONDE_MAX_REGIONS];
  uint32_t region_push_count;
  uint32_t *region_row;      // [nodes] of VOLUME
  sonde_vec3 *region_weight; // [nodes] w k
  sonde_batch_probe probe;
  real *probe_place;  // [rows][4] from the probe's origin; 1 for nodes of near_probe, else 0
  real *probe_motion; // [rows][4] velocity against the probe
  real *probe_move;   // [rows][4] solution
  sonde_pushed_batch *pushed; // [batches of faces, or of nodes if more] ascending
  uint32_t pushed_count;
  sonde_push_corners *push_corners;       // [1] of the batch at hand
  sonde_advance_corners *advance_corners; // [1]
  uint16_t *touched_rows;                 // [batches] rows that the probe touches
  wholes (*face)[3];                      // [batches of faces] their corners
  reals *point_area; // [batches of faces] a quarter of a face's at rest; 0: no face
  uint32_t *near, *face_near;
  uint64_t *face_marked; // [batches of faces / 64] bits: with a corner near the probe
  uint32_t *face_code;   // [batches of faces] of these: planes that all such corners are beyond
  uint32_t *near_probe;  // batches that the contact looks at
  uint32_t *near_code;   // of these: planes of the probe that all of the batch's nodes are beyond
  uint32_t near_probe_count;
  // What neighbours read of every row is in the tissue's published[], of which the first is here:
  // displacement and velocity where forces are evaluated, and the direction.
  real *place, *direction;
  uint32_t part_count;
  uint32_t part_batch[SONDE_PARTS + 1]; // first batches
  uint32_t part_seen[SONDE_PARTS + 1];  // of seen[]: those that a part sees of the other
  uint32_t *seen; // rows, copied to the rows from batch_count * SONDE_BATCH on
  uint32_t seen_count;
  uint32_t *seen_at; // [rows] where the other part sees a row
  uint32_t *awake;   // batches that take part, ascending
  uint32_t awake_count;
  uint32_t part_awake[SONDE_PARTS + 1]; // of awake[]
  struct sonde_second_thread *thread;   // NULL: one thread
  uint8_t *is_near;                     // touched batches and waking ones around them
  uint32_t *near_list;                  // these
  uint32_t near_count;
  real *speed2, *moved2; // [batches] as in `common`
  real *unrest2;     // [batches] largest square of unbalanced force over the anchors' stiffness: no
                     // node is farther from its equilibrium
  sonde_batch *base; // [batches] of double engines: where a search for equilibrium is
  sonde_response response; // of a body whose compliance is known
  sonde_vec3 reaction_n, holder_n;
  uint32_t slot_total;  // of the batches last linearised
  bool by_gradients;    // conjugate gradients only: too stiff for sweeps, or double
  bool corners_coupled; // corner couplings take part in the linear system at hand
};

static inline sonde_batches *sonde_batches_of(const sonde_state *state) {
  return (sonde_batches *)(void *)state->engine;
}

// The numbers of one row.
static inline sonde_vec3 sonde_batch_vector(const reals a[3], uint32_t row) {
  return (sonde_vec3){(double)a[0][row], (double)a[1][row], (double)a[2][row]};
}

// High and low parts of a number. Where gcc 12 makes vectors of it, it takes (double)(float)a for
// a: hence volatile.
static inline void sonde_split(double a, real *high, real *low) {
  volatile real rounded = (real)a;
  *high = rounded;
  *low = (real)(a - (double)*high);
}

// One step of the engine; false when something is not finite. @thread tick
#define sonde_batches_step BY_REAL(sonde_batches_step)
bool sonde_batches_step(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                        const sonde_motion *motion);
// The numbers of a step of `def`.
#define sonde_batches_set_step BY_REAL(sonde_batches_set_step)
void sonde_batches_set_step(sonde_batches *body, const sonde_world_def *def);
// Directions of zero in `count` batches. @thread tick
#define sonde_batches_still BY_REAL(sonde_batches_still)
void sonde_batches_still(sonde_batches *body, uint32_t first, uint32_t count);
// Lists the batches that `take` marks. @thread tick
#define sonde_batches_list BY_REAL(sonde_batches_list)
void sonde_batches_list(sonde_batches *body, const uint8_t *take);

// The kernels over all parts of a body, on its one or two threads: the same bits on both.
// @thread tick
#define sonde_parts_linearise BY_REAL(sonde_parts_linearise)
#define sonde_parts_sweep BY_REAL(sonde_parts_sweep)
#define sonde_parts_restart BY_REAL(sonde_parts_restart)
#define sonde_parts_multiply BY_REAL(sonde_parts_multiply)
#define sonde_parts_advance BY_REAL(sonde_parts_advance)
#define sonde_parts_bend BY_REAL(sonde_parts_bend)
#define sonde_parts_accept BY_REAL(sonde_parts_accept)
#define sonde_parts_update BY_REAL(sonde_parts_update)
sonde_batch_sums sonde_parts_linearise(sonde_batches *body, bool sweep);
sonde_batch_sums sonde_parts_sweep(sonde_batches *body);
sonde_batch_sums sonde_parts_restart(sonde_batches *body);
double sonde_parts_multiply(sonde_batches *body, bool first);
sonde_batch_sums sonde_parts_advance(sonde_batches *body, bool first, real alpha, real beta);
double sonde_parts_bend(sonde_batches *body);
void sonde_parts_accept(sonde_batches *body);
double sonde_parts_update(sonde_batches *body);

// Finds touched nodes where the nodes are evaluated and adds pushes and their part of the matrix to
// contact[], with corner couplings and region pushes. @thread tick
#define sonde_batches_detect BY_REAL(sonde_batches_detect)
void sonde_batches_detect(sonde_state *state, sonde_batches *body, const sonde_probe *probe,
                          sonde_pose pose, const sonde_motion *motion);
// contact_force[] at the end of the step by the linear system; with `surprise` the square of the
// difference between these pushes and the ones that nodes meet where they go. @thread tick
#define sonde_batches_advance_contact BY_REAL(sonde_batches_advance_contact)
double sonde_batches_advance_contact(sonde_state *state, sonde_batches *body, bool surprise);
// What corners and regions take from the product of the matrix with the directions, for the
// solver. @thread tick
#define sonde_batches_couple BY_REAL(sonde_batches_couple)
void sonde_batches_couple(sonde_batches *body, const real *vectors);
// Conjugate gradients on a linearised body until |r| <= target; returns |r|. @thread tick
#define sonde_batches_conjugate BY_REAL(sonde_batches_conjugate)
double sonde_batches_conjugate(sonde_batches *body, double target, uint32_t most_iterations,
                               sonde_batch_sums sums, uint32_t *iterations);

// Solves the linear system of a body whose compliance is known into x; the square of the contact's
// impulses, or forces of a search for equilibrium. False: not by this way. @thread tick
#define sonde_batches_respond BY_REAL(sonde_batches_respond)
bool sonde_batches_respond(sonde_state *state, sonde_batches *body, double *force2);

// The widest kernels of a deformable model that this processor runs, or those called `name` (NULL:
// widest).
#define sonde_kernels_find BY_REAL(sonde_kernels_find)
const sonde_kernels *sonde_kernels_find(const sonde_model *model, const char *name);

#endif
