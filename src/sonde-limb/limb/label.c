// Labels, distances and fibres at points; the mirror of a left limb.
#include "limb/bones.h"
#include "limb/label.h"
#include "limb/muscles.h"
#include "limb/vessels.h"

#include <string.h>

static const double FASCIA_M = 0.0008, SUPERFICIAL_M = 0.0003, SEPTUM_M = 0.0009;
static const double MUSCLE_GAP_M = 0.0005; // loose tissue between neighbouring muscles

static const char *const TISSUES[] = {"outside",     "skin",       "fat",    "superficial fascia",
                                      "deep fascia", "septum",     "muscle", "tendon",
                                      "sheath",      "lymph node", "nerve",  "vessel wall",
                                      "lumen",       "bone"};
_Static_assert(SONDE_COUNT_OF(TISSUES) == SONDE_LIMB_TISSUES, "a name for each tissue");
static const char *const BONES[] = {"pelvis", "femur", "patella", "tibia", "fibula"};
_Static_assert(SONDE_COUNT_OF(BONES) == SONDE_LIMB_BONES, "a name for each bone");

// Septa, by the pair of compartments that they divide; the last one is the membrane under
// sartorius.
static const struct septum {
  limb_compartment a, b;
  const char *name;
} SEPTA[] = {{LIMB_ANTERIOR, LIMB_POSTERIOR, "lateral intermuscular septum"},
             {LIMB_ANTERIOR, LIMB_MEDIAL, "medial intermuscular septum"},
             {LIMB_MEDIAL, LIMB_POSTERIOR, "posterior intermuscular septum"},
             {LIMB_LEG_ANTERIOR, LIMB_LEG_LATERAL, "anterior peroneal septum"},
             {LIMB_LEG_LATERAL, LIMB_LEG_SUPERFICIAL, "posterior peroneal septum"},
             {LIMB_LEG_LATERAL, LIMB_LEG_DEEP, "posterior peroneal septum"},
             {LIMB_LEG_SUPERFICIAL, LIMB_LEG_DEEP, "transverse intermuscular septum"},
             {LIMB_LEG_ANTERIOR, LIMB_LEG_DEEP, "interosseous membrane"},
             {LIMB_FILLING, LIMB_FILLING, "vastoadductor membrane"}};

sonde_limb_label sonde_limb_at(const sonde_limb *limb, sonde_vec3 point) {
  SONDE_ASSERT(limb && limb->muscles);
  sonde_vec3 p = limb_side_point(limb, point);
  sonde_limb_label label = {SONDE_LIMB_OUTSIDE, 0, limb->body.side};
  double level = limb_level(limb, p.z);
  if (!(level >= LIMB_TOP && level <= 2)) return label;
  sonde_vec3 c = limb_centre(limb, level);
  double x = p.x - c.x, y = p.y - c.y, r = sqrt(x * x + y * y);
  if (r > 0.35) return label;
  double angle = atan2(x, y), fascia = limb_fascia_radius(limb, level, angle);
  double fat = r > fascia ? limb_fat(limb, level, angle) : 0;
  if (r > fascia + fat + limb->body.skin_m) return label;
  if (r > fascia + fat) {
    label.tissue = SONDE_LIMB_SKIN;
    return label;
  }
  // Bones, then what the vessels say.
  const double xyz[3] = {p.x, p.y, p.z};
  int bone = 0;
  if (r < fascia && limb_bone_distance(limb, xyz, &bone) < 0) {
    label.tissue = SONDE_LIMB_BONE, label.index = (uint32_t)bone;
    return label;
  }
  if (limb->vessels && !limb_vessels_clear(limb->vessels, xyz)) {
    static const sonde_limb_tissue PARTS[] = {SONDE_LIMB_OUTSIDE, SONDE_LIMB_LUMEN,
                                              SONDE_LIMB_WALL,    SONDE_LIMB_NERVE,
                                              SONDE_LIMB_NODE,    SONDE_LIMB_SHEATH};
    limb_vessel_hit hit = limb_vessels_at(limb->vessels, xyz);
    if (hit.part != LIMB_PART_NONE) {
      label.tissue = PARTS[hit.part], label.index = hit.index;
      return label;
    }
  }
  if (r > fascia) {
    double deep = limb_deep_fat(limb, level, angle);
    label.tissue = fabs(r - fascia - deep) < SUPERFICIAL_M / 2 ? SONDE_LIMB_SUPERFICIAL_FASCIA
                                                               : SONDE_LIMB_FAT;
    return label;
  }
  // Within the fascia: tendons, cells, their boundaries.
  int tendon = limb_tendon_at(limb, level, x, y);
  if (tendon >= 0) {
    label.tissue = SONDE_LIMB_TENDON, label.index = (uint32_t)tendon;
    return label;
  }
  if (r > fascia - FASCIA_M) {
    label.tissue = SONDE_LIMB_FASCIA;
    return label;
  }
  limb_cell cell = limb_cell_at(limb, level, x, y);
  int septum = -1;
  if (cell.boundary_m < SEPTUM_M / 2) {
    const uint32_t sartorius = 0;
    int a = (int)limb_cell_compartment(cell.cell), b = (int)limb_cell_compartment(cell.second);
    for (size_t k = 0; k + 1 < SONDE_COUNT_OF(SEPTA) && a != b; ++k)
      if ((int)SEPTA[k].a == (a < b ? a : b) && (int)SEPTA[k].b == (a < b ? b : a)) septum = (int)k;
    if ((cell.cell == sartorius || cell.second == sartorius) && level > 0.51 && level < 0.72)
      septum = (int)SONDE_COUNT_OF(SEPTA) - 1;
  }
  if (septum >= 0)
    label.tissue = SONDE_LIMB_SEPTUM, label.index = (uint32_t)septum;
  else if (cell.cell >= SONDE_LIMB_MUSCLES || cell.boundary_m < MUSCLE_GAP_M / 2)
    label.tissue = SONDE_LIMB_FAT, label.index = 1;
  else
    label.tissue = SONDE_LIMB_MUSCLE, label.index = cell.cell;
  return label;
}

