// Between frames that follow each other: part of slice_kernel.c.
//
// Where the planes of a block do not cross, those sorted by distance cut the picture into strips.
// Within a strip the same two frames lie on either side, and everything that a pixel needs is
// linear: the distances and the points on both frames. A tile's strips stand in a table, a strip
// in a lane. The number of planes in front of a pixel is its strip, and one permutation fetches a
// number for 16 pixels. Pixels whose frames might end nearby are left to the full search.
//
// sort_planes       by distance at the block's middle
// are_ordered       planes that nowhere come closer than a micrometre
// shift_between     direction that joins two planes
// make_strip        what is linear between two planes
// strips_cover      every line meets both frames well within
// find_strips       of a block
// count_planes      in front of all and of some of a tile's pixels
// widest            distance of two planes
// fill_lanes, find_limits, fill_table        a tile's strips
// look_up           a number of 16 pixels' strips
// find_index        the strip of each pixel of a row
// place_pixels      where in the frame, and how far between its pixels
// check             pixels for which the strip speaks
// place_row         a row of a tile
// ask_for, load_greys        four pixels of a frame around each place
// place_tile
// mix_apart         bilinear
// mix_row_of
// put_row
// fill_evenly       a tile that strips cover, or none
#ifndef SONDE_SRC_ECHO_SLICE_STRIPS_H
#define SONDE_SRC_ECHO_SLICE_STRIPS_H

#include "echo/kernel_vector.h"
#include "echo/slice_mix.h"

enum { STRIPS = SLICE_STRIPS, TILE_PIXELS = SLICE_TILE * SLICE_TILE };

// Numbers of a tile's strips at its first pixel, and per column and row. Columns and rows of the
// frames count from the used part.
typedef struct strip_table {
  float at[SLICE_FORMS][STRIPS], column[SLICE_FORMS][STRIPS], row[SLICE_FORMS][STRIPS];
  int32_t frame[2][STRIPS]; // of the layout: behind and in front
  float low[2], high[2];    // lines that meet both frames here start from a foot on both
  uint32_t count;
  bool whole; // the strips speak for all pixels
} strip_table;

typedef struct strip_work {
  int32_t met[TILE_PIXELS]; // -1 where the strip speaks
  int32_t place[2][TILE_PIXELS];
  float share[2][2][TILE_PIXELS], t[TILE_PIXELS];
  uint64_t greys[2][TILE_PIXELS]; // bytes 0, 1 and below them 6, 7
} strip_work;

// Forwards or backwards along the sweep is sorted already.
static void sort_planes(const rectangle *r, const slice_plane **planes, uint32_t count,
                        double *keys) {
  for (uint32_t i = 0; i < count; ++i) {
    bounds d = span(planes[i]->forms.d, r);
    keys[i] = d.low + d.high;
  }
  bool backwards = keys[0] > keys[count - 1];
  for (uint32_t a = 0, b = count - 1; backwards && a < b; ++a, --b) {
    const slice_plane *plane = planes[a];
    double key = keys[a];
    planes[a] = planes[b], planes[b] = plane;
    keys[a] = keys[b], keys[b] = key;
  }
  for (uint32_t i = 1; i < count; ++i) {
    const slice_plane *plane = planes[i];
    double key = keys[i];
    uint32_t k = i;
    for (; k && keys[k - 1] > key; --k) keys[k] = keys[k - 1], planes[k] = planes[k - 1];
    keys[k] = key, planes[k] = plane;
  }
}

static bool are_ordered(const rectangle *r, const slice_plane *const *planes, uint32_t count) {
  for (uint32_t i = 0; i + 1 < count; ++i) {
    const double *a = planes[i]->forms.d, *b = planes[i + 1]->forms.d;
    if (span((const double[3]){b[0] - a[0], b[1] - a[1], b[2] - a[2]}, r).low < 1e-6) return false;
  }
  return true;
}

