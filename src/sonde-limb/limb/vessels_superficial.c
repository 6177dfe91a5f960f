// Saphenous veins with their tributaries, veins inside muscles, perforators (docs/limb_vessels.md).
#include "limb/vessels_graph.h"

#include <string.h>

static const double SKIN_SIDE_WALL = 0.0005;

typedef struct mark {
  double level, degrees, depth; // below the deep fascia; negative: outside of it
} mark;

// In the middle of the saphenous compartment; in the outer layer of the fat.
static sonde_vec3 in_eye(const sonde_limb *limb, double level, double degrees, double radius) {
  double deep = limb_deep_fat(limb, level, degrees * DEGREE);
  return limb_below_fascia(limb, level, degrees,
                           -fmax(0.5 * deep, radius + SKIN_SIDE_WALL + 0.0004));
}

static sonde_vec3 in_outer_fat(const sonde_limb *limb, double level, double degrees) {
  double deep = limb_deep_fat(limb, level, degrees * DEGREE),
         fat = limb_fat(limb, level, degrees * DEGREE);
  return limb_below_fascia(limb, level, degrees, -0.5 * (deep + fat));
}

static vessel_spec superficial(const char *name, double from, double to, uint32_t parent,
                               vessel_layer layer) {
  return (vessel_spec){name,        SONDE_LIMB_SUPERFICIAL_VEIN,
                       from,        to,
                       parent,      VESSEL_NONE,
                       VESSEL_NONE, SKIN_SIDE_WALL,
                       layer,       layer == LAYER_EYE ? 0.055 : 0};
}

static uint32_t add_through(struct limb_vessels *v, const vessel_spec *spec, const sonde_vec3 *knot,
                            uint32_t count) {
  vessel_line line;
  limb_line_through(knot, count, &line);
  return limb_branch_add(v, spec, &line, 0, line.count - 1);
}

// Angle of the great saphenous vein by level, degrees.
static double saphenous_angle(double level, double aside) {
  static const double at[][2] = {{0, 40},    {0.1, 45},  {0.3, 57},   {0.5, 70},
                                 {0.7, 86},  {0.9, 104}, {1.02, 104}, {1.1, 92},
                                 {1.25, 76}, {1.5, 66},  {1.75, 58},  {1.99, 46}};
  uint32_t k = 0;
  while (k + 2 < SONDE_COUNT_OF(at) && at[k + 1][0] < level) ++k;
  double u = clamp((level - at[k][0]) / (at[k + 1][0] - at[k][0]), 0, 1);
  return at[k][1] + u * (at[k + 1][1] - at[k][1]) +
         aside * clamp(4 * level, 0, 1) * clamp(4 * (1.1 - level), 0, 1);
}

// A second trunk from `from` to `to` beside the great saphenous vein.
static void lay_second_trunk(struct limb_vessels *v, const char *name, uint32_t main, double from,
                             double to, double apart, vessel_layer layer) {
  sonde_vec3 knot[48];
  double radius = 0.8 * v->draws.radius[DIA_GSV];
  uint32_t n = 0, a = limb_branch_at_level(v, main, from), e = limb_branch_at_level(v, main, to);
  knot[n++] = limb_branch_point(v, main, a);
  for (double level = from + 0.04; level < to - 0.03 && n + 1 < SONDE_COUNT_OF(knot);
       level += 0.03) {
    // Beside the trunk as it lies there.
    double degrees, at, f, ramp = fmin(1, fmin((level - from), (to - level)) / 0.08);
    limb_place_of(v->limb, limb_branch_point(v, main, limb_branch_at_level(v, main, level)), &at,
                  &degrees, &f);
    degrees += apart * ramp;
    knot[n++] = layer == LAYER_EYE ? in_eye(v->limb, level, degrees, radius)
                                   : in_outer_fat(v->limb, level, degrees);
  }
  knot[n++] = limb_branch_point(v, main, e);
  vessel_spec spec = superficial(name, radius, 0.9 * radius, main, layer);
  spec.joins = main;
  add_through(v, &spec, knot, n);
}

