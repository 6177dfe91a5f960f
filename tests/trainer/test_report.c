// The report of an exam: its JSON holds everything once, agrees with the judge, keeps foreign texts
// as data, and is right with nothing and with much. With a directory as argument it only writes
// examples there, which tests/web/exam_report_test.mjs opens in a browser.
#include "base/random.h"
#include "trainer/report.h"
#include "trainer_test.h"

#include <png.h>
#include <stdio.h>
#include <unistd.h>

#define NASTY "<b>&\"'\x01\xff</script><script>alert(1)</script>"
enum { PRESSES = 300, SAMPLES = 5000, EARLIER = 14, SIDE = 512, POINTS = 31, PAIRS = 12 };

static struct {
  sonde_case patient;
  sonde_exam_protocol protocol;
  sonde_vein_map map;
  sonde_plan plan;
  sonde_score score;
  sonde_compression presses[PRESSES];
  sonde_exam_picture pictures[PAIRS];
  sonde_exam_sample samples[SAMPLES];
  sonde_log_entry earlier[EARLIER];
  sonde_comment comments[2];
  uint8_t open[SIDE * SIDE], closed[SIDE * SIDE];
} made;

// ---- a synthetic exam ---------------------------------------------------------------------------

static void make_map(void) {
  static const char *const NAMES[] = {"common_femoral", "femoral_proximal", "femoral_mid",
                                      "femoral_distal", "popliteal"};
  static const double TO[] = {0.04, 0.12, 0.20, 0.26, 0.30};
  made.map = (sonde_vein_map){.segment_count = 5, .point_count = POINTS, .length_m = 0.3};
  for (uint32_t i = 0; i < POINTS; ++i)
    made.map.point[i] = (sonde_vein_point){.along_m = 0.01 * i,
                                           .z_m = 0.4 - 0.01 * i,
                                           .vein_m = {0, 0, 0.4 - 0.01 * i},
                                           .skin_m = {0.03, 0, 0.4 - 0.01 * i},
                                           .normal = {1, 0, 0},
                                           .across = {0, 1, 0},
                                           .radius_m = 0.004,
                                           .depth_m = 0.03};
  for (uint32_t i = 0; i < 5; ++i) {
    made.map.segment[i].from_m = 0.4 - TO[i];
    made.map.segment[i].to_m = 0.4 - (i ? TO[i - 1] : 0);
    snprintf(made.map.segment[i].name, sizeof made.map.segment[i].name, "%s", NAMES[i]);
  }
}

static void make_plan(void) {
  made.plan = (sonde_plan){.criteria = sonde_criteria_default(), .count = 15};
  for (uint32_t i = 0; i < made.plan.count; ++i) {
    sonde_plan_point *p = &made.plan.point[i];
    p->at = sonde_vein_at(&made.map, 0.01 + 0.02 * i);
    p->segment = sonde_vein_segment_at(&made.map, p->at.z_m);
    snprintf(p->title, sizeof p->title, "%u cm below the groin", 1 + 2 * i);
    p->target = sonde_force_target_make(14 + 0.5 * i);
  }
  made.protocol = (sonde_exam_protocol){.id = "extended", .title = "Extended compression"};
  snprintf(made.protocol.text, sizeof made.protocol.text,
           "Compress the vein every two centimetres from the groin to the knee.");
}

static void make_case(void) {
  made.patient = sonde_case_default();
  snprintf(made.patient.id, sizeof made.patient.id, "isolated-femoral");
  snprintf(made.patient.title, sizeof made.patient.title, "A swollen calf after a long flight");
  snprintf(made.patient.history, sizeof made.patient.history,
           "Woman, 54 years. Three days of pain and swelling of the right calf after a flight of "
           "eleven hours. No earlier thrombosis.\nWells score 3.");
  snprintf(made.patient.note, sizeof made.patient.note,
           "A clot confined to the femoral vein is missed by protocols that look at the groin and "
           "the knee only. Compress in small steps along the whole thigh when the suspicion is "
           "high.");
  snprintf(made.patient.diagnosis, sizeof made.patient.diagnosis,
           "Acute thrombosis of the femoral vein, middle third");
  made.patient.pathology.thrombus_fraction = 0.9;
  made.patient.extent = (sonde_case_extent){.from = {.shift_m = 0.125}, .to = {.shift_m = 0.175}};
  made.patient.thrombosis = true;
}

