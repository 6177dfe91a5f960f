// What the page is told, as JSON: docs/page_protocol.md. Millimetres, degrees and words for people
// exist only here.
#include "exam_app_draft.h"
#include "exam_app_lesson.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const double DEGREES = 57.295779513082321;

// ---- parts of a message

// False when out of memory: then nothing is told.
static bool begin(sonde_json_out *out, const char *type) {
  *out = (sonde_json_out){.layout = SONDE_JSON_COMPACT};
  if (sonde_file_in_memory(&out->file, NULL)) return false;
  sonde_json_begin_object(out, NULL);
  if (type) sonde_json_put_text(out, "type", type);
  return true;
}

// The newest text of a topic; members without braces for the greeting.
static void publish(exam_app *app, sonde_page_topic topic, sonde_json_out *out) {
  char *text = NULL;
  size_t length = 0;
  sonde_json_end(out);
  (void)sonde_file_take(out->file, &text, &length, NULL);
  bool bare = text && topic == SONDE_PAGE_GREETING;
  if (bare) text[length - 1] = 0;
  if (app->server) sonde_page_publish(app->server, topic, bare ? text + 1 : text, NULL);
  sonde_free(text);
}

// Rounded, so that a message does not change with every bit; null when there is none.
static void put_rounded(sonde_json_out *out, const char *key, double value, double unit) {
  assert(unit > 0);
  sonde_json_put_real(out, key, round(value / unit) * unit, 0);
}

static void put_reals(sonde_json_out *out, const char *key, const double *list, int count) {
  assert(count >= 0);
  sonde_json_begin_list(out, key);
  for (int i = 0; i < count; ++i) sonde_json_put_real(out, NULL, list[i], 0);
  sonde_json_end(out);
}

static void put_vector(sonde_json_out *out, const char *key, sonde_vec3 v, double scale) {
  assert(scale > 0);
  put_reals(out, key, (double[]){v.x * scale, v.y * scale, v.z * scale}, 3);
}

static void put_null(sonde_json_out *out, const char *key) {
  sonde_json_put_real(out, key, (double)NAN, 0);
}

static void put_case(const exam_app *app, sonde_json_out *out, const char *key, const char *id) {
  char alias[EXAM_ALIAS];
  exam_app_case_alias(app, id, alias);
  sonde_json_put_text(out, key, alias);
}

// The address of an exam's report, with the key that opens it.
static void put_report(const exam_app *app, sonde_json_out *out, const char *id) {
  assert(id[0]);
  char path[SONDE_LOG_TEXT + 16], link[SONDE_PAGE_LINK];
  snprintf(path, sizeof path, "/report/%s", id);
  sonde_page_link(app->server, path, link);
  sonde_json_put_text(out, "report", link);
}

static void put_comments(sonde_json_out *out, const sonde_comments *comments) {
  sonde_json_begin_list(out, "comments");
  for (uint32_t i = 0; comments && i < comments->count; ++i) {
    sonde_json_begin_object(out, NULL);
    put_rounded(out, "t_s", comments->list[i].time_s, 0.01);
    sonde_json_put_text(out, "text", comments->list[i].text);
    sonde_json_put_text(out, "author", comments->list[i].author);
    sonde_json_end(out);
  }
  sonde_json_end(out);
}

// ---- hello

