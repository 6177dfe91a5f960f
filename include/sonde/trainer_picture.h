/**
 * @file trainer_picture.h
 * Guidance in the picture, drawn from the truth: what each vessel is, where the wanted one is, and
 * what a press shows and why; and scripted learners with errors of search who follow it:
 * docs/course.md.
 */
#ifndef SONDE_TRAINER_PICTURE_H
#define SONDE_TRAINER_PICTURE_H

#include "sonde/trainer_course.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_PICTURE_MARKS = 24 };

typedef enum sonde_mark_kind {
  SONDE_MARK_VEIN,
  SONDE_MARK_ARTERY,
  SONDE_MARK_LESION,
  SONDE_MARK_KINDS
} sonde_mark_kind;
/** "vein", "artery", "lesion". @thread any */
SONDE_API const char *sonde_mark_kind_name(sonde_mark_kind kind);

/** A thing in the picture under its name. */
typedef struct sonde_picture_mark {
  sonde_mark_kind kind;
  double aside_m, depth_m; /**< of its middle: along the probe's x, below the face */
  double half_m, flat_m;   /**< half of its greater and of its smaller diameter */
  bool wanted;             /**< the place asks for it */
  double area_ratio;       /**< current / rest; NaN of a lesion */
  char name[48];
  char why[128]; /**< what is seen of it and why; empty: nothing to say now */
} sonde_picture_mark;

/** What guidance shows in the picture. */
typedef struct sonde_picture {
  uint32_t count;
  sonde_picture_mark mark[SONDE_PICTURE_MARKS]; /**< [count] nearest to the probe first */
  /** The way to the view: what is wanted lies to the side of the picture's x by aside_m, and along
   * the leg by along_m, > 0 where the probe's y points; both NaN when there is no way to show. */
  double aside_m, along_m;
  char way[96]; /**< in words */
} sonde_picture;

/** @param judge of the exam @param setup in whose position the patient is
 *  @param snapshot of the picture, the newest that the judge saw or older
 *  @param level FULL: names, what and why, the way; HINTS: names; EXAM: nothing
 *  @thread owner */
SONDE_API void sonde_picture_read(const sonde_judge *judge, const sonde_case_setup *setup,
                                  const sonde_snapshot *snapshot, sonde_guidance_level level,
                                  sonde_picture *picture);

/** How a scripted learner came to the view of a place. */
typedef struct sonde_search {
  bool found;     /**< else given up after SONDE_SEARCH_S */
  double path_m;  /**< of the probe over the skin */
  uint32_t ticks; /**< of 1 ms */
} sonde_search;
enum { SONDE_SEARCH_S = 120 };

/**
 * Lets learners look for the view of a place, with each level of guidance: a learner puts the probe
 * down beside it (standard deviations 40 mm along the leg, 15 mm across, 20 degrees), moves it at
 * 40 mm/s, looks 5 times a second, and is there when the wanted vein is within 8 mm of the
 * picture's middle, the probe within the plan's reach and its tilt. Without a way to follow he goes
 * to and fro along the leg, each time 15 mm farther, and knows the vein when it is in view: by its
 * name, without names at one look in three. A way that is shown he follows with an error of a
 * quarter of its length and 15 degrees of its direction. The leg is at rest: nothing is pressed.
 * @param setups,plan of sonde_exam_lay() @param place of the plan
 * @param[out] search [SONDE_GUIDANCE_LEVELS][learners]: the same learners, who begin at the same
 *   points, at each level @return MEMORY @thread owner
 */
SONDE_API sonde_status sonde_learner_search(const sonde_exam_setups *setups, const sonde_plan *plan,
                                            uint32_t place, uint32_t learners, sonde_search *search,
                                            sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
