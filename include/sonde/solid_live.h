/**
 * @file solid_live.h
 * The hyperelastic solid under a moving probe: contact forces at 1 kHz on a tangent of the solid
 * that a worker renews, following the equilibrium of solid.h. docs/solid.md, docs/solid_theory.md.
 *
 * A schedule of ticks says what belongs to which tick: at every pass_ticks-th tick the pass that
 * began pass_ticks earlier is taken over and the next begins, at the pose of that tick. The
 * stiffness of the bulk is factored anew when the probe has moved by refresh_m since the state of
 * the last one that began; factor_passes passes share that work. So forces depend on the poses
 * alone, as long as every pass is done before it is due.
 */
#ifndef SONDE_SOLID_LIVE_H
#define SONDE_SOLID_LIVE_H

#include "sonde/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

/** How a live solid keeps up. */
typedef struct sonde_solid_live_def {
  uint32_t version;            /**< SONDE_DEF_VERSION, from sonde_solid_live_def_default() */
  sonde_equilibrium_def solid; /**< sliding; step_m and tolerance are not used */
  uint32_t pass_ticks;         /**< ticks from pass to pass; 20 */
  uint32_t factor_passes;      /**< passes that share a factor of the bulk; 2 */
  uint32_t skin_steps;         /**< of the nonlinear skin in a pass, at most; 3 */
  double skin_m;      /**< skin within this of the footprint is nonlinear in a pass; 20 mm */
  double lead_passes; /**< a pass goes to where the probe will be after so many, by its motion since
                           the pass before; 1.5, the middle of the time in which it serves */
  double refresh_m;   /**< way of the probe after which the bulk is factored anew; 2 mm, less
                           where it is less than 8 mm deep */
  double pass_m;      /**< the state follows the probe by at most this in a pass; 3 mm */
  double lag_m;       /**< and stays at most this far from where the bulk was factored; 6 mm */
  double ease_n_s;    /**< what a new pass changes in the force at one pose reaches the hand at most
                           so fast; 5 N/s */
} sonde_solid_live_def;
SONDE_API sonde_solid_live_def sonde_solid_live_def_default(void); /**< @thread any */

/** What the probe feels in a tick. */
typedef struct sonde_solid_contact {
  sonde_vec3 force_n;   /**< on the probe */
  sonde_vec3 torque_nm; /**< on the probe, about its origin */
  double area_m2;       /**< skin in contact, at rest */
  uint32_t points;      /**< of the skin's quadrature that bear a force */
  uint32_t sweeps;      /**< of projected Gauss-Seidel */
} sonde_solid_contact;

/** What has happened since the creation. */
typedef struct sonde_solid_live_counts {
  uint64_t ticks;
  uint32_t passes, factors; /**< done */
  uint32_t skin_steps;      /**< of all passes */
  uint32_t shortened; /**< passes whose step was halved, because an element would have turned inside
                         out */
  uint32_t kept;      /**< passes that found no step and left the tangent as it was */
  uint32_t held;      /**< passes that did not follow the probe to its pose, see pass_m and lag_m */
  uint32_t late;      /**< passes that were not done when they were due */
  uint32_t returns;   /**< of a state that had lost its balance to rest, from where it came back */
} sonde_solid_live_counts;

/** A live solid. */
typedef struct sonde_solid_live sonde_solid_live;

/**
 * Starts at rest, its bulk factored.
 * @param mesh,probe borrowed, must outlive it
 * @param start pose of the probe at which it touches the skin at rest
 * @return ARGUMENT, MEMORY, CONVERGENCE @thread owner
 */
SONDE_API sonde_status sonde_solid_live_create(const sonde_hexes *mesh, const sonde_probe *probe,
                                               sonde_pose start, const sonde_solid_live_def *def,
                                               sonde_solid_live **live, sonde_error *error);
SONDE_API void sonde_solid_live_destroy(sonde_solid_live *live); /**< @thread owner */

/** One millisecond: the contact at a pose. Neither allocates nor waits. @thread tick */
SONDE_API void sonde_solid_live_tick(sonde_solid_live *live, sonde_pose pose,
                                     sonde_solid_contact *contact);
/** Does the pass that is due and its share of a factor. A caller without a second thread calls it
 * after every tick; one thread at a time. @return whether there was one @thread owner */
SONDE_API bool sonde_solid_live_work(sonde_solid_live *live);
/** Not during a pass. @thread owner */
SONDE_API sonde_solid_live_counts sonde_solid_live_count(const sonde_solid_live *live);
/** [mesh node_count] displacements of the state of the last pass; its own. Not during a pass.
 * @thread owner */
SONDE_API const sonde_vec3 *sonde_solid_live_state(const sonde_solid_live *live);

#ifdef __cplusplus
}
#endif
#endif
