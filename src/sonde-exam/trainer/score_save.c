// An exam's result as JSON, its presses as CSV.
// open_map, key: a member of a JSON object.
// put_note, put_metrics, put_score, put_lost, put_segments, put_places, put_presses: parts of it.
#include "trainer/judge.h"

static const double DEG = 180 / SONDE_PI;

static void key(sonde_file *file, bool *first, const char *name) {
  sonde_file_printf(file, "%s\n    \"%s\": ", *first ? "" : ",", name);
  *first = false;
}

static void real(sonde_file *file, bool *first, const char *name, double value) {
  key(file, first, name);
  sonde_json_real(file, value);
}

static void text(sonde_file *file, bool *first, const char *name, const char *value) {
  key(file, first, name);
  if (value)
    sonde_json_text(file, value);
  else
    sonde_file_printf(file, "null");
}

static void boolean(sonde_file *file, bool *first, const char *name, bool value) {
  key(file, first, name);
  sonde_file_printf(file, value ? "true" : "false");
}

static void put_note(sonde_file *file, const sonde_case *truth, const sonde_score_note *note) {
  bool first = true;
  text(file, &first, "exam", note->exam);
  text(file, &first, "date", note->date);
  text(file, &first, "trainee", note->trainee);
  text(file, &first, "case", truth->id);
  text(file, &first, "title", truth->title);
  text(file, &first, "protocol", note->protocol);
  text(file, &first, "guidance", note->guidance);
}

static void put_metrics(sonde_file *file, const sonde_metrics *m) {
  bool first = true;
  real(file, &first, "coverage", m->coverage);
  real(file, &first, "vein_coverage", m->vein_coverage);
  real(file, &first, "largest_gap_mm", 1e3 * m->gap_m);
  real(file, &first, "places", m->points);
  real(file, &first, "places_done", m->points_done);
  for (int k = 0; k < SONDE_PRESS_RESULTS; ++k)
    real(file, &first, sonde_press_result_name((sonde_press_result)k), m->presses[k]);
  real(file, &first, "completeness", m->completeness);
  real(file, &first, "valid_share", m->valid_share);
  real(file, &first, "force_peak_n", m->force_peak_n);
  real(file, &first, "force_p95_n", m->force_p95_n);
  real(file, &first, "time_s", m->time_s);
  real(file, &first, "contact_s", m->contact_s);
  real(file, &first, "path_mm", 1e3 * m->path_m);
  real(file, &first, "smoothness_ldlj", m->smoothness);
  real(file, &first, "hints", m->hints);
  real(file, &first, "taken_off", m->restores);
}

static void put_score(sonde_file *file, const sonde_score *s) {
  bool first = true;
  real(file, &first, "version", SONDE_SCORE_VERSION);
  real(file, &first, "score", s->score);
#define SONDE_SCORE_PUT(name, weight, title, what) real(file, &first, #name, s->name);
  SONDE_SCORE_LIST(SONDE_SCORE_PUT)
#undef SONDE_SCORE_PUT
  boolean(file, &first, "passed", s->passed);
  boolean(file, &first, "correct", s->correct);
  boolean(file, &first, "answered", s->answered);
  boolean(file, &first, "called_thrombosis", s->called_thrombosis);
  boolean(file, &first, "thrombosis", s->thrombosis);
  text(file, &first, "diagnosis", s->asked);
  text(file, &first, "truth", s->truth);
  text(file, &first, "summary", s->summary);
}

static void put_lost(sonde_file *file, const sonde_judge *judge, const sonde_score *s) {
  sonde_score_part part[SONDE_SCORE_PARTS];
  sonde_score_explain(s, &judge->plan, judge->press, judge->press_count, part);
  bool first = true;
  for (int k = 0; k < SONDE_SCORE_PARTS; ++k) text(file, &first, part[k].name, part[k].lost);
}

static void put_places(sonde_file *file, const sonde_judge *judge) {
  for (uint32_t i = 0; i < judge->plan.count; ++i) {
    const sonde_plan_point *p = &judge->plan.point[i];
    sonde_file_printf(file, "%s\n    {\"title\": ", i ? "," : "");
    sonde_json_text(file, p->title);
    const double value[] = {1e3 * p->at.along_m, 1e3 * p->at.depth_m, p->target.closes_n,
                            p->target.firm_n, p->target.limit_n};
    static const char *const KEYS[] = {"along_mm", "vein_depth_mm", "closes_n", "firm_n",
                                       "limit_n"};
    for (size_t k = 0; k < SONDE_COUNT_OF(KEYS); ++k) {
      sonde_file_printf(file, ", \"%s\": ", KEYS[k]);
      sonde_json_real(file, value[k]);
    }
    sonde_file_printf(file, "}");
  }
}

