// A searcher finds every station from its text: it slides a virtual probe over the skin of a limb
// that lies as the station asks, and reads nothing but the names in the plane of its picture.
#include "limb_test.h"

#include "limb/frame.h"
#include "sonde/limb_pose.h"

enum { WIDE = 56, DEEP = 116, PARTS = 48 };
static const double PIXEL = 0.001;

// What the picture shows of one structure: how much, and the middle; x towards growing angles.
typedef struct part {
  const char *name;
  uint32_t pixels;
  double x, z, top;
} part;

typedef struct hand {
  const sonde_limb *limb;
  const sonde_limb_pose *pose;
  double level, angle; // where on the skin
  sonde_pose probe;
  uint32_t count;
  part seen[PARTS];
  uint8_t pixel[DEEP][WIDE]; // number in seen + 1
} hand;

// ---- hands and eyes -----------------------------------------------------------------------------

static sonde_vec3 skin_at(const hand *h, double level, double angle) {
  double f = limb_skin_radius(h->limb, level, angle) / limb_fascia_radius(h->limb, level, angle);
  return sonde_limb_pose_point(h->pose, sonde_limb_point(h->limb, level, angle, f));
}

// Holds the probe across the limb towards its middle and reads the picture.
static void look(hand *h) {
  const double aside = 0.03;
  h->level = fmin(fmax(h->level, -0.19), 1.98);
  sonde_vec3 skin = skin_at(h, h->level, h->angle);
  sonde_vec3 middle = sonde_limb_pose_point(h->pose, sonde_limb_point(h->limb, h->level, 0, 0));
  sonde_vec3 down = v_unit(v_sub(middle, skin), vec3(0, -1, 0));
  sonde_vec3 across =
      v_sub(skin_at(h, h->level, h->angle + aside), skin_at(h, h->level, h->angle - aside));
  across = v_unit(v_madd(across, -v_dot(across, down), down), vec3(1, 0, 0));
  h->probe = (sonde_pose){skin, q_from_matrix(m_columns(across, v_cross(down, across), down))};
  h->count = 0;
  for (int j = 0; j < DEEP; ++j)
    for (int i = 0; i < WIDE; ++i) {
      double x = (i + 0.5 - WIDE / 2) * PIXEL, z = (j + 0.5) * PIXEL;
      sonde_limb_label at = sonde_limb_pose_at(h->pose, v_madd(v_madd(skin, x, across), z, down));
      h->pixel[j][i] = 0;
      if (at.tissue < SONDE_LIMB_SEPTUM) continue; // a wall has the name of its lumen
      const char *name = sonde_limb_name(h->limb, at);
      uint32_t k = 0;
      while (k < h->count && strcmp(h->seen[k].name, name)) ++k;
      if (k == PARTS) continue;
      part *p = &h->seen[k];
      if (k == h->count) *p = (part){.name = name, .top = z}, ++h->count;
      ++p->pixels, p->x += x, p->z += z;
      h->pixel[j][i] = (uint8_t)(k + 1);
    }
  for (uint32_t k = 0; k < h->count; ++k)
    h->seen[k].x /= h->seen[k].pixels, h->seen[k].z /= h->seen[k].pixels;
}

static const part *see(const hand *h, const char *name) {
  for (uint32_t k = 0; k < h->count; ++k)
    if (!strcmp(h->seen[k].name, name)) return &h->seen[k];
  return NULL;
}

// Both are seen, and their nearest pixels are not further apart.
static bool touch(const hand *h, const char *one, const char *other, double gap_m) {
  const part *a = see(h, one), *b = see(h, other);
  if (!a || !b) return false;
  int far = (int)ceil(gap_m / PIXEL);
  for (int j = 0; j < DEEP; ++j)
    for (int i = 0; i < WIDE; ++i) {
      if (h->pixel[j][i] != a - h->seen + 1) continue;
      for (int v = j - far; v <= j + far; ++v)
        for (int u = i - far; u <= i + far; ++u)
          if (v >= 0 && v < DEEP && u >= 0 && u < WIDE && h->pixel[v][u] == b - h->seen + 1 &&
              hypot(u - i, v - j) * PIXEL <= gap_m + 1e-9)
            return true;
    }
  return false;
}

