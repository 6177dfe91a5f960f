// Stations of an examination on a limb's vessels, protocols (docs/limb_vessels.md).
#include "limb/vessels_graph.h"

enum {
  ST_ILIAC,
  ST_COMMON,
  ST_JUNCTION,
  ST_DEEP,
  ST_FEMORAL,
  ST_MIDDLE,
  ST_DISTAL,
  ST_CANAL,
  ST_POPLITEAL,
  ST_TRIFURCATION,
  ST_TIBIAL,
  ST_PERONEAL,
  ST_GASTROCNEMIUS,
  ST_GREAT,
  ST_SMALL,
  ST_ROWS
};
_Static_assert((int)ST_ROWS == (int)SONDE_LIMB_STATIONS, "a row for each station");

// Level of a station: a number, or 10 and more for what the limb's draws say.
enum { AT_LIGAMENT = 10, AT_BETWEEN, AT_JUNCTION, AT_CONFLUENCE, AT_TRIFURCATION };

typedef struct station_row {
  const char *name, *view, *text;
  sonde_limb_position position;
  double level, shift; // shift: m distally from a drawn place
  double toward;       // side from which the probe comes, degrees; NaN: over the vein
  const char *vein[SONDE_LIMB_STATION_VEINS];
} station_row;

static const station_row STATIONS[] = {
    {"external iliac end",
     "V1",
     "At the inguinal ligament the vein dives backward, medial of the external iliac artery; the "
     "femoral head is behind.",
     SONDE_LIMB_SUPINE_TURNED,
     AT_LIGAMENT,
     -0.012,
     8,
     {"external iliac vein"}},
    {"common femoral vein",
     "V1",
     "Below the ligament the common femoral vein lies medial of its artery at the same depth, "
     "pectineus behind it, the femoral head behind the artery.",
     SONDE_LIMB_SUPINE_TURNED,
     AT_BETWEEN,
     0,
     8,
     {"common femoral vein"}},
    {"saphenofemoral junction",
     "V2",
     "Common femoral vein, common femoral artery lateral of it and the great saphenous vein medial "
     "in front are in one plane.",
     SONDE_LIMB_SUPINE_TURNED,
     AT_JUNCTION,
     0,
     8,
     {"common femoral vein", "great saphenous vein"}},
    {"deep femoral confluence",
     "V4",
     "Below the fork of the artery the deep femoral vein joins the femoral vein from deep and "
     "lateral, between the two arteries.",
     SONDE_LIMB_SUPINE_TURNED,
     AT_CONFLUENCE,
     0.006,
     8,
     {"femoral vein", "deep femoral vein"}},
    {"femoral vein, proximal",
     "V5",
     "The femoral vein lies medial and behind the superficial femoral artery; sartorius comes over "
     "both from the lateral side.",
     SONDE_LIMB_SUPINE_TURNED,
     0.22,
     0,
     NAN,
     {"femoral vein", "second femoral vein", "third femoral vein"}},
    {"femoral vein, middle",
     "V5",
     "At mid-thigh sartorius covers the superficial femoral artery, and the femoral vein is "
     "straight behind the artery.",
     SONDE_LIMB_SUPINE_TURNED,
     0.45,
     0,
     NAN,
     {"femoral vein", "second femoral vein", "third femoral vein"}},
    {"femoral vein, distal",
     "V6",
     "Under sartorius and the vastoadductor membrane the vein lies behind the artery on its "
     "lateral side; vastus medialis is in front.",
     SONDE_LIMB_SUPINE_TURNED,
     0.58,
     0,
     72,
     {"femoral vein", "second femoral vein", "third femoral vein"}},
    {"adductor canal",
     "V6",
     "Vein and artery go deep towards the femur and leave through the hiatus; a hand behind the "
     "thigh helps the compression.",
     SONDE_LIMB_SUPINE_TURNED,
     0.62,
     0,
     80,
     {"femoral vein"}},
    {"popliteal vein",
     "V7",
     "Behind the knee the vein lies over the artery, the tibial nerve over the vein, a head of "
     "gastrocnemius on either side.",
     SONDE_LIMB_PRONE_BENT,
     0.965,
     0,
     180,
     {"popliteal vein", "second popliteal vein"}},
    {"trifurcation",
     "V9",
     "Below the joint line the popliteal vein takes the anterior tibial veins from the depth and "
     "then the tibioperoneal trunk.",
     SONDE_LIMB_PRONE_BENT,
     AT_TRIFURCATION,
     -0.004,
     170,
     {"popliteal vein", "tibioperoneal trunk vein", "second popliteal vein"}},
    {"posterior tibial veins",
     "V10",
     "From the medial side of the calf two veins lie beside the posterior tibial artery, behind "
     "the tibia under soleus.",
     SONDE_LIMB_SITTING,
     1.5,
     0,
     100,
     {"posterior tibial vein", "second posterior tibial vein"}},
    {"peroneal veins",
     "V10",
     "Deeper in the same view two veins lie beside the peroneal artery, close to the fibula.",
     SONDE_LIMB_SITTING,
     1.55,
     0,
     140,
     {"peroneal vein", "second peroneal vein"}},
    {"gastrocnemius veins",
     "V11",
     "Inside the heads of gastrocnemius run veins that join the popliteal vein at the joint line.",
     SONDE_LIMB_SITTING,
     1.16,
     0,
     NAN,
     {"medial gastrocnemius vein", "lateral gastrocnemius vein",
      "second medial gastrocnemius vein"}},
    {"great saphenous vein",
     "V2",
     "In the eye between the deep fascia and the saphenous fascia, medial at mid-thigh.",
     SONDE_LIMB_SUPINE_TURNED,
     0.5,
     0,
     NAN,
     {"great saphenous vein", "second great saphenous vein"}},
    {"small saphenous vein",
     "V8",
     "In the middle of the calf under the fascia, between the heads of gastrocnemius, up to its "
     "end in the popliteal vein.",
     SONDE_LIMB_PRONE_BENT,
     1.12,
     0,
     180,
     {"small saphenous vein"}}};

