// Case files: every mistake is named with its line, what ships is good, what is drawn is good, the
// truth must fit, and writing and reading agree.
#include "../sanitized.h"
#include "trainer_test.h"

static const char GOOD[] = "sonde_case: 2\n"
                           "id: one\n"
                           "title: One\n"
                           "level: easy\n"
                           "history: >\n"
                           "  Two lines of\n"
                           "  history.\n"
                           "thigh: {seed: 3, fat-front-mm: 6}\n"
                           "circulation: {posture: sitting}\n"
                           "vein:\n"
                           "  stage: acute_occlusive\n"
                           "  from: {segment: femoral_mid, share: 0.1}\n"
                           "  to: {segment: femoral_mid, share: 0.9}\n"
                           "truth:\n"
                           "  thrombosis: true\n"
                           "  diagnosis: A clot\n"
                           "  segments: {common_femoral: compressible, femoral_proximal: "
                           "compressible, femoral_mid: clot, femoral_distal: compressible, "
                           "popliteal: compressible}\n";

// The good text with one piece replaced.
static char *changed(const char *from, const char *to) {
  static char text[4096];
  const char *at = strstr(GOOD, from);
  assert_non_null(at);
  snprintf(text, sizeof text, "%.*s%s%s", (int)(at - GOOD), GOOD, to, at + strlen(from));
  return text;
}

static void a_case_is_read(void **state) {
  (void)state;
  sonde_case c;
  sonde_error error = {0};
  if (sonde_case_parse(GOOD, "one.yaml", &c, &error)) fail_msg("%s", error.message);
  assert_string_equal(c.history, "Two lines of history.");
  assert_int_equal(c.thigh, SONDE_CASE_GENERATED);
  assert_int_equal(c.seed, 3);
  assert_near(c.known.fat_front_m, 0.006, 1e-15);
  assert_true(isnan(c.known.length_m));
  assert_int_equal(c.circulation.posture, SONDE_POSTURE_SITTING);
  assert_string_equal(c.pathology.name, "acute_occlusive");
  assert_int_equal(c.truth_count, 5);
  assert_int_equal(c.truth[2], SONDE_DECISION_CLOT);
}

// A clot has the form of its stage, or that which the file gives it; both are written and read
// again.
static void a_clot_has_a_form(void **state) {
  (void)state;
  static const struct {
    const char *vein;
    sonde_clot_form form;
  } CASE[] = {{"stage: partial_mural", SONDE_CLOT_MURAL},
              {"stage: free_floating", SONDE_CLOT_FLOATING},
              {"stage: recanalised\n  form: mural", SONDE_CLOT_MURAL},
              {"stage: partial_mural\n  form: recanalised", SONDE_CLOT_RECANALISED}};
  for (size_t k = 0; k < SONDE_COUNT_OF(CASE); ++k) {
    sonde_case c, again;
    sonde_error error = {0};
    if (sonde_case_parse(changed("stage: acute_occlusive", CASE[k].vein), "one.yaml", &c, &error))
      fail_msg("%s", error.message);
    assert_int_equal(c.pathology.form, CASE[k].form);
    assert_int_equal(sonde_case_save(&c, "test_case_form.yaml", NULL), SONDE_OK);
    if (sonde_case_load("test_case_form.yaml", &again, &error)) fail_msg("%s", error.message);
    assert_int_equal(again.pathology.form, CASE[k].form);
  }
}

