/**
 * @file sweep_poses.h
 * Poses of tracked frames corrected by what the frames show: the noise of the tracker, the time
 * between its clock and that of the pictures, and the calibration. docs/frames_images_theory.md
 * tells the model.
 */
#ifndef SONDE_SWEEP_POSES_H
#define SONDE_SWEEP_POSES_H

#include "sonde/sweep_frames.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What the frames told about their poses. */
typedef struct sonde_pose_findings {
  uint32_t frames;    /**< whose content was used */
  bool kept;          /**< the given poses stay: with others the frames were no more alike */
  double jitter_m;    /**< deviation of the tracker's noise at the picture's middle, one axis */
  double jitter_rad;  /**< and of its rotation about one axis; 0: none that can be told */
  double moved_m;     /**< rms of how far the pictures' middles went */
  double moved_rad;   /**< and of how far the pictures turned */
  bool timed;         /**< the frames have time stamps that grow */
  bool offset_found;  /**< the data determine it; else it is 0 in the poses */
  double offset_s;    /**< a picture shows the tracker's pose of this much later */
  double offset_sd_s; /**< its deviation */
  bool calibration_found[6]; /**< the data determine it; else the given one is kept */
  double calibration[6];     /**< shift of the picture's middle along its columns, rows and normal,
                                  m; turn about them, rad */
  double calibration_sd[6];  /**< their deviations */
  double rms_grey_before;    /**< frames against those on both sides, smoothed, given poses */
  double rms_grey_after;     /**< the same, poses as they are now */
} sonde_pose_findings;

/**
 * Corrects the poses of the used frames. What the data do not determine keeps its given value, and
 * poses with which the frames are not more alike are not taken.
 * @param sequence located; fields "Timestamp" in s are needed for the offset
 * @param hidden [count] frames whose content is not used (their tracked pose is), or NULL
 * @return SONDE_MISMATCH for fewer than eight used frames
 * @thread owner
 */
SONDE_API sonde_status sonde_sequence_refine_poses(sonde_sequence *sequence, const bool *hidden,
                                                   sonde_pose_findings *findings,
                                                   const sonde_progress *progress,
                                                   sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
