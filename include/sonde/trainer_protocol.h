/**
 * @file trainer_protocol.h
 * Protocols of the examination, as files: places, their order, and what a valid compression is.
 */
#ifndef SONDE_TRAINER_PROTOCOL_H
#define SONDE_TRAINER_PROTOCOL_H

#include "sonde/trainer_setup.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_EXAM_PROTOCOL_VERSION = 1, SONDE_EXAM_STOPS = 32, SONDE_PLAN_POINTS = 64 };

/** What a valid compression is (docs/trainer_theory.md). The forces are those of a place:
 *  sonde_force_target. */
typedef struct sonde_criteria {
  double tilt_rad;     /**< most between image plane and transverse; 20 degrees */
  double closed_ratio; /**< the vein's walls touch: area ratio at most this; 0.10 */
  double open_ratio;   /**< the vein stays open: at least this left; 0.30 */
  double reach_m;      /**< a press this near to a point examines it */
} sonde_criteria;
SONDE_API sonde_criteria sonde_criteria_default(void); /**< @thread any */

/** The force of one place of the exam: what the page shows, the judge applies, the score and the
 *  report name. Whole newtons, so that the number shown is the number that counts. */
typedef struct sonde_force_target {
  double closes_n; /**< force at which a healthy vein there falls to closed_ratio */
  double firm_n;   /**< closes_n rounded up: a vein that stays open at this force is a finding */
  double limit_n;  /**< 1.2 closes_n + 2 N rounded up: a press above it is too hard */
} sonde_force_target;
/** @param closes_n more than 0 @thread any */
SONDE_API sonde_force_target sonde_force_target_make(double closes_n);

/** One place, or places every so often between two. */
typedef struct sonde_exam_stop {
  char title[64], text[256];
  char needs[32];   /**< branch of the thigh without which the place is left out; empty: none */
  char segment[32]; /**< whose finding a station is for; empty: the station's own */
  sonde_station from, to;
  double every_m;               /**< 0: one place, `from` */
  sonde_limb_position position; /**< to be examined in; SONDE_LIMB_POSITIONS: as the patient lies */
} sonde_exam_stop;

typedef struct sonde_exam_protocol {
  char id[48], title[96], text[512];
  sonde_criteria criteria;
  uint32_t stop_count;
  sonde_exam_stop stop[SONDE_EXAM_STOPS]; /**< in the order of the exam */
} sonde_exam_protocol;

SONDE_API sonde_status sonde_exam_protocol_load(const char *path, sonde_exam_protocol *out,
                                                sonde_error *error); /**< @thread owner */
/** The same of a text; name: what messages call it. @thread owner */
SONDE_API sonde_status sonde_exam_protocol_parse(const char *text, const char *name,
                                                 sonde_exam_protocol *out, sonde_error *error);
/** As sonde_case_list(), by number of places, then id. @thread owner */
SONDE_API sonde_status sonde_exam_protocol_list(const char *directory,
                                                sonde_exam_protocol **protocols, uint32_t *count,
                                                sonde_error *error);

/** A place of the exam on one thigh. */
typedef struct sonde_plan_point {
  char title[64], text[256];
  uint32_t held; /**< setup of the exam in whose position it is; the place is in its frame */
  sonde_limb_position position; /**< that of the setup */
  uint32_t segment;             /**< of the map: its veins must close */
  bool station;        /**< of the limb: the probe stands as there, not straight above the vein */
  sonde_vein_point at; /**< of another vein than the main one without along_m (NaN) */
  double course_m;     /**< along_m where the first setup has that place of the vein */
  sonde_force_target target; /**< NaN before sonde_plan_find_targets() */
} sonde_plan_point;

/** A protocol on one thigh. Plain data. */
typedef struct sonde_plan {
  sonde_criteria criteria;
  uint32_t count;
  sonde_plan_point point[SONDE_PLAN_POINTS]; /**< in the order of the exam */
} sonde_plan;

/** The places, without their forces, all in the position of the map. A place that needs a branch
 *  which the thigh has not is left out.
 *  @return NOT_FOUND for a place or a vein there that the leg has not; ARGUMENT for more than
 * SONDE_PLAN_POINTS or none at all
 *  @thread any */
SONDE_API sonde_status sonde_plan_make(const sonde_exam_protocol *protocol,
                                       const sonde_vein_map *map, sonde_plan *plan,
                                       sonde_error *error);

/** Finds the force of every place by pressing a healthy vein there: thigh and posture of the
 * place's setup, its oedema, the linear probe straight above the vein at 12 mm/s (faster while the
 * vein is wide open), the inside by finite elements as in a session; no clot, breath or strain.
 * Places of one station share the force that closes the veins of all of them. About 1.8 s of a
 * core's time for each place in a limb, on all cores but one; the forces do not depend on their
 * number.
 *  @param setup [as many as the places name] of the case, with whose maps the plan was made
 *  @return MISMATCH for a place where the healthy vein does not close at 60 N, or 60 mm deep;
 *    CANCELLED; MEMORY @thread owner */
SONDE_API sonde_status sonde_plan_find_targets(sonde_plan *plan, const sonde_case_setup *setup,
                                               const sonde_progress *progress, sonde_error *error);
/** The place of the plan in a setup's position whose skin is nearest to a probe's face, in reach or
 * not; of places at one station the first; SONDE_PLAN_POINTS when there is none. @thread any */
SONDE_API uint32_t sonde_plan_nearest(const sonde_plan *plan, uint32_t held, sonde_vec3 face_m);

enum { SONDE_EXAM_SETUPS = 4 };
/** A case in the positions that an exam needs, in the order of its places: a model each, of the
 * same leg with the same findings. */
typedef struct sonde_exam_setups {
  uint32_t count;
  sonde_case_setup held[SONDE_EXAM_SETUPS];
} sonde_exam_setups;

/** The case in every position that the protocol's places ask for and the patient can take (a place
 *  that asks for another is examined as the patient lies at first), and the plan without its
 * forces. About 1.5 s of a core's time for each position.
 *  @param bundled,directory as of sonde_case_build()
 *  @param[out] setups released by sonde_exam_setups_clear()
 *  @return as sonde_case_build(), sonde_plan_make() @thread owner */
SONDE_API sonde_status sonde_exam_lay(const sonde_case *from, const sonde_exam_protocol *protocol,
                                      const char *bundled, const char *directory,
                                      sonde_exam_setups *setups, sonde_plan *plan,
                                      sonde_error *error);
/** The same with the forces. @return also as sonde_plan_find_targets() @thread owner */
SONDE_API sonde_status sonde_exam_prepare(const sonde_case *from,
                                          const sonde_exam_protocol *protocol, const char *bundled,
                                          const char *directory, const sonde_progress *progress,
                                          sonde_exam_setups *setups, sonde_plan *plan,
                                          sonde_error *error);
SONDE_API void sonde_exam_setups_clear(sonde_exam_setups *setups); /**< @thread owner */
/** The setup in whose position the patient is; the count when there is none. @thread any */
SONDE_API uint32_t sonde_exam_setups_find(const sonde_exam_setups *setups,
                                          sonde_limb_position position);

#ifdef __cplusplus
}
#endif
#endif
