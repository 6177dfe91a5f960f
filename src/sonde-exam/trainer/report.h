// What an exam says as JSON: shared by its result file and its report.
#ifndef SONDE_SRC_TRAINER_REPORT_H
#define SONDE_SRC_TRAINER_REPORT_H

#include "sonde/base_json.h"
#include "sonde/trainer_report.h"
#include "trainer/judge.h"

// A number under its name; not a number: null.
typedef struct sonde_named {
  const char *name;
  double value;
} sonde_named;
void sonde_put_named(sonde_json_out *out, const sonde_named *list, size_t count);
// A text; NULL: null.
void sonde_put_text_or_null(sonde_json_out *out, const char *key, const char *text);
// The members of a result file: exam, score, lost, metrics, segments, places, presses.
void sonde_put_result(sonde_json_out *out, const sonde_exam_report *exam);
// The list "pictures", PNG data in base64.
sonde_status sonde_put_pictures(sonde_json_out *out, const sonde_exam_report *exam,
                                sonde_error *error);
// The whole document that the report renders. @param text freed by sonde_free()
sonde_status sonde_exam_report_json(const sonde_exam_report *exam, char **text, size_t *length,
                                    sonde_error *error);

#endif