uint32_t limb_vessels_lay_great(struct limb_vessels *v) {
  const sonde_limb *limb = v->limb;
  const vessel_draws *d = &v->draws;
  uint32_t common = limb_branch_find(v, "common femoral vein"), n = 0;
  double junction = limb_level(limb, d->junction_z), radius = d->radius[DIA_GSV];
  double aside = d->variants.great_saphenous == SONDE_LIMB_GSV_LATERAL ? -22 : 2.5 * d->wander[1];
  sonde_vec3 knot[80];
  // The arch: forward and medially out of the common femoral vein, in the plane of the junction
  // until it lies in front of that vein; then through the fascia and down.
  uint32_t at = limb_branch_at_level(v, common, junction);
  sonde_vec3 joint = limb_branch_point(v, common, at);
  double level, degrees, f, rise = d->radius[DIA_CFV] + 1.15 * d->radius[DIA_GSV_ARCH];
  limb_place_of(limb, joint, &level, &degrees, &f);
  knot[n++] = joint;
  knot[n++] = v_madd(joint, rise, vec3(sin(30 * DEGREE), cos(30 * DEGREE), -0.2));
  knot[n++] = in_eye(limb, level + 0.03, degrees + 5, radius);
  double begin = level + 0.07;
  for (double l = begin; l < 1.99 && n < SONDE_COUNT_OF(knot); l += 0.028) {
    double w = clamp((l - begin) / 0.25, 0, 1);
    double towards = saphenous_angle(l, aside), start = degrees + 6;
    knot[n++] = in_eye(limb, l, start + w * (towards - start), radius);
  }
  vessel_spec spec =
      superficial("great saphenous vein", d->radius[DIA_GSV_ARCH], radius, common, LAYER_EYE);
  uint32_t great = add_through(v, &spec, knot, n);
  bool partial = d->variants.great_saphenous == SONDE_LIMB_GSV_PARTIAL;
  for (uint32_t k = 0; k < v->branch[great].count; ++k) {
    vessel_place *place = &v->place[v->branch[great].first + k];
    double z = limb_branch_point(v, great, k).z, l = limb_level(limb, z), down = VESSEL_STEP * k;
    double taper = clamp(1 - down / 0.09, 0, 1), calf = clamp((l - 0.95) / 0.2, 0, 1);
    double own = radius + (d->radius[DIA_GSV_CALF] - radius) * calf;
    place->radius = own + (d->radius[DIA_GSV_ARCH] - radius) * taper;
    if (partial)
      place->radius *= 1 - 0.6 * clamp(20 * (l - 0.25), 0, 1) * clamp(20 * (0.75 - l), 0, 1);
  }
  v->branch[great].valves = 0;
  const double valve[] = {0.004, 0.031, 0.1, 0.17, 0.24, 0.31, 0.38, 0.52, 0.66};
  for (size_t k = 0; k < SONDE_COUNT_OF(valve); ++k) {
    double arc = d->radius[DIA_CFV] + valve[k];
    if (arc < VESSEL_STEP * (v->branch[great].count - 1))
      v->branch[great].valve[v->branch[great].valves++] = arc;
  }
  if (d->variants.great_saphenous == SONDE_LIMB_GSV_DOUBLE)
    lay_second_trunk(v, "second great saphenous vein", great, 0.2, 0.93, -14, LAYER_EYE);
  if (d->variants.great_saphenous == SONDE_LIMB_GSV_LOOP)
    lay_second_trunk(v, "great saphenous loop", great, 0.28, 0.6, -11, LAYER_EYE);
  if (partial) lay_second_trunk(v, "great saphenous tributary", great, 0.22, 0.78, -8, LAYER_OUTER);
  return great;
}

