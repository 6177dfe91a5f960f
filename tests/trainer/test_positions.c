// An exam in two positions of the patient: places belong to one of them, time, presses and coverage
// go on from one to the other, and an operator asks for the next.
#include "trainer_test.h"

// The straight map as a position has it whose vein is shorter below the middle, in a frame of its
// own, 1 m beside.
static const double BENT = 0.9, BESIDE_M = 1;
static double bent_z(double z) { return z < 0.12 ? z : 0.12 + BENT * (z - 0.12); }
static sonde_vein_map bent_map(void) {
  sonde_vein_map map = straight_map();
  map.length_m = bent_z(0.2);
  for (uint32_t k = 0; k < map.point_count; ++k) {
    sonde_vein_point *p = &map.point[k];
    p->along_m = p->z_m = p->vein_m.z = p->skin_m.z = bent_z(p->z_m);
    p->vein_m.y = p->skin_m.y = BESIDE_M;
  }
  for (uint32_t i = 0; i < 5; ++i) {
    map.segment[i].from_m = bent_z(map.segment[i].from_m);
    map.segment[i].to_m = bent_z(map.segment[i].to_m);
  }
  return map;
}

// The upper places in the first position, the lower ones in the other.
static sonde_plan plan_of_two(const sonde_vein_map *straight, const sonde_vein_map *bent) {
  sonde_exam_protocol upper = protocol_of(
      "{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, text: b, from: 10, to: "
      "110, every_mm: 20}]}");
  sonde_exam_protocol lower = protocol_of(
      "{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, text: b, from: 129, to: "
      "183, every_mm: 18}]}");
  sonde_plan plan = plan_of(&upper, straight), more = plan_of(&lower, bent);
  for (uint32_t i = 0; i < more.count; ++i) {
    sonde_plan_point *p = &plan.point[plan.count++];
    *p = more.point[i];
    p->held = 1, p->position = SONDE_LIMB_PRONE_BENT;
    p->course_m = sonde_vein_course(bent, straight, p->at.along_m);
  }
  return plan;
}

// Ends of the segments are the same places of the vein, between them it is shared evenly.
static void a_place_has_its_like(void **state) {
  (void)state;
  sonde_vein_map a = straight_map(), b = bent_map();
  for (double z = 0; z <= 0.2; z += 0.005) {
    assert_near(sonde_vein_course(&a, &b, z), bent_z(z), 1e-12);
    assert_near(sonde_vein_course(&b, &a, bent_z(z)), z, 1e-12);
  }
  assert_true(isnan(sonde_vein_course(&a, &b, (double)NAN)));
}

static void feed_bent(sonde_judge *judge, double z_m, double start_s) {
  test_press press = closing(z_m);
  for (double t = 0; t < 2.4; t += 0.03) {
    sonde_snapshot s = press_at(&press, start_s, start_s + t);
    s.world_from_probe.position.y = s.vein_rest_m.y = BESIDE_M;
    assert_true(sonde_judge_feed(judge, &s));
  }
}

// All places pressed, each in its position: everything is covered, and the exam took the time of
// both. In the other position the presses examine nothing.
static void an_exam_goes_on_in_another_position(void **state) {
  (void)state;
  sonde_vein_map map[2] = {straight_map(), bent_map()};
  sonde_plan plan = plan_of_two(&map[0], &map[1]);
  for (int turns = 0; turns < 2; ++turns) {
    sonde_judge *judge = judge_of(&plan);
    double start_s = 0;
    for (uint32_t i = 0; i < plan.count; ++i) {
      const sonde_plan_point *p = &plan.point[i];
      if (p->held == 1 && plan.point[i - 1].held == 0) {
        sonde_guidance g = sonde_judge_guidance(judge);
        assert_true(g.turn && g.point == i);
        // The segment that was seen last is asked for before.
        const char *said = g.undecided < SONDE_SEGMENTS ? g.detail : g.text;
        assert_non_null(strstr(said, "prone, the knee bent"));
        if (turns) {
          assert_true(sonde_judge_hold(judge, 1, &map[1]));
          start_s = 0;
        }
        assert_true(sonde_judge_guidance(judge).turn == !turns);
      }
      if (p->held == 1)
        feed_bent(judge, p->at.z_m, start_s);
      else {
        test_press press = closing(p->at.z_m);
        feed_press(judge, &press, start_s, 0.03);
      }
      start_s += 3;
    }
    sonde_judge_finish(judge);
    sonde_metrics m = sonde_judge_metrics(judge);
    uint32_t count;
    const sonde_compression *press = sonde_judge_compressions(judge, &count);
    assert_int_equal(count, plan.count);
    assert_int_equal(m.points_done, turns ? plan.count : 6);
    assert_near(m.time_s, 3.0 * plan.count - 0.6, 0.8);
    for (uint32_t i = 1; i < count; ++i) assert_true(press[i].start_s > press[i - 1].end_s);
    if (turns) {
      assert_near(m.coverage, 1, 1e-9);
      for (uint32_t i = 0; i < count; ++i) {
        assert_int_equal(press[i].place, i);
        assert_near(press[i].along_m, plan.point[i].course_m, 0.001);
      }
    }
    sonde_judge_destroy(judge);
  }
}

