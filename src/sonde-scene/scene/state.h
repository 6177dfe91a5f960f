// Inside of a scene's motion: arrays over slots (docs/scene_theory.md). A node of a deformable body
// is one slot; a rigid body has two: its centre with its velocity, and its spin.
#ifndef SONDE_SRC_SCENE_STATE_H
#define SONDE_SRC_SCENE_STATE_H

#include "scene/scene.h"
#include "contact/contact.h"
#include "tissue/bulk/blocks.h"
#include "tissue/two_layer/linearise.h"

// What a step hands to the next, in one block: copied for substeps, written by snapshots.
typedef struct sonde_scene_motion_head {
  sonde_scene_event event[SONDE_SCENE_FLAGS]; // the first of each flag
  uint64_t tick, flag_count;
  double time_s;
  uint32_t all_flags;
  uint32_t level;      // substeps of dt/2^level
  uint32_t bond_count; // bonds in use
  uint32_t unused;
} sonde_scene_motion_head;

// Friction at a vertex of a touch's bond side (docs/scene_theory.md).
typedef struct sonde_bond {
  sonde_vec3 displacement; // m, since the bond began
  double slip_m_s;         // by which it slipped in the last step
} sonde_bond;

typedef struct sonde_scene_motion {
  void *block;
  size_t fixed; // bytes before the bonds
  sonde_scene_motion_head *head;
  sonde_vec3 *position;     // [slots] m; 0 for spins
  sonde_vec3 *velocity;     // [slots] m/s, rad/s
  sonde_vec3 *increment;    // [slots] of the last step: the solver's start
  sonde_quat *rotation;     // [bodies] world from the body's axes
  sonde_vec3 *hint;         // [touches] last direction out of a into b
  uint32_t *bond_first;     // [touches] 1 + its first bond; 0: it has none
  sonde_vec3 *entry;        // [touches] direction of the contact when it was last shallow; 0: apart
  uint8_t *deep;            // [touches] the contact has been deep since
  uint8_t *release;         // [touches] 1: a was wholly inside b and is not out yet; 2: b inside a
  sonde_pair_measure *pair; // [touches] contact in the last step; kept while both bodies rest
  double *calm_s;           // [bodies] how long a body has been slow
  double *self_j;           // [bodies] energy of a body's contact with itself
  uint8_t *asleep;          // [bodies] 1: it rests until something touches it
  uint8_t *calm;            // [slots] steps at rest of a tissue's node; many: it sleeps
  sonde_bond *bond;         // [bond_capacity] of the touches in contact, one after the other
} sonde_scene_motion;

// A push of one body on another along generalised coordinates: a quantity u (depth of a column or
// volume of a region) grows at the rate sum g.v, and the force on the slots is -f g.
typedef struct sonde_push {
  uint32_t touch; // UINT32_MAX: an attachment, a crease or a body's contact with itself
  uint32_t body;  // that touches itself
  bool pulls;     // an attachment or a crease; contact never pulls
  uint32_t first_row, row_count;
  double value, end_value;  // u at the evaluation and at the end of the step
  double newtons;           // |sum of g on one side|: f times this is the push in N
  double stiffness, damper; // df/du, df/d(du/dt); both 0 where nothing pushes
  double force, end_force;  // f at the evaluation and at the end of the step
  bool dropped;             // would have pulled at the end of the step
} sonde_push;

// Where friction acts: a column of a contact.
typedef struct sonde_grip {
  uint32_t touch, push;
  double share;                 // of the push: N per unit of its f
  uint32_t slot_count, slot[6]; // what moves the point
  double weight[6];             // + on a, - on b; of a rigid body on its centre
  sonde_vec3 tilt[6];           // across the normal: what tilting the face moves the point
  sonde_vec3 arm[2];            // from the centre to the point, rigid sides
  bool bonded;                  // friction acts
  uint32_t bond[3];             // the bonds of the face on the bond side
  double bond_weight[3];
  sonde_vec3 point[2];          // on a and on b, world
  sonde_vec3 normal;            // out of a into b
  sonde_vec3 displacement;      // b of the point at the start of the step, across
  double mu, stiffness, damper; // coefficient now; of the bond at the evaluation
  sonde_vec3 force, end_force;  // of friction on a
  uint32_t term_count;          // tangents that resist: 2 sticking, 1 slipping
  sonde_vec3 tangent[2];
} sonde_grip;