static void shift_between(const slice_plane *a, const slice_plane *b, float shift[2]) {
  if (b == a + 1)
    memcpy(shift, a->next_shift, sizeof a->next_shift);
  else if (a == b + 1)
    memcpy(shift, a->last_shift, sizeof a->last_shift);
  else
    slice_shift(a, b, shift);
}

static void make_strip(const slice_plane *front, const slice_plane *behind, uint32_t i,
                       slice_strips *strips) {
  float behind_shift[2], front_shift[2];
  shift_between(behind, front, behind_shift);
  shift_between(front, behind, front_shift);
  strips->place[0][i] = behind->place, strips->place[1][i] = front->place;
  for (int k = 0; k < 3; ++k) {
    double a = behind->forms.d[k], b = -front->forms.d[k];
    strips->forms[0][k][i] = behind->forms.u[k] - a * (double)behind_shift[0];
    strips->forms[1][k][i] = behind->forms.v[k] - a * (double)behind_shift[1];
    strips->forms[2][k][i] = front->forms.u[k] + b * (double)front_shift[0];
    strips->forms[3][k][i] = front->forms.v[k] + b * (double)front_shift[1];
    strips->forms[4][k][i] = a;
    strips->forms[5][k][i] = b;
  }
  for (int f = 0; f < SLICE_FORMS; ++f)
    for (int k = 0; k < 2; ++k) strips->steps[f][k][i] = (float)strips->forms[f][k + 1][i];
  for (int k = 0; k < 2; ++k) {
    double a = fabs((double)behind_shift[k]), b = fabs((double)front_shift[k]);
    strips->lean[k][i] = a > b ? a : b;
  }
}

// Largest distance of both planes of a strip from each other.
static double widest(const slice_strips *s, uint32_t i, const rectangle *r) {
  double gap[3];
  for (int k = 0; k < 3; ++k) gap[k] = s->forms[4][k][i] + s->forms[5][k][i];
  return span(gap, r).high;
}

// Also that the frames are near enough to be joined.
static bool strips_cover(const sonde_slicer *s, const rectangle *r, const slice_strips *strips,
                         uint32_t first, uint32_t last) {
  for (uint32_t i = first; i < last; ++i) {
    double most = widest(strips, i, r);
    if (most > s->options.gap_m) return false;
    for (int f = 0; f < 4; ++f) {
      double *const *form = strips->forms[f];
      bounds b = span((const double[3]){form[0][i], form[1][i], form[2][i]}, r);
      double margin = most * strips->lean[f & 1][i] - 0.1 * (double)SLACK; // unbounded later
      if (b.low < (double)s->low[f & 1] + margin || b.high > (double)s->high[f & 1] - margin)
        return false;
    }
  }
  return true;
}

// Sorts the block's planes; none when they cross.
static void find_strips(const sonde_slicer *s, const rectangle *r, uint32_t count,
                        slice_room *room) {
  slice_strips *strips = &room->strips;
  strips->count = 0;
  if (!s->has_strips || count < 2) return;
  sort_planes(r, room->block, count, room->spans.low);
  if (!are_ordered(r, room->block, count)) return;
  strips->count = count - 1;
  for (uint32_t i = 0; i + 1 < count; ++i)
    make_strip(room->block[i], room->block[i + 1], i, strips);
  room->covered = strips_cover(s, r, strips, 0, count - 1);
}

// Planes that are in front of (d < 0) all, and of some, of a tile's pixels.
static void count_planes(const slice_room *room, uint32_t count[2]) {
  count[0] = count[1] = 0;
  for (uint32_t i = 0; i <= room->strips.count; ++i) {
    count[0] += room->spans.high[i] < 0;
    count[1] += room->spans.low[i] < 0;
  }
}

