// The worksheet: entries are taken as a whole or not at all, and what is written is compared with
// the clots that the case has put on the leg.
#include "trainer_test.h"

#include "sonde/trainer_worksheet.h"

static const double MM = 1e-3;

typedef struct bench {
  sonde_model model;
  sonde_exam_setups setups;
  sonde_plan plan;
  sonde_case patient;
  sonde_worksheet sheet;
  sonde_sheet_verdict verdict;
} bench;

// Ten places on a straight vein, at 10, 30, ... 190 mm; a clot fills it from one z to another.
static bench *bench_of(const char *stage, double from_m, double to_m) {
  bench *b = test_calloc(1, sizeof *b);
  sonde_exam_protocol protocol = every_20_mm();
  b->setups.count = 1;
  sonde_case_setup *setup = &b->setups.held[0];
  setup->model = &b->model, setup->map = straight_map();
  assert_int_equal(sonde_pathology_preset(stage, &setup->pathology, NULL), SONDE_OK);
  setup->pathology.thrombus_from_m = from_m, setup->pathology.thrombus_to_m = to_m;
  b->plan = plan_of(&protocol, &setup->map);
  unsigned mask = 0;
  for (unsigned i = 0; i < 5 && to_m > from_m; ++i)
    mask |= (unsigned)(fmin(to_m, 0.04 * (i + 1)) - fmax(from_m, 0.04 * i) > 5 * MM) << i;
  b->patient = truth_of(mask);
  sonde_worksheet_begin(&b->sheet, &b->setups, &b->plan);
  return b;
}

static void drop(bench *b) {
  sonde_worksheet_clear(&b->sheet);
  test_free(b);
}

static sonde_status enter(bench *b, const char *entry) {
  return sonde_worksheet_enter(&b->sheet, &b->plan, entry, strlen(entry), NULL, NULL, NULL);
}

static const sonde_sheet_verdict *judge(bench *b) {
  sonde_worksheet_judge(&b->sheet, &b->patient, &b->setups, &b->plan, &b->verdict);
  return &b->verdict;
}

// Stands for the images of a session: tick 7 is there, of a probe over the place that is asked for.
static bool look(void *user, uint64_t tick, sonde_sheet_picture *picture) {
  const bench *b = user;
  if (tick != 7) return false;
  if (!picture) return true;
  const sonde_vein_point *at = &b->plan.point[picture->place].at;
  picture->part = 1, picture->tick = tick, picture->force_n = 2;
  picture->probe = sonde_vein_pose(at, 0);
  for (uint32_t k = 0; k < SONDE_SEGMENTS; ++k) picture->ratio[k] = 1;
  return sonde_image_create(4, 3, &picture->image, NULL) == SONDE_OK;
}

