// Textures in tissue coordinates: angle around the leg, length along it, depth below the skin.
// Included by kernel_tissue.h only.
#ifndef SONDE_SRC_ECHO_KERNEL_TEXTURE_H
#define SONDE_SRC_ECHO_KERNEL_TEXTURE_H

#include "base/vector_records.h"
#include "echo/kernel.h"

enum { TURNS_MUSCLE = 90, TURNS_FAT = 60 }; // noise cells around the leg

// cos and sin of 2 pi t for t >= 0, error 3e-4.
INLINE void turn(floats t, floats *c, floats *s) {
  floats f = t - vreal(vint(t + 0.5f)), u = f * f;
  *c = 0.9999590208378121f +
       u * (-19.73094236686188f +
            u * (64.6714417761651f + u * (-82.39080631177367f + u * 45.62105110286211f)));
  *s = f * (6.282137314937016f +
            u * (-41.205783568541634f + u * (78.82674122450844f + u * -58.13524213160963f)));
}

// 2^a for |a| < 120, relative error 1e-7.
INLINE floats power2(floats a) {
  floats i = vfloor(a), t = a - i;
  floats p = 0.0558632826591662f + t * (0.00894621466647436f + t * 0.0018951072909317184f);
  p = 0.9999998957631335f + t * (0.693154620003299f + t * (0.24014077009185858f + t * p));
  return (floats)((ints)p + (vint(i) << 23));
}

// A field of the plane between two coarse rows.
INLINE floats field_at(const tissue_job *job, uint32_t at) {
  const floats top = vload(job->top + at);
  return top + job->share * (vload(job->low + at) - top);
}

typedef uint32_t uints __attribute__((vector_size(VECTOR_BYTES)));

INLINE floats cell_value(uints a, uints b, uints c) {
  uints h = a ^ b ^ c;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  h = (h ^ (h >> 15)) >> 8;
  return vreal((ints)h) * (2.0f / 16777216.0f) - 1;
}

INLINE floats smooth(floats t) { return t * t * (3 - 2 * t); }
INLINE ints wrap(ints i, int32_t n) {
  i += (i < 0) & n, i += (i < 0) & n;
  i -= (i >= n) & n;
  return i - ((i >= n) & n);
}

// Lattice cells of one texture in which the lines were when it was last asked for, and the values
// at their corners: from row to row most of them stay.
typedef struct knots {
  ints a, b, c;
  floats corner[8];
} knots;

_Static_assert(sizeof(knots) == KNOT_FLOATS * sizeof(floats), "room for each line");

INLINE void find_corners(knots *k, int32_t turns) {
  uints a = (uints)k->a * 0x9e3779b1u, a1 = (uints)wrap(k->a + 1, turns) * 0x9e3779b1u;
  uints b = (uints)k->b * 0x85ebca77u, b1 = b + 0x85ebca77u;
  uints c = (uints)k->c * 0xc2b2ae3du, c1 = c + 0xc2b2ae3du;
  k->corner[0] = cell_value(a, b, c), k->corner[1] = cell_value(a1, b, c);
  k->corner[2] = cell_value(a, b1, c), k->corner[3] = cell_value(a1, b1, c);
  k->corner[4] = cell_value(a, b, c1), k->corner[5] = cell_value(a1, b, c1);
  k->corner[6] = cell_value(a, b1, c1), k->corner[7] = cell_value(a1, b1, c1);
}

// Value noise in [-1, 1]; periodic around the leg with `turns` cells. A salt belongs to one
// texture.
INLINE floats texture(knots *memory, floats theta, floats along, floats depth, int32_t turns,
                      int32_t salt) {
  knots *k = memory + salt;
  floats u = theta * ((float)turns * 0.159154943f);
  floats fu = vfloor(u), fv = vfloor(along), fw = vfloor(depth);
  ints a = wrap(vint(fu), turns), b = vint(fv) + 1000 * salt, c = vint(fw);
  if (vany((a != k->a) | (b != k->b) | (c != k->c))) {
    k->a = a, k->b = b, k->c = c;
    find_corners(k, turns);
  }
  floats tu = smooth(u - fu), tv = smooth(along - fv), tw = smooth(depth - fw);
  const floats *at = k->corner;
  floats p = at[0] + tu * (at[1] - at[0]), q = at[2] + tu * (at[3] - at[2]);
  floats r = at[4] + tu * (at[5] - at[4]), s = at[6] + tu * (at[7] - at[6]);
  p += tv * (q - p), r += tv * (s - r);
  return p + tw * (r - p);
}

// Bright sheets at whole values of `layer`, thin over `share` of the spacing.
INLINE floats sheet(floats layer, float share) {
  floats away = vabs(layer - vfloor(layer) - 0.5f) * 2; // 1 on the sheet, 0 half-way
  floats height = vmax((away - 1 + share) / share, vset(0));
  return height * height;
}

