// Pixels of a tile by its strips: part of slice_kernel.c.
//
// mix_apart, mix_row_of bilinear, then between both frames
#ifndef SONDE_SRC_SWEEP_SLICE_STRIP_KERNEL_H
#define SONDE_SRC_SWEEP_SLICE_STRIP_KERNEL_H

#include "sweep/slice_strips.h"

typedef struct strip_work {
  int32_t met[TILE_PIXELS]; // -1 where the strip speaks
  int32_t offset[2][TILE_PIXELS];
  float share[2][2][TILE_PIXELS], t[TILE_PIXELS];
  uint64_t greys[2][TILE_PIXELS]; // bytes 0, 1 and below them 6, 7
} strip_work;

// Lanes of a table by their index.
INLINE ints look_up(const void *table, ints index) {
#if defined(__AVX512F__)
  return (ints)_mm512_permutexvar_epi32((__m512i)index, _mm512_loadu_si512(table));
#elif defined(__AVX2__)
  const __m256i *half = table;
  __m256i low = _mm256_loadu_si256(half), high = _mm256_loadu_si256(half + 1);
  low = _mm256_permutevar8x32_epi32(low, (__m256i)index);
  high = _mm256_permutevar8x32_epi32(high, (__m256i)index);
  return vselect(index > 7, (ints)high, (ints)low);
#else
  const int32_t *from = table;
  ints to;
  for (int x = 0; x < FLOATS; ++x) to[x] = from[index[x]];
  return to;
#endif
}

INLINE ints find_index(const strip_table *table, floats x, float y) {
  ints index = {0};
  for (uint32_t k = 0; k + 1 < table->count; ++k)
    index -= table->at[4][k] + y * table->row[4][k] + x * table->column[4][k] < 0;
  return index;
}

INLINE void locate_pixels(const sonde_slicer *s, floats u, floats v, ints frame, int side,
                          uint32_t first, strip_work *w) {
  float wide = s->high[0] - s->low[0], high = s->high[1] - s->low[1];
  ints i = vint(vmin(u, vset(wide - 1))), j = vint(vmin(v, vset(high - 1)));
  floats left = vreal(i), top = vreal(j);
  ints p = vint((left + 0.5f) * (1.0f / (SLICE_LINE_WIDE - 1)));
  ints q = vint((top + 0.5f) * (1.0f / (SLICE_LINE_HIGH - 1)));
  ints offset = frame + i + p * s->layout.column_line + j * s->layout.row + q * s->layout.row_line;
  memcpy(w->offset[side] + first, &offset, sizeof offset);
  vstore(w->share[side][0] + first, u - left);
  vstore(w->share[side][1] + first, v - top);
}

// Pixels for which the strip speaks; the others' numbers become harmless.
INLINE ints check(const sonde_slicer *s, const strip_table *table, floats value[SLICE_FORMS]) {
  ints hit = (value[4] >= 0) & (value[5] > 0) & (value[4] + value[5] <= (float)s->options.gap_m);
  for (int k = 0; k < 4; ++k)
    hit = hit & (value[k] >= table->low[k & 1]) & (value[k] <= table->high[k & 1]);
  for (int k = 0; k < 4; ++k)
    value[k] = vmax(vmin(value[k], vset(s->high[k & 1] - s->low[k & 1])), vset(0));
  value[4] = vonly(hit, value[4]), value[5] = vselect(hit, value[5], vset(1));
  return hit;
}

// A row of a tile.
INLINE void locate_row(const sonde_slicer *s, const strip_table *table, bool checked, float row,
                       uint32_t first, strip_work *w) {
  static const float lanes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  float starts[SLICE_FORMS][STRIPS];
  for (int f = 0; f < SLICE_FORMS; ++f)
    for (int k = 0; k < STRIPS; k += FLOATS)
      vstore(starts[f] + k, vload(table->at[f] + k) + row * vload(table->row[f] + k));
  for (uint32_t k = 0; k < SLICE_TILE; k += FLOATS) {
    floats x = vload(lanes + k), value[SLICE_FORMS];
    ints index = find_index(table, x, row);
    for (int f = 0; f < SLICE_FORMS; ++f)
      value[f] = (floats)look_up(starts[f], index) + x * (floats)look_up(table->column[f], index);
    if (checked) {
      ints met = check(s, table, value);
      memcpy(w->met + first + k, &met, sizeof met);
    }
    vstore(w->t + first + k, value[4] / (value[4] + value[5]));
    for (int side = 0; side < 2; ++side)
      locate_pixels(s, value[2 * side], value[2 * side + 1], look_up(table->frame[side], index),
                    side, first + k, w);
  }
}

