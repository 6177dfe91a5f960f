// The fast engine's data: nodes in slices of 16 along the space-filling curve of the model's
// numbering, everything in single precision, one vector of 16 lanes per quantity and slice.
// Displacements are relative to the rest positions, so that a float resolves 1 nm.
#ifndef SONDE_SRC_LANES_H
#define SONDE_SRC_LANES_H

#include "world/press.h"

#include "sonde/world.h"

// One neighbour of each row of a slice; rows with fewer neighbours have share 0 there.
typedef struct sonde_slot {
  sonde_lane rest[3]; // X_j - X_i
  sonde_lane length;  // at rest
} sonde_slot;

// The face between a row, the neighbour of the slot before and this one, which follow one another
// around the row; zero where there is none. Before the first slot is the row's `last`.
typedef struct sonde_slot_face {
  sonde_lane cot[3]; // half the cotangents at the row, the neighbour before, this one
  sonde_lane bend;   // 1/(gm^2 area) and G of the shear layer
  sonde_lane shear;
} sonde_slot_face;

// Both layers between a row and its neighbour: all that a product reads of a slot.
typedef struct sonde_slot_layer {
  sonde_lane_index node;
  sonde_lane coupling; // s of the block s N_i N_j^T of the shear layer
  sonde_lane weight;   // half the cotangents of both faces: of the in-plane layer
} sonde_slot_layer;

// The neighbour and the edge's block of the matrix, -(along n n^T + lateral I): all that a product
// reads of a slot, in one stream.
typedef struct sonde_slot_tangent {
  sonde_lane_index node;
  sonde_lane n[3], along, lateral;
} sonde_slot_tangent;

typedef struct sonde_slice_model {
  sonde_lane normal[3], place[3], area, k0, xm, limit, mass, yield;
  sonde_lane weight;           // sum of its slots' weights
  sonde_lane_index last, turn; // the neighbour before the first slot, and the slots up to it
  uint32_t first_slot, slot_count;
  uint32_t whole_count;            // slots from the front whose shares are all 1
  uint32_t first_near, near_count; // slices that share an edge with this one
  uint32_t first_face, face_count; // slices of faces with a corner in this one, for the contact
  uint32_t used;                   // rows that are nodes, from the front
  float bend;                      // 1 over the shortest edge at a node, at rest
  sonde_lane place_low[3];         // what single precision leaves of `place`
} sonde_slice_model;

// Of 16 slices at rest: boxes of their nodes, longest edges at one of them. Beyond the last slice
// boxes are inside out.
typedef struct sonde_slice_boxes {
  sonde_lane low[3], high[3], reach;
} sonde_slice_boxes;

typedef struct sonde_slice {
  sonde_lane u[3], v[3]; // at the start of the step: displacement, velocity
  sonde_lane ve[3]; // where forces are evaluated, at u + h ve; starts at v + the last step's change
  sonde_lane factor[6]; // of the diagonal blocks D = L E L^T: l21 l31 l32, 1/e1 1/e2 1/e3
  sonde_lane x[3], r[3], z[3], w[3], p[3], q[3]; // of the conjugate gradients; D z = r
} sonde_slice;

// Numbers of the law and of the step, in single precision.
typedef struct sonde_lane_law {
  float edge_stiffness, edge_damper, edge_compression, edge_pretension;
  float tangential, normal_damping_s;
  float inplane, shear;  // 0: no such layer
  bool springs, layered; // whether edges carry springs, and faces layers
  int exponent;
  float dt, stiffness_scale, damping_scale;
} sonde_lane_law;

typedef struct sonde_lanes sonde_lanes;

// Two parts of a large body, halves of its slices, are stepped beside each other. Within a part
// slices see what those before them moved; of the other part they see the rows that they touch as
// these were when the kernel began, copied behind the body's own rows.
enum { SONDE_PARTS = 2, SONDE_PART_NODES = 16384 };

// What a kernel sums up over the rows of a part.
typedef struct sonde_lane_sums {
  double left2, far2; // r.r, and of what is_near leaves out; of sweeps as each slice found it
  double force2;      // (h F)^2
  double product;     // r.z
  sonde_vec3 reaction_n;
  uint32_t slots;
} sonde_lane_sums;

