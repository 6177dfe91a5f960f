// What the desk tells the page, as JSON: docs/page_protocol.md. Millimetres, degrees and words for
// people exist only here.
//
// add_*                parts of a message
// publish              a message as a topic's newest text
// step, compression, segments, presses, result   parts of the exam's message
// desk_tell_*          the topics
#include "desk_parts.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double DEGREES = 57.295779513082321;

// Rounded, so that a message does not change with every bit; null when there is none.
static void add_real(cJSON *to, const char *key, double value, double unit) {
  double scaled = round(value / unit) * unit;
  if (isfinite(scaled))
    cJSON_AddNumberToObject(to, key, scaled);
  else
    cJSON_AddNullToObject(to, key);
}

static void add_vector(cJSON *to, const char *key, sonde_vec3 v, double scale) {
  const double list[3] = {v.x * scale, v.y * scale, v.z * scale};
  cJSON_AddItemToObject(to, key, cJSON_CreateDoubleArray(list, 3));
}

static void add_case(const desk *d, cJSON *to, const char *key, const char *id) {
  char alias[DESK_ALIAS];
  desk_case_alias(d, id, alias);
  cJSON_AddStringToObject(to, key, alias);
}

static void publish(desk *d, sonde_page_topic topic, cJSON *root) {
  char *text = root ? cJSON_PrintUnformatted(root) : NULL;
  if (d->server) sonde_page_publish(d->server, topic, text, NULL);
  cJSON_free(text);
  cJSON_Delete(root);
}

// The address of an exam's report, with the key that opens it.
static void link_report(const desk *d, const char *id, char link[SONDE_PAGE_LINK]) {
  char path[SONDE_LOG_TEXT + 16];
  snprintf(path, sizeof path, "/report/%s", id);
  sonde_page_link(d->server, path, link);
}

// ---- hello

static const char *level_name(sonde_case_level level) {
  static const char *const NAMES[] = {"first", "easy", "hard"};
  return NAMES[level];
}

// Nothing of the truth.
static cJSON *cases(const desk *d) {
  cJSON *list = cJSON_CreateArray();
  for (uint32_t i = 0; i < d->case_count; ++i) {
    cJSON *item = cJSON_CreateObject();
    add_case(d, item, "id", d->case_list[i].id);
    cJSON_AddStringToObject(item, "title", d->case_list[i].title);
    cJSON_AddStringToObject(item, "history", d->case_list[i].history);
    cJSON_AddStringToObject(item, "level", level_name(d->case_list[i].level));
    cJSON_AddItemToArray(list, item);
  }
  return list;
}

static cJSON *protocols(const desk *d) {
  cJSON *list = cJSON_CreateArray();
  for (uint32_t i = 0; i < d->protocol_count; ++i) {
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "id", d->protocol_list[i].id);
    cJSON_AddStringToObject(item, "title", d->protocol_list[i].title);
    cJSON_AddStringToObject(item, "text", d->protocol_list[i].text);
    cJSON_AddItemToArray(list, item);
  }
  return list;
}

void desk_tell_greeting(desk *d) {
  cJSON *root = cJSON_CreateObject();
  cJSON_AddBoolToObject(root, "trainer", true);
  cJSON_AddStringToObject(root, "trainee", d->trainee);
  cJSON_AddStringToObject(root, "device", d->def.device_name);
  cJSON_AddItemToObject(root, "case_list", cases(d));
  cJSON_AddItemToObject(root, "protocols", protocols(d));
  char *text = cJSON_PrintUnformatted(root);
  if (text) { // the members without the braces
    text[strlen(text) - 1] = 0;
    sonde_page_publish(d->server, SONDE_PAGE_GREETING, text + 1, NULL);
  }
  cJSON_free(text);
  cJSON_Delete(root);
}

// ---- exam

static void add_target(cJSON *to, const desk_exam *exam, const sonde_plan_point *point) {
  cJSON *target = cJSON_AddObjectToObject(to, "target");
  cJSON_AddStringToObject(target, "name", point->title);
  add_vector(target, "position_mm", point->at.skin_m, 1e3);
  add_vector(target, "normal", point->at.normal, 1);
  add_vector(target, "across", point->at.across, 1);
  cJSON_AddNumberToObject(target, "radius_mm", exam->plan.criteria.reach_m * 1e3);
}