// Brings the first of the names that is seen to the middle of the picture; looks round for it
// within `reach` degrees of the hand's place.
static const part *centre(hand *h, const char *const *names, double reach) {
  double begin = h->angle;
  const part *found = NULL;
  for (double turn = 0; turn <= reach && !found; turn = turn > 0 ? -turn : 8 - turn) {
    h->angle = begin + turn * DEGREE;
    look(h);
    for (int n = 0; names[n] && !found; ++n) found = see(h, names[n]);
    if (turn < 0 && -turn > reach - 8) break;
  }
  if (!found) {
    h->angle = begin;
    return NULL;
  }
  const char *name = found->name;
  for (int pass = 0; pass < 5 && found && fabs(found->x) > 0.002; ++pass) {
    // What is deep moves less in the picture than the probe does on the skin.
    double radius = limb_skin_radius(h->limb, h->level, h->angle);
    h->angle += 0.8 * found->x / fmax(radius - found->z, 0.3 * radius);
    look(h);
    found = see(h, name);
  }
  return found;
}

typedef bool sight(const hand *h);

// Slides along the limb, the vein in the middle, until the picture shows something; then back and
// forth in small steps to the place where it begins.
static bool slide(hand *h, double to, const char *const *follow, sight *wanted) {
  double length = h->level < 1 ? 0.43 : 0.4;
  double step = (to > h->level ? 1 : -1) * 0.006 / length;
  for (; (to - h->level) * step > 0; h->level += step) {
    centre(h, follow, 16);
    if (!wanted(h)) continue;
    for (int k = 0; k < 4; ++k) {
      hand before = *h;
      h->level -= step / 4;
      centre(h, follow, 8);
      if (!wanted(h)) {
        *h = before;
        break;
      }
    }
    return true;
  }
  return false;
}

// ---- what the texts ask for ---------------------------------------------------------------------

static const char *const GROIN[] = {"common femoral vein", "external iliac vein", NULL};
static const char *const THIGH[] = {"femoral vein", "common femoral vein", "popliteal vein", NULL};
static const char *const KNEE[] = {"popliteal vein", NULL};
static const char *const KNEE_DOWN[] = {"popliteal vein", "tibioperoneal trunk vein", NULL};
static const char *const TIBIAL[] = {"posterior tibial vein", NULL};
static const char *const PERONEAL[] = {"peroneal vein", NULL};
static const char *const HEADS[] = {"medial gastrocnemius vein", "lateral gastrocnemius vein",
                                    "second medial gastrocnemius vein", NULL};
static const char *const GREAT[] = {"great saphenous vein", "second great saphenous vein", NULL};
static const char *const SMALL[] = {"small saphenous vein", NULL};

static bool iliac(const hand *h) {
  return see(h, "external iliac vein") && !see(h, "common femoral vein");
}
static bool junction(const hand *h) {
  return touch(h, "common femoral vein", "great saphenous vein", 0.0015);
}
static bool confluence(const hand *h) {
  return touch(h, "femoral vein", "deep femoral vein", 0.0015) ||
         touch(h, "common femoral vein", "deep femoral vein", 0.0015);
}
static bool membrane(const hand *h) { return see(h, "vastoadductor membrane") != NULL; }
static bool hiatus(const hand *h) { return see(h, "popliteal vein") && !see(h, "femoral vein"); }
static bool trunk(const hand *h) {
  return see(h, "tibioperoneal trunk vein") && see(h, "popliteal vein") == NULL;
}
// Nerve, vein and artery one behind the other, a head of gastrocnemius on either side.
static bool fossa(const hand *h) {
  const part *nerve = see(h, "tibial nerve"), *vein = see(h, "popliteal vein"),
             *artery = see(h, "popliteal artery");
  const part *medial = see(h, "gastrocnemius, medial head"),
             *lateral = see(h, "gastrocnemius, lateral head");
  return nerve && vein && artery && nerve->z < vein->z && vein->z < artery->z && medial &&
         lateral && (medial->x - vein->x) * (lateral->x - vein->x) < 0;
}
static bool within_heads(const hand *h) {
  for (int n = 0; HEADS[n]; ++n)
    for (int side = 0; side < 2; ++side)
      if (touch(h, HEADS[n], side ? "gastrocnemius, medial head" : "gastrocnemius, lateral head",
                0.003))
        return true;
  return false;
}
static bool between_heads(const hand *h) {
  const part *vein = see(h, "small saphenous vein");
  const part *medial = see(h, "gastrocnemius, medial head"),
             *lateral = see(h, "gastrocnemius, lateral head");
  return vein && medial && lateral && (medial->x - vein->x) * (lateral->x - vein->x) < 0;
}
static bool sartorius_over(const hand *h) {
  const part *muscle = see(h, "sartorius"), *artery = see(h, "superficial femoral artery"),
             *vein = see(h, "femoral vein");
  return muscle && artery && vein && muscle->top < artery->z && vein->z > artery->z - 0.002;
}

