// The model driven along a motion in time: what the robot's sensors would say.
#ifndef SONDE_SRC_FORWARD_H
#define SONDE_SRC_FORWARD_H

#include "identify/track.h"
#include "sonde/identify.h"
#include "tissue/model.h"

#include <stdatomic.h>

// One motion: where the probe goes and when it is looked at.
typedef struct sonde_drive {
  const sonde_site *site;
  sonde_probe probe;
  sonde_vec3 axis;
  sonde_track penetration, slide;
  uint32_t count;
  double *time_s; // [count] increasing
} sonde_drive;

sonde_status sonde_drive_create(const sonde_model *model, uint32_t site, const char *probe,
                                char axis, uint32_t count, sonde_drive *drive, sonde_error *error);
void sonde_drive_clear(sonde_drive *drive);

// The motion behind a record's noisy positions. The record is borrowed for the call only.
sonde_status sonde_drive_from_record(const sonde_model *model, const sonde_motion_record *record,
                                     sonde_drive *drive, sonde_error *error);

sonde_pose sonde_drive_pose(const sonde_drive *drive, double time_s);

// Normal and tangential force at the drive's times, linear between steps; starts at rest, or
// settled when the first pose is inside the skin.
// @param stop looked at between steps; may be NULL
// @param progress called from this thread; may be NULL
// @return CANCELLED; CONVERGENCE when a step is not finite
sonde_status sonde_drive_run(const sonde_drive *drive, const sonde_model *model,
                             const sonde_world_def *def, const atomic_bool *stop,
                             const sonde_progress *progress, double *normal_n, double *tangential_n,
                             sonde_error *error);

// A copy of the model that shares its arrays but for the stiffnesses: every spring times scale.
sonde_status sonde_model_borrow(const sonde_model *model, double stiffness_scale, sonde_model *copy,
                                sonde_error *error);
void sonde_model_return(sonde_model *copy);

#endif