typedef struct sonde_inertia {
  sonde_mat3 start;   // world, at the start of the step
  sonde_vec3 angular; // angular momentum then
} sonde_inertia;

struct sonde_scene_state {
  const sonde_scene *scene;
  sonde_scene_motion now, undo;    // undo: the start of a step, for one that fails
  sonde_scene_motion saved, whole; // of step doubling: the start, and the single step's end
  void *block;                     // all arrays below
  uint32_t bond_capacity, surface_count;

  // the point at which forces are evaluated
  sonde_vec3 *stage_position, *stage_velocity; // [slots]
  sonde_quat *stage_rotation;                  // [bodies]
  sonde_vec3 *surface;                         // [surface vertices]
  uint32_t *surface_first;                     // [bodies]
  sonde_inertia *inertia;                      // [bodies]
  double *reach_m;                             // [bodies] of a rigid body's vertices
  double *thickness_m;                         // [bodies] volume over area at rest
  double *section_m2;         // [bodies] mean section at rest: a quarter of the area
  sonde_bounds *displacement; // [bodies] scratch: box of the vertices' displacements
  sonde_bounds *cast_box;     // [bodies] scratch: box of the vertices
  bool *cast_known;           // [bodies] scratch: cast_box has been made
  bool *fitted;               // [bodies] surface and tree are those of the sleeping body
  sonde_mat3 *body_inverse;   // [bodies] inverse inertia in the body's frame
  sonde_bulk_blocks **solid;  // [bodies] of volumetric bodies

  // contact
  sonde_face_tree **tree;    // [bodies], NULL for what never touches
  sonde_overlap *overlap[2]; // one for all touches with a column per piece, one for three columns
  sonde_sweep *sweep;
  uint32_t *touch_of; // [bodies^2] touch + 1
  uint32_t (*near)[2];
  uint32_t near_capacity;
  uint32_t *near_touch, near_touch_count; // touches whose bodies' boxes meet
  sonde_vec3 *found_hint;                 // [touches] direction of the largest region
  sonde_bounds *bounds;                   // [bodies]
  sonde_push *pushes;                     // [push_capacity]
  sonde_grip *grips;                      // [grip_capacity]
  sonde_rank_one *terms;                  // [term_capacity]
  uint32_t *rows;                         // [row_capacity] pool
  sonde_vec3 *g;                          // [row_capacity] pool
  uint32_t push_count, grip_count, term_count, row_count, bulk_terms;
  uint32_t push_capacity, grip_capacity, term_capacity, row_capacity;
  uint32_t bulk_row_count, bulk_row_capacity; // rows at the pool's start, of enclosed volumes
  double *bond_load;                          // [bond_capacity] scratch
  sonde_bond *bond_sum;                       // [bond_capacity] scratch

  // assembly and solve
  sonde_block_matrix *matrix;
  sonde_mat3 *plain_diagonal;                  // [slots]
  sonde_vec3 *force, *product;                 // [slots] of the bodies themselves
  sonde_vec3 *contact_force, *contact_product; // [slots]
  sonde_vec3 *residual, *change, *move, *gain; // [slots]
  sonde_vec3 *mean_velocity;                   // [slots] scratch
  bool listed;                                 // the lists below are those of what is awake
  uint32_t *active_rows, *active_pairs;
  uint32_t active_row_count, active_pair_count;
  uint32_t *moving, moving_count; // the active rows and the slots of driven bodies
  uint32_t *moved_faces;          // [faces] of tissues, at the last search for contacts
  uint32_t *face_first;           // [bodies] in moved_faces
  uint32_t *moved_count;          // [bodies] UINT32_MAX: all have to be looked at
  sonde_tissue_part *part;        // [bodies] the waking part of a tissue
  uint32_t *part_rows, *part_rim, *part_edges, *part_faces; // [slots], [slots], [pairs], [faces]
  uint8_t *in_rim;                                          // [slots] scratch
  uint32_t *island;                                         // [bodies]
  bool *loose;                                              // [bodies] nothing outside holds it
  bool *keeps_awake, *is_held;                              // [bodies] scratch of falling asleep
  sonde_pcg_scratch scratch;
  sonde_tissue_node *tissue_nodes;
  sonde_scene_report report;
  sonde_scene_event noted[SONDE_SCENE_FLAGS]; // in this step
};