// A leg in a position: it is read, written and read again, and takes no posture beside it.
static void a_leg_has_its_position(void **state) {
  (void)state;
  static const char LEG[] = "sonde_case: 3\n"
                            "id: bent\n"
                            "title: Bent\n"
                            "level: easy\n"
                            "history: None.\n"
                            "leg: {seed: 3, bmi: 24, side: left, position: prone_bent}\n"
                            "%s"
                            "vein: {stage: healthy}\n"
                            "truth:\n"
                            "  thrombosis: false\n"
                            "  diagnosis: None\n"
                            "  segments: {common_femoral: compressible, femoral_proximal: "
                            "compressible, femoral_mid: compressible, femoral_distal: "
                            "compressible, popliteal: compressible}\n";
  char text[1024];
  sonde_case c, again;
  sonde_case_setup setup;
  sonde_error error = {0};
  snprintf(text, sizeof text, LEG, "");
  if (sonde_case_parse(text, "bent.yaml", &c, &error)) fail_msg("%s", error.message);
  assert_int_equal(c.position, SONDE_LIMB_PRONE_BENT);
  assert_int_equal(sonde_case_save(&c, "test_case_bent.yaml", NULL), SONDE_OK);
  assert_int_equal(sonde_case_load("test_case_bent.yaml", &again, NULL), SONDE_OK);
  assert_int_equal(again.position, SONDE_LIMB_PRONE_BENT);
  remove("test_case_bent.yaml");
  // Its thigh is that position's, and so are the places of the examination.
  if (sonde_case_build(&c, NULL, NULL, &setup, &error)) fail_msg("%s", error.message);
  assert_null(strstr(setup.model->name, c.id)); // learners read the name, and ids may tell findings
  const sonde_limb_pose *pose = sonde_limb_pose_of(setup.model);
  assert_non_null(pose);
  assert_int_equal(sonde_limb_pose_setting(pose).position, SONDE_LIMB_PRONE_BENT);
  sonde_limb_station station[SONDE_LIMB_STATIONS];
  sonde_limb_pose_stations(pose, station);
  for (uint32_t k = 0; k < setup.map.station_count; ++k) {
    sonde_vec3 skin = sonde_limb_to_model(sonde_limb_of(setup.model), station[k].skin_m);
    assert_near(v_distance(setup.map.station[k].probe.position, skin), 0, 1e-6);
  }
  sonde_case_setup_clear(&setup);
  // The great saphenous vein is pressed below its arch, where it runs across the plane.
  c.position = SONDE_LIMB_SUPINE_TURNED;
  if (sonde_case_build(&c, NULL, NULL, &setup, &error)) fail_msg("%s", error.message);
  const uint32_t saphenous = sonde_vein_segment(&setup.map, "great_saphenous");
  const sonde_thigh_anatomy *anatomy = setup.model->anatomy;
  uint32_t branch = 0, junction = 0, at = 0;
  while (strcmp(anatomy->branch[branch].name, "great_saphenous") != 0) ++branch;
  while (strcmp(setup.map.station[junction].name, "saphenofemoral_junction") != 0) ++junction;
  const sonde_vessel *line = &anatomy->branch[branch].line;
  const sonde_map_station *station_of = &setup.map.station[junction];
  for (uint32_t i = 1; i + 1 < line->count; ++i)
    if (v_distance(line->point[i].centre_m, station_of->vein_m[saphenous]) <
        v_distance(line->point[at].centre_m, station_of->vein_m[saphenous]))
      at = i;
  assert_true(at > 0 && at + 1 < line->count);
  const sonde_vec3 course =
      v_unit(v_sub(line->point[at + 1].centre_m, line->point[at - 1].centre_m), vec3(0, 0, 1));
  const double along = v_dot(course, q_rotate(station_of->probe.rotation, vec3(0, 0, 1)));
  print_message("saphenous vein at the junction: cosine to the beam %.2f\n", along);
  assert_true(fabs(along) < 0.5);
  sonde_case_setup_clear(&setup);
  snprintf(text, sizeof text, LEG, "circulation: {posture: sitting}\n");
  assert_int_equal(sonde_case_parse(text, "bent.yaml", &c, &error), SONDE_MISMATCH);
  assert_non_null(strstr(error.message, "no posture"));
}