// Nothing of the truth.
void exam_app_tell_greeting(exam_app *app) {
  static const char *const LEVELS[] = {"first", "easy", "hard"};
  sonde_json_out out;
  if (!begin(&out, NULL)) return;
  sonde_json_put_bool(&out, "trainer", true);
  sonde_json_put_text(&out, "trainee", app->trainee);
  sonde_json_put_text(&out, "device", app->def.device_name);
  sonde_json_begin_list(&out, "case_list");
  for (uint32_t i = 0; i < app->case_count; ++i) {
    const sonde_case *c = &app->case_list[i];
    sonde_json_begin_object(&out, NULL);
    put_case(app, &out, "id", c->id);
    sonde_json_put_text(&out, "title", c->title);
    sonde_json_put_text(&out, "history", c->history);
    sonde_json_put_text(&out, "level", LEVELS[c->level]);
    sonde_json_put_bool(&out, "own", i >= app->shipped_count);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  sonde_json_begin_list(&out, "protocols");
  for (uint32_t i = 0; i < app->protocol_count; ++i) {
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "id", app->protocol_list[i].id);
    sonde_json_put_text(&out, "title", app->protocol_list[i].title);
    sonde_json_put_text(&out, "text", app->protocol_list[i].text);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  exam_app_put_course(app, &out);
  publish(app, SONDE_PAGE_GREETING, &out);
}

// ---- exam

// How the patient lies, the press under way, the segments, and the newest presses.
static void put_findings(sonde_json_out *out, const exam *of, bool shown) {
  enum { MOST = 200 };
  uint32_t count;
  const sonde_vein_map *map = &of->setups.held[of->held].map;
  const sonde_compression *press = sonde_judge_compressions(of->judge, &count);
  const uint32_t lies = of->turns ? of->turns_to : of->held;
  sonde_json_put_text(out, "position", sonde_position_key(of->setups.held[lies].position));
  sonde_json_begin_list(out, "positions");
  for (uint32_t k = 0; k < of->setups.count; ++k) {
    const sonde_limb_position position = of->setups.held[k].position;
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "id", sonde_position_key(position));
    sonde_json_put_text(out, "title", sonde_position_title(position));
    sonde_json_end(out);
  }
  sonde_json_end(out);
  if (shown) {
    sonde_judge_now now = sonde_judge_state(of->judge);
    sonde_json_begin_object(out, "compression");
    sonde_json_put_text(out, "state", sonde_press_state_name(now.state));
    put_rounded(out, "vein", now.vein_ratio, 0.01);
    put_rounded(out, "artery", now.artery_ratio, 0.01);
    sonde_json_end(out);
  } else {
    put_null(out, "compression");
  }
  sonde_json_begin_list(out, "segments");
  for (uint32_t i = 0; i < map->segment_count; ++i) {
    sonde_segment_status status = sonde_judge_segment(of->judge, i);
    if (map->segment[i].kind != SONDE_SEGMENT_MAIN && !status.needed) continue;
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "id", map->segment[i].name);
    sonde_json_put_text(out, "title", sonde_segment_title(map->segment[i].name));
    put_rounded(out, "from_mm", map->segment[i].from_m * 1e3, 0.1);
    put_rounded(out, "to_mm", map->segment[i].to_m * 1e3, 0.1);
    sonde_json_put_bool(out, "needed", status.needed);
    sonde_json_put_integer(out, "points", status.points);
    sonde_json_put_integer(out, "done", status.done);
    sonde_json_put_text(out, "decision", sonde_decision_name(status.decision));
    sonde_json_end(out);
  }
  sonde_json_end(out);
  sonde_json_begin_list(out, "presses");
  for (uint32_t i = count > MOST ? count - MOST : 0; i < count; ++i) {
    bool known = press[i].segment < map->segment_count;
    sonde_json_begin_object(out, NULL);
    put_rounded(out, "t_s", press[i].peak_s, 0.01);
    put_rounded(out, "z_mm", press[i].z_m * 1e3, 0.1);
    sonde_json_put_text(out, "segment", known ? map->segment[press[i].segment].name : "");
    sonde_json_put_text(out, "result", sonde_press_result_name(press[i].result));
    put_rounded(out, "force_n", press[i].force_peak_n, 0.1);
    sonde_json_end(out);
  }
  sonde_json_end(out);
}

