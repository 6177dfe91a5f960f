// An exam: begun on a case's thigh, watched frame by frame, judged.
#include "exam_app_lesson.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

bool exam_app_show_progress(double fraction, const char *what, void *user) {
  exam_app *app = user;
  (void)what;
  app->progress = fraction;
  exam_app_tell_exam(app);
  return true;
}

sonde_status exam_prepare(exam *of, const char *bundled, const char *cases,
                          const sonde_progress *progress, sonde_error *error) {
  assert(of != NULL);
  sonde_status status = sonde_exam_prepare(&of->patient, of->protocol, bundled, cases, progress,
                                           &of->setups, &of->plan, error);
  if (!status) status = sonde_judge_create(&of->setups.held[0].map, &of->plan, &of->judge, error);
  of->held = 0, of->part = of->watched_part = 1;
  if (!status) sonde_worksheet_begin(&of->sheet, &of->setups, &of->plan);
  if (!status && !(of->sample = calloc(EXAM_SAMPLES, sizeof *of->sample)))
    status = app_error(error, SONDE_MEMORY, "out of memory");
  return status;
}

// On the session's image thread.
static void watch(void *user, const sonde_frame *frame) {
  exam *of = user;
  pthread_mutex_lock(of->lock);
  if (of->turns) exam_hold(of, of->turns_to);
  exam_observe(of, frame);
  pthread_mutex_unlock(of->lock);
  if (of->also) of->also(of->also_user, frame);
}

// The session of a part of the exam, with the probe above the first place of the patient's
// position, in a thigh above the vein's end at the groin.
static sonde_status begin_part(exam_app *app, exam *of, uint32_t held, uint32_t part,
                               sonde_error *error) {
  char recording[EXAM_PATH], *setup = NULL;
  snprintf(of->tissue, sizeof of->tissue, "%s", app->def.practice.solid ? "solid" : "springs");
  const sonde_case_setup *lies = &of->setups.held[held];
  sonde_status status = exam_setup_text(of, lies->position, &setup, error);
  if (status) return status;
  exam_part_path(recording, of->directory, part);
  sonde_session_def def = app->def.practice;
  sonde_case_session(lies, &def);
  def.model_path = of->patient.thigh == SONDE_CASE_BUNDLED ? app->def.model_path : NULL;
  def.record_path = recording;
  def.record_setup = setup;
  if (of->lesson && of->lesson->doppler) def.controls.duplex.shown = SONDE_DUPLEX_VELOCITY;
  of->also = def.watch, of->also_user = def.watch_user;
  def.watch = watch;
  def.watch_user = of;
  sonde_vein_point first = sonde_vein_at(&lies->map, 0.0);
  for (uint32_t i = of->plan.count; i-- > 0 && lies->map.station_count > 0;)
    if (of->plan.point[i].held == held) first = of->plan.point[i].at;
  // A strain comes once.
  const double before_s = sonde_judge_state(of->judge).time_s;
  def.circulation.valsalva_from_s -= before_s, def.circulation.valsalva_to_s -= before_s;
  sonde_site site = {.position_m = first.skin_m, .normal = first.normal, .u = first.across};
  status = exam_app_run_session(app, &def, &site, error);
  sonde_free(setup);
  return status;
}

sonde_status exam_choose(const exam_app *app, const sonde_page_request *request, exam *of,
                         sonde_error *error) {
  const bool practises = request->ask == SONDE_PAGE_START_LESSON;
  const sonde_case *patient = NULL;
  const char *guidance = request->guidance;
  if (practises) {
    const uint32_t k = sonde_course_find(&app->course, request->id);
    if (k == app->course.count)
      return app_error(error, SONDE_NOT_FOUND, "there is no lesson of that name");
    of->lesson = &app->course.lesson[k];
    of->turn = request->turn < of->lesson->turn_count ? request->turn : of->lesson->turn_count - 1;
    of->protocol = &of->lesson->protocol;
    guidance = sonde_guidance_level_name(of->lesson->turn[of->turn]);
    // A drawn patient is none of those that the bar was measured on.
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    const uint64_t seed = (uint64_t)now.tv_sec * 1000 + (uint64_t)now.tv_nsec / 1000000;
    sonde_lesson_patient(of->lesson, seed, &of->patient);
  }
  if (!practises) patient = app->trial;
  for (uint32_t i = 0; i < app->case_count && !practises && !patient; ++i) {
    char alias[EXAM_ALIAS];
    exam_app_case_alias(app, app->case_list[i].id, alias);
    if (strcmp(alias, request->id) == 0) patient = &app->case_list[i];
  }
  for (uint32_t i = 0; i < app->protocol_count && !practises; ++i)
    if (strcmp(app->protocol_list[i].id, request->protocol) == 0)
      of->protocol = &app->protocol_list[i];
  if (!practises && (!patient || !of->protocol))
    return app_error(error, SONDE_NOT_FOUND, "there is no %s of that name",
                     patient ? "protocol" : "case");
  if (patient) of->patient = *patient;
  snprintf(of->guidance, sizeof of->guidance, "%.*s", (int)sizeof of->guidance - 1, guidance);
  snprintf(of->trainee, sizeof of->trainee, "%.*s", (int)sizeof of->trainee - 1, request->name);
  return SONDE_OK;
}