static void make_presses(uint32_t count) {
  for (uint32_t i = 0; i < count; ++i) {
    double along = fmod(0.012 + 0.0193 * i, 0.23) + 0.002 * sonde_random_normal(1, i);
    bool clot = along > 0.125 && along < 0.175;
    double luck = sonde_random_uniform(2, i);
    sonde_press_result result = luck < 0.68   ? clot ? SONDE_PRESS_OPEN : SONDE_PRESS_COMPLETE
                                : luck < 0.80 ? SONDE_PRESS_INSUFFICIENT
                                : luck < 0.90 ? SONDE_PRESS_TOO_HARD
                                              : SONDE_PRESS_OFF_AXIS;
    double force = result == SONDE_PRESS_TOO_HARD       ? 31
                   : result == SONDE_PRESS_INSUFFICIENT ? 5
                                                        : 13;
    sonde_compression *p = &made.presses[i];
    *p = (sonde_compression){.start_s = 8 + 240.0 * i / count,
                             .result = result,
                             .point = SONDE_PLAN_POINTS,
                             .along_m = fmax(along, 0),
                             .force_peak_n = force * (1 + 0.12 * sonde_random_normal(3, i)),
                             .vein_ratio = result == SONDE_PRESS_COMPLETE ? 0.03
                                           : clot                         ? 0.88
                                                                          : 0.42,
                             .artery_ratio = 0.86,
                             .artery_least = 0.84,
                             .tilt_rad = result == SONDE_PRESS_OFF_AXIS ? 0.55 : 0.12};
    p->peak_s = p->start_s + 1.2 * fmin(1, 60.0 / count);
    p->end_s = p->start_s + 2.4 * fmin(1, 60.0 / count);
    p->z_m = 0.4 - p->along_m;
    p->segment = sonde_vein_segment_at(&made.map, p->z_m);
    bool valid = result == SONDE_PRESS_COMPLETE || result == SONDE_PRESS_OPEN;
    for (uint32_t k = 0; k < made.plan.count && valid; ++k)
      if (fabs(made.plan.point[k].at.along_m - p->along_m) <= made.plan.criteria.reach_m)
        p->examined |= (uint64_t)1 << k;
    p->place = sonde_plan_nearest(&made.plan, 0, sonde_vein_at(&made.map, p->along_m).skin_m);
  }
  if (count > 5) made.presses[5].along_m = made.presses[5].vein_ratio = NAN;
  if (count > 5) made.presses[5].segment = SONDE_SEGMENTS;
}

static void make_score(uint32_t presses, bool right) {
  sonde_score *s = &made.score;
  *s = (sonde_score){.segment_count = 5, .thrombosis = true, .answered = true};
  for (uint32_t i = 0; i < presses; ++i) s->metrics.presses[made.presses[i].result]++;
  s->metrics.press_count = presses;
  s->metrics.points = 15;
  s->metrics.points_done = presses ? 11 : 0;
  s->metrics.coverage = presses ? 0.78 : 0;
  s->metrics.vein_coverage = presses ? 0.76 : 0;
  s->metrics.gap_m = presses ? 0.06 : 0.3;
  s->metrics.completeness = presses ? 0.968 : NAN;
  s->metrics.valid_share = presses ? 0.7 : NAN;
  s->metrics.force_peak_n = presses ? 33.1 : 0;
  s->metrics.force_p95_n = presses ? 17.4 : NAN;
  s->metrics.time_s = 252;
  s->metrics.contact_s = presses ? 198 : 0;
  s->metrics.path_m = 1.84;
  s->metrics.smoothness = -11.2;
  s->decisions = right ? 0.8 : 0.6;
  s->coverage = s->metrics.coverage;
  s->technique = presses ? 0.7 : 0;
  s->force = presses ? 0.42 : 0;
  s->economy = presses ? 0.78 : 0;
  s->score = right ? 73.6 : 49;
  s->correct = s->passed = s->called_thrombosis = right;
  for (uint32_t i = 0; i < 5; ++i) {
    sonde_segment_verdict *v = &s->segment[i];
    memcpy(v->name, made.map.segment[i].name, sizeof v->name);
    v->needed = true;
    v->truth = i == 2 ? SONDE_DECISION_CLOT : SONDE_DECISION_COMPRESSIBLE;
    v->decision = i == 2 && !right ? SONDE_DECISION_COMPRESSIBLE
                  : i == 4         ? SONDE_DECISION_NONE
                                   : v->truth;
    v->correct = v->decision == v->truth;
    v->supported = presses && i != 3 && v->correct;
    v->points = 3;
    v->done = presses ? i == 4 ? 0 : 3 : 0;
  }
  snprintf(s->asked, sizeof s->asked, "%s",
           right ? "Deep vein thrombosis" : "No deep vein thrombosis where examined");
  snprintf(s->truth, sizeof s->truth, "%s", made.patient.diagnosis);
  snprintf(s->summary, sizeof s->summary, "%s. %.0f of 100 points; %u of 15 places examined.",
           right ? "Passed" : "Not passed: a clot was missed", s->score, s->metrics.points_done);
}