static void an_entry_is_taken_as_a_whole(void **state) {
  (void)state;
#define FIVE_MARKS                                                                                 \
  "{\"place\":0,\"picture\":7,\"marks\":[[0,0,1,1,0],[0,0,1,1,0],[0,0,1,1,0],[0,0,1,1,0],"         \
  "[0,0,1,1,0]]}"
  static const char *const WRONG[] = {"",
                                      "[]",
                                      "3",
                                      "{",
                                      "{\"type\":\"worksheet\"}",
                                      "{\"place\":0}x",
                                      "{\"place\":10,\"finding\":\"partly\"}",
                                      "{\"place\":-1,\"finding\":\"partly\"}",
                                      "{\"place\":0.5,\"finding\":\"partly\"}",
                                      "{\"place\":\"0\",\"finding\":\"partly\"}",
                                      "{\"place\":1e300,\"finding\":\"partly\"}",
                                      "{\"place\":0,\"finding\":\"clot\"}",
                                      "{\"place\":0,\"finding\":7}",
                                      "{\"place\":0,\"finding\":\"partly\",\"age\":\"old\"}",
                                      "{\"place\":0,\"finding\":\"partly\",\"diagnosis\":\"x\"}",
                                      "{\"place\":0,\"text\":\"a\\u0007\"}",
                                      "{\"place\":0,\"reflux_s\":-1}",
                                      "{\"place\":0,\"reflux_s\":\"1\"}",
                                      "{\"conclusion\":\"maybe\"}",
                                      "{\"deep\":[0]}",
                                      "{\"deep\":[0,10]}",
                                      "{\"deep\":{\"a\":0,\"b\":1}}",
                                      "{\"deep\":[0,1,2]}",
                                      "{\"place\":0,\"picture\":8}",
                                      "{\"place\":0,\"picture\":-1}",
                                      "{\"picture\":7}",
                                      "{\"place\":0,\"picture\":7,\"view\":\"both\"}",
                                      "{\"place\":0,\"picture\":7,\"marks\":[[1,2,3,4]]}",
                                      "{\"place\":0,\"picture\":7,\"marks\":[[1,2,3,4,-5]]}",
                                      "{\"place\":0,\"picture\":7,\"marks\":[3]}",
                                      FIVE_MARKS,
                                      "{\"change\":1}",
                                      "{\"change\":1,\"drop\":true}",
                                      "{\"hold\":1.5}",
                                      "{\"hold\":\"7\"}",
                                      "{\"place\":0,\"text\":[[[1]]]}"};
  bench *b = bench_of("healthy", 0, 0);
  const sonde_worksheet before = b->sheet;
  for (size_t i = 0; i < SONDE_COUNT_OF(WRONG); ++i) {
    sonde_error error = {0};
    sonde_status status =
        sonde_worksheet_enter(&b->sheet, &b->plan, WRONG[i], strlen(WRONG[i]), look, b, &error);
    if (status != SONDE_ARGUMENT && status != SONDE_FORMAT) fail_msg("%s: %d", WRONG[i], status);
    assert_true(error.message[0] != 0);
    assert_memory_equal(&b->sheet, &before, sizeof before);
  }
  // As long as it may be, and longer: in bytes of the entry, in characters of its text.
  char long_text[SONDE_SHEET_MESSAGE + 100];
  for (int most = 200; most <= 600; most += 400)
    for (int more = 0; more <= 1; ++more) {
      int used = snprintf(long_text, sizeof long_text,
                          most == 200 ? "{\"place\":0,\"text\":\"" : "{\"text\":\"");
      for (int k = 0; k < most + more; ++k)
        used += snprintf(long_text + used, sizeof long_text - (size_t)used, "\xc3\xa4");
      snprintf(long_text + used, sizeof long_text - (size_t)used, "\"}");
      // A text alone is no entry of the whole before a conclusion's members are known: it is one.
      assert_int_equal(enter(b, long_text), more ? SONDE_ARGUMENT : SONDE_OK);
    }
  assert_int_equal(strlen(b->sheet.row[0].text), 400);
  assert_int_equal(strlen(b->sheet.text), 1200);
  memset(long_text, ' ', sizeof long_text);
  memcpy(long_text, "{\"place\":0,\"finding\":\"partly\"}", 31);
  long_text[30] = ' ';
  assert_int_equal(sonde_worksheet_enter(&b->sheet, &b->plan, long_text, SONDE_SHEET_MESSAGE + 1,
                                         NULL, NULL, NULL),
                   SONDE_FORMAT);
  assert_int_equal(b->sheet.row[0].finding, SONDE_SHEET_NO_FINDING);
  drop(b);
}

