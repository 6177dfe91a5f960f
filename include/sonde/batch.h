/**
 * @file batch.h
 * Many legs under many probes, stepped together for learning and for studies: actions in,
 * observations out, states to return to. docs/batch.md.
 */
#ifndef SONDE_BATCH_H
#define SONDE_BATCH_H

#include "sonde/echo_scanner.h"
#include "sonde/trainer_setup.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_BATCH_ACTION = 7, SONDE_BATCH_POSE = 7, SONDE_BATCH_WRENCH = 6 };

/** How the SONDE_BATCH_ACTION numbers of an action move a probe during a step. */
typedef enum sonde_batch_drive {
  SONDE_BATCH_TO_POSE, /**< x y z (m), w x y z: straight and along the short arc to this pose of the
                            probe in the world, as far as the speeds below reach */
  SONDE_BATCH_BY_TWIST, /**< velocity (m/s) and angular velocity (rad/s) in the probe's frame; the
                             last number is not used */
  SONDE_BATCH_BY_FORCE, /**< as BY_TWIST, but the third number is the normal force (N) that an
                             admittance along the probe's axis keeps */
  SONDE_BATCH_DRIVES
} sonde_batch_drive;
/** "pose", "twist", "force". @thread any */
SONDE_API const char *sonde_batch_drive_name(sonde_batch_drive drive);

/** What the vessels in the image plane are like; NaN when the plane meets none within 40 mm of the
 *  beam's axis. x is along the face, z into the tissue (the probe's frame). */
#define SONDE_BATCH_VESSEL_LIST(X)                                                                 \
  X(vein_ratio, "area of the main vein over its area at rest")                                     \
  X(vein_x_m, "middle of the main vein along the face")                                            \
  X(vein_z_m, "middle of the main vein below the face")                                            \
  X(vein_tilt_rad, "angle between the vein and the normal of the image plane, 0: transverse")      \
  X(vein_short_m, "short diameter of the main vein")                                               \
  X(other_ratio, "greatest area ratio of its double veins")                                        \
  X(artery_ratio, "area of the main artery over its area at rest")                                 \
  X(artery_x_m, "middle of the main artery along the face")                                        \
  X(artery_z_m, "middle of the main artery below the face")
enum {
#define SONDE_BATCH_VESSEL_NUMBER(name, text) SONDE_BATCH_##name,
  SONDE_BATCH_VESSEL_LIST(SONDE_BATCH_VESSEL_NUMBER)
#undef SONDE_BATCH_VESSEL_NUMBER
      SONDE_BATCH_VESSEL
};
/** Name of a column of sonde_batch_view.vessel. @param column less than SONDE_BATCH_VESSEL
 * @thread any */
SONDE_API const char *sonde_batch_vessel_name(uint32_t column);

typedef struct sonde_batch sonde_batch;

typedef struct sonde_batch_def {
  uint32_t version;                        /**< SONDE_DEF_VERSION, from sonde_batch_def_default() */
  uint32_t count;                          /**< environments, 1 to 4096; default 1 */
  const sonde_case_setup *const *patients; /**< [patient_count] borrowed; environment i has
                                                patient i % patient_count */
  uint32_t patient_count;
  const char *probe;       /**< as sonde_probe_create(); default linear */
  sonde_batch_drive drive; /**< default BY_TWIST */
  uint32_t ticks_per_step; /**< of 1 ms, 1 to 1000; default 20 */
  uint32_t threads;        /**< 0, the default: one per core; the results do not depend on it */
  bool inside;             /**< vessels at the end of each step; default true. Else NaN */
  uint32_t width, height;  /**< of the picture at the end of each step, 16 to 4096; default 0:
                                none. A picture needs `inside` */
  const sonde_scanner *scanner;  /**< copied; NULL: the plain one */
  sonde_friction friction;       /**< default none */
  double speed_m_s, speed_rad_s; /**< greatest of a probe; default 0.2 and 2 */
  double force_limit_n;          /**< a probe is moved back along its axis while the normal force is
                                      above it; default 40 */
  double admittance_m_s_n; /**< speed along the axis per newton that is missing; default 0.02 */
} sonde_batch_def;

/** No patients. @thread any */
SONDE_API sonde_batch_def sonde_batch_def_default(void);

