// The parameters of a body: their list, their ranges and the population's rules (docs/limb.md).
#include "limb/frame.h"

#include "base/parameters.h"
#include "base/random.h"

#define ROW(member, name, unit, low, high, text)                                                   \
  {name, text, unit, low, high, offsetof(sonde_limb_body, member)},
static const sonde_parameter PARAMETERS[] = {SONDE_LIMB_LIST(ROW)};
#undef ROW

enum { TRIES = 64, SEX_COUNTER = 1 << 20 };

const sonde_parameter *sonde_limb_parameters(uint32_t *count) {
  SONDE_ASSERT(count);
  *count = (uint32_t)SONDE_COUNT_OF(PARAMETERS);
  return PARAMETERS;
}

sonde_limb_body sonde_limb_unknown(void) {
  sonde_limb_body body = {.sex = SONDE_SEX_DRAWN, .side = SONDE_LIMB_RIGHT};
  sonde_parameters_forget(&body, PARAMETERS, SONDE_COUNT_OF(PARAMETERS));
  for (size_t k = 0; k < SONDE_LIMB_MUSCLES; ++k) body.share[k] = NAN;
  return body;
}

typedef struct draw {
  sonde_limb_body *body;
  uint64_t seed;
  bool female;
} draw;

// A standard normal number of a parameter, between -2.5 and 2.5.
static double standard(const draw *d, const double *member) {
  uint64_t place = (uint64_t)((const char *)member - (const char *)d->body);
  SONDE_ASSERT(place < sizeof *d->body);
  double value = 0;
  for (uint64_t k = 0; k < TRIES; ++k) {
    value = sonde_random_normal(d->seed, place * TRIES + k);
    if (fabs(value) <= 2.5) return value;
  }
  return 0;
}

// The parameter of a member with its range.
static void keep_in_range(const draw *d, double *member, double value) {
  size_t place = (size_t)((char *)member - (char *)d->body);
  for (size_t k = 0; k < SONDE_COUNT_OF(PARAMETERS); ++k)
    if (PARAMETERS[k].offset == place) value = clamp(value, PARAMETERS[k].low, PARAMETERS[k].high);
  *member = value;
}

// Mean and deviation by sex; kept when known.
static void normal(const draw *d, double *member, double male, double female, double male_sd,
                   double female_sd) {
  SONDE_ASSERT(male_sd >= 0 && female_sd >= 0);
  if (!isnan(*member)) return;
  double deviation = d->female ? female_sd : male_sd;
  keep_in_range(d, member, (d->female ? female : male) + deviation * standard(d, member));
}

// A girth whose residual follows the residual above it by a correlation; gives the residual in its
// own deviations, so that a known girth steers those that follow.
static double girth(const draw *d, double *member, double mean, double deviation, double above,
                    double correlation) {
  SONDE_ASSERT(fabs(correlation) < 1 && deviation > 0);
  if (isnan(*member)) {
    double own = standard(d, member);
    double residual = correlation * above + sqrt(1 - correlation * correlation) * own;
    keep_in_range(d, member, mean + deviation * residual);
  }
  return clamp((*member - mean) / deviation, -3, 3);
}

// A fat thickness whose logarithm is normal about `mean_m`; kept when known.
static void fat(const draw *d, double *member, double mean_m, double log_sd) {
  SONDE_ASSERT(mean_m > 0);
  if (!isnan(*member)) return;
  keep_in_range(d, member, mean_m * exp(log_sd * standard(d, member) - 0.5 * log_sd * log_sd));
}

// Stature, lengths and girths: regressions of ANSUR II about its means.
static void draw_frame(const draw *d) {
  sonde_limb_body *b = d->body;
  const bool w = d->female;
  normal(d, &b->age_y, 45, 45, 15, 15);
  normal(d, &b->stature_m, 1.756, 1.628, 0.069, 0.064);
  normal(d, &b->bmi, 27.7, 25.5, 4.0, 3.5);
  double taller = b->stature_m - (w ? 1.628 : 1.756), heavier = b->bmi - (w ? 25.5 : 27.7);
  double thigh = 0.245 * b->stature_m;
  normal(d, &b->thigh_length_m, thigh, thigh, 0.012, 0.011);
  normal(d, &b->calf_length_m, 0.395 + 0.225 * taller, 0.375 + 0.230 * taller, 0.014, 0.014);
  double mean[4] = {
      w ? 0.616 + 0.235 * taller + 0.0137 * heavier : 0.625 + 0.216 * taller + 0.0128 * heavier,
      w ? 0.401 + 0.154 * taller + 0.0078 * heavier : 0.409 + 0.139 * taller + 0.0066 * heavier,
      w ? 0.373 + 0.135 * taller + 0.0060 * heavier : 0.392 + 0.115 * taller + 0.0059 * heavier,
      w ? 0.216 + 0.079 * taller + 0.0021 * heavier : 0.229 + 0.079 * taller + 0.0023 * heavier};
  // Correlations of the residuals that leave .88, .80 and .82 between the girths themselves.
  double e = girth(d, &b->girth_thigh_m, mean[0], 0.023, 0, 0);
  e = girth(d, &b->girth_knee_m, mean[1], w ? 0.019 : 0.015, e, 0.48);
  e = girth(d, &b->girth_calf_m, mean[2], w ? 0.017 : 0.016, e, 0.45);
  girth(d, &b->girth_ankle_m, mean[3], w ? 0.012 : 0.010, e, 0.68);
}