const char *sonde_limb_tissue_name(sonde_limb_tissue tissue) {
  SONDE_ASSERT((unsigned)tissue < SONDE_LIMB_TISSUES);
  return TISSUES[tissue];
}

const char *sonde_limb_name(const sonde_limb *limb, sonde_limb_label label) {
  SONDE_ASSERT(limb && (unsigned)label.tissue < SONDE_LIMB_TISSUES);
  static const limb_part PARTS[SONDE_LIMB_TISSUES] = {[SONDE_LIMB_SHEATH] = LIMB_PART_SHEATH,
                                                      [SONDE_LIMB_NODE] = LIMB_PART_NODE,
                                                      [SONDE_LIMB_NERVE] = LIMB_PART_NERVE,
                                                      [SONDE_LIMB_WALL] = LIMB_PART_WALL,
                                                      [SONDE_LIMB_LUMEN] = LIMB_PART_LUMEN};
  const char *name = NULL;
  if (label.tissue == SONDE_LIMB_MUSCLE && label.index < SONDE_LIMB_MUSCLES)
    name = limb_muscle_table[label.index].name;
  else if (label.tissue == SONDE_LIMB_BONE && label.index < SONDE_LIMB_BONES)
    name = BONES[label.index];
  else if (label.tissue == SONDE_LIMB_TENDON && label.index < limb_tendon_count())
    name = limb_tendon_name((int)label.index);
  else if (label.tissue == SONDE_LIMB_SEPTUM && label.index < SONDE_COUNT_OF(SEPTA))
    name = SEPTA[label.index].name;
  else if (PARTS[label.tissue] && limb->vessels)
    name = limb_vessels_name(limb->vessels, PARTS[label.tissue], label.index);
  return name && *name ? name : TISSUES[label.tissue];
}

limb_layers limb_layers_at(const sonde_limb *limb, sonde_vec3 p) {
  const double top = limb_z(limb, LIMB_TOP), foot = limb_z(limb, 2);
  double level = clamp(limb_level(limb, p.z), LIMB_TOP, 2);
  sonde_vec3 c = limb_centre(limb, level);
  double x = p.x - c.x, y = p.y - c.y, r = sqrt(x * x + y * y), a = atan2(x, y);
  // The distance along the ray over the slope of the surface around and along the limb is the one
  // along the normal.
  const double turn = 0.02, rise = 0.006;
  const limb_radii at = limb_radii_at(limb, level, a, rise, turn);
  double around = (at.on - at.back) / (2 * turn * at.skin);
  sonde_vec3 up = limb_centre(limb, level - rise), down = limb_centre(limb, level + rise);
  double along =
      (at.up - at.down + (up.x - down.x) * sin(a) + (up.y - down.y) * cos(a)) / (up.z - down.z);
  double slope = sqrt(1 + around * around + along * along), beyond = most_of(p.z - top, foot - p.z);
  double deep = at.fascia + limb_deep_share(at.fat);
  return (limb_layers){most_of((r - at.skin) / slope, beyond), most_of((r - deep) / slope, beyond),
                       most_of((r - at.fascia) / slope, beyond)};
}

sonde_limb_distances sonde_limb_distance(const sonde_limb *limb, sonde_vec3 point) {
  SONDE_ASSERT(limb && limb->bones);
  sonde_vec3 p = limb_side_point(limb, point);
  const double xyz[3] = {p.x, p.y, p.z};
  limb_layers layers = limb_layers_at(limb, p);
  return (sonde_limb_distances){layers.skin, layers.fascia, limb_bone_distance(limb, xyz, NULL),
                                limb->vessels ? limb_vessels_at(limb->vessels, xyz).distance_m
                                              : INFINITY};
}

bool sonde_limb_fibre(const sonde_limb *limb, sonde_vec3 point, sonde_vec3 *direction) {
  SONDE_ASSERT(limb && direction);
  if (sonde_limb_at(limb, point).tissue != SONDE_LIMB_MUSCLE) return false;
  sonde_vec3 p = limb_side_point(limb, point);
  double level = limb_level(limb, p.z);
  sonde_vec3 c = limb_centre(limb, level);
  limb_cell cell = limb_cell_at(limb, level, p.x - c.x, p.y - c.y);
  *direction = limb_side_point(limb, limb_fibre(limb, &cell, p));
  return true;
}

sonde_vec3 sonde_limb_point(const sonde_limb *limb, double level, double angle, double f) {
  double xyz[3];
  limb_point(limb, level, angle, f, xyz);
  return limb_side_point(limb, vec3(xyz[0], xyz[1], xyz[2]));
}

void sonde_limb_polar(const sonde_limb *limb, sonde_vec3 point, double *level, double *angle,
                      double *f) {
  sonde_vec3 p = limb_side_point(limb, point);
  const double xyz[3] = {p.x, p.y, p.z};
  limb_polar(limb, xyz, level, angle, f);
}
