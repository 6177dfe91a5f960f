/**
 * @file haptics_local.h
 * Local model: forces every tick from a scene that answers only 30 to 300 times a second.
 */
#ifndef SONDE_HAPTICS_LOCAL_H
#define SONDE_HAPTICS_LOCAL_H

#include "sonde/base.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sonde_local_def {
  uint32_t version;     /**< SONDE_DEF_VERSION, from sonde_local_def_default() */
  double dt_s;          /**< a tick; default 1e-3 */
  double period_s;      /**< between two answers of the scene; default 1e-2 */
  double stiffness_n_m; /**< taken before anything was measured; default 300 */
  double fade_s;        /**< time constant of the decay when the scene falls silent; default 0.02 */
} sonde_local_def;

/** @thread any */
SONDE_API sonde_local_def sonde_local_def_default(void);

/**
 * Force near the newest answer of the scene (docs/haptics.md): along the force
 * dF = d / (1/K - d/(K room)) + B dv, the increment of eq. (1) with the room that is left; across
 * it a spring. K and B are measured from the answers themselves. Held by value in the loop's state,
 * as sonde_safety is; its members are there to be read.
 */
typedef struct sonde_local {
  sonde_local_def def;
  uint64_t answers;
  double age_s;                        /**< since the newest answer */
  sonde_vec3 at_m, speed_m_s, force_n; /**< of the newest answer */
  sonde_vec3 normal;                   /**< along its force; zero: no contact */
  double depth_m;                      /**< pressed in since the contact began */
  double stiffness_n_m, damping_n_s_m; /**< K, B */
  double across_n_m;                   /**< spring across the normal */
  double room_m;                       /**< until eq. (1) would lock; infinite: no stiffening */
  double spread[3];                    /**< covariance of K, B: KK, KB, BB */
  sonde_vec3 offset_n;                 /**< blended out over a period */
  sonde_vec3 last_m, velocity_m_s;     /**< of the probe, this tick */
  sonde_vec3 output_n;
  bool placed;
} sonde_local;

/** @param def NULL or of another version: the default; members out of range are replaced by it
 *  @thread owner */
SONDE_API void sonde_local_init(sonde_local *local, const sonde_local_def *def);
/** A new answer: the force on a probe that was at `at_m` with `velocity_m_s` when the scene read
 * it. Numbers that are not finite are ignored. @thread tick */
SONDE_API void sonde_local_feed(sonde_local *local, sonde_vec3 at_m, sonde_vec3 velocity_m_s,
                                sonde_vec3 force_n);
/** The force of this tick; call once per tick. @thread tick */
SONDE_API sonde_vec3 sonde_local_force(sonde_local *local, sonde_vec3 position_m);

#ifdef __cplusplus
}
#endif
#endif