// A press under way ends when the patient turns; the force before is none of the new position.
static void turning_ends_a_press(void **state) {
  (void)state;
  sonde_vein_map map[2] = {straight_map(), bent_map()};
  sonde_plan plan = plan_of_two(&map[0], &map[1]);
  sonde_judge *judge = judge_of(&plan);
  test_press press = closing(0.05);
  for (double t = 0; t < 1.1; t += 0.03) {
    sonde_snapshot s = press_at(&press, 0, t);
    assert_true(sonde_judge_feed(judge, &s));
  }
  assert_int_equal(sonde_judge_state(judge).state, SONDE_PRESS_STATE_COMPLETE);
  assert_true(sonde_judge_hold(judge, 1, &map[1]));
  assert_int_equal(sonde_judge_state(judge).state, SONDE_PRESS_STATE_NONE);
  uint32_t count;
  const sonde_compression *p = sonde_judge_compressions(judge, &count);
  assert_int_equal(count, 1);
  assert_int_equal(p->result, SONDE_PRESS_COMPLETE);
  double before_m = sonde_judge_metrics(judge).path_m;
  sonde_snapshot away = press_at(&press, 10, 0.03);
  away.world_from_probe.position.y = BESIDE_M; // no path leads there
  assert_true(sonde_judge_feed(judge, &away));
  assert_near(sonde_judge_metrics(judge).path_m, before_m, 1e-9);
  sonde_judge_destroy(judge);
}

// Who skips nothing asks for each position once, and comes to its first place with another hand.
static void an_operator_asks_for_the_position(void **state) {
  (void)state;
  sonde_vein_map map[2] = {straight_map(), bent_map()};
  sonde_plan plan = plan_of_two(&map[0], &map[1]);
  sonde_judge *judge = judge_of(&plan);
  sonde_operator *op;
  sonde_device hand;
  assert_int_equal(sonde_operator_create("expert", 1, &map[0], &plan, 0.004, &op, &hand, NULL),
                   SONDE_OK);
  uint32_t held = 0, turned = 0;
  uint64_t tick = 0;
  for (uint64_t n = 0; !sonde_operator_done(op) && n < 200000; ++n, ++tick) {
    sonde_device_sample sample;
    if (sonde_operator_wants(op) != held) {
      held = sonde_operator_wants(op), ++turned;
      hand.destroy(hand.self);
      assert_int_equal(sonde_operator_hold(op, held, &map[held], 0.004, &hand, NULL), SONDE_OK);
      assert_true(sonde_judge_hold(judge, held, &map[held]));
      tick = 0;
      hand.read(hand.self, tick, &sample);
      assert_near(v_distance(sample.world_from_probe.position, plan.point[6].at.skin_m), 0.006,
                  0.004);
    }
    hand.read(hand.self, tick, &sample);
    if (tick % 10) continue;
    sonde_pose pose = sample.world_from_probe;
    double depth_m = 0.07 - pose.position.x, force_n = depth_m > 0 ? depth_m * 1500 : 0;
    sonde_snapshot s = {.tick = tick,
                        .time_s = 0.004 * (double)tick,
                        .world_from_probe = pose,
                        .force_normal_n = force_n,
                        .vein_area_ratio = fmax(0, 1 - force_n / 20),
                        .artery_area_ratio = 1,
                        .vein_rest_m = vec3(0.05, held * BESIDE_M, pose.position.z)};
    sonde_judge_feed(judge, &s);
    sonde_operator_see(op, &s);
  }
  assert_true(sonde_operator_done(op));
  assert_int_equal(turned, 1);
  sonde_metrics m = sonde_judge_metrics(judge);
  assert_int_equal(m.points_done, plan.count);
  for (uint32_t i = 0; i < 5; ++i)
    assert_int_equal(sonde_operator_decision(op, i), SONDE_DECISION_COMPRESSIBLE);
  hand.destroy(hand.self);
  sonde_operator_destroy(op);
  sonde_judge_destroy(judge);
}

