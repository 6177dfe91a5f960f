// The exam application of `sonde run`: free practice, exams of cases, replays; what the page shows
// of them and asks for. One thread owns it; the page's threads only leave requests and frames.
#ifndef SONDE_APP_EXAM_APP_H
#define SONDE_APP_EXAM_APP_H

#include "app.h"

typedef struct exam_app exam_app;

typedef struct exam_app_def {
  const sonde_model *model; // of free practice; borrowed
  const char *model_path;   // absolute; also of the cases that use the bundled thigh
  const char *bundled_path; // NULL: model_path
  sonde_site start;         // where the probe of free practice begins
  const char *cases;        // directories
  const char *own_cases;    // made on the page; created when the first one is kept
  const char *protocols;
  const char *course;         // NULL: none
  const char *exams;          // created when it is missing
  const char *trainee;        // "" unknown
  sonde_session_def practice; // model is set from above
  uint16_t port;
  double force_limit_n; // shown on the page
  // The device that moves the probe over a thigh, above a place at first.
  sonde_status (*make_device)(const void *user, const sonde_site *start,
                              const sonde_session_def *def, sonde_device *device,
                              sonde_error *error);
  const void *user;
  const char *device_name;
} exam_app_def;

// Starts practice and serves the page.
sonde_status exam_app_create(const exam_app_def *def, exam_app **out, sonde_error *error);
// Ends what runs; an exam under way is kept without a score.
sonde_status exam_app_destroy(exam_app *app, sonde_error *error);
// The page's address with the learner's or the teacher's token.
void exam_app_address(const exam_app *app, bool teacher, char address[SONDE_PAGE_ADDRESS]);
// Does what was asked for since the last turn; call it every 10 ms or so.
void exam_app_turn(exam_app *app);

#endif
