// An exam at the desk: begun on a case's thigh, watched frame by frame, judged, kept.
//
// name_exam            id, directory and date
// desk_exam_prepare, begin   thigh, plan with its forces, judge, session
// watch                every image, on the session's image thread
// shrink, keep_pictures   the learner's own pictures of a press
// desk_exam_observe    one frame
// desk_exam_finish     judged and kept
#include "desk_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static sonde_status name_exam(desk *d, desk_exam *exam, sonde_error *error) {
  struct timespec now;
  struct tm day;
  char stamp[32];
  clock_gettime(CLOCK_REALTIME, &now);
  localtime_r(&now.tv_sec, &day);
  strftime(stamp, sizeof stamp, "%Y-%m-%d-%H%M%S", &day);
  sonde_log_date((int64_t)now.tv_sec, exam->date);
  unsigned mark = (unsigned)(now.tv_nsec / 1000 ^ (long)getpid()) & 0xffff;
  snprintf(exam->id, sizeof exam->id, "%s-%04x", stamp, mark);
  desk_path(exam->directory, d->exams, exam->id);
  return sonde_directory_make(exam->directory, 0700, false, error);
}

static bool show_progress(double fraction, const char *what, void *user) {
  desk *d = user;
  (void)what;
  d->progress = fraction;
  desk_tell_exam(d);
  return true;
}

sonde_status desk_exam_prepare(desk_exam *exam, const char *bundled, const char *cases,
                               const sonde_progress *progress, sonde_error *error) {
  sonde_status status = sonde_case_build(&exam->patient, bundled, cases, &exam->setup, error);
  if (!status) status = sonde_plan_make(exam->protocol, &exam->setup.map, &exam->plan, error);
  if (!status) status = sonde_plan_find_targets(&exam->plan, &exam->setup, progress, error);
  if (!status) status = sonde_judge_create(&exam->setup.map, &exam->plan, &exam->judge, error);
  if (!status && !(exam->sample = calloc(DESK_SAMPLES, sizeof *exam->sample)))
    status = app_error(error, SONDE_MEMORY, "out of memory");
  return status;
}

static void watch(void *user, const sonde_frame *frame) {
  desk_exam *exam = user;
  pthread_mutex_lock(exam->lock);
  desk_exam_observe(exam, frame);
  pthread_mutex_unlock(exam->lock);
}

static sonde_status run(desk *d, desk_exam *exam, const char *setup, sonde_error *error) {
  char recording[DESK_PATH];
  desk_path(recording, exam->directory, "exam.rec");
  sonde_session_def def = d->def.practice;
  sonde_case_session(&exam->setup, &def);
  def.model_path = exam->patient.thigh == SONDE_CASE_BUNDLED ? d->def.model_path : NULL;
  def.record_path = recording;
  def.record_setup = setup;
  def.watch = watch;
  def.watch_user = exam;
  sonde_vein_point first = sonde_vein_at(&exam->setup.map, 0.0);
  sonde_site site = {.position_m = first.skin_m, .normal = first.normal, .u = first.across};
  return desk_run_session(d, &def, &site, error);
}

static void copy_text(char *to, size_t size, const char *from) { snprintf(to, size, "%s", from); }

// The learner is told nothing before the session is shown.
static sonde_status begin(desk *d, desk_exam *exam, sonde_error *error) {
  char *setup = NULL;
  const char *bundled = d->def.bundled_path ? d->def.bundled_path : d->def.model_path;
  sonde_progress progress = {show_progress, d};
  sonde_status status = desk_exam_prepare(exam, bundled, d->cases, &progress, error);
  d->progress = 0;
  if (!status) status = name_exam(d, exam, error);
  if (!status) status = desk_exam_setup_text(exam, &setup, error);
  if (status) return status;
  sonde_page_conceal(d->server, true, strcmp(exam->guidance, "full") != 0);
  status = run(d, exam, setup, error);
  free(setup);
  if (status) sonde_page_conceal(d->server, false, false);
  return status;
}

sonde_status desk_exam_start(desk *d, const sonde_page_request *request, sonde_error *error) {
  const sonde_case *patient = desk_find_case(d, request->id);
  const sonde_exam_protocol *protocol = desk_find_protocol(d, request->protocol);
  if (!patient || !protocol)
    return app_error(error, SONDE_NOT_FOUND, "there is no %s of that name",
                     patient ? "protocol" : "case");
  desk_exam *exam = calloc(1, sizeof *exam);
  if (!exam) return app_error(error, SONDE_MEMORY, "out of memory");
  exam->lock = &d->lock;
  exam->patient = *patient;
  exam->protocol = protocol;
  copy_text(exam->guidance, sizeof exam->guidance, request->guidance);
  copy_text(exam->trainee, sizeof exam->trainee, request->name);
  copy_text(d->trainee, sizeof d->trainee, request->name);
  desk_phase before = d->phase;
  desk_set_phase(d, DESK_PREPARING, "The patient is being prepared: this takes some seconds.");
  const sonde_session *session = d->session;
  sonde_status status = begin(d, exam, error);
  if (status) {
    bool bare = d->session != session || !session; // what ran before is gone
    if (bare) desk_end_session(d);
    desk_exam_destroy(exam);
    if (!bare || desk_practice(d, NULL)) desk_set_phase(d, before, error->message);
    return status;
  }
  desk_change(d, exam, NULL);
  desk_tell_greeting(d);
  desk_set_phase(d, DESK_RUNNING, "");
  return SONDE_OK;
}

