// A straight vein without a thigh, snapshots made by hand, and a thigh of two formulas.
#ifndef SONDE_TESTS_TRAINER_TEST_H
#define SONDE_TESTS_TRAINER_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#include "trainer/trainer.h"

#include <string.h>
#include <unistd.h>

#define assert_near(got, expected, tolerance)                                                      \
  do {                                                                                             \
    double got_ = (got), expected_ = (expected), tolerance_ = (tolerance);                         \
    if (!(fabs(got_ - expected_) <= tolerance_))                                                   \
      fail_msg("%s is %.17g, expected %.17g within %.3g", #got, got_, expected_, tolerance_);      \
  } while (0)

static const char *const TEST_SEGMENTS[] = {"common_femoral", "femoral_proximal", "femoral_mid",
                                            "femoral_distal", "popliteal"};

// Five segments of 40 mm along z, 20 mm below a flat skin that looks to +x.
static inline sonde_vein_map straight_map(void) {
  sonde_vein_map map = {.point_count = 21, .segment_count = 5, .length_m = 0.2};
  for (uint32_t k = 0; k < 21; ++k) {
    double z = 0.01 * k;
    map.point[k] = (sonde_vein_point){.along_m = z,
                                      .z_m = z,
                                      .vein_m = vec3(0.05, 0, z),
                                      .skin_m = vec3(0.07, 0, z),
                                      .normal = vec3(1, 0, 0),
                                      .across = vec3(0, 1, 0),
                                      .radius_m = 0.004,
                                      .depth_m = 0.02};
  }
  for (uint32_t i = 0; i < 5; ++i) {
    snprintf(map.segment[i].name, sizeof map.segment[i].name, "%s", TEST_SEGMENTS[i]);
    map.segment[i].from_m = 0.04 * i;
    map.segment[i].to_m = 0.04 * (i + 1);
  }
  return map;
}

// The same with a pair of calf veins (vessels 2 and 3) and a superficial vein (4), and the two
// stations "pair", where all three are, and "behind", on the other side of the leg.
enum { TEST_PAIR = 5, TEST_SUPERFICIAL = 6 };
static inline sonde_vein_map branched_map(void) {
  sonde_vein_map map = straight_map();
  sonde_quat facing = q_from_matrix(m_columns(vec3(0, 1, 0), vec3(0, 0, -1), vec3(-1, 0, 0)));
  sonde_quat turned = q_from_matrix(m_columns(vec3(0, -1, 0), vec3(0, 0, -1), vec3(1, 0, 0)));
  const double none = (double)NAN;
  map.segment_count = 7;
  map.segment[TEST_PAIR] =
      (sonde_exam_segment){"posterior_tibial", 0.1, 0.2, SONDE_SEGMENT_CALF, 2, {2, 3}};
  map.segment[TEST_SUPERFICIAL] =
      (sonde_exam_segment){"great_saphenous", 0, 0.2, SONDE_SEGMENT_SUPERFICIAL, 1, {4}};
  map.station_count = map.landmark_count = 2;
  for (uint32_t i = 0; i < 2; ++i) {
    const double x_m = i ? -0.07 : 0.07;
    map.station[i] = (sonde_map_station){.segment = i ? TEST_PAIR : 3,
                                         .text = "Landmarks.",
                                         .probe = {vec3(x_m, 0, 0.14), i ? turned : facing}};
    for (uint32_t k = 0; k < SONDE_SEGMENTS; ++k)
      map.station[i].vein_m[k] =
          i && k < TEST_PAIR ? vec3(none, none, none) : vec3(i ? -0.05 : 0.05, 0, 0.14);
    snprintf(map.landmark[i], sizeof map.landmark[i], i ? "behind" : "pair");
    snprintf(map.station[i].name, sizeof map.station[i].name, i ? "behind" : "pair");
    map.landmark_z_m[i] = 0.14;
  }
  map.middle_z_m[1] = 0.2;
  for (uint32_t k = 0; k < SONDE_MAP_MIDDLES; ++k)
    map.middle_m[k] = vec3(0, 0, 0.2 * k / (SONDE_MAP_MIDDLES - 1));
  return map;
}

static inline sonde_exam_protocol protocol_of(const char *text) {
  sonde_exam_protocol protocol;
  sonde_error error = {0};
  if (sonde_exam_protocol_parse(text, "test.yaml", &protocol, &error))
    fail_msg("%s", error.message);
  return protocol;
}

static inline sonde_exam_protocol every_20_mm(void) {
  return protocol_of("{sonde_protocol: 1, id: all, title: All, text: All of it, places: [{title: "
                     "Vein, text: Press., from: 10, to: 190, every_mm: 20}]}");
}

// Every place takes 18 N: 18 is firm, 24 the limit.
static inline sonde_plan plan_of(const sonde_exam_protocol *protocol, const sonde_vein_map *map) {
  sonde_plan plan;
  sonde_error error = {0};
  if (sonde_plan_make(protocol, map, &plan, &error)) fail_msg("%s", error.message);
  for (uint32_t i = 0; i < plan.count; ++i) plan.point[i].target = sonde_force_target_make(18);
  return plan;
}

static inline sonde_judge *judge_of(const sonde_plan *plan) {
  sonde_vein_map map = straight_map();
  sonde_judge *judge;
  assert_int_equal(sonde_judge_create(&map, plan, &judge, NULL), SONDE_OK);
  return judge;
}

// What a press does at its peak; force, areas and depth go linearly there and back in two seconds.
typedef struct test_press {
  double z_m, force_n, vein, artery, tilt_rad;
} test_press;

static inline sonde_snapshot press_at(const test_press *p, double start_s, double time_s) {
  double share = 1 - fabs(time_s - start_s - 1);
  if (share < 0) share = 0;
  double depth_m = -0.005 + 0.025 * share;
  return (sonde_snapshot){
      .tick = (uint64_t)(1e3 * time_s),
      .time_s = time_s,
      .world_from_probe = {vec3(0.07 - depth_m, 0, p->z_m),
                           q_from_matrix(m_columns(vec3(0, 1, 0), vec3(0, 0, -1), vec3(-1, 0, 0)))},
      .force_normal_n = share * p->force_n,
      .vein_area_ratio = 1 - share * (1 - p->vein),
      .artery_area_ratio = 1 - share * (1 - p->artery),
      .vein_rest_m = vec3(0.05, 0, p->z_m),
      .vein_tilt_rad = p->tilt_rad};
}

// From start_s on for 2.4 s, looked at every step_s.
static inline void feed_press(sonde_judge *judge, const test_press *p, double start_s,
                              double step_s) {
  for (double t = 0; t < 2.4; t += step_s) {
    sonde_snapshot s = press_at(p, start_s, start_s + t);
    assert_true(sonde_judge_feed(judge, &s));
  }
}

static inline test_press closing(double z_m) { return (test_press){z_m, 22, 0.03, 0.66, 0.1}; }
static inline test_press staying_open(double z_m) { return (test_press){z_m, 22, 0.80, 0.62, 0.1}; }

// A case whose truth is a clot in the segments of the mask.
static inline sonde_case truth_of(unsigned mask) {
  sonde_case c = sonde_case_default();
  snprintf(c.id, sizeof c.id, "made-up");
  snprintf(c.title, sizeof c.title, "Made up");
  snprintf(c.diagnosis, sizeof c.diagnosis, mask ? "A clot" : "No clot");
  c.truth_count = 5;
  c.thrombosis = mask != 0;
  for (uint32_t i = 0; i < 5; ++i) {
    snprintf(c.truth_segment[i], sizeof c.truth_segment[i], "%s", TEST_SEGMENTS[i]);
    c.truth[i] = mask & (1u << i) ? SONDE_DECISION_CLOT : SONDE_DECISION_COMPRESSIBLE;
  }
  return c;
}

static inline sonde_score score_of(const sonde_judge *judge, const sonde_case *truth) {
  sonde_score score;
  sonde_judge_score(judge, truth, &score);
  return score;
}

#endif