sonde_status exam_start(exam_app *app, const sonde_page_request *request, sonde_error *error) {
  exam *of = calloc(1, sizeof *of);
  if (!of) return app_error(error, SONDE_MEMORY, "out of memory");
  of->lock = &app->lock;
  sonde_status status = exam_choose(app, request, of, error);
  if (status) {
    free(of);
    return status;
  }
  if (!app->trial) snprintf(app->trainee, sizeof app->trainee, "%s", of->trainee);
  exam_phase before = app->phase;
  exam_app_set_phase(app, EXAM_PREPARING,
                     "The patient is being prepared: this takes some seconds.");
  const sonde_session *session = app->session;
  // The learner is told nothing before the session is shown.
  char stamp[32];
  sonde_progress progress = {exam_app_show_progress, app};
  status = exam_prepare(of, exam_app_bundled(app), app->cases, &progress, error);
  app->progress = 0;
  if (!status) {
    // Date, id and directory; the mark tells exams of the same second apart.
    struct timespec now;
    struct tm day;
    clock_gettime(CLOCK_REALTIME, &now);
    localtime_r(&now.tv_sec, &day);
    strftime(stamp, sizeof stamp, "%Y-%m-%d-%H%M%S", &day);
    sonde_log_date((int64_t)now.tv_sec, of->date);
    unsigned mark = (unsigned)(now.tv_nsec / 1000 ^ (long)getpid()) & 0xffff;
    snprintf(of->id, sizeof of->id, "%s-%04x", stamp, mark);
    exam_app_path(of->directory, app->exams, of->id);
    status = sonde_directory_make(of->directory, 0700, false, error);
    if (!status) {
      sonde_page_conceal(app->server, true, strcmp(of->guidance, "full") != 0);
      status = begin_part(app, of, 0, 1, error);
      if (status) sonde_page_conceal(app->server, false, false);
    }
  }
  if (status) {
    bool bare = app->session != session || !session; // what ran before is gone
    if (bare) exam_app_end_session(app);
    exam_destroy(of);
    if (!bare || exam_app_practice(app, NULL)) exam_app_set_phase(app, before, error->message);
    return status;
  }
  exam_app_change(app, of, NULL);
  exam_app_tell_greeting(app);
  exam_app_set_phase(app, EXAM_RUNNING, "");
  return SONDE_OK;
}

sonde_status exam_turn(exam_app *app, const char *position, sonde_error *error) {
  exam *of = app->exam;
  sonde_limb_position wanted;
  if (app->phase != EXAM_RUNNING || !of)
    return app_error(error, SONDE_ARGUMENT, "there is no exam in which the patient could turn");
  const bool known = sonde_position_parse(position, &wanted);
  const uint32_t held = known ? sonde_exam_setups_find(&of->setups, wanted) : of->setups.count;
  if (held == of->setups.count)
    return app_error(error, SONDE_NOT_FOUND, "no place of this exam is in that position");
  if (held == of->held) return SONDE_OK;
  if (of->part == EXAM_PARTS)
    return app_error(error, SONDE_ARGUMENT, "the patient has turned %d times, and stays now",
                     EXAM_PARTS - 1);
  // Nothing of the position before is watched from here on; the first image of the new one turns.
  sonde_session_stop(app->session);
  pthread_mutex_lock(&app->lock);
  of->turns = true, of->turns_to = held;
  pthread_mutex_unlock(&app->lock);
  sonde_status status = begin_part(app, of, held, of->part + 1, error);
  if (!status) {
    of->part++;
    exam_app_tell_exam(app);
    return SONDE_OK;
  }
  // The patient stays, when the session before is still there.
  pthread_mutex_lock(&app->lock);
  of->turns = false;
  pthread_mutex_unlock(&app->lock);
  if (app->session) {
    (void)sonde_session_start(app->session, NULL);
  } else { // the device could not move on: the exam ended with its last part
    exam_recovered found;
    exam_recover_log(app->exams, app->log, &found);
    (void)exam_app_practice(app, NULL);
  }
  return status;
}