static void entries_write(void **state) {
  (void)state;
  bench *b = bench_of("healthy", 0, 0);
  assert_int_equal(enter(b, "{\"type\":\"worksheet\",\"place\":3,\"finding\":\"partly\",\"age\":"
                            "\"chronic\",\"kind\":\"free_floating\",\"reflux\":\"present\","
                            "\"reflux_s\":1.5,\"text\":\"a \\\"b\\\"\"}"),
                   SONDE_OK);
  const sonde_sheet_row *row = &b->sheet.row[3];
  assert_true(row->finding == SONDE_SHEET_PARTLY && row->age == SONDE_SHEET_CHRONIC);
  assert_true(row->kind == SONDE_SHEET_FREE_FLOATING && row->reflux == SONDE_SHEET_REFLUX_PRESENT);
  assert_true(row->reflux_s == 1.5 && strcmp(row->text, "a \"b\"") == 0);
  assert_int_equal(enter(b, "{\"place\":3,\"finding\":\"compressible\",\"reflux_s\":null}"),
                   SONDE_OK);
  assert_true(row->age == SONDE_SHEET_NO_AGE && row->kind == SONDE_SHEET_NO_KIND &&
              isnan(row->reflux_s));
  assert_int_equal(enter(b, "{\"conclusion\":\"distal\",\"deep\":[2,4],\"text\":\"t\"}"), SONDE_OK);
  assert_true(b->sheet.conclusion == SONDE_SHEET_DISTAL && b->sheet.deep.from == 2 &&
              b->sheet.deep.to == 4);
  assert_int_equal(enter(b, "{\"deep\":[]}"), SONDE_OK);
  assert_true(b->sheet.deep.from == SONDE_PLAN_POINTS && b->sheet.conclusion == SONDE_SHEET_DISTAL);

  // Pictures: stored, labelled by their force, relabelled, thrown away; their numbers stay theirs.
  static const char *const STORE[] = {
      "{\"place\":1,\"picture\":7,\"marks\":[[0,0,3,4,0],[0,0,4,0,1]]}",
      "{\"place\":2,\"picture\":7,\"view\":\"with\"}"};
  for (int k = 0; k < 2; ++k)
    assert_int_equal(
        sonde_worksheet_enter(&b->sheet, &b->plan, STORE[k], strlen(STORE[k]), look, b, NULL),
        SONDE_OK);
  assert_true(b->sheet.picture_count == 2 && !b->sheet.picture[0].compressed &&
              b->sheet.picture[1].compressed);
  assert_true(b->sheet.picture[0].mark_count == 2 && b->sheet.picture[0].image.pixels);
  assert_int_equal(enter(b, "{\"change\":2,\"view\":\"without\",\"place\":1}"), SONDE_OK);
  assert_true(!b->sheet.picture[1].compressed && b->sheet.picture[1].place == 1);
  assert_int_equal(enter(b, "{\"change\":1,\"drop\":true}"), SONDE_OK);
  assert_true(b->sheet.picture_count == 1 && b->sheet.picture[0].number == 2);
  assert_int_equal(enter(b, "{\"change\":1,\"view\":\"with\"}"), SONDE_ARGUMENT);
  for (uint32_t k = 1; k < SONDE_SHEET_PICTURES; ++k)
    assert_int_equal(
        sonde_worksheet_enter(&b->sheet, &b->plan, STORE[1], strlen(STORE[1]), look, b, NULL),
        SONDE_OK);
  assert_int_equal(
      sonde_worksheet_enter(&b->sheet, &b->plan, STORE[1], strlen(STORE[1]), look, b, NULL),
      SONDE_ARGUMENT);
  drop(b);
}

