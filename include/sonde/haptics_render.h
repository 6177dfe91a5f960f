/**
 * @file haptics_render.h
 * From tissue force to device force: device limits, the virtual coupling and its passivity, the
 * local model for slow scenes.
 */
#ifndef SONDE_HAPTICS_RENDER_H
#define SONDE_HAPTICS_RENDER_H

#include "sonde/haptics.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a haptic device can do, at its handle; 0 where no public source tells. */
typedef struct sonde_device_limits {
  const char *name;    /**< touch, touch_x, premium_1.5, omega.3, omega.6, inverse3, falcon */
  const char *product; /**< as its maker calls it */
  double force_peak_n, force_continuous_n;
  double stiffness_n_m; /**< largest that stays stable */
  double damping_n_s_m; /**< largest virtual damping */
  double mass_kg;       /**< apparent */
  double workspace_m;   /**< radius */
  double resolution_m;  /**< of the position */
  const char *source;   /**< where the numbers come from */
} sonde_device_limits;

/** Row of a name, NULL when there is none. @thread any */
SONDE_API const sonde_device_limits *sonde_device_limits_find(const char *name);
/** Safety limits of a device: 0.8 of its peak force, from zero to the peak in 4 ms, its continuous
 *  force (a quarter of the peak when unknown) as the thermal limit, velocity 1 m/s. @thread any */
SONDE_API sonde_safety_limits sonde_safety_limits_of(const sonde_device_limits *limits);

/** How a tissue force becomes a device force. Stiffness and damping are those felt at the device.
 */
typedef struct sonde_render_def {
  uint32_t version;            /**< SONDE_DEF_VERSION, from sonde_render_def_default() */
  double dt_s;                 /**< default 1e-3 */
  double force_scale;          /**< rendered over tissue force; default 1 */
  double stiffness_n_m;        /**< of the coupling; 0: none, the probe is the device */
  double damping_n_s_m;        /**< of the coupling */
  double probe_mass_kg;        /**< of the virtual probe; default 0.1 */
  double filter_rad_s;         /**< of the velocity estimate; default 800 */
  bool controller;             /**< passivity controller; default true */
  double controller_max_n_s_m; /**< most damping that it may add; default 30 */
  double reserve_j;            /**< passive energy that may be kept for later; default 2e-5 */
} sonde_render_def;

/** No coupling, scale 1: what devices without force use. @thread any */
SONDE_API sonde_render_def sonde_render_def_default(void);
/** Coupling for a device (docs/haptics.md): half of its stiffness and of its damping, controller up
 *  to 0.5 m/T.
 *  @param force_scale 0: 0.8 of the peak force is 25 N of tissue force @thread any */
SONDE_API sonde_render_def sonde_render_def_for(const sonde_device_limits *limits, double dt_s,
                                                double force_scale);

/** Distance of a coupling from instability when a hand holds the device (linear loop with the
 *  probe held fast: the stiffest case). */
typedef struct sonde_render_margins {
  double damping_needed_n_s_m; /**< K T/2 + B: passive whatever the hand does (Colgate) */
  double passivity;            /**< hand's damping plus the controller's over the needed one */
  double stiffness;            /**< largest stable stiffness over the coupling's (gain margin) */
  double phase_rad;            /**< phase margin */
} sonde_render_margins;
/** @param latency_s of device and computation @thread any */
SONDE_API sonde_render_margins sonde_render_margins_of(const sonde_render_def *def, double mass_kg,
                                                       double damping_n_s_m, double latency_s);

/** State of the rendering of one device; energies at the device, J. Held by value in its owner's
 *  state, as sonde_safety is: the loop and the tests of passivity read its members. */
typedef struct sonde_render {
  sonde_render_def def;
  bool started;
  sonde_vec3 device_m, velocity_m_s; /**< device: position of this tick, filtered velocity */
  sonde_vec3 probe_m, probe_m_s;     /**< virtual probe */
  sonde_vec3 probe_moved_m;          /**< in the last tick */
  sonde_vec3 force_n;                /**< wanted at the device, before the safety limits */
  double stored_j;                   /**< in coupling and virtual probe */
  double energy_j, energy_min_j;     /**< observer: absorbed from the hand since the start */
  double surplus_j, surplus_min_j;   /**< dissipated by the rendering itself, kept <= reserve_j */
  double damping_n_s_m;              /**< of the controller in this tick */
  double controlled_j;               /**< dissipated by the controller */
  uint64_t controlled_ticks;
} sonde_render;

/** @param def NULL or of another version: the default; members out of range are replaced by it
 *  @thread owner */
SONDE_API void sonde_render_init(sonde_render *render, const sonde_render_def *def);
/**
 * One tick before the world's step: the device's pose in, the probe's pose out. The force for the
 * device is then in render->force_n.
 * @param tissue_force_n of the tissue on the probe in the last tick
 * @param rendered_force_n what really went to the device in the last tick
 * @thread tick
 */
SONDE_API sonde_pose sonde_render_probe(sonde_render *render, sonde_pose world_from_device,
                                        sonde_vec3 tissue_force_n, sonde_vec3 rendered_force_n);
/** The same tick after the world's step: without a coupling the fresh tissue force becomes the
 *  device's. @thread tick */
SONDE_API void sonde_render_force(sonde_render *render, sonde_vec3 tissue_force_n);

#ifdef __cplusplus
}
#endif
#endif
