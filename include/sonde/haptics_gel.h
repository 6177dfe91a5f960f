/**
 * @file haptics_gel.h
 * Coupling gel on the skin: one film that drives friction and image alike.
 */
#ifndef SONDE_HAPTICS_GEL_H
#define SONDE_HAPTICS_GEL_H

#include "sonde/world.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sonde_gel_def {
  uint32_t version;        /**< SONDE_DEF_VERSION, from sonde_gel_def_default() */
  double viscosity_pa_s;   /**< at the shear of a scan; default 10 */
  double lubricating_m;    /**< film that lubricates by 1/e, and couples the same; default 20e-6 */
  double drying_m_s;       /**< loss to the air; default 5e-8 */
  double moist_s;          /**< how long the skin stays moist without a film; default 60 */
  double moist_stickiness; /**< moist skin without a film has 1 + this times the dry friction;
                               default 0.8 */
} sonde_gel_def;

/** @thread any */
SONDE_API sonde_gel_def sonde_gel_def_default(void);

/** Film on the skin of a model. */
typedef struct sonde_gel sonde_gel;

/** Dry skin. @param model borrowed @param def NULL: the default
 *  @return ARGUMENT naming the member that is out of range, MEMORY @thread owner */
SONDE_API sonde_status sonde_gel_create(const sonde_model *model, const sonde_gel_def *def,
                                        sonde_gel **gel, sonde_error *error);
SONDE_API void sonde_gel_destroy(sonde_gel *gel); /**< @thread owner */
/** Puts a volume on a disc, evenly; on the nearest node when the disc holds none.
 *  @param centre_m on the skin at rest @thread tick */
SONDE_API void sonde_gel_put(sonde_gel *gel, sonde_vec3 centre_m, double radius_m,
                             double volume_m3);
/** Takes all away and leaves dry skin. @thread tick */
SONDE_API void sonde_gel_wipe(sonde_gel *gel);
/**
 * Squeezes out, smears and dries for dt_s; once per 5 to 20 ticks is enough.
 * @param contact_n force of the probe on each node [nodes], sonde_state_contact_forces()
 * @param probe_m_s velocity of the probe @thread tick
 */
SONDE_API void sonde_gel_step(sonde_gel *gel, const sonde_vec3 *contact_n, sonde_vec3 probe_m_s,
                              double dt_s);
/** `dry` with the film under the probe: gel_film set, moist skin stickier; for
 *  sonde_state_set_friction(). @thread tick */
SONDE_API sonde_friction sonde_gel_friction(const sonde_gel *gel, const sonde_vec3 *contact_n,
                                            const sonde_friction *dry);
/**
 * Share of sound that enters at points of the probe's face, 0..1: one value per line of the image.
 * Gel fills gaps up to 2 mm; without skin that touches within 4 mm there is air: 0.
 * @param skin_m [nodes] deformed, sonde_state_positions() @param point_m [count] @param[out] share
 * [count] @thread tick
 */
SONDE_API void sonde_gel_coupling(sonde_gel *gel, const sonde_vec3 *skin_m,
                                  const sonde_vec3 *contact_n, const sonde_vec3 *point_m,
                                  uint32_t count, float *share);
/** Film per node, m [nodes]. @thread tick */
SONDE_API const double *sonde_gel_film(const sonde_gel *gel);

#ifdef __cplusplus
}
#endif
#endif
