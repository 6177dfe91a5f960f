// Inside of the moving state: what every engine shares, arrays by the stage that writes them, one
// block of memory. Motion itself is in the engine's batches; doubles follow when they are asked
// for.
#ifndef SONDE_SRC_STATE_H
#define SONDE_SRC_STATE_H

#include "base/link.h"
#include "sonde/world.h"
#include "tissue/nodes.h"

typedef struct sonde_box {
  sonde_vec3 low, high;
} sonde_box;

// Rigid motion of the probe during the step: the point x moves at velocity + spin x (x - origin).
typedef struct sonde_motion {
  sonde_vec3 origin, velocity, spin;
} sonde_motion;

struct sonde_state {
  const sonde_model *model;
  const sonde_model *tissue; // whose springs act: the model, or `tuned`
  sonde_nodes nodes;         // of the model
  sonde_model tuned;         // shares the model's arrays but for k0_n_m3
  sonde_bulk tuned_bulk;     // of a volumetric model, its arrays shared
  sonde_tuning tuning;
  sonde_world_def def;
  struct sonde_engine_data *engine; // the one that steps
  struct sonde_engine_data
      *precise; // in double precision, of searches for equilibrium; may be NULL
  void *block;  // all arrays below

  double *tuned_k0;     // [nodes]
  uint32_t *face_order; // [faces] sorted along a space-filling curve

  // motion, published by the engine
  uint64_t tick;
  sonde_vec3 *position;  // [nodes] m
  sonde_vec3 *velocity;  // [nodes] m/s
  sonde_vec3 *probed;    // [nodes] m, where contact was evaluated, of touched nodes
  sonde_pose probe_pose; // of the last step
  bool has_probe_pose;
  uint32_t awake_nodes; // in the last step

  // contact
  uint32_t *touched; // [nodes] nodes with a share of the volume, ascending
  uint32_t touched_count;
  uint32_t *parent;          // [nodes] union-find over touched nodes
  double *share_m3;          // [nodes] V_i
  sonde_vec3 inward;         // direction of the columns: the beam axis of the probe
  sonde_vec3 *gradient;      // [nodes] g_i = dV/dx_i
  sonde_vec3 *contact_force; // [nodes] of the probe on the node
  sonde_vec3 *surprise;      // [nodes] by how much pushes after a solution are not those foreseen
  sonde_vec3 *plane_normal;  // [max planes] of the probe in the world frame
  double *plane_offset;
  double *plane_weight; // of its distance in the depth, see plane_slope()
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
// Brings position[] and velocity[] up to date with the engine. @thread tick
void sonde_state_publish(sonde_state *state);
// Wakes every node; the doubles are what counts. @thread tick
void sonde_state_wake_all(sonde_state *state);
// Back to rest in the midst of a run: tick and count of flags go on. @thread tick
SONDE_LINK void sonde_state_relax(sonde_state *state);
// No probe: no contact. @thread tick
void sonde_contact_clear(sonde_state *state);

#endif