static void mistakes_are_named_with_their_line(void **state) {
  (void)state;
  static const struct {
    const char *from, *to, *says;
    int line;
  } MISTAKE[] = {
      {"sonde_case: 2", "sonde_case: 7", "version 7", 1},
      {"level: easy", "criteria: {force_low_n: 3}", "unknown key 'criteria'", 4},
      {"id: one", "id: One", "'O'", 2},
      {"id: one\n", "", "id is missing", 1},
      {"title: One", "titel: One", "unknown key 'titel'", 3},
      {"level: easy", "level: simple", "first, easy, hard", 4},
      {"thigh: {seed: 3, fat-front-mm: 6}", "thigh: small", "expected bundled", 8},
      {"fat-front-mm: 6", "fat-front-mm: 600", "from 2 to 60", 8},
      {"seed: 3", "seed: -3", "seed must be", 8},
      {"sitting", "lying", "supine, sitting, standing", 9},
      {"stage: acute_occlusive", "stage: odd", "odd", 11},
      {"stage: acute_occlusive", "form: wavy\n  stage: partial_mural", "mural, floating", 11},
      {"share: 0.1", "share: 1.1", "from 0 to 1", 12},
      {"  from: {segment: femoral_mid, share: 0.1}\n", "", "both from and to", 11},
      {"thrombosis: true", "thrombosis: perhaps", "false, true", 15},
      {"thrombosis: true", "thrombosis: false", "a segment is clot", 15},
      {"femoral_mid: clot", "femoral_mid: open", "compressible, clot", 17},
      {"femoral_mid: clot", "femoral_middle: clot", "unknown key", 17},
      {"  segments: {common_femoral: compressible, femoral_proximal: compressible, femoral_mid: "
       "clot, "
       "femoral_distal: compressible, popliteal: compressible}\n",
       "", "the truth has no segments", 15},
      {"title: One", "title: [", "not YAML", 5},
  };
  for (size_t i = 0; i < SONDE_COUNT_OF(MISTAKE); ++i) {
    sonde_case c;
    sonde_error error = {0};
    const char *text = changed(MISTAKE[i].from, MISTAKE[i].to);
    if (!sonde_case_parse(text, "one.yaml", &c, &error)) fail_msg("accepted: %s", MISTAKE[i].to);
    char place[32];
    snprintf(place, sizeof place, "one.yaml:%d:", MISTAKE[i].line);
    if (!strstr(error.message, MISTAKE[i].says) ||
        strncmp(error.message, place, strlen(place)) != 0)
      fail_msg("'%s' says: %s (expected %s %s)", MISTAKE[i].to, error.message, place,
               MISTAKE[i].says);
  }
}

static sonde_status build(const sonde_case *c, sonde_case_setup *setup, sonde_error *error) {
  return sonde_case_build(c, NULL, NULL, setup, error);
}

