// The judge: what a press is, that the order and the rate of the snapshots do not matter, that
// coverage adds up, and that memory is bounded.
#include "trainer_test.h"

static sonde_press_result result_of(test_press p) {
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  sonde_judge *judge = judge_of(&plan);
  feed_press(judge, &p, 0, 0.03);
  uint32_t count;
  const sonde_compression *presses = sonde_judge_compressions(judge, &count);
  assert_int_equal(count, 1);
  sonde_press_result result = presses[0].result;
  sonde_judge_destroy(judge);
  return result;
}

static void a_press_is_named(void **state) {
  (void)state;
  const double unseen = (double)NAN;
  assert_int_equal(result_of(closing(0.1)), SONDE_PRESS_COMPLETE);
  assert_int_equal(result_of(staying_open(0.1)), SONDE_PRESS_OPEN);
  assert_int_equal(result_of((test_press){0.1, 8, 0.6, 0.92, 0.1}), SONDE_PRESS_INSUFFICIENT);
  // half closed at a firm press: neither closed nor clearly open
  assert_int_equal(result_of((test_press){0.1, 20, 0.2, 0.66, 0.1}), SONDE_PRESS_INSUFFICIENT);
  // the vein is still open, but a healthy one would be as well
  assert_int_equal(result_of((test_press){0.1, 17, 0.8, 0.6, 0.1}), SONDE_PRESS_INSUFFICIENT);
  // the artery decides nothing: crushed, untouched, or not in view
  assert_int_equal(result_of((test_press){0.1, 22, 0.01, 0.3, 0.1}), SONDE_PRESS_COMPLETE);
  assert_int_equal(result_of((test_press){0.1, 20, 0.8, 0.99, 0.1}), SONDE_PRESS_OPEN);
  assert_int_equal(result_of((test_press){0.1, 20, 0.8, unseen, 0.1}), SONDE_PRESS_OPEN);
  assert_int_equal(result_of((test_press){0.1, 22, 0.03, 0.66, 0.6}), SONDE_PRESS_OFF_AXIS);
  assert_int_equal(result_of((test_press){0.1, 22, unseen, 0.66, 0.1}), SONDE_PRESS_OFF_AXIS);
  assert_int_equal(result_of((test_press){0.1, 45, 0.01, 0.66, 0.1}), SONDE_PRESS_TOO_HARD);
  assert_int_equal(result_of((test_press){0.1, 24.5, 0.01, 0.6, 0.1}), SONDE_PRESS_TOO_HARD);
}

// Where each place has a force of its own, a press is judged by that of the nearest one, and the
// guidance shows just these two numbers while it lasts: whatever is said closed or open lies at or
// below the limit shown, whatever is called too hard above it.
static void what_is_shown_is_what_is_judged(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  for (uint32_t i = 0; i < plan.count; ++i)
    plan.point[i].target = sonde_force_target_make(12 + 2.3 * i);
  unsigned noise = 7, seen[SONDE_PRESS_RESULTS] = {0};
  for (int trial = 0; trial < 200; ++trial) {
    double draw[3];
    for (int k = 0; k < 3; ++k) {
      noise = noise * 1664525u + 1013904223u;
      draw[k] = (noise >> 8) / (double)(1u << 24);
    }
    test_press press = {0.2 * draw[0], 45 * draw[1], draw[2] * draw[2], 0.6, 0.1};
    sonde_judge *judge = judge_of(&plan);
    for (double t = 0; t < 2.4; t += 0.03) {
      sonde_snapshot s = press_at(&press, 0, t);
      assert_true(sonde_judge_feed(judge, &s));
      sonde_press_state now = sonde_judge_state(judge).state;
      if (now == SONDE_PRESS_STATE_NONE) continue;
      sonde_force_target shown = sonde_judge_guidance(judge).force;
      double limit =
          plan.point[sonde_plan_nearest(&plan, 0, vec3(0.07, 0, press.z_m))].target.limit_n;
      assert_true(shown.limit_n == limit);
      if (now == SONDE_PRESS_STATE_COMPLETE || now == SONDE_PRESS_STATE_OPEN)
        assert_true(s.force_normal_n <= shown.limit_n);
      if (s.force_normal_n > shown.limit_n) assert_int_equal(now, SONDE_PRESS_STATE_TOO_HARD);
    }
    uint32_t count;
    const sonde_compression *presses = sonde_judge_compressions(judge, &count);
    for (uint32_t i = 0; i < count; ++i) {
      sonde_force_target target = plan.point[presses[i].place].target;
      seen[presses[i].result]++;
      assert_int_equal(presses[i].result == SONDE_PRESS_TOO_HARD,
                       presses[i].force_peak_n > target.limit_n);
      if (presses[i].result == SONDE_PRESS_OPEN)
        assert_true(presses[i].force_peak_n >= target.firm_n);
    }
    sonde_judge_destroy(judge);
  }
  assert_true(seen[SONDE_PRESS_COMPLETE] > 5 && seen[SONDE_PRESS_OPEN] > 5);
  assert_true(seen[SONDE_PRESS_TOO_HARD] > 5 && seen[SONDE_PRESS_INSUFFICIENT] > 5);
}

