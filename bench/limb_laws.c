// Views of a limb from the labels of image planes: what is where in a picture 50 mm wide and 102 mm
// deep, against the views' landmarks.
#include "limb_laws.h"

#include "base/base.h"
#include "base/maths.h"

#include <math.h>
#include <string.h>

static const double PIXEL_M = 0.0006;
enum { WIDE = 84, DEEP = 170 };

typedef struct picture {
  const sonde_limb *limb;
  double medial; // 1: the picture's +x is medial or, from the side, the back
  sonde_pose probe;
  sonde_limb_label at[DEEP][WIDE];
} picture;

// Pixels of one structure: number, middle, least and greatest depth; mm.
typedef struct seen {
  uint32_t pixels;
  double x, z, top, bottom;
} seen;

static double x_of(const picture *p, int column) {
  return p->medial * 1e3 * PIXEL_M * (column - 0.5 * (WIDE - 1));
}
static double z_of(int row) { return 1e3 * PIXEL_M * (row + 0.5); }

static void take(picture *p, sonde_pose probe) {
  p->probe = probe;
  for (int row = 0; row < DEEP; ++row)
    for (int column = 0; column < WIDE; ++column) {
      sonde_vec3 local = vec3(PIXEL_M * (column - 0.5 * (WIDE - 1)), 0, PIXEL_M * (row + 0.5));
      p->at[row][column] = sonde_limb_at(p->limb, pose_apply(probe, local));
    }
}

// The structure of a tissue whose name begins with `name`, within x from `low` to `high`, mm.
static seen find_within(const picture *p, sonde_limb_tissue tissue, const char *name, double low,
                        double high) {
  seen s = {0, 0, 0, INFINITY, -INFINITY};
  size_t length = strlen(name);
  for (int row = 0; row < DEEP; ++row)
    for (int column = 0; column < WIDE; ++column) {
      sonde_limb_label label = p->at[row][column];
      double x = x_of(p, column), z = z_of(row);
      if (label.tissue != tissue || x < low || x > high) continue;
      if (strncmp(sonde_limb_name(p->limb, label), name, length) != 0) continue;
      ++s.pixels, s.x += x, s.z += z;
      s.top = fmin(s.top, z), s.bottom = fmax(s.bottom, z);
    }
  if (s.pixels) s.x /= s.pixels, s.z /= s.pixels;
  return s;
}

static seen find(const picture *p, sonde_limb_tissue tissue, const char *name) {
  return find_within(p, tissue, name, -INFINITY, INFINITY);
}
static seen vessel(const picture *p, const char *name) { return find(p, SONDE_LIMB_LUMEN, name); }
static seen muscle(const picture *p, const char *name) { return find(p, SONDE_LIMB_MUSCLE, name); }

// Depth of the first bone below a depth in the columns beside x; infinite without one.
static double bone_below(const picture *p, double x, double depth) {
  for (int row = 0; row < DEEP; ++row)
    for (int column = 0; column < WIDE; ++column)
      if (z_of(row) > depth && fabs(x_of(p, column) - x) < 4 &&
          p->at[row][column].tissue == SONDE_LIMB_BONE)
        return z_of(row);
  return INFINITY;
}

// Middle of a structure in the limb's frame, m.
static sonde_vec3 middle_of(const picture *p, seen s) {
  return pose_apply(p->probe, vec3(1e-3 * p->medial * s.x, 0, 1e-3 * s.z));
}

// Angle of the way from a to b against the beam, degrees.
static double lean(seen a, seen b) { return atan2(b.x - a.x, b.z - a.z) * 180 / SONDE_PI; }

// ---- conditions of the views: each returns what is missing, NULL when nothing is
// -----------------

#define MUST(condition)                                                                            \
  do                                                                                               \
    if (!(condition)) return #condition;                                                           \
  while (0)