// ---- watching

// Means of 2 x 2 pixels.
static void shrink(const sonde_frame *frame, desk_picture *picture) {
  sonde_image *image = &picture->image;
  if (!image->pixels &&
      sonde_image_create(frame->width / 2, frame->height / 2, image, NULL) != SONDE_OK)
    return;
  for (uint32_t y = 0; y < image->height; ++y)
    for (uint32_t x = 0; x < image->width; ++x) {
      const uint8_t *p = frame->pixels + 2 * (size_t)y * frame->width + 2 * (size_t)x;
      image->pixels[y * image->width + x] =
          (uint8_t)((p[0] + p[1] + p[frame->width] + p[frame->width + 1] + 2) / 4);
    }
  image->width_m = frame->width_m;
  image->height_m = frame->height_m;
  image->tick = frame->snapshot.tick;
  picture->vein_ratio = frame->snapshot.vein_area_ratio;
}

// Hands both images over to the press that just ended.
static void keep_pictures(desk_exam *exam, uint32_t press) {
  if (!exam->open.image.pixels || !exam->closed.image.pixels) return;
  if (exam->picture_count == DESK_PICTURES) return;
  exam->picture[exam->picture_count++] =
      (sonde_exam_picture){press, exam->open.image, exam->closed.image};
  exam->open.image = exam->closed.image = (sonde_image){0};
}

// The open vein is pictured as long as nothing presses, the closed one whenever it gets smaller.
static void watch_pictures(desk_exam *exam, const sonde_frame *frame) {
  uint32_t presses;
  sonde_judge_compressions(exam->judge, &presses);
  if (presses > exam->presses_seen) {
    exam->presses_seen = presses;
    keep_pictures(exam, presses - 1);
    exam->closed.vein_ratio = INFINITY;
  }
  double ratio = frame->snapshot.vein_area_ratio;
  if (!isfinite(ratio)) return;
  if (sonde_judge_state(exam->judge).state == SONDE_PRESS_STATE_NONE) {
    shrink(frame, &exam->open);
    exam->closed.vein_ratio = INFINITY;
  } else if (ratio < exam->closed.vein_ratio) {
    shrink(frame, &exam->closed);
  }
}

static void watch_curve(desk_exam *exam, const sonde_snapshot *s) {
  const double every_s = 0.1;
  uint32_t n = exam->sample_count;
  if (n == DESK_SAMPLES || (n && s->time_s - exam->sample[n - 1].time_s < every_s)) return;
  exam->sample[exam->sample_count++] =
      (sonde_exam_sample){s->time_s, s->force_normal_n, s->vein_area_ratio};
}

void desk_exam_observe(desk_exam *exam, const sonde_frame *frame) {
  sonde_judge_feed(exam->judge, &frame->snapshot);
  exam->seen_tick = frame->snapshot.tick;
  watch_pictures(exam, frame);
  watch_curve(exam, &frame->snapshot);
}

// ---- the end

// What the disk does not take is told and tried again by desk_keep().
sonde_status desk_exam_finish(desk *d, sonde_error *error) {
  desk_exam *exam = d->exam;
  if (d->phase != DESK_RUNNING)
    return app_error(error, SONDE_ARGUMENT, "there is no exam to finish");
  desk_set_phase(d, DESK_DONE, "");
  sonde_session_stop(d->session); // from here on nothing is watched
  sonde_judge_finish(exam->judge);
  sonde_judge_score(exam->judge, &exam->patient, &exam->score);
  exam->scored = true;
  desk_keep(d);
  desk_tell_exam(d);
  return SONDE_OK;
}

void desk_exam_destroy(desk_exam *exam) {
  if (!exam) return;
  for (uint32_t i = 0; i < exam->picture_count; ++i) {
    sonde_image_clear(&exam->picture[i].before);
    sonde_image_clear(&exam->picture[i].peak);
  }
  sonde_image_clear(&exam->open.image);
  sonde_image_clear(&exam->closed.image);
  free(exam->sample);
  free(exam->comments.list);
  sonde_judge_destroy(exam->judge);
  sonde_case_setup_clear(&exam->setup);
  free(exam);
}