// The second femoral vein with a clot: the first closes alone.
static void a_double_vein_is_closed_when_both_are(void **state) {
  (void)state;
  const double further[] = {0.03, 0.85};
  const sonde_press_result expected[] = {SONDE_PRESS_COMPLETE, SONDE_PRESS_OPEN};
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  test_press press = closing(0.1);
  for (int k = 0; k < 2; ++k) {
    sonde_judge *judge = judge_of(&plan);
    for (double t = 0; t < 2.4; t += 0.03) {
      sonde_snapshot s = press_at(&press, 0, t);
      s.other_vein_ratio = further[k];
      assert_true(sonde_judge_feed(judge, &s));
    }
    uint32_t count;
    const sonde_compression *presses = sonde_judge_compressions(judge, &count);
    assert_int_equal(count, 1);
    assert_int_equal(presses[0].result, expected[k]);
    sonde_judge_destroy(judge);
  }
}

// A press at the station of branched_map(), the three other veins left as open as `left`.
static void feed_cuts(sonde_judge *judge, const test_press *p, double start_s, const double left[3],
                      const double aside_m[3]) {
  for (double t = 0; t < 2.4; t += 0.03) {
    sonde_snapshot s = press_at(p, start_s, start_s + t);
    double share = fmax(0, 1 - fabs(t - 1));
    s.crossing_count = 3;
    for (uint32_t k = 0; k < 3; ++k)
      s.crossing[k] = (sonde_vein_crossing){.vessel = 2 + k,
                                            .area_ratio = 1 - share * (1 - left[k]),
                                            .aside_m = aside_m[k],
                                            .rest_m = vec3(0.05, 0.003 * k, p->z_m)};
    assert_true(sonde_judge_feed(judge, &s));
  }
}

static sonde_plan station_plan(const sonde_vein_map *map, const char *segment) {
  char text[400];
  snprintf(
      text, sizeof text,
      "{sonde_protocol: 1, id: s, title: S, text: s, places: [{title: A, at: {station: pair}}, "
      "{title: B, at: {station: pair}, segment: %s}]}",
      segment);
  sonde_exam_protocol protocol = protocol_of(text);
  return plan_of(&protocol, map);
}