// Under full guidance, or while a hint shows it.
static void add_guides(cJSON *to, const desk_exam *exam, const sonde_guidance *g, bool shown) {
  if (shown && g->point < exam->plan.count)
    add_target(to, exam, &exam->plan.point[g->point]);
  else
    cJSON_AddNullToObject(to, "target");
  if (shown && isfinite(g->force.limit_n))
    cJSON_AddItemToObject(
        to, "force_n", cJSON_CreateDoubleArray((double[]){g->force.firm_n, g->force.limit_n}, 2));
  else
    cJSON_AddNullToObject(to, "force_n");
  add_real(to, "offset_mm", shown ? g->offset_m * 1e3 : (double)NAN, 1);
  add_real(to, "angle_deg", shown ? g->angle_rad * DEGREES : (double)NAN, 1);
  cJSON_AddBoolToObject(to, "angle_ok", shown && g->angle_ok);
}

static void add_step(cJSON *root, const desk_exam *exam, bool full, bool hinted) {
  sonde_guidance g = sonde_judge_guidance(exam->judge);
  bool silent = strcmp(exam->guidance, "exam") == 0;
  bool asked = !silent && g.undecided < exam->setup.map.segment_count;
  cJSON *step = cJSON_AddObjectToObject(root, "step");
  cJSON_AddStringToObject(step, "text", silent ? "" : g.text);
  cJSON_AddStringToObject(step, "detail", full || hinted || asked ? g.detail : "");
  cJSON_AddStringToObject(step, "segment", asked ? exam->setup.map.segment[g.undecided].name : "");
  add_guides(step, exam, &g, full || hinted);
  cJSON_AddStringToObject(root, "hint", hinted ? g.text : "");
}

static void add_compression(cJSON *root, const desk_exam *exam, bool shown) {
  sonde_judge_now now = sonde_judge_state(exam->judge);
  if (!shown) {
    cJSON_AddNullToObject(root, "compression");
    return;
  }
  cJSON *press = cJSON_AddObjectToObject(root, "compression");
  cJSON_AddStringToObject(press, "state", sonde_press_state_name(now.state));
  add_real(press, "vein", now.vein_ratio, 0.01);
  add_real(press, "artery", now.artery_ratio, 0.01);
}

static void add_segments(cJSON *root, const desk_exam *exam) {
  const sonde_vein_map *map = &exam->setup.map;
  cJSON *list = cJSON_AddArrayToObject(root, "segments");
  for (uint32_t i = 0; i < map->segment_count; ++i) {
    sonde_segment_status status = sonde_judge_segment(exam->judge, i);
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "id", map->segment[i].name);
    cJSON_AddStringToObject(item, "title", sonde_segment_title(map->segment[i].name));
    add_real(item, "from_mm", map->segment[i].from_m * 1e3, 0.1);
    add_real(item, "to_mm", map->segment[i].to_m * 1e3, 0.1);
    cJSON_AddBoolToObject(item, "needed", status.needed);
    cJSON_AddNumberToObject(item, "points", status.points);
    cJSON_AddNumberToObject(item, "done", status.done);
    cJSON_AddStringToObject(item, "decision", sonde_decision_name(status.decision));
    cJSON_AddItemToArray(list, item);
  }
}

static void add_presses(cJSON *root, const desk_exam *exam) {
  enum { MOST = 200 }; // the newest
  uint32_t count;
  const sonde_compression *press = sonde_judge_compressions(exam->judge, &count);
  const sonde_vein_map *map = &exam->setup.map;
  cJSON *list = cJSON_AddArrayToObject(root, "presses");
  for (uint32_t i = count > MOST ? count - MOST : 0; i < count; ++i) {
    cJSON *item = cJSON_CreateObject();
    bool known = press[i].segment < map->segment_count;
    add_real(item, "t_s", press[i].peak_s, 0.01);
    add_real(item, "z_mm", press[i].z_m * 1e3, 0.1);
    cJSON_AddStringToObject(item, "segment", known ? map->segment[press[i].segment].name : "");
    cJSON_AddStringToObject(item, "result", sonde_press_result_name(press[i].result));
    add_real(item, "force_n", press[i].force_peak_n, 0.1);
    cJSON_AddItemToArray(list, item);
  }
}

