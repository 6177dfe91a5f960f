/**
 * @file trainer_setup.h
 * A case on its thigh: model, places of the vein, pathology where the case has it.
 */
#ifndef SONDE_TRAINER_SETUP_H
#define SONDE_TRAINER_SETUP_H

#include "sonde/trainer.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A case on its thigh, in the case's first position. */
typedef struct sonde_case_setup {
  sonde_limb_position position;
  sonde_model *model; /**< owned */
  sonde_vein_map map;
  sonde_pathology pathology;
  sonde_findings findings;
  sonde_circulation circulation;
  bool clot[SONDE_SEGMENTS]; /**< [map.segment_count] one of its veins holds one of 5 mm or more */
  bool thrombosis;           /**< of a deep vein */
} sonde_case_setup;

/** Loads or makes the thigh, places everything on it, finds which segments hold a clot and checks
 *  the truth against that. A case without a truth (truth_count 0) is built too.
 *  @param bundled path of the bundled model; may be NULL when the case does not use it
 *  @param directory of the case file, for model paths; NULL: the working directory
 *  @param[out] setup released by sonde_case_setup_clear()
 *  @return MISMATCH when the truth calls a segment what its vein is not; NOT_FOUND, ARGUMENT naming
 *    the place; what loading or making the model says
 *  @thread owner */
SONDE_API sonde_status sonde_case_build(const sonde_case *from, const char *bundled,
                                        const char *directory, sonde_case_setup *setup,
                                        sonde_error *error);
SONDE_API void sonde_case_setup_clear(sonde_case_setup *setup); /**< @thread owner */
/** Model, pathology, findings, posture and circulation of a session; the setup must outlive it.
 *  @thread owner */
SONDE_API void sonde_case_session(const sonde_case_setup *setup, sonde_session_def *def);

#ifdef __cplusplus
}
#endif
#endif