// A pair closes when both veins have; one that is not in the picture is not asked for. The vein of
// the other place is examined by the same press, each by its own area.
static void each_vein_of_a_pair_closes(void **state) {
  (void)state;
  const struct {
    double main, left[3], aside_m[3];
    sonde_press_result result;
    uint32_t closed, open; // of the pair
  } TRY[] = {{0.02, {0.03, 0.05, 1}, {0, 0.006, 0.01}, SONDE_PRESS_COMPLETE, 1, 0},
             {0.02, {0.03, 0.80, 1}, {0, 0.006, 0.01}, SONDE_PRESS_OPEN, 0, 1},
             {0.02, {0.80, 0.03, 1}, {0, 0.006, 0.01}, SONDE_PRESS_OPEN, 0, 1},
             {0.02, {0.03, 0.80, 1}, {0, 0.030, 0.01}, SONDE_PRESS_COMPLETE, 1, 0},
             {0.02, {0.20, 0.20, 1}, {0, 0.006, 0.01}, SONDE_PRESS_COMPLETE, 0, 0},
             {0.20, {0.03, 0.05, 1}, {0, 0.006, 0.01}, SONDE_PRESS_COMPLETE, 1, 0}};
  sonde_vein_map map = branched_map();
  sonde_plan plan = station_plan(&map, "posterior_tibial");
  assert_int_equal(plan.point[0].segment, 3);
  assert_int_equal(plan.point[1].segment, TEST_PAIR);
  for (size_t i = 0; i < SONDE_COUNT_OF(TRY); ++i) {
    sonde_judge *judge;
    assert_int_equal(sonde_judge_create(&map, &plan, &judge, NULL), SONDE_OK);
    test_press press = {0.14, 20, TRY[i].main, 0.9, 0.1};
    feed_cuts(judge, &press, 0, TRY[i].left, TRY[i].aside_m);
    uint32_t count;
    const sonde_compression *p = sonde_judge_compressions(judge, &count);
    assert_int_equal(count, 1);
    assert_int_equal(p[0].result, TRY[i].result);
    sonde_segment_status main = sonde_judge_segment(judge, 3);
    sonde_segment_status pair = sonde_judge_segment(judge, TEST_PAIR);
    assert_int_equal(main.done, TRY[i].main < 0.1);
    assert_int_equal(pair.done, TRY[i].closed + TRY[i].open);
    assert_int_equal(pair.open, TRY[i].open);
    assert_int_equal(main.open, 0);
    sonde_metrics m = sonde_judge_metrics(judge);
    assert_int_equal(m.points_done, main.done + pair.done);
    assert_near(m.coverage, m.points_done / 2.0, 0.01);
    sonde_judge_destroy(judge);
  }
}

// Other veins in the picture change nothing of an exam that does not ask for them.
static void veins_beside_change_nothing(void **state) {
  (void)state;
  sonde_vein_map map = branched_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  sonde_judge *judge[2];
  const double open[3] = {0.9, 0.9, 0.9}, aside_m[3] = {0, 0, 0};
  for (int k = 0; k < 2; ++k) {
    assert_int_equal(sonde_judge_create(&map, &plan, &judge[k], NULL), SONDE_OK);
    const test_press press[] = {closing(0.03), staying_open(0.11), {0.15, 8, 0.6, 0.9, 0.1}};
    for (uint32_t i = 0; i < SONDE_COUNT_OF(press); ++i) {
      if (k == 0)
        feed_press(judge[k], &press[i], 3.0 * i, 0.03);
      else
        feed_cuts(judge[k], &press[i], 3.0 * i, open, aside_m);
    }
  }
  uint32_t count[2];
  const sonde_compression *p = sonde_judge_compressions(judge[0], &count[0]);
  const sonde_compression *q = sonde_judge_compressions(judge[1], &count[1]);
  assert_true(count[0] == 3 && count[1] == 3);
  for (int i = 0; i < 3; ++i) {
    assert_true(p[i].result == q[i].result && p[i].examined == q[i].examined);
    assert_true(p[i].along_m == q[i].along_m && p[i].vein_ratio == q[i].vein_ratio);
  }
  sonde_metrics a = sonde_judge_metrics(judge[0]), b = sonde_judge_metrics(judge[1]);
  assert_memory_equal(&a, &b, sizeof a);
  for (int k = 0; k < 2; ++k) sonde_judge_destroy(judge[k]);
}

