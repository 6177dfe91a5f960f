// March along the scan lines through the deformed tissue: backscatter, attenuation, specular
// echoes at interfaces, shadow of the bone, air. Constants and sources: docs/echo.md.
//
// sonde_echo_medium  all rows of the march
// interpolate_row    coarse plane -> one row, per line
// texture            value noise in tissue coordinates: septa of the fat, bundles of the muscle
// tissue_at          label, backscatter and attenuation at a point
// cross              detects a level's zero between two rows and records its echo
// mark_air           lines whose face does not touch the skin
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <string.h>

enum { TURNS_MUSCLE = 90, TURNS_FAT = 60 }; // noise cells around the leg

static const float air_gap_m = 1.5e-3f;
static const float bone_loss_db = 55; // behind the cortex
static const float wall_m[2] = {0.6e-3f, 0.9e-3f};

// Backscatter over muscle (amplitude) and attenuation (dB/m/MHz one way).
typedef struct tissue {
  float scatter, loss;
} tissue;

// Echo of an interface over the rms of muscle speckle: decibels at normal incidence, the angle's
// tangent at which the specular part has fallen by 1/e, and the diffuse share that stays.
typedef struct interface {
  float db, tangent, diffuse;
} interface;
static const interface skin_top = {18, 0.5f, 0.3f}, skin_base = {10, 0.3f, 0.2f},
                       fascia = {21, 0.22f, 0.12f}, vessel_wall = {17, 0.5f, 0.12f},
                       cortex = {36, 0.4f, 0.02f};

static void interpolate_row(sonde_echo *echo, uint32_t row) {
  SONDE_ASSERT(row < SONDE_MEDIUM_ROWS);
  const uint32_t count = SONDE_PLANE_COLUMNS * SONDE_PLANE_ROWS, lines = echo->lines;
  float y = (float)row * (SONDE_PLANE_ROWS - 1) / (SONDE_MEDIUM_ROWS - 1);
  uint32_t j = (uint32_t)y < SONDE_PLANE_ROWS - 2 ? (uint32_t)y : SONDE_PLANE_ROWS - 2;
  float b = y - (float)j, x_step = (float)(SONDE_PLANE_COLUMNS - 1) / (float)(lines - 1);
  for (int field = 0; field < PLANE_FIELDS; ++field) {
    const float *top = echo->plane + (uint32_t)field * count + j * SONDE_PLANE_COLUMNS;
    float mixed[SONDE_PLANE_COLUMNS + 1], *out = echo->row + (uint32_t)field * lines;
    for (int i = 0; i < SONDE_PLANE_COLUMNS; ++i)
      mixed[i] = top[i] + b * (top[i + SONDE_PLANE_COLUMNS] - top[i]);
    mixed[SONDE_PLANE_COLUMNS] = mixed[SONDE_PLANE_COLUMNS - 1];
    for (uint32_t l = 0; l < lines; ++l) {
      float x = (float)l * x_step;
      int i = (int)x;
      out[l] = mixed[i] + (x - (float)i) * (mixed[i + 1] - mixed[i]);
    }
  }
}

// Fast mix for noise cells: only the texture depends on it.
static float cell_value(int32_t a, int32_t b, int32_t c) {
  uint32_t h = (uint32_t)a * 0x9e3779b1u ^ (uint32_t)b * 0x85ebca77u ^ (uint32_t)c * 0xc2b2ae3du;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return (float)((h ^ (h >> 15)) >> 8) * (2.0f / 16777216.0f) - 1.0f;
}

static float smooth(float t) { return t * t * (3 - 2 * t); }
static int32_t wrap(int32_t i, int32_t n) {
  while (i < 0) i += n;
  while (i >= n) i -= n;
  return i;
}
static float whole_below(float x) {
  float i = (float)(int32_t)x;
  return i > x ? i - 1 : i;
}

// Value noise in [-1, 1]; periodic around the leg with `turns` cells.
static float texture(float theta, float along, float depth, int32_t turns, int32_t salt) {
  float u = theta * (float)turns * 0.159154943f;
  float fu = whole_below(u), fv = whole_below(along), fw = whole_below(depth);
  int32_t a = wrap((int32_t)fu, turns), a1 = a + 1 == turns ? 0 : a + 1;
  int32_t b = (int32_t)fv + 1000 * salt, c = (int32_t)fw;
  float tu = smooth(u - fu), tv = smooth(along - fv), tw = smooth(depth - fw), sum = 0;
  for (int32_t k = 0; k < 4; ++k) {
    float low = cell_value(a, b + (k & 1), c + (k >> 1));
    float high = cell_value(a1, b + (k & 1), c + (k >> 1));
    float weight = ((k & 1) ? tv : 1 - tv) * ((k >> 1) ? tw : 1 - tw);
    sum += weight * (low + tu * (high - low));
  }
  return sum;
}