// The clot lies where the file says; moved truth, moved clot and a clot beyond the leg are refused.
static void the_truth_must_fit(void **state) {
  (void)state;
  sonde_case c, bad;
  sonde_case_setup setup;
  sonde_error error = {0};
  assert_int_equal(sonde_case_parse(GOOD, "one.yaml", &c, NULL), SONDE_OK);
  if (build(&c, &setup, &error)) fail_msg("%s", error.message);
  assert_null(strstr(setup.model->name, c.id));
  uint32_t mid = sonde_vein_segment(&setup.map, "femoral_mid");
  assert_true(setup.pathology.thrombus_from_m > setup.map.segment[mid].from_m);
  assert_true(setup.pathology.thrombus_to_m < setup.map.segment[mid].to_m);
  double supine_pa = 10 * SONDE_PA_PER_MMHG;
  assert_true(setup.pathology.venous_pressure_pa > 2 * supine_pa);
  sonde_case_setup_clear(&setup);
  bad = c;
  bad.truth[1] = SONDE_DECISION_CLOT;
  assert_int_equal(build(&bad, &setup, &error), SONDE_MISMATCH);
  assert_non_null(strstr(error.message, "femoral_proximal clot"));
  assert_null(setup.model);
  bad = c;
  snprintf(bad.extent.to.segment, sizeof bad.extent.to.segment, "femoral_distal");
  assert_int_equal(build(&bad, &setup, &error), SONDE_MISMATCH);
  assert_non_null(strstr(error.message, "femoral_distal compressible"));
  bad = c;
  bad.extent.to.shift_m = 0.5;
  assert_int_equal(build(&bad, &setup, &error), SONDE_ARGUMENT);
  bad = c;
  bad.truth_count = 4;
  assert_int_equal(build(&bad, &setup, &error), SONDE_MISMATCH);
  assert_non_null(strstr(error.message, "misses"));
  // Without a truth there is nothing to deny: the findings give it.
  sonde_exam_protocol *ways;
  sonde_exam_setups setups;
  sonde_plan plan;
  uint32_t count;
  bad = c;
  bad.truth_count = 0, bad.thrombosis = false;
  if (build(&bad, &setup, &error)) fail_msg("%s", error.message);
  assert_true(setup.thrombosis);
  for (uint32_t i = 0; i < setup.map.segment_count; ++i)
    assert_int_equal(setup.clot[i], strcmp(setup.map.segment[i].name, "femoral_mid") == 0);
  sonde_case_setup_clear(&setup);
  bad.pathology.thrombus_fraction = 0;
  bad.branch_count = 1;
  bad.branch[0] =
      (sonde_case_branch){.branch = "great_saphenous",
                          .pathology = c.pathology,
                          .extent = {.from.of_branch = true, .to = {.of_branch = true}}};
  for (int k = 0; k < 2; ++k) { // a millimetre does not count; nothing superficial is a thrombosis
    bad.branch[0].extent.to.shift_m = k ? 0.05 : 0.001;
    if (build(&bad, &setup, &error)) fail_msg("%s", error.message);
    assert_false(setup.thrombosis);
    assert_int_equal(setup.clot[sonde_vein_segment(&setup.map, "great_saphenous")], k);
    sonde_case_setup_clear(&setup);
  }
  assert_int_equal(
      sonde_exam_protocol_list(SONDE_SOURCE_DIR "/data/protocols", &ways, &count, NULL), SONDE_OK);
  assert_int_equal(sonde_exam_lay(&bad, &ways[0], NULL, NULL, &setups, &plan, &error),
                   SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "without truth"));
  sonde_free(ways);
  bad = c;
  bad.thigh = SONDE_CASE_BUNDLED;
  assert_int_equal(build(&bad, &setup, &error), SONDE_NOT_FOUND);
}

// Lesions lie where the vein and the skin are; a branch has to be there.
static void findings_are_placed(void **state) {
  (void)state;
  sonde_case c;
  sonde_case_setup setup;
  sonde_error error = {0};
  assert_int_equal(sonde_case_parse(GOOD, "one.yaml", &c, NULL), SONDE_OK);
  c.lesion_count = 1;
  c.lesion[0] = (sonde_case_lesion){.kind = SONDE_LESION_NODE,
                                    .station = {.segment = "common_femoral", .share = 0.5},
                                    .depth_m = 0.012,
                                    .half_m = {0.004, 0.005, 0.008}};
  c.branch_count = 1;
  c.branch[0].extent.whole = true;
  snprintf(c.branch[0].branch, sizeof c.branch[0].branch, "great_saphenous");
  if (build(&c, &setup, &error)) fail_msg("%s", error.message);
  const sonde_lesion *lesion = &setup.findings.lesion[0];
  double along = sonde_vein_along(&setup.map, lesion->centre_m.z);
  sonde_vein_point p = sonde_vein_at(&setup.map, along);
  assert_near(v_distance(lesion->centre_m, p.skin_m), 0.012, 0.001);
  assert_true(v_distance(lesion->centre_m, p.vein_m) < p.depth_m);
  assert_int_equal(setup.findings.branch_count, 1);
  sonde_case_setup_clear(&setup);
  snprintf(c.branch[0].branch, sizeof c.branch[0].branch, "jugular");
  assert_int_equal(build(&c, &setup, &error), SONDE_NOT_FOUND);
  assert_non_null(strstr(error.message, "jugular"));
}