// Puts the hand where the text says and moves it as the text says. False: not seen.
static bool search(hand *h, uint32_t station, double eye) {
  double groin = 0.02, mm = 1e-3 / 0.43; // a person's leg by eye
  switch (station) {
  case 0: // up from the groin until the vein is the iliac one, and a probe's width further
    h->level = groin, h->angle = 15 * DEGREE;
    if (!centre(h, GROIN, 40) || !slide(h, -0.19, GROIN, iliac)) return false;
    h->level -= 12 * mm;
    return centre(h, GROIN, 16) != NULL && (see(h, "femur") || see(h, "pelvis"));
  case 1: { // between the ligament and the junction
    h->level = groin, h->angle = 15 * DEGREE;
    if (!centre(h, GROIN, 40) || !slide(h, -0.19, GROIN, iliac)) return false;
    double top = h->level;
    if (!slide(h, 0.2, GROIN, junction)) return false;
    h->level = 0.5 * (top + h->level);
    const part *vein = centre(h, GROIN, 16), *artery = see(h, "common femoral artery");
    return vein && artery && artery->x < vein->x;
  }
  case 2: // down from the ligament until the saphenous vein opens into the femoral one
    h->level = -0.08, h->angle = 15 * DEGREE;
    return centre(h, GROIN, 40) && slide(h, 0.2, GROIN, junction);
  case 3: // further down until the deep vein joins
    h->level = -0.02, h->angle = 15 * DEGREE;
    if (!centre(h, GROIN, 40) || !slide(h, 0.3, THIGH, confluence)) return false;
    h->level += 6 * mm;
    return centre(h, THIGH, 16) && see(h, "deep femoral vein");
  case 4: // a hand's breadth below the groin crease
    h->level = 0.22 + eye, h->angle = 35 * DEGREE;
    return centre(h, THIGH, 40) && see(h, "superficial femoral artery") && see(h, "sartorius");
  case 5:
    h->level = 0.44 + eye, h->angle = 60 * DEGREE;
    return centre(h, THIGH, 48) && (sartorius_over(h) || slide(h, 0.52, THIGH, sartorius_over));
  case 6: // from mid-thigh down until the membrane is seen, then two fingers further
    h->level = 0.45, h->angle = 60 * DEGREE;
    if (!centre(h, THIGH, 48) || !slide(h, 0.65, THIGH, membrane)) return false;
    h->level += 30 * mm;
    return centre(h, THIGH, 24) && see(h, "vastus medialis");
  case 7: // down to where the femoral vein goes through the hiatus, and three fingers back
    h->level = 0.55, h->angle = 75 * DEGREE;
    if (!centre(h, THIGH, 48) || !slide(h, 0.85, THIGH, hiatus)) return false;
    h->level -= 45 * mm;
    return centre(h, THIGH, 24) != NULL;
  case 8: // down from above the crease until the heads stand on either side
    h->level = 0.93, h->angle = 180 * DEGREE;
    return centre(h, KNEE, 32) && (fossa(h) || slide(h, 1.04, KNEE, fossa));
  case 9: // down from the fossa until the vein is the trunk
    h->level = 1, h->angle = 180 * DEGREE;
    return centre(h, KNEE, 32) && slide(h, 1.3, KNEE_DOWN, trunk);
  case 10: // half-way down the calf, medial side
    h->level = 1.5 + eye, h->angle = 105 * DEGREE;
    return centre(h, TIBIAL, 32) && see(h, "posterior tibial artery") && see(h, "soleus");
  case 11:
    h->level = 1.55 + eye, h->angle = 140 * DEGREE;
    return centre(h, PERONEAL, 40) && see(h, "peroneal artery") && see(h, "fibula");
  case 12: // down from the joint line until the veins lie within the heads
    h->level = 1.12, h->angle = 160 * DEGREE;
    return centre(h, HEADS, 40) && (within_heads(h) || slide(h, 1.3, HEADS, within_heads)) &&
           centre(h, HEADS, 16);
  case 13: // at mid-thigh; a thin one may show a little higher or lower
    for (int n = 0; n < 9; ++n) {
      h->level = 0.5 + eye + (n % 2 ? 4 : -4) * (n + 1) / 2 * mm, h->angle = 75 * DEGREE;
      if (centre(h, GREAT, 64)) return true;
    }
    return false;
  default: // up the middle of the calf while it lies between the heads
    h->level = 1.12 + eye, h->angle = 180 * DEGREE;
    return centre(h, SMALL, 40) && between_heads(h);
  }
}

