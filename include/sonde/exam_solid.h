/**
 * @file exam_solid.h
 * Sessions whose tissue is the hyperelastic solid: it bears the probe at 1 kHz, and moves vessels,
 * labels and picture. docs/solid.md.
 */
#ifndef SONDE_EXAM_SOLID_H
#define SONDE_EXAM_SOLID_H

#include "sonde/exam.h"
#include "sonde/solid_live.h"

#ifdef __cplusplus
extern "C" {
#endif

/** For sonde_session_def.solid, in place of springs: without presets, with a step of 1 ms and a
 * model that has a bone. The controls' scales of stiffness, damping and friction do nothing. */
typedef struct sonde_session_solid {
  uint32_t version; /**< SONDE_DEF_VERSION, from sonde_session_solid_default() */
  sonde_hyperelastic layer[SONDE_SOLID_LAYERS];
  double edge_m; /**< of the mesh's faces below the probe, 5 to 20 mm; 10 mm */
} sonde_session_solid;
/** The materials of the finite-element study. @thread any */
SONDE_API sonde_session_solid sonde_session_solid_default(void);

/** How a session's solid kept up. */
typedef struct sonde_session_solid_counts {
  uint64_t passes, factors;     /**< of the worker: states, and stiffnesses of the bulk */
  uint64_t ticks_without_place; /**< with the probe's face in the skin at rest, and no solid there
                                     that bears all of it: the hand feels nothing, or too little */
  uint32_t late;                /**< passes that were not done when they were due */
  uint32_t places;              /**< solids that the probe has changed over to */
  uint32_t refused;             /**< places where there was no skin below the probe, or no ring */
  double pass_mean_s, pass_most_s; /**< processor time */
  double build_s;                  /**< processor time of all places */
  double handed_over_n;            /**< largest change of the force where one took over */
} sonde_session_solid_counts;
/** All 0 for a session of springs. @thread owner, only while no loop runs */
SONDE_API sonde_session_solid_counts sonde_session_solid_count(const sonde_session *session);

#ifdef __cplusplus
}
#endif
#endif
