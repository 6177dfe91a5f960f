/**
 * @file trainer_judge.h
 * What a trainee did, from what the session showed: compressions, coverage, guidance, decisions,
 * and the score against the truth. Every formula: docs/trainer_theory.md.
 */
#ifndef SONDE_TRAINER_JUDGE_H
#define SONDE_TRAINER_JUDGE_H

#include "sonde/trainer_protocol.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_SCORE_VERSION = 4, SONDE_COMPRESSIONS = 4096, SONDE_HINT_S = 10 };

typedef enum sonde_press_result {
  SONDE_PRESS_COMPLETE,     /**< walls touch, transverse, not too hard */
  SONDE_PRESS_OPEN,         /**< pressed firmly, and the vein stays open: a finding */
  SONDE_PRESS_INSUFFICIENT, /**< neither */
  SONDE_PRESS_TOO_HARD,     /**< force beyond the place's limit */
  SONDE_PRESS_OFF_AXIS,     /**< image plane not transverse, or the vein left it */
  SONDE_PRESS_RESULTS
} sonde_press_result;
/** "complete", "open", "insufficient", "too_hard", "off_axis". @thread any */
SONDE_API const char *sonde_press_result_name(sonde_press_result result);

/** One compression, from touching harder than the threshold to letting go. */
typedef struct sonde_compression {
  double start_s, peak_s, end_s; /**< since the first snapshot */
  sonde_press_result result;
  uint32_t segment;    /**< of the map; SONDE_SEGMENTS when the vein was not in view */
  uint32_t point;      /**< nearest of the plan within reach; SONDE_PLAN_POINTS: none */
  uint32_t place;      /**< nearest of the plan, in reach or not: its force target applies */
  uint64_t examined;   /**< a bit per place of the plan that it examined */
  double z_m, along_m; /**< where the image plane cut the vein when it began, in the frame of its
                            position; along the main vein as the first setup has it, NaN when the
                            press shows nothing of that one */
  double force_peak_n;
  double vein_ratio, artery_ratio; /**< least of the vein; the artery's at the same time */
  double artery_least;
  double tilt_rad; /**< when the vein was smallest */
} sonde_compression;

typedef enum sonde_press_state {
  SONDE_PRESS_STATE_NONE,
  SONDE_PRESS_STATE_PRESSING,
  SONDE_PRESS_STATE_COMPLETE,
  SONDE_PRESS_STATE_OPEN,
  SONDE_PRESS_STATE_TOO_HARD,
  SONDE_PRESS_STATE_OFF_AXIS
} sonde_press_state;
/** "none", "pressing", "complete", "open", "too_hard", "off_axis". @thread any */
SONDE_API const char *sonde_press_state_name(sonde_press_state state);

typedef struct sonde_judge sonde_judge;

/** @param map of the first setup of the plan; copied, as the plan is
 *  @param[out] judge released by sonde_judge_destroy() @thread owner */
SONDE_API sonde_status sonde_judge_create(const sonde_vein_map *map, const sonde_plan *plan,
                                          sonde_judge **judge, sonde_error *error);
SONDE_API void sonde_judge_destroy(sonde_judge *judge); /**< @thread owner */

/** The next snapshot; one that is not newer than the last is ignored. Time is the snapshot's, so
 *  that its rate does not matter. Up to SONDE_COMPRESSIONS presses are kept, further ones are
 * counted.
 *  @return false when a press could not be kept for want of memory @thread owner */
SONDE_API bool sonde_judge_feed(sonde_judge *judge, const sonde_snapshot *snapshot);
/** Ends a press under way. @thread owner */
SONDE_API bool sonde_judge_finish(sonde_judge *judge);
/** The patient has taken another position: what is fed from now on is of that setup, in its frame,
 *  its time counted from 0. Ends a press under way; presses, places and decisions stay.
 *  @param map of setup `held`, copied @return false as sonde_judge_feed() @thread owner */
SONDE_API bool sonde_judge_hold(sonde_judge *judge, uint32_t held, const sonde_vein_map *map);

/** Finished presses; valid until the next feed. @thread owner */
SONDE_API const sonde_compression *sonde_judge_compressions(const sonde_judge *judge,
                                                            uint32_t *count);

/** The press under way, or nothing. */
typedef struct sonde_judge_now {
  sonde_press_state state;
  double vein_ratio, artery_ratio; /**< of the place at the probe; NaN when not in view */
  double force_n, time_s;
} sonde_judge_now;
SONDE_API sonde_judge_now sonde_judge_state(const sonde_judge *judge); /**< @thread owner */

/** A segment in the exam. */
typedef struct sonde_segment_status {
  bool needed;           /**< the plan has points there */
  uint32_t points, done; /**< of the plan; with a complete or open press */
  uint32_t open;         /**< presses that found the vein open */
  sonde_decision decision;
} sonde_segment_status;
/** @param segment of the map @thread owner */
SONDE_API sonde_segment_status sonde_judge_segment(const sonde_judge *judge, uint32_t segment);
/** @return ARGUMENT for an unknown segment @thread owner */
SONDE_API sonde_status sonde_judge_decide(sonde_judge *judge, uint32_t segment,
                                          sonde_decision decision, sonde_error *error);

