// Poses corrected by what frames show: sweeps through a known phantom whose tracker is late, whose
// calibration is off or whose poses jitter.
#include "fixture.h"
#include "sanitized.h"
#include "sonde/sweep_poses.h"
#include "sweep/poses.h"

#include <stdio.h>

enum { WIDE = 96, HIGH = 80, FRAMES = 60 };

static const double PIXEL_M = 0.3e-3, STEP_S = 1 / 20.0, GRAIN = 12;

// Tissue with structure in every direction: waves of 9 to 14 mm and a vessel.
static double phantom(sonde_vec3 p) {
  double grey = 110 + 50 * sin(600 * p.x + 200 * p.z) * cos(500 * p.y - 250 * p.z) +
                50 * sin(450 * p.z + 250 * p.x - 300 * p.y);
  double x = p.x - 0.012 - 0.15 * p.z, y = p.y - 0.012 + 0.1 * p.z;
  return grey * (1 - 0.8 / (1 + exp((hypot(x, y) - 3e-3) / 8e-4)));
}

// The picture's middle at a time: a hand that sweeps along z and back, sways and turns.
static sonde_pose hand(double t) {
  const double motion[POSE_AXES] = {1.5e-3 * sin(2.1 * t),
                                    1.0e-3 * cos(3.3 * t + 0.4),
                                    8e-3 * sin(1.9 * t) + 1.2e-3 * sin(2.9 * t + 1),
                                    0.10 * sin(2.3 * t),
                                    0.12 * sin(1.7 * t + 0.7),
                                    0.08 * cos(2.7 * t)};
  return pose_moved((sonde_pose){vec3(0.012, 0.012, 0), {1, 0, 0, 0}}, motion);
}

// A hand that never turns and keeps its speed.
static sonde_pose rail(double t) {
  return (sonde_pose){vec3(0.012, 0.012, 6e-3 * t), {1, 0, 0, 0}};
}

static sonde_affine map_of(sonde_pose pose) {
  const sonde_vec3 x = q_rotate(pose.rotation, vec3(PIXEL_M, 0, 0));
  const sonde_vec3 y = q_rotate(pose.rotation, vec3(0, PIXEL_M, 0));
  const sonde_vec3 corner =
      v_madd(v_madd(pose.position, -0.5 * (WIDE - 1), x), -0.5 * (HIGH - 1), y);
  return affine_columns(x, y, q_rotate(pose.rotation, vec3(0, 0, PIXEL_M)), corner);
}

static sonde_pose middle_of(const sonde_affine *map) {
  sonde_pose pose = {affine_apply(map, vec3(0.5 * (WIDE - 1), 0.5 * (HIGH - 1), 0)), {1, 0, 0, 0}};
  const double step = 1 / PIXEL_M;
  pose.rotation = q_from_matrix(m_columns(v_scale(affine_column(map, 0), step),
                                          v_scale(affine_column(map, 1), step),
                                          v_scale(affine_column(map, 2), step)));
  return pose;
}

typedef struct errors {
  double offset_s;               // pictures show the tracker's pose of so much later
  double calibration[POSE_AXES]; // what must be added to the given one
  double jitter_m, jitter_rad;   // deviations of the tracker
} errors;

static double normal(uint64_t *seed) { // a sum of twelve even numbers
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    const sonde_vec3 v = fixture_vector(seed, 0.5);
    sum += v.x + v.y + v.z;
  }
  return sum;
}

static sonde_sequence sweep(sonde_pose (*motion)(double), const errors *e) {
  sonde_sequence s;
  uint64_t seed = 11;
  assert_int_equal(sonde_sequence_create(WIDE, HIGH, FRAMES, &s, NULL), SONDE_OK);
  double back[POSE_AXES];
  const sonde_pose none = {{0, 0, 0}, {1, 0, 0, 0}};
  pose_between(none, pose_inverse(pose_moved(none, e->calibration)), back);
  for (uint32_t i = 0; i < FRAMES; ++i) {
    const double t = STEP_S * i;
    const sonde_affine truth = map_of(motion(t));
    for (int p = 0; p < WIDE * HIGH; ++p) {
      const double grain = fixture_vector(&seed, GRAIN).x;
      const double grey = phantom(affine_apply(&truth, vec3(p % WIDE, p / WIDE, 0))) + grain;
      s.pixels[(size_t)i * WIDE * HIGH + (size_t)p] = (uint8_t)(clamp(grey, 0, 255) + 0.5);
    }
    double noise[POSE_AXES];
    for (int a = 0; a < POSE_AXES; ++a)
      noise[a] = (a < 3 ? e->jitter_m : e->jitter_rad) * normal(&seed);
    const sonde_pose tracked = pose_moved(motion(t - e->offset_s), noise);
    s.frames[i].world_from_pixel = map_of(pose_moved(tracked, back));
    s.frames[i].used = true;
    char text[32];
    snprintf(text, sizeof text, "%.6f", 100 + t);
    assert_int_equal(sonde_sequence_set(&s, i, "Timestamp", text, NULL), SONDE_OK);
  }
  return s;
}

// Root mean square of how far the pictures' middles are from the truth (m), inner frames.
static double far_off(const sonde_sequence *s, sonde_pose (*motion)(double)) {
  double sum = 0;
  for (uint32_t i = 2; i + 2 < FRAMES; ++i)
    sum += v_norm2(
        v_sub(middle_of(&s->frames[i].world_from_pixel).position, motion(STEP_S * i).position));
  return sqrt(sum / (FRAMES - 4));
}

