// The score: a wrong diagnosis never passes, more coverage never scores less, nothing comes of
// nothing, and the files say what the score says.
#include "trainer_test.h"

#include <cjson/cJSON.h>

// Presses every 20 mm: open where the mask has a clot, else closed; left out where `skip` says.
static sonde_judge *examined(unsigned clots, unsigned skip) {
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  sonde_judge *judge = judge_of(&plan);
  for (uint32_t i = 0; i < plan.count; ++i) {
    if (skip & (1u << i)) continue;
    double z = plan.point[i].at.z_m;
    test_press press = clots & (1u << plan.point[i].segment) ? staying_open(z) : closing(z);
    feed_press(judge, &press, 3.0 * i, 0.04);
  }
  return judge;
}

static void decide_all(sonde_judge *judge, unsigned code) { // base 4, a digit per segment
  for (uint32_t i = 0; i < 5; ++i, code /= 4)
    assert_int_equal(sonde_judge_decide(judge, i, (sonde_decision)(code % 4), NULL), SONDE_OK);
}

// Every set of decisions on every truth after a flawless examination: 1,024 x 32.
static void a_wrong_diagnosis_never_passes(void **state) {
  (void)state;
  unsigned passed = 0;
  for (unsigned clots = 0; clots < 32; ++clots) {
    sonde_judge *judge = examined(clots, 0);
    sonde_case truth = truth_of(clots);
    for (unsigned code = 0; code < 1024; ++code) {
      decide_all(judge, code);
      bool called = false, all = true;
      for (unsigned i = 0, rest = code; i < 5; ++i, rest /= 4) {
        called |= rest % 4 == SONDE_DECISION_CLOT;
        all &= rest % 4 == SONDE_DECISION_COMPRESSIBLE;
      }
      bool right = clots ? called : all;
      sonde_score score = score_of(judge, &truth);
      assert_int_equal(score.correct, right);
      assert_true(right || (!score.passed && score.score < 50));
      assert_true(score.score >= 0 && score.score <= 100 + 1e-9);
      passed += score.passed;
    }
    sonde_judge_destroy(judge);
  }
  assert_true(passed >= 32);
}

// Exams of random presses and decisions: a part that is not full says what was lost, one that is
// full says nothing; the force part is not full exactly when a press was too hard or a place was
// missed, and names one of these with its place.
static void every_lost_point_is_named(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  for (uint32_t i = 0; i < plan.count; ++i) {
    plan.point[i].target = sonde_force_target_make(14 + i);
    snprintf(plan.point[i].title, sizeof plan.point[i].title, "Place %u", i);
  }
  unsigned noise = 3, hard_only = 0, lost_parts[SONDE_SCORE_PARTS] = {0};
  for (int trial = 0; trial < 150; ++trial) {
    sonde_judge *judge = judge_of(&plan);
    for (uint32_t i = 0; i < plan.count; ++i) {
      noise = noise * 1664525u + 1013904223u;
      unsigned luck = (noise >> 16) % 40;
      if (trial % 3 == 2 && luck < 8) continue; // left out
      test_press press = closing(plan.point[i].at.z_m);
      press.force_n = plan.point[i].target.firm_n + 0.5;
      if (luck == 1) press.vein = 0.5;
      if (luck == 3) press.tilt_rad = 0.6;
      feed_press(judge, &press, 6.0 * i, 0.04);
      press.force_n = plan.point[i].target.limit_n + 3;
      if (luck == 2) feed_press(judge, &press, 6.0 * i + 3, 0.04);
    }
    for (uint32_t i = 0; i < 5; ++i)
      sonde_judge_decide(judge, i, trial % 4 ? SONDE_DECISION_COMPRESSIBLE : SONDE_DECISION_NONE,
                         NULL);
    sonde_case truth = truth_of(trial % 5 ? 0 : 4);
    sonde_score score = score_of(judge, &truth);
    uint32_t count;
    const sonde_compression *presses = sonde_judge_compressions(judge, &count);
    sonde_score_part part[SONDE_SCORE_PARTS];
    sonde_score_explain(&score, &plan, presses, count, part);
    double sum = 0;
    for (int k = 0; k < SONDE_SCORE_PARTS; ++k) {
      bool full = part[k].points >= part[k].of - 1e-9;
      assert_int_equal(part[k].lost[0] == 0, full);
      lost_parts[k] += !full;
      sum += part[k].points;
    }
    if (score.correct) assert_near(sum, score.score, 1e-9);
    const sonde_score_part *force = &part[3];
    assert_string_equal(force->name, "force");
    uint32_t hard = score.metrics.presses[SONDE_PRESS_TOO_HARD];
    bool missed = score.metrics.points_done < score.metrics.points;
    assert_int_equal(force->lost[0] != 0, hard > 0 || missed);
    if (force->lost[0]) assert_non_null(strstr(force->lost, "Place "));
    if (hard) assert_non_null(strstr(force->lost, " N, limit "));
    if (missed) assert_non_null(strstr(force->lost, "not examined"));
    hard_only += hard && !missed;
    sonde_judge_destroy(judge);
  }
  assert_true(hard_only > 3 && lost_parts[0] && lost_parts[1] && lost_parts[2]);
}