// ---- watching

static void keep_picture(const sonde_frame *frame, double vein, exam_picture *picture) {
  sonde_image *image = &picture->image;
  if (!image->pixels &&
      sonde_image_create(frame->width / 2, frame->height / 2, image, NULL) != SONDE_OK)
    return;
  exam_shrink(frame, image);
  picture->vein_ratio = vein;
}

void exam_hold(exam *of, uint32_t held) {
  assert(of->judge && held < of->setups.count);
  (void)sonde_judge_hold(of->judge, held, &of->setups.held[held].map);
  sonde_judge_compressions(of->judge, &of->presses_seen); // one that it ended has no pictures
  sonde_image_clear(&of->open.image);
  sonde_image_clear(&of->closed.image);
  of->held = held, of->turns = false;
  exam_sheet_turn(of);
}

void exam_observe(exam *of, const sonde_frame *frame) {
  assert(of->judge && frame);
  const sonde_snapshot *s = &frame->snapshot;
  uint32_t presses, n = of->sample_count;
  sonde_judge_feed(of->judge, s);
  of->seen_tick = s->tick;
  of->seen = *s;
  exam_sheet_watch(of, frame);

  // The press that just ended takes both images.
  sonde_judge_compressions(of->judge, &presses);
  if (presses > of->presses_seen) {
    of->presses_seen = presses;
    if (of->open.image.pixels && of->closed.image.pixels && of->picture_count < EXAM_PICTURES) {
      of->picture[of->picture_count++] =
          (sonde_exam_picture){presses - 1, of->open.image, of->closed.image};
      of->open.image = of->closed.image = (sonde_image){0};
    }
    of->closed.vein_ratio = INFINITY;
  }

  // The open vein is pictured as long as nothing presses, the closed one whenever it gets smaller.
  sonde_judge_now now = sonde_judge_state(of->judge);
  bool pressing = now.state != SONDE_PRESS_STATE_NONE;
  if (isfinite(now.vein_ratio) && !pressing) {
    keep_picture(frame, now.vein_ratio, &of->open);
    of->closed.vein_ratio = INFINITY;
  } else if (isfinite(now.vein_ratio) && now.vein_ratio < of->closed.vein_ratio) {
    keep_picture(frame, now.vein_ratio, &of->closed);
  }

  // Force and area of the vein, ten times a second.
  if (n == EXAM_SAMPLES || (n && now.time_s - of->sample[n - 1].time_s < 0.1)) return;
  of->sample[of->sample_count++] =
      (sonde_exam_sample){now.time_s, s->force_normal_n, now.vein_ratio};
}

// ---- the end

void exam_score(exam *of) {
  assert(of->judge);
  sonde_judge_finish(of->judge);
  sonde_judge_score(of->judge, &of->patient, &of->score);
  sonde_worksheet_judge(&of->sheet, &of->patient, &of->setups, &of->plan, &of->verdict);
}

// What the disk does not take is told and tried again by exam_app_keep().
sonde_status exam_finish(exam_app *app, sonde_error *error) {
  exam *of = app->exam;
  if (app->phase != EXAM_RUNNING)
    return app_error(error, SONDE_ARGUMENT, "there is no exam to finish");
  exam_app_set_phase(app, EXAM_DONE, "");
  sonde_session_stop(app->session); // from here on nothing is watched
  exam_score(of);
  of->scored = true;
  exam_app_keep(app);
  exam_app_tell_exam(app);
  return SONDE_OK;
}

void exam_destroy(exam *of) {
  if (!of) return;
  for (uint32_t i = 0; i < of->picture_count; ++i) {
    sonde_image_clear(&of->picture[i].before);
    sonde_image_clear(&of->picture[i].peak);
  }
  sonde_image_clear(&of->open.image);
  sonde_image_clear(&of->closed.image);
  exam_sheet_clear(of);
  free(of->sample);
  free(of->comments.list);
  sonde_judge_destroy(of->judge);
  sonde_exam_setups_clear(&of->setups);
  free(of);
}