static void make_samples(uint32_t presses) {
  for (uint32_t i = 0; i < SAMPLES; ++i) {
    double t = 0.05 * i, force = 1.2 + 0.3 * sonde_random_normal(4, i), vein = 1;
    for (uint32_t k = 0; k < presses; ++k) {
      const sonde_compression *p = &made.presses[k];
      double share = 1 - fabs(t - p->peak_s) / (p->peak_s - p->start_s);
      if (share <= 0) continue;
      force += share * p->force_peak_n;
      vein = fmin(vein, 1 - share * (1 - p->vein_ratio)); // NaN: not in view
      if (isnan(p->vein_ratio)) vein = NAN;
    }
    made.samples[i] = (sonde_exam_sample){t, force, vein};
  }
}

// A dark vessel pair in speckle; the vein is flat in the second image.
static void make_images(void) {
  for (uint32_t y = 0; y < SIDE; ++y)
    for (uint32_t x = 0; x < SIDE; ++x) {
      double dx = x / 512.0 - 0.55, dy = y / 512.0 - 0.5, ax = x / 512.0 - 0.36;
      double speckle = 60 + 40 * sonde_random_uniform(5, (uint64_t)y * SIDE + x) - 40 * fabs(dy);
      bool artery = ax * ax + dy * dy < 0.006;
      bool open = dx * dx + dy * dy < 0.009, flat = dx * dx + 40 * dy * dy < 0.012;
      made.open[y * SIDE + x] = (uint8_t)(artery || open ? 8 : speckle);
      made.closed[y * SIDE + x] = (uint8_t)(artery || flat ? 8 : speckle);
    }
}

static sonde_image image_of(uint8_t *pixels) {
  return (sonde_image){
      .width = SIDE, .height = SIDE, .width_m = 0.05, .height_m = 0.05, .pixels = pixels};
}

static uint32_t make_pictures(uint32_t presses) {
  uint32_t chosen[PAIRS], count = sonde_exam_report_choose(made.presses, presses, PAIRS, chosen);
  for (uint32_t i = 0; i < count; ++i)
    made.pictures[i] = (sonde_exam_picture){chosen[i], image_of(made.open), image_of(made.closed)};
  return count;
}

static void make_earlier(void) {
  for (uint32_t i = 0; i < EARLIER; ++i) {
    sonde_log_entry *e = &made.earlier[i];
    *e = (sonde_log_entry){.score = 78 - 3.4 * i + 9 * sonde_random_normal(6, i)};
    e->score = fmin(fmax(e->score, 5), 97);
    e->passed = e->correct = e->score >= 70;
    e->metrics = (sonde_metrics){
        .coverage = 0.95 - 0.04 * i, .valid_share = 0.9 - 0.03 * i, .time_s = 220 + 20 * i};
    snprintf(e->id, sizeof e->id, "exam-%u", EARLIER - i);
    snprintf(e->case_id, sizeof e->case_id, i % 5 ? "case-%u" : "isolated-femoral", i % 4);
    snprintf(e->case_title, sizeof e->case_title,
             i % 5 ? "A painful thigh, number %u" : "A swollen calf after a long flight", i);
    sonde_log_date(1795000000 - 86400 * (int64_t)i, e->date);
  }
  made.earlier[3].interrupted = true;
}