void limb_vessels_lay_tributaries(struct limb_vessels *v, uint32_t great) {
  static const struct {
    const char *name;
    double down; // arc of the joint on the great saphenous vein beyond the fascia, m
    mark end;
    vessel_layer layer;
    double radius;
  } row[] = {{"superficial epigastric vein", 0.004, {-0.13, 28, 0}, LAYER_OUTER, 0.0009},
             {"superficial circumflex iliac vein", 0.017, {-0.10, -28, 0}, LAYER_OUTER, 0.0009},
             {"external pudendal vein", 0.0105, {-0.03, 78, 0}, LAYER_OUTER, 0.0008},
             {"anterior accessory saphenous vein", 0.0235, {0.55, -4, 0}, LAYER_EYE, 0.0013},
             {"posterior accessory saphenous vein", 0.03, {0.42, 102, 0}, LAYER_OUTER, 0.0011}};
  const sonde_limb *limb = v->limb;
  uint32_t first = 0;
  while (first + 12 < v->branch[great].count) {
    double level, degrees, f;
    limb_place_of(limb, limb_branch_point(v, great, first), &level, &degrees, &f);
    if (f > 1) break;
    ++first;
  }
  for (size_t k = 0; k < SONDE_COUNT_OF(row); ++k) {
    sonde_vec3 knot[24];
    uint32_t at = first + (uint32_t)(row[k].down / VESSEL_STEP), n = 0;
    double level, degrees, f, radius = row[k].radius;
    knot[n++] = limb_branch_point(v, great, at);
    limb_place_of(limb, knot[0], &level, &degrees, &f);
    if (degrees > 180) degrees -= 360;
    for (int i = 1; i <= 14; ++i) {
      double s = i / 14.0, turn = 1 - (1 - s) * (1 - s);
      double l = level + s * (row[k].end.level - level),
             a = degrees + turn * (row[k].end.degrees - degrees);
      knot[n++] = row[k].layer == LAYER_EYE ? in_eye(limb, l, a, radius) : in_outer_fat(limb, l, a);
    }
    vessel_spec spec = superficial(row[k].name, radius, 0.7 * radius, great, row[k].layer);
    add_through(v, &spec, knot, n);
  }
  // Behind the tibia's edge, in the outer fat: what most of the calf's perforators join.
  sonde_vec3 knot[32];
  uint32_t n = 0;
  knot[n++] = limb_branch_point(v, great, limb_branch_at_level(v, great, 1.1));
  for (double l = 1.16; l < 1.95; l += 0.05)
    knot[n++] = in_outer_fat(limb, l, saphenous_angle(l, 0) + 26 + 22 * clamp(2 * (l - 1.2), 0, 1));
  vessel_spec spec = superficial("posterior arch vein", 0.0012, 0.001, great, LAYER_OUTER);
  add_through(v, &spec, knot, n);
}

void limb_vessels_lay_small(struct limb_vessels *v, uint32_t great) {
  const sonde_limb *limb = v->limb;
  const vessel_draws *d = &v->draws;
  uint32_t popliteal = limb_branch_find(v, "popliteal vein"), n = 0;
  const sonde_limb_small_saphenous kind = d->variants.small_saphenous;
  double radius = d->radius[DIA_SSV], under = radius + SKIN_SIDE_WALL + 0.0012;
  // The junction: 20 to 50 mm above the crease, which is 15 mm above the joint line.
  double junction = 1 - (0.015 + 0.035 + 0.006 * d->wander[2]) / limb->body.thigh_length_m;
  sonde_vec3 knot[80];
  if (kind != SONDE_LIMB_SSV_THIGH) {
    uint32_t at = limb_branch_at_level(v, popliteal, junction);
    double level, degrees, f;
    limb_place_of(limb, limb_branch_point(v, popliteal, at), &level, &degrees, &f);
    double deep = (1 - f) * limb_fascia_radius(limb, level, degrees * DEGREE);
    knot[n++] = limb_branch_point(v, popliteal, at);
    knot[n++] = limb_below_fascia(limb, level + 0.012, degrees - 4, 0.6 * deep);
    knot[n++] =
        limb_below_fascia(limb, level + 0.045, 0.5 * (degrees + 178), fmax(0.25 * deep, under));
  } else {
    // Up the back of the thigh and round its medial side to the great saphenous vein.
    knot[n++] = limb_branch_point(v, great, limb_branch_at_level(v, great, 0.42));
    const double way[][2] = {{0.47, 80},  {0.53, 98},  {0.6, 120},
                             {0.68, 143}, {0.76, 162}, {0.84, 174}};
    for (size_t k = 0; k < SONDE_COUNT_OF(way); ++k)
      knot[n++] = in_eye(limb, way[k][0], way[k][1], radius);
    knot[n++] = limb_below_fascia(limb, 0.92, 178, under);
  }
  for (double l = kind == SONDE_LIMB_SSV_THIGH ? 0.96 : 1.0; l < 1.98; l += 0.035) {
    double degrees = l < 1.5 ? 181 : 181 + 42 * (l - 1.5) / 0.48;
    knot[n++] = limb_below_fascia(limb, l, degrees, under);
  }
  uint32_t parent = kind == SONDE_LIMB_SSV_THIGH ? great : popliteal;
  vessel_spec spec = superficial("small saphenous vein", radius, 0.7 * radius, parent, LAYER_DEEP);
  spec.valves = 0.045;
  uint32_t small = add_through(v, &spec, knot, n);
  if (kind == SONDE_LIMB_SSV_THIGH) {
    // Its part in the thigh has the compartment's place, the rest that under the fascia.
    v->branch[small].layer = LAYER_ANY;
  }
  if (kind != SONDE_LIMB_SSV_EXTENDED) return;
  knot[0] = limb_branch_point(v, small, limb_branch_at_level(v, small, junction + 0.05));
  n = 1;
  for (double l = junction; l > 0.6; l -= 0.05)
    knot[n++] = limb_below_fascia(limb, l, 179 - 6 * (junction - l), under);
  spec = superficial("cranial extension of the small saphenous vein", 0.6 * radius, 0.4 * radius,
                     small, LAYER_DEEP);
  add_through(v, &spec, knot, n);
}

