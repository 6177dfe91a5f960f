// Scripted operators on a thigh of two formulas: they are told apart, they find what is there, and
// they never see the truth.
#include "trainer_test.h"

enum { OPERATORS = 4 };

// A flat skin at x = 0.07: 1 N per mm; a healthy vein keeps 1 - F/20 of its area, a clotted one
// 1 - F/120, the artery 1 - F/60.
static sonde_snapshot plant(sonde_pose pose, double time_s, unsigned clots) {
  double depth_m = 0.07 - pose.position.x, force = fmax(0, 1e3 * depth_m);
  double z = clamp(pose.position.z, 0, 0.2);
  bool clot = clots & (1u << (unsigned)fmin(4, z / 0.04));
  double along = fabs(v_dot(q_rotate(pose.rotation, vec3(0, 1, 0)), vec3(0, 0, 1)));
  return (sonde_snapshot){.tick = (uint64_t)(1e3 * time_s),
                          .time_s = time_s,
                          .world_from_probe = pose,
                          .force_normal_n = force,
                          .vein_area_ratio = fmax(0, 1 - force / (clot ? 120 : 20)),
                          .artery_area_ratio = fmax(0, 1 - force / 60),
                          .vein_rest_m = vec3(0.05, 0, z),
                          .vein_tilt_rad = acos(fmin(1, along))};
}

static sonde_score examine(const char *name, uint64_t seed, unsigned clots) {
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  sonde_judge *judge = judge_of(&plan);
  sonde_operator *op;
  sonde_device hand;
  assert_int_equal(sonde_operator_create(name, seed, &map, &plan, 0.004, &op, &hand, NULL),
                   SONDE_OK);
  uint64_t tick = 0;
  for (; !sonde_operator_done(op) && tick < 200000; ++tick) {
    sonde_device_sample sample;
    hand.read(hand.self, tick, &sample);
    if (tick % 10) continue;
    sonde_snapshot s = plant(sample.world_from_probe, 0.004 * (double)tick, clots);
    sonde_judge_feed(judge, &s);
    sonde_operator_see(op, &s);
  }
  assert_true(sonde_operator_done(op));
  sonde_judge_finish(judge);
  for (uint32_t i = 0; i < 5; ++i)
    sonde_judge_decide(judge, i, sonde_operator_decision(op, i), NULL);
  sonde_case truth = truth_of(clots);
  sonde_score score = score_of(judge, &truth);
  hand.destroy(hand.self);
  sonde_operator_destroy(op);
  sonde_judge_destroy(judge);
  return score;
}

static void the_expert_finds_every_clot(void **state) {
  (void)state;
  for (unsigned clots = 0; clots < 32; ++clots) {
    sonde_score score = examine("expert", clots + 1, clots);
    assert_true(score.correct && score.passed);
    assert_true(score.score >= 90);
    for (uint32_t i = 0; i < 5; ++i) assert_true(score.segment[i].correct);
  }
}

static void the_others_do_not_pass(void **state) {
  (void)state;
  for (int k = 1; k < OPERATORS; ++k)
    for (unsigned clots = 0; clots < 32; clots += 5) {
      sonde_score score = examine(sonde_operator_names()[k], clots + 1, clots);
      assert_true(score.score <= 60);
    }
}

// Each fault shows in the metric that is made for it.
static void faults_show_where_they_belong(void **state) {
  (void)state;
  sonde_metrics m[OPERATORS];
  for (int k = 0; k < OPERATORS; ++k) m[k] = examine(sonde_operator_names()[k], 7, 0).metrics;
  enum { EXPERT, NOVICE, TIMID, FORCEFUL };
  assert_true(m[TIMID].presses[SONDE_PRESS_INSUFFICIENT] >= 9);
  assert_true(m[TIMID].force_peak_n < 12 && m[EXPERT].force_peak_n > 15);
  assert_true(m[FORCEFUL].presses[SONDE_PRESS_TOO_HARD] >= 9);
  assert_true(m[FORCEFUL].force_peak_n > 24);
  assert_true(m[NOVICE].presses[SONDE_PRESS_OFF_AXIS] >= 1);
  assert_true(m[NOVICE].gap_m > 0.03 && m[EXPERT].gap_m == 0);
  assert_int_equal(m[EXPERT].presses[SONDE_PRESS_OFF_AXIS], 0);
}

static void equal_seeds_equal_exams(void **state) {
  (void)state;
  sonde_score a = examine("novice", 3, 4), b = examine("novice", 3, 4), c = examine("novice", 4, 4);
  assert_memory_equal(&a.metrics, &b.metrics, sizeof a.metrics);
  assert_true(memcmp(&a.metrics, &c.metrics, sizeof a.metrics) != 0);
}