static sonde_exam_report exam(uint32_t presses, bool right) {
  memset(&made, 0, sizeof made);
  make_map();
  make_plan();
  make_case();
  make_presses(presses);
  make_score(presses, right);
  make_samples(presses);
  make_images();
  make_earlier();
  return (sonde_exam_report){.patient = &made.patient,
                             .protocol = &made.protocol,
                             .map = &made.map,
                             .plan = &made.plan,
                             .score = &made.score,
                             .note = {.exam = "20261122-044000-anna",
                                      .trainee = "Anna Example",
                                      .protocol = "extended",
                                      .guidance = "hints on request",
                                      .date = "2026-11-22T04:40:00Z"},
                             .presses = made.presses,
                             .press_count = presses,
                             .pictures = made.pictures,
                             .picture_count = make_pictures(presses),
                             .samples = made.samples,
                             .sample_count = SAMPLES,
                             .earlier = made.earlier,
                             .earlier_count = EARLIER,
                             .recording = "exams/20261122-044000-anna.rec"};
}

static sonde_exam_report hostile(void) {
  sonde_exam_report r = exam(30, false);
  char longer[1020];
  for (size_t i = 0; i + 1 < sizeof longer; ++i) longer[i] = i % 90 == 89 ? ' ' : 'w';
  longer[sizeof longer - 1] = 0;
  snprintf(made.patient.title, sizeof made.patient.title, "%s", NASTY);
  snprintf(made.patient.id, sizeof made.patient.id, "%s", NASTY);
  snprintf(made.patient.history, sizeof made.patient.history, "%s %.900s", NASTY, longer);
  snprintf(made.patient.note, sizeof made.patient.note, "%s", longer);
  snprintf(made.protocol.title, sizeof made.protocol.title, "%s", NASTY);
  snprintf(made.protocol.text, sizeof made.protocol.text, "%s", NASTY);
  snprintf(made.score.asked, sizeof made.score.asked, "%s", NASTY);
  snprintf(made.score.truth, sizeof made.score.truth, "%s", NASTY);
  snprintf(made.score.summary, sizeof made.score.summary, "%s", NASTY);
  for (uint32_t i = 0; i < 5; ++i) {
    snprintf(made.score.segment[i].name, sizeof made.score.segment[i].name, "%.30s", NASTY);
    snprintf(made.map.segment[i].name, sizeof made.map.segment[i].name, "%.30s", NASTY);
  }
  snprintf(made.plan.point[13].title, sizeof made.plan.point[13].title, "%s", NASTY);
  snprintf(made.earlier[0].case_title, sizeof made.earlier[0].case_title, "%s", NASTY);
  snprintf(made.earlier[1].date, sizeof made.earlier[1].date, "%.20s", NASTY);
  r.note = (sonde_score_note){NASTY, NASTY, NASTY, NASTY, NASTY, NASTY};
  r.recording = NASTY;
  snprintf(made.comments[0].author, sizeof made.comments[0].author, "%.60s", NASTY);
  snprintf(made.comments[0].text, sizeof made.comments[0].text, "%s", NASTY);
  r.comments = made.comments;
  r.comment_count = 1;
  return r;
}

// ---- reading the page ---------------------------------------------------------------------------

static char *write_page(const sonde_exam_report *report) {
  char path[64], *bytes = NULL;
  size_t count = 0;
  sonde_error error = {0};
  snprintf(path, sizeof path, "exam_%d.html", (int)getpid());
  if (sonde_exam_report_write(report, path, &error)) fail_msg("%s", error.message);
  assert_int_equal(sonde_file_load(path, &bytes, &count, NULL), SONDE_OK);
  assert_int_equal(strlen(bytes), count);
  unlink(path);
  return bytes;
}

// The data that the page of a report holds.
static sonde_json *data_of(const sonde_exam_report *report) {
  static const char BEGIN[] = "<script type=\"application/json\" id=\"report\">";
  char *page = write_page(report);
  const char *begin = strstr(page, BEGIN), *end = begin ? strstr(begin, "</script>") : NULL;
  assert_non_null(end);
  begin += sizeof BEGIN - 1;
  sonde_json *root = NULL;
  sonde_error error = {0};
  if (sonde_json_parse(begin, (size_t)(end - begin), NULL, &root, &error))
    fail_msg("%s", error.message);
  assert_string_equal(sonde_json_as_text(sonde_json_member(root, "kind")), "exam");
  sonde_free(page);
  return root;
}

static const sonde_json *member(const sonde_json *object, const char *key) {
  const sonde_json *value = sonde_json_member(object, key);
  if (!value) fail_msg("there is no %s", key);
  return value;
}

static const char *text_of(const sonde_json *object, const char *key) {
  const char *text = sonde_json_as_text(member(object, key));
  if (!text) fail_msg("%s is no text", key);
  return text;
}