static vessel_spec in_muscle(const char *name, double radius, uint32_t parent) {
  return (vessel_spec){name,        SONDE_LIMB_MUSCLE_VEIN,
                       radius,      0.6 * radius,
                       parent,      VESSEL_NONE,
                       VESSEL_NONE, 0.0004,
                       LAYER_DEEP,  0.05};
}

void limb_vessels_lay_muscle_veins(struct limb_vessels *v) {
  const sonde_limb *limb = v->limb;
  const vessel_draws *d = &v->draws;
  uint32_t popliteal = limb_branch_find(v, "popliteal vein"),
           small = limb_branch_find(v, "small saphenous vein");
  static const char *const name[2][2] = {
      {"medial gastrocnemius vein", "second medial gastrocnemius vein"},
      {"lateral gastrocnemius vein", "second lateral gastrocnemius vein"}};
  sonde_vec3 knot[8];
  for (uint32_t head = 0; head < 2; ++head)
    for (uint32_t k = 0; k < d->variants.gastrocnemius[head]; ++k) {
      double radius = (k == 0 ? 1 : 0.75) * d->radius[DIA_GASTROCNEMIUS],
             aside = k * (head == 0 ? 14.0 : -14.0);
      double z = -0.010 + 0.04 * limb_draw_uniform(limb->body.seed, 92 + 2 * head + k) + 0.004 * k;
      bool sural = d->variants.common_sural_trunk && head == 1 && k == 0;
      uint32_t parent = sural ? small : popliteal;
      double level = 1 + z / limb->body.calf_length_m, side = head == 0 ? 1 : -1;
      knot[0] = limb_branch_point(v, parent, limb_branch_at_level(v, parent, level));
      knot[1] = limb_at(limb, level + 0.06, 182 - side * 14 - 0.3 * side * aside, 0.58);
      knot[2] = limb_at(limb, level + 0.13, 182 - side * 30 - side * fabs(aside), 0.68);
      knot[3] = limb_at(limb, level + 0.22, head == 0 ? 142 - aside : 222 - aside, 0.72);
      knot[4] = limb_at(limb, level + 0.34, head == 0 ? 138 - aside : 224 - aside, 0.78);
      vessel_spec spec = in_muscle(name[head][k], radius, parent);
      add_through(v, &spec, knot, 5);
    }
  static const struct {
    const char *name, *parent;
    double from;
    mark end;
  } soleal[] = {{"medial soleal vein", "posterior tibial vein", 1.29, {1.55, 118, 0.56}},
                {"central soleal vein", "peroneal vein", 1.3, {1.6, 172, 0.6}},
                {"lateral soleal vein", "peroneal vein", 1.36, {1.58, 212, 0.62}}};
  for (size_t k = 0; k < SONDE_COUNT_OF(soleal); ++k) {
    uint32_t parent = limb_branch_find(v, soleal[k].parent);
    double radius = d->radius[DIA_SOLEAL] * (k == 1 ? 1 : 0.85), level, degrees, f;
    knot[0] = limb_branch_point(v, parent, limb_branch_at_level(v, parent, soleal[k].from));
    limb_place_of(limb, knot[0], &level, &degrees, &f);
    for (int i = 1; i <= 4; ++i) {
      double s = i / 4.0, w = pow(s, 0.6);
      knot[i] = limb_at(limb, level + s * (soleal[k].end.level - level),
                        degrees + w * (soleal[k].end.degrees - degrees),
                        f + w * (soleal[k].end.depth - f));
    }
    vessel_spec spec = in_muscle(soleal[k].name, radius, parent);
    uint32_t b = add_through(v, &spec, knot, 5), count = v->branch[b].count;
    for (uint32_t i = 0; i < count; ++i) // a spindle
      v->place[v->branch[b].first + i].radius =
          radius * (0.35 + 0.65 * sin(SONDE_PI * fmin(1, (i + 0.5) / count)));
  }
}

