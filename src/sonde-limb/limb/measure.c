// The table of a limb: girths, muscles' areas and volumes.
#include "limb/muscles.h"

uint32_t sonde_limb_muscle_count(void) { return SONDE_LIMB_MUSCLES; }

const sonde_limb_body *sonde_limb_body_of(const sonde_limb *limb) {
  SONDE_ASSERT(limb);
  return &limb->body;
}

double sonde_limb_girth(const sonde_limb *limb, double level) {
  SONDE_ASSERT(limb);
  enum { SIDES = 360 };
  double length = 0;
  sonde_vec3 before = {0, 0, 0};
  for (uint32_t i = 0; i <= SIDES; ++i) {
    double a = 2 * SONDE_PI * i / SIDES, r = limb_skin_radius(limb, level, a);
    sonde_vec3 p = vec3(r * sin(a), r * cos(a), 0);
    if (i) length += v_distance(p, before);
    before = p;
  }
  return length;
}

double sonde_limb_muscle_section(const sonde_limb *limb, uint32_t index, double level,
                                 double *rule_m2) {
  const struct limb_muscles *m = limb->muscles;
  SONDE_ASSERT(m && index < SONDE_LIMB_MUSCLES);
  double at = clamp((level - LIMB_TOP) / LIMB_CELL_STEP, 0, LIMB_CELL_ROWS - 1.000001);
  uint32_t row = (uint32_t)at;
  double u = at - row;
  if (rule_m2) *rule_m2 = (1 - u) * m->target[row][index] + u * m->target[row + 1][index];
  return (1 - u) * m->area[row][index] + u * m->area[row + 1][index];
}

sonde_limb_muscle sonde_limb_muscle_at(const sonde_limb *limb, uint32_t index) {
  SONDE_ASSERT(limb && limb->muscles && index < SONDE_LIMB_MUSCLES);
  const limb_muscle *table = &limb_muscle_table[index];
  sonde_limb_muscle muscle = {.name = table->name,
                              .pennation_rad = table->pennation_deg * SONDE_PI / 180,
                              .fibre_m = table->fibre_mm * 1e-3 * limb->scale};
  for (uint32_t row = 0; row + 1 < LIMB_CELL_ROWS; ++row) {
    double level = LIMB_TOP + row * LIMB_CELL_STEP, next = level + LIMB_CELL_STEP;
    double thick = limb_z(limb, level) - limb_z(limb, next);
    double area = limb->muscles->area[row][index];
    muscle.volume_m3 += 0.5 * thick * (area + limb->muscles->area[row + 1][index]);
    muscle.rule_m3 +=
        0.5 * thick *
        (limb_muscle_area(&limb->body, index, level) + limb_muscle_area(&limb->body, index, next));
    if (area > muscle.largest_m2) muscle.largest_m2 = area, muscle.largest_level = level;
  }
  return muscle;
}
