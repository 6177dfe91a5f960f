// exam_once run [...]: one exam as the page would drive it, with what the program was
// told to be on the disk on standard output, one word a line: begun, decided (twice), kept, and
// what the log has of it: scored or interrupted.
// exam_once notes FILE: how many decisions a journal has.
// Environment, EXAM_ONCE_...: DIR, MODEL, CASES, PROTOCOLS, COURSE, SECONDS, ROOM_AFTER (the
// program goes on so long with a result that is not on the disk), SHEET (a worksheet is written as
// well), TICKS (each part goes on until so many ticks are done and seen).
#include "exam_app_lesson.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const char *setting(const char *name) {
  const char *value = getenv(name);
  return value ? value : "";
}

// Over the start, then in contact, back and forth.
static sonde_status make_device(const void *user, const sonde_site *start,
                                const sonde_session_def *def, sonde_device *device,
                                sonde_error *error) {
  (void)user;
  const sonde_script_key keys[] = {
      {0.0, sonde_site_pose(start, -0.01)}, {0.3, sonde_site_pose(start, 0.012)},
      {0.5, sonde_site_pose(start, 0.012)}, {0.7, sonde_site_pose(start, -0.002)},
      {1.0, sonde_site_pose(start, 0.015)}, {1.3, sonde_site_pose(start, -0.005)}};
  return sonde_device_script(keys, sizeof keys / sizeof keys[0], def->world.dt_s, device, error);
}

static void say(const char *word) {
  printf("%s\n", word);
  fflush(stdout);
}

static void turn_for(exam_app *app, double seconds) {
  double until_s = app_seconds(CLOCK_MONOTONIC) + seconds;
  do {
    exam_app_turn(app);
    nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
  } while (app_seconds(CLOCK_MONOTONIC) < until_s);
}

// However long the machine takes for it.
static void turn_until_seen(exam_app *app, uint32_t part) {
  const uint64_t ticks = strtoull(setting("EXAM_ONCE_TICKS"), NULL, 10);
  for (bool seen = ticks == 0; !seen && app->exam && app->phase == EXAM_RUNNING;) {
    turn_for(app, 0);
    pthread_mutex_lock(&app->lock);
    seen = app->exam && app->exam->watched_part >= part && app->exam->seen_tick >= ticks;
    pthread_mutex_unlock(&app->lock);
  }
}

static void ask(exam_app *app, const sonde_page_request *request) {
  pthread_mutex_lock(&app->lock);
  app->request[(app->request_first + app->request_count++) % EXAM_REQUESTS] = *request;
  pthread_mutex_unlock(&app->lock);
}

// Asks and waits until the journal has one more note on the disk, or the disk is in trouble.
static bool ask_noted(exam_app *app, const sonde_page_request *request) {
  sonde_recording_state state = sonde_session_recording(app->session);
  const uint32_t count = state.notes + 1;
  ask(app, request);
  for (int i = 0; i < 1000 && state.notes < count && !state.in_trouble; ++i) {
    turn_for(app, 0);
    state = sonde_session_recording(app->session);
  }
  return state.notes >= count;
}

static void decide(exam_app *app, const char *word) {
  sonde_page_request request = {.ask = SONDE_PAGE_DECIDE};
  snprintf(request.id, sizeof request.id, "%s", app->exam->setups.held[0].map.segment[0].name);
  snprintf(request.text, sizeof request.text, "%s", word);
  if (ask_noted(app, &request)) say("decided");
}

// A picture of now in the worksheet.
static void store_picture(exam_app *app) {
  sonde_error error = {0};
  uint64_t tick = 0;
  for (int k = 0; k < 20000 && !tick; ++k) {
    turn_for(app, 0);
    pthread_mutex_lock(&app->lock);
    tick = app->exam->watched_part == app->exam->part ? app->exam->seen_tick : 0;
    pthread_mutex_unlock(&app->lock);
  }
  char entry[100];
  snprintf(entry, sizeof entry, "{\"type\":\"worksheet\",\"picture\":%llu,\"place\":0}",
           (unsigned long long)tick);
  sonde_status stored = exam_app_write_sheet(app, entry, &error);
  printf("stores a picture: %s\n", stored ? error.message : "yes");
}

// A clot with all that can be said of it, and a conclusion.
static void write_sheet(exam_app *app) {
  static const char *const ENTRIES[] = {
      "{\"type\":\"worksheet\",\"place\":0,\"finding\":\"not_compressible\",\"age\":\"acute\","
      "\"kind\":\"occlusive\",\"reflux\":\"present\",\"reflux_s\":0.8,\"text\":\"Größe: 9 mm\"}",
      "{\"type\":\"worksheet\",\"conclusion\":\"proximal\",\"deep\":[0,0],"
      "\"text\":\"Fresh clot.\\nTreat.\"}"};
  sonde_error error = {0};
  store_picture(app);
  for (int k = 0; k < 2; ++k)
    if (exam_app_write_sheet(app, ENTRIES[k], &error)) say(error.message);
}

static bool is_kept(const exam_app *app) {
  return app->exam && app->exam->in_journal && app->exam->filed && app->exam->logged;
}

