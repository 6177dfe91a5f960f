// Deep fascia, fat and skin: harmonics on cubic splines in level, girths of the body
// (docs/limb_theory.md).
#include "limb/bones.h"
#include "limb/knots.h"

#include <string.h>

// Catmull-Rom weights at a fraction between the second and the third of four values.
static inline void catmull_rom(double u, double w[4]) {
  w[0] = 0.5 * u * (-1 + u * (2 - u));
  w[1] = 0.5 * (2 + u * u * (-5 + 3 * u));
  w[2] = 0.5 * u * (1 + u * (4 - 3 * u));
  w[3] = 0.5 * u * u * (u - 1);
}

typedef struct place {
  uint32_t row[4], column[4];
  double along[4], around[4];
} place;

static inline void place_level(double level, place *p) {
  double r = clamp((level - LIMB_TOP) / LIMB_STEP, 0, LIMB_ROWS - 1);
  uint32_t k = (uint32_t)least_of(r, LIMB_ROWS - 2);
  for (uint32_t i = 0; i < 4; ++i) {
    uint32_t row = k + i > 0 ? k + i - 1 : 0;
    p->row[i] = row < LIMB_ROWS ? row : LIMB_ROWS - 1;
  }
  catmull_rom(r - k, p->along);
}

static inline void place_angle(double angle, place *p) {
  double c = angle * (LIMB_ANGLES / (2 * SONDE_PI));
  c -= LIMB_ANGLES * floor(c / LIMB_ANGLES);
  uint32_t k = (uint32_t)c;
  for (uint32_t i = 0; i < 4; ++i) p->column[i] = (k + i + LIMB_ANGLES - 1) % LIMB_ANGLES;
  catmull_rom(c - k, p->around);
}

static double lookup(const double table[LIMB_ROWS][LIMB_ANGLES], const place *p) {
  double sum = 0;
  for (uint32_t i = 0; i < 4; ++i) {
    const double *row = table[p->row[i]];
    double line = 0;
    for (uint32_t j = 0; j < 4; ++j) line += p->around[j] * row[p->column[j]];
    sum += p->along[i] * line;
  }
  return sum;
}

sonde_vec3 limb_centre(const sonde_limb *limb, double level) {
  const limb_surface *s = &limb->surface;
  place p;
  place_level(level, &p);
  sonde_vec3 c = {0, 0, limb_z(limb, level)};
  for (uint32_t i = 0; i < 4; ++i)
    c.x += p.along[i] * s->x[p.row[i]], c.y += p.along[i] * s->y[p.row[i]];
  return c;
}

double limb_fascia_radius(const sonde_limb *limb, double level, double angle) {
  place p;
  place_level(level, &p);
  place_angle(angle, &p);
  return lookup(limb->surface.fascia, &p);
}

double limb_fat(const sonde_limb *limb, double level, double angle) {
  place p;
  place_level(level, &p);
  place_angle(angle, &p);
  return lookup(limb->surface.fat, &p);
}

double limb_skin_radius(const sonde_limb *limb, double level, double angle) {
  place p;
  place_level(level, &p);
  place_angle(angle, &p);
  return lookup(limb->surface.fascia, &p) + lookup(limb->surface.fat, &p) + limb->body.skin_m;
}

limb_radii limb_radii_at(const sonde_limb *limb, double level, double angle, double rise,
                         double turn) {
  const limb_surface *s = &limb->surface;
  SONDE_ASSERT(rise > 0 && turn > 0);
  place here;
  place_level(level, &here), place_angle(angle, &here);
  place up = here, down = here, left = here, right = here;
  place_level(level - rise, &up), place_level(level + rise, &down);
  place_angle(angle - turn, &left), place_angle(angle + turn, &right);
  const double fascia = lookup(s->fascia, &here), fat = lookup(s->fat, &here);
  const place *const beside[4] = {&up, &down, &left, &right};
  double skin[4];
  for (int k = 0; k < 4; ++k)
    skin[k] = lookup(s->fascia, beside[k]) + lookup(s->fat, beside[k]) + limb->body.skin_m;
  return (limb_radii){fascia,  fat,    fascia + fat + limb->body.skin_m, skin[0], skin[1],
                      skin[2], skin[3]};
}

double limb_deep_fat(const sonde_limb *limb, double level, double angle) {
  return limb_deep_share(limb_fat(limb, level, angle));
}

