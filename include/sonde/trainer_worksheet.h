/**
 * @file trainer_worksheet.h
 * The worksheet of an exam: what the examiner writes at each place of the protocol, the pictures
 * that he stores there, his conclusion; and how all that compares with the truth of the case:
 * docs/worksheet.md.
 */
#ifndef SONDE_TRAINER_WORKSHEET_H
#define SONDE_TRAINER_WORKSHEET_H

#include "sonde/base_json.h"
#include "sonde/echo.h"
#include "sonde/trainer_protocol.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SONDE_SHEET_PICTURES = 128,
  SONDE_SHEET_MARKS = 4,      /**< calipers on a picture */
  SONDE_SHEET_NOTE = 804,     /**< bytes of the text of a place: 200 characters */
  SONDE_SHEET_TEXT = 2404,    /**< bytes of the impression: 600 characters */
  SONDE_SHEET_MESSAGE = 4096, /**< bytes of an entry */
  SONDE_SHEET_FAULT = 96      /**< bytes of what is wrong with the pictures of a place */
};

/** What is written of a place; each list begins with nothing written. */
typedef enum sonde_sheet_finding {
  SONDE_SHEET_NO_FINDING,
  SONDE_SHEET_COMPRESSIBLE,
  SONDE_SHEET_PARTLY,
  SONDE_SHEET_NOT_COMPRESSIBLE,
  SONDE_SHEET_NOT_SEEN
} sonde_sheet_finding;
/** Age of a clot; indeterminate: between acute and chronic. */
typedef enum sonde_sheet_age {
  SONDE_SHEET_NO_AGE,
  SONDE_SHEET_ACUTE,
  SONDE_SHEET_CHRONIC,
  SONDE_SHEET_INDETERMINATE
} sonde_sheet_age;
/** How a clot lies in the lumen. */
typedef enum sonde_sheet_kind {
  SONDE_SHEET_NO_KIND,
  SONDE_SHEET_OCCLUSIVE,
  SONDE_SHEET_PART_OF_LUMEN,
  SONDE_SHEET_FREE_FLOATING
} sonde_sheet_kind;
/** Reflux, where it was looked for. */
typedef enum sonde_sheet_reflux {
  SONDE_SHEET_REFLUX_NOT_TESTED,
  SONDE_SHEET_REFLUX_ABSENT,
  SONDE_SHEET_REFLUX_PRESENT
} sonde_sheet_reflux;
typedef enum sonde_sheet_conclusion {
  SONDE_SHEET_NO_CONCLUSION,
  SONDE_SHEET_NO_DVT,
  SONDE_SHEET_PROXIMAL,
  SONDE_SHEET_DISTAL,
  SONDE_SHEET_SUPERFICIAL,
  SONDE_SHEET_INCONCLUSIVE
} sonde_sheet_conclusion;

/** The five lists above, as words of messages and files. */
typedef enum sonde_sheet_list {
  SONDE_SHEET_FINDINGS,
  SONDE_SHEET_AGES,
  SONDE_SHEET_KINDS,
  SONDE_SHEET_REFLUXES,
  SONDE_SHEET_CONCLUSIONS,
  SONDE_SHEET_LISTS
} sonde_sheet_list;
/** Word of a value, "" of nothing written: compressible, partly, not_compressible, not_seen; acute,
 *  chronic, indeterminate; occlusive, partly, free_floating; absent, present; no_dvt, proximal,
 *  distal, superficial, inconclusive. NULL beyond the list. @thread any */
SONDE_API const char *sonde_sheet_word(sonde_sheet_list list, uint32_t value);

/** A caliper: from point to point, or the ellipse on that axis. */
typedef struct sonde_sheet_mark {
  double from_m[2], to_m[2]; /**< from the picture's left edge, and below the probe */
  double half_m;             /**< half of the ellipse's other axis; 0: a distance */
} sonde_sheet_mark;

/** A picture of the worksheet, with the moment that it shows. */
typedef struct sonde_sheet_picture {
  uint32_t number; /**< from 1, never given again */
  uint32_t place;
  bool compressed;     /**< its label: with compression, without */
  uint32_t part, held; /**< of the recording, from 1; setup in whose position the patient is */
  uint64_t tick;       /**< in that part */
  double time_s;       /**< of the exam */
  double force_n;
  sonde_pose probe;
  double ratio[SONDE_SEGMENTS]; /**< how open the veins of each segment are; NaN: not in view */
  uint32_t mark_count;
  sonde_sheet_mark mark[SONDE_SHEET_MARKS];
  sonde_image image; /**< owned by the worksheet; without pixels: none was made */
} sonde_sheet_picture;

typedef struct sonde_sheet_row {
  sonde_sheet_finding finding;
  sonde_sheet_age age;
  sonde_sheet_kind kind;
  sonde_sheet_reflux reflux;
  double reflux_s; /**< how long blood flows back; NaN: not measured */
  char text[SONDE_SHEET_NOTE];
} sonde_sheet_row;

/** Where clot begins and ends, as places: nearest to the groin, nearest to the foot;
 * SONDE_PLAN_POINTS: not written. */
typedef struct sonde_sheet_extent {
  uint32_t from, to;
} sonde_sheet_extent;

/** A worksheet; a row for each place of the plan. */
typedef struct sonde_worksheet {
  char side[8]; /**< "left", "right"; empty: of a thigh */
  bool written; /**< anything was */
  uint32_t place_count, picture_count, last_number;
  sonde_sheet_row row[SONDE_PLAN_POINTS];
  sonde_sheet_picture picture[SONDE_SHEET_PICTURES]; /**< [picture_count] in the order of storing */
  sonde_sheet_extent deep, superficial;
  sonde_sheet_conclusion conclusion;
  char text[SONDE_SHEET_TEXT]; /**< impression in words */
} sonde_worksheet;

