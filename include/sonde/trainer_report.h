/**
 * @file trainer_report.h
 * The report of one exam for the learner: one self-contained HTML page, which holds the exam as
 * JSON and the script that draws it (sonde_report_write()). What it says: docs/trainer_report.md.
 */
#ifndef SONDE_TRAINER_REPORT_H
#define SONDE_TRAINER_REPORT_H

#include "sonde/echo.h"
#include "sonde/exam_player.h"
#include "sonde/trainer_log.h"
#include "sonde/trainer_worksheet.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_EXAM_PICTURES = 12 };

/** Images of one press. An image without pixels is missing. Borrowed. */
typedef struct sonde_exam_picture {
  uint32_t press;           /**< index of the compression */
  sonde_image before, peak; /**< open vein before the press; at its peak */
} sonde_exam_picture;

/** Force and vein over time, at any rate; NaN where there was nothing. */
typedef struct sonde_exam_sample {
  double time_s, force_n;
  double vein_ratio; /**< area of the vein over its area at rest */
} sonde_exam_sample;

/**
 * What the page tells. All pointers are borrowed; patient, map, plan and score are required, what
 * else is NULL or 0 is left out with a word where a reader would miss it. Equal reports give equal
 * bytes.
 */
typedef struct sonde_exam_report {
  const sonde_case *patient;
  const sonde_exam_protocol *protocol;
  const sonde_vein_map *map;
  const sonde_plan *plan;
  const sonde_score *score;
  sonde_score_note note; /**< exam, trainee, guidance, date as in the log; protocol: its title when
                              `protocol` is NULL */
  bool interrupted;
  const sonde_compression *presses; /**< [press_count] in the order of time */
  uint32_t press_count;
  const sonde_exam_picture
      *pictures; /**< [picture_count] the first SONDE_EXAM_PICTURES are shown */
  uint32_t picture_count;
  const sonde_exam_sample *samples; /**< [sample_count] ascending time */
  uint32_t sample_count;
  const sonde_log_entry *earlier; /**< [earlier_count] of this trainee, newest first; this exam is
                                       left out by its id */
  uint32_t earlier_count;
  const sonde_comment *comments; /**< [comment_count] of who watched, by time */
  uint32_t comment_count;
  const char *recording;            /**< file to replay; NULL: none was kept */
  const sonde_worksheet *worksheet; /**< NULL: none was written */
  const sonde_sheet_verdict *verdict;
} sonde_exam_report;

/** Which presses to show: findings, faults and good ones from all along the vein, in the order of
 *  time. @param[out] chosen indices @return how many, at most `most` @thread any */
SONDE_API uint32_t sonde_exam_report_choose(const sonde_compression *presses, uint32_t count,
                                            uint32_t most, uint32_t *chosen);

/** Writes the page, atomically.
 *  @return ARGUMENT without patient, map, plan or score, for a picture of a press that is not there
 *    or larger than 2048 pixels; IO; MEMORY
 *  @thread owner */
SONDE_API sonde_status sonde_exam_report_write(const sonde_exam_report *report, const char *path,
                                               sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
