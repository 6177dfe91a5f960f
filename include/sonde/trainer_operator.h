/**
 * @file trainer_operator.h
 * Scripted operators: they see what a trainee sees (snapshots, never the truth), move a device
 * along a protocol, press, and decide. docs/trainer_theory.md.
 */
#ifndef SONDE_TRAINER_OPERATOR_H
#define SONDE_TRAINER_OPERATOR_H

#include "sonde/trainer_judge.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Names, NULL-terminated: expert, novice, timid, forceful. @thread any */
SONDE_API const char *const *sonde_operator_names(void);

typedef struct sonde_operator sonde_operator;

/** What an operator does. */
typedef enum sonde_operator_phase {
  SONDE_OPERATOR_TRAVEL, /**< to a place, and aims there */
  SONDE_OPERATOR_PRESS,
  SONDE_OPERATOR_HOLD, /**< the press has come to its end */
  SONDE_OPERATOR_RELEASE,
  SONDE_OPERATOR_TURN, /**< the patient has to take another position */
  SONDE_OPERATOR_DONE
} sonde_operator_phase;
/** @param[out] place of the plan; its count when done @param[out] attempt at it, from 0
 *  @thread owner */
SONDE_API sonde_operator_phase sonde_operator_doing(const sonde_operator *op, uint32_t *place,
                                                    uint32_t *attempt);

/** @param device filled with the operator's hand, moved into a session; it may be destroyed before
 *    or after the operator
 *  @param map,plan copied
 *  @return NOT_FOUND listing the names @thread owner */
SONDE_API sonde_status sonde_operator_create(const char *name, uint64_t seed,
                                             const sonde_vein_map *map, const sonde_plan *plan,
                                             double dt_s, sonde_operator **out,
                                             sonde_device *device, sonde_error *error);
SONDE_API void sonde_operator_destroy(sonde_operator *op); /**< @thread owner */
/** Shows the newest snapshot: the operator moves on. @thread owner, while no tick runs */
SONDE_API void sonde_operator_see(sonde_operator *op, const sonde_snapshot *snapshot);
/** The setup in whose position the operator wants the patient next. Until sonde_operator_hold() has
 *  put him there the operator does nothing. @thread owner */
SONDE_API uint32_t sonde_operator_wants(const sonde_operator *op);
/** The patient is in that position now: the hand comes to the next place anew, with another device.
 *  @param map of setup `held`, copied @param device filled as by sonde_operator_create() and taken
 *  in the place of that one, which may be gone @return MEMORY @thread owner */
SONDE_API sonde_status sonde_operator_hold(sonde_operator *op, uint32_t held,
                                           const sonde_vein_map *map, double dt_s,
                                           sonde_device *device, sonde_error *error);
/** Whether the exam is over for the operator. @thread owner */
SONDE_API bool sonde_operator_done(const sonde_operator *op);
/** What the operator thinks of a segment of the map. @thread owner */
SONDE_API sonde_decision sonde_operator_decision(const sonde_operator *op, uint32_t segment);

/** A whole exam without a person. */
typedef struct sonde_exam_def {
  const sonde_case *patient;
  const sonde_exam_protocol *protocol;
  const sonde_plan *plan;    /**< of the protocol on the setups with its targets, borrowed; NULL:
                                  that of the first setup's position with targets of its own */
  const char *operator_name; /**< default expert */
  uint64_t seed;             /**< of the operator's hand */
  const char *bundled;       /**< path of the bundled model */
  const char *directory;     /**< of the case file, for model paths */
  double limit_s;            /**< of simulated time; default 1200 */
  bool solid;                /**< the inside by finite elements, as in real time and always in a
                                  limb; default columns: ratios within 0.06 in a thigh */
  const char *json_path, *csv_path; /**< NULL: not written */
} sonde_exam_def;
SONDE_API sonde_exam_def sonde_exam_def_default(void); /**< @thread any */

/** Builds the case, lets the operator examine it in lockstep, judges. The patient turns when the
 *  operator asks for it.
 *  @param setups of this case for the protocol, borrowed; NULL: built for this exam
 *  @return what building says, CANCELLED, CONVERGENCE when the operator found no end @thread owner
 */
SONDE_API sonde_status sonde_exam_run(const sonde_exam_def *def, const sonde_exam_setups *setups,
                                      const sonde_progress *progress, sonde_score *score,
                                      sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