static void fill_lanes(const sonde_slicer *s, const rectangle *tile, const slice_strips *strips,
                       uint32_t first, strip_table *table) {
  double x = tile->column, y = tile->row;
  for (int f = 0; f < SLICE_FORMS; ++f) {
    const double *at = strips->forms[f][0] + first, *column = strips->forms[f][1] + first;
    const double *row = strips->forms[f][2] + first, start = f < 4 ? (double)s->low[f & 1] : 0;
    float *to = table->at[f];
    for (int k = 0; k < STRIPS; ++k) to[k] = (float)(at[k] + column[k] * x + row[k] * y - start);
    memcpy(table->column[f], strips->steps[f][0] + first, sizeof table->column[f]);
    memcpy(table->row[f], strips->steps[f][1] + first, sizeof table->row[f]);
  }
  for (int side = 0; side < 2; ++side)
    memcpy(table->frame[side], strips->place[side] + first, sizeof table->frame[side]);
}

// Where a line that meets both frames starts from a foot on both.
static void find_limits(const sonde_slicer *s, const rectangle *tile, const slice_strips *strips,
                        uint32_t first, strip_table *table) {
  double margin[2] = {0, 0};
  for (uint32_t i = first; i < first + table->count; ++i)
    for (int k = 0; k < 2; ++k) {
      double lean = strips->lean[k][i] * widest(strips, i, tile);
      margin[k] = lean > margin[k] ? lean : margin[k];
    }
  for (int k = 0; k < 2; ++k) {
    table->low[k] = (float)margin[k] - SLACK;
    table->high[k] = s->high[k] - s->low[k] - table->low[k];
  }
}

// False when the tile has no strip or too many.
static bool fill_table(const sonde_slicer *s, const slice_room *room, const rectangle *tile,
                       strip_table *table) {
  const slice_strips *strips = &room->strips;
  uint32_t planes[2];
  if (!strips->count) return false;
  count_planes(room, planes);
  bool ends = planes[0] == 0 || planes[1] > strips->count; // a pixel has planes on one side
  uint32_t first = planes[0] ? planes[0] - 1 : 0, last = at_most(planes[1], strips->count);
  if (last <= first || last - first > STRIPS) return false;
  table->count = last - first;
  table->whole = !ends && (room->covered || strips_cover(s, tile, strips, first, last));
  fill_lanes(s, tile, strips, first, table);
  if (!table->whole) find_limits(s, tile, strips, first, table);
  return true;
}

// Lanes of a table by their index.
INLINE vi look_up(const void *table, vi index) {
#if defined(__AVX512F__)
  return (vi)_mm512_permutexvar_epi32((__m512i)index, _mm512_loadu_si512(table));
#elif defined(__AVX2__)
  const __m256i *half = table;
  __m256i low = _mm256_loadu_si256(half), high = _mm256_loadu_si256(half + 1);
  low = _mm256_permutevar8x32_epi32(low, (__m256i)index);
  high = _mm256_permutevar8x32_epi32(high, (__m256i)index);
  return pick_of(index > 7, (vi)high, (vi)low);
#else
  const int32_t *from = table;
  vi to;
  for (int x = 0; x < W; ++x) to[x] = from[index[x]];
  return to;
#endif
}

INLINE vi find_index(const strip_table *table, vf x, float y) {
  vi index = {0};
  for (uint32_t k = 0; k + 1 < table->count; ++k)
    index -= table->at[4][k] + y * table->row[4][k] + x * table->column[4][k] < 0;
  return index;
}

INLINE void place_pixels(const sonde_slicer *s, vf u, vf v, vi frame, int side, uint32_t first,
                         strip_work *w) {
  float wide = s->high[0] - s->low[0], high = s->high[1] - s->low[1];
  vi i = whole(at_most_of(u, wide - 1)), j = whole(at_most_of(v, high - 1));
  vf left = real(i), top = real(j);
  vi p = whole((left + 0.5f) * (1.0f / (SLICE_LINE_WIDE - 1)));
  vi q = whole((top + 0.5f) * (1.0f / (SLICE_LINE_HIGH - 1)));
  vi place = frame + i + p * s->layout.column_line + j * s->layout.row + q * s->layout.row_line;
  memcpy(w->place[side] + first, &place, sizeof place);
  store(w->share[side][0] + first, u - left);
  store(w->share[side][1] + first, v - top);
}