static void same_case(const sonde_case *a, const sonde_case *b) {
  assert_string_equal(a->id, b->id);
  assert_string_equal(a->history, b->history);
  assert_string_equal(a->note, b->note);
  assert_string_equal(a->diagnosis, b->diagnosis);
  assert_true(a->level == b->level && a->thigh == b->thigh && a->seed == b->seed);
  assert_near(a->pathology.thrombus_modulus_pa, b->pathology.thrombus_modulus_pa, 1e-9);
  assert_true(a->pathology.thrombus_fraction == b->pathology.thrombus_fraction);
  assert_true(a->extent.whole == b->extent.whole && a->extent.from.share == b->extent.from.share);
  assert_string_equal(a->extent.to.segment, b->extent.to.segment);
  assert_true(a->circulation.posture == b->circulation.posture);
  assert_near(a->circulation.breath_pa, b->circulation.breath_pa, 1e-9);
  assert_near(a->circulation.valve_leak, b->circulation.valve_leak, 1e-9);
  assert_true(a->webs == b->webs && a->oedema == b->oedema);
  assert_true(a->thrombosis == b->thrombosis && a->truth_count == b->truth_count);
  assert_memory_equal(a->truth, b->truth, a->truth_count * sizeof a->truth[0]);
  assert_true(a->lesion_count == b->lesion_count && a->branch_count == b->branch_count);
  for (uint32_t i = 0; i < a->lesion_count; ++i) {
    assert_near(a->lesion[i].depth_m, b->lesion[i].depth_m, 1e-12);
    assert_near(a->lesion[i].half_m.z, b->lesion[i].half_m.z, 1e-12);
  }
  assert_int_equal(a->look_alike_count, b->look_alike_count);
  assert_int_equal(a->thigh, b->thigh);
  assert_int_equal(a->leg.side, b->leg.side);
  if (isfinite(a->leg.bmi)) assert_near(a->leg.bmi, b->leg.bmi, 1e-9);
}

