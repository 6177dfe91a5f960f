// The shape that parameters describe.
#include "anatomy/shape.h"

static const double FAT_TAPER = 0.15; // more at the groin, less at the knee

void sonde_shape_fill_fat(const sonde_thigh *thigh, sonde_thigh_shape *shape) {
  SONDE_ASSERT(thigh->fat_inner_m > 0 && thigh->fat_outer_m > 0);
  SONDE_ASSERT(thigh->fat_front_m > 0 && thigh->fat_back_m > 0);
  double inner = log(thigh->fat_inner_m), outer = log(thigh->fat_outer_m);
  double front = log(thigh->fat_front_m), back = log(thigh->fat_back_m);
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j) {
    double taper = 1 + FAT_TAPER * (1 - 2.0 * j / (SONDE_TUBE_ROWS - 1));
    for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i) {
      // The logarithm of the fat by two harmonics, so that it stays positive between the sides.
      double angle = tube_angle(i);
      double fat = exp(0.25 * (inner + outer + front + back) + 0.5 * (inner - outer) * cos(angle) +
                       0.5 * (front - back) * sin(angle) +
                       0.25 * (inner + outer - front - back) * cos(2 * angle));
      shape->fat_m[j][i] = whole_nm(taper * fat);
    }
  }
}

double sonde_shape_fat(const sonde_thigh_shape *shape, sonde_vec3 point_m) {
  sonde_thigh_shape *s = (sonde_thigh_shape *)(uintptr_t)shape;
  return sonde_tube_lookup(&shape->skin, s->fat_m, sonde_tube_angle_of(&shape->skin, point_m),
                           point_m.z);
}

double sonde_shape_least_muscle(const sonde_thigh_shape *shape, const sonde_thigh *thigh,
                                double *z_m) {
  double least = INFINITY;
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j) {
    double z = shape->skin.length_m * j / (SONDE_TUBE_ROWS - 1);
    for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i) {
      double angle = tube_angle(i), depth = thigh->skin_m + shape->fat_m[j][i];
      sonde_vec3 skin = sonde_tube_point(&shape->skin, angle, z);
      sonde_vec3 below = v_madd(skin, -depth, sonde_tube_normal(&shape->skin, angle, z));
      double muscle = sonde_tube_outside(&shape->femur, below);
      if (muscle < least) least = muscle, *z_m = z;
    }
  }
  return least;
}

// Where the sections' middle stands medial of the femur at the knee.
static double knee_offset(const sonde_thigh *thigh) { return fmin(0.003, thigh->femur_lateral_m); }

double sonde_shape_swing(const sonde_thigh *thigh) {
  return thigh->femur_lateral_m - knee_offset(thigh);
}

void sonde_shape_place_femur(const sonde_thigh *thigh, sonde_thigh_shape *shape) {
  // The shaft widens towards the trochanter and the condyles. z runs along it, so that it is the
  // middle of the sections that comes from the medial side to the femur on the way to the knee.
  sonde_tube *femur = &shape->femur;
  SONDE_ASSERT(femur->length_m > 0 && thigh->femur_m > 0);
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j) {
    double t = (double)j / (SONDE_TUBE_ROWS - 1);
    double up = fmax(0, (0.15 - t) / 0.15), down = fmax(0, (t - 0.7) / 0.3);
    double radius = 0.5 * thigh->femur_m * (1 + 0.35 * (up * up + down * down));
    double lateral = knee_offset(thigh) + sonde_shape_swing(thigh) * (1 - t) * (1 - t);
    femur->x_m[j] = whole_nm(shape->skin.x_m[j] - lateral);
    femur->y_m[j] = shape->skin.y_m[j] + thigh->femur_anterior_m;
    for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i) femur->radius_m[j][i] = whole_nm(radius);
  }
}

sonde_status sonde_thigh_shape_create(const sonde_thigh *thigh, sonde_thigh_shape **out,
                                      sonde_error *error) {
  *out = NULL;
  sonde_status status = sonde_thigh_check(thigh, error);
  if (status) return status;
  sonde_thigh_shape *shape = SONDE_NEW(sonde_thigh_shape, 1);
  if (!shape) return sonde_fail_memory(error);
  shape->skin.length_m = shape->femur.length_m = thigh->length_m;
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j) {
    // The section's radius up to a factor, which gives it the wanted girth.
    double t = (double)j / (SONDE_TUBE_ROWS - 1), z = t * shape->skin.length_m;
    double second = thigh->oval * (1 - 0.45 * t), third = 0.02 * (1 - 0.4 * t);
    for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i)
      shape->skin.radius_m[j][i] =
          1 + second * cos(2 * (tube_angle(i) - 1.745)) + third * cos(3 * (tube_angle(i) - 0.349));
    double wanted = thigh->girth_proximal_m * (1 - t) * (1 - 2 * t) +
                    4 * thigh->girth_m * t * (1 - t) + thigh->girth_distal_m * t * (2 * t - 1);
    double factor = wanted / sonde_tube_girth(&shape->skin, z);
    for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i)
      shape->skin.radius_m[j][i] = whole_nm(factor * shape->skin.radius_m[j][i]);
  }
  sonde_shape_fill_fat(thigh, shape);
  const double swing = sonde_shape_swing(thigh);
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j)
    shape->skin.x_m[j] = whole_nm(swing * (0.5 - (double)j / (SONDE_TUBE_ROWS - 1)));
  sonde_shape_place_femur(thigh, shape);
  double z_m = 0, least = sonde_shape_least_muscle(shape, thigh, &z_m);
  if (least >= SONDE_LEAST_MUSCLE_M) {
    *out = shape;
    return SONDE_OK;
  }
  // A girth that would do: the femur moves aside with the girth and takes a part of a wider radius.
  const double share = 0.65;
  double here = sonde_tube_girth(&shape->skin, z_m);
  double more = 2 * SONDE_PI * (SONDE_LEAST_MUSCLE_M - least) * thigh->girth_m / here / share;
  sonde_thigh_shape_destroy(shape);
  return sonde_fail(error, SONDE_ARGUMENT,
                    "girth-mm is %g: fat and femur leave %.1f mm of muscle at %.0f mm from the "
                    "groin, expected 12; girth-mm from about %.0f to 900 would do, or less fat",
                    thigh->girth_m * 1e3, least * 1e3, z_m * 1e3, (thigh->girth_m + more) * 1e3);
}

void sonde_thigh_shape_destroy(sonde_thigh_shape *shape) { sonde_free(shape); }