static double number_of(const sonde_json *object, const char *key) {
  return sonde_json_as_number(member(object, key));
}

static bool is_true(const sonde_json *object, const char *key) {
  return sonde_json_kind_of(member(object, key)) == SONDE_JSON_TRUE;
}

// ---- tests --------------------------------------------------------------------------------------

// Nine digits.
static void assert_close(double got, double wanted) {
  if (isnan(wanted))
    assert_true(isnan(got));
  else
    assert_near(got, wanted, 1e-8 * fmax(1, fabs(wanted)));
}

static void everything_stands_once(void **state) {
  (void)state;
  static const uint32_t COUNTS[] = {0, 1, 30, PRESSES};
  for (size_t i = 0; i < SONDE_COUNT_OF(COUNTS); ++i) {
    sonde_exam_report r = exam(COUNTS[i], i % 2);
    sonde_json *root = data_of(&r);
    const sonde_json *presses = member(root, "presses"), *pictures = member(root, "pictures");
    assert_int_equal(sonde_json_count(presses), COUNTS[i]);
    const sonde_compression *p = made.presses;
    for (const sonde_json *press = sonde_json_first(presses); press;
         press = sonde_json_next(press)) {
      assert_string_equal(text_of(press, "result"), sonde_press_result_name(p->result));
      assert_close(number_of(press, "force_peak_n"), p->force_peak_n);
      assert_close(number_of(press, "along_mm"), 1e3 * p->along_m);
      assert_close(number_of(press, "vein"), p->vein_ratio);
      assert_close(number_of(press, "limit_n"), made.plan.point[p->place].target.limit_n);
      ++p;
    }
    assert_int_equal(sonde_json_count(pictures), r.picture_count);
    for (const sonde_json *pair = sonde_json_first(pictures); pair; pair = sonde_json_next(pair)) {
      assert_true(number_of(pair, "press") >= 1 && number_of(pair, "press") <= COUNTS[i]);
      assert_true(strlen(text_of(pair, "before")) > 100 && strlen(text_of(pair, "peak")) > 100);
    }
    assert_int_equal(sonde_json_count(member(root, "segments")), 5);
    assert_int_equal(sonde_json_count(member(root, "places")), 15);
    assert_int_equal(sonde_json_count(member(root, "exams")), EARLIER + 1);
    assert_close(number_of(member(root, "score"), "score"), made.score.score);
    // Points and what they are of: the weights add up to a hundred.
    double points = 0, of = 0;
    for (const sonde_json *part = sonde_json_first(member(root, "parts")); part;
         part = sonde_json_next(part)) {
      points += number_of(part, "points");
      of += number_of(part, "of");
      if (text_of(part, "lost")[0]) assert_true(number_of(part, "points") < number_of(part, "of"));
    }
    assert_close(of, 100);
    assert_close(points, 40 * made.score.decisions + 25 * made.score.coverage +
                             20 * made.score.technique + 10 * made.score.force +
                             5 * made.score.economy);
    sonde_json_free(root);
  }
}

// At most 900 points, over the whole time, with the greatest force and the least vein of all
// samples.
static void traces_keep_every_peak(void **state) {
  (void)state;
  sonde_exam_report r = exam(30, true);
  sonde_json *root = data_of(&r);
  const sonde_json *traces = member(root, "traces");
  double most_n = 0, least = 1, got_n = 0, got = 1;
  for (uint32_t i = 0; i < SAMPLES; ++i) {
    most_n = fmax(most_n, made.samples[i].force_n);
    least = fmin(least, made.samples[i].vein_ratio);
  }
  uint32_t count = sonde_json_count(member(traces, "time_s"));
  assert_true(count > 450 && count <= 900);
  assert_int_equal(sonde_json_count(member(traces, "force_n")), count);
  assert_int_equal(sonde_json_count(member(traces, "vein")), count);
  const sonde_json *force = sonde_json_first(member(traces, "force_n"));
  for (; force; force = sonde_json_next(force)) got_n = fmax(got_n, sonde_json_as_number(force));
  const sonde_json *vein = sonde_json_first(member(traces, "vein"));
  for (; vein; vein = sonde_json_next(vein)) got = fmin(got, sonde_json_as_number(vein));
  assert_near(got_n, most_n, 1e-4 * most_n);
  assert_near(got, least, 1e-4);
  sonde_json_free(root);
}

