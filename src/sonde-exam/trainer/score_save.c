// An exam's result as JSON, its presses as CSV.
#include "trainer/report.h"

static const double DEGREES = 180 / SONDE_PI;

void sonde_put_named(sonde_json_out *out, const sonde_named *list, size_t count) {
  for (size_t i = 0; i < count; ++i) sonde_json_put_real(out, list[i].name, list[i].value, 9);
}

void sonde_put_text_or_null(sonde_json_out *out, const char *key, const char *text) {
  if (text)
    sonde_json_put_text(out, key, text);
  else
    sonde_json_put_real(out, key, (double)NAN, 0); // null
}

// Exam, score, what was lost, and metrics.
static void put_score(sonde_json_out *out, const sonde_exam_report *exam) {
  const sonde_score *s = exam->score;
  const sonde_score_note *note = &exam->note;
  sonde_json_begin_object(out, "exam");
  const char *const about[][2] = {
      {"exam", note->exam},
      {"date", note->date},
      {"trainee", note->trainee},
      {"case", exam->patient->id},
      {"title", exam->patient->title},
      {"protocol", note->protocol},
      {"guidance", note->guidance},
      {"tissue", note->tissue && note->tissue[0] ? note->tissue : "springs"}};
  for (size_t i = 0; i < SONDE_COUNT_OF(about); ++i)
    sonde_put_text_or_null(out, about[i][0], about[i][1]);
  sonde_json_end(out);

  sonde_json_begin_object(out, "score");
  const sonde_named figures[] = {{"version", SONDE_SCORE_VERSION},
                                 {"score", s->score},
#define SONDE_SCORE_NAMED(name, weight, title, what) {#name, s->name},
                                 SONDE_SCORE_LIST(SONDE_SCORE_NAMED)};
#undef SONDE_SCORE_NAMED
  sonde_put_named(out, figures, SONDE_COUNT_OF(figures));
  sonde_json_put_bool(out, "passed", s->passed);
  sonde_json_put_bool(out, "correct", s->correct);
  sonde_json_put_bool(out, "answered", s->answered);
  sonde_json_put_bool(out, "called_thrombosis", s->called_thrombosis);
  sonde_json_put_bool(out, "thrombosis", s->thrombosis);
  sonde_json_put_text(out, "diagnosis", s->asked);
  sonde_json_put_text(out, "truth", s->truth);
  sonde_json_put_text(out, "summary", s->summary);
  sonde_json_end(out);

  sonde_score_part part[SONDE_SCORE_PARTS];
  sonde_score_explain(s, exam->plan, exam->presses, exam->press_count, part);
  sonde_json_begin_object(out, "lost");
  for (int k = 0; k < SONDE_SCORE_PARTS; ++k) sonde_json_put_text(out, part[k].name, part[k].lost);
  sonde_json_end(out);

  const sonde_metrics *m = &s->metrics;
  const sonde_named before[] = {{"coverage", m->coverage},
                                {"vein_coverage", m->vein_coverage},
                                {"largest_gap_mm", 1e3 * m->gap_m},
                                {"places", m->points},
                                {"places_done", m->points_done}};
  const sonde_named after[] = {{"completeness", m->completeness},
                               {"valid_share", m->valid_share},
                               {"force_peak_n", m->force_peak_n},
                               {"force_p95_n", m->force_p95_n},
                               {"time_s", m->time_s},
                               {"contact_s", m->contact_s},
                               {"path_mm", 1e3 * m->path_m},
                               {"smoothness_ldlj", m->smoothness},
                               {"hints", m->hints},
                               {"taken_off", m->restores}};
  sonde_json_begin_object(out, "metrics");
  sonde_put_named(out, before, SONDE_COUNT_OF(before));
  for (int k = 0; k < SONDE_PRESS_RESULTS; ++k)
    sonde_json_put_integer(out, sonde_press_result_name((sonde_press_result)k), m->presses[k]);
  sonde_put_named(out, after, SONDE_COUNT_OF(after));
  sonde_json_end(out);
}

static const char *segment_of(const sonde_vein_map *map, const sonde_compression *p) {
  return p->segment < map->segment_count ? map->segment[p->segment].name : "";
}