static const char *common_femoral(const picture *p, double *depth) {
  seen vein = vessel(p, "common femoral vein"), artery = vessel(p, "common femoral artery"),
       nerve = find(p, SONDE_LIMB_NERVE, "femoral nerve");
  *depth = vein.pixels ? vein.top : NAN;
  MUST(vein.pixels && artery.pixels && nerve.pixels);
  MUST(vein.x > artery.x + 6);
  MUST(fabs(vein.z - artery.z) <= 4);
  double ratio = sqrt((double)vein.pixels / artery.pixels);
  MUST(ratio > 0.96 && ratio < 1.65); // 1.0 to 1.6 in diameters, counted in pixels
  MUST(nerve.x < artery.x - 4 && nerve.x > artery.x - 22);
  seen iliopsoas = find_within(p, SONDE_LIMB_MUSCLE, "iliopsoas", artery.x - 12, artery.x + 4),
       pectineus = find_within(p, SONDE_LIMB_MUSCLE, "pectineus", vein.x - 5, vein.x + 12);
  MUST(iliopsoas.pixels && iliopsoas.bottom > artery.bottom);
  MUST(pectineus.pixels && pectineus.bottom > vein.bottom);
  double head = bone_below(p, artery.x, artery.bottom) - artery.bottom;
  MUST(head >= 15 && head <= 25);
  MUST(isfinite(bone_below(p, vein.x + 8, vein.top)));
  return NULL;
}

static const char *junction(const picture *p, double *depth) {
  seen vein = vessel(p, "common femoral vein"), artery = vessel(p, "common femoral artery"),
       great = vessel(p, "great saphenous vein");
  *depth = great.pixels ? great.top : NAN;
  MUST(vein.pixels && artery.pixels && great.pixels);
  MUST(artery.x < vein.x);
  MUST(great.z < vein.z && great.z < artery.z);
  MUST(great.x > artery.x && great.x > vein.x - 3);
  return NULL;
}

static const char *arterial_fork(const picture *p, double *depth) {
  seen first = vessel(p, "superficial femoral artery"), deep = vessel(p, "deep femoral artery"),
       vein = vessel(p, "common femoral vein"), sartorius = muscle(p, "sartorius");
  *depth = first.pixels ? first.top : NAN;
  MUST(first.pixels && deep.pixels && vein.pixels);
  MUST(deep.x < first.x && deep.z > first.z);
  MUST(vein.x > first.x && vein.z > first.z);
  MUST(sartorius.pixels && sartorius.x < first.x);
  return NULL;
}

static const char *confluence(const picture *p, double *depth) {
  seen femoral = vessel(p, "femoral vein"), deep = vessel(p, "deep femoral vein"),
       first = vessel(p, "superficial femoral artery"), artery = vessel(p, "deep femoral artery");
  *depth = femoral.pixels ? femoral.top : NAN;
  MUST(femoral.pixels && deep.pixels && first.pixels && artery.pixels);
  MUST(deep.x < femoral.x && deep.z > femoral.z);
  MUST(artery.z > first.z && deep.z > first.z);
  MUST(artery.x < femoral.x && first.x < femoral.x);
  return NULL;
}

static const char *middle(const picture *p, double *depth) {
  seen vein = vessel(p, "femoral vein"), artery = vessel(p, "superficial femoral artery");
  *depth = vein.pixels ? vein.top : NAN;
  MUST(vein.pixels && artery.pixels);
  seen sartorius = find_within(p, SONDE_LIMB_MUSCLE, "sartorius", artery.x - 4, artery.x + 4);
  MUST(sartorius.pixels && sartorius.z < artery.top);
  MUST(artery.z < vein.z);
  seen vastus = muscle(p, "vastus medialis"), longus = muscle(p, "adductor longus"),
       magnus = muscle(p, "adductor magnus");
  MUST(vastus.pixels && vastus.x < artery.x);
  MUST((longus.pixels && longus.x > vastus.x) || (magnus.pixels && magnus.x > vastus.x));
  sonde_vec3 a = middle_of(p, artery), v = middle_of(p, vein);
  double turn = atan2(p->medial * (v.x - a.x), v.y - a.y) * 180 / SONDE_PI;
  MUST(fabs(remainder(turn - 175, 360)) <= 25);
  return NULL;
}

