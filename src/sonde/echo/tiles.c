// Periodic pieces of fat and of muscle as amplitudes over muscle speckle, which the kernels look
// up in tissue coordinates (docs/echo_theory.md, Tiles).
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <stdlib.h>

enum { SIDE = SONDE_TILE_SIDE, VOXELS = SIDE * SIDE * SIDE };

// Amplitudes of a tile before they are packed: sheets that face the beam at w, the body beside
// them, and room for noise.
typedef struct draft {
  float facing[VOXELS], body[VOXELS], noise[6][VOXELS];
  uint64_t seed;
} draft;

// Value noise of unit deviation with so many knots along x, y and z, periodic with the tile.
static void draw_noise(draft *d, float *out, uint32_t nx, uint32_t ny, uint32_t nz) {
  SONDE_ASSERT(nx <= SIDE && ny <= SIDE && nz <= SIDE && nx > 1 && ny > 1 && nz > 1);
  const uint32_t count[3] = {nx, ny, nz};
  float *knot = d->noise[5], share[3][SIDE];
  uint32_t from[3][SIDE], to[3][SIDE];
  // Deviation of smooth value noise between independent knots: (sum of the squared shares' mean)
  // of 0.743 per axis.
  const float scale = 1.7320508f / 0.6403f;
  for (uint32_t k = 0; k < nx * ny * nz; ++k)
    knot[k] = scale * (float)(2 * sonde_random_uniform(d->seed, k) - 1);
  ++d->seed;
  for (int c = 0; c < 3; ++c)
    for (uint32_t i = 0; i < SIDE; ++i) {
      const float at = (float)(i * count[c]) / SIDE, t = at - floorf(at);
      from[c][i] = (uint32_t)at, to[c][i] = (from[c][i] + 1) % count[c];
      share[c][i] = t * t * (3 - 2 * t);
    }
  for (uint32_t z = 0; z < SIDE; ++z)
    for (uint32_t y = 0; y < SIDE; ++y) {
      const float u = share[1][y], v = share[2][z];
      const float *low = knot + nx * ny * from[2][z], *high = knot + nx * ny * to[2][z];
      float row[SIDE];
      for (uint32_t x = 0; x < nx; ++x) {
        const uint32_t a = nx * from[1][y] + x, b = nx * to[1][y] + x;
        const float below = low[a] + u * (low[b] - low[a]);
        row[x] = below + v * (high[a] + u * (high[b] - high[a]) - below);
      }
      for (uint32_t x = 0; x < SIDE; ++x)
        *out++ = row[from[0][x]] + share[0][x] * (row[to[0][x]] - row[from[0][x]]);
    }
}

// Height of a sheet at whole values of `phase`, `spacing` thick, whose half thickness is given.
static float profile(float phase, float spacing, float half) {
  SONDE_ASSERT(spacing > 0 && half > 0);
  const float away = fabsf(phase - floorf(phase + 0.5f)) * spacing / half;
  return away < 1 ? (1 - away * away) * (1 - away * away) : 0;
}

// Strength of a patch: none where the noise is low, far above the mean in few places.
static float patch(float floor_of, float rise, float noise) {
  const float root = fminf(fmaxf(floor_of + rise * noise, 0), 1.5f);
  return root * root;
}

// Sheets of a tile: `count` of them along z, which climb by `turns` of them along x and along y.
typedef struct sheets {
  float count, spacing_mm, half_mm, level, floor, rise, turns[2];
} sheets;

// Adds sheets to `out`, bent by `bend`, in patches of `strength`.
static void add_sheets(float *out, const sheets *s, const float *bend, float bent,
                       const float *strength) {
  SONDE_ASSERT(s->count > 0 && s->half_mm > 0);
  for (uint32_t i = 0; i < VOXELS; ++i) {
    const float x = (float)(i % SIDE), y = (float)(i / SIDE % SIDE), z = (float)(i / (SIDE * SIDE));
    const float phase = (s->count * z + s->turns[0] * x + s->turns[1] * y) / SIDE + bent * bend[i];
    const float height = profile(phase, s->spacing_mm, s->half_mm);
    if (height > 0) out[i] += s->level * height * patch(s->floor, s->rise, strength[i]);
  }
}

// The same upright: across x (`axis` 0), where the tile's shear is undone, or along y.
static void add_upright(float *out, int axis, const sheets *s, const float *bend, float bent,
                        const float *strength) {
  SONDE_ASSERT(s->count > 0 && s->half_mm > 0);
  for (uint32_t i = 0; i < VOXELS; ++i) {
    const uint32_t x = i % SIDE, y = i / SIDE % SIDE, z = i / (SIDE * SIDE);
    const float place = axis == 0 ? (float)x + SONDE_TILE_SHEAR * (float)z : (float)y;
    const float phase = s->count * place / SIDE + bent * bend[i];
    const float height = profile(phase, s->spacing_mm, s->half_mm);
    if (height > 0) out[i] += s->level * height * patch(s->floor, s->rise, strength[i]);
  }
}