// A clot from 85 to 125 mm, with the criteria's reach of 10 mm: surely at 110 mm; at 90 and 130 it
// ends; elsewhere the vein is healthy.
static void the_truth_of_a_place(void **state) {
  (void)state;
  static const struct {
    const char *stage;
    sonde_sheet_finding finding;
    sonde_sheet_age age;
    sonde_sheet_kind kind;
  } STAGE[] = {
      {"acute_occlusive", SONDE_SHEET_NOT_COMPRESSIBLE, SONDE_SHEET_ACUTE, SONDE_SHEET_OCCLUSIVE},
      {"subacute_occlusive", SONDE_SHEET_NOT_COMPRESSIBLE, SONDE_SHEET_INDETERMINATE,
       SONDE_SHEET_OCCLUSIVE},
      {"chronic_occlusive", SONDE_SHEET_NOT_COMPRESSIBLE, SONDE_SHEET_CHRONIC,
       SONDE_SHEET_OCCLUSIVE},
      {"partial_mural", SONDE_SHEET_PARTLY, SONDE_SHEET_ACUTE, SONDE_SHEET_PART_OF_LUMEN},
      {"free_floating", SONDE_SHEET_PARTLY, SONDE_SHEET_ACUTE, SONDE_SHEET_FREE_FLOATING},
      {"recanalised", SONDE_SHEET_PARTLY, SONDE_SHEET_CHRONIC, SONDE_SHEET_PART_OF_LUMEN}};
  for (size_t s = 0; s < SONDE_COUNT_OF(STAGE); ++s) {
    bench *b = bench_of(STAGE[s].stage, 85 * MM, 125 * MM);
    const sonde_sheet_verdict *v = judge(b);
    for (uint32_t i = 0; i < 10; ++i) {
      const sonde_sheet_place_verdict *p = &v->place[i];
      const double z_mm = 10 + 20.0 * i;
      const bool edge = fabs(z_mm - 85) < 10 || fabs(z_mm - 125)<10, clot = z_mm> 85 && z_mm < 125;
      assert_int_equal(p->edge, edge);
      assert_int_equal(p->clot, clot);
      assert_int_equal(p->truth, clot ? STAGE[s].finding : SONDE_SHEET_COMPRESSIBLE);
      if (clot) assert_true(p->truth_age == STAGE[s].age && p->truth_kind == STAGE[s].kind);
      assert_int_equal(p->outcome, SONDE_SHEET_UNWRITTEN);
    }
    assert_true(v->score == 0 && v->conclusion == SONDE_SHEET_PROXIMAL && !v->conclusion_right);
    drop(b);
  }
  // The whole vein, and a healthy one.
  bench *b = bench_of("acute_occlusive", 0, 0);
  b->patient = truth_of(31);
  const sonde_sheet_verdict *v = judge(b);
  for (uint32_t i = 0; i < 10; ++i) assert_true(v->place[i].clot && !v->place[i].edge);
  drop(b);
  b = bench_of("healthy", 0, 0);
  v = judge(b);
  for (uint32_t i = 0; i < 10; ++i) assert_true(!v->place[i].clot && !v->place[i].edge);
  assert_true(v->conclusion == SONDE_SHEET_NO_DVT && isnan(v->clot));
  drop(b);
}

static void picture_at(bench *b, uint32_t place, bool with, double force_n, double ratio,
                       double along_m) {
  sonde_sheet_picture p = {.place = place, .compressed = with, .part = 1, .force_n = force_n};
  p.probe = sonde_vein_pose(&b->plan.point[place].at, 0);
  p.probe.position.z += along_m;
  for (uint32_t k = 0; k < SONDE_SEGMENTS; ++k) p.ratio[k] = ratio;
  assert_int_equal(sonde_worksheet_store(&b->sheet, &p, NULL), SONDE_OK);
}

// Every rule of a pair of pictures, each broken alone. 18 N is the firm force of every place.
static void pictures_document_a_place(void **state) {
  (void)state;
  const double none = (double)NAN;
  static const struct {
    double force_n[2], ratio[2], along_mm[2];
    const char *says;
  } CASE[] = {{{2, 18}, {1, 0.8}, {0, 0}, NULL},
              {{2, 9}, {1, 0.05}, {9, -9}, NULL},
              {{0.5, 18}, {1, 0.8}, {0, 0}, "without compression: hardly touches the skin"},
              {{2, 17}, {1, 0.8}, {0, 0}, "with compression: not pressed far enough"},
              {{6, 18}, {0.4, 0.05}, {0, 0}, "without compression: pressed already"},
              {{2, 18}, {1, 0.8}, {0, 12}, "with compression: taken elsewhere"}};
  for (size_t k = 0; k < SONDE_COUNT_OF(CASE); ++k) {
    bench *b = bench_of("healthy", 0, 0);
    for (int w = 0; w < 2; ++w)
      picture_at(b, 4, w == 1, CASE[k].force_n[w], CASE[k].ratio[w], CASE[k].along_mm[w] * MM);
    const sonde_sheet_place_verdict *v = &judge(b)->place[4];
    assert_string_equal(v->pictures, CASE[k].says ? CASE[k].says : "");
    assert_int_equal(v->documented, CASE[k].says == NULL);
    assert_string_equal(b->verdict.place[5].pictures,
                        "without compression: none; with compression: none");
    drop(b);
  }
  // A good one makes up for a bad one; another position of the patient shows another place.
  bench *b = bench_of("healthy", 0, 0);
  picture_at(b, 0, false, 2, none, 0), picture_at(b, 0, false, 2, 1, 0);
  picture_at(b, 0, true, 20, 0.02, 0);
  assert_true(judge(b)->place[0].documented);
  b->sheet.picture[2].held = 1;
  assert_string_equal(judge(b)->place[0].pictures, "with compression: taken elsewhere");
  drop(b);
}