// Turns by spin * time (exponential map).
sonde_quat sonde_quat_advance(sonde_quat rotation, sonde_vec3 spin, double time_s);
// Spin that turns one orientation into another in a time, the shorter way.
sonde_vec3 sonde_spin_between(sonde_quat from, sonde_quat to, double time_s);
// R I R^T.
sonde_mat3 sonde_inertia_world(sonde_mat3 inertia, sonde_quat rotation);
// Orientation after turning for time_s at the spin that the angular momentum has there; *spin
// receives it.
sonde_quat sonde_rigid_advance(const sonde_scene_state *state, uint32_t body, sonde_quat from,
                               sonde_vec3 angular, double time_s, sonde_vec3 *spin);
// Velocities of driven bodies over a step, inertias and angular momenta at its start. @thread tick
void sonde_rigid_begin(sonde_scene_state *state, double h);
// Stage at the start of the step. @thread tick
void sonde_stage_start(sonde_scene_state *state);
// Stage lambda of a step with the increments dv. @thread tick
void sonde_stage_at(sonde_scene_state *state, const sonde_vec3 *dv, double h);
// End of the step. False when something is not finite. @thread tick
bool sonde_stage_finish(sonde_scene_state *state, const sonde_vec3 *dv, double h);
// Vertices of a body's surface at given positions and rotations. @thread tick
void sonde_surface_at(const sonde_scene_state *state, uint32_t body, const sonde_vec3 *position,
                      const sonde_quat *rotation, sonde_vec3 *vertices);

// Forces, matrix (mass, damping, stiffness scaled) and K v of a body of springs. @thread tick
void sonde_network_linearise(sonde_scene_state *state, uint32_t body,
                             const sonde_tissue_scales *scales);
double sonde_network_energy(const sonde_body *body, const sonde_vec3 *position);
double sonde_network_volume(const sonde_body *body, const sonde_vec3 *position);

// The solver's rows and pairs, and the waking parts of tissues. @thread tick
void sonde_sleep_list(sonde_scene_state *state);
// Puts tissues to sleep that are at rest in the beginning.
void sonde_sleep_start(sonde_scene_state *state);
// The same at the start of a step; bodies that may not sleep are woken. @thread tick
void sonde_sleep_begin(sonde_scene_state *state);
// Wakes what contacts push; true when something slept: the bodies have to be linearised again.
// @thread tick
bool sonde_sleep_wake_touched(sonde_scene_state *state);
// Puts nodes and bodies at rest to sleep and wakes nodes beside movers, at the end of a step of h.
// @thread tick
void sonde_sleep_rest(sonde_scene_state *state, double h);
// Whether a body will not move in this step unless it is woken. @thread tick
bool sonde_body_rests(const sonde_scene_state *state, uint32_t body);
static inline bool sonde_touch_rests(const sonde_scene_state *state, uint32_t t) {
  const sonde_touch *touch = &state->scene->touches[t];
  return sonde_body_rests(state, touch->a) && sonde_body_rests(state, touch->b);
}
// Wakes sleeping bodies that touch others, and what they rest with; true when one slept.
// @thread tick
bool sonde_sleep_wake_bodies(sonde_scene_state *state);

// One step of size h. @thread tick
void sonde_step_once(sonde_scene_state *state, double h);
// The same in as many parts as it takes for no body to pass through another. @thread tick
void sonde_step_guarded(sonde_scene_state *state, double h);
void sonde_scene_motion_copy(sonde_scene_motion *to, const sonde_scene_motion *from);
// Bytes of a motion with the bonds in use.
size_t sonde_scene_motion_bytes(const sonde_scene_motion *motion);
// Ends all bonds.
void sonde_scene_motion_unbond(sonde_scene_motion *motion);

#endif