static unsigned right_code(unsigned clots) {
  unsigned code = 0;
  for (unsigned i = 5; i-- > 0;)
    code = 4 * code + (clots & (1u << i) ? SONDE_DECISION_CLOT : SONDE_DECISION_COMPRESSIBLE);
  return code;
}

static void a_flawless_exam_has_all_points(void **state) {
  (void)state;
  for (unsigned clots = 0; clots < 32; clots += 3) {
    sonde_judge *judge = examined(clots, 0);
    decide_all(judge, right_code(clots));
    sonde_case truth = truth_of(clots);
    sonde_score score = score_of(judge, &truth);
    assert_near(score.score, 100, 1e-9);
    assert_true(score.passed);
    sonde_judge_destroy(judge);
  }
}

// Leaving out one place more never scores more, with the right decisions.
static void the_score_grows_with_coverage(void **state) {
  (void)state;
  sonde_case truth = truth_of(0);
  double before = 101, coverage = 1.01;
  for (unsigned left_out = 0; left_out <= 10; ++left_out) {
    sonde_judge *judge = examined(0, (1u << left_out) - 1);
    decide_all(judge, right_code(0));
    sonde_score score = score_of(judge, &truth);
    assert_true(score.score < before && score.metrics.coverage < coverage);
    before = score.score;
    coverage = score.metrics.coverage;
    sonde_judge_destroy(judge);
  }
  assert_true(before == 0); // nothing pressed, nothing earned
}

// A decision without a press that shows it is a guess.
static void guesses_earn_nothing(void **state) {
  (void)state;
  sonde_judge *judge = examined(0, 0x3ff);
  sonde_case sick = truth_of(4);
  decide_all(judge, right_code(4));
  sonde_score score = score_of(judge, &sick);
  assert_true(score.correct && !score.passed);
  assert_true(score.decisions == 0 && score.score == 0);
  sonde_judge_destroy(judge);
}

// A clot outside the places of the protocol is missed, and that is not passed.
static void two_regions_miss_the_middle(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = protocol_of(
      "{sonde_protocol: 1, id: two, title: Two, text: Two, places: [{title: A, text: a, "
      "at: 20}, {title: B, text: b, at: 180}]}");
  sonde_plan plan = plan_of(&protocol, &map);
  sonde_judge *judge = judge_of(&plan);
  test_press groin = closing(0.02), knee = closing(0.18);
  feed_press(judge, &groin, 0, 0.04);
  feed_press(judge, &knee, 3, 0.04);
  sonde_judge_decide(judge, 0, SONDE_DECISION_COMPRESSIBLE, NULL);
  sonde_judge_decide(judge, 4, SONDE_DECISION_COMPRESSIBLE, NULL);
  sonde_case middle = truth_of(4), healthy = truth_of(0);
  sonde_score score = score_of(judge, &middle);
  assert_true(score.answered && !score.correct && !score.passed);
  assert_true(score_of(judge, &healthy).passed);
  sonde_judge_destroy(judge);
}

static void a_series_counts(void **state) {
  (void)state;
  sonde_series series = {0};
  assert_true(isnan(sonde_series_sensitivity(&series)));
  for (unsigned k = 0; k < 8; ++k) {
    sonde_judge *judge = examined(k % 2 ? 4 : 0, 0);
    decide_all(judge, right_code(k == 1 || k == 2 ? 4 : k == 3 ? 0 : k % 2 ? 4 : 0));
    sonde_case truth = truth_of(k % 2 ? 4 : 0);
    sonde_score score = score_of(judge, &truth);
    sonde_series_add(&series, &score);
    sonde_judge_destroy(judge);
  }
  assert_near(sonde_series_sensitivity(&series), 0.75, 1e-12); // one of four clots missed
  assert_near(sonde_series_specificity(&series), 0.75, 1e-12); // one of four healthy called
  assert_int_equal(series.exams, 8);
  assert_int_equal(series.passed, 6);
}

