// One exam of two places on a generated thigh, in lockstep: the expert finds the clot, the novice
// does not pass, and the same exam again is the same to the last bit.
#include "trainer_test.h"

static sonde_case patient(bool sick) {
  sonde_case c = truth_of(sick ? 2 : 0);
  c.thigh = SONDE_CASE_GENERATED;
  c.seed = 3;
  c.known.fat_front_m = 0.006;
  if (!sick) return c;
  assert_int_equal(sonde_pathology_preset("acute", &c.pathology, NULL), SONDE_OK);
  c.extent = (sonde_case_extent){.from = {.segment = "femoral_proximal"},
                                 .to = {.segment = "femoral_proximal", .share = 1}};
  return c;
}

// In the groin and in the middle of another segment.
static sonde_score examine_at(const sonde_case *c, const sonde_case_setup *setup, const char *name,
                              const char *segment) {
  char text[512];
  snprintf(text, sizeof text,
           "{sonde_protocol: 1, id: two, title: Two, text: Two, places: [{title: A, text: a, "
           "at: {segment: common_femoral, share: 0.6}}, {title: B, text: b, at: {segment: "
           "%s, share: 0.5}}]}",
           segment);
  sonde_exam_protocol protocol = protocol_of(text);
  sonde_exam_def def = sonde_exam_def_default();
  def.patient = c;
  def.protocol = &protocol;
  def.operator_name = name;
  sonde_score score;
  sonde_error error = {0};
  sonde_exam_setups setups = {1, {*setup}};
  if (sonde_exam_run(&def, &setups, NULL, &score, &error)) fail_msg("%s", error.message);
  return score;
}

static sonde_score examine(const sonde_case *c, const sonde_case_setup *setup, const char *name) {
  return examine_at(c, setup, name, "femoral_proximal");
}

static void expert_and_novice(void **state) {
  (void)state;
  sonde_case sick = patient(true);
  sonde_case_setup setup;
  sonde_error error = {0};
  if (sonde_case_build(&sick, NULL, NULL, &setup, &error)) fail_msg("%s", error.message);
  sonde_score expert = examine(&sick, &setup, "expert"), novice = examine(&sick, &setup, "novice");
  assert_true(expert.passed && expert.score >= 90);
  assert_int_equal(expert.segment[0].decision, SONDE_DECISION_COMPRESSIBLE);
  assert_int_equal(expert.segment[1].decision, SONDE_DECISION_CLOT);
  assert_true(!novice.passed && novice.score <= 60);
  sonde_score again = examine(&sick, &setup, "novice");
  assert_memory_equal(&again.metrics, &novice.metrics, sizeof again.metrics);
  sonde_case_setup_clear(&setup);
}

// The femoral vein closes, the second one beside it holds a clot: a finding, for scripted operators
// as in a session.
static void the_other_vein_counts(void **state) {
  (void)state;
  sonde_case sick = patient(false);
  sick.known.second_vein = 1;
  sick.branch_count = 1;
  snprintf(sick.branch[0].branch, sizeof sick.branch[0].branch, "second_femoral_vein");
  assert_int_equal(sonde_pathology_preset("acute", &sick.branch[0].pathology, NULL), SONDE_OK);
  sick.branch[0].extent = (sonde_case_extent){.from = {.segment = "femoral_mid"},
                                              .to = {.segment = "femoral_mid", .share = 1}};
  sick.thrombosis = true;
  sonde_case_setup setup;
  sonde_error error = {0};
  sick.truth[2] = SONDE_DECISION_CLOT;
  if (sonde_case_build(&sick, NULL, NULL, &setup, &error)) fail_msg("%s", error.message);
  sonde_score expert = examine_at(&sick, &setup, "expert", "femoral_mid");
  assert_int_equal(expert.segment[2].decision, SONDE_DECISION_CLOT);
  setup.findings.branch_count = 0; // the same thigh without the clot
  expert = examine_at(&sick, &setup, "expert", "femoral_mid");
  assert_int_equal(expert.segment[2].decision, SONDE_DECISION_COMPRESSIBLE);
  sonde_case_setup_clear(&setup);
}

