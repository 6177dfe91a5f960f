/**
 * @file haptics_hand.h
 * A simulated operator: an arm that tracks a goal and yields to the rendered force. It closes the
 * loop where no hardware is attached.
 */
#ifndef SONDE_HAPTICS_HAND_H
#define SONDE_HAPTICS_HAND_H

#include "sonde/haptics.h"

#ifdef __cplusplus
extern "C" {
#endif

/**
 * Arm and device handle as one mass on a spring to the goal (docs/haptics.md):
 *   m x'' = k (goal(t - delay) + tremor(t) - x) - b x' + f
 * solved exactly for a force f and a goal held over a tick. The rotation follows the delayed goal.
 */
typedef struct sonde_hand_def {
  uint32_t version;       /**< SONDE_DEF_VERSION, from sonde_hand_def_default() */
  double mass_kg;         /**< hand and handle; default 0.5 */
  double damping_n_s_m;   /**< of arm and device; default 2 */
  double stiffness_n_m;   /**< of the arm towards its goal, 0: a free mass; default 400 */
  double delay_s;         /**< reaction; default 0.15, at most 1 */
  double tremor_m;        /**< amplitude per axis, 0: none; default 50e-6 */
  double tremor_hz;       /**< default 9 */
  double resolution_m;    /**< of the reported position, 0: exact; default 0 */
  double force_limit_n;   /**< what the motors can give, 0: no limit; default 0 */
  uint32_t latency_ticks; /**< a force written now acts so many ticks later, 0..8; default 0 */
  uint64_t seed;          /**< of the tremor */
} sonde_hand_def;

/** @thread any */
SONDE_API sonde_hand_def sonde_hand_def_default(void);

/** A named operator: mass and damping of sonde_hand_def. */
typedef struct sonde_hand_preset {
  const char *name; /**< child, light, firm, heavy, loose, bare */
  double mass_kg, damping_n_s_m;
} sonde_hand_preset;

/** A hand whose goal follows keys as sonde_device_script() does; it starts at rest at the first.
 *  @param keys [count], copied
 *  @return SONDE_ARGUMENT naming the member or the key that is out of range @thread owner */
SONDE_API sonde_status sonde_device_hand(const sonde_hand_def *def, const sonde_script_key *keys,
                                         uint32_t count, double dt_s, sonde_device *device,
                                         sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
