// The course in the exam application: demonstrations, practice, what the page is told of both.
#ifndef SONDE_APP_EXAM_APP_LESSON_H
#define SONDE_APP_EXAM_APP_LESSON_H

#include "exam_app_parts.h"

enum {
  EXAM_WORDS = 1100, // bytes of what is said at a step of a demonstration
  EXAM_FILM_SEED = 1 // of the expert's hand there, and of a drawn patient: one that a bar knows
};

// The demonstration of a lesson.
struct exam_film {
  const sonde_lesson *lesson;
  sonde_case patient;
  sonde_exam_setups setups;
  sonde_plan plan;
  sonde_judge *judge;
  sonde_operator *op;
  sonde_session *session; // in lockstep, on the leg in position `held`
  uint32_t held;
  sonde_snapshot seen; // of the newest picture
  sonde_frame frame;   // the newest picture, of the session
  double posted_s;     // clock when the page got it last
  sonde_operator_phase phase;
  uint32_t place, attempt; // what the words are about
  char words[EXAM_WORDS];
  double read_until_s;    // clock until which the words are read
  uint32_t squeezed;      // place for which the calf was squeezed last
  double squeeze_until_s; // of the session
  bool playing, over;
  double speed, at_s; // at_s: clock of the last picture
};

// Case, protocol and guidance of a request for an exam or for a lesson's practice.
sonde_status exam_choose(const exam_app *app, const sonde_page_request *request, exam *of,
                         sonde_error *error);
bool exam_app_show_progress(double fraction, const char *what, void *app); // of what is prepared

// exam_app_lesson.c: members of the hello and of the exam's message about the course.
void exam_app_put_course(const exam_app *app, sonde_json_out *out);
// The lesson of now, the picture's guidance, the demonstration. @param full all guidance is shown
void exam_app_put_lesson(const exam_app *app, bool full, sonde_json_out *out);

// exam_app_film.c: the scripted expert examines a lesson's places.
sonde_status exam_film_open(exam_app *app, const char *lesson, sonde_error *error);
void exam_film_turn(exam_app *app);
// So many pictures on; false: it cannot go on.
bool exam_film_step(exam_app *app, uint32_t images);
void exam_film_destroy(exam_film *film);

#endif
