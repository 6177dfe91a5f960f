// The population: means, deviations and correlations of what is drawn; what is given stays and
// changes nothing that does not depend on it; impossible bodies are refused.
#include "limb_test.h"

enum { BODIES = 600 };

typedef struct sum {
  double n, x, xx, y, yy, xy;
} sum;

static void add(sum *s, double x, double y) {
  s->n += 1, s->x += x, s->xx += x * x, s->y += y, s->yy += y * y, s->xy += x * y;
}
static double mean(const sum *s) { return s->x / s->n; }
static double deviation(const sum *s) { return sqrt(s->xx / s->n - mean(s) * mean(s)); }
static double correlation(const sum *s) {
  double my = s->y / s->n;
  return (s->xy / s->n - mean(s) * my) / deviation(s) / sqrt(s->yy / s->n - my * my);
}

// Draws are cut at 2.5 deviations, which takes 5 % off a normal deviation.
static void girths_have_the_population_s_moments(void **state) {
  (void)state;
  const struct row {
    size_t offset;
    double male, male_sd, female, female_sd;
  } rows[] = {{offsetof(sonde_limb_body, stature_m), 1.756, 0.069, 1.628, 0.064},
              {offsetof(sonde_limb_body, bmi), 27.7, 4.0, 25.5, 3.5},
              {offsetof(sonde_limb_body, girth_thigh_m), 0.625, 0.059, 0.616, 0.056},
              {offsetof(sonde_limb_body, girth_knee_m), 0.409, 0.032, 0.401, 0.035},
              {offsetof(sonde_limb_body, girth_calf_m), 0.392, 0.030, 0.373, 0.029},
              {offsetof(sonde_limb_body, girth_ankle_m), 0.229, 0.015, 0.216, 0.015},
              {offsetof(sonde_limb_body, calf_length_m), 0.395, 0.025, 0.375, 0.024},
              {offsetof(sonde_limb_body, head_m), 0.048, 0.0025, 0.0425, 0.0022},
              {offsetof(sonde_limb_body, epicondylar_m), 0.084, 0.004, 0.075, 0.004},
              {offsetof(sonde_limb_body, malleoli_m), 0.075, 0.004, 0.067, 0.004}};
  for (int sex = SONDE_SEX_FEMALE; sex <= SONDE_SEX_MALE; ++sex)
    for (size_t k = 0; k < SONDE_COUNT_OF(rows); ++k) {
      bool male = sex == SONDE_SEX_MALE;
      sum s = {0};
      for (uint64_t seed = 0; seed < BODIES; ++seed) {
        sonde_limb_body body = sonde_limb_unknown();
        body.sex = (sonde_sex)sex;
        if (sonde_limb_draw(&body, seed, &body, NULL)) continue;
        add(&s, *(const double *)(const void *)((const char *)&body + rows[k].offset), 0);
      }
      double wanted = male ? rows[k].male : rows[k].female;
      double sd = male ? rows[k].male_sd : rows[k].female_sd;
      assert_true(s.n > 0.99 * BODIES);
      assert_near(mean(&s) / wanted, 1, 0.02);
      assert_near(deviation(&s) / sd, 0.96, 0.16);
    }
}

static void girths_are_correlated(void **state) {
  (void)state;
  sum lower = {0}, calf = {0}, ankle = {0};
  for (uint64_t seed = 0; seed < BODIES; ++seed) {
    sonde_limb_body body = sonde_limb_unknown();
    body.sex = SONDE_SEX_MALE;
    if (sonde_limb_draw(&body, seed, &body, NULL)) continue;
    add(&lower, body.girth_thigh_m, body.girth_knee_m);
    add(&calf, body.girth_thigh_m, body.girth_calf_m);
    add(&ankle, body.girth_calf_m, body.girth_ankle_m);
  }
  assert_near(correlation(&lower), 0.88, 0.04);
  assert_near(correlation(&calf), 0.80, 0.06);
  assert_near(correlation(&ankle), 0.82, 0.05);
}

// Fat of the front: 10.4 mm times 0.6 in men and 1.3 in women at the BMI of the published sample.
static void fat_follows_sex_and_mass(void **state) {
  (void)state;
  double front[2][2] = {{0}}; // sex, BMI 25.5 and 32
  for (int sex = 0; sex < 2; ++sex)
    for (int fat = 0; fat < 2; ++fat) {
      sum s = {0};
      for (uint64_t seed = 0; seed < BODIES; ++seed) {
        sonde_limb_body body = sonde_limb_unknown();
        body.sex = sex ? SONDE_SEX_MALE : SONDE_SEX_FEMALE, body.bmi = fat ? 32 : 25.5;
        if (!sonde_limb_draw(&body, seed, &body, NULL)) add(&s, body.fat_front_m, 0);
      }
      front[sex][fat] = mean(&s);
    }
  assert_near(front[0][0], 0.0135, 0.0012);
  assert_near(front[1][0], 0.0063, 0.0009);
  assert_true(front[0][1] > 1.25 * front[0][0] && front[1][1] > 1.35 * front[1][0]);
}