// Beyond the reach of the station a vein that closes examines nothing; from behind neither. The
// guidance sends the probe round the leg.
static void a_station_is_where_its_vein_is(void **state) {
  (void)state;
  sonde_vein_map map = branched_map();
  sonde_exam_protocol protocol = protocol_of(
      "{sonde_protocol: 1, id: s, title: S, text: s, places: [{title: A, at: {station: behind}}]}");
  sonde_plan plan = plan_of(&protocol, &map);
  assert_int_equal(plan.point[0].segment, TEST_PAIR);
  assert_string_equal(plan.point[0].text, "Landmarks.");
  assert_true(isnan(plan.point[0].at.along_m));
  sonde_judge *judge;
  assert_int_equal(sonde_judge_create(&map, &plan, &judge, NULL), SONDE_OK);
  const double left[3] = {0.02, 0.02, 0.02}, aside_m[3] = {0, 0, 0};
  test_press press = {0.14, 20, 0.02, 0.9, 0.1};
  feed_cuts(judge, &press, 0, left, aside_m); // cuts 0.1 m from the station's vein
  sonde_guidance g = sonde_judge_guidance(judge);
  assert_int_equal(g.point, 0);
  assert_non_null(strstr(g.text, "the leg"));
  assert_int_equal(sonde_judge_metrics(judge).points_done, 0);
  sonde_judge_destroy(judge);
}

static sonde_judge *judged(const test_press *presses, size_t count, const size_t *order,
                           double step_s) {
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol = every_20_mm();
  sonde_plan plan = plan_of(&protocol, &map);
  sonde_judge *judge = judge_of(&plan);
  for (size_t i = 0; i < count; ++i)
    feed_press(judge, &presses[order ? order[i] : i], 3.0 * (double)i, step_s);
  return judge;
}

static const double PLACES_M[] = {0.01, 0.031, 0.05, 0.118, 0.13, 0.187};
enum { PLACES = 6 };

static void the_order_does_not_matter(void **state) {
  (void)state;
  test_press presses[PLACES];
  for (int i = 0; i < PLACES; ++i)
    presses[i] = i == 3 ? staying_open(PLACES_M[i]) : closing(PLACES_M[i]);
  const size_t orders[][PLACES] = {{5, 4, 3, 2, 1, 0}, {2, 0, 5, 1, 3, 4}, {3, 5, 1, 0, 4, 2}};
  sonde_judge *first = judged(presses, PLACES, NULL, 0.03);
  sonde_metrics m = sonde_judge_metrics(first);
  assert_true(m.coverage > 0.4 && m.coverage < 0.8);
  for (size_t k = 0; k < 3; ++k) {
    sonde_judge *other = judged(presses, PLACES, orders[k], 0.03);
    sonde_metrics n = sonde_judge_metrics(other);
    assert_true(n.coverage == m.coverage && n.vein_coverage == m.vein_coverage);
    assert_true(n.gap_m == m.gap_m && n.points_done == m.points_done);
    assert_memory_equal(n.presses, m.presses, sizeof m.presses);
    for (uint32_t i = 0; i < 5; ++i)
      assert_int_equal(sonde_judge_segment(other, i).open, sonde_judge_segment(first, i).open);
    sonde_judge_destroy(other);
  }
  sonde_judge_destroy(first);
}

static double coverage_of(const double *places_m, size_t count, double *gap_m) {
  test_press presses[PLACES];
  for (size_t i = 0; i < count; ++i) presses[i] = closing(places_m[i]);
  sonde_judge *judge = judged(presses, count, NULL, 0.03);
  sonde_metrics m = sonde_judge_metrics(judge);
  sonde_judge_destroy(judge);
  if (gap_m) *gap_m = m.gap_m;
  return m.coverage;
}

// Apart from each other two presses cover what each covers; twice the same covers no more.
static void coverage_adds_up(void **state) {
  (void)state;
  const double near[] = {0.03}, far[] = {0.15}, both[] = {0.03, 0.15}, twice[] = {0.03, 0.03};
  double a = coverage_of(near, 1, NULL), b = coverage_of(far, 1, NULL);
  assert_true(a > 0 && b > 0);
  assert_near(coverage_of(both, 2, NULL), a + b, 1e-12);
  assert_true(coverage_of(twice, 2, NULL) == a);
  const double overlapping[] = {0.03, 0.04};
  assert_true(coverage_of(overlapping, 2, NULL) < 2 * a);
}

