// What the tests of the limb share: limbs of seeds, sexes and body mass indices.
#ifndef SONDE_TESTS_LIMB_TEST_H
#define SONDE_TESTS_LIMB_TEST_H

#include "../fixture.h"
#include "../sanitized.h"
#include "sonde/limb.h"

#ifndef DEGREE
#define DEGREE (SONDE_PI / 180)
#endif

static inline sonde_limb_body draw_body(uint64_t seed, sonde_sex sex, double bmi,
                                        sonde_limb_side side) {
  sonde_limb_body body = sonde_limb_unknown();
  sonde_error error = {0};
  body.sex = sex, body.bmi = bmi, body.side = side;
  if (sonde_limb_draw(&body, seed, &body, &error))
    fail_msg("seed %d, BMI %g: %s", (int)seed, bmi, error.message);
  return body;
}

static inline sonde_limb *make_limb(uint64_t seed, sonde_sex sex, double bmi,
                                    sonde_limb_side side) {
  sonde_limb_body body = draw_body(seed, sex, bmi, side);
  sonde_limb *limb = NULL;
  sonde_error error = {0};
  if (sonde_limb_create(&body, &limb, &error))
    fail_msg("seed %d, BMI %g: %s", (int)seed, bmi, error.message);
  return limb;
}

// The k-th of a family over both sexes and BMI 17 to 40.
static inline sonde_limb_body body_of_family(uint32_t k, sonde_limb_side side) {
  const double bmi[] = {17, 21, 25, 30, 35, 40};
  return draw_body(1000 + k, k % 2 ? SONDE_SEX_MALE : SONDE_SEX_FEMALE, bmi[k / 2 % 6], side);
}

static inline sonde_limb *limb_of_family(uint32_t k, sonde_limb_side side) {
  sonde_limb_body body = body_of_family(k, side);
  return make_limb(1000 + k, body.sex, body.bmi, side);
}

// Uniform in [0, 1), a sequence for each test.
static inline double next_uniform(uint32_t *state) {
  *state = *state * 1664525u + 1013904223u;
  return (*state >> 8) / 16777216.0;
}

#endif