// A round leg of radius 0.07: the main vein in front, a pair behind. The hand goes from one side to
// the other around it without touching, and says of each what is there.
static void the_hand_goes_round_the_leg(void **state) {
  (void)state;
  sonde_vein_map map = branched_map();
  sonde_exam_protocol protocol = protocol_of(
      "{sonde_protocol: 1, id: s, title: S, text: s, places: [{title: A, at: {station: pair}}, "
      "{title: B, at: {station: behind}}]}");
  sonde_plan plan = plan_of(&protocol, &map);
  for (int clot = 0; clot < 2; ++clot) {
    sonde_judge *judge;
    sonde_operator *op;
    sonde_device hand;
    assert_int_equal(sonde_judge_create(&map, &plan, &judge, NULL), SONDE_OK);
    assert_int_equal(sonde_operator_create("expert", 1, &map, &plan, 0.004, &op, &hand, NULL),
                     SONDE_OK);
    uint64_t tick = 0, beside = 0;
    for (; !sonde_operator_done(op) && tick < 20000; ++tick) {
      sonde_device_sample sample;
      hand.read(hand.self, tick, &sample);
      sonde_vec3 at = sample.world_from_probe.position;
      double out_m = hypot(at.x, at.y), force_n = fmax(0, 1e3 * (0.07 - out_m));
      if (fabs(at.y) > 0.02) { // on the way
        ++beside;
        assert_true(out_m > 0.075 && force_n == 0);
        sonde_vec3 beam = q_rotate(sample.world_from_probe.rotation, vec3(0, 0, 1));
        assert_true(-(beam.x * at.x + beam.y * at.y) > 0.5 * out_m); // looks at the leg
      }
      if (tick % 10) continue;
      const double none = (double)NAN;
      sonde_snapshot s = {.tick = tick,
                          .time_s = 0.004 * (double)tick,
                          .world_from_probe = sample.world_from_probe,
                          .force_normal_n = force_n,
                          .vein_area_ratio = none,
                          .other_vein_ratio = none,
                          .vein_rest_m = {none, none, none}};
      if (at.x > 0)
        s.vein_area_ratio = fmax(0, 1 - force_n / 20), s.vein_rest_m = vec3(0.05, 0, at.z);
      if (at.x < 0) {
        double other = clot ? 0.9 : fmax(0, 1 - force_n / 20);
        s.crossing[0] = (sonde_vein_crossing){2, fmax(0, 1 - force_n / 20), at.y, {-0.05, 0, at.z}};
        s.crossing[1] = (sonde_vein_crossing){3, other, at.y, {-0.05, 0.004, at.z}};
        s.crossing_count = 2;
      }
      assert_true(sonde_judge_feed(judge, &s));
      sonde_operator_see(op, &s);
    }
    assert_true(sonde_operator_done(op) && beside > 100);
    sonde_judge_finish(judge);
    assert_int_equal(sonde_judge_metrics(judge).points_done, 2);
    assert_int_equal(sonde_operator_decision(op, 3), SONDE_DECISION_COMPRESSIBLE);
    assert_int_equal(sonde_operator_decision(op, TEST_PAIR),
                     clot ? SONDE_DECISION_CLOT : SONDE_DECISION_COMPRESSIBLE);
    hand.destroy(hand.self);
    sonde_operator_destroy(op);
    sonde_judge_destroy(judge);
  }
}

// Presses that begin while the patient strains, from 2 to 8 s: the expert waits, a timid hand does
// not know.
static void the_expert_waits_for_calm(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  uint32_t begun[2] = {0};
  for (int k = 0; k < 2; ++k) {
    sonde_operator *op;
    sonde_device hand;
    assert_int_equal(
        sonde_operator_create(k ? "timid" : "expert", 3, &map, &plan, 0.004, &op, &hand, NULL),
        SONDE_OK);
    uint64_t tick = 0;
    double before_n = 0;
    for (; !sonde_operator_done(op) && tick < 200000; ++tick) {
      sonde_device_sample sample;
      hand.read(hand.self, tick, &sample);
      if (tick % 10) continue;
      sonde_snapshot s = plant(sample.world_from_probe, 0.004 * (double)tick, 0);
      bool strains = s.time_s > 2 && s.time_s < 8;
      s.venous_pressure_pa = SONDE_PA_PER_MMHG * (strains ? 35 : 25);
      if (s.time_s > 2.3 && s.time_s < 8 && before_n == 0) begun[k] += s.force_normal_n > 0;
      before_n = s.force_normal_n;
      sonde_operator_see(op, &s);
    }
    assert_true(sonde_operator_done(op));
    hand.destroy(hand.self);
    sonde_operator_destroy(op);
  }
  assert_true(begun[0] == 0 && begun[1] >= 1);
}

static void unknown_names_are_refused(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  sonde_operator *op;
  sonde_device hand;
  sonde_error error = {0};
  assert_int_equal(sonde_operator_create("surgeon", 1, &map, &plan, 0.004, &op, &hand, &error),
                   SONDE_NOT_FOUND);
  assert_non_null(strstr(error.message, "timid"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_expert_finds_every_clot),   cmocka_unit_test(the_others_do_not_pass),
      cmocka_unit_test(faults_show_where_they_belong), cmocka_unit_test(equal_seeds_equal_exams),
      cmocka_unit_test(the_hand_goes_round_the_leg),   cmocka_unit_test(the_expert_waits_for_calm),
      cmocka_unit_test(unknown_names_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