// The score part by part, and where its points went.
static void put_result(sonde_json_out *out, const exam_app *app, const exam *of) {
  if (!of->scored) {
    put_null(out, "result");
    return;
  }
  const sonde_score *score = &of->score;
  uint32_t count;
  const sonde_compression *press = sonde_judge_compressions(of->judge, &count);
  sonde_score_part part[SONDE_SCORE_PARTS];
  sonde_score_explain(score, &of->plan, press, count, part);
  sonde_json_begin_object(out, "result");
  put_rounded(out, "score", score->score, 0.1);
  sonde_json_put_bool(out, "passed", score->passed);
  sonde_json_put_bool(out, "correct", score->correct);
  sonde_json_put_text(out, "summary", score->summary);
  sonde_json_put_text(out, "note", of->patient.note);
  put_report(app, out, of->id);
  sonde_json_begin_list(out, "parts");
  for (int i = 0; i < SONDE_SCORE_PARTS; ++i) {
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "title", part[i].title);
    put_rounded(out, "points", part[i].points, 0.1);
    sonde_json_put_real(out, "of", part[i].of, 0);
    sonde_json_put_text(out, "lost", part[i].lost);
    sonde_json_end(out);
  }
  sonde_json_end(out);
  sonde_json_begin_object(out, "diagnosis");
  sonde_json_put_text(out, "asked", score->asked);
  sonde_json_put_text(out, "truth", score->truth);
  sonde_json_end(out);
  sonde_json_end(out);
}

// In the order of exam_phase.
static const char *const PHASES[] = {"practice", "preparing", "running", "done",
                                     "replay",   "film",      "edit"};

void exam_app_tell_exam(exam_app *app) {
  sonde_json_out out, status;
  if (!begin(&out, "exam")) return;
  if (!begin(&status, NULL)) {
    sonde_file_discard(out.file);
    return;
  }
  pthread_mutex_lock(&app->lock);
  const exam *of = app->exam;
  bool hinted = false, full = of && strcmp(of->guidance, "full") == 0;
  uint32_t hints = of ? sonde_judge_hints(of->judge, &hinted) : 0;
  double elapsed_s = of ? sonde_judge_state(of->judge).time_s : 0;
  sonde_json_put_text(&out, "phase", PHASES[app->phase]);
  sonde_json_put_text(&out, "message", app->message);
  sonde_json_put_real(&out, "progress", app->progress, 0);
  sonde_json_put_text(&out, "exam", of ? of->id : "");
  put_case(app, &out, "case", of ? of->patient.id : "");
  sonde_json_put_text(&out, "title", of ? of->patient.title : "");
  sonde_json_put_text(&out, "history", of ? of->patient.history : "");
  sonde_json_put_text(&out, "protocol", of ? of->protocol->id : "");
  sonde_json_put_text(&out, "guidance", of ? of->guidance : "");
  put_rounded(&out, "elapsed_s", elapsed_s, 1);
  sonde_json_put_bool(&out, "recording", of != NULL);
  sonde_json_put_integer(&out, "hints_used", hints);
  // The step to take. Target, force and offsets under full guidance, or while a hint shows them.
  sonde_guidance g = {.offset_m = (double)NAN};
  if (of) g = sonde_judge_guidance(of->judge);
  bool shown = of && (full || hinted), silent = !of || strcmp(of->guidance, "exam") == 0;
  bool asked = !silent && g.undecided < of->setups.held[0].map.segment_count;
  sonde_json_begin_object(&out, "step");
  sonde_json_put_text(&out, "text", silent ? "" : g.text);
  sonde_json_put_text(&out, "detail", shown || asked ? g.detail : "");
  sonde_json_put_text(&out, "segment",
                      asked ? of->setups.held[0].map.segment[g.undecided].name : "");
  if (shown && g.point < of->plan.count && !g.turn) {
    const sonde_plan_point *point = &of->plan.point[g.point];
    sonde_json_begin_object(&out, "target");
    sonde_json_put_text(&out, "name", point->title);
    sonde_json_put_integer(&out, "place", g.point);
    put_vector(&out, "position_mm", point->at.skin_m, 1e3);
    put_vector(&out, "normal", point->at.normal, 1);
    put_vector(&out, "across", point->at.across, 1);
    sonde_json_put_real(&out, "radius_mm", of->plan.criteria.reach_m * 1e3, 0);
    sonde_json_end(&out);
  } else {
    put_null(&out, "target");
  }
  if (shown && isfinite(g.force.limit_n))
    put_reals(&out, "force_n", (double[]){g.force.firm_n, g.force.limit_n}, 2);
  else
    put_null(&out, "force_n");
  sonde_json_put_text(&out, "position",
                      shown && g.turn ? sonde_position_key(of->plan.point[g.point].position) : "");
  put_rounded(&out, "offset_mm", shown ? g.offset_m * 1e3 : (double)NAN, 1);
  put_rounded(&out, "angle_deg", shown ? g.angle_rad * DEGREES : (double)NAN, 1);
  sonde_json_put_bool(&out, "angle_ok", shown && g.angle_ok);
  sonde_json_end(&out);
  sonde_json_put_text(&out, "hint", hinted ? g.text : "");
  if (of) {
    put_findings(&out, of, full || hinted);
    put_result(&out, app, of);
  } else { // the same keys
    put_null(&out, "compression");
    put_reals(&out, "segments", NULL, 0);
    put_reals(&out, "presses", NULL, 0);
    put_null(&out, "result");
  }
  put_comments(&out, of ? &of->comments : NULL);
  exam_app_put_lesson(app, full || hinted, &out);
  // A teacher's overview.
  sonde_json_put_text(&status, "trainee", app->trainee);
  sonde_json_put_text(&status, "phase", PHASES[app->phase]);
  sonde_json_put_text(&status, "case", of ? of->patient.title : "");
  put_rounded(&status, "elapsed_s", of ? elapsed_s : (double)NAN, 1);
  put_rounded(&status, "score", of && of->scored ? of->score.score : (double)NAN, 0.1);
  pthread_mutex_unlock(&app->lock); // the server's lock is taken before this one elsewhere
  publish(app, SONDE_PAGE_EXAM, &out);
  publish(app, SONDE_PAGE_STATUS, &status);
}

