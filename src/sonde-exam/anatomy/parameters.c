// The parameters of a thigh: their list, their ranges and their distributions (docs/anatomy.md).
#include "anatomy/shape.h"
#include "base/parameters.h"
#include "base/random.h"

#include <stddef.h>

#define ROW(member, name, unit, low, high, text)                                                   \
  {name, text, unit, low, high, offsetof(sonde_thigh, member)},
static const sonde_parameter PARAMETERS[] = {SONDE_THIGH_LIST(ROW)};
#undef ROW

enum { TRIES = 64, SEX_COUNTER = 1 << 20 };

const sonde_parameter *sonde_thigh_parameters(uint32_t *count) {
  SONDE_ASSERT(count);
  *count = (uint32_t)SONDE_COUNT_OF(PARAMETERS);
  return PARAMETERS;
}

sonde_thigh sonde_thigh_unknown(void) {
  sonde_thigh thigh = {.sex = SONDE_SEX_DRAWN};
  sonde_parameters_forget(&thigh, PARAMETERS, SONDE_COUNT_OF(PARAMETERS));
  return thigh;
}

sonde_status sonde_thigh_check(const sonde_thigh *thigh, sonde_error *error) {
  sonde_status status =
      sonde_parameters_check(thigh, PARAMETERS, SONDE_COUNT_OF(PARAMETERS), true, error);
  if (status) return status;
  if (thigh->second_vein != 0 && thigh->second_vein != 1)
    return sonde_fail(error, SONDE_ARGUMENT, "second-vein is %g, expected 0 or 1",
                      thigh->second_vein);
  if (!(thigh->girth_proximal_m >= thigh->girth_m && thigh->girth_m >= thigh->girth_distal_m))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "girth-mm is %g, expected %g to %g: between girth-distal-mm and "
                      "girth-proximal-mm",
                      thigh->girth_m * 1e3, thigh->girth_distal_m * 1e3,
                      thigh->girth_proximal_m * 1e3);
  return SONDE_OK;
}

typedef struct draw {
  sonde_thigh *thigh;
  uint64_t seed;
} draw;

// Mean and deviation, truncated to mean +- 2.5 deviations and to [low, high]; kept when known.
static void normal_draw(const draw *d, double *member, double mean, double deviation, double low,
                        double high) {
  SONDE_ASSERT(low < high && deviation >= 0);
  if (!isnan(*member)) return;
  uint64_t place = (uint64_t)((char *)member - (char *)d->thigh);
  double value = mean;
  low = fmax(low, mean - 2.5 * deviation);
  high = fmin(high, mean + 2.5 * deviation);
  for (uint64_t k = 0; k < TRIES; ++k) {
    value = mean + deviation * sonde_random_normal(d->seed, place * TRIES + k);
    if (value >= low && value <= high) break;
  }
  *member = whole_nm(clamp(value, low, high));
}

sonde_status sonde_thigh_draw(const sonde_thigh *known, uint64_t seed, sonde_thigh *thigh,
                              sonde_error *error) {
  *thigh = *known;
  sonde_status status =
      sonde_parameters_check(thigh, PARAMETERS, SONDE_COUNT_OF(PARAMETERS), false, error);
  if (status) return status;
  if (thigh->sex == SONDE_SEX_DRAWN)
    thigh->sex = sonde_random_bits(seed, SEX_COUNTER) & 1 ? SONDE_SEX_FEMALE : SONDE_SEX_MALE;
  draw d = {thigh, seed};
  sonde_thigh *t = d.thigh;
  const bool female = t->sex == SONDE_SEX_FEMALE;
  const double share = female ? 1.15 : 0.85;
  // Fat of the four sides, then the sections, which depend on it, then vessels and springs.
  normal_draw(&d, &t->fat_front_m, 0.0104 * share, 0.0041 * share, 0.003, 0.04);
  normal_draw(&d, &t->fat_inner_m, 1.5 * t->fat_front_m, 0.15 * t->fat_front_m, 0.003, 0.06);
  normal_draw(&d, &t->fat_outer_m, 0.7 * t->fat_front_m, 0.05 * t->fat_front_m, 0.002, 0.06);
  normal_draw(&d, &t->fat_back_m, 1.1 * t->fat_front_m, 0.1 * t->fat_front_m, 0.002, 0.06);
  normal_draw(&d, &t->length_m, female ? 0.300 : 0.323, female ? 0.012 : 0.013, 0.2, 0.4);
  normal_draw(&d, &t->skin_m, 0.0018, 0.0002, 0.001, 0.004);
  double fat = 0.25 * (t->fat_front_m + t->fat_back_m + t->fat_inner_m + t->fat_outer_m);
  double around = 2 * SONDE_PI * (fat + t->skin_m); // what skin and fat add to the muscles' girth
  normal_draw(&d, &t->girth_m, around + (female ? 0.425 : 0.46), 0.022, 0.3, 0.9);
  normal_draw(&d, &t->girth_proximal_m, 1.22 * t->girth_m, 0.03 * t->girth_m, t->girth_m, 1.1);
  normal_draw(&d, &t->girth_distal_m, 0.81 * t->girth_m, 0.02 * t->girth_m, 0.25, t->girth_m);
  normal_draw(&d, &t->oval, 0.055, 0.012, 0, 0.12);
  normal_draw(&d, &t->femur_m, female ? 0.026 : 0.028, 0.0015, 0.016, 0.04);
  normal_draw(&d, &t->femur_lateral_m, 0.30 * t->girth_proximal_m / (2 * SONDE_PI), 0.003, 0,
              0.045);
  normal_draw(&d, &t->femur_anterior_m, 0.012, 0.0015, 0, 0.025);
  normal_draw(&d, &t->vein_m, female ? 0.0098 : 0.0106, 0.0012, 0.004, 0.018);
  normal_draw(&d, &t->artery_m, female ? 0.0075 : 0.0085, 0.0007, 0.003, 0.014);
  normal_draw(&d, &t->vein_angle_rad, 70 * SONDE_PI / 180, 4 * SONDE_PI / 180, 0.78, 1.57);
  normal_draw(&d, &t->vein_cover_m, 0.003, 0.0008, 0.001, 0.03);
  normal_draw(&d, &t->canal_cover_m, 0.009, 0.0015, 0.003, 0.04);
  normal_draw(&d, &t->saphenous_m, 0.004, 0.0007, 0.001, 0.01);
  normal_draw(&d, &t->deep_branch_m, 0.04, 0.006, 0.015, 0.08);
  if (isnan(t->second_vein))
    t->second_vein = sonde_random_uniform(d.seed, SEX_COUNTER + 1) < 0.2 ? 1 : 0;
  normal_draw(&d, &t->stiffness, 1, 0.17, 0.2, 5);
  normal_draw(&d, &t->damping_s, 0.02, 0, 0.001, 0.2);
  return sonde_thigh_check(thigh, error);
}
