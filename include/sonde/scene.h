/**
 * @file scene.h
 * Scenes of several bodies: rigid bodies, surfaces of springs, lattices of springs, two-layer and
 * volumetric tissues; contact and friction between any two of them; one implicit step for all. The
 * file format and the mathematics: docs/scene.md.
 */
#ifndef SONDE_SCENE_H
#define SONDE_SCENE_H

#include "sonde/sparse.h"
#include "sonde/tissue.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sonde_body_kind {
  SONDE_BODY_RIGID,      /**< six degrees of freedom; mass, centre and inertia of its mesh */
  SONDE_BODY_SPRINGS,    /**< a surface: every edge a spring-damper, mass lumped by area */
  SONDE_BODY_LATTICE,    /**< a solid: tetrahedra whose edges are spring-dampers */
  SONDE_BODY_TWO_LAYER,  /**< a thigh model: surface springs and nonlinear normal springs */
  SONDE_BODY_VOLUMETRIC, /**< a thigh model of springs or tetrahedra through its volume */
} sonde_body_kind;

typedef enum sonde_body_motion {
  SONDE_BODY_FREE,
  SONDE_BODY_FIXED,
  SONDE_BODY_DRIVEN
} sonde_body_motion;

/** How two bodies push each other apart (docs/scene_theory.md). */
typedef enum sonde_touch_law {
  SONDE_TOUCH_FOUNDATION, /**< pressure kappa*depth + mu*rate at points of the contact */
  SONDE_TOUCH_VOLUME,     /**< eq. (2): kappa V + mu dV/dt per region along its direction */
  SONDE_TOUCH_ENERGY,     /**< energy kappa' V^2/2: nodal forces kappa' V grad V; kappa' in N/m^5 */
} sonde_touch_law;

/** Options of the step. */
typedef struct sonde_scene_step {
  double dt_s;                /**< default 1e-3 */
  double lambda;              /**< implicitness of eq. (4) in [0,1]; 0 is eq. (3); default 1 */
  bool symplectic;            /**< with lambda = 0: positions follow the new velocities */
  uint32_t newton_iterations; /**< 1 is eq. (4); default 1 */
  double newton_residual;     /**< stop the iterations at |g| <= this * |first g|; default 1e-9 */
  bool line_search;           /**< on the slope of the incremental potential; default true */
  bool cast;                  /**< parts of a step where bodies move fast: none passes through;
                                   default true */
  double sleep_m;             /**< nodes of a tissue whose unbalanced force over their anchors is
                                   less sleep when slow; 0: none; default 5e-6 */
  sonde_pcg_options solver;   /**< default relative 1e-8, at most 1000 iterations */
  double substep_tolerance_m; /**< wanted error of a step, by step doubling; 0: no substeps */
  uint32_t substep_halvings;  /**< smallest substep is dt/2^this; default 8, at most 16 */
} sonde_scene_step;

/** A compiled scene. */
typedef struct sonde_scene sonde_scene;

/**
 * Reads a scene file (YAML, docs/scene.md); relative names in it are relative to its directory.
 * @param thigh model file that the name `thigh` stands for; NULL: that name is refused
 * @return FORMAT, NOT_FOUND, ARGUMENT or MESH with file, line and reason
 * @thread owner
 */
SONDE_API sonde_status sonde_scene_load(const char *path, const char *thigh, sonde_scene **scene,
                                        sonde_error *error);
SONDE_API void sonde_scene_destroy(sonde_scene *scene); /**< @thread owner */

