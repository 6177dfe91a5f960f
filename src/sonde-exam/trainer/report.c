// The report of an exam: one JSON document, which the bundle of web/src/report renders.
#include "trainer/report.h"

#include "sonde/files.h"
#include "trainer/log.h"

#include <string.h>

// ---- the vein -----------------------------------------------------------------------------------

static void put_stretch(sonde_json_out *out, const char *key, double from_m, double to_m) {
  sonde_json_begin_list(out, key);
  sonde_json_put_real(out, NULL, 1e3 * from_m, 6);
  sonde_json_put_real(out, NULL, 1e3 * to_m, 6);
  sonde_json_end(out);
}

// The stretches of vein whose steps are marked, groin first.
static void put_steps(sonde_json_out *out, const char *key, const bool *marked, uint32_t count) {
  sonde_json_begin_list(out, key);
  for (uint32_t i = 0, from; i < count; ++i) {
    if (!marked[i]) continue;
    for (from = i; i < count && marked[i];) ++i;
    put_stretch(out, NULL, from * JUDGE_BIN_M, i * JUDGE_BIN_M);
  }
  sonde_json_end(out);
}

static void put_vein(sonde_json_out *out, const sonde_exam_report *exam) {
  const sonde_vein_map *map = exam->map;
  const sonde_case *patient = exam->patient;
  double reach_m = exam->plan->criteria.reach_m, cover_m = reach_m + COVER_EXTRA_M;
  bool planned[JUDGE_BINS] = {false}, examined[JUDGE_BINS] = {false};
  uint32_t steps = sonde_vein_steps(map);
  sonde_json_begin_object(out, "vein");
  sonde_json_put_real(out, "length_mm", 1e3 * map->length_m, 6);
  sonde_json_put_real(out, "reach_mm", 1e3 * reach_m, 6);
  sonde_json_put_real(out, "tilt_deg", 180 / SONDE_PI * exam->plan->criteria.tilt_rad, 6);
  sonde_json_begin_list(out, "segments");
  for (uint32_t i = 0; i < map->segment_count && map->segment[i].vein_count == 0; ++i) {
    double from_m, to_m;
    sonde_vein_segment_ends(map, i, &from_m, &to_m);
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "id", map->segment[i].name);
    sonde_json_put_text(out, "title", sonde_segment_title(map->segment[i].name));
    put_stretch(out, "mm", from_m, to_m);
    sonde_json_end(out);
  }
  sonde_json_end(out);

  // Planned and examined stretches, in the steps that the judge counts.
  for (uint32_t i = 0; i < exam->plan->count; ++i) {
    double at_m = exam->plan->point[i].course_m;
    sonde_vein_mark(map, planned, at_m - reach_m, at_m + reach_m);
  }
  for (uint32_t i = 0; i < exam->press_count; ++i) {
    double at_m = exam->presses[i].along_m;
    if (sonde_press_is_valid(exam->presses[i].result) && isfinite(at_m))
      sonde_vein_mark(map, examined, at_m - cover_m, at_m + cover_m);
  }
  put_steps(out, "planned", planned, steps);
  put_steps(out, "examined", examined, steps);
  sonde_vein_run gap = sonde_vein_longest_gap(planned, examined, steps);
  if (gap.to > gap.from) put_stretch(out, "gap", gap.from * JUDGE_BIN_M, gap.to * JUDGE_BIN_M);

  // Where the case has a clot in the femoral vein.
  double from_m = 0, to_m = map->length_m;
  bool clot = patient->pathology.thrombus_fraction > 0;
  if (clot && !patient->extent.whole)
    clot = !sonde_station_find(&patient->extent.from, map, &from_m, NULL) &&
           !sonde_station_find(&patient->extent.to, map, &to_m, NULL);
  if (clot) put_stretch(out, "clot", fmin(from_m, to_m), fmax(from_m, to_m));
  sonde_json_end(out);
}

// ---- traces -------------------------------------------------------------------------------------