// With nothing pressed the gap is the whole stretch; a press in its middle halves it at best.
static void the_gap_shrinks(void **state) {
  (void)state;
  double all, halves, shorter;
  const double middle[] = {0.1}, more[] = {0.1, 0.05};
  assert_true(coverage_of(NULL, 0, &all) == 0);
  assert_near(all, 0.2, 1e-9);
  coverage_of(middle, 1, &halves);
  coverage_of(more, 2, &shorter);
  assert_near(2 * halves + 0.025, 0.2, 1e-3);
  assert_true(shorter <= halves);
}

// Looked at every 20 ms, every 50 ms or at any irregular times: the same exam.
static void the_rate_does_not_matter(void **state) {
  (void)state;
  test_press presses[PLACES];
  for (int i = 0; i < PLACES; ++i)
    presses[i] = i == 2 ? staying_open(PLACES_M[i]) : closing(PLACES_M[i]);
  sonde_judge *regular = judged(presses, PLACES, NULL, 0.02);
  sonde_judge *irregular = judged(presses, 0, NULL, 0.02);
  unsigned noise = 1;
  for (double t = 0; t < 3.0 * PLACES;) {
    size_t i = (size_t)(t / 3.0);
    sonde_snapshot s = press_at(&presses[i], 3.0 * (double)i, t);
    sonde_judge_feed(irregular, &s);
    noise = noise * 1664525u + 1013904223u;
    t += 0.01 + 0.05 * (noise >> 8) / (double)(1u << 24);
  }
  sonde_metrics m = sonde_judge_metrics(regular), n = sonde_judge_metrics(irregular);
  assert_memory_equal(m.presses, n.presses, sizeof m.presses);
  assert_true(m.coverage == n.coverage && m.gap_m == n.gap_m && m.points_done == n.points_done);
  assert_near(n.force_p95_n, m.force_p95_n, 0.5);
  assert_near(n.force_peak_n, m.force_peak_n, 0.7);
  assert_near(n.completeness, m.completeness, 0.03);
  assert_near(n.contact_s, m.contact_s, 0.4);
  assert_near(n.path_m, m.path_m, 0.04 * m.path_m);
  sonde_judge_destroy(regular);
  sonde_judge_destroy(irregular);
}

// The same snapshot again, or an older one, changes nothing; nor does one that is no number.
static void stale_snapshots_are_ignored(void **state) {
  (void)state;
  test_press press = closing(0.1);
  sonde_judge *once = judged(&press, 1, NULL, 0.03), *again = judged(&press, 0, NULL, 0.03);
  for (double t = 0; t < 2.4; t += 0.03) {
    sonde_snapshot s = press_at(&press, 0, t), old = press_at(&press, 0, 0.5 * t), bad = s;
    bad.force_normal_n = (double)NAN;
    bad.time_s = t + 0.01;
    sonde_judge_feed(again, &s);
    sonde_judge_feed(again, &s);
    sonde_judge_feed(again, &old);
    sonde_judge_feed(again, &bad);
  }
  sonde_metrics m = sonde_judge_metrics(once), n = sonde_judge_metrics(again);
  assert_memory_equal(&m, &n, sizeof m);
  sonde_judge_destroy(once);
  sonde_judge_destroy(again);
}

// A hand that trembles around the threshold presses once, not at every tremor.
static void tremor_is_one_press(void **state) {
  (void)state;
  sonde_judge *judge = judged(NULL, 0, NULL, 0.03);
  test_press press = closing(0.1);
  for (int i = 0; i < 200; ++i) {
    sonde_snapshot s = press_at(&press, 0, 1);
    s.time_s = 0.05 * i;
    s.force_normal_n = i < 5 || i > 190 ? 0 : 12 + 3 * sin(2.1 * i);
    sonde_judge_feed(judge, &s);
  }
  uint32_t count;
  sonde_judge_compressions(judge, &count);
  assert_int_equal(count, 1);
  sonde_judge_destroy(judge);
}