/** What one environment starts with. */
typedef struct sonde_batch_start {
  sonde_pose world_from_probe;
  sonde_pathology pathology;    /**< of the main vein */
  double stiffness_scale;       /**< of every spring, 0.5 to 2 */
  double damping_scale;         /**< of every damper, 0.25 to 4 */
  double friction_scale;        /**< of every coefficient of friction, 0 to 2 */
  sonde_echo_settings settings; /**< of the picture; clamped */
} sonde_batch_start;
/** The patient of the environment as its case has it, the probe 20 mm above the skin over the first
 *  station, site or point of the vein, the scanner's own settings. @thread owner */
SONDE_API sonde_batch_start sonde_batch_start_default(const sonde_batch *batch, uint32_t index);

/** What the environments are like; arrays of the batch that stay where they are until
 *  sonde_batch_destroy(). */
typedef struct sonde_batch_view {
  uint32_t count, width, height;
  const double *pose;    /**< [count*7] x y z (m), w x y z: world from probe */
  const double *wrench;  /**< [count*6] N and N m of the tissue on the probe about the middle of its
                              face, in the probe's frame */
  const double *vessel;  /**< [count*SONDE_BATCH_VESSEL] */
  const double *time_s;  /**< [count] since the reset */
  const uint32_t *flags; /**< [count] SONDE_FLAG_* that any tick of the step has set */
  const uint8_t *pixels; /**< [count*height*width] row 0 at the probe; NULL without pictures */
  double width_m, height_m; /**< of a picture by the first environment's settings */
} sonde_batch_view;

/** Builds the environments at their default starts; docs/batch.md tells what they take of memory.
 *  @param[out] batch released by sonde_batch_destroy()
 *  @return ARGUMENT naming the member out of range; NOT_FOUND for a probe; MESH for `inside` of a
 *    model without a bone; MEMORY @thread owner */
SONDE_API sonde_status sonde_batch_create(const sonde_batch_def *def, sonde_batch **batch,
                                          sonde_error *error);
SONDE_API void sonde_batch_destroy(sonde_batch *batch);                /**< @thread owner */
SONDE_API sonde_batch_view sonde_batch_look(const sonde_batch *batch); /**< @thread owner */

/** Puts one environment back to rest under a start, with its observations made anew.
 *  @return ARGUMENT for a pose that is none or a scale out of range @thread owner */
SONDE_API sonde_status sonde_batch_reset(sonde_batch *batch, uint32_t index,
                                         const sonde_batch_start *start, sonde_error *error);
/** Steps all environments, on `threads` threads.
 *  @param actions [count*SONDE_BATCH_ACTION]; a number that is not finite counts as 0, a pose that
 *    is none as the present one
 *  @param mask NULL, or [count]: those with 0 stand still
 *  @return MEMORY when no thread could be started @thread owner */
SONDE_API sonde_status sonde_batch_step(sonde_batch *batch, const double *actions,
                                        const uint8_t *mask, sonde_error *error);

/** Bytes of a saved environment. @thread owner */
SONDE_API size_t sonde_batch_size(const sonde_batch *batch, uint32_t index);
/** Keeps all that the next steps of an environment depend on.
 *  @param[out] blob [sonde_batch_size()] aligned to 8 bytes @thread owner */
SONDE_API void sonde_batch_save(const sonde_batch *batch, uint32_t index, void *blob);
/** Goes on where an environment of the same patient was saved, bit for bit; the picture is that of
 *  the next step, the other observations are there at once.
 *  @return FORMAT, MISMATCH @thread owner */
SONDE_API sonde_status sonde_batch_restore(sonde_batch *batch, uint32_t index, const void *blob,
                                           size_t bytes, sonde_error *error);
/** Hash of the skin's motion and the probe's pose of all environments: equal runs have equal
 *  hashes. @thread owner */
SONDE_API uint64_t sonde_batch_hash(sonde_batch *batch);
/** Snapshot of one environment as sonde_judge_feed() takes it; valid until the next step or reset.
 *  @thread owner */
SONDE_API const sonde_snapshot *sonde_batch_snapshot(const sonde_batch *batch, uint32_t index);

#ifdef __cplusplus
}
#endif
#endif
