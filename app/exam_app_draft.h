// The case editor of the exam application: a teacher's draft, and the cases that were kept.
#ifndef SONDE_APP_EXAM_APP_DRAFT_H
#define SONDE_APP_EXAM_APP_DRAFT_H

#include "exam_app_parts.h"

enum { EXAM_OWN_CASES = 100 }; // that a user may keep

// A case that a teacher edits: what the page is told of its text.
struct exam_draft {
  sonde_case_setup setup; // whose leg is in view; without a model: none
  sonde_case seen;        // the case that leg was made of
  uint32_t serial;        // of the message that is answered
  bool good, exists;      // it can be examined; another of its id would be replaced
  char message[512], saved[EXAM_PATH];
  bool follows;       // the answer is what the findings come to
  sonde_case told;    // the case that was found to be right, with its answer
  char *text;         // of the case that was opened, freed by sonde_free(); NULL: the page has it
  char *right;        // text of `told`; free(). NULL: none
  bool right_follows; // `told` has the answer of its findings, whatever its text says
};

// exam_app_edit.c: the case editor.
// One message of a teacher's page. What is wrong with the case is told in the draft, not returned.
sonde_status exam_edit(exam_app *app, const char *entry, sonde_error *error);

// exam_app_draft.c: its draft, and the cases that were kept.
// Reads those that ship and the user's own again. Of the user's own those that cannot be read are
// left out with a sentence on stderr.
sonde_status exam_app_load_cases(exam_app *app, sonde_error *error);
// Reads the text and builds the case; when the draft's answer follows, it is that of the findings.
// A leg whose findings or truth are wrong is shown nevertheless.
sonde_status exam_draft_check(exam_app *app, const char *text, sonde_case *out, sonde_error *error);
// Writes it among the user's own cases, under its id, which the reader has found to be a plain
// name.
sonde_status exam_draft_keep(exam_app *app, const sonde_case *c, bool replace, sonde_error *error);
// The page must show something else by then.
void exam_draft_destroy(exam_draft *draft);

// exam_app_messages.c: what the pages of teachers are told of it.
void exam_app_tell_draft(exam_app *app);

#endif