static size_t allocations;
static void *counted(size_t bytes, void *user) {
  (void)user;
  allocations++;
  return malloc(bytes);
}
static void released(void *pointer, void *user) {
  (void)user;
  free(pointer);
}

static void memory_is_bounded(void **state) {
  (void)state;
  sonde_set_allocator(&(sonde_allocator){counted, released, NULL});
  sonde_judge *judge = judged(NULL, 0, NULL, 0.03);
  test_press press = closing(0.1);
  allocations = 0;
  for (int i = 0; i < 5000; ++i) { // presses of 0.4 s, seen ten times each
    for (int k = 0; k < 10; ++k) {
      sonde_snapshot s = press_at(&press, 0, 0.2 * k);
      s.time_s = 0.4 * i + 0.04 * k;
      assert_true(sonde_judge_feed(judge, &s));
    }
  }
  assert_true(sonde_judge_finish(judge));
  uint32_t count;
  sonde_judge_compressions(judge, &count);
  assert_int_equal(count, SONDE_COMPRESSIONS);
  assert_int_equal(sonde_judge_metrics(judge).press_count, 5000);
  assert_true(allocations <= 8); // doublings of the list
  sonde_judge_destroy(judge);
  sonde_set_allocator(&(sonde_allocator){0});
}

static void guidance_leads_through_the_plan(void **state) {
  (void)state;
  sonde_judge *judge = judged(NULL, 0, NULL, 0.03);
  sonde_guidance g = sonde_judge_guidance(judge);
  assert_int_equal(g.point, 0);
  test_press press = closing(0.07);
  sonde_snapshot above = press_at(&press, 0, 0);
  sonde_judge_feed(judge, &above);
  g = sonde_judge_guidance(judge);
  assert_near(g.offset_m, 0.06, 1e-9);
  assert_non_null(strstr(g.text, "60 mm"));
  assert_non_null(strstr(g.text, "groin"));
  assert_true(g.angle_ok && g.angle_rad < 1e-6);
  for (int i = 0; i < 10; ++i) {
    assert_int_equal(sonde_judge_guidance(judge).point, i);
    press = closing(0.01 + 0.02 * i);
    feed_press(judge, &press, 10 + 3.0 * i, 0.03);
  }
  g = sonde_judge_guidance(judge);
  assert_int_equal(g.point, SONDE_PLAN_POINTS);
  assert_int_equal(g.undecided, 4);
  assert_int_equal(sonde_judge_decide(judge, 4, SONDE_DECISION_COMPRESSIBLE, NULL), SONDE_OK);
  assert_int_equal(sonde_judge_guidance(judge).undecided, 0);
  assert_int_equal(sonde_judge_decide(judge, 5, SONDE_DECISION_CLOT, NULL), SONDE_ARGUMENT);
  sonde_judge_destroy(judge);
}

// A press that counts for no place is not led on, one at any place of the plan is.
static void a_press_elsewhere_is_called_off(void **state) {
  (void)state;
  sonde_vein_map map = straight_map();
  sonde_exam_protocol protocol =
      protocol_of("{sonde_protocol: 1, id: few, title: Few, text: Few places, places: [{title: "
                  "Vein, text: Press., from: 10, to: 190, every_mm: 60}]}");
  sonde_plan plan = plan_of(&protocol, &map);
  assert_true(plan.count > 2);
  for (int elsewhere = 0; elsewhere < 2; ++elsewhere) {
    sonde_judge *judge = judge_of(&plan);
    test_press press = closing(plan.point[1].at.skin_m.z + elsewhere * 0.03);
    for (double t = 0; t < 1; t += 0.03) {
      sonde_snapshot s = press_at(&press, 0, t);
      assert_true(sonde_judge_feed(judge, &s));
    }
    const char *text = sonde_judge_guidance(judge).text;
    if (elsewhere)
      assert_non_null(strstr(text, "Not here: let go and move the probe 90 mm towards the groin"));
    else
      assert_non_null(strstr(text, "let go"));
    assert_int_equal(strstr(text, "Not here") != NULL, elsewhere);
    sonde_judge_destroy(judge);
  }
}

