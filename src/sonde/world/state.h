// Inside of the moving state: arrays by the stage that writes them, one block of memory.
#ifndef SONDE_SRC_STATE_H
#define SONDE_SRC_STATE_H

#include "base/link.h"
#include "sonde/world.h"

enum { SONDE_FACES_PER_BLOCK = 32, SONDE_REFIT_PERIOD = 8 };

// Axis-aligned box of a run of SONDE_FACES_PER_BLOCK faces in face_order.
typedef struct sonde_box {
  sonde_vec3 low, high;
} sonde_box;

// The four integration points of a face; SONDE_OUTSIDE: not inside the probe.
enum { SONDE_POINTS = 4, SONDE_OUTSIDE = 0xffff };
typedef uint16_t sonde_point_planes[SONDE_POINTS];

struct sonde_state {
  const sonde_model *model;
  const sonde_model *tissue; // whose springs act: the model, or `tuned`
  sonde_model tuned;         // shares the model's arrays but for k0_n_m3
  sonde_tuning tuning;
  sonde_world_def def;
  struct sonde_lanes *lanes; // of the fast engine, else NULL
  void *block;               // all arrays below

  double *tuned_k0; // [nodes]

  // motion, written by the update
  uint64_t tick;
  sonde_vec3 *position;  // [nodes] m
  sonde_vec3 *velocity;  // [nodes] m/s
  sonde_vec3 *increment; // [nodes] dv of the last step, the solver's warm start
  sonde_vec3 *probed; // [nodes] m, where contact is evaluated: x + lambda h v before the solution
  sonde_pose probe_pose; // of the last step
  bool has_probe_pose;

  // sleeping, written at the start and the end of a step
  uint8_t *calm;   // [nodes] ticks since the node last moved; asleep at SONDE_CALM_TICKS
  uint8_t *awake;  // [nodes]
  uint32_t *rows;  // [nodes] awake nodes, ascending
  uint32_t *edges; // [edges] with at least one awake end
  uint32_t *pairs; // [edges] with both ends awake
  uint32_t *faces; // [faces] with at least one awake corner
  uint32_t *rim;   // [nodes] sleeping ends of `edges`
  uint8_t *in_rim; // [nodes]
  uint32_t row_count, edge_count, pair_count, face_count, rim_count;
  bool lists_stale; // awake[] changed since the lists were made

  // contact
  uint32_t *face_order; // [faces] sorted along a space-filling curve
  sonde_box *boxes;     // [blocks]
  uint32_t block_count;
  uint32_t *touched; // [nodes] nodes with a share of the volume, ascending
  uint32_t touched_count;
  uint32_t *parent;        // [nodes] union-find over touched nodes
  double *share_m3;        // [nodes] V_i
  uint32_t *touched_faces; // [faces] faces inside the probe, in the order they were found
  uint32_t touched_face_count;
  sonde_point_planes *point_planes; // [faces] of touched faces: the plane nearest to each point
  sonde_vec3 inward;                // direction of the columns: the beam axis of the probe
  sonde_vec3 *gradient;             // [nodes] g_i = dV/dx_i
  sonde_vec3 *contact_force;        // [nodes] of the probe on the node
  sonde_vec3 *lumped;               // [nodes] w_i k of lumped regions, packed per region
  uint32_t *lumped_rows;            // [nodes]
  sonde_rank_one term[SONDE_MAX_REGIONS];
  uint32_t term_count;
  sonde_vec3 *plane_normal; // [max planes] of the probe in the world frame
  double *plane_offset;
  double *plane_weight; // of its distance in the depth: see depth_at()
  sonde_vec3 origin;    // of the probe
  uint32_t plane_count;
  sonde_vec3 ball_centre; // of a ball
  double ball_radius;     // > 0 for a ball
  sonde_contact contact;

  // friction, written at the end of a step
  sonde_vec3 *bond_m;  // [nodes] deflection of the node's bond with the probe
  sonde_vec3 *grip_n;  // [nodes] normal push on the node
  uint64_t *grip_tick; // [nodes] tick of both
  double mu;           // coefficient of the next step

  // assembly and solve
  sonde_block_matrix *matrix;
  sonde_vec3 *force;                       // [nodes] tissue forces
  sonde_vec3 *product;                     // [nodes] K v0
  struct sonde_tissue_node *scratch_nodes; // [nodes]
  sonde_vec3 *right;                       // [nodes] right-hand side
  sonde_vec3 *trial;                       // [nodes] positions kept for a rejected step
  sonde_pcg_scratch scratch;
  sonde_pcg_result solver;