double limb_muscle_rule(const sonde_limb_body *b) {
  double mass = b->bmi * b->stature_m * b->stature_m;
  double old = b->age_y > 60 ? 1 - 0.01 * (b->age_y - 60) : 1;
  return (47 * b->stature_m * mass + 1285) / 7300 * (b->sex == SONDE_SEX_FEMALE ? 0.92 : 1) * old;
}

double limb_groin_fat(const sonde_limb_body *b) {
  double lean = b->sex == SONDE_SEX_FEMALE ? 0.012 : 0.008;
  return fmax(lean + 0.001 * (b->bmi - 22.5), 0.003);
}

double limb_groin_cover(const sonde_limb_body *b) {
  // The front wall of the vein is 19 mm deep, that of the artery 15 mm, both 1.2 mm more per unit
  // of body mass index (docs/limb_vessels.md). The artery stands 5 mm deeper than its own rule, so
  // that the middles of both are at one depth within 4 mm.
  double depth = 0.0198 + 0.0012 * (b->bmi - 22.5);
  return clamp(depth - limb_groin_fat(b) - b->skin_m, 0.0045, 0.014);
}

// Fat: the front of mid-thigh by sex and BMI and by what girth and muscle volume leave, the other
// places by it.
static void draw_fat(const draw *d) {
  sonde_limb_body *b = d->body;
  const bool w = d->female;
  normal(d, &b->skin_m, 0.0018, 0.0017, 0.0002, 0.0002);
  double fatter = exp((w ? 0.06 : 0.07) * (b->bmi - 25.5));
  // Two rules speak about the fat in front: its own logarithm with a deviation of 25 %, and the
  // skin's girth less the muscles' section, which has 10 %. The draw is from their product.
  double rule = (w ? 0.0135 : 0.0063) * fatter, rule_sd = 0.25 * rule;
  double section = 0.01316 * limb_muscle_rule(b) / (b->stature_m / 1.70);
  double radius = 1.015 * sqrt(section / SONDE_PI), radius_sd = 0.05 * radius;
  double left = b->girth_thigh_m * (0.497 / 0.630) / (2 * SONDE_PI) - radius - b->skin_m;
  double trust = 1 / (rule_sd * rule_sd), other = 1.075 * 1.075 / (radius_sd * radius_sd);
  double mean = (trust * rule + other * left / 1.075) / (trust + other);
  double least = 0.4 * rule;
  normal(d, &b->fat_front_m, fmax(mean, least), fmax(mean, least), 1 / sqrt(trust + other),
         1 / sqrt(trust + other));
  double f = b->fat_front_m;
  fat(d, &b->fat_medial_m, 1.5 * f, 0.1);
  fat(d, &b->fat_lateral_m, 0.7 * f, 0.1);
  fat(d, &b->fat_back_m, 1.1 * f, 0.1);
  fat(d, &b->fat_groin_m, limb_groin_fat(b), 0.25);
  double calf = sqrt(fatter);
  fat(d, &b->fat_popliteal_m, (w ? 0.013 : 0.008) * calf, 0.25);
  fat(d, &b->fat_calf_m, (w ? 0.011 : 0.007) * calf, 0.3);
  fat(d, &b->fat_calf_medial_m, (w ? 0.009 : 0.006) * calf, 0.3);
  fat(d, &b->fat_shin_m, (w ? 0.0033 : 0.0025) * sqrt(calf), 0.2);
}

