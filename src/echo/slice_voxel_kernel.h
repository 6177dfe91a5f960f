// Pixels of a picture from a volume; part of slice_kernel.c.
//
// find_voxels       places of a row of a cell
// load_voxels       the eight greys around each
// mix_voxels        trilinear
// voxel_cell
#ifndef SONDE_SRC_ECHO_SLICE_VOXEL_KERNEL_H
#define SONDE_SRC_ECHO_SLICE_VOXEL_KERNEL_H

#include "echo/slice_mix.h"

enum { LANES = 16 }; // pixels at a time

// A cell on its way: which voxels, how far between them, and the eight greys of each pixel. Loops
// over a row of 16 pixels are plain, for the compiler to take as many at a time as there is room.
typedef struct voxel_work {
  int32_t base[SLICE_CELL_HIGH][LANES];
  float t[SLICE_CELL_HIGH][3][LANES];
  uint32_t inside[SLICE_CELL_HIGH][LANES]; // 1 or 0
  uint64_t greys[SLICE_CELL_HIGH][LANES];
} voxel_work;

INLINE void find_voxels(const slice_voxels *v, const float start[3], const float step[3],
                        uint32_t y, voxel_work *w) {
  int32_t stride[3] = {1, (int32_t)v->size[0], (int32_t)(v->size[0] * v->size[1])};
  for (int x = 0; x < LANES; ++x) w->base[y][x] = 0, w->inside[y][x] = 1;
  for (int k = 0; k < 3; ++k) {
    int32_t last = (int32_t)v->size[k] - 2;
    float high = (float)(v->size[k] - 1);
    for (int x = 0; x < LANES; ++x) {
      float at = start[k] + (float)x * step[k], in = bound(at, 0, high);
      int32_t i = (int32_t)in;
      i = i > last ? last : i;
      w->inside[y][x] &= (uint32_t)((at >= -SLACK) & (at <= high + SLACK));
      w->t[y][k][x] = in - (float)i;
      w->base[y][x] += i * stride[k];
    }
  }
}

// Plain loads: processors that guard gathers against leaks are slower at them.
INLINE void load_voxels(const slice_voxels *v, uint32_t rows, voxel_work *w) {
  size_t dy = v->size[0], dz = dy * v->size[1];
  for (uint32_t y = 0; y < rows; ++y)
    for (int x = 0; x < LANES; ++x) {
      const uint8_t *p = v->voxels + w->base[y][x];
      w->greys[y][x] = two_greys(p) | two_greys(p + dy) << 16 | two_greys(p + dz) << 32 |
                       two_greys(p + dz + dy) << 48;
    }
}

INLINE void mix_voxels(const voxel_work *w, uint32_t y, uint8_t out[LANES]) {
  const float(*t)[LANES] = w->t[y];
  int32_t value[LANES];
  for (int x = 0; x < LANES; ++x) {
    float near = mix_sheet((uint32_t)w->greys[y][x], t[0][x], t[1][x]);
    float far = mix_sheet((uint32_t)(w->greys[y][x] >> 32), t[0][x], t[1][x]);
    value[x] = (int32_t)(near + t[2][x] * (far - near) + 0.5f) * (int32_t)w->inside[y][x];
  }
  for (int x = 0; x < LANES; ++x) out[x] = (uint8_t)value[x];
}

// A cell of the picture between four corners, at which the places in the volume are known. Pixels
// beyond the picture are worked out and dropped.
static uint64_t voxel_cell(const slice_voxels *v, const float corners[4][3], uint32_t column,
                           uint32_t row) {
  uint32_t wide = at_most(SLICE_CELL_WIDE, v->image->width - column);
  uint32_t high = at_most(SLICE_CELL_HIGH, v->image->height - row);
  voxel_work w;
  for (uint32_t y = 0; y < high; ++y) {
    float start[3], step[3], t = (float)y * (1.0f / SLICE_CELL_HIGH);
    for (int k = 0; k < 3; ++k) {
      start[k] = corners[0][k] + t * (corners[2][k] - corners[0][k]);
      float end = corners[1][k] + t * (corners[3][k] - corners[1][k]);
      step[k] = (end - start[k]) * (1.0f / SLICE_CELL_WIDE);
    }
    find_voxels(v, start, step, y, &w);
  }
  load_voxels(v, high, &w);
  uint64_t reached = 0;
  for (uint32_t y = 0; y < high; ++y) {
    uint8_t grey[LANES];
    mix_voxels(&w, y, grey);
    size_t at = (size_t)(row + y) * v->image->width + column;
    memcpy(v->image->pixels + at, grey, wide);
    for (uint32_t x = 0; x < wide; ++x) reached += w.inside[y][x];
    for (uint32_t x = 0; x < wide && v->known; ++x) v->known[at + x] = (uint8_t)w.inside[y][x];
  }
  return reached;
}

#endif