/** What a body is. */
typedef struct sonde_body_info {
  const char *name;
  sonde_body_kind kind;
  sonde_body_motion motion;
  uint32_t node_count;       /**< 0 for a rigid body */
  uint32_t spring_count;     /**< of a surface or a lattice */
  const sonde_mesh *surface; /**< at rest; of a rigid body about its centre */
  sonde_mass mass;           /**< inertia of rigid bodies only */
} sonde_body_info;
SONDE_API uint32_t sonde_scene_body_count(const sonde_scene *scene); /**< @thread any */
/** @thread any */
SONDE_API sonde_body_info sonde_scene_body(const sonde_scene *scene, uint32_t body);
SONDE_API const char *sonde_scene_title(const sonde_scene *scene); /**< @thread any */
/** `duration_s` of the file: how long a run is meant to be; 1 s when absent. @thread any */
SONDE_API double sonde_scene_duration(const sonde_scene *scene);
/** Acceleration of gravity (m/s^2); zero when the file gives none. @thread any */
SONDE_API sonde_vec3 sonde_scene_gravity(const sonde_scene *scene);

/** Two bodies that may touch; indices of bodies. */
typedef struct sonde_scene_pair {
  uint32_t a, b;
  sonde_touch_law law;
  double stiffness, damping; /**< N/m^3 and N s/m^3; of the energy law N/m^5 and N s/m^5 */
  double mu_static, mu_kinetic;
} sonde_scene_pair;
SONDE_API uint32_t sonde_scene_pair_count(const sonde_scene *scene); /**< @thread any */
/** @thread any */
SONDE_API sonde_scene_pair sonde_scene_pair_at(const sonde_scene *scene, uint32_t pair);

SONDE_API sonde_scene_step sonde_scene_get_step(const sonde_scene *scene); /**< @thread owner */

/** Everything that moves. */
typedef struct sonde_scene_state sonde_scene_state;

/** Start of a scene. @param scene borrowed, must outlive the state @thread owner */
SONDE_API sonde_status sonde_scene_state_create(const sonde_scene *scene, sonde_scene_state **state,
                                                sonde_error *error);
SONDE_API void sonde_scene_state_destroy(sonde_scene_state *state); /**< @thread owner */

/** Bits of sonde_scene_report.flags; trouble is flagged and counted, never fatal. */
enum {
  SONDE_SCENE_NON_FINITE = 1u << 0,    /**< the step was undone and all velocities zeroed */
  SONDE_SCENE_NOT_CONVERGED = 1u << 1, /**< the solver hit its iteration limit */
  SONDE_SCENE_CONTACT_FULL = 1u << 2,  /**< more contact than there was room for */
  SONDE_SCENE_SUBSTEP_LIMIT = 1u << 3, /**< the smallest substep missed the tolerance */
  SONDE_SCENE_INVERTED = 1u << 4,      /**< a deformable body is inside out, or a part of it, or
                                            its surface went through itself */
  SONDE_SCENE_PASSED = 1u << 5,        /**< a body went through another */
  SONDE_SCENE_INSIDE = 1u << 6,        /**< a body was found wholly inside another */
  SONDE_SCENE_FLAGS = 7                /**< how many there are */
};

/** The first step that raised a flag. */
typedef struct sonde_scene_event {
  double time_s;        /**< at its start */
  uint32_t count;       /**< 0: it was never raised; else 1 */
  uint32_t body, other; /**< whose it is, and of INSIDE and PASSED the other; UINT32_MAX: none */
  uint32_t unused;
} sonde_scene_event;

/** What the last step did. */
typedef struct sonde_scene_report {
  uint32_t flags;
  uint32_t newton_iterations, solver_iterations, line_halvings;
  uint32_t substeps, rejected; /**< of an adaptive step */
  uint32_t cuts;               /**< parts made in place of a step so that no body passes through */
  uint32_t awake;              /**< slots that took part in the last solve */
  uint32_t touch_points;       /**< integration points of all contacts */
  uint64_t contact_tests; /**< pairs of boxes and of faces compared by the contacts' searches */
  double newton_residual; /**< |g| at the last evaluation over the first */
  double error_m;         /**< estimate by step doubling; 0 without substeps */
  double contact_s, assembly_s, solve_s;
} sonde_scene_report;