void limb_point(const sonde_limb *limb, double level, double angle, double f, double xyz[3]) {
  SONDE_ASSERT(isfinite(level) && isfinite(angle) && isfinite(f));
  sonde_vec3 c = limb_centre(limb, level);
  double r = f * limb_fascia_radius(limb, level, angle);
  xyz[0] = c.x + r * sin(angle), xyz[1] = c.y + r * cos(angle), xyz[2] = c.z;
}

void limb_polar(const sonde_limb *limb, const double xyz[3], double *level, double *angle,
                double *f) {
  SONDE_ASSERT(level && angle && f);
  *level = limb_level(limb, xyz[2]);
  sonde_vec3 c = limb_centre(limb, *level);
  double dx = xyz[0] - c.x, dy = xyz[1] - c.y;
  *angle = atan2(dx, dy);
  if (*angle < 0) *angle += 2 * SONDE_PI;
  *f = sqrt(dx * dx + dy * dy) / limb_fascia_radius(limb, *level, *angle);
}

// Skin girth of the measured leg, mm, and the harmonics of the muscles' envelope: amplitude times
// cosine and sine of 2 phase (second), 3 phase (third); phases from the front through medial.
static const double PROFILE[][3] = {
    {-0.2, 690, 0}, {-0.1, 678, 0}, {0.05, 653, 0}, {0.15, 617, 0}, {0.25, 571, 0}, {0.35, 535, 0},
    {0.41, 520, 0}, {0.5, 497, 0},  {0.65, 456, 0}, {0.75, 418, 0}, {0.85, 389, 0}, {0.95, 383, 0},
    {1.05, 366, 0}, {1.15, 366, 0}, {1.25, 376, 0}, {1.35, 375, 0}, {1.5, 335, 0},  {1.65, 272, 0},
    {1.72, 246, 0}, {1.86, 217, 0}, {1.93, 222, 0}, {2, 238, 0}};
// Level, second amplitude and direction (degrees), third amplitude and direction.
static const double HARMONICS[][5] = {
    {-0.2, 0.1, 160, 0.03, 33},    {0, 0.12, 165, 0.045, 33},      {0.12, 0.11, 130, 0.036, 33},
    {0.25, 0.145, 110, 0.034, 35}, {0.35, 0.165, 116, 0.02, 35},   {0.5, 0.165, 125, 0.019, 35},
    {0.65, 0.125, 129, 0.012, 20}, {0.75, 0.09, 131, 0.015, 10},   {0.86, 0.04, 150, 0.025, 0},
    {0.93, 0.06, 175, 0.03, 0},    {1, 0.085, 179, 0.03, 0},       {1.06, 0.09, 180, 0.05, 0},
    {1.15, 0.1, 2, 0.058, 0},      {1.25, 0.062, 161, 0.075, 113}, {1.35, 0.065, 155, 0.07, 116},
    {1.5, 0.079, 146, 0.065, 119}, {1.68, 0.06, 165, 0.05, 118},   {1.85, 0.09, 178, 0.04, 0},
    {2, 0.08, 178, 0.05, 0}};
// Where the section's centre is, as the place (degrees, f) of a bone in it: the hip's centre up to
// level 0, the femoral shaft down to 1, the tibia below.
static const double CENTRES[][3] = {
    {-0.2, 15, 0.14},  {0, 18, 0.105},   {0.15, 272, 0.46}, {0.25, 274, 0.4}, {0.5, 299, 0.2},
    {0.75, 317, 0.21}, {0.9, 345, 0.12}, {0.99, 5, 0.02},   {1.01, 15, 0.05}, {1.12, 22, 0.46},
    {1.25, 24, 0.73},  {1.5, 28, 0.75},  {1.75, 25, 0.52},  {1.9, 30, 0.34},  {2, 22, 0.25}};

// Skin girth at a level: the measured profile, scaled to the body's four girths.
static double girth_at(const sonde_limb_body *b, double level) {
  const double ratio[][2] = {{0.12, log(b->girth_thigh_m / 0.630)},
                             {0.88, log(b->girth_knee_m / 0.3865)},
                             {1.28, log(b->girth_calf_m / 0.3765)},
                             {1.86, log(b->girth_ankle_m / 0.217)}};
  return 1e-3 * KNOTS(PROFILE, 1, level) * exp(KNOTS(ratio, 1, level));
}

// From the femur's condyles to the roof of the popliteal fossa: artery 8.6 mm and vein 5 mm with
// their walls, gaps of 2.1, 0.8 and 0.8 mm.
static const double FOSSA_M = 0.018;