// ---- kept exams

void exam_app_tell_exams(exam_app *app) {
  enum { MOST = 200 };
  sonde_log_entry *entries = NULL;
  uint32_t count = 0;
  sonde_error error = {0};
  sonde_json_out out;
  if (!begin(&out, "exams")) return;
  if (sonde_exam_log_list(app->log, NULL, MOST, &entries, &count, &error))
    sonde_page_tell(app->server, error.message);
  sonde_json_begin_list(&out, "list");
  for (const sonde_log_entry *e = entries; e < entries + count; ++e) {
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "id", e->id);
    sonde_json_put_text(&out, "trainee", e->trainee);
    put_case(app, &out, "case", e->case_id);
    sonde_json_put_text(&out, "title", e->case_title);
    sonde_json_put_text(&out, "date", e->date);
    sonde_json_put_text(&out, "protocol", e->protocol);
    put_rounded(&out, "score", e->interrupted ? (double)NAN : e->score, 0.1);
    sonde_json_put_bool(&out, "passed", e->passed);
    put_rounded(&out, "seconds", e->metrics.time_s, 1);
    if (e->interrupted)
      sonde_json_put_text(&out, "report", "");
    else
      put_report(app, &out, e->id);
    sonde_json_put_bool(&out, "recording", e->recording[0] != 0);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  sonde_free(entries);
  publish(app, SONDE_PAGE_EXAMS, &out);
}

// ---- replay