void sonde_put_result(sonde_json_out *out, const sonde_exam_report *exam) {
  SONDE_ASSERT(exam->score->segment_count <= SONDE_SEGMENTS);
  put_score(out, exam);

  sonde_json_begin_list(out, "segments");
  for (uint32_t i = 0; i < exam->score->segment_count; ++i) {
    const sonde_segment_verdict *v = &exam->score->segment[i];
    if (v->kind != SONDE_SEGMENT_MAIN && !v->needed) continue;
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "id", v->name);
    sonde_json_put_text(out, "title", sonde_segment_title(v->name));
    sonde_json_put_real(out, "from_mm", 1e3 * v->from_m, 9);
    sonde_json_put_real(out, "to_mm", 1e3 * v->to_m, 9);
    sonde_json_put_bool(out, "needed", v->needed);
    sonde_json_put_integer(out, "places", v->points);
    sonde_json_put_integer(out, "places_done", v->done);
    sonde_json_put_text(out, "decision", sonde_decision_name(v->decision));
    sonde_json_put_text(out, "truth", sonde_decision_name(v->truth));
    sonde_json_put_bool(out, "correct", v->correct);
    sonde_json_put_bool(out, "supported", v->supported);
    sonde_json_end(out);
  }
  sonde_json_end(out);

  sonde_json_begin_list(out, "places");
  for (uint32_t i = 0; i < exam->plan->count; ++i) {
    const sonde_plan_point *p = &exam->plan->point[i];
    const sonde_named figures[] = {{"along_mm", 1e3 * p->course_m},
                                   {"vein_depth_mm", 1e3 * p->at.depth_m},
                                   {"closes_n", p->target.closes_n},
                                   {"firm_n", p->target.firm_n},
                                   {"limit_n", p->target.limit_n}};
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "title", p->title);
    sonde_json_put_text(out, "position", sonde_position_key(p->position));
    sonde_put_named(out, figures, SONDE_COUNT_OF(figures));
    sonde_json_put_bool(out, "done",
                        sonde_place_is_done(exam->plan, i, exam->presses, exam->press_count));
    sonde_json_end(out);
  }
  sonde_json_end(out);

  sonde_json_begin_list(out, "presses");
  for (uint32_t i = 0; i < exam->press_count; ++i) {
    const sonde_compression *p = &exam->presses[i];
    bool placed = p->place < exam->plan->count;
    double limit_n = placed ? exam->plan->point[p->place].target.limit_n : (double)NAN;
    const sonde_named figures[] = {{"start_s", p->start_s},
                                   {"peak_s", p->peak_s},
                                   {"end_s", p->end_s},
                                   {"z_mm", 1e3 * p->z_m},
                                   {"along_mm", 1e3 * p->along_m},
                                   {"force_peak_n", p->force_peak_n},
                                   {"limit_n", limit_n},
                                   {"vein", p->vein_ratio},
                                   {"artery_least", p->artery_least},
                                   {"tilt_deg", DEGREES * p->tilt_rad}};
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "result", sonde_press_result_name(p->result));
    sonde_json_put_text(out, "segment", segment_of(exam->map, p));
    sonde_put_named(out, figures, SONDE_COUNT_OF(figures));
    sonde_json_end(out);
  }
  sonde_json_end(out);
}

sonde_status sonde_score_save(const sonde_judge *judge, const sonde_case *truth,
                              const sonde_score *score, const sonde_score_note *note,
                              const sonde_worksheet *sheet, const sonde_sheet_verdict *verdict,
                              const char *json_path, const char *csv_path, sonde_error *error) {
  SONDE_ASSERT(judge && truth && score && note && (!sheet || verdict));
  sonde_status status = SONDE_OK;
  if (json_path) {
    sonde_json_out out = {.layout = SONDE_JSON_LINES};
    sonde_exam_report exam = {.patient = truth,
                              .map = &judge->first,
                              .plan = &judge->plan,
                              .score = score,
                              .note = *note,
                              .presses = judge->press,
                              .press_count = judge->press_count};
    status = sonde_file_create(json_path, &out.file, error);
    if (status) return status;
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_integer(&out, "sonde_exam", 1);
    sonde_put_result(&out, &exam);
    if (sheet)
      (void)sonde_worksheet_put(&out, "worksheet", sheet, &judge->plan, &judge->first, verdict,
                                false, NULL);
    sonde_json_end(&out);
    sonde_file_printf(out.file, "\n");
    status = sonde_file_commit(out.file, error);
  }
  if (status || !csv_path) return status;
  sonde_file *file;
  status = sonde_file_create(csv_path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "press,result,segment,start_s,peak_s,end_s,z_mm,force_peak_n,vein_ratio,"
                          "artery_ratio,artery_least,tilt_deg\n");
  for (uint32_t i = 0; i < judge->press_count; ++i) {
    const sonde_compression *p = &judge->press[i];
    const double value[] = {p->start_s,      p->peak_s,       p->end_s,
                            1e3 * p->z_m,    p->force_peak_n, p->vein_ratio,
                            p->artery_ratio, p->artery_least, DEGREES * p->tilt_rad};
    sonde_file_printf(file, "%u,%s,%s", i + 1, sonde_press_result_name(p->result),
                      segment_of(&judge->first, p));
    for (size_t k = 0; k < SONDE_COUNT_OF(value); ++k)
      sonde_file_printf(file, isfinite(value[k]) ? ",%.9g" : ",", value[k]);
    sonde_file_printf(file, "\n");
  }
  return sonde_file_commit(file, error);
}