// Fat along the ray: the logarithm of the thickness by two harmonics through the four sides.
static double fat_at(const sonde_limb_body *b, double level, double angle) {
  double hip = b->sex == SONDE_SEX_FEMALE ? 1.6 : 1.15; // lateral, proximal
  double front = b->fat_front_m, medial = b->fat_medial_m, lateral = b->fat_lateral_m,
         back = b->fat_back_m, fold = sqrt(b->fat_popliteal_m * back), shin = b->fat_shin_m,
         calf = b->fat_calf_m, inner = b->fat_calf_medial_m, groin = b->fat_groin_m,
         outer = 1.05 * sqrt(calf * inner);
  const double sides[][5] = {
      {-0.2, log(1.2 * groin), log(1.1 * medial), log(1.3 * hip * lateral), log(2.4 * back)},
      {0, log(groin), log(1.2 * medial), log(1.25 * hip * lateral), log(2.6 * back)},
      {0.12, log(sqrt(groin * front)), log(1.2 * medial), log(1.15 * hip * lateral),
       log(1.9 * back)},
      {0.25, log(1.05 * front), log(1.15 * medial), log(hip * lateral), log(1.15 * back)},
      {0.5, log(front), log(medial), log(lateral), log(back)},
      {0.75, log(0.9 * front), log(0.95 * medial), log(0.9 * lateral), log(0.9 * back)},
      {0.93, log(0.5 * front), log(0.75 * medial), log(0.7 * lateral), log(fold)},
      {1, log(0.0035), log(0.65 * medial), log(0.6 * lateral), log(b->fat_popliteal_m)},
      {1.1, log(1.2 * shin), log(0.9 * inner), log(outer), log(sqrt(b->fat_popliteal_m * calf))},
      {1.25, log(shin), log(inner), log(outer), log(calf)},
      {1.5, log(0.95 * shin), log(0.8 * inner), log(0.85 * outer), log(0.8 * calf)},
      {1.75, log(0.9 * shin), log(0.55 * inner), log(0.5 * outer), log(0.55 * calf)},
      {2, log(0.9 * shin), log(0.3 * inner), log(0.3 * inner), log(0.5 * calf)}};
  double f = KNOTS(sides, 1, level), m = KNOTS(sides, 2, level), l = KNOTS(sides, 3, level),
         p = KNOTS(sides, 4, level);
  return exp(0.25 * (f + m + l + p) + 0.5 * (f - p) * cos(angle) + 0.5 * (m - l) * sin(angle) +
             0.25 * (f + p - m - l) * cos(2 * angle));
}

// Shape of the fascia at a level up to its size: harmonics 2 and 3, and the first harmonic that
// brings the centroid back to the centre.
static void shape_at(double level, double *around) {
  double second[2] = {0, 0}, third[2] = {0, 0}, first[2] = {0, 0};
  double knots[SONDE_COUNT_OF(HARMONICS)][5];
  for (size_t k = 0; k < SONDE_COUNT_OF(HARMONICS); ++k) {
    double two = 2 * HARMONICS[k][2] * SONDE_PI / 180, three = 3 * HARMONICS[k][4] * SONDE_PI / 180;
    const double row[5] = {HARMONICS[k][0], HARMONICS[k][1] * cos(two), HARMONICS[k][1] * sin(two),
                           HARMONICS[k][3] * cos(three), HARMONICS[k][3] * sin(three)};
    for (int j = 0; j < 5; ++j) knots[k][j] = row[j];
  }
  for (uint32_t j = 0; j < 2; ++j)
    second[j] = KNOTS(knots, 1 + j, level), third[j] = KNOTS(knots, 3 + j, level);
  for (uint32_t pass = 0; pass < 6; ++pass) {
    double area = 0, mx = 0, my = 0;
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
      double a = 2 * SONDE_PI * c / LIMB_ANGLES;
      double r = 1 + first[0] * sin(a) + first[1] * cos(a) + second[0] * cos(2 * a) +
                 second[1] * sin(2 * a) + third[0] * cos(3 * a) + third[1] * sin(3 * a);
      around[c] = r;
      area += 0.5 * r * r, mx += r * r * r * sin(a) / 3, my += r * r * r * cos(a) / 3;
    }
    first[0] -= mx / area, first[1] -= my / area;
  }
}

