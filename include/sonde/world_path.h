/**
 * @file world_path.h
 * The static press: the equilibrium that a slow press of the probe ends in.
 */
#ifndef SONDE_WORLD_PATH_H
#define SONDE_WORLD_PATH_H

#include "sonde/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/** How sonde_settle_path() goes; sonde_path_def_default(), then changes. */
typedef struct sonde_path_def {
  uint32_t version;         /**< SONDE_DEF_VERSION, from sonde_path_def_default() */
  double step_m;            /**< longest step of the probe's face; default 1 mm */
  double least_step_m;      /**< no step is halved below it; default 0.125 mm */
  double tolerance;         /**< relative difference of force at which one step and two half steps
                                 agree; default 0.01 */
  double force_n;           /**< ends where the force along the beam is this, to 1e-4 of it;
                                 default INFINITY: at the goal */
  double relative_residual; /**< at the end; default 1e-9 */
  uint32_t max_iterations;  /**< of each equilibrium; default 400 */
} sonde_path_def;
/** @thread any */
SONDE_API sonde_path_def sonde_path_def_default(void);

/** A step of the least length of which one whole and two halves end in different equilibria. */
typedef struct sonde_path_jump {
  double from_m, to_m;   /**< way of the probe's origin from the start */
  double before_n;       /**< force along the beam before the step */
  double whole_n, two_n; /**< and after it, in one and in two; the press goes on from the second */
} sonde_path_jump;

enum { SONDE_PATH_JUMPS = 16 };

/** Where a press ended. */
typedef struct sonde_path_result {
  sonde_settle_result settled; /**< at the end */
  sonde_pose pose;             /**< world_from_probe at the end */
  double way_m;                /**< of the probe's origin from the start */
  double force_n;              /**< along the beam, onto the skin */
  uint32_t steps, iterations;  /**< accepted steps; Newton iterations of all equilibria */
  uint32_t jump_count;         /**< may be more than SONDE_PATH_JUMPS; the first ones are kept */
  sonde_path_jump jump[SONDE_PATH_JUMPS];
} sonde_path_result;

/**
 * The equilibrium that a slow press ends in: the probe goes straight from one pose to the other in
 * steps, each settled from the last, with the touched skin riding along first. A step counts when
 * the force after it agrees with that after two half steps, otherwise it is halved
 * (docs/world.md, Static equilibrium). So the result does not depend on how the caller divides the
 * way. The state begins in its present positions, which should be those at `from`, e.g. at rest
 * with the probe clear of the skin, and ends at `result->pose`.
 * @param def NULL: the default
 * @param progress,error may be NULL
 * @return CONVERGENCE when no equilibrium was found on the way or the force not met (the result
 *         says where), ARGUMENT for a def out of range, CANCELLED, MEMORY
 * @thread owner of the state
 */
SONDE_API sonde_status sonde_settle_path(sonde_state *state, const sonde_probe *probe,
                                         sonde_pose from, sonde_pose to, const sonde_path_def *def,
                                         const sonde_progress *progress, sonde_path_result *result,
                                         sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