// A worksheet without a mistake has all points, each mistake costs its own.
static void the_score(void **state) {
  (void)state;
  bench *b = bench_of("acute_occlusive", 45 * MM, 135 * MM); // surely at 70 to 110; edges 50, 130
  for (uint32_t i = 0; i < 10; ++i) {
    char entry[128];
    const bool clot = i >= 2 && i <= 6;
    snprintf(entry, sizeof entry, "{\"place\":%u,\"finding\":\"%s\"%s}", i,
             clot ? "not_compressible" : "compressible",
             clot ? ",\"age\":\"acute\",\"kind\":\"occlusive\"" : "");
    assert_int_equal(enter(b, entry), SONDE_OK);
    picture_at(b, i, false, 2, 1, 0), picture_at(b, i, true, 18, clot ? 0.8 : 0.05, 0);
  }
  assert_int_equal(enter(b, "{\"conclusion\":\"proximal\",\"deep\":[6,3]}"),
                   SONDE_OK); // either order
  const sonde_sheet_verdict *v = judge(b);
  assert_near(v->score, 100, 1e-9);
  assert_true(v->right == 10 && v->documented == 10 && v->clot == 1 && v->conclusion_right);
  assert_true(v->deep.clot && v->deep.said && v->deep.truth.from == 3 && v->deep.truth.to == 5);

  // Ends: two stations too high, one too low, from the nearest that is right.
  assert_int_equal(enter(b, "{\"deep\":[0,7]}"), SONDE_OK);
  v = judge(b);
  assert_true(v->deep.off[0] == -2 && v->deep.off[1] == 1);
  assert_near(v->deep.off_m[0], -40 * MM, 1e-9);
  assert_near(v->deep.off_m[1], 20 * MM, 1e-9);
  assert_near(v->score, 100 - 15 * 2 / 8.0, 1e-9); // three places with age and lumen, two ends
  assert_int_equal(enter(b, "{\"deep\":[2,6]}"), SONDE_OK);

  // A clot missed, one called that is not there, one not written.
  assert_int_equal(enter(b, "{\"place\":4,\"finding\":\"compressible\"}"), SONDE_OK);
  assert_int_equal(enter(b, "{\"place\":9,\"finding\":\"partly\"}"), SONDE_OK);
  assert_int_equal(enter(b, "{\"place\":0,\"finding\":\"not_seen\"}"), SONDE_OK);
  v = judge(b);
  assert_true(v->place[4].outcome == SONDE_SHEET_MISSED &&
              v->place[9].outcome == SONDE_SHEET_OVER_CALLED);
  assert_true(v->place[0].outcome == SONDE_SHEET_UNSEEN && v->right == 7 && v->missed == 1 &&
              v->over_called == 1);
  assert_near(v->score, 100 - 45 * 0.3 - 15 * 2 / 8.0, 1e-9);
  // The place where a clot ends may be called either way.
  assert_int_equal(enter(b, "{\"place\":2,\"finding\":\"compressible\"}"), SONDE_OK);
  assert_int_equal(judge(b)->right, 7);
  // A wrong conclusion is capped.
  assert_int_equal(enter(b, "{\"conclusion\":\"no_dvt\"}"), SONDE_OK);
  v = judge(b);
  assert_true(v->score == 49 && !v->conclusion_right);
  drop(b);
}