static const char *canal(const picture *p, double *depth) {
  seen vein = vessel(p, "femoral vein"), artery = vessel(p, "superficial femoral artery");
  *depth = vein.pixels ? vein.top : NAN;
  MUST(vein.pixels && artery.pixels);
  sonde_vec3 a = middle_of(p, artery), v = middle_of(p, vein);
  MUST(v.y < a.y && p->medial * v.x < p->medial * a.x);
  seen sartorius = find_within(p, SONDE_LIMB_MUSCLE, "sartorius", artery.x - 12, artery.x + 12);
  MUST(sartorius.pixels && sartorius.top < artery.top);
  seen femur = find(p, SONDE_LIMB_BONE, "femur");
  MUST(femur.pixels);
  double line = femur.top - vein.bottom;
  MUST(line >= 15 && line <= 25);
  return NULL;
}

static const char *popliteal(const picture *p, double *depth) {
  seen vein = vessel(p, "popliteal vein"), artery = vessel(p, "popliteal artery"),
       nerve = find(p, SONDE_LIMB_NERVE, "tibial nerve");
  *depth = vein.pixels ? vein.top : NAN;
  MUST(vein.pixels && artery.pixels && nerve.pixels);
  MUST(nerve.z < vein.z && vein.z < artery.z);
  double line = lean(nerve, artery);
  MUST(fabs(lean(nerve, vein) - line) <= 20 && fabs(lean(vein, artery) - line) <= 20);
  seen inner = muscle(p, "gastrocnemius, medial"), outer = muscle(p, "gastrocnemius, lateral"),
       side = muscle(p, "semimembranosus"), other = muscle(p, "biceps");
  MUST((inner.pixels && inner.x > vein.x) || (side.pixels && side.x > vein.x));
  MUST((outer.pixels && outer.x < vein.x) || (other.pixels && other.x < vein.x));
  double bone = bone_below(p, vein.x, vein.z) - vein.bottom;
  MUST(bone >= 10 && bone <= 25);
  return NULL;
}

static const char *small_saphenous(const picture *p, double *depth) {
  seen small = vessel(p, "small saphenous vein");
  *depth = small.pixels ? small.top : NAN;
  MUST(small.pixels);
  // Under the deep fascia, between the heads.
  double level, angle, f;
  sonde_limb_polar(p->limb, middle_of(p, small), &level, &angle, &f);
  MUST(f < 1 && fabs(remainder(angle - SONDE_PI, 2 * SONDE_PI)) < 15 * SONDE_PI / 180);
  seen inner = muscle(p, "gastrocnemius, medial"), outer = muscle(p, "gastrocnemius, lateral");
  MUST(inner.pixels && inner.x > small.x);
  MUST(outer.pixels && outer.x < small.x);
  return NULL;
}

static const char *trifurcation(const picture *p, double *depth) {
  seen vein = vessel(p, "popliteal vein"), trunk = vessel(p, "tibioperoneal trunk vein"),
       front = vessel(p, "anterior tibial vein");
  seen main = vein.pixels ? vein : trunk;
  *depth = main.pixels ? main.top : NAN;
  MUST(main.pixels && front.pixels);
  MUST(front.z > main.z);
  // Further down the trunk has split into the posterior tibial and the peroneal veins.
  static picture below;
  bool split = false;
  for (double down = 0.01; down < 0.065 && !split; down += 0.01) {
    below = (picture){.limb = p->limb, .medial = p->medial};
    sonde_pose probe = p->probe;
    probe.position.z -= down;
    take(&below, probe);
    split =
        vessel(&below, "posterior tibial vein").pixels && vessel(&below, "peroneal vein").pixels;
  }
  MUST(split);
  return NULL;
}