void sonde_limb_force_band(double depth_m, double force_n[2]) {
  SONDE_ASSERT(depth_m > 0 && force_n);
  static const double row[][3] = {{0.005, 1.5, 3}, {0.010, 2.2, 4.4}, {0.015, 3, 6},
                                  {0.020, 4.5, 8}, {0.025, 6, 11},    {0.030, 7.5, 15},
                                  {0.040, 12, 24}, {0.060, 24, 48}};
  uint32_t k = 0;
  while (k + 2 < SONDE_COUNT_OF(row) && row[k + 1][0] < depth_m) ++k;
  double t = clamp((depth_m - row[k][0]) / (row[k + 1][0] - row[k][0]), 0, 1);
  for (int i = 0; i < 2; ++i) force_n[i] = row[k][1 + i] + t * (row[k + 1][1 + i] - row[k][1 + i]);
}

// Skin over a point, in a direction of the section: place and unit outward normal.
static sonde_vec3 skin_over(const sonde_limb *limb, double level, double angle,
                            sonde_vec3 *normal) {
  const double da = 0.02, dl = 0.01;
  sonde_vec3 p[5];
  for (int k = 0; k < 5; ++k) {
    double l = level + (k == 1   ? dl
                        : k == 2 ? -dl
                                 : 0),
           a = angle + (k == 3   ? da
                        : k == 4 ? -da
                                 : 0);
    double radius = limb_skin_radius(limb, l, a);
    p[k] = v_madd(limb_centre(limb, l), radius, vec3(sin(a), cos(a), 0));
  }
  *normal = v_unit(v_cross(v_sub(p[1], p[2]), v_sub(p[3], p[4])), vec3(sin(angle), cos(angle), 0));
  if (v_dot(*normal, vec3(sin(angle), cos(angle), 0)) < 0) *normal = v_neg(*normal);
  return p[0];
}

// The place on the skin from which a probe looks along its normal through the target.
static void aim(const sonde_limb *limb, double level, double toward, sonde_limb_station *s) {
  sonde_vec3 c = limb_centre(limb, level);
  double angle = isnan(toward) ? atan2(s->target_m.x - c.x, s->target_m.y - c.y) : toward * DEGREE;
  if (isnan(toward)) {
    // The nearest skin of the section.
    double least = INFINITY, best = angle;
    for (int k = -40; k <= 40; ++k) {
      double a = angle + 0.02 * k,
             far = v_distance(skin_over(limb, level, a, &s->normal), s->target_m);
      if (far < least) least = far, best = a;
    }
    angle = best;
  } else {
    // Slide along the skin until the ray through the target has the direction asked for.
    sonde_vec3 from = vec3(s->target_m.x, s->target_m.y, 0), out = vec3(sin(angle), cos(angle), 0);
    double reach = 0;
    for (int k = 0; k < 60; ++k) {
      sonde_vec3 at = v_madd(from, reach, out);
      double a = atan2(at.x - c.x, at.y - c.y), radius = limb_skin_radius(limb, level, a);
      reach += radius - hypot(at.x - c.x, at.y - c.y);
      angle = a;
    }
  }
  s->skin_m = skin_over(limb, level, angle, &s->normal);
}

