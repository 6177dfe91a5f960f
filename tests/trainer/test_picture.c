// Guidance in the picture: names and reasons are those of the truth and fade with the level;
// scripted learners find their way sooner with it.
#include "trainer_test.h"

#include "sonde/trainer_picture.h"

static const sonde_picture_mark *mark_of(const sonde_picture *picture, const char *name) {
  for (uint32_t k = 0; k < picture->count; ++k)
    if (strcmp(picture->mark[k].name, name) == 0) return &picture->mark[k];
  return NULL;
}

// A snapshot at the first place of the straight vein: vein and artery side by side, a calf vein
// deeper, under a force that leaves a share of the vein.
static sonde_snapshot picture_at(double aside_m, double force_n, double ratio, double time_s) {
  const sonde_vein_map map = straight_map();
  const sonde_vein_point at = sonde_vein_at(&map, 0.02);
  sonde_pose pose = sonde_vein_pose(&at, 1e-3 * force_n);
  pose.position = v_madd(pose.position, -aside_m, at.across);
  sonde_snapshot s = {.tick = (uint64_t)(1e3 * time_s) + 1,
                      .time_s = time_s,
                      .world_from_probe = pose,
                      .force_normal_n = force_n,
                      .vein_area_ratio = ratio,
                      .artery_area_ratio = 1,
                      .other_vein_ratio = (double)NAN,
                      .vein_rest_m = at.vein_m,
                      .view_count = 3};
  s.view[0] = (sonde_vessel_view){0, false, aside_m, 0.02, 0.004, 0.004, ratio, 0.02};
  s.view[1] = (sonde_vessel_view){1, true, aside_m + 0.012, 0.02, 0.004, 0.004, 1, 0.02};
  s.view[2] = (sonde_vessel_view){2, false, aside_m - 0.008, 0.03, 0.002, 0.002, 1, 0.02};
  return s;
}

static sonde_case_setup setup_of(bool clot) {
  sonde_case_setup setup = {.map = straight_map()};
  setup.map.branch_count = 1;
  snprintf(setup.map.branch[0], sizeof setup.map.branch[0], "great_saphenous");
  if (!clot) return setup;
  setup.pathology =
      (sonde_pathology){.thrombus_fraction = 1, .thrombus_modulus_pa = 6e3, .thrombus_to_m = 0.1};
  setup.findings.lesion_count = 1;
  setup.findings.lesion[0] = (sonde_lesion){.kind = SONDE_LESION_NODE,
                                            .centre_m = vec3(0.058, 0.01, 0.02),
                                            .half_m = vec3(0.005, 0.006, 0.01)};
  return setup;
}

static sonde_picture seen(const sonde_case_setup *setup, const sonde_snapshot *s, int count,
                          sonde_guidance_level level) {
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &setup->map);
  for (uint32_t k = 0; k < plan.count; ++k) plan.point[k].target = sonde_force_target_make(8);
  sonde_judge *judge = NULL;
  sonde_picture picture;
  assert_int_equal(sonde_judge_create(&setup->map, &plan, &judge, NULL), SONDE_OK);
  for (int k = 0; k < count; ++k) assert_true(sonde_judge_feed(judge, &s[k]));
  sonde_picture_read(judge, setup, &s[count - 1], level, &picture);
  sonde_judge_destroy(judge);
  return picture;
}

static void names_fade(void **state) {
  (void)state;
  const sonde_case_setup setup = setup_of(false);
  const sonde_snapshot s = picture_at(0.01, 0.5, 1, 1);
  sonde_picture full = seen(&setup, &s, 1, SONDE_GUIDANCE_FULL);
  sonde_picture hints = seen(&setup, &s, 1, SONDE_GUIDANCE_HINTS);
  sonde_picture none = seen(&setup, &s, 1, SONDE_GUIDANCE_EXAM);
  const sonde_picture_mark *vein = mark_of(&full, "Common femoral vein");
  const sonde_picture_mark *artery = mark_of(&full, "Common femoral artery");
  assert_non_null(vein), assert_non_null(artery);
  assert_non_null(mark_of(&full, "Great saphenous vein"));
  assert_true(vein->wanted && !artery->wanted);
  assert_int_equal(artery->kind, SONDE_MARK_ARTERY);
  assert_non_null(strstr(artery->why, "beats"));
  assert_int_equal(hints.count, full.count);
  for (uint32_t k = 0; k < hints.count; ++k) {
    assert_string_equal(hints.mark[k].name, full.mark[k].name);
    assert_true(!hints.mark[k].wanted && !hints.mark[k].why[0]);
  }
  assert_true(isnan(hints.aside_m) && !hints.way[0]);
  assert_int_equal(none.count, 0);
  // In the air there is nothing to name.
  sonde_snapshot lifted = s;
  lifted.penetration_m = -0.006;
  assert_int_equal(seen(&setup, &lifted, 1, SONDE_GUIDANCE_FULL).count, 0);
  assert_true(isnan(none.aside_m));
}