static void files_say_the_same(void **state) {
  (void)state;
  sonde_judge *judge = examined(4, 3);
  decide_all(judge, right_code(4));
  sonde_case truth = truth_of(4);
  snprintf(truth.title, sizeof truth.title, "A \"quoted\"\ntitle");
  sonde_score score = score_of(judge, &truth);
  sonde_score_note note = {.trainee = "someone", .protocol = "all"};
  assert_int_equal(
      sonde_score_save(judge, &truth, &score, &note, NULL, NULL, "score.json", "score.csv", NULL),
      SONDE_OK);
  char *text;
  size_t count;
  assert_int_equal(sonde_file_load("score.json", &text, &count, NULL), SONDE_OK);
  cJSON *root = cJSON_Parse(text);
  assert_non_null(root);
  cJSON *part = cJSON_GetObjectItem(root, "score");
  assert_near(cJSON_GetObjectItem(part, "score")->valuedouble, score.score, 1e-6);
  assert_true(cJSON_IsTrue(cJSON_GetObjectItem(part, "correct")));
  assert_string_equal(cJSON_GetObjectItem(cJSON_GetObjectItem(root, "exam"), "title")->valuestring,
                      truth.title);
  assert_true(cJSON_IsNull(cJSON_GetObjectItem(cJSON_GetObjectItem(root, "exam"), "date")));
  assert_string_equal(cJSON_GetObjectItem(cJSON_GetObjectItem(root, "exam"), "tissue")->valuestring,
                      "springs");
  uint32_t presses;
  sonde_judge_compressions(judge, &presses);
  assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "presses")), presses);
  assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "segments")), 5);
  cJSON_Delete(root);
  sonde_free(text);
  assert_int_equal(sonde_file_load("score.csv", &text, &count, NULL), SONDE_OK);
  uint32_t lines = 0;
  for (size_t i = 0; i < count; ++i) lines += text[i] == '\n';
  assert_int_equal(lines, presses + 1);
  sonde_free(text);
  assert_int_equal(
      sonde_score_save(judge, &truth, &score, &note, NULL, NULL, "/nonexistent/x.json", NULL, NULL),
      SONDE_IO);
  unlink("score.json");
  unlink("score.csv");
  sonde_judge_destroy(judge);
}

// A clot below the knee is the diagnosis where the protocol asks for the calf, and left to another
// examination where it does not; one in a superficial vein is a finding and no thrombosis.
static void what_counts_is_what_is_asked(void **state) {
  (void)state;
  sonde_vein_map map = branched_map();
  sonde_exam_protocol thigh = every_20_mm();
  sonde_exam_protocol leg = protocol_of(
      "{sonde_protocol: 1, id: leg, title: L, text: l, places: [{title: A, at: {station: pair}}, "
      "{title: B, at: {station: behind}}, {title: C, at: {station: pair}, segment: "
      "great_saphenous}]}");
  const struct {
    bool asks_calf;
    const char *filled; // the branch with the clot
    sonde_decision pair, superficial;
    bool thrombosis, correct, found;
  } TRY[] = {
      {true, "second_posterior_tibial_vein", SONDE_DECISION_CLOT, 1, true, true, true},
      {true, "second_posterior_tibial_vein", 1, 1, true, false, false},
      {true, "great_saphenous", 1, SONDE_DECISION_CLOT, false, true, true},
      {true, "great_saphenous", 1, 1, false, true, false},
      {true, "great_saphenous", SONDE_DECISION_CLOT, 1, false, false, false},
      {false, "posterior_tibial_vein", 0, 0, false, true, true},
      {false, "great_saphenous", 0, 0, false, true, true},
  };
  for (size_t i = 0; i < SONDE_COUNT_OF(TRY); ++i) {
    sonde_plan plan = plan_of(TRY[i].asks_calf ? &leg : &thigh, &map);
    sonde_judge *judge;
    assert_int_equal(sonde_judge_create(&map, &plan, &judge, NULL), SONDE_OK);
    for (uint32_t k = 0; k < 5; ++k)
      sonde_judge_decide(judge, k, SONDE_DECISION_COMPRESSIBLE, NULL);
    sonde_judge_decide(judge, TEST_PAIR, TRY[i].pair, NULL);
    sonde_judge_decide(judge, TEST_SUPERFICIAL, TRY[i].superficial, NULL);
    sonde_case truth = truth_of(0);
    truth.branch_count = 1;
    truth.branch[0].pathology.thrombus_fraction = 1;
    snprintf(truth.branch[0].branch, sizeof truth.branch[0].branch, "%s", TRY[i].filled);
    sonde_score score = score_of(judge, &truth);
    assert_int_equal(score.thrombosis, TRY[i].thrombosis);
    assert_int_equal(score.correct, TRY[i].correct);
    bool all = true;
    for (uint32_t k = 0; k < score.segment_count; ++k)
      if (score.segment[k].needed) all &= score.segment[k].correct;
    assert_int_equal(all, TRY[i].found);
    sonde_judge_destroy(judge);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_wrong_diagnosis_never_passes),
      cmocka_unit_test(every_lost_point_is_named),
      cmocka_unit_test(a_flawless_exam_has_all_points),
      cmocka_unit_test(the_score_grows_with_coverage),
      cmocka_unit_test(guesses_earn_nothing),
      cmocka_unit_test(two_regions_miss_the_middle),
      cmocka_unit_test(what_counts_is_what_is_asked),
      cmocka_unit_test(a_series_counts),
      cmocka_unit_test(files_say_the_same),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
