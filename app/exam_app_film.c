// The demonstration of a lesson: the scripted expert examines its places before the learner's eyes,
// in lockstep at the pace of the clock, with words for each step. It waits while they are read, and
// as long as it is paused.
#include "exam_app_lesson.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TICKS_PER_IMAGE = 40 };
static const double STEP_S = 0.001, POST_AGAIN_S = 0.5;
static const double READ_S = 1.2, READ_LETTER_S = 0.045; // how long words are read
static const double SQUEEZE_S = 3.5, TOUCH_N = 1.2;      // the free hand, under a light touch

// ---- words

static void say(exam_film *film, bool wait, const char *words) {
  assert(film && words[0]);
  snprintf(film->words, sizeof film->words, "%s", words);
  const double read_s = READ_S + READ_LETTER_S * (double)strlen(words);
  film->read_until_s = wait ? app_seconds(CLOCK_MONOTONIC) + read_s : 0;
}

// A new step of the expert gets its words.
static void follow(exam_film *film) {
  assert(film->op && film->judge);
  char words[EXAM_WORDS];
  uint32_t place, attempt;
  const sonde_operator_phase phase = sonde_operator_doing(film->op, &place, &attempt);
  if (phase == film->phase && place == film->place && attempt == film->attempt) return;
  const bool again = attempt > 0;
  const sonde_plan_point *point = place < film->plan.count ? &film->plan.point[place] : NULL;
  film->phase = phase, film->place = place, film->attempt = attempt;
  if (phase == SONDE_OPERATOR_DONE) {
    snprintf(words, sizeof words, "That was all. %.900s", film->patient.note);
    say(film, false, words);
    film->over = true;
    film->playing = false;
  } else if (phase == SONDE_OPERATOR_TRAVEL && !again) {
    snprintf(words, sizeof words, "%s. %s", point->title, point->text);
    say(film, true, words);
  } else if (phase == SONDE_OPERATOR_PRESS) {
    snprintf(
        words, sizeof words,
        "Straight down and slowly. Watch the vein, not the hand: it gets flat, the artery stays "
        "round. A healthy vein closes here at about %.0f N.",
        point->target.closes_n);
    say(film, !again, words);
  } else if (phase == SONDE_OPERATOR_HOLD) {
    const sonde_judge_now now = sonde_judge_state(film->judge);
    const double left = 100 * now.vein_ratio;
    if (now.state == SONDE_PRESS_STATE_COMPLETE)
      snprintf(
          words, sizeof words,
          "The walls touch at %.0f N: there is no clot at this place. Nothing more is shown by "
          "more force, so let go at once.",
          now.force_n);
    else if (now.state == SONDE_PRESS_STATE_OPEN)
      snprintf(words, sizeof words,
               "%.0f N would have closed a healthy vein here, and %.0f %% of this one is still "
               "open: a clot fills it. One such press is enough.",
               point->target.firm_n, left);
    else
      snprintf(words, sizeof words,
               "Not clear yet: %.0f N, and the vein has %.0f %% left. Let go, correct the probe, "
               "and press once more with more care.",
               now.force_n, left);
    say(film, true, words);
  } else if (phase == SONDE_OPERATOR_RELEASE) {
    say(film, false, "Let go: the vein fills again.");
  }
}

// ---- the session

// The expert's hand on the leg in a position.
static sonde_status lay(exam_app *app, exam_film *film, uint32_t held, sonde_device *device,
                        sonde_error *error) {
  assert(film->lesson && held < film->setups.count);
  const sonde_case_setup *setup = &film->setups.held[held];
  sonde_session_def def = app->def.practice;
  sonde_session *next = NULL;
  sonde_case_session(setup, &def);
  def.model_path = def.record_path = NULL;
  def.ticks_per_image = TICKS_PER_IMAGE;
  def.watch = NULL; // its images are made ahead of what is shown
  if (film->lesson->doppler) def.controls.duplex.shown = SONDE_DUPLEX_VELOCITY;
  sonde_status status = sonde_session_create(&def, device, &next, error);
  if (!status)
    status = sonde_page_show_model(app->server, setup->model, app->probes, app->probe_count, error);
  if (status) {
    sonde_session_destroy(next, NULL);
    return status;
  }
  sonde_session_destroy(film->session, NULL);
  film->session = next, film->held = held;
  film->squeezed = UINT32_MAX;
  return SONDE_OK;
}

