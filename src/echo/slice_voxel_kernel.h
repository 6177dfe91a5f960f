// Pixels of a picture from a volume; part of slice_kernel.c.
//
// is_within         a cell whose pixels all lie in the volume
// find_voxels       places of a row of a cell
// load_voxels       the eight greys around each
// mix_voxels        trilinear
// voxel_cell
#ifndef SONDE_SRC_ECHO_SLICE_VOXEL_KERNEL_H
#define SONDE_SRC_ECHO_SLICE_VOXEL_KERNEL_H

#include "echo/kernel_vector.h"
#include "echo/slice_mix.h"

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

INLINE void find_voxels(const slice_voxels *v, const float start[3], const float step[3],
                        bool checked, uint32_t first, voxel_work *w) {
  static const float lanes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  for (uint32_t x = 0; x < LANES; x += W) {
    vi place = {0}, inside = all_of(-1);
    for (int k = 0; k < 3; ++k) {
      float high = (float)(v->size[k] - 1);
      vf at = start[k] + load(lanes + x) * step[k];
      if (checked) {
        inside = inside & (at >= -SLACK) & (at <= high + SLACK);
        at = at_least_of(at_most_of(at, high), 0);
      }
      vi i = whole(at_most_of(at, high - 1));
      vf t = at - real(i);
      store(w->t[k] + first + x, t);
      if (v->lines) {
        vi line = whole((real(i) + 0.5f) * (1.0f / (SLICE_BRICK - 1)));
        place += line * v->line_step[k];
      }
      place += i * v->step[k];
    }
    memcpy(w->place + first + x, &place, sizeof place);
    if (checked) memcpy(w->inside + first + x, &inside, sizeof inside);
  }
}

// Plain loads: processors that guard gathers against leaks are slower at them.
INLINE void load_voxels(const slice_voxels *v, uint32_t count, voxel_work *w) {
  const uint8_t *voxels = v->voxels;
  size_t dy = (size_t)v->step[1], dz = (size_t)v->step[2];
  if (v->lines)
    for (uint32_t i = 0; i < count; i += LANES)
      for (uint32_t x = 0; x < LANES; ++x) {
        const uint8_t *p = voxels + w->place[i + x];
        memcpy(&w->near[i + x], p, sizeof *w->near);
        memcpy(&w->far[i + x], p + dz - 2, sizeof *w->far);
      }
  else
    for (uint32_t i = 0; i < count; ++i) {
      const uint8_t *p = voxels + w->place[i], *q = p + dz;
      w->near[i] = two_greys(p) | two_greys(p + dy) << 32;
      w->far[i] = two_greys(q) << 16 | two_greys(q + dy) << 48;
    }
}

INLINE void mix_voxels(const voxel_work *w, uint32_t first, uint8_t out[LANES]) {
  const uint64_t *near = w->near + first, *far = w->far + first;
  const float *t0 = w->t[0] + first, *t1 = w->t[1] + first, *t2 = w->t[2] + first;
  int32_t value[LANES];
  for (int x = 0; x < LANES; ++x) {
    uint64_t both = (near[x] & NEAR_BYTES) | (far[x] & ~NEAR_BYTES);
    uint32_t low = (uint32_t)both, high = (uint32_t)(both >> 32);
    float a = grey_of(low, 0), b = grey_of(high, 0), c = grey_of(low, 2), d = grey_of(high, 2);
    a = a + t0[x] * (grey_of(low, 1) - a), b = b + t0[x] * (grey_of(high, 1) - b);
    c = c + t0[x] * (grey_of(low, 3) - c), d = d + t0[x] * (grey_of(high, 3) - d);
    float close = a + t1[x] * (b - a), beyond = c + t1[x] * (d - c);
    value[x] = (int32_t)(close + t2[x] * (beyond - close) + 0.5f);
  }
  for (int x = 0; x < LANES; ++x) out[x] = (uint8_t)value[x];
}

// Asks for most lines of memory that a row will read.
INLINE void ask_for_voxels(const slice_voxels *v, const voxel_work *w, uint32_t first) {
  for (uint32_t x = 0; x < LANES; x += 4) __builtin_prefetch(v->voxels + w->place[first + x]);
}

static void find_cell(const slice_voxels *v, const float corners[4][3], uint32_t high, bool checked,
                      voxel_work *w) {
  for (uint32_t y = 0; y < high; ++y) {
    float start[3], step[3], t = (float)y * (1.0f / SLICE_CELL_HIGH);
    for (int k = 0; k < 3; ++k) {
      start[k] = corners[0][k] + t * (corners[2][k] - corners[0][k]);
      float end = corners[1][k] + t * (corners[3][k] - corners[1][k]);
      step[k] = (end - start[k]) * (1.0f / SLICE_CELL_WIDE);
    }
    if (checked)
      find_voxels(v, start, step, true, y * LANES, w);
    else
      find_voxels(v, start, step, false, y * LANES, w);
    if (v->lines) ask_for_voxels(v, w, y * LANES);
  }
}

// A cell of the picture between four corners, at which the places in the volume are known. Pixels
// beyond the picture are worked out and dropped.
static uint64_t voxel_cell(const slice_voxels *v, const float corners[4][3], uint32_t column,
                           uint32_t row) {
  uint32_t wide = at_most(SLICE_CELL_WIDE, v->image->width - column);
  uint32_t high = at_most(SLICE_CELL_HIGH, v->image->height - row);
  bool within = is_within(v, corners);
  voxel_work w;
  find_cell(v, corners, high, !within, &w);
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
    memcpy(v->image->pixels + at, grey, wide);
    for (uint32_t x = 0; x < wide && v->known; ++x)
      v->known[at + x] = within || w.inside[y * LANES + x];
  }
  return reached;
}

#endif