// Kernels of one instruction set, the first ones over one part; every set gives the same bits.
typedef struct sonde_lane_kernels {
  const char *name;
  // r = h F - M (ve - v), matrix. `sweep`: x = D^-1 r slice by slice, and each sees where those
  // before it went; else the matrix is symmetric, x = 0, z = D^-1 r
  void (*linearise)(sonde_lanes *lanes, uint32_t part, bool sweep, sonde_lane_sums *sums);
  void (*sweep)(sonde_lanes *lanes, uint32_t part, sonde_lane_sums *sums); // x += D^-1 r
  // r after the sweeps, z = D^-1 r
  void (*restart)(sonde_lanes *lanes, uint32_t part, sonde_lane_sums *sums);
  // w = A z, the first time q; returns z.w
  double (*multiply)(sonde_lanes *lanes, uint32_t part, bool first);
  // p = z + beta p, q = w + beta q, x += alpha p, r -= alpha q, z = D^-1 r. The first time p = z.
  void (*advance)(sonde_lanes *lanes, uint32_t part, bool first, float alpha, float beta,
                  sonde_lane_sums *sums);
  // Square of what x leaves unbalanced, see lanes_kernel.c
  double (*bend)(sonde_lanes *lanes, uint32_t part);
  void (*accept)(sonde_lanes *lanes, uint32_t part); // ve += x, records
  // u, v at the end with ve + x, ve and records for the next step; not finite: NaN
  double (*update)(sonde_lanes *lanes, uint32_t part);
  // near_probe: slices with a node in the box, which grows by `edges` times their reach
  void (*near)(sonde_lanes *lanes, const float low[3], const float high[3], float edges);
  // Nodes of these slices from the probe, for their faces; near_code
  void (*locate)(sonde_lanes *lanes);
  void (*hand_on)(sonde_lanes *lanes); // and their solution
  // Pushes where the nodes are evaluated; false where none of the slice is inside.
  bool (*press_faces)(const sonde_lanes *lanes, uint32_t index, sonde_pressed_slice *at,
                      sonde_press_corners *to);
  bool (*press_nodes)(const sonde_lanes *lanes, uint32_t index, sonde_pressed_slice *at,
                      sonde_press_corners *to);
  void (*meet_faces)(const sonde_lanes *lanes, const sonde_pressed_slice *at, bool surprise,
                     sonde_meet_corners *to);
  void (*meet_nodes)(const sonde_lanes *lanes, const sonde_pressed_slice *at, bool surprise,
                     sonde_meet_corners *to);
  // What the ties take from the product of the matrix with vectors [rows][4], into carry[] of
  // press[]: from that of whole rows, or, where they are tied, of what tied[] leaves of them
  void (*carry)(sonde_lanes *lanes, const float *vectors);
} sonde_lane_kernels;