// Four bytes a voxel: facing here and at the next x, body here and at the next x.
static void pack(const draft *d, uint32_t *word) {
  for (uint32_t i = 0; i < VOXELS; ++i) {
    const uint32_t next = i % SIDE + 1 < SIDE ? i + 1 : i + 1 - SIDE;
    const float value[4] = {d->facing[i], d->facing[next], d->body[i], d->body[next]};
    word[i] = 0;
    for (int k = 0; k < 4; ++k)
      word[i] |= (uint32_t)fminf(value[k] * SONDE_TILE_STEPS + 0.5f, 255) << 8 * k;
  }
}

// Lobules of fat in 32 x 32 x 16 mm: two generations of septa, 3.0 and 2.4 mm apart, lean against
// each other by 20 degrees around the leg and 10 along it and close lenses of 8 mm between them;
// fine sheets every 0.57 mm, a few upright ones every 4 mm, and dark grain.
static void draw_fat(draft *d, uint32_t *word) {
  float *bend = d->noise[0], *fine = d->noise[1], *strength = d->noise[2], *other = d->noise[3];
  const sheets septa[2] = {{6, 3.0f, 0.20f, 2.8f, 0.1f, 0.8f, {2, 1}},
                           {6, 2.4f, 0.18f, 2.4f, 0.1f, 0.8f, {-2, -1}}};
  const sheets second = {28, 0.57f, 0.16f, 0.7f, 0.3f, 0.65f, {0, 0}};
  const sheets upright = {8, 4, 0.35f, 1.0f, -0.1f, 0.6f, {0, 0}};
  draw_noise(d, bend, 9, 9, 5);
  draw_noise(d, fine, 15, 15, 8);
  for (uint32_t i = 0; i < VOXELS; ++i) bend[i] += 0.35f * fine[i];
  for (int k = 0; k < 2; ++k) {
    draw_noise(d, strength, 10, 10, 9);
    add_sheets(d->facing, &septa[k], bend, 0.2f, strength);
  }
  draw_noise(d, strength, 22, 22, 28);
  add_sheets(d->facing, &second, bend, 0.9f, strength);
  draw_noise(d, strength, 8, 8, 10);
  draw_noise(d, other, 16, 16, 16);
  add_upright(d->body, 0, &upright, other, 0.25f, strength);
  draw_noise(d, strength, 8, 8, 10);
  add_upright(d->body, 1, &upright, other, 0.25f, strength);
  draw_noise(d, fine, 26, 26, 40);
  for (uint32_t i = 0; i < VOXELS; ++i) d->body[i] += 0.13f * exp2f(0.5f * fine[i]);
  pack(d, word);
}

// Fascicles in 19.2 mm across x 51.2 mm along the fibres (y) x 16 mm: two generations of perimysium
// every 1.7 and 1.5 mm, which cross at 8 degrees along the fibres and 10 across, in patches 1.6 mm
// wide and 3 mm long; fine sheets every 0.62 mm, upright ones every 2.4 mm, bundles of 0.45 mm.
static void draw_muscle(draft *d, uint32_t *word) {
  float *bend = d->noise[0], *fine = d->noise[1], *strength = d->noise[2], *other = d->noise[3];
  const sheets perimysium[2] = {{10, 1.66f, 0.28f, 2.8f, 0.05f, 0.8f, {1, 2}},
                                {10, 1.54f, 0.26f, 2.6f, 0.05f, 0.8f, {-1, -2}}};
  const sheets second = {26, 0.62f, 0.22f, 0.7f, 0.3f, 0.55f, {0, 0}};
  const sheets upright = {8, 2.4f, 0.35f, 0.5f, 0.2f, 0.6f, {0, 0}};
  draw_noise(d, bend, 6, 12, 6);
  draw_noise(d, fine, 10, 12, 12);
  for (uint32_t i = 0; i < VOXELS; ++i) bend[i] += 0.4f * fine[i];
  for (int k = 0; k < 2; ++k) {
    draw_noise(d, strength, 9, 15, 12);
    add_sheets(d->facing, &perimysium[k], bend, 0.3f, strength);
  }
  draw_noise(d, strength, 22, 19, 26);
  add_sheets(d->facing, &second, bend, 0.8f, strength);
  draw_noise(d, strength, 9, 12, 12);
  draw_noise(d, other, 10, 5, 10);
  add_upright(d->body, 0, &upright, other, 0.3f, strength);
  draw_noise(d, fine, 26, 6, 38);
  draw_noise(d, other, 5, 5, 4);
  for (uint32_t i = 0; i < VOXELS; ++i) {
    const float slow = exp2f(0.45f * other[i]);
    d->body[i] = slow * (d->body[i] + 0.13f * exp2f(0.55f * fine[i])), d->facing[i] *= slow;
  }
  pack(d, word);
}

bool sonde_tiles_draw(uint32_t *fat, uint32_t *muscle) {
  SONDE_ASSERT(fat != NULL && muscle != NULL);
  void (*const draw[2])(draft *, uint32_t *) = {draw_fat, draw_muscle};
  for (int k = 0; k < 2; ++k) {
    draft *d = SONDE_NEW(draft, 1);
    if (d == NULL) return false;
    d->seed = 1000 * (uint64_t)(k + 1);
    draw[k](d, k == 0 ? fat : muscle);
    sonde_free(d);
  }
  return true;
}