// A clot of a branch is where the file says, as a share of the branch; what the truth does not name
// follows from it, and what it names must fit. Deep ones are a thrombosis, superficial ones not.
static void a_branch_has_its_own_truth(void **state) {
  (void)state;
  static const char *const FINDING =
      "findings:\n  branches:\n  - {branch: %s, stage: acute_occlusive, from: {share: 0.25}, to: "
      "{share: 0.5}}\ntruth:\n  thrombosis: %s\n  diagnosis: D\n  segments: {common_femoral: "
      "compressible, femoral_proximal: compressible, femoral_mid: compressible, femoral_distal: "
      "compressible, popliteal: compressible%s}\n";
  static const struct {
    const char *branch, *thrombosis, *named, *says;
  } TRY[] = {{"posterior_tibial_vein", "true", "", NULL},
             {"posterior_tibial_vein", "true", ", posterior_tibial: clot", NULL},
             {"posterior_tibial_vein", "false", "", "a segment is clot"},
             {"great_saphenous", "false", ", great_saphenous: clot", NULL},
             {"great_saphenous", "true", "", "no deep segment is clot"},
             {"posterior_tibial_vein", "true", ", peroneal: clot", "peroneal clot, but 0"}};
  for (size_t i = 0; i < SONDE_COUNT_OF(TRY); ++i) {
    char text[1024], finding[800];
    snprintf(finding, sizeof finding, FINDING, TRY[i].branch, TRY[i].thrombosis, TRY[i].named);
    snprintf(text, sizeof text,
             "sonde_case: 3\nid: b\ntitle: B\nlevel: hard\nhistory: h\nleg: {seed: 3, sex: male, "
             "bmi: 24}\ncirculation: {valve_leak: 0.5}\n%s",
             finding);
    sonde_case c, back;
    sonde_case_setup setup = {0};
    sonde_error error = {0};
    char *written = NULL;
    sonde_status status = sonde_case_parse(text, "b.yaml", &c, &error);
    if (!status && (i == 0 || TRY[i].says)) status = build(&c, &setup, &error);
    if (TRY[i].says) {
      assert_int_equal(status, SONDE_MISMATCH);
      if (!strstr(error.message, TRY[i].says)) fail_msg("%s", error.message);
      continue;
    }
    if (status) fail_msg("%s", error.message);
    bool deep = strcmp(TRY[i].thrombosis, "true") == 0;
    assert_int_equal(sonde_case_truth(&c, "posterior_tibial"),
                     deep ? SONDE_DECISION_CLOT : SONDE_DECISION_COMPRESSIBLE);
    assert_int_equal(sonde_case_truth(&c, "great_saphenous"),
                     deep ? SONDE_DECISION_COMPRESSIBLE : SONDE_DECISION_CLOT);
    assert_int_equal(sonde_case_text(&c, &written, NULL), SONDE_OK);
    assert_int_equal(sonde_case_parse(written, "again", &back, &error), SONDE_OK);
    same_case(&c, &back);
    assert_memory_equal(&c.branch[0].extent, &back.branch[0].extent, sizeof c.branch[0].extent);
    sonde_free(written);
    if (i > 0) continue;
    // A quarter of the branch: the lengths of its pieces with both ends in the stretch.
    const sonde_pathology *p = &setup.findings.branch[0].pathology;
    uint32_t segment = sonde_vein_segment(&setup.map, "posterior_tibial");
    const sonde_vessel *line =
        &setup.model->anatomy->branch[setup.map.segment[segment].vein[0] - 2].line;
    double all_m = 0, filled_m = 0;
    for (uint32_t k = 1; k < line->count; ++k) {
      sonde_vec3 a = line->point[k - 1].centre_m, b = line->point[k].centre_m;
      double middle_z = 0.5 * (a.z + b.z);
      all_m += v_distance(a, b);
      if (middle_z > p->thrombus_from_m && middle_z < p->thrombus_to_m)
        filled_m += v_distance(a, b);
    }
    assert_near(filled_m / all_m, 0.25, 0.02);
    sonde_case_setup_clear(&setup);
  }
}

// The probe's place above every point of the vein looks at the vein.
static void the_map_looks_at_the_vein(void **state) {
  (void)state;
  sonde_case c;
  sonde_case_setup setup;
  assert_int_equal(sonde_case_parse(GOOD, "one.yaml", &c, NULL), SONDE_OK);
  assert_int_equal(build(&c, &setup, NULL), SONDE_OK);
  const sonde_vein_map *map = &setup.map;
  for (uint32_t k = 0; k < map->point_count; ++k) {
    const sonde_vein_point *p = &map->point[k];
    sonde_vec3 beam = v_madd(p->skin_m, -p->depth_m, p->normal);
    assert_true(v_distance(beam, p->vein_m) < 1e-6);
    assert_near(v_dot(p->normal, p->across), 0, 1e-9);
    assert_near(v_norm(p->across), 1, 1e-9);
    assert_near(sonde_vein_along(map, p->z_m), p->along_m, 1e-9);
    assert_true(p->depth_m > 0.008 && p->depth_m < 0.06);
    if (k > 0) assert_true(v_dot(p->across, map->point[k - 1].across) > 0.9);
  }
  for (uint32_t i = 1; i < map->segment_count && map->segment[i].vein_count == 0; ++i)
    assert_near(map->segment[i].from_m, map->segment[i - 1].to_m, 1e-9);
  sonde_case_setup_clear(&setup);
}

static void save_and_load_again(const sonde_case *c) {
  sonde_case back;
  sonde_error error = {0};
  if (sonde_case_save(c, "trainer_case.yaml", &error)) fail_msg("%s", error.message);
  if (sonde_case_load("trainer_case.yaml", &back, &error)) fail_msg("%s", error.message);
  same_case(c, &back);
  unlink("trainer_case.yaml");
}