static const char *calf(const picture *p, double *depth) {
  seen vein = vessel(p, "posterior tibial vein"), second = vessel(p, "second posterior tibial"),
       artery = vessel(p, "posterior tibial artery"), fibular = vessel(p, "peroneal vein"),
       other = vessel(p, "peroneal artery");
  *depth = vein.pixels ? vein.top : NAN;
  MUST(vein.pixels && artery.pixels && fibular.pixels && other.pixels);
  MUST(!second.pixels || (artery.x - vein.x) * (artery.x - second.x) < 0 ||
       (artery.z - vein.z) * (artery.z - second.z) < 0);
  MUST(other.z > artery.z + 6 && fibular.z > vein.z);
  seen tibia = find(p, SONDE_LIMB_BONE, "tibia"), soleus = muscle(p, "soleus");
  MUST(tibia.pixels && tibia.x < vein.x);
  MUST(soleus.pixels && soleus.top < vein.top);
  return NULL;
}

static const char *muscle_veins(const picture *p, double *depth) {
  seen inner = vessel(p, "medial gastrocnemius vein"), outer = vessel(p, "lateral gastrocnemius");
  seen vein = inner.pixels ? inner : outer;
  *depth = vein.pixels ? vein.top : NAN;
  MUST(vein.pixels);
  // In its head: muscle of it on both sides.
  const char *name = inner.pixels ? "gastrocnemius, medial" : "gastrocnemius, lateral";
  seen head = find_within(p, SONDE_LIMB_MUSCLE, name, vein.x - 6, vein.x + 6);
  MUST(head.pixels && head.top < vein.top);
  return NULL;
}

// A view: its station; how far below it the probe may slide and how far it stands to the medial
// side or to the back, mm; the bands of its depth at a body mass index of 20 to 25 and of 30 to 35.
static const struct {
  const char *station;
  const char *(*law)(const picture *p, double *depth);
  double from_mm, to_mm, aside_mm, band[2][2];
} VIEWS[LIMB_VIEWS] = {{"common femoral vein", common_femoral, -8, 8, -6, {{15, 24}, {26, 40}}},
                       {"saphenofemoral junction", junction, -8, 8, 0, {{8, 15}, {19, 31}}},
                       {"saphenofemoral junction", arterial_fork, 5, 20, -18, {{14, 22}, {24, 38}}},
                       {"deep femoral confluence", confluence, 0, 26, 0, {{18, 26}, {28, 42}}},
                       {"femoral vein, middle", middle, -8, 8, 0, {{25, 38}, {40, 60}}},
                       {"adductor canal", canal, -8, 8, -8, {{30, 45}, {45, 70}}},
                       {"popliteal vein", popliteal, -8, 24, 0, {{15, 25}, {23, 40}}},
                       {"small saphenous vein", small_saphenous, -8, 8, 0, {{5, 12}, {8, 20}}},
                       {"trifurcation", trifurcation, -8, 8, 0, {{20, 35}, {28, 50}}},
                       {"posterior tibial veins", calf, -8, 8, -10, {{20, 35}, {20, 43}}},
                       {"gastrocnemius veins", muscle_veins, -8, 8, 0, {{15, 35}, {15, 43}}}};

double limb_vein_depth_mm(double bmi) { return 19 + 1.2 * (bmi - 22.5); }