// Bright sheets at whole values of `layer`, thin over `share` of the spacing.
static float sheet(float layer, float share) {
  float away = fabsf(layer - whole_below(layer) - 0.5f) * 2; // 1 on the sheet, 0 half-way
  float height = (away - 1 + share) / share;
  return height > 0 ? height * height : 0;
}

// Septa of the fat: broken sheets roughly along the skin, bent by the lobules.
static float septa(float theta, float s, float depth) {
  float bend = texture(theta, s * 70, depth * 250, TURNS_FAT, 1);
  float strength = texture(theta, s * 110, depth * 500, 2 * TURNS_FAT, 4);
  float height = sheet(depth * 300 + 0.9f * bend, 0.22f) * (0.5f + strength);
  return height > 0 ? height : 0;
}

// Bundles of muscle, in decibels: dark fascicles between broken bright connective layers that run
// at a small angle to the skin.
static float bundles(float theta, float s, float depth) {
  float slant = depth + 0.012f * theta;
  float bend = texture(theta, s * 40, depth * 130, TURNS_MUSCLE / 3, 2);
  float fine = texture(theta, s * 90, slant * 900, TURNS_MUSCLE, 3);
  float strength = texture(theta, s * 60, slant * 400, TURNS_MUSCLE / 2, 5);
  float bright = sheet(slant * 260 + 0.8f * bend, 0.35f) * (0.35f + strength);
  return 2.5f * fine + 2.5f * bend + (bright > 0 ? 13 * bright : 0) - 1;
}

// Chord that bounds a mural clot of share `part` on the deep side, in semi-axes.
static bool in_clot(const sonde_echo *echo, const float *row, uint32_t l) {
  uint32_t lines = echo->lines;
  float part = (float)echo->frame.pathology->thrombus_fraction;
  if (row[PLANE_CLOT * lines + l] < 0.5f) return false;
  return part >= 1 || -row[PLANE_VEIN_SHORT * lines + l] > 1 - 2 * part;
}

// Signed distance to a vessel's inner wall over the row, metres (negative inside): to first order
// (F - 1)/|grad F| of the ellipse F = 1.
static float wall_distance(const float *row, uint32_t lines, uint32_t l, int which) {
  const float *at = row + (which == 0 ? PLANE_VEIN_SHORT : PLANE_ARTERY_SHORT) * lines + l;
  const float *half =
      row + (which == 0 ? PLANE_VEIN_HALF_SHORT : PLANE_ARTERY_HALF_SHORT) * lines + l;
  float a = at[0], b = at[lines], square = a * a + b * b;
  if (square > 400) return 1;
  float size = sqrtf(square), ga = a / half[0], gb = b / half[lines];
  float steep = sqrtf(ga * ga + gb * gb);
  float distance = steep > 1e-3f ? (size - 1) * size / steep : -half[0];
  float beyond = (fabsf(b) - 1) * half[lines]; // bounds the estimate beside a flat ellipse's tips
  return beyond > 0 && beyond > distance ? beyond : distance;
}

static tissue tissue_at(const sonde_echo *echo, const float *row, uint32_t l) {
  uint32_t lines = echo->lines;
  float depth = row[PLANE_DEPTH * lines + l];
  if (depth < 0) return (tissue){0, 0.2f};
  if (row[PLANE_R * lines + l] < (float)echo->interior->bone_radius_m) return (tissue){0.02f, 200};
  for (int which = 0; which < 2; ++which) {
    float d = wall_distance(row, lines, l, which);
    if (d >= wall_m[which]) continue;
    if (d > 0) return (tissue){1.9f, 110};
    if (which == 0 && in_clot(echo, row, l))
      return (tissue){0.12f + 0.9f * (float)echo->frame.pathology->echogenicity, 45};
    return (tissue){0.006f, 18};
  }
  float theta = row[PLANE_THETA * lines + l], s = row[PLANE_S * lines + l];
  if (depth < row[PLANE_FAT * lines + l]) return (tissue){2.2f, 100};
  if (depth < row[PLANE_MUSCLE * lines + l])
    return (tissue){0.40f + (echo->plain ? 0 : 1.5f * septa(theta, s, depth)), 50};
  if (echo->plain) return (tissue){1, 100};
  float b = bundles(theta, s, depth);
  return (tissue){0.85f * amplitude_of_db(b), 100};
}

static void record(sonde_echo *echo, uint32_t l, float depth_m, float amplitude) {
  SONDE_ASSERT(l < echo->lines);
  uint32_t n = echo->echo_count[l];
  if (n >= SONDE_MAX_ECHOES || amplitude <= 0) return;
  echo->echoes[l * SONDE_MAX_ECHOES + n] = (specular){depth_m, amplitude};
  echo->echo_count[l] = (uint8_t)(n + 1);
}