static void put_segments(sonde_file *file, const sonde_score *s) {
  for (uint32_t i = 0; i < s->segment_count; ++i) {
    const sonde_segment_verdict *v = &s->segment[i];
    sonde_file_printf(file, "%s\n    {\"id\": \"%s\", \"from_mm\": %.9g, \"to_mm\": %.9g, ",
                      i ? "," : "", v->name, 1e3 * v->from_m, 1e3 * v->to_m);
    sonde_file_printf(file, "\"needed\": %s, \"places\": %u, \"places_done\": %u, ",
                      v->needed ? "true" : "false", v->points, v->done);
    sonde_file_printf(file,
                      "\"decision\": \"%s\", \"truth\": \"%s\", \"correct\": %s, "
                      "\"supported\": %s}",
                      sonde_decision_name(v->decision), sonde_decision_name(v->truth),
                      v->correct ? "true" : "false", v->supported ? "true" : "false");
  }
}

static const char *segment_of(const sonde_judge *judge, const sonde_compression *p) {
  return p->segment < judge->map.segment_count ? judge->map.segment[p->segment].name : "";
}

static void put_presses(sonde_file *file, const sonde_judge *judge) {
  static const char *const KEYS[] = {"start_s",      "peak_s", "end_s",        "z_mm",
                                     "force_peak_n", "vein",   "artery_least", "tilt_deg"};
  for (uint32_t i = 0; i < judge->press_count; ++i) {
    const sonde_compression *p = &judge->press[i];
    const double value[] = {p->start_s,      p->peak_s,     p->end_s,        1e3 * p->z_m,
                            p->force_peak_n, p->vein_ratio, p->artery_least, DEG * p->tilt_rad};
    sonde_file_printf(file, "%s\n    {\"result\": \"%s\", \"segment\": \"%s\"", i ? "," : "",
                      sonde_press_result_name(p->result), segment_of(judge, p));
    for (size_t k = 0; k < SONDE_COUNT_OF(KEYS); ++k) {
      sonde_file_printf(file, ", \"%s\": ", KEYS[k]);
      sonde_json_real(file, value[k]);
    }
    sonde_file_printf(file, "}");
  }
}

static sonde_status save_json(const sonde_judge *judge, const sonde_case *truth,
                              const sonde_score *score, const sonde_score_note *note,
                              const char *path, sonde_error *error) {
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "{\n  \"sonde_exam\": 1,\n  \"exam\": {");
  put_note(file, truth, note);
  sonde_file_printf(file, "\n  },\n  \"score\": {");
  put_score(file, score);
  sonde_file_printf(file, "\n  },\n  \"lost\": {");
  put_lost(file, judge, score);
  sonde_file_printf(file, "\n  },\n  \"metrics\": {");
  put_metrics(file, &score->metrics);
  sonde_file_printf(file, "\n  },\n  \"segments\": [");
  put_segments(file, score);
  sonde_file_printf(file, "\n  ],\n  \"places\": [");
  put_places(file, judge);
  sonde_file_printf(file, "\n  ],\n  \"presses\": [");
  put_presses(file, judge);
  sonde_file_printf(file, "\n  ]\n}\n");
  return sonde_file_commit(file, error);
}

static void csv_real(sonde_file *file, double value) {
  if (isfinite(value))
    sonde_file_printf(file, ",%.9g", value);
  else
    sonde_file_printf(file, ",");
}

static sonde_status save_csv(const sonde_judge *judge, const char *path, sonde_error *error) {
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "press,result,segment,start_s,peak_s,end_s,z_mm,force_peak_n,vein_ratio,"
                          "artery_ratio,artery_least,tilt_deg\n");
  for (uint32_t i = 0; i < judge->press_count; ++i) {
    const sonde_compression *p = &judge->press[i];
    const double value[] = {p->start_s,      p->peak_s,       p->end_s,
                            1e3 * p->z_m,    p->force_peak_n, p->vein_ratio,
                            p->artery_ratio, p->artery_least, DEG * p->tilt_rad};
    sonde_file_printf(file, "%u,%s,%s", i + 1, sonde_press_result_name(p->result),
                      segment_of(judge, p));
    for (size_t k = 0; k < SONDE_COUNT_OF(value); ++k) csv_real(file, value[k]);
    sonde_file_printf(file, "\n");
  }
  return sonde_file_commit(file, error);
}

sonde_status sonde_score_save(const sonde_judge *judge, const sonde_case *truth,
                              const sonde_score *score, const sonde_score_note *note,
                              const char *json_path, const char *csv_path, sonde_error *error) {
  SONDE_ASSERT(judge && truth && score && note);
  sonde_status status = SONDE_OK;
  if (json_path) status = save_json(judge, truth, score, note, json_path, error);
  if (!status && csv_path) status = save_csv(judge, csv_path, error);
  return status;
}
