// Protocols: what ships has places on a vein, in order and dense enough; mistakes are named.
#include "trainer_test.h"

static void the_protocols_that_ship(void **state) {
  (void)state;
  sonde_exam_protocol *all;
  uint32_t count;
  sonde_error error = {0};
  if (sonde_exam_protocol_list(SONDE_SOURCE_DIR "/data/protocols", &all, &count, &error))
    fail_msg("%s", error.message);
  assert_int_equal(count, 3);
  assert_string_equal(all[0].id, "two_point");
  assert_string_equal(all[2].id, "extended");
  sonde_vein_map map = straight_map();
  uint32_t before = 0;
  for (uint32_t i = 0; i < count; ++i) {
    sonde_plan plan = plan_of(&all[i], &map);
    assert_true(plan.count > before);
    before = plan.count;
    for (uint32_t k = 1; k < plan.count; ++k) {
      double step = plan.point[k].at.along_m - plan.point[k - 1].at.along_m;
      assert_true(step > 0); // from the groin to the knee
      if (i == 2) assert_true(step <= 0.02 + 1e-9);
      assert_true(plan.point[k].text[0] && plan.point[k].title[0]);
    }
    assert_true(plan.criteria.tilt_rad > 0.34 && plan.criteria.tilt_rad < 0.35);
  }
  sonde_free(all);
}

static void a_stretch_is_divided_evenly(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol p = protocol_of("{sonde_protocol: 1, id: a, title: A, text: a, places: [{"
                                      "title: B, text: b, from: 20, to: 75, every_mm: 20}]}");
  sonde_plan plan = plan_of(&p, &map);
  assert_int_equal(plan.count, 4);
  for (uint32_t k = 0; k < 4; ++k)
    assert_near(plan.point[k].at.along_m, 0.02 + 0.055 / 3 * k, 1e-12);
}

static void a_case_replaces_criteria(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol p = every_20_mm();
  sonde_case_criteria own = {(double)NAN, 31, 44, 0.6};
  sonde_plan plan;
  assert_int_equal(sonde_plan_make(&p, &map, &own, &plan, NULL), SONDE_OK);
  assert_true(plan.criteria.force_low_n == p.criteria.force_low_n);
  assert_true(plan.criteria.force_high_n == 31 && plan.criteria.force_limit_n == 44);
  assert_true(plan.criteria.artery_ratio == 0.6);
  own.artery_ratio = p.criteria.crushed_ratio;
  sonde_error error;
  assert_int_equal(sonde_plan_make(&p, &map, &own, &plan, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "crushed_ratio"));
}

static void mistakes_are_named(void **state) {
  (void)state;
  static const struct {
    const char *text, *says;
  } BAD[] = {
      {"sonde_protocol: 2\nid: a\ntitle: A\ntext: a\nplaces: []\n",
       "p.yaml:1: protocol of version"},
      {"sonde_protocol: 1\nid: a\ntitle: A\ntext: a\nplaces: []\n", "0 places"},
      {"sonde_protocol: 1\nid: a\ntitle: A\ntext: a\nplaces:\n- {title: B, text: b}\n",
       "p.yaml:6: give either at"},
      {"sonde_protocol: 1\nid: a\ntitle: A\ntext: a\nplaces:\n- {title: B, text: b, from: 1, to: "
       "2}\n",
       "p.yaml:6: every_mm is missing"},
      {"sonde_protocol: 1\nid: a\ntitle: A\ntext: a\ncriteria: {closed_ratio: 0.5}\nplaces:\n- "
       "{title: B, text: b, at: 3}\n",
       "p.yaml:5: closed_ratio is 0.5"},
      {"sonde_protocol: 1\nid: a\ntitle: A\ntext: a\ncriteria: {tilt: 5}\nplaces:\n- "
       "{title: B, text: b, at: 3}\n",
       "p.yaml:5: unknown key 'tilt'"}};
  for (size_t i = 0; i < SONDE_COUNT_OF(BAD); ++i) {
    sonde_exam_protocol p;
    sonde_error error = {0};
    assert_int_not_equal(sonde_exam_protocol_parse(BAD[i].text, "p.yaml", &p, &error), SONDE_OK);
    if (!strstr(error.message, BAD[i].says))
      fail_msg("says: %s, expected %s", error.message, BAD[i].says);
  }
  sonde_vein_map map = straight_map();
  sonde_plan plan;
  sonde_error error = {0};
  sonde_exam_protocol p = protocol_of("{sonde_protocol: 1, id: a, title: A, text: a, places: [{"
                                      "title: B, text: b, at: {segment: calf}}]}");
  assert_int_equal(sonde_plan_make(&p, &map, NULL, &plan, &error), SONDE_NOT_FOUND);
  assert_non_null(strstr(error.message, "calf"));
  p = protocol_of("{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, text: b, at: "
                  "300}]}");
  assert_int_equal(sonde_plan_make(&p, &map, NULL, &plan, &error), SONDE_ARGUMENT);
  p = protocol_of(
      "{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, text: b, from: "
      "0, to: 200, every_mm: 2}]}");
  assert_int_equal(sonde_plan_make(&p, &map, NULL, &plan, &error), SONDE_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_protocols_that_ship),
      cmocka_unit_test(a_stretch_is_divided_evenly),
      cmocka_unit_test(a_case_replaces_criteria),
      cmocka_unit_test(mistakes_are_named),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