// Radii of the fascia in one section: the shape at the size that gives the skin its girth, outside
// the bones.
static double fit_section(const double *around, const double *bone, const double *outside,
                          double wanted, double *radius) {
  double size = wanted / (2 * SONDE_PI) - 0.01, fold = 0.0015;
  for (uint32_t pass = 0; pass < 12; ++pass) {
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
      double r = size * around[c], gap = r - bone[c];
      radius[c] = bone[c] > 0 ? 0.5 * (r + bone[c] + sqrt(gap * gap + fold * fold)) : r;
    }
    // Girth of the skin that this fascia has.
    double girth = 0, x0 = 0, y0 = 0;
    for (uint32_t i = 0; i <= LIMB_ANGLES; ++i) {
      uint32_t c = i % LIMB_ANGLES;
      double angle = 2 * SONDE_PI * c / LIMB_ANGLES, r = radius[c] + outside[c];
      double x = r * sin(angle), y = r * cos(angle);
      if (i) girth += hypot(x - x0, y - y0);
      x0 = x, y0 = y;
    }
    size += (wanted - girth) / (2 * SONDE_PI);
  }
  return size;
}

// Moves the centre of a section to the centroid of its contour and reads the contour anew from
// there.
static void recentre(double *x, double *y, double *radius) {
  double px[LIMB_ANGLES + 1], py[LIMB_ANGLES + 1], area = 0, mx = 0, my = 0;
  for (uint32_t c = 0; c <= LIMB_ANGLES; ++c) {
    double a = 2 * SONDE_PI * c / LIMB_ANGLES, r = radius[c % LIMB_ANGLES];
    px[c] = r * sin(a), py[c] = r * cos(a);
  }
  for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
    double twice = py[c] * px[c + 1] - px[c] * py[c + 1];
    area += twice / 2, mx += twice * (px[c] + px[c + 1]) / 6, my += twice * (py[c] + py[c + 1]) / 6;
  }
  mx /= area, my /= area;
  *x += mx, *y += my;
  for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
    double a = 2 * SONDE_PI * c / LIMB_ANGLES, dx = sin(a), dy = cos(a);
    for (uint32_t i = 0; i < LIMB_ANGLES; ++i) {
      // Ray from the new centre against the side of the contour.
      double ax = px[i] - mx, ay = py[i] - my, bx = px[i + 1] - mx, by = py[i + 1] - my;
      double left = dy * ax - dx * ay, right = dy * bx - dx * by;
      if (left > 0 || right <= 0) continue;
      double u = left / (left - right);
      double r = (ax + u * (bx - ax)) * dx + (ay + u * (by - ay)) * dy;
      if (r > 0) radius[c] = r;
    }
  }
}

// What the bones reach at a place, also in the rows and, at pelvis and patella, the angles beside.
static double bone_reach(double (*bone)[LIMB_ANGLES], uint32_t r, uint32_t c) {
  const double level = LIMB_TOP + r * LIMB_STEP;
  const int aside = level < 0.15 || fabs(level - 0.95) < 0.1 || level > 1.9 ? 1 : 0;
  double reach = 0;
  for (int k = r > 0 ? -1 : 0; k <= (r + 1 < LIMB_ROWS ? 1 : 0); ++k)
    for (int q = -aside; q <= aside; ++q)
      reach = most_of(reach, bone[(int)r + k][((int)c + q + LIMB_ANGLES) % LIMB_ANGLES]);
  return reach;
}

// Around the knee the spread push makes the girth larger where the fossa's roof begins: its
// sections get the girth again, outside the bones.
static void keep_girth(const sonde_limb *limb, double (*bone)[LIMB_ANGLES],
                       double (*fascia)[LIMB_ANGLES]) {
  const sonde_limb_body *b = &limb->body;
  for (uint32_t r = 0; r < LIMB_ROWS; ++r) {
    const double level = LIMB_TOP + r * LIMB_STEP;
    const double knee = 1 - smooth_step((fabs(level - 0.93) - 0.14) / 0.08);
    double around[LIMB_ANGLES], outside[LIMB_ANGLES], radius[LIMB_ANGLES], reach[LIMB_ANGLES],
        mean = 0;
    if (knee <= 0) continue;
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) mean += fascia[r][c] / LIMB_ANGLES;
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c)
      around[c] = fascia[r][c] / mean, outside[c] = limb->surface.fat[r][c] + b->skin_m,
      reach[c] = bone_reach(bone, r, c);
    fit_section(around, reach, outside, girth_at(b, level), radius);
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) fascia[r][c] += knee * (radius[c] - fascia[r][c]);
  }
}

