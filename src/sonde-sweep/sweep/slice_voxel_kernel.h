// Pixels of a picture from a volume; part of slice_kernel.c.
#ifndef SONDE_SRC_SWEEP_SLICE_VOXEL_KERNEL_H
#define SONDE_SRC_SWEEP_SLICE_VOXEL_KERNEL_H

#include "base/vector_records.h"
#include "sweep/slice_mix.h"

enum { LANES = SLICE_CELL_WIDE, CELL = SLICE_CELL_WIDE * SLICE_CELL_HIGH };

static const uint64_t NEAR_BYTES = 0x0000ffff0000ffffu;

// A cell on its way: which voxels, how far between them, and the eight greys of each pixel: of two
// neighbours along i in bytes 0 and 1, of those along j in 4 and 5; beyond them along k in 2, 3 and
// 6, 7.
typedef struct voxel_work {
  int32_t place[CELL];
  float t[3][CELL];
  int32_t inside[CELL]; // -1 or 0
  uint64_t near[CELL], far[CELL];
} voxel_work;

// Between corners that are.
static bool is_within(const slice_voxels *v, const float corners[4][3]) {
  for (int c = 0; c < 4; ++c)
    for (int k = 0; k < 3; ++k)
      if (!(corners[c][k] >= 0 && corners[c][k] <= (float)(v->size[k] - 1))) return false;
  return true;
}

// A row of a cell: places are bilinear between the corners.
INLINE void find_voxels(const slice_voxels *v, const floats start[3], const floats step[3],
                        float row, bool lines, bool checked, uint32_t first, voxel_work *w) {
  ints place = {0}, inside = vset_ints(-1);
  for (int k = 0; k < 3; ++k) {
    float high = (float)(v->size[k] - 1);
    floats at = start[k] + row * step[k];
    if (checked) {
      inside = inside & (at >= -SLACK) & (at <= high + SLACK);
      at = vmax(vmin(at, vset(high)), vset(0));
    }
    ints i = vint(vmin(at, vset(high - 1)));
    floats low = vreal(i);
    vstore(w->t[k] + first, at - low);
    if (lines) {
      ints line = vint((low + 0.5f) * (1.0f / (SLICE_BRICK - 1)));
      place += line * v->line_step[k] + (i << (2 * k)); // a brick is four voxels wide
    } else
      place += i * v->step[k];
  }
  memcpy(w->place + first, &place, sizeof place);
  if (checked) memcpy(w->inside + first, &inside, sizeof inside);
}

INLINE void find_cell(const slice_voxels *v, const float corners[4][3], uint32_t high, bool lines,
                      bool checked, voxel_work *w) {
  static const float lanes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  for (uint32_t x = 0; x < LANES; x += FLOATS) {
    floats share = vload(lanes + x) * (1.0f / SLICE_CELL_WIDE), start[3], step[3];
    for (int k = 0; k < 3; ++k) {
      start[k] = corners[0][k] + share * (corners[1][k] - corners[0][k]);
      floats end = corners[2][k] + share * (corners[3][k] - corners[2][k]);
      step[k] = (end - start[k]) * (1.0f / SLICE_CELL_HIGH);
    }
    if (checked)
      for (uint32_t y = 0; y < high; ++y)
        find_voxels(v, start, step, (float)y, lines, true, y * LANES + x, w);
    else
      for (uint32_t y = 0; y < high; ++y)
        find_voxels(v, start, step, (float)y, lines, false, y * LANES + x, w);
  }
}

// Plain loads: processors that guard gathers against leaks are slower at them.
INLINE void load_voxels(const slice_voxels *v, uint32_t count, voxel_work *w) {
  const uint8_t *voxels = v->voxels;
  size_t dy = (size_t)v->step[1], dz = (size_t)v->step[2];
  if (v->lines)
    for (uint32_t i = 0; i < count; i += 4)
      for (uint32_t x = i; x < i + 4; ++x) {
        const uint8_t *p = voxels + w->place[x];
        uint64_t both[2];
        memcpy(&both[0], p, sizeof both[0]);
        memcpy(&both[1], p + 4 * SLICE_BRICK - 2, sizeof both[1]);
        w->near[x] = both[0], w->far[x] = both[1];
      }
  else
    for (uint32_t i = 0; i < count; ++i) {
      const uint8_t *p = voxels + w->place[i], *q = p + dz;
      w->near[i] = two_greys(p) | two_greys(p + dy) << 32;
      w->far[i] = two_greys(q) << 16 | two_greys(q + dy) << 48;
    }
}