/** An empty worksheet for a plan. @thread any */
SONDE_API void sonde_worksheet_begin(sonde_worksheet *sheet, const sonde_exam_setups *setups,
                                     const sonde_plan *plan);
/** Frees the pictures. @thread owner */
SONDE_API void sonde_worksheet_clear(sonde_worksheet *sheet);

/** Finds the image of a tick, for a picture or (`picture` NULL) to be kept in reach.
 *  @param picture everything but number and marks is filled; its place is set before, and its label
 *  @return false: that image is gone */
typedef bool (*sonde_sheet_look)(void *user, uint64_t tick, sonde_sheet_picture *picture);

/**
 * Takes one entry as the page sends it and the journal keeps it: one JSON object with the members
 * of the message `worksheet` of docs/page_protocol.md. An entry is taken as a whole or not at all.
 * @param look NULL: no image can be found
 * @return FORMAT for no such object, ARGUMENT for a member that is unknown or out of range or an
 * image that is gone @thread owner
 */
SONDE_API sonde_status sonde_worksheet_enter(sonde_worksheet *sheet, const sonde_plan *plan,
                                             const char *json, size_t count, sonde_sheet_look look,
                                             void *user, sonde_error *error);
/** Stores a picture; number is given here. The pixels change hands.
 *  @return ARGUMENT when there are SONDE_SHEET_PICTURES @thread owner */
SONDE_API sonde_status sonde_worksheet_store(sonde_worksheet *sheet, sonde_sheet_picture *picture,
                                             sonde_error *error);

/* ---- against the truth --------------------------------------------------------------------- */

typedef enum sonde_sheet_outcome {
  SONDE_SHEET_RIGHT,
  SONDE_SHEET_MISSED,      /**< a clot was called compressible */
  SONDE_SHEET_OVER_CALLED, /**< a clot was called that is not there */
  SONDE_SHEET_UNSEEN,
  SONDE_SHEET_UNWRITTEN
} sonde_sheet_outcome;

typedef struct sonde_sheet_place_verdict {
  sonde_sheet_outcome outcome;
  sonde_segment_kind system; /**< of the place's veins */
  bool clot;                 /**< in the plane of the place */
  bool edge; /**< it ends within the criteria's reach of the place: either finding is right */
  sonde_sheet_finding truth;
  sonde_sheet_age truth_age; /**< indeterminate: any age is right */
  sonde_sheet_kind truth_kind;
  bool age_right, kind_right;
  bool documented; /**< a picture without and one with compression show the place */
  char pictures[SONDE_SHEET_FAULT]; /**< what is wrong with them; empty exactly when documented */
} sonde_sheet_place_verdict;

/** Of the deep veins, or of the superficial ones. */
typedef struct sonde_sheet_extent_verdict {
  bool clot, said; /**< in a place of the plan; both ends were written */
  sonde_sheet_extent truth;
  int off[2];      /**< stations from the true end to the one written: > 0 nearer to the foot */
  double off_m[2]; /**< likewise along the leg; both 0 unless there is a clot and it was said */
} sonde_sheet_extent_verdict;

typedef struct sonde_sheet_verdict {
  uint32_t place_count, right, missed, over_called, documented;
  sonde_sheet_place_verdict place[SONDE_PLAN_POINTS];
  sonde_sheet_extent_verdict deep, superficial;
  sonde_sheet_conclusion conclusion; /**< the truth */
  bool conclusion_right;
  /** Shares, 0..1: places right; places documented; age, kind and ends of the clot (NaN: there is
   * none to describe). */
  double findings, pictures, clot;
  double score; /**< 0..100; a wrong conclusion is capped as a wrong diagnosis is */
  char summary[256];
} sonde_sheet_verdict;

/** What a worksheet says against the case. Nothing in it comes from elsewhere than the clots as the
 *  case puts them on the leg, and the pictures' moments.
 *  @param setups with the models, as the plan was made for @thread owner */
SONDE_API void sonde_worksheet_judge(const sonde_worksheet *sheet, const sonde_case *patient,
                                     const sonde_exam_setups *setups, const sonde_plan *plan,
                                     sonde_sheet_verdict *verdict);
/** "right", "missed", "over_called", "not_seen", "not_written". @thread any */
SONDE_API const char *sonde_sheet_outcome_name(sonde_sheet_outcome outcome);

/* ---- files --------------------------------------------------------------------------------- */

/** Writes a worksheet as one object (docs/worksheet.md).
 *  @param key of the member; NULL: members of the object that is open
 *  @param map of the first setup @param verdict NULL: none yet
 *  @param images with the pictures' pixels as PNG in base64 @return MEMORY @thread owner */
SONDE_API sonde_status sonde_worksheet_put(sonde_json_out *out, const char *key,
                                           const sonde_worksheet *sheet, const sonde_plan *plan,
                                           const sonde_vein_map *map,
                                           const sonde_sheet_verdict *verdict, bool images,
                                           sonde_error *error);
/** A table of the places, atomically: finding, clot, pictures and (with a verdict) truth and
 *  outcome. @thread owner */
SONDE_API sonde_status sonde_worksheet_save_csv(const sonde_worksheet *sheet,
                                                const sonde_plan *plan,
                                                const sonde_sheet_verdict *verdict,
                                                const char *path, sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
