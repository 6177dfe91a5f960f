// Protocols: what ships has places on a vein, in order and dense enough; mistakes are named.
#include "trainer_test.h"

static void the_protocols_that_ship(void **state) {
  (void)state;
  sonde_exam_protocol *all;
  uint32_t count;
  sonde_error error = {0};
  if (sonde_exam_protocol_list(SONDE_SOURCE_DIR "/data/protocols", &all, &count, &error))
    fail_msg("%s", error.message);
  assert_int_equal(count, 4);
  assert_string_equal(all[0].id, "two_point");
  assert_string_equal(all[2].id, "whole_leg");
  assert_string_equal(all[3].id, "extended");
  sonde_vein_map map = straight_map(); // without the saphenous vein: its place is left out
  uint32_t before = 0;
  for (uint32_t i = 0; i < count; ++i) {
    if (i == 2) { // a thigh has no calf, and is not called examined without it
      sonde_plan none;
      assert_int_equal(sonde_plan_make(&all[i], &map, &none, &error), SONDE_NOT_FOUND);
      continue;
    }
    sonde_plan plan = plan_of(&all[i], &map);
    assert_true(plan.count > before);
    before = plan.count;
    for (uint32_t k = 1; k < plan.count; ++k) {
      double step = plan.point[k].at.along_m - plan.point[k - 1].at.along_m;
      assert_true(step > 0); // from the groin to the knee
      if (i == 3) assert_true(step <= 0.02 + 1e-9);
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

// A place that needs a branch is there exactly when the thigh has it, at the branch's landmark.
static void a_place_needs_its_branch(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol p = protocol_of(
      "{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, text: b, at: 20}, {title: "
      "C, text: c, needs: great_saphenous, at: {landmark: junction, shift_mm: 4}}]}");
  assert_int_equal(plan_of(&p, &map).count, 1);
  map.branch_count = map.landmark_count = 1;
  snprintf(map.branch[0], sizeof map.branch[0], "great_saphenous");
  snprintf(map.landmark[0], sizeof map.landmark[0], "junction");
  map.landmark_z_m[0] = 0.06;
  sonde_plan plan = plan_of(&p, &map);
  assert_int_equal(plan.count, 2);
  assert_near(plan.point[1].at.along_m, 0.064, 1e-12);
  map.landmark_count = 0;
  sonde_error error = {0};
  assert_int_equal(sonde_plan_make(&p, &map, &plan, &error), SONDE_NOT_FOUND);
  assert_non_null(strstr(error.message, "junction"));
}

// Whole newtons, the limit a fifth and two newtons above what closes the vein, never less.
static void the_force_of_a_place(void **state) {
  (void)state;
  for (double closes_n = 2; closes_n < 60; closes_n += 0.37) {
    sonde_force_target t = sonde_force_target_make(closes_n);
    assert_true(t.firm_n >= closes_n && t.firm_n < closes_n + 1 && t.firm_n == floor(t.firm_n));
    assert_true(t.limit_n > t.firm_n + 1 && t.limit_n == floor(t.limit_n));
    assert_near(t.limit_n, 1.2 * closes_n + 2.5, 0.5 + 1e-9);
  }
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
  assert_int_equal(sonde_plan_make(&p, &map, &plan, &error), SONDE_NOT_FOUND);
  assert_non_null(strstr(error.message, "calf"));
  p = protocol_of("{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, text: b, at: "
                  "300}]}");
  assert_int_equal(sonde_plan_make(&p, &map, &plan, &error), SONDE_ARGUMENT);
  p = protocol_of(
      "{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, text: b, from: "
      "0, to: 200, every_mm: 2}]}");
  assert_int_equal(sonde_plan_make(&p, &map, &plan, &error), SONDE_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_protocols_that_ship),  cmocka_unit_test(a_stretch_is_divided_evenly),
      cmocka_unit_test(a_place_needs_its_branch), cmocka_unit_test(the_force_of_a_place),
      cmocka_unit_test(mistakes_are_named),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