/** What to do next, for guidance and hints. */
typedef struct sonde_guidance {
  uint32_t point;              /**< of the plan; SONDE_PLAN_POINTS when all are done */
  bool turn;                   /**< it is in another position than the patient's */
  char text[160], detail[256]; /**< what to do; how, or what comes then */
  double offset_m;             /**< of the probe's face from the target along the skin */
  double angle_rad;            /**< of the image plane from transverse there */
  bool angle_ok;
  sonde_force_target force; /**< of the press under way, else of the target */
  uint32_t undecided; /**< segment to decide next: the one pressed last, else the first that waits;
                           SONDE_SEGMENTS: none */
} sonde_guidance;
SONDE_API sonde_guidance sonde_judge_guidance(const sonde_judge *judge); /**< @thread owner */
/** The same, counted; force and target may be shown for SONDE_HINT_S. @thread owner */
SONDE_API sonde_guidance sonde_judge_hint(sonde_judge *judge);
/** Hints so far, and whether the last one is still to be shown. @thread owner */
SONDE_API uint32_t sonde_judge_hints(const sonde_judge *judge, bool *showing);

/** What was measured, few and defined; NaN where nothing was done. */
typedef struct sonde_metrics {
  double coverage;      /**< of the plan's stretch of vein, 0..1 */
  double vein_coverage; /**< of the whole vein, 0..1 */
  double gap_m;         /**< longest stretch of the plan without a valid press */
  uint32_t points, points_done;
  uint32_t presses[SONDE_PRESS_RESULTS], press_count;
  double completeness; /**< mean of 1 - the vein's least ratio over the complete presses */
  double valid_share;  /**< of the presses: complete or open */
  double force_peak_n, force_p95_n; /**< while pressing */
  double time_s, contact_s;
  double path_m;     /**< of the probe */
  double smoothness; /**< log dimensionless jerk of the way to a press, mean; higher is smoother */
  uint32_t hints;
  uint32_t restores; /**< times the probe was taken off (sonde_snapshot.restores) */
} sonde_metrics;
SONDE_API sonde_metrics sonde_judge_metrics(const sonde_judge *judge); /**< @thread owner */

/** Verdict on one segment. */
typedef struct sonde_segment_verdict {
  char name[32];
  bool needed;
  sonde_decision decision, truth;
  bool correct, supported; /**< by a press of the right kind */
  sonde_segment_kind kind;
  double from_m, to_m;
  uint32_t points, done;
} sonde_segment_verdict;

/** Parts of the score, each 0..1: name, weight in points, title, meaning. */
#define SONDE_SCORE_LIST(X)                                                                        \
  X(decisions, 40, "Findings",                                                                     \
    "Planned segments answered rightly, each shown by a press of the right kind there.")           \
  X(coverage, 25, "Coverage", "How much of the planned vein lies near a good press.")              \
  X(technique, 20, "Technique", "Share of the presses that closed the vein, or showed it open.")   \
  X(force, 10, "Force", "Planned places examined without a press above the place's limit.")        \
  X(economy, 5, "Time", "Little time for what was examined.")

typedef struct sonde_score {
  sonde_metrics metrics;
#define SONDE_SCORE_MEMBER(name, weight, title, text) double name;
  SONDE_SCORE_LIST(SONDE_SCORE_MEMBER)
#undef SONDE_SCORE_MEMBER
  double score; /**< 0..100 */
  bool correct; /**< the overall diagnosis; wrong or none: never passed */
  bool answered, called_thrombosis, thrombosis;
  bool passed;
  uint32_t segment_count;
  sonde_segment_verdict segment[SONDE_SEGMENTS];
  char asked[160], truth[160], summary[256];
} sonde_score;

/** @param truth whose map is the judge's @thread owner */
SONDE_API void sonde_judge_score(const sonde_judge *judge, const sonde_case *truth,
                                 sonde_score *score);

enum { SONDE_SCORE_PARTS = 5, SONDE_SCORE_WORDS = 480 };
/** One part of the score, in points, and in words where they went. */
typedef struct sonde_score_part {
  const char *name, *title, *meaning; /**< static */
  double points, of;
  char lost[SONDE_SCORE_WORDS]; /**< what was lost, where and why; empty exactly when nothing was */
} sonde_score_part;
/** The parts in the order of SONDE_SCORE_LIST.
 *  @param presses [count] of the exam that was scored, in the order of time @thread any */
SONDE_API void sonde_score_explain(const sonde_score *score, const sonde_plan *plan,
                                   const sonde_compression *presses, uint32_t count,
                                   sonde_score_part part[SONDE_SCORE_PARTS]);

/** What a result file says beside the score; texts may be NULL. */
typedef struct sonde_score_note {
  const char *exam, *trainee, *protocol, *guidance, *date;
  const char *tissue; /**< "solid"; NULL or empty: springs */
} sonde_score_note;
struct sonde_worksheet;
struct sonde_sheet_verdict;
/** Everything as JSON and the presses as CSV, atomically; either path may be NULL.
 *  @param sheet,verdict trainer_worksheet.h; NULL: none was written @thread owner */
SONDE_API sonde_status sonde_score_save(const sonde_judge *judge, const sonde_case *truth,
                                        const sonde_score *score, const sonde_score_note *note,
                                        const struct sonde_worksheet *sheet,
                                        const struct sonde_sheet_verdict *verdict,
                                        const char *json_path, const char *csv_path,
                                        sonde_error *error);

/** Exams over a series: overall diagnosis and segments. */
typedef struct sonde_series {
  uint32_t exams, passed, unanswered;
  uint32_t true_positive, false_positive, true_negative, false_negative;
  double score_sum;
} sonde_series;
/** An exam without an answer counts as missed when there was a clot, else as unanswered only.
 *  @thread owner */
SONDE_API void sonde_series_add(sonde_series *series, const sonde_score *score);
/** NaN without a case of the kind. @thread any */
SONDE_API double sonde_series_sensitivity(const sonde_series *series);
SONDE_API double sonde_series_specificity(const sonde_series *series); /**< @thread any */

#ifdef __cplusplus
}
#endif
#endif