// Pixels for which the strip speaks; the others' numbers become harmless.
INLINE vi check(const sonde_slicer *s, const strip_table *table, vf value[SLICE_FORMS]) {
  vi hit = (value[4] >= 0) & (value[5] > 0) & (value[4] + value[5] <= (float)s->options.gap_m);
  for (int k = 0; k < 4; ++k)
    hit = hit & (value[k] >= table->low[k & 1]) & (value[k] <= table->high[k & 1]);
  for (int k = 0; k < 4; ++k)
    value[k] = at_least_of(at_most_of(value[k], s->high[k & 1] - s->low[k & 1]), 0);
  value[4] = only(hit, value[4]), value[5] = pick(hit, value[5], all(1));
  return hit;
}

// A row of a tile.
INLINE void place_row(const sonde_slicer *s, const strip_table *table, bool checked, float row,
                      uint32_t first, strip_work *w) {
  static const float lanes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  float starts[SLICE_FORMS][STRIPS];
  for (int f = 0; f < SLICE_FORMS; ++f)
    for (int k = 0; k < STRIPS; k += W)
      store(starts[f] + k, load(table->at[f] + k) + row * load(table->row[f] + k));
  for (uint32_t k = 0; k < SLICE_TILE; k += W) {
    vf x = load(lanes + k), value[SLICE_FORMS];
    vi index = find_index(table, x, row);
    for (int f = 0; f < SLICE_FORMS; ++f)
      value[f] = (vf)look_up(starts[f], index) + x * (vf)look_up(table->column[f], index);
    if (checked) {
      vi met = check(s, table, value);
      memcpy(w->met + first + k, &met, sizeof met);
    }
    store(w->t + first + k, value[4] / (value[4] + value[5]));
    for (int side = 0; side < 2; ++side)
      place_pixels(s, value[2 * side], value[2 * side + 1], look_up(table->frame[side], index),
                   side, first + k, w);
  }
}

// Pixels around many places: many loads are under way at once.
static void load_greys(const slice_layout *layout, uint32_t count, strip_work *w) {
  const uint8_t *pixels = layout->pixels;
  size_t row = (size_t)layout->row;
  for (int side = 0; side < 2; ++side) {
    const int32_t *place = w->place[side];
    uint64_t *greys = w->greys[side];
    for (uint32_t i = 0; layout->lines && i < count; i += 8)
      for (uint32_t k = 0; k < 8; ++k) memcpy(&greys[i + k], pixels + place[i + k], sizeof *greys);
    for (uint32_t i = 0; !layout->lines && i < count; ++i) {
      const uint8_t *p = pixels + place[i];
      greys[i] = two_greys(p) | two_greys(p + row) << 48;
    }
  }
}

// Most lines of memory that a row will read.
INLINE void ask_for(const slice_layout *layout, const strip_work *w, uint32_t first) {
  for (uint32_t x = 0; x < SLICE_TILE; x += 4)
    for (int side = 0; side < 2; ++side)
      __builtin_prefetch(layout->pixels + w->place[side][first + x]);
}

static void place_tile(const sonde_slicer *s, const strip_table *table, uint32_t high,
                       strip_work *w) {
  for (uint32_t y = 0; y < high; ++y) {
    if (table->whole)
      place_row(s, table, false, (float)y, y * SLICE_TILE, w);
    else
      place_row(s, table, true, (float)y, y * SLICE_TILE, w);
    ask_for(&s->layout, w, y * SLICE_TILE);
  }
  load_greys(&s->layout, high * SLICE_TILE, w);
}

// Four greys of which two stand in bytes 0 and 1, two in 6 and 7.
INLINE float mix_apart(uint64_t greys, float t0, float t1) {
  uint32_t high = (uint32_t)greys, low = (uint32_t)(greys >> 32);
  float a = grey_of(high, 0), b = grey_of(high, 1), c = grey_of(low, 2), d = grey_of(low, 3);
  float top = a + t0 * (b - a), under = c + t0 * (d - c);
  return top + t1 * (under - top);
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
