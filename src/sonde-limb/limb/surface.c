// Deep fascia, fat and skin: harmonics on cubic splines in level, girths of the body
// (docs/limb_theory.md).
#include "limb/frame.h"

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
  uint32_t k = (uint32_t)fmin(r, LIMB_ROWS - 2);
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

double limb_deep_fat(const sonde_limb *limb, double level, double angle) {
  double whole = limb_fat(limb, level, angle);
  return fmin(0.45 * whole, 0.003 + 0.2 * whole);
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

// ---- knots in level
// ------------------------------------------------------------------------------

// Value at x of the C1 cubic through knots[count][columns] (first column: x), with the tangents of
// the parabola through three neighbours; constant beyond the ends.
static double through(const double *knots, uint32_t count, uint32_t columns, uint32_t column,
                      double x) {
  SONDE_ASSERT(count >= 2 && column > 0 && column < columns);
#define AT(i) knots[(size_t)(i)*columns]
#define OF(i) knots[(size_t)(i)*columns + column]
  if (x <= AT(0)) return OF(0);
  if (x >= AT(count - 1)) return OF(count - 1);
  uint32_t k = 0;
  while (AT(k + 1) < x) ++k;
  double h = AT(k + 1) - AT(k), u = (x - AT(k)) / h, rise = (OF(k + 1) - OF(k)) / h;
  double before = rise, after = rise;
  if (k > 0) {
    double h0 = AT(k) - AT(k - 1), r0 = (OF(k) - OF(k - 1)) / h0;
    before = (r0 * h + rise * h0) / (h + h0);
  }
  if (k + 2 < count) {
    double h1 = AT(k + 2) - AT(k + 1), r1 = (OF(k + 2) - OF(k + 1)) / h1;
    after = (rise * h1 + r1 * h) / (h + h1);
  }
  double v = 1 - u;
  return OF(k) * v * v * (1 + 2 * u) + OF(k + 1) * u * u * (3 - 2 * u) +
         h * u * v * (before * v - after * u);
#undef AT
#undef OF
}
#define THROUGH(knots, column, x)                                                                  \
  through(&(knots)[0][0], SONDE_COUNT_OF(knots), SONDE_COUNT_OF((knots)[0]), column, x)

// Skin girth of the measured leg, mm, and the harmonics of the muscles' envelope: amplitude times
// cosine and sine of 2 phase (second), 3 phase (third); phases from the front through medial.
static const double PROFILE[][3] = {
    {-0.2, 690, 0}, {-0.1, 678, 0}, {0.05, 653, 0}, {0.15, 617, 0}, {0.25, 571, 0}, {0.35, 535, 0},
    {0.41, 520, 0}, {0.5, 497, 0},  {0.65, 456, 0}, {0.75, 418, 0}, {0.85, 389, 0}, {0.95, 383, 0},
    {1.05, 366, 0}, {1.15, 366, 0}, {1.25, 376, 0}, {1.35, 375, 0}, {1.5, 335, 0},  {1.65, 272, 0},
    {1.72, 246, 0}, {1.86, 217, 0}, {1.93, 222, 0}, {2, 238, 0}};
// Level, second amplitude and direction (degrees), third amplitude and direction.
static const double HARMONICS[][5] = {
    {-0.2, 0.1, 160, 0, 0},         {0, 0.12, 165, 0.01, 30},      {0.12, 0.11, 130, 0.03, 33},
    {0.25, 0.145, 110, 0.034, 35},  {0.35, 0.165, 116, 0.02, 35},  {0.5, 0.165, 125, 0.019, 35},
    {0.65, 0.125, 129, 0.012, 20},  {0.75, 0.09, 131, 0.015, 10},  {0.88, 0.03, 120, 0.035, 0},
    {0.98, 0.03, 60, 0.05, 0},      {1.06, 0.05, 10, 0.055, 0},    {1.15, 0.1, 2, 0.058, 0},
    {1.25, 0.062, 161, 0.075, 113}, {1.35, 0.065, 155, 0.07, 116}, {1.5, 0.079, 146, 0.065, 119},
    {1.68, 0.06, 165, 0.05, 118},   {1.85, 0.11, 175, 0.05, 0},    {2, 0.17, 178, 0.06, 0}};
// Where the section's centre is, as the place (degrees, f) of the bone that the other columns give
// in mm of a thigh of 430 mm or a calf of 395 mm: hip centre, femoral shaft, tibia.
static const double CENTRES[][5] = {
    {-0.2, 15, 0.26, 0, 0},   {0, 18, 0.24, 0, 0},     {0.15, 272, 0.46, -37, -3},
    {0.25, 274, 0.4, -33, 1}, {0.5, 299, 0.2, -22, 6}, {0.75, 317, 0.21, -11, 1},
    {0.9, 345, 0.12, -3, 0},  {1, 5, 0.04, 0, -6},     {1.12, 24, 0.42, 2, 2},
    {1.25, 24, 0.6, 3, 3},    {1.5, 28, 0.6, 3, 3},    {1.75, 25, 0.5, 2, 2},
    {1.9, 12, 0.3, 1, 0},     {2, 8, 0.22, 0, 0}};

// Skin girth at a level: the measured profile, scaled to the body's four girths.
static double girth_at(const sonde_limb_body *b, double level) {
  const double ratio[][2] = {{0.12, log(b->girth_thigh_m / 0.630)},
                             {0.88, log(b->girth_knee_m / 0.3865)},
                             {1.28, log(b->girth_calf_m / 0.3765)},
                             {1.86, log(b->girth_ankle_m / 0.217)}};
  return 1e-3 * THROUGH(PROFILE, 1, level) * exp(THROUGH(ratio, 1, level));
}

// Fat along the ray: the logarithm of the thickness by two harmonics through the four sides.
static double fat_at(const sonde_limb_body *b, double level, double angle) {
  double hip = b->sex == SONDE_SEX_FEMALE ? 1.6 : 1.15; // lateral, proximal
  double front = b->fat_front_m, medial = b->fat_medial_m, lateral = b->fat_lateral_m,
         back = b->fat_back_m, fold = sqrt(b->fat_popliteal_m * back), shin = b->fat_shin_m,
         calf = b->fat_calf_m, inner = b->fat_calf_medial_m, groin = b->fat_groin_m;
  const double sides[][5] = {
      {-0.2, log(1.2 * groin), log(1.1 * medial), log(1.3 * hip * lateral), log(1.6 * back)},
      {0, log(groin), log(1.2 * medial), log(1.25 * hip * lateral), log(1.6 * back)},
      {0.25, log(1.05 * front), log(1.15 * medial), log(hip * lateral), log(1.15 * back)},
      {0.5, log(front), log(medial), log(lateral), log(back)},
      {0.75, log(0.9 * front), log(0.95 * medial), log(0.9 * lateral), log(0.9 * back)},
      {0.93, log(0.5 * front), log(0.75 * medial), log(0.7 * lateral), log(fold)},
      {1, log(0.0035), log(0.65 * medial), log(0.6 * lateral), log(b->fat_popliteal_m)},
      {1.1, log(1.2 * shin), log(0.9 * inner), log(0.7 * inner), log(b->fat_popliteal_m)},
      {1.25, log(shin), log(inner), log(0.7 * inner), log(calf)},
      {1.5, log(0.95 * shin), log(0.8 * inner), log(0.6 * inner), log(0.8 * calf)},
      {1.75, log(0.9 * shin), log(0.55 * inner), log(0.45 * inner), log(0.55 * calf)},
      {2, log(0.9 * shin), log(0.3 * inner), log(0.3 * inner), log(0.5 * calf)}};
  double f = THROUGH(sides, 1, level), m = THROUGH(sides, 2, level), l = THROUGH(sides, 3, level),
         p = THROUGH(sides, 4, level);
  return exp(0.25 * (f + m + l + p) + 0.5 * (f - p) * cos(angle) + 0.5 * (m - l) * sin(angle) +
             0.25 * (f + p - m - l) * cos(2 * angle));
}

// Length of the closed curve of radii around[LIMB_ANGLES] times `factor` plus outside[].
static double girth_of(const double *around, double factor, const double *outside) {
  double length = 0, x0 = 0, y0 = 0;
  for (uint32_t i = 0; i <= LIMB_ANGLES; ++i) {
    uint32_t c = i % LIMB_ANGLES;
    double angle = 2 * SONDE_PI * c / LIMB_ANGLES, r = factor * around[c] + outside[c];
    double x = r * sin(angle), y = r * cos(angle);
    if (i) length += hypot(x - x0, y - y0);
    x0 = x, y0 = y;
  }
  return length;
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
    second[j] = THROUGH(knots, 1 + j, level), third[j] = THROUGH(knots, 3 + j, level);
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

sonde_status limb_surface_make(sonde_limb *limb, sonde_error *error) {
  const sonde_limb_body *b = &limb->body;
  limb_surface *s = &limb->surface;
  limb->scale = b->thigh_length_m / 0.430;
  for (uint32_t r = 0; r < LIMB_ROWS; ++r) {
    double level = LIMB_TOP + r * LIMB_STEP, outside[LIMB_ANGLES], around[LIMB_ANGLES];
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) {
      s->fat[r][c] = fat_at(b, level, 2 * SONDE_PI * c / LIMB_ANGLES);
      outside[c] = s->fat[r][c] + b->skin_m;
    }
    // Size of the fascia that gives the skin its girth: secant steps.
    shape_at(level, around);
    double wanted = girth_at(b, level), size = wanted / (2 * SONDE_PI) - 0.01;
    for (uint32_t pass = 0; pass < 8; ++pass)
      size += (wanted - girth_of(around, size, outside)) / (2 * SONDE_PI);
    if (!(size > 0.02))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "the skin's girth at level %.2f is %.0f mm: fat and skin leave a fascia of "
                        "%.0f mm radius, expected 20 or more",
                        level, wanted * 1e3, size * 1e3);
    for (uint32_t c = 0; c < LIMB_ANGLES; ++c) s->fascia[r][c] = size * around[c];
  }
  // Centres: from the bone's place in the section; in front of the hip the fascia keeps its
  // distance from the joint whatever the girth.
  for (uint32_t r = 0; r < LIMB_ROWS; ++r) {
    double level = LIMB_TOP + r * LIMB_STEP, knots[SONDE_COUNT_OF(CENTRES)][3];
    double size = level <= 1 ? limb->scale : b->calf_length_m / 0.395;
    for (size_t k = 0; k < SONDE_COUNT_OF(CENTRES); ++k) {
      double a = CENTRES[k][1] * SONDE_PI / 180, at = CENTRES[k][0];
      double radius = limb_fascia_radius(limb, at, a), f = CENTRES[k][2] * radius;
      knots[k][0] = at;
      knots[k][1] = 1e-3 * size * CENTRES[k][3] - f * sin(a);
      knots[k][2] = 1e-3 * size * CENTRES[k][4] - f * cos(a);
      if (at <= 0) knots[k][2] = 0.062 * limb->scale - limb_fascia_radius(limb, at, 0.25);
    }
    s->x[r] = THROUGH(knots, 1, level), s->y[r] = THROUGH(knots, 2, level);
  }
  return SONDE_OK;
}