sonde_status exam_film_open(exam_app *app, const char *id, sonde_error *error) {
  assert(id && app->server);
  const uint32_t k = sonde_course_find(&app->course, id);
  if (k == app->course.count)
    return app_error(error, SONDE_NOT_FOUND, "there is no lesson of that name");
  if (app->phase == EXAM_RUNNING)
    return app_error(error, SONDE_ARGUMENT, "finish or leave the exam before a demonstration");
  exam_film *film = calloc(1, sizeof *film);
  if (!film) return app_error(error, SONDE_MEMORY, "out of memory");
  const exam_phase before = app->phase;
  film->lesson = &app->course.lesson[k];
  film->speed = 1, film->place = UINT32_MAX;
  sonde_lesson_patient(film->lesson, EXAM_FILM_SEED, &film->patient);
  exam_app_set_phase(app, EXAM_PREPARING,
                     "The demonstration is being prepared: this takes some seconds.");
  sonde_progress progress = {exam_app_show_progress, app};
  sonde_device hand = {0};
  sonde_status status =
      sonde_exam_prepare(&film->patient, &film->lesson->protocol, exam_app_bundled(app), app->cases,
                         &progress, &film->setups, &film->plan, error);
  app->progress = 0;
  const sonde_vein_map *map = &film->setups.held[0].map;
  if (!status) status = sonde_judge_create(map, &film->plan, &film->judge, error);
  if (!status)
    status = sonde_operator_create("expert", EXAM_FILM_SEED, map, &film->plan, STEP_S, &film->op,
                                   &hand, error);
  if (!status) status = lay(app, film, 0, &hand, error);
  if (hand.destroy) hand.destroy(hand.self); // not moved: creation failed
  if (status) {
    exam_film_destroy(film);
    const bool bare = !app->session && before != EXAM_REPLAY && before != EXAM_FILM;
    if (!bare || exam_app_practice(app, NULL)) exam_app_set_phase(app, before, error->message);
    return status;
  }
  sonde_page_conceal(app->server, true, false);
  exam_app_end_session(app);
  exam_app_change(app, NULL, NULL);
  app->film = film;
  say(film, false, film->lesson->film);
  exam_film_step(app, 1); // a first picture
  exam_app_set_phase(app, EXAM_FILM, "");
  return SONDE_OK;
}

static void post(exam_app *app) {
  assert(app->film && app->film->frame.pixels);
  exam_film *film = app->film;
  const sonde_session_controls controls = sonde_session_controls_now(film->session);
  (void)sonde_page_post(app->server, &film->frame, &controls);
  film->posted_s = app_seconds(CLOCK_MONOTONIC);
}

bool exam_film_step(exam_app *app, uint32_t images) {
  exam_film *film = app->film;
  assert(film && film->session && film->op);
  sonde_error error = {0};
  for (uint32_t done = 0; done < images && !film->over;) {
    sonde_session_tick(film->session);
    if (!sonde_session_frame(film->session, &film->frame)) continue;
    ++done;
    film->seen = film->frame.snapshot;
    post(app);
    (void)sonde_judge_feed(film->judge, &film->seen);
    // The free hand squeezes the calf at each place, under a light touch; the press waits for it.
    const bool colour = film->lesson->doppler && film->phase == SONDE_OPERATOR_PRESS &&
                        film->attempt == 0 && film->playing;
    if (colour && film->squeezed != film->place && film->seen.force_normal_n >= TOUCH_N) {
      sonde_session_controls controls = sonde_session_controls_now(film->session);
      controls.squeeze++;
      sonde_session_control(film->session, &controls);
      film->squeezed = film->place;
      film->squeeze_until_s = film->seen.time_s + SQUEEZE_S;
      say(film, false,
          "Before the press the free hand squeezes the calf: blood runs up, and colour fills an "
          "open vein from wall to wall.");
    }
    const bool waits =
        colour && film->squeezed == film->place && film->seen.time_s < film->squeeze_until_s;
    if (film->playing && !waits) {
      sonde_operator_see(film->op, &film->seen);
      follow(film);
    }
    const uint32_t held = sonde_operator_wants(film->op);
    if (held == film->held) continue;
    // The patient turns; the expert goes on.
    const sonde_case_setup *setup = &film->setups.held[held];
    sonde_device hand = {0};
    sonde_status status = SONDE_OK;
    if (!sonde_judge_hold(film->judge, held, &setup->map))
      status = app_error(&error, SONDE_MEMORY, "out of memory");
    if (!status) status = sonde_operator_hold(film->op, held, &setup->map, STEP_S, &hand, &error);
    if (!status) status = lay(app, film, held, &hand, &error);
    if (hand.destroy) hand.destroy(hand.self);
    if (status) {
      sonde_page_tell(app->server, error.message);
      film->over = true;
      return false;
    }
    char words[EXAM_WORDS];
    snprintf(words, sizeof words, "The patient turns: %s.", sonde_position_title(setup->position));
    say(film, true, words);
    film->place = UINT32_MAX;
    break;
  }
  return true;
}

void exam_film_turn(exam_app *app) {
  exam_film *film = app->film;
  const double now_s = app_seconds(CLOCK_MONOTONIC);
  const double image_s = TICKS_PER_IMAGE * STEP_S / film->speed;
  if (!film->playing || film->over || now_s < film->read_until_s) {
    film->at_s = now_s;
    // A page that was loaded anew has the picture too.
    if (now_s - film->posted_s > POST_AGAIN_S) post(app);
    return;
  }
  if (now_s - film->at_s < image_s) return;
  // A machine that is too slow for the pace plays slower.
  film->at_s = fmax(film->at_s + image_s, now_s - image_s);
  (void)exam_film_step(app, 1);
}

void exam_film_destroy(exam_film *film) {
  if (!film) return;
  sonde_session_destroy(film->session, NULL);
  sonde_operator_destroy(film->op);
  sonde_judge_destroy(film->judge);
  sonde_exam_setups_clear(&film->setups);
  free(film);
}