static void drawn_cases_are_good(void **state) {
  (void)state;
  uint32_t sick = 0, count = 0, ways;
  sonde_exam_protocol *protocols;
  assert_int_equal(
      sonde_exam_protocol_list(SONDE_SOURCE_DIR "/data/protocols", &protocols, &ways, NULL),
      SONDE_OK);
  for (uint64_t seed = 1; seed <= 40; ++seed)
    for (int level = 0; level < 3; ++level) {
      sonde_case c, again;
      sonde_case_generate(seed, (sonde_case_level)level, &c);
      sonde_case_generate(seed, (sonde_case_level)level, &again);
      same_case(&c, &again);
      save_and_load_again(&c);
      sick += c.thrombosis;
      count++;
      if (seed > SAMPLES(4u, 1u)) continue;
      sonde_case_setup setup;
      sonde_error error = {0};
      if (build(&c, &setup, &error)) fail_msg("%s", error.message);
      for (uint32_t k = 0; k < ways; ++k) {
        sonde_plan plan = plan_of(&protocols[k], &setup.map);
        assert_true(plan.count >= protocols[k].stop_count);
      }
      sonde_case_setup_clear(&setup);
    }
  sonde_free(protocols);
  assert_true(sick > count / 4 && sick < 3 * count / 4);
}

static bool says(const char *text, const char *word) {
  for (const char *at = text; (at = strstr(at, word)); ++at)
    if (at == text || !((at[-1] >= 'a' && at[-1] <= 'z') || (at[-1] >= 'A' && at[-1] <= 'Z')))
      return true;
  return false;
}

// Sex and age of the history are those of the leg, which has the veins that are named.
static void check_texts(const sonde_case *c, const sonde_vein_map *map) {
  bool woman = says(c->history, "Woman, "), man = says(c->history, "Man, ");
  unsigned age = 0;
  const char *told[] = {c->title, c->note, c->diagnosis};
  assert_int_equal(woman + man, 1);
  assert_int_equal(c->leg.sex, woman ? SONDE_SEX_FEMALE : SONDE_SEX_MALE);
  assert_int_equal(sscanf(strchr(c->history, ' '), "%u", &age), 1);
  assert_near(c->leg.age_y, age, 1e-9);
  for (size_t k = 0; k < SONDE_COUNT_OF(told); ++k) {
    if (says(told[k], "saphenous")) assert_true(sonde_vein_has_branch(map, "great_saphenous"));
    if (says(told[k], "double")) assert_true(sonde_vein_has_branch(map, "second_femoral_vein"));
  }
}

// At a station the probe stands on the skin and the first vein of the segment lies in its plane,
// under the face.
static void the_place_shows_its_vein(const sonde_plan_point *p, const sonde_case_setup *setup) {
  if (!p->station) return;
  sonde_vec3 z = v_neg(p->at.normal), y = v_cross(z, p->at.across);
  sonde_vec3 to = v_sub(p->at.vein_m, p->at.skin_m);
  assert_near(v_dot(to, y), 0, 1e-9);
  assert_true(fabs(v_dot(to, p->at.across)) <= 0.025 && v_dot(to, z) > 0.002 && v_dot(to, z) < 0.1);
  const sonde_exam_segment *segment = &setup->map.segment[p->segment];
  const sonde_vessel *line = segment->vein_count
                                 ? &setup->model->anatomy->branch[segment->vein[0] - 2].line
                                 : &setup->model->vein;
  double nearest = INFINITY; // to the line of the first vein, or of its double
  for (uint32_t v = 0; v < (segment->vein_count ? segment->vein_count : 1); ++v) {
    if (segment->vein_count) line = &setup->model->anatomy->branch[segment->vein[v] - 2].line;
    for (uint32_t i = 0; i < line->count; ++i)
      nearest = fmin(nearest, v_distance(line->point[i].centre_m, p->at.vein_m));
  }
  assert_true(nearest < 0.01);
}