// Pixels around many places: many loads are under way at once.
static void load_greys(const slice_layout *layout, uint32_t count, strip_work *w) {
  const uint8_t *pixels = layout->pixels;
  size_t row = (size_t)layout->row;
  for (int side = 0; side < 2; ++side) {
    const int32_t *offset = w->offset[side];
    uint64_t *greys = w->greys[side];
    for (uint32_t i = 0; layout->lines && i < count; i += 8)
      for (uint32_t k = 0; k < 8; ++k) memcpy(&greys[i + k], pixels + offset[i + k], sizeof *greys);
    for (uint32_t i = 0; !layout->lines && i < count; ++i) {
      const uint8_t *p = pixels + offset[i];
      greys[i] = two_greys(p) | two_greys(p + row) << 48;
    }
  }
}

// Most lines of memory that a row will read.
INLINE void ask_for(const slice_layout *layout, const strip_work *w, uint32_t first) {
  for (uint32_t x = 0; x < SLICE_TILE; x += 4)
    for (int side = 0; side < 2; ++side)
      __builtin_prefetch(layout->pixels + w->offset[side][first + x]);
}

static void locate_tile(const sonde_slicer *s, const strip_table *table, uint32_t high,
                        strip_work *w) {
  for (uint32_t y = 0; y < high; ++y) {
    if (table->whole)
      locate_row(s, table, false, (float)y, y * SLICE_TILE, w);
    else
      locate_row(s, table, true, (float)y, y * SLICE_TILE, w);
    ask_for(&s->layout, w, y * SLICE_TILE);
  }
  load_greys(&s->layout, high * SLICE_TILE, w);
}

// Four greys of which two stand in bytes 0 and 1, two in 6 and 7.
INLINE float mix_apart(uint64_t greys, float t0, float t1) {
  uint32_t high = (uint32_t)greys, low = (uint32_t)(greys >> 32);
  return mix_four(grey_of(high, 0), grey_of(high, 1), grey_of(low, 2), grey_of(low, 3), t0, t1);
}

INLINE void mix_row_of(const strip_work *w, uint32_t first, uint8_t grey[SLICE_TILE]) {
  const uint64_t *behind = w->greys[0] + first, *front = w->greys[1] + first;
  const float *a = w->share[0][0] + first, *b = w->share[0][1] + first;
  const float *c = w->share[1][0] + first, *d = w->share[1][1] + first, *t = w->t + first;
  int32_t value[SLICE_TILE];
  for (int x = 0; x < SLICE_TILE; ++x) {
    float near = mix_apart(behind[x], a[x], b[x]), far = mix_apart(front[x], c[x], d[x]);
    value[x] = (int32_t)(near + (far - near) * t[x] + 0.5f);
  }
  for (int x = 0; x < SLICE_TILE; ++x) grey[x] = (uint8_t)value[x];
}

static inline uint32_t put_row(const sonde_slicer *s, size_t at, uint32_t wide,
                               const uint8_t grey[SLICE_TILE], bool known) {
  if (wide == SLICE_TILE)
    memcpy(s->image->pixels + at, grey, SLICE_TILE);
  else
    memcpy(s->image->pixels + at, grey, wide);
  if (s->known) memset(s->known + at, known, wide);
  return wide;
}

// A tile that strips cover, or a black one without.
static uint64_t fill_evenly(const sonde_slicer *s, const rectangle *r, const strip_work *strips) {
  uint64_t reached = 0;
  for (uint32_t y = 0; y < r->high; ++y) {
    uint8_t grey[SLICE_TILE] = {0};
    if (strips) mix_row_of(strips, y * SLICE_TILE, grey);
    reached += put_row(s, (size_t)(r->row + y) * s->image->width + r->column, r->wide, grey,
                       strips != NULL);
  }
  return strips ? reached : 0;
}

#endif