// Amplitudes of a tile's voxel: of sheets when the beam meets them squarely, of all else there.
typedef struct tile_grain {
  floats facing, body;
} tile_grain;

// Both amplitudes of a voxel and of the next one along x.
INLINE tile_grain tile_pair(const uint32_t *tile, ints at, floats t) {
  ints w = (ints)vgather((const float *)(const void *)tile, at);
  floats a = vreal(w & 255), b = vreal((w >> 16) & 255);
  return (tile_grain){a + t * (vreal((w >> 8) & 255) - a), b + t * (vreal((w >> 24) & 255) - b)};
}

// A tile at a place in voxels, periodic.
INLINE tile_grain tile_at(const uint32_t *tile, floats x, floats y, floats z) {
  enum { SIDE = SONDE_TILE_SIDE, LAST = SIDE - 1 };
  x -= SONDE_TILE_SHEAR * z;
  floats fx = vfloor(x), fy = vfloor(y), fz = vfloor(z);
  ints i = vint(fx) & LAST, j = vint(fy), k = vint(fz);
  ints j0 = (j & LAST) * SIDE + i, j1 = ((j + 1) & LAST) * SIDE + i;
  ints k0 = (k & LAST) * (SIDE * SIDE), k1 = ((k + 1) & LAST) * (SIDE * SIDE);
  floats tx = x - fx, ty = y - fy, tz = z - fz;
  tile_grain p = tile_pair(tile, k0 + j0, tx), q = tile_pair(tile, k0 + j1, tx);
  tile_grain r = tile_pair(tile, k1 + j0, tx), s = tile_pair(tile, k1 + j1, tx);
  p.facing += ty * (q.facing - p.facing), p.body += ty * (q.body - p.body);
  r.facing += ty * (s.facing - r.facing), r.body += ty * (s.body - r.body);
  const float unit = 1 / SONDE_TILE_STEPS;
  return (tile_grain){unit * (p.facing + tz * (r.facing - p.facing)),
                      unit * (p.body + tz * (r.body - p.body))};
}

// Fat's tile by angle, length and depth: 15 tiles around the leg, of 32 mm along it and 16 mm down.
INLINE tile_grain fat_grain(const uint32_t *tile, floats theta, floats s, floats depth) {
  const float around = 15 * SONDE_TILE_SIDE * 0.159154943f;
  return tile_at(tile, theta * around, s * 2000, depth * 4000);
}

// The nearest of the septa between large lobules: signed distance along the depth, m, and strength.
typedef struct septum {
  floats away, size;
} septum;

// Sheets every 2.2 mm along the skin, bent over 4 to 6 mm; each has patches of its own.
INLINE septum septum_at(knots *memory, floats theta, floats s, floats depth) {
  const float per_m = 450;
  floats bend = texture(memory, theta, s * 160, depth * 300, 2 * TURNS_FAT, 14);
  floats w = depth * per_m + 0.6f * bend, nearest = vfloor(w + 0.5f);
  floats patch = texture(memory, theta, s * 280, nearest + 0.5f, 3 * TURNS_FAT, 0);
  return (septum){(w - nearest) * (1 / per_m),
                  vmin(vmax(0.15f + 1.6f * patch, vset(0)), vset(1.2f))};
}

// Oedema: fluid in clefts around lobules of 6 by 8 mm, 0..1.
INLINE floats clefts(knots *memory, floats theta, floats s, floats depth, float oedema) {
  floats bend = texture(memory, theta, s * 70, depth * 250, TURNS_FAT, 1);
  floats sway = texture(memory, theta, s * 60, depth * 160, TURNS_FAT, 8);
  float share = 0.12f + 0.2f * oedema;
  floats along = sheet(depth * 170 + 0.9f * bend, share);
  floats across = sheet(theta * (TURNS_FAT * 0.159154943f) + depth * 40 + 0.8f * sway, share);
  floats deep = vmin(vmax(along, across) * 3, vset(1));
  return deep * (oedema < 0.5f ? 2 * oedema : 1);
}

// Bright bands along the flow in a clot that has been there for long.
INLINE floats webs(knots *memory, floats theta, floats s, floats depth, floats along) {
  floats bend = texture(memory, theta, s * 90, depth * 400, 2 * TURNS_FAT, 9);
  floats strength = texture(memory, theta, s * 110, depth * 500, 2 * TURNS_FAT, 10);
  return 2.6f * sheet(along * 1.2f + 0.7f * bend, 0.4f) * (0.8f + 0.6f * strength);
}

// Connective tissue within half a millimetre of the fascia.
INLINE floats fascia(knots *memory, floats theta, floats s, floats away) {
  floats patch = texture(memory, theta, s * 120, vset(0.5f), 2 * TURNS_FAT, 7);
  floats height = vmax(1 - vabs(away) * (1 / 0.7e-3f), vset(0));
  return height * (1.6f + 0.9f * patch);
}

#endif