// Each has a leg of its own, is built, and has every place of every protocol. Both sides, and legs
// with and without a clot, are two fifths of them at least.
static void the_cases_that_ship_are_good(void **state) {
  (void)state;
  sonde_case *cases;
  sonde_exam_protocol *protocols;
  uint32_t count, sick = 0, left = 0, ways;
  const uint32_t every = SAMPLES(1, 8); // so many cases have one that is built
  sonde_error error = {0};
  if (sonde_case_list(SONDE_SOURCE_DIR "/data/cases", &cases, &count, &error) ||
      sonde_exam_protocol_list(SONDE_SOURCE_DIR "/data/protocols", &protocols, &ways, &error))
    fail_msg("%s", error.message);
  assert_true(count >= 40);
  for (uint32_t i = 0; i < count; ++i) {
    save_and_load_again(&cases[i]);
    sick += cases[i].thrombosis;
    left += cases[i].leg.side == SONDE_LIMB_LEFT;
    assert_true(strlen(cases[i].history) > 40 && strlen(cases[i].note) > 40);
    if (i > 0) assert_true(cases[i].level >= cases[i - 1].level);
    assert_int_equal(cases[i].thigh, SONDE_CASE_LEG);
    for (uint32_t k = 0; k < i; ++k)
      if (cases[k].seed == cases[i].seed)
        fail_msg("%s and %s are the same leg", cases[k].id, cases[i].id);
    if (i % every != 0) continue;
    sonde_case_setup setup;
    if (build(&cases[i], &setup, &error)) fail_msg("%s", error.message);
    check_texts(&cases[i], &setup.map);
    // What the findings come to is what the author says.
    assert_int_equal(setup.thrombosis, cases[i].thrombosis);
    for (uint32_t s = 0; s < setup.map.segment_count; ++s)
      assert_int_equal(setup.clot[s], sonde_case_truth(&cases[i], setup.map.segment[s].name) ==
                                          SONDE_DECISION_CLOT);
    for (uint32_t k = 0; k < ways; ++k) {
      sonde_plan plan = plan_of(&protocols[k], &setup.map);
      assert_true(plan.count >= protocols[k].stop_count);
      for (uint32_t n = 0; n < plan.count; ++n) the_place_shows_its_vein(&plan.point[n], &setup);
      // Where the main vein of a segment has a clot, one of the segment's places lies in it.
      for (uint32_t s = 0; s < setup.map.segment_count; ++s) {
        const sonde_pathology *p = &setup.pathology;
        bool asked = false, met = p->thrombus_from_m == p->thrombus_to_m;
        for (uint32_t n = 0; n < plan.count; ++n) {
          double z_m = plan.point[n].at.z_m;
          if (plan.point[n].segment != s) continue;
          asked = true, met |= z_m > p->thrombus_from_m && z_m < p->thrombus_to_m;
        }
        bool main = setup.map.segment[s].vein_count == 0;
        if (main && asked &&
            sonde_case_truth(&cases[i], setup.map.segment[s].name) == SONDE_DECISION_CLOT && !met)
          fail_msg("%s: no place of %s meets the clot in %s", cases[i].id, protocols[k].id,
                   setup.map.segment[s].name);
      }
    }
    sonde_case_setup_clear(&setup);
  }
  assert_true(5 * sick >= 2 * count && 5 * (count - sick) >= 2 * count);
  assert_true(5 * left >= 2 * count && 5 * (count - left) >= 2 * count);
  sonde_free(cases);
  sonde_free(protocols);
  assert_int_equal(sonde_case_list("/nonexistent", &cases, &count, &error), SONDE_IO);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_case_is_read),
      cmocka_unit_test(a_clot_has_a_form),
      cmocka_unit_test(a_leg_has_its_position),
      cmocka_unit_test(mistakes_are_named_with_their_line),
      cmocka_unit_test(the_truth_must_fit),
      cmocka_unit_test(findings_are_placed),
      cmocka_unit_test(a_branch_has_its_own_truth),
      cmocka_unit_test(the_map_looks_at_the_vein),
      cmocka_unit_test(drawn_cases_are_good),
      cmocka_unit_test(the_cases_that_ship_are_good),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
