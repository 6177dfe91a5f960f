/**
 * @file world.h
 * One tick of the scene: contact of a convex probe with the deformable skin, the implicit step,
 * the wrench on the probe.
 */
#ifndef SONDE_WORLD_H
#define SONDE_WORLD_H

#include "sonde/sparse.h"
#include "sonde/tissue.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_MAX_REGIONS = 8 };

/** How contact pushes (docs/world.md). */
typedef enum sonde_contact_law {
  SONDE_CONTACT_FOUNDATION, /**< pressure kappa*depth + mu*rate at points of the skin, along the
                                 probe's nearest face: follows the probe's shape */
  SONDE_CONTACT_VOLUME, /**< eq. (2): one force kappa V + mu dV/dt per region along its direction,
                             spread by projected nodal area */
  SONDE_CONTACT_NODES,  /**< the pressure of the foundation at the nodes, times their area: cheaper,
                             coarser at the probe's rim */
} sonde_contact_law;

/** How a step is computed (docs/world.md). */
typedef enum sonde_engine {
  SONDE_ENGINE_DOUBLE, /**< double precision, every option */
  SONDE_ENGINE_FAST,   /**< the same code in single precision; implicitness 1, not VOLUME */
} sonde_engine;

/**
 * Friction of the probe on the skin (docs/world.md): Coulomb with bonds that stick, the coefficient
 * falling from mu_static to mu_kinetic with the slip speed (Stribeck) and towards mu_gel with the
 * gel film. mu_static = 0: none, whatever the rest.
 */
typedef struct sonde_friction {
  double mu_static, mu_kinetic; /**< of dry skin, 0 <= mu_kinetic <= mu_static; default 0 */
  double stribeck_speed_m_s;    /**< default 0.01 */
  double gel_film;              /**< thickness over the one that lubricates by 1/e; default 0 */
  double mu_gel;                /**< of a full film; default 0.05 */
} sonde_friction;

/** mu_gel + (mu_dry - mu_gel) e^-film, mu_dry = mu_kinetic + (mu_static - mu_kinetic) e^-(v/vs)^2;
 * 0 when mu_static is 0. @thread any (tick) */
SONDE_API double sonde_friction_coefficient(const sonde_friction *friction, double slip_m_s);

/** Options of a world; all validated at creation. */
typedef struct sonde_world_def {
  uint32_t version;           /**< SONDE_DEF_VERSION, from sonde_world_def_default() */
  double dt_s;                /**< step; default 1e-3 */
  double implicitness;        /**< lambda in [0,1]; default 1 (backward Euler) */
  uint32_t newton_iterations; /**< from the last step's change of velocity; default 3. At most:
                                   fewer where the next would change less than the solver leaves.
                                   0: eq. (4) as in the paper, linearised once (DOUBLE) */
  sonde_engine engine;        /**< default FAST, what a trainee feels */
  sonde_pcg_options pcg;      /**< default relative 1e-2, 1 mN over a step, at most 200 */
  sonde_contact_law contact_law;
  double contact_stiffness_n_m3; /**< kappa; default 5e8 */
  double contact_damping_n_s_m3; /**< mu; default 1e5 */
  double sleep_displacement_m;   /**< a node slower than this per 10 ms for 20 steps sleeps until a
                                      neighbour moves; 0 keeps all awake; default 20e-6 */
  sonde_friction friction;       /**< default none */
  uint32_t threads; /**< FAST: 1 or 2, default 1 (0 is 1). With 2 another thread steps half of a
                       body of 16,384 nodes and more: the same bits, and it waits in a loop while
                         steps follow one another. Smaller bodies are stepped by one */
} sonde_world_def;

SONDE_API sonde_world_def sonde_world_def_default(void); /**< @thread any */

/** A connected patch of skin inside the probe. */
typedef struct sonde_contact_region {
  double volume_m3;
  double volume_rate_m3_s;
  double area_m2;       /**< clipped skin area */
  double force_n;       /**< along the direction */
  sonde_vec3 direction; /**< k: unit, from the tissue to the probe */
  sonde_vec3 centre_m;  /**< force-weighted centre, world */
  double depth_max_m;   /**< deepest residual interpenetration */
  uint32_t node_count;
} sonde_contact_region;