// What others wrote stays text: it ends no script, and what is not UTF-8 becomes U+FFFD.
static void foreign_texts_stay_data(void **state) {
  (void)state;
  static const char CLEAN[] = "<b>&\"'\x01\ufffd</script><script>alert(1)</script>";
  sonde_exam_report r = hostile();
  char *page = write_page(&r);
  assert_null(strstr(page, "<script>alert"));
  assert_null(strstr(page, "<b>&\""));
  sonde_free(page);
  sonde_json *root = data_of(&r);
  assert_string_equal(text_of(member(root, "exam"), "title"), CLEAN);
  assert_string_equal(text_of(member(root, "exam"), "trainee"), CLEAN);
  assert_string_equal(text_of(member(root, "score"), "truth"), CLEAN);
  assert_string_equal(text_of(sonde_json_first(member(root, "comments")), "text"), CLEAN);
  assert_string_equal(text_of(root, "recording"), CLEAN);
  sonde_json_free(root);
}

static void equal_reports_give_equal_bytes(void **state) {
  (void)state;
  sonde_exam_report r = exam(40, true);
  char *a = write_page(&r), *b = write_page(&r);
  assert_string_equal(a, b);
  sonde_free(a);
  sonde_free(b);
}

static void missing_parts_are_left_out(void **state) {
  (void)state;
  sonde_exam_report r = exam(12, true);
  r.picture_count = r.sample_count = r.earlier_count = 0;
  r.protocol = NULL;
  r.recording = NULL;
  r.note = (sonde_score_note){0};
  made.patient.note[0] = made.patient.history[0] = 0;
  sonde_json *root = data_of(&r);
  assert_null(sonde_json_member(root, "protocol"));
  assert_int_equal(sonde_json_kind_of(member(root, "recording")), SONDE_JSON_NULL);
  assert_int_equal(sonde_json_kind_of(member(member(root, "exam"), "trainee")), SONDE_JSON_NULL);
  assert_int_equal(sonde_json_count(member(root, "pictures")), 0);
  assert_int_equal(sonde_json_count(member(member(root, "traces"), "time_s")), 0);
  assert_int_equal(sonde_json_count(member(root, "exams")), 1);
  sonde_json_free(root);
  r = exam(12, true);
  made.pictures[0].peak.pixels = NULL;
  root = data_of(&r);
  const sonde_json *pair = sonde_json_first(member(root, "pictures"));
  assert_int_equal(sonde_json_kind_of(member(pair, "before")), SONDE_JSON_TEXT);
  assert_int_equal(sonde_json_kind_of(member(pair, "peak")), SONDE_JSON_NULL);
  sonde_json_free(root);
}

// The exam itself is in the log, later ones may be too: neither is an earlier one.
static void only_earlier_exams_are_compared(void **state) {
  (void)state;
  sonde_exam_report r = exam(12, true);
  r.earlier_count = 3;
  snprintf(made.earlier[0].id, sizeof made.earlier[0].id, "%s", r.note.exam);
  snprintf(made.earlier[0].case_title, sizeof made.earlier[0].case_title, "Twice here");
  sonde_log_date(1900000000, made.earlier[1].date);
  snprintf(made.earlier[1].case_title, sizeof made.earlier[1].case_title, "From the future");
  sonde_json *root = data_of(&r);
  const sonde_json *now = sonde_json_first(member(root, "exams"));
  assert_int_equal(sonde_json_count(member(root, "exams")), 2);
  assert_string_equal(text_of(now, "title"), made.patient.title);
  assert_true(is_true(now, "same_patient"));
  assert_string_equal(text_of(sonde_json_next(now), "title"), made.earlier[2].case_title);
  assert_int_equal(sonde_json_count(member(root, "curve")), 2);
  sonde_json_free(root);
}

static void comments_stand_in_the_order_of_time(void **state) {
  (void)state;
  sonde_exam_report r = exam(12, true);
  made.comments[0] = (sonde_comment){83.4, "Dr. Keller", "Slower here."};
  made.comments[1] = (sonde_comment){121, "", "Well done & quick."};
  r.comments = made.comments;
  r.comment_count = 2;
  sonde_json *root = data_of(&r);
  const sonde_json *first = sonde_json_first(member(root, "comments"));
  assert_int_equal(sonde_json_count(member(root, "comments")), 2);
  assert_close(number_of(first, "time_s"), 83.4);
  assert_string_equal(text_of(first, "author"), "Dr. Keller");
  assert_string_equal(text_of(sonde_json_next(first), "text"), "Well done & quick.");
  sonde_json_free(root);
}

