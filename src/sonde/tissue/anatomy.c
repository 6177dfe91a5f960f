// Questions to the named anatomy.
#include "sonde/tissue_anatomy.h"

#include "base/base.h"
#include "base/maths.h"
#include "tissue/anatomy.h"

#include <string.h>

// Muscle level at a height, between two stored ones.
static sonde_muscle_level level_at(const sonde_thigh_anatomy *a, double z_m) {
  SONDE_ASSERT(a->level_count >= 2);
  uint32_t k = 1;
  while (k + 1 < a->level_count && a->level[k].z_m < z_m) ++k;
  const sonde_muscle_level *p = &a->level[k - 1], *q = &a->level[k];
  double t = clamp((z_m - p->z_m) / (q->z_m - p->z_m), 0, 1);
  sonde_muscle_level l = {z_m,
                          p->bone_x_m + t * (q->bone_x_m - p->bone_x_m),
                          p->bone_y_m + t * (q->bone_y_m - p->bone_y_m),
                          {0}};
  for (int s = 0; s < SONDE_COMPARTMENTS; ++s)
    l.septum_rad[s] = p->septum_rad[s] + t * (q->septum_rad[s] - p->septum_rad[s]);
  return l;
}

sonde_compartment sonde_anatomy_compartment(const sonde_thigh_anatomy *anatomy, sonde_vec3 rest_m) {
  sonde_muscle_level l = level_at(anatomy, rest_m.z);
  double angle = atan2(rest_m.y - l.bone_y_m, rest_m.x - l.bone_x_m), round = 2 * SONDE_PI;
  while (angle < l.septum_rad[0]) angle += round;
  while (angle >= l.septum_rad[0] + round) angle -= round;
  if (angle < l.septum_rad[1]) return SONDE_COMPARTMENT_ANTERIOR;
  return angle < l.septum_rad[2] ? SONDE_COMPARTMENT_POSTERIOR : SONDE_COMPARTMENT_MEDIAL;
}

sonde_vec3 sonde_anatomy_fibre(const sonde_thigh_anatomy *anatomy, sonde_vec3 rest_m) {
  sonde_muscle_level l = level_at(anatomy, rest_m.z);
  double angle = anatomy->pennation_rad[sonde_anatomy_compartment(anatomy, rest_m)];
  sonde_vec3 in = v_unit(vec3(l.bone_x_m - rest_m.x, l.bone_y_m - rest_m.y, 0), vec3(1, 0, 0));
  return vec3(sin(angle) * in.x, sin(angle) * in.y, cos(angle));
}

double sonde_anatomy_fascia(const sonde_thigh_anatomy *anatomy, sonde_vec3 rest_m) {
  sonde_muscle_level l = level_at(anatomy, rest_m.z);
  sonde_vec3 out = v_unit(vec3(rest_m.x - l.bone_x_m, rest_m.y - l.bone_y_m, 0), vec3(1, 0, 0));
  double lateral = 0.5 - 0.5 * out.x;
  return anatomy->fascia_medial_m +
         lateral * (anatomy->fascia_lateral_m - anatomy->fascia_medial_m);
}

const sonde_landmark *sonde_anatomy_landmark(const sonde_thigh_anatomy *anatomy, const char *name) {
  SONDE_ASSERT(anatomy && name);
  for (uint32_t k = 0; k < anatomy->landmark_count; ++k)
    if (strcmp(anatomy->landmark[k].name, name) == 0) return &anatomy->landmark[k];
  return NULL;
}

const sonde_branch *sonde_anatomy_branch(const sonde_thigh_anatomy *anatomy, const char *name) {
  SONDE_ASSERT(anatomy && name);
  for (uint32_t k = 0; k < anatomy->branch_count; ++k)
    if (strcmp(anatomy->branch[k].name, name) == 0) return &anatomy->branch[k];
  return NULL;
}