/** Bits of sonde_state.flags; physical trouble is flagged and counted, never fatal. */
enum {
  SONDE_FLAG_NON_FINITE = 1u << 0,    /**< state was restored to rest, force is zero */
  SONDE_FLAG_NOT_CONVERGED = 1u << 1, /**< linear solver hit its iteration limit */
  SONDE_FLAG_CONTACT_FULL = 1u << 2,  /**< more contacts than the fixed capacity */
  SONDE_FLAG_INSIDE_OUT = 1u << 3,    /**< pushed skin rests more than CARRIED beside the probe's
                                           box, or all of it more than CAUGHT (docs/world.md) */
};
#define SONDE_CARRIED_M 40e-3 /**< a press carries skin along by some 3 mm, a slide by 10 */
#define SONDE_CAUGHT_M 10e-3

/** Time spent per stage of the last step, seconds. */
typedef struct sonde_stage_times {
  double contact_s, assembly_s, solve_s, update_s;
} sonde_stage_times;

/** What one tick leaves behind for readers. */
typedef struct sonde_contact {
  uint32_t region_count;
  sonde_contact_region region[SONDE_MAX_REGIONS];
  sonde_vec3 force_n;    /**< on the probe, world */
  sonde_vec3 torque_n_m; /**< on the probe about its origin, world */
  sonde_vec3 reaction_n; /**< sum of the tissue's anchors (normal and tangential springs) */
  double volume_m3, area_m2;
} sonde_contact;

/** Everything that moves. Opaque arrays are reached by the functions below. */
typedef struct sonde_state sonde_state;

/** Rest state of a model. @param model borrowed, must outlive the state @thread owner */
SONDE_API sonde_status sonde_state_create(const sonde_model *model, const sonde_world_def *def,
                                          sonde_state **state, sonde_error *error);
SONDE_API void sonde_state_destroy(sonde_state *state); /**< @thread owner */
/** Back to rest, tick 0, no probe history. @thread owner of the state */
SONDE_API void sonde_state_reset(sonde_state *state);

/**
 * Advances one step with the probe at world_from_probe (its pose at the end of the step; the
 * velocity follows from the previous pose). NULL probe: nothing touches.
 * @thread tick (no allocation, no locks, no I/O)
 */
SONDE_API void sonde_step(sonde_state *state, const sonde_probe *probe,
                          sonde_pose world_from_probe);

/** Result of a search for static equilibrium. */
typedef struct sonde_settle_result {
  bool converged;      /**< |unbalanced force| is within the residual: *an* equilibrium */
  uint32_t iterations; /**< Newton iterations */
  double residual;     /**< |unbalanced force| / |contact force| */
  double contact_n;    /**< |force on the probe| */
  double reaction_n;   /**< |tissue reaction| */
  /** Deepest place of the skin inside the probe before the first iteration (0 without a probe).
   * Beyond SONDE_SETTLE_NEAR_M the probe came from far: skin deep inside it may be pushed out at
   * its sides, and the force is that of one of several equilibria, 10 to 30 % off. */
  double start_depth_m;
} sonde_settle_result;

/** sonde_settle_result.start_depth_m up to which the equilibrium is that of a slow press. */
#define SONDE_SETTLE_NEAR_M 1e-3

/**
 * *An* equilibrium with the probe held still, near the present positions: Newton with line search
 * on the total energy, all nodes awake, velocities zeroed, without friction. A pressed skin has
 * several equilibria; which one is found depends on where the search starts. For the one that a
 * hand meets use sonde_settle_path(); this function is for a probe that has hardly moved since the
 * state was last at rest (start_depth_m says whether it was so).
 * @param relative_residual e.g. 1e-9
 * @thread owner of the state
 */
SONDE_API sonde_settle_result sonde_settle(sonde_state *state, const sonde_probe *probe,
                                           sonde_pose world_from_probe, double relative_residual,
                                           uint32_t max_iterations);

/**
 * Static equilibrium with prescribed nodes (a bonded footprint): the listed nodes are held at the
 * given positions, all others are free.
 * @param force_n receives the sum of the forces that hold them (on the holder)
 * @thread owner of the state
 */
SONDE_API sonde_settle_result sonde_settle_bonded(sonde_state *state, const uint32_t *nodes,
                                                  const sonde_vec3 *positions_m, uint32_t count,
                                                  double relative_residual, uint32_t max_iterations,
                                                  sonde_vec3 *force_n);

/** Changes the friction from the next step on. @return ARGUMENT naming the value out of range
 * @thread owner, between steps */
SONDE_API sonde_status sonde_state_set_friction(sonde_state *state, const sonde_friction *friction,
                                                sonde_error *error);

/** Springs beside those of the model. A spring's damper is a time of its stiffness: it goes along.
 */
