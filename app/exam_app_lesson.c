// What the page is told of the course: its lessons, the one that is practised or demonstrated, the
// guidance in the picture, the bar.
#include "exam_app_lesson.h"

#include <assert.h>
#include <math.h>
#include <string.h>

static void put_bar(sonde_json_out *out, const sonde_bar *bar) {
  assert(out && bar);
  if (bar->runs == 0) {
    sonde_json_put_real(out, "bar", (double)NAN, 0);
    return;
  }
  sonde_json_begin_object(out, "bar");
  sonde_json_put_real(out, "score", bar->score, 4);
  sonde_json_put_real(out, "mean", bar->score_mean, 4);
  sonde_json_put_real(out, "sd", bar->score_sd, 3);
  sonde_json_put_integer(out, "runs", bar->runs);
  sonde_json_put_real(out, "time_s", bar->time_mean_s, 3);
  sonde_json_put_real(out, "path_mm", 1e3 * bar->path_mean_m, 3);
  sonde_json_put_real(out, "force_n", bar->force_mean_n, 3);
  sonde_json_end(out);
}

void exam_app_put_course(const exam_app *app, sonde_json_out *out) {
  assert(app && out);
  sonde_json_begin_list(out, "course");
  for (uint32_t i = 0; i < app->course.count; ++i) {
    const sonde_lesson *l = &app->course.lesson[i];
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "id", l->protocol.id);
    sonde_json_put_text(out, "title", l->title);
    sonde_json_put_text(out, "goal", l->goal);
    sonde_json_put_text(out, "patient", l->drawn ? "" : l->patient.history);
    sonde_json_put_integer(out, "places", l->protocol.stop_count);
    sonde_json_begin_list(out, "practice");
    for (uint32_t k = 0; k < l->turn_count; ++k)
      sonde_json_put_text(out, NULL, sonde_guidance_level_name(l->turn[k]));
    sonde_json_end(out);
    sonde_json_begin_list(out, "quiz");
    for (const sonde_question *q = l->question; q < l->question + l->question_count; ++q) {
      sonde_json_begin_object(out, NULL);
      sonde_json_put_text(out, "ask", q->ask);
      sonde_json_begin_list(out, "choices");
      for (uint32_t c = 0; c < q->choice_count; ++c) sonde_json_put_text(out, NULL, q->choice[c]);
      sonde_json_end(out);
      sonde_json_put_integer(out, "right", q->right);
      sonde_json_put_text(out, "why", q->why);
      sonde_json_end(out);
    }
    sonde_json_end(out);
    put_bar(out, &l->bar);
    sonde_json_end(out);
  }
  sonde_json_end(out);
}

// Half millimetres: a label does not tremble, and a message stays as it is while the hand rests.
static void put_mm(sonde_json_out *out, const char *key, double length_m) {
  sonde_json_put_real(out, key, round(2e3 * length_m) / 2, 0);
}

static void put_picture(sonde_json_out *out, const sonde_picture *picture) {
  assert(picture->count <= SONDE_PICTURE_MARKS);
  sonde_json_begin_object(out, "picture");
  sonde_json_begin_list(out, "marks");
  for (const sonde_picture_mark *m = picture->mark; m < picture->mark + picture->count; ++m) {
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "kind", sonde_mark_kind_name(m->kind));
    sonde_json_put_text(out, "name", m->name);
    sonde_json_put_text(out, "why", m->why);
    sonde_json_put_bool(out, "wanted", m->wanted);
    put_mm(out, "x_mm", m->aside_m);
    put_mm(out, "depth_mm", m->depth_m);
    put_mm(out, "half_mm", m->half_m);
    put_mm(out, "flat_mm", m->flat_m);
    sonde_json_end(out);
  }
  sonde_json_end(out);
  put_mm(out, "aside_mm", picture->aside_m);
  put_mm(out, "along_mm", picture->along_m);
  sonde_json_put_text(out, "way", picture->way);
  sonde_json_end(out);
}

void exam_app_put_lesson(const exam_app *app, bool full, sonde_json_out *out) {
  assert(!app->exam || !app->film);
  const exam *of = app->exam;
  const exam_film *film = app->film;
  const sonde_lesson *lesson = of ? of->lesson : film ? film->lesson : NULL;
  if (lesson) {
    sonde_json_begin_object(out, "lesson");
    sonde_json_put_text(out, "id", lesson->protocol.id);
    sonde_json_put_integer(out, "turn", of ? of->turn : 0);
    sonde_json_put_integer(out, "turns", lesson->turn_count);
    put_bar(out, &lesson->bar);
    sonde_json_put_bool(out, "reached",
                        of && of->scored && of->score.correct && lesson->bar.runs > 0 &&
                            of->score.score >= lesson->bar.score);
    sonde_json_end(out);
  } else {
    sonde_json_put_real(out, "lesson", (double)NAN, 0);
  }
  sonde_picture picture;
  const bool hints = of && strcmp(of->guidance, "hints") == 0;
  const sonde_guidance_level level = full    ? SONDE_GUIDANCE_FULL
                                     : hints ? SONDE_GUIDANCE_HINTS
                                             : SONDE_GUIDANCE_EXAM;
  if (of && app->phase == EXAM_RUNNING && of->seen.tick > 0) {
    sonde_picture_read(of->judge, &of->setups.held[of->held], &of->seen, level, &picture);
    put_picture(out, &picture);
  } else if (film) {
    sonde_picture_read(film->judge, &film->setups.held[film->held], &film->seen,
                       SONDE_GUIDANCE_FULL, &picture);
    put_picture(out, &picture);
  } else {
    sonde_json_put_real(out, "picture", (double)NAN, 0);
  }
  if (!film) {
    sonde_json_put_real(out, "film", (double)NAN, 0);
    return;
  }
  sonde_json_begin_object(out, "film");
  sonde_json_put_text(out, "title", film->lesson->title);
  sonde_json_put_text(out, "words", film->words);
  sonde_json_put_bool(out, "playing", film->playing);
  sonde_json_put_bool(out, "reading", app_seconds(CLOCK_MONOTONIC) < film->read_until_s);
  sonde_json_put_bool(out, "over", film->over);
  sonde_json_put_real(out, "speed", film->speed, 3);
  const uint32_t places = film->plan.count, place = film->over ? places : film->place;
  sonde_json_put_integer(out, "place", place < places ? place : film->over ? places : 0);
  sonde_json_put_integer(out, "places", places);
  sonde_json_end(out);
}