static uint32_t decode(const char *text, uint8_t *bytes, uint32_t room) {
  static const char DIGITS[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  uint32_t count = 0, held = 0, bits = 0;
  for (const char *p = text; strchr(DIGITS, *p) && *p; ++p) {
    held = held << 6 | (uint32_t)(strchr(DIGITS, *p) - DIGITS);
    if ((bits += 6) < 8) continue;
    bits -= 8;
    assert_true(count < room);
    bytes[count++] = (uint8_t)(held >> bits);
  }
  return count;
}

// A small image comes back pixel by pixel; a large one keeps its mean.
static void images_come_back(void **state) {
  (void)state;
  static uint8_t bytes[1 << 20], pixels[SIDE * SIDE];
  static const uint32_t SIDES[] = {96, SIDE};
  for (size_t k = 0; k < 2; ++k) {
    sonde_exam_report r = exam(1, true);
    made.pictures[0].before.width = made.pictures[0].before.height = SIDES[k];
    sonde_json *root = data_of(&r);
    const char *data = text_of(sonde_json_first(member(root, "pictures")), "before");
    uint32_t count = decode(data, bytes, sizeof bytes);
    png_image png = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_memory(&png, bytes, count));
    png.format = PNG_FORMAT_GRAY;
    assert_true(png_image_finish_read(&png, NULL, pixels, 0, NULL));
    if (k == 0) {
      assert_int_equal(png.width, 96);
      assert_memory_equal(pixels, made.open, 96 * 96);
    } else {
      double got = 0, wanted = 0;
      for (uint32_t i = 0; i < png.width * png.height; ++i) got += pixels[i];
      for (uint32_t i = 0; i < SIDE * SIDE; ++i) wanted += made.open[i];
      assert_true(png.width < SIDE);
      assert_near(got / (png.width * png.height), wanted / (SIDE * SIDE), 0.5);
    }
    sonde_json_free(root);
  }
}

static void choice_shows_every_kind_all_along(void **state) {
  (void)state;
  exam(PRESSES, true);
  uint32_t chosen[PAIRS];
  bool kinds[SONDE_PRESS_RESULTS] = {false};
  double least = 1, most = 0;
  assert_int_equal(sonde_exam_report_choose(made.presses, PRESSES, PAIRS, chosen), PAIRS);
  for (uint32_t i = 0; i < PAIRS; ++i) {
    const sonde_compression *p = &made.presses[chosen[i]];
    assert_true(i == 0 || chosen[i] > chosen[i - 1]);
    kinds[p->result] = true;
    if (p->result != SONDE_PRESS_COMPLETE) continue;
    least = fmin(least, p->along_m);
    most = fmax(most, p->along_m);
  }
  for (int k = 0; k < SONDE_PRESS_RESULTS; ++k) assert_true(kinds[k]);
  assert_true(most - least > 0.1);
  assert_int_equal(sonde_exam_report_choose(made.presses, 3, PAIRS, chosen), 3);
  assert_int_equal(sonde_exam_report_choose(NULL, 0, PAIRS, chosen), 0);
}

static double overlap(const double *a, const double *b) {
  return fmax(0, fmin(a[1], b[1]) - fmax(a[0], b[0]));
}

static uint32_t read_stretches(const sonde_json *list, double stretches[][2]) {
  uint32_t count = 0;
  for (const sonde_json *one = sonde_json_first(list); one; one = sonde_json_next(one), ++count) {
    assert_true(count < 64 && sonde_json_count(one) == 2);
    stretches[count][0] = sonde_json_as_number(sonde_json_first(one));
    stretches[count][1] = sonde_json_as_number(sonde_json_next(sonde_json_first(one)));
    assert_true(stretches[count][0] < stretches[count][1]);
  }
  return count;
}