void exam_app_tell_replay(exam_app *app) {
  static const char *const REALS[][2] = {
      {"peak_s", "t_s"}, {"z_mm", "z_mm"}, {"force_peak_n", "force_n"}};
  const exam_replay *replay = app->replay;
  sonde_json_out out;
  if (!replay || app->phase != EXAM_REPLAY || !begin(&out, "replay")) return;
  sonde_json_put_text(&out, "exam", replay->id);
  sonde_json_put_text(&out, "title", replay->title);
  put_rounded(&out, "duration_s", exam_replay_length(replay), 0.001);
  put_rounded(&out, "time_s", exam_replay_time(replay), 0.001);
  sonde_json_put_bool(&out, "playing", replay->playing);
  put_rounded(&out, "speed", replay->speed, 0.01);
  sonde_json_begin_list(&out, "presses");
  const sonde_json *press = sonde_json_first(sonde_json_member(replay->result, "presses"));
  for (; press; press = sonde_json_next(press)) {
    const char *segment = sonde_json_as_text(sonde_json_member(press, "segment"));
    const char *result = sonde_json_as_text(sonde_json_member(press, "result"));
    sonde_json_begin_object(&out, NULL);
    for (size_t i = 0; i < sizeof REALS / sizeof REALS[0]; ++i)
      sonde_json_put_real(&out, REALS[i][1],
                          sonde_json_as_number(sonde_json_member(press, REALS[i][0])), 0);
    sonde_json_put_text(&out, "segment", segment ? segment : "");
    sonde_json_put_text(&out, "result", result ? result : "");
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  put_comments(&out, &replay->comments);
  publish(app, SONDE_PAGE_REPLAY, &out);
}

// ---- editor

void exam_app_tell_draft(exam_app *app) {
  static const char *const KINDS[] = {"main", "deep", "calf", "superficial"};
  enum { FIRST_BRANCH = 2 }; // vessels before it: main vein and artery
  const exam_draft *draft = app->draft;
  sonde_json_out out;
  if (!draft || !begin(&out, "draft")) return;
  sonde_json_put_integer(&out, "serial", draft->serial);
  sonde_json_put_bool(&out, "good", draft->good);
  sonde_json_put_bool(&out, "exists", draft->exists);
  sonde_json_put_text(&out, "message", draft->message);
  sonde_json_put_text(&out, "saved", draft->saved);
  if (draft->text) sonde_json_put_text(&out, "text", draft->text);
  if (draft->good && draft->follows) { // what the findings come to
    sonde_json_begin_object(&out, "answer");
    sonde_json_put_bool(&out, "thrombosis", draft->told.thrombosis);
    sonde_json_begin_object(&out, "segments");
    for (uint32_t k = 0; k < draft->told.truth_count; ++k)
      sonde_json_put_text(&out, draft->told.truth_segment[k],
                          sonde_decision_name(draft->told.truth[k]));
    sonde_json_end(&out);
    sonde_json_end(&out);
  }
  uint32_t count;
  const sonde_parameter *p = sonde_limb_parameters(&count);
  sonde_json_begin_list(&out, "parameters");
  for (uint32_t i = 0; i < count; ++i) {
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "key", p[i].name);
    sonde_json_put_text(&out, "text", p[i].text);
    put_rounded(&out, "low", p[i].low / p[i].unit, 0.01);
    put_rounded(&out, "high", p[i].high / p[i].unit, 0.01);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  // Of a leg in view: segments and vessels; without one the map is empty.
  const sonde_vein_map *map = &draft->setup.map;
  sonde_json_put_real(&out, "vein_mm", 1e3 * map->length_m, 0);
  sonde_json_begin_list(&out, "segments");
  for (uint32_t i = 0; i < map->segment_count; ++i) {
    const sonde_exam_segment *s = &map->segment[i];
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "id", s->name);
    sonde_json_put_text(&out, "title", sonde_segment_title(s->name));
    sonde_json_put_text(&out, "kind", KINDS[s->kind]);
    if (s->kind == SONDE_SEGMENT_MAIN) {
      const double ends[2] = {sonde_vein_along(map, s->from_m), sonde_vein_along(map, s->to_m)};
      put_reals(&out, "along_mm", (double[]){1e3 * ends[0], 1e3 * ends[1]}, 2);
    }
    sonde_json_begin_list(&out, "branches");
    for (uint32_t k = 0; k < s->vein_count; ++k) {
      assert(s->vein[k] >= FIRST_BRANCH && s->vein[k] - FIRST_BRANCH < map->branch_count);
      sonde_json_put_text(&out, NULL, map->branch[s->vein[k] - FIRST_BRANCH]);
    }
    sonde_json_end(&out);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  sonde_json_begin_list(&out, "branches");
  for (uint32_t i = 0; i < map->branch_count; ++i) sonde_json_put_text(&out, NULL, map->branch[i]);
  sonde_json_end(&out);
  const sonde_model *model = draft->setup.model;
  assert(!model || !model->anatomy || model->anatomy->branch_count == map->branch_count);
  sonde_json_begin_list(&out, "veins");
  for (uint32_t i = 0; model && model->anatomy && i < map->branch_count; ++i)
    if (model->anatomy->branch[i].kind == SONDE_VESSEL_VEIN)
      sonde_json_put_text(&out, NULL, map->branch[i]);
  sonde_json_end(&out);
  publish(app, SONDE_PAGE_DRAFT, &out);
}