// Sum of the products of both halves of each lane, numbers with a sign.
INLINE ints sum_of_products(ints a, ints b) {
#if defined(__AVX512BW__)
  return (ints)_mm512_madd_epi16((__m512i)a, (__m512i)b);
#elif defined(__AVX2__)
  return (ints)_mm256_madd_epi16((__m256i)a, (__m256i)b);
#elif defined(__SSE2__)
  return (ints)_mm_madd_epi16((__m128i)a, (__m128i)b);
#else
  return (a << 16 >> 16) * (b << 16 >> 16) + (a >> 16) * (b >> 16);
#endif
}

// Along k in whole numbers, two greys of a lane at once; their sums are exact as floats.
INLINE void mix_voxels(const voxel_work *w, uint32_t first, uint8_t out[LANES]) {
  enum { ONE = 1 << 14, EVEN = 0x00ff00ff };
  const uint64_t *near = w->near + first, *far = w->far + first;
  int32_t low[LANES], high[LANES], value[LANES];
  for (int x = 0; x < LANES; ++x) {
    uint64_t both = (near[x] & NEAR_BYTES) | (far[x] & ~NEAR_BYTES);
    low[x] = (int32_t)(uint32_t)both, high[x] = (int32_t)(uint32_t)(both >> 32);
  }
  for (uint32_t x = 0; x < LANES; x += FLOATS) {
    ints a, b;
    memcpy(&a, low + x, sizeof a);
    memcpy(&b, high + x, sizeof b);
    floats t0 = vload(w->t[0] + first + x), t1 = vload(w->t[1] + first + x);
    ints t = vint(vload(w->t[2] + first + x) * ONE + 0.5f), share = (t << 16) - t + ONE;
    floats p = vreal(sum_of_products(a & EVEN, share)),
           q = vreal(sum_of_products(a >> 8 & EVEN, share));
    floats r = vreal(sum_of_products(b & EVEN, share)),
           s = vreal(sum_of_products(b >> 8 & EVEN, share));
    floats top = p + t0 * (q - p), under = r + t0 * (s - r);
    ints grey = vint((top + t1 * (under - top)) * (1.0f / ONE) + 0.5f);
    memcpy(value + x, &grey, sizeof grey);
  }
  for (int x = 0; x < LANES; ++x) out[x] = (uint8_t)value[x];
}

// A cell of the picture between four corners, at which the places in the volume are known. Pixels
// beyond the picture are worked out and dropped.
static uint64_t voxel_cell(const slice_voxels *v, const float corners[4][3], uint32_t column,
                           uint32_t row) {
  uint32_t wide = at_most(SLICE_CELL_WIDE, v->image->width - column);
  uint32_t high = at_most(SLICE_CELL_HIGH, v->image->height - row);
  bool within = is_within(v, corners);
  voxel_work w;
  if (v->lines)
    find_cell(v, corners, high, true, !within, &w);
  else
    find_cell(v, corners, high, false, !within, &w);
  load_voxels(v, high * LANES, &w);
  uint64_t reached = within ? (uint64_t)wide * high : 0;
  for (uint32_t y = 0; y < high; ++y) {
    uint8_t grey[LANES];
    mix_voxels(&w, y * LANES, grey);
    size_t at = (size_t)(row + y) * v->image->width + column;
    for (uint32_t x = 0; x < LANES && !within; ++x) {
      int32_t inside = w.inside[y * LANES + x];
      grey[x] &= (uint8_t)inside;
      reached += x < wide && inside;
    }
    if (wide == LANES)
      memcpy(v->image->pixels + at, grey, LANES);
    else
      memcpy(v->image->pixels + at, grey, wide);
    for (uint32_t x = 0; v->known && x < wide; ++x)
      v->known[at + x] = within || w.inside[y * LANES + x];
  }
  return reached;
}

#endif