// The score part by part, and where its points went.
static void add_parts(cJSON *result, const desk_exam *exam) {
  uint32_t count;
  const sonde_compression *press = sonde_judge_compressions(exam->judge, &count);
  sonde_score_part part[SONDE_SCORE_PARTS];
  sonde_score_explain(&exam->score, &exam->plan, press, count, part);
  cJSON *list = cJSON_AddArrayToObject(result, "parts");
  for (int i = 0; i < SONDE_SCORE_PARTS; ++i) {
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "title", part[i].title);
    add_real(item, "points", part[i].points, 0.1);
    cJSON_AddNumberToObject(item, "of", part[i].of);
    cJSON_AddStringToObject(item, "lost", part[i].lost);
    cJSON_AddItemToArray(list, item);
  }
}

static void add_result(cJSON *root, const desk *d, const desk_exam *exam) {
  if (!exam->scored) {
    cJSON_AddNullToObject(root, "result");
    return;
  }
  char report[SONDE_PAGE_LINK];
  link_report(d, exam->id, report);
  cJSON *result = cJSON_AddObjectToObject(root, "result");
  add_real(result, "score", exam->score.score, 0.1);
  cJSON_AddBoolToObject(result, "passed", exam->score.passed);
  cJSON_AddBoolToObject(result, "correct", exam->score.correct);
  cJSON_AddStringToObject(result, "summary", exam->score.summary);
  cJSON_AddStringToObject(result, "note", exam->patient.note);
  cJSON_AddStringToObject(result, "report", report);
  add_parts(result, exam);
  cJSON *diagnosis = cJSON_AddObjectToObject(result, "diagnosis");
  cJSON_AddStringToObject(diagnosis, "asked", exam->score.asked);
  cJSON_AddStringToObject(diagnosis, "truth", exam->score.truth);
}

static void add_comments(cJSON *root, const sonde_comments *comments) {
  cJSON *list = cJSON_AddArrayToObject(root, "comments");
  for (uint32_t i = 0; i < comments->count; ++i) {
    cJSON *item = cJSON_CreateObject();
    add_real(item, "t_s", comments->list[i].time_s, 0.01);
    cJSON_AddStringToObject(item, "text", comments->list[i].text);
    cJSON_AddStringToObject(item, "author", comments->list[i].author);
    cJSON_AddItemToArray(list, item);
  }
}

// Under the lock.
static void add_exam(cJSON *root, const desk *d, const desk_exam *exam) {
  bool hinted = false, full = strcmp(exam->guidance, "full") == 0;
  uint32_t hints = sonde_judge_hints(exam->judge, &hinted);
  cJSON_AddStringToObject(root, "exam", exam->id);
  add_case(d, root, "case", exam->patient.id);
  cJSON_AddStringToObject(root, "title", exam->patient.title);
  cJSON_AddStringToObject(root, "history", exam->patient.history);
  cJSON_AddStringToObject(root, "protocol", exam->protocol->id);
  cJSON_AddStringToObject(root, "guidance", exam->guidance);
  add_real(root, "elapsed_s", sonde_judge_state(exam->judge).time_s, 1);
  cJSON_AddBoolToObject(root, "recording", true);
  cJSON_AddNumberToObject(root, "hints_used", hints);
  add_step(root, exam, full, hinted);
  add_compression(root, exam, full || hinted);
  add_segments(root, exam);
  add_presses(root, exam);
  add_result(root, d, exam);
  add_comments(root, &exam->comments);
}

// The same keys when there is no exam.
static void add_no_exam(cJSON *root) {
  static const char *const TEXTS[] = {"exam",     "case",     "title", "history",
                                      "protocol", "guidance", "hint"};
  for (size_t i = 0; i < sizeof TEXTS / sizeof TEXTS[0]; ++i)
    cJSON_AddStringToObject(root, TEXTS[i], "");
  cJSON_AddNumberToObject(root, "elapsed_s", 0);
  cJSON_AddBoolToObject(root, "recording", false);
  cJSON_AddNumberToObject(root, "hints_used", 0);
  cJSON *step = cJSON_AddObjectToObject(root, "step");
  cJSON_AddStringToObject(step, "text", "");
  cJSON_AddStringToObject(step, "detail", "");
  cJSON_AddStringToObject(step, "segment", "");
  add_guides(step, NULL, NULL, false);
  cJSON_AddNullToObject(root, "compression");
  cJSON_AddArrayToObject(root, "segments");
  cJSON_AddArrayToObject(root, "presses");
  cJSON_AddNullToObject(root, "result");
  cJSON_AddArrayToObject(root, "comments");
}

