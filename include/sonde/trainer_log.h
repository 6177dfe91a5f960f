/**
 * @file trainer_log.h
 * The log of exams: one SQLite file for all trainees of a machine, written by several programs at
 * once, readable by anything that reads SQLite: docs/trainer_report.md.
 */
#ifndef SONDE_TRAINER_LOG_H
#define SONDE_TRAINER_LOG_H

#include "sonde/trainer_judge.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SONDE_LOG_VERSION = 1,
  SONDE_LOG_WINDOW = 5,
  SONDE_LOG_WINDOW_MAX = 99,
  SONDE_LOG_TEXT = 96
};

/** One exam as the log keeps it. Plain data; texts are UTF-8. */
typedef struct sonde_log_entry {
  char id[SONDE_LOG_TEXT]; /**< unique in the log */
  char trainee[SONDE_LOG_TEXT];
  char case_id[48], case_title[96];
  char protocol[48], guidance[32]; /**< ids */
  char date[24];                   /**< of the end, "2026-11-22T04:40:00Z" */
  char recording[256];             /**< path of the recording that was kept; empty: none */
  double score;                    /**< 0..100 */
  bool passed, correct, answered, called_thrombosis, thrombosis;
  bool
      interrupted; /**< ended by something else than the trainee: listed, not counted as learning */
  sonde_metrics metrics; /**< time_s is the exam's duration; NaN is kept as NULL */
} sonde_log_entry;

/** What an exam's score says, as an entry; texts too long are cut at a character. NULL texts are
 *  empty, a NULL date is now. @thread any */
SONDE_API sonde_log_entry sonde_log_entry_make(const sonde_case *patient, const sonde_score *score,
                                               const sonde_score_note *note);
/** The time in seconds since 1970 as "2026-11-22T04:40:00Z". @thread any */
SONDE_API void sonde_log_date(int64_t unix_s, char date[24]);

typedef struct sonde_exam_log sonde_exam_log;

/** Opens a log or makes an empty one (its directory must exist). Other programs may have it open.
 *  @param[out] log released by sonde_exam_log_close()
 *  @return FORMAT for another kind of file or a damaged one, which stays as it is; VERSION for a
 *    newer log; IO
 *  @thread owner */
SONDE_API sonde_status sonde_exam_log_open(const char *path, sonde_exam_log **log,
                                           sonde_error *error);
/** NULL is ignored. @thread owner */
SONDE_API void sonde_exam_log_close(sonde_exam_log *log);

/** Adds an exam: all of it is on disk when this returns OK, else none of it. Waits up to 5 s for
 *  other programs.
 *  @return ARGUMENT for an empty id, trainee or case, an id that is there already, a date of
 * another form, a score outside 0..100; IO
 *  @thread owner */
SONDE_API sonde_status sonde_exam_log_add(sonde_exam_log *log, const sonde_log_entry *entry,
                                          sonde_error *error);

/** Whether an exam of that id is in the log. @thread owner */
SONDE_API sonde_status sonde_exam_log_has(sonde_exam_log *log, const char *id, bool *found,
                                          sonde_error *error);

/** An entry as one JSON object with the names of the log's columns, e.g. for a journal.
 *  @param[out] text freed by sonde_free() @return MEMORY @thread any */
SONDE_API sonde_status sonde_log_entry_text(const sonde_log_entry *entry, char **text,
                                            sonde_error *error);
/** The same read back; members that are missing are empty, 0 or NaN.
 *  @return FORMAT when the text is not an object or could not be added to a log @thread any */
SONDE_API sonde_status sonde_log_entry_parse(const char *text, sonde_log_entry *entry,
                                             sonde_error *error);

/** Newest first (by date, then by order of adding).
 *  @param trainee NULL: all @param most 0: all
 *  @param[out] entries [*count] freed by sonde_free; NULL when *count is 0
 *  @thread owner */
SONDE_API sonde_status sonde_exam_log_list(sonde_exam_log *log, const char *trainee, uint32_t most,
                                           sonde_log_entry **entries, uint32_t *count,
                                           sonde_error *error);

/** A point of a learning curve. */
typedef struct sonde_learning_point {
  uint32_t number; /**< 1 is the first exam */
  double score;
  double median; /**< of this exam's score and the ones before, at most `window` of them */
  bool passed;
  char date[24];
} sonde_learning_point;
/** Finished exams of a trainee, oldest first.
 *  @param window 0: SONDE_LOG_WINDOW; at most SONDE_LOG_WINDOW_MAX @param[out] points [*count]
 * freed by sonde_free
 *  @thread owner */
SONDE_API sonde_status sonde_exam_log_curve(sonde_exam_log *log, const char *trainee,
                                            uint32_t window, sonde_learning_point **points,
                                            uint32_t *count, sonde_error *error);
/** The same from entries that are newest first. @param points [count] @return how many were filled
 *  @thread any */
SONDE_API uint32_t sonde_learning_curve(const sonde_log_entry *entries, uint32_t count,
                                        uint32_t window, sonde_learning_point *points);

/** Finished exams of a trainee (NULL: all) as a series: sonde_series_sensitivity(). @thread owner
 */
SONDE_API sonde_status sonde_exam_log_series(sonde_exam_log *log, const char *trainee,
                                             sonde_series *series, sonde_error *error);

/** How often something was examined. */
typedef struct sonde_log_count {
  char name[SONDE_LOG_TEXT];  /**< trainee, or id of a case */
  char title[SONDE_LOG_TEXT]; /**< of the case as last added; empty for a trainee */
  uint32_t exams, finished, passed;
  double score_best, score_mean; /**< of the finished ones; NaN without one */
  char last[24];                 /**< date of the newest */
} sonde_log_count;
typedef enum sonde_log_by { SONDE_LOG_BY_TRAINEE, SONDE_LOG_BY_CASE } sonde_log_by;
/** By name. @param trainee of cases: only this one's exams; NULL: all
 *  @param[out] counts [*count] freed by sonde_free @thread owner */
SONDE_API sonde_status sonde_exam_log_count(sonde_exam_log *log, sonde_log_by by,
                                            const char *trainee, sonde_log_count **counts,
                                            uint32_t *count, sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