void sonde_limb_stations(const sonde_limb *limb, sonde_limb_station stations[SONDE_LIMB_STATIONS]) {
  SONDE_ASSERT(limb && limb->vessels && stations);
  const struct limb_vessels *v = limb->vessels;
  const vessel_draws *d = &v->draws;
  const double place_z[] = {d->ligament_z, 0.5 * (d->ligament_z + d->junction_z),
                            d->junction_z - 0.004, d->confluence_z,
                            limb_z(limb, fmin(1.13, d->trunk_end - 0.004))};
  double side = limb->body.side == SONDE_LIMB_LEFT ? -1 : 1;
  for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k) {
    const station_row *row = &STATIONS[k];
    sonde_limb_station *s = &stations[k];
    *s = (sonde_limb_station){
        .name = row->name,
        .text = row->text,
        .view = row->view,
        .position = row->position,
        .level = row->level < 2
                     ? row->level
                     : limb_level(limb, place_z[(int)row->level - AT_LIGAMENT] - row->shift)};
    uint32_t at[SONDE_LIMB_STATION_VEINS];
    for (uint32_t i = 0; i < SONDE_LIMB_STATION_VEINS && row->vein[i]; ++i) {
      uint32_t b = limb_branch_find(v, row->vein[i]);
      if (b == VESSEL_NONE) continue;
      uint32_t place = limb_branch_at_level(v, b, s->level);
      double off = fabs(limb_branch_point(v, b, place).z - limb_z(limb, s->level));
      if (s->veins > 0 && off > 0.012) continue; // a second vein that is not here
      at[s->veins] = place;
      s->vein[s->veins] = b;
      s->arc_m[s->veins++] = limb_branch_places(v, b)[place].arc;
    }
    SONDE_ASSERT(s->veins > 0);
    s->target_m = limb_branch_point(v, s->vein[0], at[0]);
    s->level = limb_level(limb, s->target_m.z);
    aim(limb, s->level, row->toward, s);
    double radius = limb_branch_places(v, s->vein[0])[at[0]].radius;
    s->depth_m = fmax(v_distance(s->skin_m, s->target_m) - radius, 0.001);
    sonde_limb_force_band(s->depth_m, s->force_n);
    // To the limb's own side; +x to the patient's left, on the medial and lateral side to the back.
    s->target_m.x *= side, s->skin_m.x *= side, s->normal.x *= side;
    // The beam goes from the side asked for, or along the normal.
    sonde_vec3 down = v_neg(s->normal), wanted = vec3(1, -0.6, 0);
    if (!isnan(row->toward))
      down = vec3(-side * sin(row->toward * DEGREE), -cos(row->toward * DEGREE), 0);
    sonde_vec3 across = v_unit(v_cross(vec3(0, 0, 1), down), vec3(1, 0, 0));
    if (v_dot(across, wanted) < 0) across = v_neg(across);
    s->probe.position = s->skin_m;
    s->probe.rotation = q_from_matrix(m_columns(across, v_cross(down, across), down));
  }
}

const sonde_limb_protocol *sonde_limb_protocols(uint32_t *count) {
  SONDE_ASSERT(count);
  static const sonde_limb_protocol PROTOCOLS[] = {
      {"2-region",
       "groin from above the saphenofemoral junction to the deep femoral confluence; popliteal "
       "vein to the trifurcation",
       5,
       {ST_COMMON, ST_JUNCTION, ST_DEEP, ST_POPLITEAL, ST_TRIFURCATION},
       0},
      {"3-region",
       "the two regions and the femoral vein at mid-thigh",
       6,
       {ST_COMMON, ST_JUNCTION, ST_DEEP, ST_MIDDLE, ST_POPLITEAL, ST_TRIFURCATION},
       0},
      {"extended",
       "every 2 cm from the inguinal ligament to the trifurcation",
       9,
       {ST_COMMON, ST_JUNCTION, ST_DEEP, ST_FEMORAL, ST_MIDDLE, ST_DISTAL, ST_CANAL, ST_POPLITEAL,
        ST_TRIFURCATION},
       0.02},
      {"whole leg",
       "every 2 cm from the inguinal ligament to the ankle, calf and superficial veins too",
       15,
       {ST_ILIAC, ST_COMMON, ST_JUNCTION, ST_DEEP, ST_FEMORAL, ST_MIDDLE, ST_DISTAL, ST_CANAL,
        ST_POPLITEAL, ST_TRIFURCATION, ST_TIBIAL, ST_PERONEAL, ST_GASTROCNEMIUS, ST_GREAT,
        ST_SMALL},
       0.02}};
  *count = (uint32_t)SONDE_COUNT_OF(PROTOCOLS);
  return PROTOCOLS;
}
