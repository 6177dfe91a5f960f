// Between frames that follow each other: part of slice_kernel.c.
//
// Where the planes of a block do not cross, those sorted by distance cut the picture into strips.
// Within a strip the same two frames lie on either side, and everything that a pixel needs is
// linear: the distances and the points on both frames. A tile's strips stand in a table, a strip
// in a vector element. The number of planes in front of a pixel is its strip, and one permutation
// fetches a number for 16 pixels. Pixels whose frames might end nearby are left to the full search.
#ifndef SONDE_SRC_SWEEP_SLICE_STRIPS_H
#define SONDE_SRC_SWEEP_SLICE_STRIPS_H

#include "base/vector_records.h"
#include "sweep/slice_mix.h"

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
  strips->offset[0][i] = behind->offset, strips->offset[1][i] = front->offset;
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

static void fill_numbers(const sonde_slicer *s, const rectangle *tile, const slice_strips *strips,
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
    memcpy(table->frame[side], strips->offset[side] + first, sizeof table->frame[side]);
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
  fill_numbers(s, tile, strips, first, table);
  if (!table->whole) find_limits(s, tile, strips, first, table);
  return true;
}

#endif
