/**
 * @file trainer_protocol.h
 * Protocols of the examination, as files: places, their order, and what a valid compression is.
 */
#ifndef SONDE_TRAINER_PROTOCOL_H
#define SONDE_TRAINER_PROTOCOL_H

#include "sonde/trainer.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_EXAM_PROTOCOL_VERSION = 1, SONDE_EXAM_STOPS = 16, SONDE_PLAN_POINTS = 64 };

/** What a valid compression is (docs/trainer.md). */
typedef struct sonde_criteria {
  double tilt_rad;                  /**< most between image plane and transverse; 20 degrees */
  double closed_ratio;              /**< the vein's walls touch: area ratio at most this; 0.10 */
  double open_ratio;                /**< the vein stays open: at least this left; 0.25 */
  double artery_ratio;              /**< the artery deforms: at most this left */
  double crushed_ratio;             /**< less left of the artery is too hard */
  double force_low_n, force_high_n; /**< corridor shown to the learner */
  double force_limit_n;             /**< more is too hard */
  double reach_m;                   /**< a press this near to a point examines it */
} sonde_criteria;
SONDE_API sonde_criteria sonde_criteria_default(void);

/** One place, or places every so often between two. */
typedef struct sonde_exam_stop {
  char title[64], text[256];
  sonde_station from, to;
  double every_m; /**< 0: one place, `from` */
} sonde_exam_stop;

typedef struct sonde_exam_protocol {
  char id[48], title[96], text[512];
  sonde_criteria criteria;
  uint32_t stop_count;
  sonde_exam_stop stop[SONDE_EXAM_STOPS]; /**< in the order of the exam */
} sonde_exam_protocol;

SONDE_API sonde_status sonde_exam_protocol_load(const char *path, sonde_exam_protocol *out,
                                                sonde_error *error);
SONDE_API sonde_status sonde_exam_protocol_parse(const char *text, const char *name,
                                                 sonde_exam_protocol *out, sonde_error *error);
/** As sonde_case_list(), by number of places, then id. @thread owner */
SONDE_API sonde_status sonde_exam_protocol_list(const char *directory,
                                                sonde_exam_protocol **protocols, uint32_t *count,
                                                sonde_error *error);

/** A place of the exam on one thigh. */
typedef struct sonde_plan_point {
  char title[64], text[256];
  uint32_t segment; /**< of the map */
  sonde_vein_point at;
} sonde_plan_point;

/** A protocol on one thigh, with a case's criteria. Plain data. */
typedef struct sonde_plan {
  sonde_criteria criteria;
  uint32_t count;
  sonde_plan_point point[SONDE_PLAN_POINTS]; /**< in the order of the exam */
} sonde_plan;

/** @param criteria of the case, NULL: the protocol's
 *  @return NOT_FOUND for a place that the thigh has not; ARGUMENT for more than SONDE_PLAN_POINTS
 *  @thread any */
SONDE_API sonde_status sonde_plan_make(const sonde_exam_protocol *protocol,
                                       const sonde_vein_map *map,
                                       const sonde_case_criteria *criteria, sonde_plan *plan,
                                       sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
