/**
 * @file flow_gate.h
 * Pulsed Doppler in the vessels of a pressed model: a sample volume at any place of the image
 * plane, columns of its spectrum while the network runs. docs/flow.md, docs/flow_theory.md.
 *
 * Velocities are those along the beam towards the probe: who knows the angle between beam and flow
 * divides by its cosine.
 */
#ifndef SONDE_FLOW_GATE_H
#define SONDE_FLOW_GATE_H

#include "sonde/flow_colour.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Columns come so many seconds after each other; so many are kept. */
#define SONDE_GATE_COLUMN_S 0.01
enum { SONDE_GATE_COLUMNS = 64 };

/** What an examiner sets; sonde_gate_clean() says the ranges. */
typedef struct sonde_gate_settings {
  double x_m, z_m;  /**< middle of the sample volume in the image plane, x and z of the probe frame;
                         before a curved face its line, along the arc from the face's middle, and
                         its depth on that line */
  double length_m;  /**< of it along the beam */
  double steer_rad; /**< lean of a flat face's beam towards +x; of a curved face's line nothing */
  double angle_rad; /**< from the beam to the cursor that lies along the vessel: kept, not used */
  double scale_m_s; /**< velocity along the beam from which it folds when the base line is in the
                         middle; less where pulses have a longer way to the gate and back */
  double baseline;  /**< how far the base line is moved down, share of half the axis */
  double filter_hz; /**< the wall filter: Doppler shifts below are removed */
  double gain_db;   /**< of the shown power */
} sonde_gate_settings;
/** 3 mm at a depth of 20 mm, 20 cm/s, 50 Hz, 60 degrees, beam and base line straight. @thread any
 */
SONDE_API sonde_gate_settings sonde_gate_settings_default(void);
/** Settings with every number usable: within its range, or from `before` where it is none. x -0.1
 * to 0.1 m, depth 1 mm to 0.25 m, length 0.5 to 15 mm, lean up to 0.35, angle up to 1.4 either way,
 *  scale 0.02 to 2 m/s, base line -0.9 to 0.9, filter 10 to 1000 Hz, gain -30 to 30 dB.
 *  @thread any */
SONDE_API sonde_gate_settings sonde_gate_clean(const sonde_gate_settings *wanted,
                                               const sonde_gate_settings *before);

/** The spectrum at one time. */
typedef struct sonde_gate_column {
  uint64_t number; /**< times SONDE_GATE_COLUMN_S: when its last pulse was sent */
  float mean_m_s;  /**< power-weighted; what the filter took goes on evenly between its edges */
  float peak_m_s;  /**< edge away from zero, 99 % of the power below it; 0: nothing but noise */
  uint8_t
      power[SONDE_DOPPLER_BINS]; /**< from the lowest velocity that is shown; 0 to 255 are 36 dB */
} sonde_gate_column;

/** The last columns; what they have in common. */
typedef struct sonde_gate_spectrum {
  bool on;                      /**< else nothing else is set */
  sonde_gate_settings settings; /**< as they were used */
  double pulse_hz;
  double window_s;    /**< of the pulses of a column */
  double limit_m_s;   /**< half the width of the velocities that are shown */
  double low_m_s;     /**< the lowest of them; the highest is 2 limits above it */
  double slowest_m_s; /**< from which blood passes the wall filter whole, along the beam */
  uint32_t count;
  const sonde_gate_column *column; /**< [count] oldest first, without gaps */
} sonde_gate_spectrum;

typedef struct sonde_gate sonde_gate;
/** @return MEMORY @thread owner */
SONDE_API sonde_status sonde_gate_create(sonde_gate **gate, sonde_error *error);
SONDE_API void sonde_gate_destroy(sonde_gate *gate); /**< NULL is fine. @thread owner */
/** Nothing of before counts: no column, no scatterer. @thread owner; no allocation */
SONDE_API void sonde_gate_forget(sonde_gate *gate);

/** What else the echo of a gate depends on. */
typedef struct sonde_gate_place {
  const sonde_echo *echo; /**< its last picture says where blood is drawn */
  double frequency_hz;    /**< 1e6 to 2e7 */
  double tissue_m_s;      /**< of the tissue there, towards the probe */
  double loss_db;         /**< of echoes from there: in a shadow, or without gel */
} sonde_gate_place;
/**
 * Puts the gate into the blood of a scene, which runs on with sonde_flow_scene_listen(). Other
 * scales, base lines or frequencies begin the columns anew.
 * @param settings clean
 * @thread owner; no allocation
 */
SONDE_API void sonde_gate_put(sonde_gate *gate, const sonde_flow_scene *scene,
                              const sonde_gate_settings *settings, const sonde_gate_place *place);
/** The scene's next runs send pulses through the gate, as it was put last; NULL: none does. The
 * gate is borrowed. @thread owner */
SONDE_API void sonde_flow_scene_listen(sonde_flow_scene *scene, sonde_gate *gate);
/** Mean velocity of the blood in the gate now, by the beam's weight: what the mean of a spectrum
 * without walls, noise, filter and chance would be; 0 without blood. @thread owner */
SONDE_API double sonde_gate_truth(const sonde_gate *gate, const sonde_flow_scene *scene,
                                  const sonde_echo *echo);
/** The columns so far, oldest first. @param[out] column [SONDE_GATE_COLUMNS] @return their number
 *  @thread owner; no allocation */
SONDE_API uint32_t sonde_gate_columns(const sonde_gate *gate, sonde_gate_column *column);
/** What columns have in common, `count` and `column` left out. @thread owner; no allocation */
SONDE_API sonde_gate_spectrum sonde_gate_axes(const sonde_gate *gate);

#ifdef __cplusplus
}
#endif
#endif