// Fat over the femoral vessels: 8 mm in men and 12 mm in women at a body mass index of 22.5, 1 mm
// more per unit.
static void fat_of_the_groin_follows_sex_and_mass(void **state) {
  (void)state;
  for (int sex = SONDE_SEX_FEMALE; sex <= SONDE_SEX_MALE; ++sex)
    for (double bmi = 22.5; bmi < 35; bmi += 10) {
      sum s = {0};
      for (uint64_t seed = 0; seed < BODIES; ++seed) {
        sonde_limb_body body = sonde_limb_unknown();
        body.sex = (sonde_sex)sex, body.bmi = bmi;
        if (!sonde_limb_draw(&body, seed, &body, NULL)) add(&s, body.fat_groin_m, 0);
      }
      double wanted = (sex == SONDE_SEX_MALE ? 0.008 : 0.012) + 0.001 * (bmi - 22.5);
      assert_near(mean(&s) / wanted, 1, 0.05);
      assert_near(deviation(&s) / wanted, 0.25, 0.03);
    }
}

static void what_is_given_stays_and_steers_only_its_dependants(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    sonde_limb_body free = sonde_limb_unknown(), given = sonde_limb_unknown();
    free.sex = given.sex = SONDE_SEX_FEMALE;
    given.fat_popliteal_m = 0.011, given.girth_calf_m = 0.38;
    assert_int_equal(sonde_limb_draw(&free, seed, &free, NULL), SONDE_OK);
    assert_int_equal(sonde_limb_draw(&given, seed, &given, NULL), SONDE_OK);
    assert_near(given.fat_popliteal_m, 0.011, 0);
    assert_near(given.girth_calf_m, 0.38, 0);
    // Above the calf nothing changes; the ankle follows the calf's residual.
    assert_near(given.stature_m, free.stature_m, 0);
    assert_near(given.girth_thigh_m, free.girth_thigh_m, 0);
    assert_near(given.girth_knee_m, free.girth_knee_m, 0);
    assert_near(given.fat_front_m, free.fat_front_m, 0);
    assert_near(given.malleoli_m, free.malleoli_m, 0);
    assert_true(
        (given.girth_ankle_m - free.girth_ankle_m) * (given.girth_calf_m - free.girth_calf_m) >= 0);
    for (uint32_t k = 0; k < SONDE_LIMB_MUSCLES; ++k) assert_near(given.share[k], free.share[k], 0);
  }
}

static void impossible_bodies_are_refused(void **state) {
  (void)state;
  sonde_error error = {0};
  sonde_limb_body body = sonde_limb_unknown(), drawn;
  body.bmi = 60;
  assert_int_equal(sonde_limb_draw(&body, 1, &drawn, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "bmi is 60, expected 15 to 45"));
  body = sonde_limb_unknown();
  body.stature_m = 1.5, body.thigh_length_m = 0.5;
  assert_int_equal(sonde_limb_draw(&body, 1, &drawn, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "thigh-length-mm"));
  body = sonde_limb_unknown();
  body.girth_calf_m = 0.3, body.girth_ankle_m = 0.3;
  assert_int_equal(sonde_limb_draw(&body, 1, &drawn, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "girth-ankle-mm"));
  // Fat that leaves no muscle.
  body = sonde_limb_unknown();
  body.girth_thigh_m = 0.4, body.girth_knee_m = 0.3, body.fat_front_m = body.fat_back_m = 0.06;
  body.fat_medial_m = 0.07, body.fat_lateral_m = 0.05, body.epicondylar_m = 0.075;
  body.girth_calf_m = 0.29, body.girth_ankle_m = 0.19, body.malleoli_m = 0.06;
  sonde_limb *limb = NULL;
  assert_int_equal(sonde_limb_draw(&body, 1, &drawn, &error), SONDE_OK);
  assert_int_equal(sonde_limb_create(&drawn, &limb, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "radius, expected 22 or more"));
  assert_null(limb);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(girths_have_the_population_s_moments),
      cmocka_unit_test(girths_are_correlated),
      cmocka_unit_test(fat_follows_sex_and_mass),
      cmocka_unit_test(fat_of_the_groin_follows_sex_and_mass),
      cmocka_unit_test(what_is_given_stays_and_steers_only_its_dependants),
      cmocka_unit_test(impossible_bodies_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