void limb_muscle_ratio(const sonde_limb *limb, double ratio[2]) {
  enum { SLICES = 120, AROUND = 48, RINGS = 16, MUSCLES = 64 };
  const sonde_limb_body *body = sonde_limb_body_of(limb);
  double count[MUSCLES] = {0}, volume[2] = {0}, rule[2] = {0};
  SONDE_ASSERT(sonde_limb_muscle_count() <= MUSCLES);
  // Cells of equal area of the fascia's section in slices from the upper end to the ankle.
  for (int slice = 0; slice < SLICES; ++slice)
    for (int a = 0; a < AROUND; ++a) {
      double level = -0.2 + 2.2 * (slice + 0.5) / SLICES, angle = 2 * SONDE_PI * (a + 0.5) / AROUND;
      double thick = 2.2 / SLICES * (level < 1 ? body->thigh_length_m : body->calf_length_m);
      double radius = v_distance(sonde_limb_point(limb, level, angle, 1),
                                 sonde_limb_point(limb, level, angle, 0));
      double cell = thick * SONDE_PI * radius * radius / (AROUND * RINGS);
      for (int ring = 0; ring < RINGS; ++ring) {
        sonde_vec3 at = sonde_limb_point(limb, level, angle, sqrt((ring + 0.5) / RINGS));
        sonde_limb_label label = sonde_limb_at(limb, at);
        if (label.tissue == SONDE_LIMB_MUSCLE) count[label.index] += cell;
      }
    }
  for (uint32_t m = 0; m < sonde_limb_muscle_count(); ++m) {
    sonde_limb_muscle muscle = sonde_limb_muscle_at(limb, m);
    if (strstr(muscle.name, "gluteus") || strstr(muscle.name, "iliopsoas")) continue;
    int calf = muscle.largest_level > 1;
    volume[calf] += count[m], rule[calf] += muscle.rule_m3;
  }
  for (int k = 0; k < 2; ++k) ratio[k] = volume[k] / rule[k];
}

void limb_views(const sonde_limb *limb, limb_view view[LIMB_VIEWS]) {
  static const double TILTS[] = {0, -15, 15};
  sonde_limb_station stations[SONDE_LIMB_STATIONS];
  sonde_limb_stations(limb, stations);
  picture p = {.limb = limb};
  double bmi = sonde_limb_body_of(limb)->bmi;
  p.medial = sonde_limb_body_of(limb)->side == SONDE_LIMB_LEFT ? -1 : 1;
  // 0 from a body mass index of 20 to 25, 1 from 30 to 35, linear between; a tenth per unit beyond.
  double heavier = clamp((bmi - 25) / 5, 0, 1) + 0.1 * (fmin(bmi - 20, 0) + fmax(bmi - 35, 0));
  for (uint32_t k = 0; k < LIMB_VIEWS; ++k) {
    const sonde_limb_station *s = stations;
    while (strcmp(s->name, VIEWS[k].station) != 0) ++s;
    view[k] = (limb_view){"no plane", NAN, {0, 0}};
    for (int i = 0; i < 2; ++i)
      view[k].band_mm[i] =
          VIEWS[k].band[0][i] + heavier * (VIEWS[k].band[1][i] - VIEWS[k].band[0][i]);
    // From the middle of the slide outwards, without tilt first.
    double centre = 0.5 * (VIEWS[k].from_mm + VIEWS[k].to_mm);
    double reach = 0.5 * (VIEWS[k].to_mm - VIEWS[k].from_mm);
    for (int way = 0; way < 15 && view[k].missing; ++way) {
      double slide = centre + reach * 0.5 * ((way / 3 + 1) / 2) * (way / 3 % 2 ? 1 : -1);
      double tilt = TILTS[way % 3] * SONDE_PI / 180, depth = NAN;
      sonde_pose probe = s->probe;
      probe.position.z -= 1e-3 * slide;
      probe.position = v_madd(probe.position, 1e-3 * p.medial * VIEWS[k].aside_mm,
                              q_rotate(probe.rotation, vec3(1, 0, 0)));
      probe.rotation = q_mul(probe.rotation, (sonde_quat){cos(0.5 * tilt), sin(0.5 * tilt), 0, 0});
      take(&p, probe);
      const char *missing = VIEWS[k].law(&p, &depth);
      if (way == 0 || !missing) view[k].missing = missing, view[k].depth_mm = depth;
    }
  }
}