// The stretches that the report draws are those that the judge measures.
static void stretches_agree_with_the_judge(void **state) {
  (void)state;
  static const double places_m[] = {0.012, 0.031, 0.05, 0.118, 0.13, 0.187};
  enum { PLACES = SONDE_COUNT_OF(places_m) };
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  sonde_case patient = truth_of(1u << 2);
  for (size_t count = 0; count <= PLACES; ++count) {
    sonde_judge *judge = judge_of(&plan);
    for (size_t i = 0; i < count; ++i) {
      test_press press = i == 3 ? staying_open(places_m[i]) : closing(places_m[i]);
      if (i == 4) press.force_n = 45; // too hard: covers nothing
      feed_press(judge, &press, 3.0 * (double)i, 0.03);
    }
    sonde_score score;
    sonde_judge_score(judge, &patient, &score);
    sonde_exam_report r = {.patient = &patient, .map = &map, .plan = &plan, .score = &score};
    r.presses = sonde_judge_compressions(judge, &r.press_count);
    assert_int_equal(r.press_count, count);
    sonde_json *root = data_of(&r);
    const sonde_json *vein = member(root, "vein"), *gap = sonde_json_member(vein, "gap");
    double planned[64][2], examined[64][2], all_mm = 0, both_mm = 0, gap_mm[2] = {0, 0};
    uint32_t planned_count = read_stretches(member(vein, "planned"), planned);
    uint32_t examined_count = read_stretches(member(vein, "examined"), examined);
    for (uint32_t i = 0; i < planned_count; ++i) {
      all_mm += planned[i][1] - planned[i][0];
      for (uint32_t k = 0; k < examined_count; ++k) both_mm += overlap(planned[i], examined[k]);
    }
    assert_near(both_mm / all_mm, score.metrics.coverage, 1e-5);
    if (gap) gap_mm[0] = sonde_json_as_number(sonde_json_first(gap));
    if (gap) gap_mm[1] = sonde_json_as_number(sonde_json_next(sonde_json_first(gap)));
    assert_near(gap_mm[1] - gap_mm[0], 1e3 * score.metrics.gap_m, 1e-3);
    for (uint32_t k = 0; k < examined_count; ++k)
      assert_near(overlap(gap_mm, examined[k]), 0, 1e-9);
    uint32_t done = 0;
    const sonde_json *place = sonde_json_first(member(root, "places"));
    for (; place; place = sonde_json_next(place)) done += is_true(place, "done");
    assert_int_equal(done, score.metrics.points_done);
    sonde_json_free(root);
    sonde_judge_destroy(judge);
  }
}

static void wrong_reports_are_refused(void **state) {
  (void)state;
  sonde_exam_report r = exam(3, true);
  made.pictures[0].press = 3;
  assert_int_equal(sonde_exam_report_write(&r, "never.html", NULL), SONDE_ARGUMENT);
  r = exam(3, true);
  r.plan = NULL;
  assert_int_equal(sonde_exam_report_write(&r, "never.html", NULL), SONDE_ARGUMENT);
  r = exam(3, true);
  assert_int_equal(sonde_exam_report_write(&r, "no/such/place.html", NULL), SONDE_IO);
  assert_int_not_equal(access("never.html", F_OK), 0);
}

static void write_example(const char *directory, const char *name, const sonde_exam_report *r) {
  char path[512];
  sonde_error error = {0};
  snprintf(path, sizeof path, "%s/%s.html", directory, name);
  if (sonde_exam_report_write(r, path, &error)) fprintf(stderr, "%s\n", error.message);
}

static void write_examples(const char *directory) {
  sonde_exam_report r = exam(26, true);
  write_example(directory, "passed", &r);
  r = exam(26, false);
  write_example(directory, "missed", &r);
  r = exam(PRESSES, true);
  write_example(directory, "many", &r);
  r = exam(0, false);
  r.earlier_count = 0;
  r.interrupted = true;
  write_example(directory, "nothing", &r);
  r = hostile();
  made.pictures[1].before.pixels = made.pictures[1].peak.pixels = made.pictures[2].peak.pixels =
      NULL;
  write_example(directory, "hostile", &r);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(everything_stands_once),
      cmocka_unit_test(traces_keep_every_peak),
      cmocka_unit_test(foreign_texts_stay_data),
      cmocka_unit_test(equal_reports_give_equal_bytes),
      cmocka_unit_test(missing_parts_are_left_out),
      cmocka_unit_test(comments_stand_in_the_order_of_time),
      cmocka_unit_test(only_earlier_exams_are_compared),
      cmocka_unit_test(images_come_back),
      cmocka_unit_test(choice_shows_every_kind_all_along),
      cmocka_unit_test(stretches_agree_with_the_judge),
      cmocka_unit_test(wrong_reports_are_refused),
  };
  if (argc > 1) {
    write_examples(argv[1]);
    return 0;
  }
  return cmocka_run_group_tests(tests, NULL, NULL);
}