struct sonde_lanes {
  void *block;
  uint32_t node_count, slice_count, face_slice_count, slot_count, near_total, face_total;
  const uint32_t *face_order; // [faces] of the state: slices of faces follow it
  sonde_lane_law law;
  const sonde_lane_kernels *kernels;
  sonde_slice_model *model;
  sonde_slice_boxes *box; // [slices / 16]
  sonde_slice *slice;
  sonde_slot *slot;
  sonde_slot_tangent *tangent;
  sonde_slot_face *slot_face;   // of layered models
  sonde_slot_layer *slot_layer; // as well
  sonde_lane_index *slot_from;  // the same: which face, SONDE_NO_FACE for none
  sonde_lane *share;            // [slots] of a spring: 1, 0 for padding
  sonde_slice_press *press;     // of touched slices, which press_of counts from 1
  uint32_t *press_of;           // [slices] 0: not touched
  uint32_t *pressed;            // those slices
  uint32_t press_count;
  sonde_press_ties *tie; // [4 faces / 16]
  uint32_t tie_count;
  sonde_lane_probe probe;
  float *probe_place;  // [rows][4] from the probe's origin; 1 for nodes of near_probe, else 0
  float *probe_motion; // [rows][4] velocity against the probe
  float *probe_way;    // [rows][4] solution
  sonde_pressed_slice *pressed_slice; // [slices of faces, or of nodes if more] ascending
  uint32_t pressed_slice_count;
  sonde_press_corners *press_corners; // [1] of the slice at hand
  sonde_meet_corners *meet_corners;   // [1]
  uint16_t *touched_rows;             // [slices] lanes that the probe touches
  sonde_lane_index (*face)[3];        // [slices of faces] their corners
  sonde_lane *point_area;             // [slices of faces] a quarter of a face's at rest; 0: no face
  uint32_t *near, *face_near;
  // For the neighbours, of every row where it is evaluated
  float *record; // [rows][8] of springs: u + h ve, ve
  // [rows][8] of layers: tangential displacement, indentation, N.x of what it moved since they
  // looked
  float *slide;
  // and of the directions: z, for springs and ties; its tangential part and N.z for layers.
  float *direction, *layer_direction; // [rows][4]
  uint32_t part_count;
  uint32_t part_slice[SONDE_PARTS + 1]; // first slices
  uint32_t part_seen[SONDE_PARTS + 1];  // of seen[]: those that a part sees of the other
  uint32_t *seen;                       // rows, copied to the rows from slice_count * 16 on
  uint32_t seen_count;
  uint32_t *seen_at; // [rows] where the other part sees a row
  uint32_t *awake;   // slices that take part, ascending
  uint32_t awake_count;
  uint32_t part_awake[SONDE_PARTS + 1]; // of awake[]
  struct sonde_crew *crew;              // NULL: one thread
  uint8_t *is_awake, *calm;
  uint8_t *is_near;    // touched slices and waking ones around them
  uint32_t *near_list; // these
  uint32_t near_count;
  uint64_t *face_marked; // [slices of faces / 64] bits: with a corner near the probe
  uint32_t *face_code;   // [slices of faces] of these: planes that all such corners are beyond
  float *speed2;         // [slices] largest square of a node's speed
  float *way2;           // [slices] and displacement
  float *unrest2;     // [slices] largest square of unbalanced force over the anchors' stiffness: no
                      // node is farther from its equilibrium
  uint8_t *published; // [slices] the doubles of the state are up to date
  uint32_t *near_probe; // slices that the contact looks at
  uint32_t *near_code;  // of these: planes of the probe that all of the slice's nodes are beyond
  uint32_t near_probe_count;
  sonde_vec3 reaction_n;
  uint32_t slot_total;  // of the slices last linearised
  uint64_t bytes_moved; // by the last step, see count_bytes()
  bool stiff;           // too stiff for sweeps
  bool tied;            // ties take part in the linear system at hand
  bool stale;           // the doubles of the state are newer
};

// The numbers of one lane.
static inline sonde_vec3 sonde_lane_vector(const sonde_lane a[3], uint32_t lane) {
  return (sonde_vec3){(double)a[0][lane], (double)a[1][lane], (double)a[2][lane]};
}

// The neighbours of node i around it: where face[k] is one, its corners are i, node[k-1] and
// node[k]; `last` is the one before the first, whose own slot is turn - 1. Room for twice as many
// as there are faces around i.
#define SONDE_NO_FACE UINT32_MAX
typedef struct sonde_fan {
  uint32_t count, last, turn;
  uint32_t *node, *face;
} sonde_fan;
void sonde_lanes_fan(const sonde_model *model, uint32_t i, sonde_fan *fan);

// Lays out the model; NULL where memory is out.
// face_order: faces along a space-filling curve, borrowed; slices of faces follow it.
sonde_status sonde_lanes_create(const sonde_model *model, const sonde_world_def *def,
                                const uint32_t *face_order, sonde_lanes **lanes,
                                sonde_error *error);
void sonde_lanes_destroy(sonde_lanes *lanes);
// Takes over the springs of a model with the same mesh. @thread tick
void sonde_lanes_tune(sonde_lanes *lanes, const sonde_model *tuned, const sonde_world_def *def);
// Takes over displacements and velocities from doubles; wakes every slice, or none.
void sonde_lanes_import(sonde_lanes *lanes, const sonde_vec3 *rest, const sonde_vec3 *position,
                        const sonde_vec3 *velocity, bool awake);
// Directions of zero in `count` slices. @thread tick
void sonde_lanes_still(sonde_lanes *lanes, uint32_t first, uint32_t count);
// The record of one row where it is evaluated. @thread tick
void sonde_lanes_record(sonde_lanes *lanes, uint32_t i);
// Writes positions and velocities that are not up to date as doubles. @thread tick
void sonde_lanes_publish(sonde_lanes *lanes, const sonde_vec3 *rest, sonde_vec3 *position,
                         sonde_vec3 *velocity);
// The widest kernels that this processor runs, or those called `name` (NULL: widest).
const sonde_lane_kernels *sonde_lane_kernels_find(const char *name);
extern const sonde_lane_kernels sonde_lane_kernels_base;
#ifdef __x86_64__
extern const sonde_lane_kernels sonde_lane_kernels_avx2;
extern const sonde_lane_kernels sonde_lane_kernels_avx512;
#endif

#endif