/** Advances by dt. @thread tick (no allocation, no locks, no I/O) */
SONDE_API void sonde_scene_advance(sonde_scene_state *state);
SONDE_API sonde_scene_report sonde_scene_last(const sonde_scene_state *state); /**< @thread tick */
/** Steps with any flag since the start. @thread tick */
SONDE_API uint64_t sonde_scene_flag_count(const sonde_scene_state *state);
/** All flags since the start. @thread tick */
SONDE_API uint32_t sonde_scene_all_flags(const sonde_scene_state *state);
/** @param flag one of the bits @thread tick */
SONDE_API sonde_scene_event sonde_scene_first(const sonde_scene_state *state, uint32_t flag);
SONDE_API uint64_t sonde_scene_tick(const sonde_scene_state *state); /**< @thread tick */
SONDE_API double sonde_scene_time(const sonde_scene_state *state);   /**< @thread tick */
/** Hash of everything that moves: equal runs have equal hashes. @thread owner */
SONDE_API uint64_t sonde_scene_hash(const sonde_scene_state *state);

/** Writes the vertices of a body's surface as they are now, [surface vertices] m. @thread owner */
SONDE_API void sonde_scene_surface(const sonde_scene_state *state, uint32_t body,
                                   sonde_vec3 *vertices);

/** A body's motion as one: sums over its nodes, or of the rigid body. */
typedef struct sonde_body_measure {
  sonde_vec3 centre_m, velocity_m_s;
  sonde_quat rotation;                         /**< rigid bodies: world from the body at rest */
  sonde_vec3 spin_rad_s;                       /**< rigid bodies */
  sonde_vec3 momentum_kg_m_s, angular_kg_m2_s; /**< angular about the world's origin */
  double kinetic_j, elastic_j, gravity_j;
} sonde_body_measure;
/** @thread tick */
SONDE_API sonde_body_measure sonde_scene_measure(const sonde_scene_state *state, uint32_t body);

/** A pair's contact in the last step. */
typedef struct sonde_pair_measure {
  sonde_vec3 force_n;      /**< on body a; body b feels the opposite */
  sonde_vec3 torque_n_m;   /**< on body a about the world's origin */
  sonde_vec3 torque_b_n_m; /**< on body b about the world's origin */
  double normal_n;         /**< sum of the pushes */
  sonde_vec3 friction_n;   /**< on body a; part of force_n */
  double volume_m3, area_m2, depth_m, energy_j;
  uint32_t region_count, point_count;
} sonde_pair_measure;
SONDE_API sonde_pair_measure sonde_scene_pair_measure(const sonde_scene_state *state,
                                                      uint32_t pair); /**< @thread tick */

/** An attachment of two bodies, or of one and the world, as it is now. */
typedef struct sonde_attachment_measure {
  uint32_t a, b;      /**< bodies; UINT32_MAX: the world */
  sonde_vec3 force_n; /**< sum of its springs and dampers on body a */
  double stretch_m;   /**< of the longest spring */
  double energy_j;
} sonde_attachment_measure;
SONDE_API uint32_t sonde_scene_attachment_count(const sonde_scene *scene); /**< @thread any */
/** @thread tick */
SONDE_API sonde_attachment_measure sonde_scene_attachment(const sonde_scene_state *state,
                                                          uint32_t attachment);

/** Writes the full state atomically; a state loaded from it goes on bit by bit as this one.
 * @thread owner */
SONDE_API sonde_status sonde_scene_state_save(const sonde_scene_state *state, const char *path,
                                              sonde_error *error);
/** @return MISMATCH for a snapshot of another scene, CHECKSUM, VERSION, FORMAT @thread owner */
SONDE_API sonde_status sonde_scene_state_load(sonde_scene_state *state, const char *path,
                                              sonde_error *error);

/** Writes a body's surface with velocity and displacement as VTK XML polydata (.vtp), atomically.
 * @thread owner */
SONDE_API sonde_status sonde_scene_save_vtp(const sonde_scene_state *state, uint32_t body,
                                            const char *path, sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