// A patient who can only sit is examined sitting, whatever the places ask for; a posture of the
// circulation is kept too.
static void a_case_says_what_the_patient_can(void **state) {
  (void)state;
  static const char LEG[] =
      "{sonde_case: 3, id: a, title: A, level: easy, history: b, leg: {seed: 3, bmi: 24%s}%s, "
      "truth: {thrombosis: false, diagnosis: none, segments: {common_femoral: compressible}}}";
  char text[512];
  sonde_case c;
  sonde_error error = {0};
  snprintf(text, sizeof text, LEG, "", "");
  assert_int_equal(sonde_case_parse(text, "a.yaml", &c, &error), SONDE_OK);
  for (uint32_t k = 0; k <= SONDE_LIMB_POSITIONS; ++k)
    assert_true(sonde_case_takes(&c, (sonde_limb_position)k));
  snprintf(text, sizeof text, LEG, ", position: sitting, positions: [standing]", "");
  assert_int_equal(sonde_case_parse(text, "a.yaml", &c, &error), SONDE_OK);
  for (uint32_t k = 0; k < SONDE_LIMB_POSITIONS; ++k)
    assert_true(sonde_case_takes(&c, (sonde_limb_position)k) ==
                (k == SONDE_LIMB_SITTING || k == SONDE_LIMB_STANDING));
  char *again = NULL;
  sonde_case read;
  assert_int_equal(sonde_case_text(&c, &again, NULL), SONDE_OK);
  assert_int_equal(sonde_case_parse(again, "again.yaml", &read, &error), SONDE_OK);
  assert_true(read.position == c.position && read.positions == c.positions);
  sonde_free(again);
  snprintf(text, sizeof text, LEG, "", ", circulation: {posture: sitting}");
  assert_int_equal(sonde_case_parse(text, "a.yaml", &c, &error), SONDE_OK);
  assert_false(sonde_case_takes(&c, SONDE_LIMB_PRONE_BENT));
  snprintf(text, sizeof text, LEG, ", positions: [lying]", "");
  assert_int_equal(sonde_case_parse(text, "a.yaml", &c, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "prone_bent"));
  sonde_exam_protocol p = protocol_of("{sonde_protocol: 1, id: a, title: A, text: a, places: "
                                      "[{title: B, text: b, at: 20, position: "
                                      "prone_bent}, {title: C, text: c, at: 40}]}");
  assert_int_equal(p.stop[0].position, SONDE_LIMB_PRONE_BENT);
  assert_int_equal(p.stop[1].position, SONDE_LIMB_POSITIONS);
  assert_int_equal(
      sonde_exam_protocol_parse("{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, "
                                "text: b, at: 20, position: upright}]}",
                                "p.yaml", &p, &error),
      SONDE_FORMAT);
}

// A branch's mouth closes with the vein that it opens into: where the great saphenous vein's arch
// runs along the beam it asks for no more than twice the force of the common femoral vein behind
// it, which a hand gives.
static void branches_in_the_groin_close_with_the_main_vein(void **state) {
  (void)state;
  static const char *const PATIENT[] = {"popliteal-near", "calf-to-knee"};
  const sonde_exam_protocol groin = protocol_of(
      "{sonde_protocol: 1, id: a, title: A, text: a, places: ["
      "{title: B, text: b, at: {station: saphenofemoral_junction}, position: supine_turned}, "
      "{title: C, text: c, at: {station: saphenofemoral_junction}, position: supine_turned, "
      "segment: great_saphenous}]}");
  for (size_t k = 0; k < SONDE_COUNT_OF(PATIENT); ++k) {
    static sonde_case patient;
    static sonde_exam_setups setups;
    static sonde_plan plan;
    sonde_error error = {0};
    char path[1024];
    snprintf(path, sizeof path, SONDE_SOURCE_DIR "/data/cases/%s.yaml", PATIENT[k]);
    sonde_status status = sonde_case_load(path, &patient, &error);
    if (!status)
      status = sonde_exam_prepare(&patient, &groin, NULL, NULL, NULL, &setups, &plan, &error);
    if (status) fail_msg("%s: %s", PATIENT[k], error.message);
    assert_int_equal(plan.count, 2);
    const double main_n = plan.point[0].target.closes_n, branch_n = plan.point[1].target.closes_n;
    print_message("%s: %.1f N, great saphenous vein %.1f N\n", PATIENT[k], main_n, branch_n);
    assert_true(main_n > 5 && main_n < 20 && branch_n < 20);
    assert_true(branch_n < 2 * main_n);
    sonde_exam_setups_clear(&setups);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_place_has_its_like),
      cmocka_unit_test(an_exam_goes_on_in_another_position),
      cmocka_unit_test(turning_ends_a_press),
      cmocka_unit_test(an_operator_asks_for_the_position),
      cmocka_unit_test(a_case_says_what_the_patient_can),
      cmocka_unit_test(branches_in_the_groin_close_with_the_main_vein),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