static bool cancel(double fraction, const char *what, void *user) {
  (void)fraction;
  (void)what;
  (void)user;
  return false;
}

static void an_exam_can_be_cancelled(void **state) {
  (void)state;
  sonde_case healthy = patient(false);
  sonde_exam_protocol protocol = every_20_mm();
  sonde_exam_def def = sonde_exam_def_default();
  def.patient = &healthy;
  def.protocol = &protocol;
  sonde_progress progress = {cancel, NULL};
  sonde_score score;
  assert_int_equal(sonde_exam_run(&def, NULL, &progress, &score, NULL), SONDE_CANCELLED);
  sonde_case_setup setup;
  assert_int_equal(sonde_case_build(&healthy, NULL, NULL, &setup, NULL), SONDE_OK);
  sonde_plan plan = plan_of(&protocol, &setup.map);
  sonde_exam_setups setups = {1, {setup}};
  def.plan = &plan;
  def.operator_name = "nobody";
  assert_int_equal(sonde_exam_run(&def, &setups, NULL, &score, NULL), SONDE_NOT_FOUND);
  def.operator_name = "expert";
  def.limit_s = 0.5;
  assert_int_equal(sonde_exam_run(&def, &setups, NULL, &score, NULL), SONDE_CONVERGENCE);
  sonde_case_setup_clear(&setup);
}

// The force of a place follows the patient: more pressure in the vein takes more force, so does a
// second vein or a thicker layer of fat above it; a clot changes nothing, since the force is that
// of a healthy vein.
static void forces_follow_the_patient(void **state) {
  (void)state;
  sonde_exam_protocol protocol = protocol_of(
      "{sonde_protocol: 1, id: one, title: One, text: One, places: [{title: A, text: a, at: "
      "{segment: common_femoral, share: 0.3}}, {title: B, text: b, at: {segment: femoral_mid}}]}");
  enum { LYING, SITTING, CLOT, FAT, KINDS };
  sonde_plan plan[KINDS];
  for (int k = 0; k < KINDS; ++k) {
    sonde_case c = patient(k == CLOT);
    if (k == SITTING) c.circulation.posture = SONDE_POSTURE_SITTING;
    if (k == FAT) c.known.fat_front_m = 0.009;
    sonde_case_setup setup;
    sonde_error error = {0};
    if (sonde_case_build(&c, NULL, NULL, &setup, &error)) fail_msg("%s", error.message);
    if (sonde_plan_make(&protocol, &setup.map, &plan[k], &error)) fail_msg("%s", error.message);
    assert_true(isnan(plan[k].point[0].target.firm_n));
    if (sonde_plan_find_targets(&plan[k], &setup, NULL, &error)) fail_msg("%s", error.message);
    // A place has its force whether or not others share the bench before it.
    sonde_plan alone = plan[k];
    alone.point[0] = alone.point[1], alone.count = 1;
    if (k == LYING && sonde_plan_find_targets(&alone, &setup, NULL, &error))
      fail_msg("%s", error.message);
    if (k == LYING) assert_true(alone.point[0].target.closes_n == plan[k].point[1].target.closes_n);
    sonde_case_setup_clear(&setup);
  }
  for (int i = 0; i < 2; ++i) {
    double lying_n = plan[LYING].point[i].target.closes_n;
    print_message("%d: lying %.1f N, sitting %.1f, more fat %.1f\n", i, lying_n,
                  plan[SITTING].point[i].target.closes_n, plan[FAT].point[i].target.closes_n);
    assert_true(lying_n > 3 && lying_n < 15);
    assert_true(plan[SITTING].point[i].target.closes_n > 1.5 * lying_n);
    assert_true(plan[FAT].point[i].target.closes_n > 1.03 * lying_n);
    assert_true(plan[CLOT].point[i].target.closes_n == lying_n);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(forces_follow_the_patient),
      cmocka_unit_test(expert_and_novice),
      cmocka_unit_test(the_other_vein_counts),
      cmocka_unit_test(an_exam_can_be_cancelled),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