// The fascia of all rows: what the bones add and what the size loses by them, spread over
// neighbouring rows, and outside every bone. `extra` is room for what the bones reach beyond that.
static void spread_push(const sonde_limb *limb, double (*pushed)[LIMB_ANGLES],
                        double (*bone)[LIMB_ANGLES], double (*extra)[LIMB_ANGLES],
                        double (*fascia)[LIMB_ANGLES]) {
  enum { SPREAD = 6 };
  const limb_surface *s = &limb->surface;
  for (uint32_t r = 0; r < LIMB_ROWS; ++r)
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
      double sum = 0, weights = 0;
      for (int k = -SPREAD; k <= SPREAD; ++k) {
        int row = (int)r + k;
        if (row < 0 || row >= LIMB_ROWS) continue;
        double w = SPREAD + 1 - abs(k);
        sum += w * (pushed[row][c] - s->fascia[row][c]), weights += w;
      }
      fascia[r][c] = s->fascia[r][c] + sum / weights;
      extra[r][c] = most_of(bone_reach(bone, r, c) - fascia[r][c], 0);
    }
  // Above the thigh the fascia leaves a bone gently along the limb: what it stands forward over the
  // ramus ends 60 mm away, with a radius of curvature of 100 mm for 6 mm of height.
  const double gently_m = 0.06 * limb->scale, thigh = 0.15;
  for (uint32_t r = 0; r < LIMB_ROWS; ++r)
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
      double most = extra[r][c];
      for (uint32_t k = 0; LIMB_TOP + k * LIMB_STEP < thigh; ++k) {
        double away = fabs((double)r - k) * LIMB_STEP * limb->body.thigh_length_m / gently_m;
        most = most_of(most, extra[k][c] * (1 - smooth_step(away)));
      }
      fascia[r][c] += most;
    }
  // At the groin the skin runs from the thigh over the fat in front of the ramus to the middle of
  // the body: the contour has no hollow beside the bone. Chords over every side of the ray bound
  // it.
  const double from = 0.12, to = 0.22;
  for (uint32_t r = 0; LIMB_TOP + r * LIMB_STEP < to; ++r) {
    const double share = 1 - smooth_step((LIMB_TOP + r * LIMB_STEP - from) / (to - from));
    double x[LIMB_ANGLES], y[LIMB_ANGLES], hull[LIMB_ANGLES];
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
      double a = 2 * SONDE_PI * c / LIMB_ANGLES;
      hull[c] = fascia[r][c], x[c] = hull[c] * sin(a), y[c] = hull[c] * cos(a);
    }
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
      double a = 2 * SONDE_PI * c / LIMB_ANGLES, dx = sin(a), dy = cos(a);
      for (uint32_t i = 1; i < LIMB_ANGLES / 2; ++i)
        for (uint32_t j = 1; i + j < LIMB_ANGLES / 2; ++j) {
          uint32_t p = (c + LIMB_ANGLES - i) % LIMB_ANGLES, q = (c + j) % LIMB_ANGLES;
          double left = dy * x[p] - dx * y[p], right = dy * x[q] - dx * y[q];
          double u = left / (left - right);
          hull[c] =
              most_of(hull[c], (x[p] + u * (x[q] - x[p])) * dx + (y[p] + u * (y[q] - y[p])) * dy);
        }
    }
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) fascia[r][c] += share * (hull[c] - fascia[r][c]);
  }
  keep_girth(limb, bone, fascia);
}