  uint32_t flags;
  uint64_t flag_count;
  sonde_stage_times times;
};

enum { SONDE_CALM_TICKS = 20, SONDE_TRIAL_PERIOD = 32 };

// sonde_state_tune() and another friction with values in their ranges; the friction of a probe that
// slips stays that of a slipping one. @thread tick
SONDE_LINK void sonde_state_retune(sonde_state *state, const sonde_tuning *tuning);
SONDE_LINK void sonde_state_rub(sonde_state *state, const sonde_friction *friction);

// sonde_state_create() with the order of the faces known, NULL: found here.
sonde_status sonde_state_create_ordered(const sonde_model *model, const sonde_world_def *def,
                                        const uint32_t *face_order, sonde_state **state,
                                        sonde_error *error);
// Brings position[] and velocity[] up to date with the fast engine. @thread tick
void sonde_state_publish(sonde_state *state);
// Wakes every node. @thread tick
void sonde_state_wake_all(sonde_state *state);
// Back to rest in the midst of a run: tick and count of flags go on. @thread tick
SONDE_LINK void sonde_state_relax(sonde_state *state);
// Lists of awake rows, edges and pairs from awake[]. @thread tick
void sonde_state_list_awake(sonde_state *state);

// A node's move from a place, kept to 95 % of the gap between its indentation and x_m. @thread tick
sonde_vec3 sonde_bounded_move(const sonde_model *model, uint32_t i, sonde_vec3 from,
                              sonde_vec3 move);

// How a contact law enters the linear system at a step of size h (0: static): scales of K and C.
typedef struct sonde_contact_scales {
  double damping, stiffness;
} sonde_contact_scales;

// Finds the skin inside the probe at probed[]: shares, gradients, touched nodes,
// regions, and wakes the touched. @thread tick
void sonde_contact_detect(sonde_state *state, const sonde_probe *probe, sonde_pose pose);
// Rigid motion of the probe during the step: the point x moves at velocity + spin x (x - origin).
typedef struct sonde_motion {
  sonde_vec3 origin, velocity, spin;
} sonde_motion;

// Pushes at probed[] from the detected volumes, contact_force[], and their terms in the matrix
// (diagonal blocks or rank-one terms). @thread tick
void sonde_contact_apply(sonde_state *state, const sonde_motion *probe,
                         const sonde_contact_scales *scales);
// Pushes at the end of the step by the same linearisation: from probed[] the nodes go on by
// lambda^2 h dv at velocities changed by lambda dv. @thread tick
void sonde_contact_advance(sonde_state *state, const sonde_motion *probe, double lambda, double h);
// Box of the probe in the world. @thread tick
sonde_box sonde_contact_box(const sonde_probe *probe, sonde_pose pose);
// After a step: whether the probe holds skin that rests elsewhere (SONDE_FLAG_INSIDE_OUT). @thread
// tick
bool sonde_contact_carries(const sonde_state *state, const sonde_probe *probe, sonde_pose pose);
// Depth of a point inside the probe and its gradient; false outside. @thread tick
bool sonde_contact_depth(const sonde_state *state, sonde_vec3 x, double *depth, sonde_vec3 *slope);
// The law at the nodes: touched nodes whose point is inside `box`, their pushes, and their pushes
// at the end of the step. @thread tick
void sonde_nodes_detect(sonde_state *state, const sonde_box *box);
void sonde_nodes_apply(sonde_state *state, const sonde_motion *probe,
                       const sonde_contact_scales *scales);
void sonde_nodes_advance(sonde_state *state, const sonde_motion *probe, double lambda, double h);
// One step of the fast engine; false when something is not finite. @thread tick
bool sonde_lane_step(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                     const sonde_motion *motion);
// Force and torque on the probe, forces and centres of the regions from the pushes. @thread tick
void sonde_contact_wrench(sonde_state *state, sonde_vec3 origin);
// Forces of the bonds at the start of a step, or at a point that the nodes reach after moving for
// moved_s at their velocities, and their terms in the matrix and in product[]. @thread tick
void sonde_friction_apply(sonde_state *state, const sonde_motion *probe,
                          const sonde_contact_scales *scales, double moved_s);
// Bonds, normal pushes and the coefficient at the end of the step; adds friction to
// contact_force[]. @thread tick
void sonde_friction_advance(sonde_state *state, const sonde_motion *probe);
// Forgets all bonds. @thread tick
void sonde_friction_release(sonde_state *state);
// No probe: no contact. @thread tick
void sonde_contact_clear(sonde_state *state);

#endif