// What is written is read again: the file says what the sheet says.
static void files(void **state) {
  (void)state;
  bench *b = bench_of("acute_occlusive", 45 * MM, 135 * MM);
  assert_int_equal(enter(b, "{\"place\":3,\"finding\":\"partly\",\"text\":\"</script> \\u00e4\"}"),
                   SONDE_OK);
  static const char STORE[] = "{\"place\":1,\"picture\":7,\"marks\":[[0,0,3,4,0],[0,0,4,0,1]]}";
  assert_int_equal(sonde_worksheet_enter(&b->sheet, &b->plan, STORE, strlen(STORE), look, b, NULL),
                   SONDE_OK);
  judge(b);
  for (int judged = 0; judged < 2; ++judged) {
    sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
    char *text;
    size_t length;
    sonde_json *root;
    assert_int_equal(sonde_file_in_memory(&out.file, NULL), SONDE_OK);
    sonde_json_begin_object(&out, NULL);
    assert_int_equal(sonde_worksheet_put(&out, "worksheet", &b->sheet, &b->plan,
                                         &b->setups.held[0].map, judged ? &b->verdict : NULL,
                                         judged == 1, NULL),
                     SONDE_OK);
    sonde_json_end(&out);
    assert_int_equal(sonde_file_take(out.file, &text, &length, NULL), SONDE_OK);
    assert_int_equal(sonde_json_parse(text, length, NULL, &root, NULL), SONDE_OK);
    const sonde_json *sheet = sonde_json_member(root, "worksheet"),
                     *places = sonde_json_member(sheet, "places");
    const sonde_json *picture = sonde_json_first(sonde_json_member(sheet, "pictures"));
    const sonde_json *mark = sonde_json_first(sonde_json_member(picture, "marks"));
    assert_int_equal(sonde_json_count(places), 10);
    assert_near(sonde_json_as_number(sonde_json_member(mark, "distance_mm")), 5, 1e-9);
    assert_near(sonde_json_as_number(sonde_json_member(sonde_json_next(mark), "area_mm2")),
                2 * SONDE_PI, 1e-2);
    // Before the end nothing tells how open the vein was, or what is there.
    assert_int_equal(sonde_json_member(sheet, "verdict") != NULL, judged);
    assert_int_equal(strstr(text, "truth") != NULL, judged);
    assert_int_equal(sonde_json_member(picture, "image") != NULL, judged);
    assert_int_equal(isnan(sonde_json_as_number(sonde_json_member(picture, "vein"))) == 0, judged);
    sonde_json_free(root);
    sonde_free(text);
  }
  assert_int_equal(
      sonde_worksheet_save_csv(&b->sheet, &b->plan, &b->verdict, "worksheet.csv", NULL), SONDE_OK);
  char *table;
  size_t size;
  assert_int_equal(sonde_file_load("worksheet.csv", &table, &size, NULL), SONDE_OK);
  assert_non_null(strstr(table, "\n4,\"Femoral vein, upper third\",partly,"));
  assert_non_null(strstr(table, ",not_compressible,right,acute,occlusive,0\n"));
  sonde_free(table);
  unlink("worksheet.csv");
  assert_int_equal(sonde_worksheet_save_csv(&b->sheet, &b->plan, NULL, "/nonexistent/x.csv", NULL),
                   SONDE_IO);
  drop(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(an_entry_is_taken_as_a_whole),
                                     cmocka_unit_test(entries_write),
                                     cmocka_unit_test(the_truth_of_a_place),
                                     cmocka_unit_test(pictures_document_a_place),
                                     cmocka_unit_test(the_score),
                                     cmocka_unit_test(files)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