// Force and area of the vein over time: at most 900 points, each with the greatest force and the
// least area of its samples, so that every peak stays. fmax() and fmin() leave NaN out.
static void put_traces(sonde_json_out *out, const sonde_exam_report *exam) {
  enum { POINTS = 900, TIME = 0, FORCE = 1, VEIN = 2 };
  static const char *const KEYS[] = {"time_s", "force_n", "vein"};
  uint32_t count = exam->sample_count, per = (count + POINTS - 1) / POINTS;
  SONDE_ASSERT(count == 0 || exam->samples);
  sonde_json_begin_object(out, "traces");
  for (int k = TIME; k <= VEIN; ++k) {
    sonde_json_begin_list(out, KEYS[k]);
    for (uint32_t from = 0; from < count; from += per) {
      uint32_t end = from + per < count ? from + per : count;
      double value = (double)NAN;
      if (k == TIME) value = 0.5 * (exam->samples[from].time_s + exam->samples[end - 1].time_s);
      for (uint32_t i = from; i < end && k != TIME; ++i)
        value = k == FORCE ? fmax(value, exam->samples[i].force_n)
                           : fmin(value, exam->samples[i].vein_ratio);
      sonde_json_put_real(out, NULL, value, k == TIME ? 7 : 5);
    }
    sonde_json_end(out);
  }
  sonde_json_end(out);
}

// ---- earlier exams ------------------------------------------------------------------------------

// This exam and the trainee's earlier ones, newest first, and the learning curve through them.
static sonde_status put_history(sonde_json_out *out, const sonde_exam_report *exam,
                                sonde_error *error) {
  SONDE_ASSERT(exam->earlier_count == 0 || exam->earlier);
  sonde_log_entry *entries = SONDE_NEW(sonde_log_entry, (size_t)exam->earlier_count + 1);
  sonde_learning_point *points = SONDE_NEW(sonde_learning_point, (size_t)exam->earlier_count + 1);
  sonde_status status = entries && points ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    sonde_score_note note = exam->note;
    if (!note.date) note.date = "";
    entries[0] = sonde_log_entry_make(exam->patient, exam->score, &note);
    entries[0].interrupted = exam->interrupted;
    uint32_t count = 1;
    for (uint32_t i = 0; i < exam->earlier_count; ++i) {
      const sonde_log_entry *e = &exam->earlier[i];
      bool later = entries[0].date[0] && strcmp(e->date, entries[0].date) > 0;
      if (strcmp(e->id, entries[0].id) != 0 && !later) entries[count++] = *e;
    }
    sonde_json_begin_list(out, "exams");
    for (const sonde_log_entry *e = entries; e < entries + count; ++e) {
      const sonde_named figures[] = {{"score", e->score},
                                     {"coverage", e->metrics.coverage},
                                     {"valid_share", e->metrics.valid_share},
                                     {"time_s", e->metrics.time_s}};
      sonde_json_begin_object(out, NULL);
      sonde_json_put_text(out, "title", e->case_title);
      sonde_json_put_text(out, "date", e->date);
      sonde_json_put_bool(out, "same_patient", strcmp(e->case_id, exam->patient->id) == 0);
      sonde_json_put_bool(out, "interrupted", e->interrupted);
      sonde_json_put_bool(out, "passed", e->passed);
      sonde_json_put_bool(out, "correct", e->correct);
      sonde_put_named(out, figures, SONDE_COUNT_OF(figures));
      sonde_json_end(out);
    }
    sonde_json_end(out);

    uint32_t finished = sonde_learning_curve(entries, count, 0, points);
    sonde_json_begin_list(out, "curve");
    for (uint32_t i = 0; i < finished; ++i) {
      sonde_json_begin_object(out, NULL);
      sonde_json_put_integer(out, "number", points[i].number);
      sonde_json_put_real(out, "score", points[i].score, 6);
      sonde_json_put_real(out, "median", points[i].median, 6);
      sonde_json_put_bool(out, "passed", points[i].passed);
      sonde_json_end(out);
    }
    sonde_json_end(out);
  }
  sonde_free(entries);
  sonde_free(points);
  return status;
}

// ---- the whole ----------------------------------------------------------------------------------

