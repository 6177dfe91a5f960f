// One leg under one probe: what moves, and what is seen of it.
#ifndef SONDE_SRC_ENVIRONMENT_H
#define SONDE_SRC_ENVIRONMENT_H

#include "exam/subject.h"
#include "interior/interior.h"
#include "sonde/batch.h"

// What environments of one patient share.
typedef struct sonde_patient {
  const sonde_case_setup *setup; // borrowed
  sonde_batch_start start;
  void *rest; // a subject at rest, [rest_bytes]
  size_t rest_bytes;
  sonde_interior_memory inside; // of the interior at rest
} sonde_patient;

// What the next step depends on besides the subject.
typedef struct sonde_environment_moment {
  sonde_batch_start start;
  sonde_pose pose; // of the probe
  uint32_t shown;  // whether the inside has followed since the reset
  uint64_t shown_tick;
  sonde_interior_memory inside;
  size_t subject_bytes; // that follow in a saved environment
  // what was seen last
  double vessel[SONDE_BATCH_VESSEL];
  sonde_snapshot snapshot;
} sonde_environment_moment;

typedef struct sonde_environment {
  const sonde_batch_def *def; // of the batch
  const sonde_probe *probe;   // of the batch
  const sonde_patient *patient;
  sonde_subject *subject;
  sonde_interior *interior; // NULL without `inside`
  sonde_echo *echo;         // NULL without pictures
  sonde_environment_moment now;
  // rows of the batch's arrays
  double *pose, *wrench, *vessel, *time_s;
  uint32_t *flags;
  uint8_t *pixels;
} sonde_environment;

// @param patient with its setup; without a rest yet it gets its rest from this environment
// @param environment with def, probe and rows; closed also after a failure @thread owner
sonde_status sonde_environment_open(sonde_environment *environment, sonde_patient *patient,
                                    sonde_error *error);
void sonde_environment_close(sonde_environment *environment);
// @thread owner
sonde_status sonde_environment_reset(sonde_environment *environment, const sonde_batch_start *start,
                                     sonde_error *error);
size_t sonde_environment_size(const sonde_environment *environment);
void sonde_environment_save(const sonde_environment *environment, void *blob);
sonde_status sonde_environment_restore(sonde_environment *environment, const void *blob,
                                       size_t bytes, sonde_error *error);

// Moves the probe by an action for `ticks` ticks (0: only looks). @thread any one
void sonde_environment_step(sonde_environment *environment, const double *action, uint32_t ticks);
// Brings the inside up to date, fills the rows, draws the picture. @thread any one
void sonde_environment_look(sonde_environment *environment);
// Fills the rows from the leg and what was seen last. @thread any one
void sonde_environment_tell(sonde_environment *environment);

#endif