// The way leads to where the vein is, and ends when it is in the middle.
static void the_way_leads_to_the_vein(void **state) {
  (void)state;
  const sonde_case_setup setup = setup_of(false);
  const double aside_m[] = {0.015, -0.015, 0.002};
  for (int k = 0; k < 3; ++k) {
    const sonde_snapshot s = picture_at(aside_m[k], 0.5, 1, 1);
    const sonde_picture picture = seen(&setup, &s, 1, SONDE_GUIDANCE_FULL);
    if (k < 2)
      assert_near(picture.aside_m, aside_m[k], 1e-9);
    else
      assert_true(isnan(picture.aside_m) && !picture.way[0]);
  }
  // 60 mm along the leg from there: back, and in words.
  sonde_snapshot far = picture_at(0, 0.5, 1, 1);
  far.world_from_probe.position.z += 0.06;
  const sonde_picture picture = seen(&setup, &far, 1, SONDE_GUIDANCE_FULL);
  const double y = q_rotate(far.world_from_probe.rotation, vec3(0, 1, 0)).z;
  assert_true(picture.along_m * y < 0 && fabs(picture.along_m) > 0.03);
  assert_non_null(strstr(picture.way, "towards the groin"));
}

// Closed, open with a clot, too light: each is told by what is there.
static void a_press_is_explained(void **state) {
  (void)state;
  static const struct {
    bool clot;
    double force_n, ratio;
    const char *says;
  } PRESS[] = {{false, 8, 0.05, "closed"},      {true, 9, 0.9, "fresh clot"},
               {true, 5, 0.95, "still open"},   {false, 5, 0.4, "closing"},
               {false, 9, 0.9, "another vein"}, {false, 0.5, 1, "press here"}};
  for (size_t k = 0; k < SONDE_COUNT_OF(PRESS); ++k) {
    const sonde_case_setup setup = setup_of(PRESS[k].clot);
    sonde_snapshot s[2] = {picture_at(0, 0.5, 1, 1),
                           picture_at(0, PRESS[k].force_n, PRESS[k].ratio, 2)};
    const sonde_picture picture = seen(&setup, s, 2, SONDE_GUIDANCE_FULL);
    const sonde_picture_mark *vein = mark_of(&picture, "Common femoral vein");
    assert_non_null(vein);
    if (!strstr(vein->why, PRESS[k].says))
      fail_msg("says: %s, expected %s", vein->why, PRESS[k].says);
    // A lesion is named where it lies at rest, before a press moves it.
    assert_null(PRESS[k].force_n >= 3 ? mark_of(&picture, "Lymph node") : NULL);
    const sonde_picture before = seen(&setup, s, 1, SONDE_GUIDANCE_FULL);
    assert_int_equal(mark_of(&before, "Lymph node") != NULL, PRESS[k].clot);
  }
}

// On a drawn limb the same learners, from the same points: the way that is shown spares most of the
// search.
static void guidance_shortens_the_search(void **state) {
  (void)state;
  enum { LEARNERS = 20 };
  sonde_case patient;
  sonde_exam_setups setups;
  sonde_plan plan;
  sonde_error error = {0};
  sonde_case_generate(3, SONDE_CASE_EASY, &patient);
  sonde_exam_protocol protocol =
      protocol_of("{sonde_protocol: 1, id: a, title: A, text: a, places: [{title: B, at: {station: "
                  "common_femoral}}, {title: C, at: {station: femoral_mid}}]}");
  if (sonde_exam_lay(&patient, &protocol, NULL, NULL, &setups, &plan, &error))
    fail_msg("%s", error.message);
  for (uint32_t place = 0; place < plan.count; ++place) {
    sonde_search search[SONDE_GUIDANCE_LEVELS * LEARNERS];
    double path_m[SONDE_GUIDANCE_LEVELS] = {0}, ticks[SONDE_GUIDANCE_LEVELS] = {0};
    uint32_t found[SONDE_GUIDANCE_LEVELS] = {0}, farther = 0;
    assert_int_equal(sonde_learner_search(&setups, &plan, place, LEARNERS, search, NULL), SONDE_OK);
    for (uint32_t k = 0; k < SONDE_GUIDANCE_LEVELS * LEARNERS; ++k) {
      path_m[k / LEARNERS] += search[k].path_m / LEARNERS;
      ticks[k / LEARNERS] += (double)search[k].ticks / LEARNERS;
      found[k / LEARNERS] += search[k].found;
      if (k < LEARNERS) farther += search[k].path_m > search[2 * LEARNERS + k].path_m + 0.02;
    }
    print_message("place %u: path %.0f, %.0f, %.0f mm; ticks %.0f, %.0f, %.0f; found %u %u %u\n",
                  place, 1e3 * path_m[0], 1e3 * path_m[1], 1e3 * path_m[2], ticks[0], ticks[1],
                  ticks[2], found[0], found[1], found[2]);
    assert_int_equal(found[0], LEARNERS);
    assert_true(path_m[0] < path_m[2] / 3 && ticks[0] < ticks[2] / 3);
    assert_true(path_m[1] <= path_m[2]);
    assert_true(farther <= LEARNERS / 10); // of single learners whom guidance led about
  }
  sonde_exam_setups_clear(&setups);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(names_fade), cmocka_unit_test(the_way_leads_to_the_vein),
      cmocka_unit_test(a_press_is_explained), cmocka_unit_test(guidance_shortens_the_search)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