// What is asked for is what was pressed last, as long as it waits for a finding; then what comes
// first. A press that is under way is not talked over, and the next place is still named.
static void the_finding_of_what_was_just_seen_is_asked_for(void **state) {
  (void)state;
  sonde_judge *judge = judged(NULL, 0, NULL, 0.03);
  const double order_m[] = {0.17, 0.19, 0.05, 0.07, 0.01, 0.03};
  const uint32_t segment[] = {4, 4, 1, 1, 0, 0};
  for (int i = 0; i < 6; ++i) {
    test_press press = closing(order_m[i]);
    feed_press(judge, &press, 3.0 * i, 0.03);
    sonde_guidance g = sonde_judge_guidance(judge);
    if (i == 0) assert_int_equal(g.undecided, SONDE_SEGMENTS); // one of its two places waits
    if (i % 2 == 0) continue;
    assert_int_equal(g.undecided, segment[i]);
    assert_non_null(strstr(g.text, sonde_segment_title(TEST_SEGMENTS[segment[i]])));
    assert_non_null(strstr(g.detail, "Then "));
  }
  test_press elsewhere = closing(0.09);
  for (double t = 0; t < 1; t += 0.03) {
    sonde_snapshot s = press_at(&elsewhere, 30, 30 + t);
    sonde_judge_feed(judge, &s);
  }
  sonde_guidance pressing = sonde_judge_guidance(judge);
  assert_int_equal(pressing.undecided, 0);
  assert_null(strstr(pressing.text, sonde_segment_title(TEST_SEGMENTS[0])));
  const uint32_t then[] = {0, 1, 4, SONDE_SEGMENTS};
  for (int k = 0; k < 3; ++k) {
    assert_int_equal(sonde_judge_guidance(judge).undecided, then[k]);
    sonde_judge_decide(judge, then[k], SONDE_DECISION_CLOT, NULL);
  }
  assert_int_equal(sonde_judge_guidance(judge).undecided, SONDE_SEGMENTS);
  sonde_judge_destroy(judge);
}

static void hints_are_counted_and_fade(void **state) {
  (void)state;
  sonde_judge *judge = judged(NULL, 0, NULL, 0.03);
  test_press press = closing(0.01);
  bool showing = true;
  assert_int_equal(sonde_judge_hints(judge, &showing), 0);
  assert_false(showing);
  feed_press(judge, &press, 0, 0.03);
  sonde_judge_hint(judge);
  assert_int_equal(sonde_judge_hints(judge, &showing), 1);
  assert_true(showing);
  feed_press(judge, &press, 2 + SONDE_HINT_S, 0.03);
  assert_int_equal(sonde_judge_hints(judge, &showing), 1);
  assert_false(showing);
  sonde_judge_destroy(judge);
}

// At the peak of each kind of press the learner is told what it is.
static void the_state_follows_the_press(void **state) {
  (void)state;
  sonde_judge *judge = judged(NULL, 0, NULL, 0.03);
  assert_int_equal(sonde_judge_state(judge).state, SONDE_PRESS_STATE_NONE);
  test_press press = closing(0.1);
  for (double t = 0; t <= 0.5; t += 0.05) {
    sonde_snapshot s = press_at(&press, 0, t);
    sonde_judge_feed(judge, &s);
  }
  assert_int_equal(sonde_judge_state(judge).state, SONDE_PRESS_STATE_PRESSING);
  for (double t = 0.55; t <= 1.01; t += 0.05) {
    sonde_snapshot s = press_at(&press, 0, t);
    sonde_judge_feed(judge, &s);
  }
  assert_int_equal(sonde_judge_state(judge).state, SONDE_PRESS_STATE_COMPLETE);
  for (double t = 1.05; t <= 2.2; t += 0.05) {
    sonde_snapshot s = press_at(&press, 0, t);
    sonde_judge_feed(judge, &s);
  }
  assert_int_equal(sonde_judge_state(judge).state, SONDE_PRESS_STATE_NONE);
  sonde_judge_destroy(judge);
}

