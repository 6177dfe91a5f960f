// The page of an exam: what its files share.
#ifndef SONDE_SRC_TRAINER_REPORT_H
#define SONDE_SRC_TRAINER_REPORT_H

#include "base/maths.h"
#include "report/svg.h"
#include "sonde/trainer_report.h"
#include "trainer/judge.h"

// Widths of the drawings: pixels, scaled to the page.
enum { PAGE_WIDTH = 900 };

// Examined and planned vein in steps of JUDGE_BIN_M, as the metrics count it.
typedef struct sonde_debrief_vein {
  uint32_t bins;
  bool wanted[JUDGE_BINS], covered[JUDGE_BINS];
  bool done[SONDE_PLAN_POINTS];
  double gap_from_m, gap_to_m;   // longest planned stretch that is not covered; equal: none
  double clot_from_m, clot_to_m; // in the femoral vein; equal: none
} sonde_debrief_vein;

typedef struct sonde_debrief {
  const sonde_exam_report *in;
  sonde_text out;
  sonde_debrief_vein vein;
} sonde_debrief;

sonde_debrief_vein sonde_debrief_vein_make(const sonde_exam_report *report);

// Names for people.
const char *sonde_press_words(sonde_press_result result);
const char *sonde_press_colour(sonde_press_result result);
const char *sonde_decision_words(sonde_decision decision);
// Place on the vein as words: segment and centimetres from the groin, or that it was not in view.
void sonde_debrief_place(sonde_debrief *page, const sonde_compression *press);
// A mark of a press in a drawing: shape and colour by result.
void sonde_press_mark(sonde_text *out, double x, double y, sonde_press_result result);

void sonde_debrief_section(sonde_debrief *page, const char *id, const char *title);
// A drawing that fills the width of the page. `body` is cleared.
void sonde_debrief_drawing(sonde_debrief *page, sonde_figure *figure, const char *caption);

// The parts of the page.
void sonde_debrief_question(sonde_debrief *page);
void sonde_debrief_score(sonde_debrief *page);
void sonde_debrief_advice(sonde_debrief *page);
void sonde_debrief_along(sonde_debrief *page);
sonde_status sonde_debrief_pictures(sonde_debrief *page, sonde_error *error);
sonde_status sonde_debrief_traces(sonde_debrief *page, sonde_error *error);
void sonde_debrief_comments(sonde_debrief *page);
sonde_status sonde_debrief_earlier(sonde_debrief *page, sonde_error *error);
void sonde_debrief_measures(sonde_debrief *page);
void sonde_debrief_presses(sonde_debrief *page);

#endif