sonde_status limb_surface_make(sonde_limb *limb, sonde_error *error) {
  SONDE_ASSERT(limb->bones);
  const sonde_limb_body *b = &limb->body;
  limb_surface *s = &limb->surface;
  double(*around)[LIMB_ANGLES] = sonde_calloc((size_t)5 * LIMB_ROWS, sizeof *around);
  if (!around) return sonde_fail_memory(error);
  double outside[LIMB_ANGLES], none[LIMB_ANGLES] = {0};
  // Sections as if there were no bones.
  for (uint32_t r = 0; r < LIMB_ROWS; ++r) {
    double level = LIMB_TOP + r * LIMB_STEP;
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
      s->fat[r][c] = fat_at(b, level, 2 * SONDE_PI * c / LIMB_ANGLES);
      outside[c] = s->fat[r][c] + b->skin_m;
    }
    shape_at(level, around[r]);
    double wanted = girth_at(b, level);
    double size = fit_section(around[r], none, outside, wanted, s->fascia[r]);
    if (!(size > 0.022)) {
      sonde_free(around);
      return sonde_fail(error, SONDE_ARGUMENT,
                        "the skin's girth at level %.2f is %.0f mm: fat and skin leave a fascia of "
                        "%.0f mm radius, expected 22 or more",
                        level, wanted * 1e3, size * 1e3);
    }
  }
  // Centres from the bones' places in the sections; in front of the hip the fascia keeps its
  // distance from the joint whatever the girth.
  double knots[SONDE_COUNT_OF(CENTRES)][3];
  for (size_t k = 0; k < SONDE_COUNT_OF(CENTRES); ++k) {
    double a = CENTRES[k][1] * SONDE_PI / 180, at = CENTRES[k][0];
    double f = CENTRES[k][2] * limb_fascia_radius(limb, at, a);
    sonde_vec3 bone = at <= 0  ? vec3(0, 0, 0)
                      : at < 1 ? limb_shaft_axis(b, at)
                               : limb_tibia_axis(b, at);
    knots[k][0] = at, knots[k][1] = bone.x - f * sin(a), knots[k][2] = bone.y - f * cos(a);
    // The femoral artery's front wall stands 55 mm before the hip's centre, the fascia before it.
    if (at <= 0)
      knots[k][2] = 0.055 * limb->scale + limb_groin_cover(b) - limb_fascia_radius(limb, at, 0.25);
  }
  // The fascia passes outside the bones; the girth stays. What the bones add and what the size
  // loses by them are spread over neighbouring rows, so that the skin has no edge there.
  double(*bone)[LIMB_ANGLES] = &around[LIMB_ROWS], (*pushed)[LIMB_ANGLES] = &around[2 * LIMB_ROWS];
  double(*fascia)[LIMB_ANGLES] = &around[3 * LIMB_ROWS],
  (*extra)[LIMB_ANGLES] = &around[4 * LIMB_ROWS];
  for (uint32_t pass = 0; pass < 2; ++pass) {
    for (uint32_t r = 0; r < LIMB_ROWS; ++r) {
      double level = LIMB_TOP + r * LIMB_STEP;
      s->x[r] = KNOTS(knots, 1, level), s->y[r] = KNOTS(knots, 2, level);
      sonde_vec3 centre = vec3(s->x[r], s->y[r], limb_z(limb, level));
      for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
        double angle = 2 * SONDE_PI * c / LIMB_ANGLES;
        // The farthest bone on the ray, with some tissue over it; behind the knee with room for the
        // vessels and the nerve between the condyles and the roof of the popliteal fossa.
        const double fossa = (1 - smooth_step((fabs(level - 0.955) - 0.04) / 0.08)) *
                             (1 - smooth_step((fabs(angle - SONDE_PI) - 0.35) / 0.6));
        const double over = (level < 0.15 ? 0.003 : 0.0012) + FOSSA_M * limb->scale * fossa;
        double reach = 1.5 * s->fascia[r][c], least = 0.2 * reach, gap = 1;
        for (; reach > least; reach -= 0.8 * gap) {
          const double p[3] = {centre.x + reach * sin(angle), centre.y + reach * cos(angle),
                               centre.z};
          gap = limb_bone_distance(limb, p, NULL) - over;
          if (gap < 1e-4) break;
        }
        bone[r][c] = reach > least ? reach : 0;
        outside[c] = s->fat[r][c] + b->skin_m;
      }
      fit_section(around[r], bone[r], outside, girth_at(b, level), pushed[r]);
    }
    spread_push(limb, pushed, bone, extra, fascia);
    // At the groin the section moves by what the push has taken from its front.
    for (size_t k = 0; k < SONDE_COUNT_OF(CENTRES) && pass == 0 && CENTRES[k][0] <= 0; ++k) {
      uint32_t row = (uint32_t)lround((CENTRES[k][0] - LIMB_TOP) / LIMB_STEP);
      knots[k][2] += s->fascia[row][3] - fascia[row][3];
    }
  }
  memcpy(s->fascia, fascia, sizeof s->fascia);
  for (uint32_t r = 0; r < LIMB_ROWS; ++r) recentre(&s->x[r], &s->y[r], s->fascia[r]);
  sonde_free(around);
  return SONDE_OK;
}