static int examine(exam_app *app) {
  double seconds = atof(setting("EXAM_ONCE_SECONDS")),
         room_s = atof(setting("EXAM_ONCE_ROOM_AFTER"));
  sonde_error error = {0};
  sonde_page_request request = {
      .ask = SONDE_PAGE_START_EXAM, .id = "patient-1", .guidance = "hints", .name = "Tester"};
  snprintf(request.protocol, sizeof request.protocol, "%s", app->protocol_list[0].id);
  if (exam_start(app, &request, &error)) {
    fprintf(stderr, "exam_once: %s\n", error.message);
    return APP_FAILED;
  }
  say("begun");
  turn_for(app, seconds / 2);
  turn_until_seen(app, 1);
  decide(app, "clot");
  if (setting("EXAM_ONCE_SHEET")[0]) write_sheet(app);
  ask_noted(app, &(sonde_page_request){.ask = SONDE_PAGE_HINT});
  ask(app, &(sonde_page_request){.ask = SONDE_PAGE_POSITION, .id = "prone_bent"});
  turn_for(app, seconds / 2);
  turn_until_seen(app, 2);
  if (!app->exam) { // the second part could not be begun: the exam is over, the first part is kept
    fprintf(stderr, "exam_once: the page is told: %s\n", app->message);
    return APP_FAILED;
  }
  decide(app, "compressible");
  if (setting("EXAM_ONCE_SHEET")[0]) store_picture(app);
  exam_finish(app, &error);
  if (is_kept(app)) say("kept");
  turn_for(app, is_kept(app) ? 0.05 : room_s);
  if (!is_kept(app)) fprintf(stderr, "exam_once: the page is told: %s\n", app->message);
  sonde_log_entry *entries = NULL;
  uint32_t count = 0;
  if (is_kept(app) && !sonde_exam_log_list(app->log, NULL, 1, &entries, &count, &error) && count)
    say(entries[0].interrupted ? "interrupted" : "scored");
  sonde_free(entries);
  return is_kept(app) ? APP_OK : APP_FAILED;
}

// A lesson as the page would have it: the demonstration to its end, each step's words on a line,
// then its practice.
static int teach(exam_app *app) {
  char words[EXAM_WORDS] = "";
  sonde_error error = {0};
  const char *lesson = app->course.lesson[0].protocol.id;
  if (exam_film_open(app, lesson, &error)) {
    fprintf(stderr, "exam_once: %s\n", error.message);
    return APP_FAILED;
  }
  const uint64_t before = sonde_session_ticks(app->film->session);
  turn_for(app, 0.2); // it waits for the learner to begin
  printf("waits: %s\n", sonde_session_ticks(app->film->session) == before ? "yes" : "no");
  ask(app, &(sonde_page_request){.ask = SONDE_PAGE_PLAY, .playing = true, .speed = 4});
  for (int k = 0; k < 20000 && !(app->film && app->film->over); ++k) {
    turn_for(app, 0);
    if (strcmp(words, app->film->words) == 0) continue;
    snprintf(words, sizeof words, "%s", app->film->words);
    printf("words: %s\n", words);
    ask(app, &(sonde_page_request){.ask = SONDE_PAGE_NEXT});
  }
  sonde_page_request request = {.ask = SONDE_PAGE_START_LESSON, .turn = 7, .name = "Tester"};
  snprintf(request.id, sizeof request.id, "%s", lesson);
  if (exam_start(app, &request, &error)) {
    fprintf(stderr, "exam_once: %s\n", error.message);
    return APP_FAILED;
  }
  printf("practises: %s, repetition %u, %s, film %s\n", app->exam->protocol->id,
         app->exam->turn + 1, app->exam->guidance, app->film ? "goes on" : "is over");
  store_picture(app);
  exam_finish(app, &error);
  return APP_OK;
}

static int run(void) {
  sonde_error error = {0};
  sonde_model *model = NULL;
  exam_app *app = NULL;
  sonde_session_def practice = sonde_session_def_default();
  practice.image_width = practice.image_height = 128;
  practice.ticks_per_image = 100; // images are a third of an exam's work, few are looked at
  if (sonde_model_load(setting("EXAM_ONCE_MODEL"), &model, &error)) return app_fail("run", &error);
  exam_app_def def = {.model = model,
                      .model_path = setting("EXAM_ONCE_MODEL"),
                      .cases = setting("EXAM_ONCE_CASES"),
                      .own_cases = "none",
                      .protocols = setting("EXAM_ONCE_PROTOCOLS"),
                      .course = getenv("EXAM_ONCE_COURSE"),
                      .exams = setting("EXAM_ONCE_DIR"),
                      .start = model->sites[0],
                      .trainee = "Tester",
                      .practice = practice,
                      .make_device = make_device,
                      .device_name = "script"};
  int code = APP_FAILED;
  if (!exam_app_create(&def, &app, &error)) code = def.course ? teach(app) : examine(app);
  sonde_error late = {0};
  if (exam_app_destroy(app, &late)) code = app_fail("run", &late);
  if (!app) code = app_fail("run", &error);
  sonde_model_destroy(model);
  return code;
}

int main(int argc, char **argv) {
  if (argc > 1 && strcmp(argv[1], "run") == 0) return run();
  sonde_notes notes;
  sonde_error error = {0};
  uint32_t decisions = 0;
  if (argc != 3 || sonde_notes_load(argv[2], &notes, &error)) {
    fprintf(stderr, "exam_once: %s\n", error.message);
    return APP_BAD_INPUT;
  }
  for (uint32_t i = 0; i < notes.count; ++i) decisions += notes.list[i].kind == SONDE_NOTE_DECISION;
  printf("%u\n", decisions);
  sonde_notes_clear(&notes);
  return APP_OK;
}