static sonde_pose_findings refine(sonde_sequence *s) {
  sonde_pose_findings f;
  sonde_error error = {0};
  if (sonde_sequence_refine_poses(s, NULL, &f, NULL, &error)) fail_msg("%s", error.message);
  return f;
}

static void a_clean_sweep_stays(void **state) {
  NOT_SANITIZED();
  (void)state;
  const errors none = {0};
  sonde_sequence s = sweep(hand, &none);
  const sonde_pose_findings f = refine(&s);
  assert_near(far_off(&s, hand), 0, 1e-7);
  assert_false(f.offset_found);
  for (int a = 0; a < POSE_AXES; ++a) assert_false(f.calibration_found[a]);
  assert_true(f.rms_grey_after <= f.rms_grey_before);
  sonde_sequence_clear(&s);
}

static void an_offset_is_found(void **state) {
  (void)state;
  const errors late = {.offset_s = 0.08, .jitter_m = 5e-5, .jitter_rad = 5e-4};
  sonde_sequence s = sweep(hand, &late);
  const double before = far_off(&s, hand);
  const sonde_pose_findings f = refine(&s);
  assert_true(f.offset_found);
  assert_near(f.offset_s, 0.08, 0.004);
  assert_near(f.offset_s, 0.08, 5 * f.offset_sd_s);
  assert_true(far_off(&s, hand) < 0.3 * before);
  sonde_sequence_clear(&s);
}

static void jitter_is_smoothed(void **state) {
  NOT_SANITIZED();
  (void)state;
  const errors rough = {.jitter_m = 2e-4, .jitter_rad = 2e-3};
  sonde_sequence s = sweep(hand, &rough);
  const double before = far_off(&s, hand);
  const sonde_pose_findings f = refine(&s);
  assert_near(f.jitter_m, 2e-4, 6e-5);
  assert_near(f.jitter_rad, 2e-3, 6e-4);
  assert_true(far_off(&s, hand) < 0.5 * before);
  assert_true(f.rms_grey_after < 0.5 * f.rms_grey_before);
  assert_false(f.offset_found);
  sonde_sequence_clear(&s);
}

static void a_calibration_is_found(void **state) {
  NOT_SANITIZED();
  (void)state;
  const errors bent = {.calibration = {0.8e-3, -1.1e-3, 0.6e-3, 0.02, -0.025, 0.015},
                       .jitter_m = 2e-5,
                       .jitter_rad = 2e-4};
  sonde_sequence s = sweep(hand, &bent);
  const sonde_pose_findings f = refine(&s);
  for (int a = 0; a < POSE_AXES; ++a) {
    assert_true(f.calibration_found[a]);
    assert_near(f.calibration[a], bent.calibration[a], a < 3 ? 0.16e-3 : 1.4e-3);
  }
  sonde_sequence_clear(&s);
}

// On rails of even speed every offset and every shift of the calibration shows the same pictures.
static void what_does_not_show_is_kept(void **state) {
  NOT_SANITIZED();
  (void)state;
  const errors rough = {.offset_s = 0.05, .jitter_m = 1e-4, .jitter_rad = 1e-3};
  sonde_sequence s = sweep(rail, &rough);
  const sonde_pose_findings f = refine(&s);
  assert_false(f.offset_found);
  for (int a = 0; a < POSE_AXES; ++a) assert_false(f.calibration_found[a]);
  sonde_sequence_clear(&s);
}

static void hidden_content_leaves_no_trace(void **state) {
  NOT_SANITIZED();
  (void)state;
  const errors rough = {.offset_s = 0.06, .jitter_m = 1e-4, .jitter_rad = 1e-3};
  sonde_sequence a = sweep(hand, &rough), b = sweep(hand, &rough);
  bool hidden[FRAMES] = {false};
  for (uint32_t i = 3; i < FRAMES; i += 7) {
    hidden[i] = true;
    memset(b.pixels + (size_t)i * WIDE * HIGH, 255, WIDE * HIGH);
  }
  sonde_pose_findings f;
  assert_int_equal(sonde_sequence_refine_poses(&a, hidden, &f, NULL, NULL), SONDE_OK);
  assert_int_equal(sonde_sequence_refine_poses(&b, hidden, &f, NULL, NULL), SONDE_OK);
  assert_true(f.offset_found);
  for (uint32_t i = 0; i < FRAMES; ++i)
    assert_memory_equal(&a.frames[i].world_from_pixel, &b.frames[i].world_from_pixel,
                        sizeof a.frames[i].world_from_pixel);
  sonde_sequence_clear(&a);
  sonde_sequence_clear(&b);
}

// Without time stamps there is no offset; too few frames are refused.
static void other_sweeps(void **state) {
  (void)state;
  const errors late = {.offset_s = 0.08};
  sonde_sequence s = sweep(hand, &late);
  assert_int_equal(sonde_sequence_set(&s, 9, "Timestamp", "soon", NULL), SONDE_OK);
  sonde_pose_findings f = refine(&s);
  assert_false(f.timed);
  assert_false(f.offset_found);
  for (uint32_t i = 7; i < FRAMES; ++i) s.frames[i].used = false;
  sonde_error error;
  assert_int_equal(sonde_sequence_refine_poses(&s, NULL, &f, NULL, &error), SONDE_MISMATCH);
  sonde_sequence_clear(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_clean_sweep_stays),
      cmocka_unit_test(an_offset_is_found),
      cmocka_unit_test(jitter_is_smoothed),
      cmocka_unit_test(a_calibration_is_found),
      cmocka_unit_test(what_does_not_show_is_kept),
      cmocka_unit_test(hidden_content_leaves_no_trace),
      cmocka_unit_test(other_sweeps),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