// How far along the limb the place may be off: places that the text fixes by a joint of veins to a
// probe's width, those that it names by a region to three fingers.
static const double ALLOWED[SONDE_LIMB_STATIONS] = {12e-3, 10e-3, 10e-3, 15e-3, 45e-3,
                                                    40e-3, 25e-3, 35e-3, 30e-3, 15e-3,
                                                    30e-3, 30e-3, 40e-3, 30e-3, 40e-3};

static void every_station_is_found(void **state) {
  const uint32_t legs = *(const uint32_t *)*state;
  uint32_t missed = 0, random = 77;
  double worst[SONDE_LIMB_STATIONS] = {0};
  for (uint32_t leg = 0; leg < legs; ++leg) {
    sonde_limb *limb = make_limb(2000 + leg, leg % 2 ? SONDE_SEX_MALE : SONDE_SEX_FEMALE,
                                 17 + (leg * 7) % 24, leg % 3 ? SONDE_LIMB_RIGHT : SONDE_LIMB_LEFT);
    sonde_limb_pose *pose[3] = {NULL};
    for (int i = 0; i < 3; ++i) {
      sonde_limb_setting setting = sonde_limb_setting_usual((sonde_limb_position)i);
      sonde_error error = {0};
      if (sonde_limb_pose_create(limb, &setting, &pose[i], &error))
        fail_msg("leg %u: %s", leg, error.message);
    }
    sonde_limb_station station[SONDE_LIMB_STATIONS];
    sonde_limb_stations(limb, station);
    hand *h = SONDE_NEW(hand, 1);
    for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k) {
      *h = (hand){.limb = limb, .pose = pose[station[k].position]};
      // Where a region is by eye: within 15 mm.
      double eye = (2 * next_uniform(&random) - 1) * 0.015 / 0.43;
      bool found = search(h, k, eye), right = false;
      // The judge: is it the station's vein in the middle, and is it the station's place?
      double off = (limb_z(limb, h->level) - limb_z(limb, station[k].level));
      for (uint32_t i = 0; i < station[k].veins; ++i) {
        const part *vein = see(h, sonde_limb_vessel_get(limb, station[k].vein[i]).name);
        right = right || (vein && fabs(vein->x) < 0.015);
      }
      if (found && right) worst[k] = fmax(worst[k], fabs(off));
      if (found && right && fabs(off) <= ALLOWED[k]) continue;
      ++missed;
      print_message("leg %u: %s is missed: %s, %s, %.0f mm off\n", leg, station[k].name,
                    found ? "landmarks seen" : "landmarks not seen",
                    right ? "vein in the middle" : "vein not in the middle", 1e3 * off);
    }
    sonde_free(h);
    for (int i = 0; i < 3; ++i) sonde_limb_pose_destroy(pose[i]);
    sonde_limb_destroy(limb);
  }
  for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k)
    print_message("station %u: at most %.0f mm along the limb\n", k, 1e3 * worst[k]);
  print_message("%u of %u stations missed\n", missed, legs * SONDE_LIMB_STATIONS);
  assert_int_equal(missed, 0);
}

// Row 87 counts 20 legs.
int main(void) {
  uint32_t legs = SAMPLES(20, 3);
  const struct CMUnitTest tests[] = {cmocka_unit_test_prestate(every_station_is_found, &legs)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