static sonde_metrics moved(double (*where)(double t), double step_s) {
  sonde_judge *judge = judged(NULL, 0, NULL, 0.03);
  test_press press = closing(0.1);
  for (double t = 0; t < 4; t += step_s) {
    sonde_snapshot s = press_at(&press, 0, 0);
    s.time_s = t;
    s.world_from_probe.position = vec3(0.1, 0, where(t));
    sonde_judge_feed(judge, &s);
  }
  sonde_metrics m = sonde_judge_metrics(judge);
  sonde_judge_destroy(judge);
  return m;
}

static double minimum_jerk(double t) {
  double x = fmin(t / 3, 1);
  return 0.1 * x * x * x * (10 - 15 * x + 6 * x * x);
}
static double in_steps(double t) { return minimum_jerk(t) + 0.003 * sin(2 * SONDE_PI * 2.5 * t); }

// The smoothest way there is scores higher than a trembling one, which is also longer; a way and
// back has no length of its own.
static void path_and_smoothness(void **state) {
  (void)state;
  sonde_metrics smooth = moved(minimum_jerk, 0.02), rough = moved(in_steps, 0.02);
  assert_near(smooth.path_m, 0.1, 0.002);
  assert_true(rough.path_m > 1.2 * smooth.path_m);
  assert_true(smooth.smoothness > rough.smoothness + 1);
  sonde_metrics slower = moved(minimum_jerk, 0.05);
  assert_near(slower.smoothness, smooth.smoothness, 0.1);
  assert_near(slower.path_m, smooth.path_m, 0.002);
}

// Ten times as many presses, each as smooth: no worse. Over the whole exam it would be 4 ln 10.
static void smoothness_is_that_of_the_way_to_a_press(void **state) {
  (void)state;
  const int presses[] = {2, 20};
  double smooth[2];
  for (int k = 0; k < 2; ++k) {
    sonde_judge *judge = judged(NULL, 0, NULL, 0.03);
    test_press press = closing(0.1);
    for (int i = 0; i < presses[k]; ++i) feed_press(judge, &press, 3.0 * i, 0.03);
    smooth[k] = sonde_judge_metrics(judge).smoothness;
    sonde_judge_destroy(judge);
  }
  assert_near(smooth[1], smooth[0], 1.5);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_press_is_named),
      cmocka_unit_test(what_is_shown_is_what_is_judged),
      cmocka_unit_test(a_double_vein_is_closed_when_both_are),
      cmocka_unit_test(each_vein_of_a_pair_closes),
      cmocka_unit_test(veins_beside_change_nothing),
      cmocka_unit_test(a_station_is_where_its_vein_is),
      cmocka_unit_test(the_order_does_not_matter),
      cmocka_unit_test(coverage_adds_up),
      cmocka_unit_test(the_gap_shrinks),
      cmocka_unit_test(the_rate_does_not_matter),
      cmocka_unit_test(stale_snapshots_are_ignored),
      cmocka_unit_test(tremor_is_one_press),
      cmocka_unit_test(memory_is_bounded),
      cmocka_unit_test(guidance_leads_through_the_plan),
      cmocka_unit_test(a_press_elsewhere_is_called_off),
      cmocka_unit_test(the_finding_of_what_was_just_seen_is_asked_for),
      cmocka_unit_test(hints_are_counted_and_fade),
      cmocka_unit_test(the_state_follows_the_press),
      cmocka_unit_test(path_and_smoothness),
      cmocka_unit_test(smoothness_is_that_of_the_way_to_a_press),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