static sonde_status check(const sonde_exam_report *r, sonde_error *error) {
  enum { LARGEST = 2048 };
  if (!r->patient || !r->map || !r->plan || !r->score)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "report of an exam; expected its patient, map, plan and score");
  if (r->map->point_count < 2 || !(r->map->length_m > 0) || r->plan->count > SONDE_PLAN_POINTS)
    return sonde_fail(error, SONDE_ARGUMENT, "report of an exam; expected a vein and its plan");
  for (uint32_t i = 0; i < r->picture_count; ++i) {
    const sonde_exam_picture *p = &r->pictures[i];
    if (p->press >= r->press_count)
      return sonde_fail(error, SONDE_ARGUMENT, "picture %u of press %u; there are %u presses", i,
                        p->press, r->press_count);
    if (p->before.width > LARGEST || p->before.height > LARGEST || p->peak.width > LARGEST ||
        p->peak.height > LARGEST)
      return sonde_fail(error, SONDE_ARGUMENT, "picture %u; expected at most %d pixels a side", i,
                        LARGEST);
  }
  return SONDE_OK;
}

sonde_status sonde_exam_report_json(const sonde_exam_report *exam, char **text, size_t *length,
                                    sonde_error *error) {
  SONDE_ASSERT(exam && text && length);
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  *text = NULL;
  sonde_status status = check(exam, error);
  if (!status) status = sonde_file_in_memory(&out.file, error);
  if (status) return status;

  // The patient and the protocol.
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_text(&out, "kind", "exam");
  sonde_json_put_text(&out, "program", sonde_version());
  sonde_json_put_bool(&out, "interrupted", exam->interrupted);
  sonde_put_text_or_null(&out, "recording", exam->recording);
  sonde_json_begin_object(&out, "patient");
  sonde_json_put_text(&out, "history", exam->patient->history);
  sonde_json_put_text(&out, "note", exam->patient->note);
  sonde_json_put_text(&out, "diagnosis", exam->patient->diagnosis);
  sonde_json_end(&out);
  if (exam->protocol) {
    sonde_json_begin_object(&out, "protocol");
    sonde_json_put_text(&out, "title", exam->protocol->title);
    sonde_json_put_text(&out, "text", exam->protocol->text);
    sonde_json_end(&out);
  }

  // The result, and the score's parts in words.
  sonde_put_result(&out, exam);
  sonde_score_part part[SONDE_SCORE_PARTS];
  sonde_score_explain(exam->score, exam->plan, exam->presses, exam->press_count, part);
  sonde_json_begin_list(&out, "parts");
  for (int k = 0; k < SONDE_SCORE_PARTS; ++k) {
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "title", part[k].title);
    sonde_json_put_text(&out, "meaning", part[k].meaning);
    sonde_json_put_real(&out, "points", part[k].points, 9);
    sonde_json_put_real(&out, "of", part[k].of, 9);
    sonde_json_put_text(&out, "lost", part[k].lost);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);

  // Comments of who watched.
  SONDE_ASSERT(exam->comment_count == 0 || exam->comments);
  sonde_json_begin_list(&out, "comments");
  for (uint32_t i = 0; i < exam->comment_count; ++i) {
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_real(&out, "time_s", exam->comments[i].time_s, 9);
    sonde_json_put_text(&out, "author", exam->comments[i].author);
    sonde_json_put_text(&out, "text", exam->comments[i].text);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);

  put_vein(&out, exam);
  put_traces(&out, exam);
  status = sonde_put_pictures(&out, exam, error);
  if (!status && exam->worksheet)
    status = sonde_worksheet_put(&out, "worksheet", exam->worksheet, exam->plan, exam->map,
                                 exam->verdict, true, error);
  if (!status) status = put_history(&out, exam, error);
  if (status) {
    sonde_file_discard(out.file);
    return status;
  }
  sonde_json_end(&out);
  return sonde_file_take(out.file, text, length, error);
}

sonde_status sonde_exam_report_write(const sonde_exam_report *report, const char *path,
                                     sonde_error *error) {
  SONDE_ASSERT(report && path);
  char *json = NULL, title[160];
  size_t length = 0;
  sonde_status status = sonde_exam_report_json(report, &json, &length, error);
  if (!status) {
    snprintf(title, sizeof title, "%.120s \u2013 examination report", report->patient->title);
    status = sonde_report_write(path, title, json, length, error);
  }
  sonde_free(json);
  return status;
}