static const char *phase_name(desk_phase phase) {
  static const char *const NAMES[] = {"practice", "preparing", "running", "done", "replay"};
  return NAMES[phase];
}

// Under the lock.
static cJSON *status_of(const desk *d) {
  cJSON *root = cJSON_CreateObject();
  const desk_exam *exam = d->exam;
  cJSON_AddStringToObject(root, "trainee", d->trainee);
  cJSON_AddStringToObject(root, "phase", phase_name(d->phase));
  cJSON_AddStringToObject(root, "case", exam ? exam->patient.title : "");
  add_real(root, "elapsed_s", exam ? sonde_judge_state(exam->judge).time_s : (double)NAN, 1);
  add_real(root, "score", exam && exam->scored ? exam->score.score : (double)NAN, 0.1);
  return root;
}

void desk_tell_exam(desk *d) {
  cJSON *root = cJSON_CreateObject();
  pthread_mutex_lock(&d->lock);
  cJSON_AddStringToObject(root, "type", "exam");
  cJSON_AddStringToObject(root, "phase", phase_name(d->phase));
  cJSON_AddStringToObject(root, "message", d->message);
  cJSON_AddNumberToObject(root, "progress", d->progress);
  if (d->exam)
    add_exam(root, d, d->exam);
  else
    add_no_exam(root);
  cJSON *status = status_of(d);
  pthread_mutex_unlock(&d->lock); // the server's lock is taken before this one elsewhere
  publish(d, SONDE_PAGE_EXAM, root);
  publish(d, SONDE_PAGE_STATUS, status);
}

// ---- kept exams

static cJSON *kept(const desk *d, const sonde_log_entry *entry) {
  char report[SONDE_PAGE_LINK];
  link_report(d, entry->id, report);
  cJSON *item = cJSON_CreateObject();
  cJSON_AddStringToObject(item, "id", entry->id);
  cJSON_AddStringToObject(item, "trainee", entry->trainee);
  add_case(d, item, "case", entry->case_id);
  cJSON_AddStringToObject(item, "title", entry->case_title);
  cJSON_AddStringToObject(item, "date", entry->date);
  cJSON_AddStringToObject(item, "protocol", entry->protocol);
  add_real(item, "score", entry->interrupted ? (double)NAN : entry->score, 0.1);
  cJSON_AddBoolToObject(item, "passed", entry->passed);
  add_real(item, "seconds", entry->metrics.time_s, 1);
  cJSON_AddStringToObject(item, "report", entry->interrupted ? "" : report);
  cJSON_AddBoolToObject(item, "recording", entry->recording[0] != 0);
  return item;
}

void desk_tell_exams(desk *d) {
  enum { MOST = 200 };
  sonde_log_entry *entries = NULL;
  uint32_t count = 0;
  sonde_error error = {0};
  if (sonde_exam_log_list(d->log, NULL, MOST, &entries, &count, &error))
    sonde_page_tell(d->server, error.message);
  cJSON *root = cJSON_CreateObject();
  cJSON_AddStringToObject(root, "type", "exams");
  cJSON *list = cJSON_AddArrayToObject(root, "list");
  for (uint32_t i = 0; i < count; ++i) cJSON_AddItemToArray(list, kept(d, &entries[i]));
  sonde_free(entries);
  publish(d, SONDE_PAGE_EXAMS, root);
}

// ---- replay

void desk_tell_replay(desk *d) {
  const desk_replay *replay = d->replay;
  if (!replay || d->phase != DESK_REPLAY) return;
  cJSON *root = cJSON_CreateObject();
  cJSON_AddStringToObject(root, "type", "replay");
  cJSON_AddStringToObject(root, "exam", replay->id);
  cJSON_AddStringToObject(root, "title", replay->title);
  add_real(root, "duration_s", sonde_player_info(replay->player)->duration_s, 0.001);
  add_real(root, "time_s", sonde_player_time(replay->player), 0.001);
  cJSON_AddBoolToObject(root, "playing", replay->playing);
  add_real(root, "speed", replay->speed, 0.01);
  cJSON *presses = replay->presses ? cJSON_Duplicate(replay->presses, true) : cJSON_CreateArray();
  cJSON_AddItemToObject(root, "presses", presses);
  add_comments(root, &replay->comments);
  publish(d, SONDE_PAGE_REPLAY, root);
}