typedef struct sonde_tuning {
  double stiffness_scale;                  /**< of every spring, 0.01 to 100; default 1 */
  double damping_scale;                    /**< of every damper, 0 to 1000; default 1 */
  double normal_damping_s, edge_damping_s; /**< 0 to 100; NaN, the default: the model's */
} sonde_tuning;
/** @thread any */
SONDE_API sonde_tuning sonde_tuning_default(void);
/** Changes the springs of a state from the next step on and wakes every node; the model stays.
 * @return ARGUMENT naming the value out of range @thread owner, between steps */
SONDE_API sonde_status sonde_state_tune(sonde_state *state, const sonde_tuning *tuning,
                                        sonde_error *error);

/**
 * Cuts the skin between two steps (sonde_model_cut) along a path on the skin as it is now. The new
 * state goes on where the old one is: positions, velocities, contact memory, tick, probe; mass,
 * momentum and energy are equal. Both stay as they are when the cut fails.
 * @param before goes on as it is; no longer needed afterwards, nor is its model
 * @param[out] model,after new, owned by the caller; `after` borrows `model`
 * @param[out] map NULL, or filled; sonde_cut_map_clear()
 * @return ARGUMENT as sonde_model_cut, MEMORY
 * @thread owner, between steps
 */
SONDE_API sonde_status sonde_state_cut(sonde_state *before, const sonde_vec3 *path_m,
                                       uint32_t count, sonde_model **model, sonde_state **after,
                                       sonde_cut_map *map, sonde_error *error);

SONDE_API const sonde_model *sonde_state_model(const sonde_state *state);   /**< @thread any */
SONDE_API const sonde_world_def *sonde_state_def(const sonde_state *state); /**< @thread tick */
SONDE_API uint64_t sonde_state_tick(const sonde_state *state);              /**< @thread tick */
SONDE_API double sonde_state_time(const sonde_state *state);                /**< @thread tick */
/** [nodes] m; may bring them up to date in the state first. @thread tick */
SONDE_API const sonde_vec3 *sonde_state_positions(sonde_state *state);
/** The same for velocities, [nodes] m/s. @thread tick */
SONDE_API const sonde_vec3 *sonde_state_velocities(sonde_state *state);
/** Overwrites the motion (tests, snapshots); wakes every node. Either may be NULL. @thread owner */
SONDE_API void sonde_state_set(sonde_state *state, const sonde_vec3 *positions,
                               const sonde_vec3 *velocities);
SONDE_API const sonde_contact *sonde_state_contact(const sonde_state *state); /**< @thread tick */
/** Force of the probe on each node at the last step, world (N). [nodes] @thread tick */
SONDE_API const sonde_vec3 *sonde_state_contact_forces(const sonde_state *state);
SONDE_API sonde_pcg_result sonde_state_solver(const sonde_state *state); /**< @thread tick */
SONDE_API uint32_t sonde_state_awake(const sonde_state *state);          /**< @thread tick */
SONDE_API uint32_t sonde_state_flags(const sonde_state *state);          /**< @thread tick */
SONDE_API uint64_t sonde_state_flag_count(const sonde_state *state);     /**< @thread tick */
SONDE_API sonde_stage_times sonde_state_times(const sonde_state *state); /**< @thread tick */
/** Bytes that the engine's kernels moved in the last step, at least. @thread tick */
SONDE_API uint64_t sonde_state_bytes_moved(const sonde_state *state);
/** Most bytes that sonde_state_save() writes for this state. @thread any */
SONDE_API size_t sonde_state_size(const sonde_state *state);
/**
 * Copies all that the next steps depend on: motion, contact, friction, sleep, warm starts, tick.
 * For the same program on the same machine.
 * @param[out] blob [sonde_state_size()] aligned to 8 bytes
 * @return bytes written
 * @thread tick, between steps; copies only
 */
SONDE_API size_t sonde_state_save(const sonde_state *state, void *blob);
/**
 * Goes on where a state of the same model and options was saved: the next steps have the same bits
 * as if it had never stopped. The blob is checked before anything changes.
 * @return FORMAT for a blob that is not one, MISMATCH for one of another model or engine
 * @thread owner, between steps
 */
SONDE_API sonde_status sonde_state_restore(sonde_state *state, const void *blob, size_t bytes,
                                           sonde_error *error);
/** sonde_state_hash() of the state that was saved, from a blob as sonde_state_save() left it.
 * @thread any */
SONDE_API uint64_t sonde_state_saved_hash(const sonde_model *model, const void *blob);
/** Hash of positions, velocities and tick: equal runs have equal hashes. @thread owner */
SONDE_API uint64_t sonde_state_hash(sonde_state *state);

#ifdef __cplusplus
}
#endif
#endif