void limb_vessels_lay_perforators(struct limb_vessels *v) {
  const sonde_limb *limb = v->limb;
  const char *const great = "great saphenous vein", *const arch = "posterior arch vein";
  const char *const tibial = "posterior tibial vein", *const small = "small saphenous vein";
  const struct {
    const char *name, *outer, *inner;
    double level, above_sole; // where it leaves the superficial vein: one of the two
  } row[] = {{"Hunter perforator", great, "femoral vein", 0.55, 0},
             {"Dodd perforator", great, "femoral vein", 0.69, 0},
             {"Boyd perforator", arch, tibial, 1.2, 0},
             {"Cockett perforator 1", arch, tibial, 0, 0.095},
             {"Cockett perforator 2", arch, tibial, 0, 0.135},
             {"Cockett perforator 3", arch, tibial, 0, 0.185},
             {"Cockett perforator 4", arch, tibial, 0, 0.24},
             {"soleal perforator", small, "central soleal vein", 1.5, 0},
             {"peroneal perforator", small, "peroneal vein", 1.72, 0},
             {"Hunter perforator 2", great, "femoral vein", 0.5, 0},
             {"medial gastrocnemius perforator", arch, "medial gastrocnemius vein", 1.27, 0},
             {"medial soleal perforator", arch, "medial soleal vein", 1.45, 0},
             {"peroneal perforator 2", small, "peroneal vein", 1.8, 0},
             {"Hunter perforator 3", great, "femoral vein", 0.45, 0},
             {"lateral soleal perforator", small, "lateral soleal vein", 1.42, 0},
             {"Dodd perforator 2", great, "femoral vein", 0.64, 0},
             {"Cockett perforator 5", arch, tibial, 0, 0.21},
             {"Cockett perforator 6", arch, tibial, 0, 0.16},
             {"peroneal perforator 3", small, "peroneal vein", 1.65, 0},
             {"medial soleal perforator 2", arch, "medial soleal vein", 1.38, 0},
             {"Hunter perforator 4", great, "femoral vein", 0.4, 0}};
  double ankle = limb->body.sex == SONDE_SEX_FEMALE ? 0.063 : 0.073; // above the sole
  for (uint32_t k = 0; k < v->draws.variants.perforators && k < SONDE_COUNT_OF(row); ++k) {
    uint32_t outer = limb_branch_find(v, row[k].outer), inner = limb_branch_find(v, row[k].inner);
    double level = row[k].above_sole > 0
                       ? 2 - (row[k].above_sole - ankle) / limb->body.calf_length_m
                       : row[k].level;
    if (outer == VESSEL_NONE || inner == VESSEL_NONE) continue;
    sonde_vec3 knot[3] = {
        limb_branch_point(v, inner, limb_branch_at_level(v, inner, level - 0.035)), vec3(0, 0, 0),
        limb_branch_point(v, outer, limb_branch_at_level(v, outer, level))};
    // Of a pair it joins the vein that is nearer, so that it does not pass the other and the
    // artery.
    char other[SONDE_LIMB_VESSEL_NAME];
    snprintf(other, sizeof other, "second %s", row[k].inner);
    uint32_t second = limb_branch_find(v, other);
    if (second != VESSEL_NONE && v->branch[second].mate != VESSEL_NONE) {
      sonde_vec3 p = limb_branch_point(v, second, limb_branch_at_level(v, second, level - 0.035));
      if (v_distance(p, knot[2]) < v_distance(knot[0], knot[2])) knot[0] = p, inner = second;
    }
    knot[1] = v_lerp(knot[0], knot[2], 0.5);
    double z = limb_draw_normal(limb->body.seed, 128 + k);
    double radius = 0.5e-3 * clamp(1.3 + 0.56 * z, 0.4, 3.5);
    vessel_spec spec = {row[k].name, SONDE_LIMB_PERFORATOR, radius, radius,    inner,
                        outer,       VESSEL_NONE,           0.0003, LAYER_ANY, 0.02};
    add_through(v, &spec, knot, 3);
  }
}