sonde_status sonde_limb_draw(const sonde_limb_body *known, uint64_t seed, sonde_limb_body *body,
                             sonde_error *error) {
  SONDE_ASSERT(known && body);
  sonde_limb_body drawn = *known;
  sonde_status status =
      sonde_parameters_check(&drawn, PARAMETERS, SONDE_COUNT_OF(PARAMETERS), false, error);
  if (status) return status;
  drawn.seed = seed;
  if (drawn.sex == SONDE_SEX_DRAWN)
    drawn.sex = sonde_random_bits(seed, SEX_COUNTER) & 1 ? SONDE_SEX_FEMALE : SONDE_SEX_MALE;
  draw d = {&drawn, seed, drawn.sex == SONDE_SEX_FEMALE};
  draw_frame(&d);
  draw_fat(&d);
  // Bones grow with stature; their deviations leave the tabled ones in the population.
  sonde_limb_body *b = &drawn;
  double size = b->stature_m / (d.female ? 1.628 : 1.756), degree = SONDE_PI / 180;
  normal(&d, &b->head_m, 0.048 * size, 0.0425 * size, 0.0017, 0.0015);
  normal(&d, &b->offset_m, 0.043 * size, 0.038 * size, 0.0055, 0.0055);
  normal(&d, &b->neck_shaft_rad, 129 * degree, 129 * degree, 6 * degree, 6 * degree);
  normal(&d, &b->anteversion_rad, 10 * degree, 13 * degree, 8 * degree, 8 * degree);
  normal(&d, &b->shaft_m, 0.0275 * size, 0.025 * size, 0.0015, 0.0014);
  normal(&d, &b->bow_m, 1.15 * size, 1.1 * size, 0.2, 0.2);
  normal(&d, &b->epicondylar_m, 0.084 * size, 0.075 * size, 0.0028, 0.0028);
  double knee = b->epicondylar_m / (d.female ? 0.075 : 0.084);
  normal(&d, &b->condyle_m, 0.064 * knee, 0.058 * knee, 0.002, 0.002);
  normal(&d, &b->patella_m, 0.045 * knee, 0.040 * knee, 0.0025, 0.0025);
  normal(&d, &b->plateau_m, 0.0785 * knee, 0.069 * knee, 0.0015, 0.0015);
  normal(&d, &b->tibia_m, 0.0225 * size, 0.0205 * size, 0.0014, 0.0013);
  normal(&d, &b->torsion_rad, 27 * degree, 29 * degree, 7 * degree, 7 * degree);
  normal(&d, &b->fibula_m, 0.0125 * size, 0.0113 * size, 0.0009, 0.0008);
  normal(&d, &b->malleoli_m, 0.075 * size, 0.067 * size, 0.0027, 0.0027);
  for (uint32_t k = 0; k < SONDE_LIMB_MUSCLES; ++k)
    if (isnan(drawn.share[k])) drawn.share[k] = exp(0.12 * standard(&d, &drawn.share[k]));
  // Pairs that no body has together are refused.
  struct pair {
    const char *first, *second;
    double ratio, low, high;
  } const pairs[] = {
      {"thigh-length-mm", "stature-cm", b->thigh_length_m / b->stature_m, 0.2, 0.29},
      {"calf-length-mm", "stature-cm", b->calf_length_m / b->stature_m, 0.17, 0.28},
      {"girth-knee-mm", "girth-thigh-mm", b->girth_knee_m / b->girth_thigh_m, 0.45, 0.92},
      {"girth-calf-mm", "girth-thigh-mm", b->girth_calf_m / b->girth_thigh_m, 0.4, 0.92},
      {"girth-ankle-mm", "girth-calf-mm", b->girth_ankle_m / b->girth_calf_m, 0.4, 0.82},
      {"epicondylar-mm", "girth-knee-mm", b->epicondylar_m / b->girth_knee_m, 0.12, 0.285},
      {"femoral-head-mm", "epicondylar-mm", b->head_m / b->epicondylar_m, 0.42, 0.75},
      {"plateau-mm", "epicondylar-mm", b->plateau_m / b->epicondylar_m, 0.75, 1.15},
      {"malleoli-mm", "girth-ankle-mm", b->malleoli_m / b->girth_ankle_m, 0.22, 0.42}};
  for (size_t k = 0; k < SONDE_COUNT_OF(pairs); ++k)
    if (!(pairs[k].ratio >= pairs[k].low && pairs[k].ratio <= pairs[k].high))
      return sonde_fail(error, SONDE_ARGUMENT, "%s is %.3g of %s, expected %g to %g",
                        pairs[k].first, pairs[k].ratio, pairs[k].second, pairs[k].low,
                        pairs[k].high);
  *body = drawn;
  return SONDE_OK;
}