// A level that changes sign between the last row and this one reflects; `across` is its change per
// line. Returns true when it crossed.
static bool cross(sonde_echo *echo, uint32_t row, uint32_t l, float before, float now, float across,
                  interface kind) {
  if ((before < 0) == (now < 0)) return false;
  float dz = (float)(echo->frame.depth_m / (SONDE_MEDIUM_ROWS - 1));
  float t = before / (before - now), slope = (now - before) / dz;
  float tangent = across / (float)echo->frame.pitch_m / (fabsf(slope) > 1e-6f ? slope : 1e-6f);
  float q = tangent / kind.tangent;
  float shape = kind.diffuse + (1 - kind.diffuse) * expf(-q * q);
  float theta = echo->row[PLANE_THETA * echo->lines + l], s = echo->row[PLANE_S * echo->lines + l];
  float rough = echo->plain ? 0 : 4 * texture(theta, s * 400, kind.db, 4 * TURNS_MUSCLE, 6);
  float level = amplitude_of_db(kind.db + rough - echo->loss_db[l]);
  record(echo, l, ((float)row - 1 + t) * dz, level * shape);
  return true;
}

static float level_at(const sonde_echo *echo, const float *row, int which, uint32_t l) {
  uint32_t lines = echo->lines;
  switch (which) {
  case 0: return row[PLANE_DEPTH * lines + l];
  case 1: return row[PLANE_DEPTH * lines + l] - row[PLANE_FAT * lines + l];
  case 2: return row[PLANE_DEPTH * lines + l] - row[PLANE_MUSCLE * lines + l];
  case 3: return (float)echo->interior->bone_radius_m - row[PLANE_R * lines + l];
  default: return wall_distance(row, lines, l, which - 4);
  }
}

static void cross_levels(sonde_echo *echo, uint32_t row, uint32_t l) {
  static const interface *const kinds[] = {&skin_top, &skin_base,   &fascia,
                                           &cortex,   &vessel_wall, &vessel_wall};
  uint32_t left = l > 0 ? l - 1 : l, right = l + 1 < echo->lines ? l + 1 : l;
  bool lumen = wall_distance(echo->row, echo->lines, l, 0) < 0 ||
               wall_distance(echo->row, echo->lines, l, 1) < 0;
  for (int which = 0; which < 6; ++which) {
    if (lumen && (which == 1 || which == 2)) continue; // layers end at a vessel
    float before = level_at(echo, echo->last_row, which, l),
          now = level_at(echo, echo->row, which, l);
    if ((before < 0) == (now < 0)) continue;
    float across =
        (level_at(echo, echo->row, which, right) - level_at(echo, echo->row, which, left)) /
        (float)(right - left);
    bool crossed = cross(echo, row, l, before, now, across, *kinds[which]);
    if (crossed && which == 3) echo->loss_db[l] += bone_loss_db;
  }
}

// Bands at multiples of the face's own thickness, fading.
static void reverberate(sonde_echo *echo, uint32_t l) {
  for (int k = 0; k < 6; ++k)
    record(echo, l, 0.4e-3f + 1.3e-3f * (float)k, 6.0f * exp2f(-1.4f * (float)k));
}

static void mark_air(sonde_echo *echo) {
  for (uint32_t l = 0; l < echo->lines; ++l) {
    echo->air[l] = echo->row[PLANE_DEPTH * echo->lines + l] < -air_gap_m;
    if (echo->air[l]) reverberate(echo, l);
  }
}

// The aperture looks past small obstacles: what a line has lost mixes with its neighbours'. Lines
// in air send nothing and take no part.
static void blur_loss(sonde_echo *echo) {
  float *loss = echo->loss_db, last = loss[0];
  for (uint32_t l = 1; l + 1 < echo->lines; ++l) {
    float here = loss[l], left = echo->air[l - 1] ? here : last;
    float right = echo->air[l + 1] ? here : loss[l + 1];
    loss[l] += 0.15f * (left - 2 * here + right);
    last = here;
  }
}

void sonde_echo_medium(sonde_echo *echo) {
  uint32_t lines = echo->lines;
  double dz = echo->frame.depth_m / (SONDE_MEDIUM_ROWS - 1);
  float step = (float)(2 * dz * echo->frame.frequency_hz * 1e-6);
  memset(echo->loss_db, 0, lines * sizeof *echo->loss_db);
  memset(echo->echo_count, 0, lines);
  for (uint32_t row = 0; row < SONDE_MEDIUM_ROWS; ++row) {
    float *swap = echo->last_row;
    echo->last_row = echo->row, echo->row = swap;
    interpolate_row(echo, row);
    if (row == 0) mark_air(echo);
    float *gain = echo->gain + row * lines;
    blur_loss(echo);
    for (uint32_t l = 0; l < lines; ++l) {
      gain[l] = 0;
      if (echo->air[l]) continue;
      if (row > 0) cross_levels(echo, row, l);
      tissue t = tissue_at(echo, echo->row, l);
      gain[l] = t.scatter * amplitude_of_db(-echo->loss_db[l]);
      echo->loss_db[l] += t.loss * step;
    }
  }
}
