// Fourth stage of the scatterers: binning into bands of rows, and from there into the (sample x
// line) grid of the complex baseband field.
#include "echo/bands.h"

#include "base/base.h"

#include <string.h>

enum { FEWEST_ROWS = 128, FEWEST_BAND_ROWS = 32, STREAMLINES_AT_ONCE = 512 };

// Single precision and the spline: rows beyond a map's own.
static const float margin_rows = 1.5f + 0.02f;
static const double stretch = 1.25; // of tissue, that still fits

// Rows that a cube reaches over, standing on a corner.
static uint32_t cube_rows(double cell_m, double step_m) {
  double rows = sqrt(3) * stretch * cell_m / step_m + 2 * (double)margin_rows;
  return (uint32_t)clamp(ceil(rows), 1, 1 << 20);
}

uint32_t sonde_bands_window(double cell_m, double step_m) {
  uint32_t rows = FEWEST_ROWS, least = cube_rows(cell_m, step_m) + FEWEST_BAND_ROWS;
  while (rows < least) rows *= 2;
  return rows;
}

void sonde_bands_measure(sonde_echo *echo) {
  const double step_m = echo->frame.step_m;
  echo->window_rows = sonde_bands_window(echo->cell_m, step_m);
  echo->band_rows = echo->window_rows - cube_rows(echo->cell_m, step_m);
  if (echo->grid_samples <= echo->window_rows) echo->band_rows = echo->grid_samples;
}

void sonde_bands_begin(sonde_echo *echo) {
  sonde_bands *b = echo->bands;
  b->maps = b->lumens = b->segments = 0;
  SONDE_ASSERT(echo->band_rows > 0 &&
               (echo->band_rows + 2 <= echo->window_rows || echo->band_rows >= echo->grid_samples));
  echo->band_count = (echo->grid_samples + echo->band_rows - 1) / echo->band_rows;
  SONDE_ASSERT(echo->band_count <= MOST_BANDS);
  band_list *lists[] = {&b->tissue, &b->blood};
  for (size_t k = 0; k < SONDE_COUNT_OF(lists); ++k)
    for (uint32_t i = 0; i < echo->band_count; ++i) lists[k]->first[i] = lists[k]->last[i] = -1;
}

// ---- binning --------------------------------------------------------------------------------

// Rows from a map's middle to the last that its scatterers reach.
static float half_rows(const splat_map *m) {
  return 0.5f * (fabsf(m->m[1][2]) + fabsf(m->m[2][2]) + fabsf(m->m[3][2])) + margin_rows;
}

// Band in which a map begins; false outside the grid.
static bool band_of(const sonde_echo *echo, const splat_map *m, uint32_t *band) {
  const float half = half_rows(m), top = m->m[0][2] - half;
  if (!(m->m[0][2] + half >= 0 && top < (float)echo->grid_samples)) return false;
  *band = top > 0 ? (uint32_t)top / echo->band_rows : 0;
  return true;
}

static void append(band_list *list, int32_t *next, uint32_t band, int32_t which) {
  SONDE_ASSERT(band < MOST_BANDS && which >= 0);
  next[which] = -1;
  if (list->first[band] < 0)
    list->first[band] = which;
  else
    next[list->last[band]] = which;
  list->last[band] = which;
}

void sonde_bands_add_map(sonde_echo *echo, const splat_map *one) {
  sonde_bands *b = echo->bands;
  uint32_t band;
  SONDE_ASSERT(one->count % ECHO_ALIGN == 0 && one->lumen + one->lumens <= b->lumens);
  echo->moved += one->count;
  if (!band_of(echo, one, &band)) return;
  if (b->maps == MOST_MAPS) {
    ++echo->lost;
    return;
  }
  b->map[b->maps] = *one;
  append(&b->tissue, b->next_map, band, (int32_t)b->maps++);
}

void sonde_bands_add_segment(sonde_echo *echo, const blood_segment *segment) {
  sonde_bands *b = echo->bands;
  uint32_t band;
  SONDE_ASSERT(segment->count > 0 && segment->solid < 1);
  if (!band_of(echo, &segment->map, &band)) return;
  if (b->segments == MOST_SEGMENTS) {
    ++echo->lost;
    return;
  }
  b->segment[b->segments] = *segment;
  append(&b->blood, b->next_segment, band, (int32_t)b->segments++);
}

// ---- into the grid --------------------------------------------------------------------------

// What the jobs of a frame have in common.
static splat_job splat_job_of(const sonde_echo *echo, splat_limits rows) {
  const frame *f = &echo->frame;
  return (splat_job){.grid = echo->grid,
                     .stride = echo->grid_stride,
                     .mask = echo->window_rows - 1,
                     .turns = (float)(2 * f->step_m / f->wavelength_m),
                     .right = (float)(echo->grid_lines - 1),
                     .rows = rows};
}

static void splat(sonde_echo *echo, const scatter_pool *pool, const splat_map *first, uint32_t maps,
                  splat_limits rows) {
  splat_job job = splat_job_of(echo, rows);
  job.x = pool->x, job.y = pool->y, job.z = pool->z, job.sign = pool->sign;
  job.map = first, job.maps = maps, job.lumen = echo->bands->lumen, job.cube = true;
  echo->kernels->splat(&job);
}

// Rows that scatterers of a band are nearest to: a scatterer reaches the row above its nearest one,
// whose band lays it.
static splat_limits rows_of(const sonde_echo *echo, uint32_t band) {
  const float last = (float)(echo->grid_samples - 1);
  const uint32_t first = band * echo->band_rows + 1;
  return (splat_limits){(float)first, fminf((float)(first + echo->band_rows), last)};
}

// What fits into the window is laid at once; what is too long for it is laid band by band, and
// waits in the next one, too.
void sonde_bands_lay(sonde_echo *echo, uint32_t band) {
  SONDE_ASSERT(band < echo->band_count);
  sonde_bands *b = echo->bands;
  const splat_limits some = rows_of(echo, band);
  const splat_limits all = {some.first, (float)(echo->grid_samples - 1)};
  const float bottom = (float)(band * echo->band_rows + echo->window_rows);
  const bool is_last = band + 1 == echo->band_count;
  uint32_t count = 0;
  for (int32_t k = b->tissue.first[band], next; k >= 0; k = next) {
    const splat_map *one = &b->map[k];
    const bool fits = one->m[0][2] + half_rows(one) < bottom;
    next = b->next_map[k];
    if (fits)
      b->batch[count++] = *one;
    else
      splat(echo, &echo->pool, one, 1, some);
    if (!fits && !is_last) append(&b->tissue, b->next_map, band + 1, k);
    if (count == MAPS_AT_ONCE) splat(echo, &echo->pool, b->batch, count, all), count = 0;
  }
  if (count > 0) splat(echo, &echo->pool, b->batch, count, all);
  for (int32_t k = b->blood.first[band], next; k >= 0; k = next) {
    const blood_segment *from = &b->segment[k];
    const bool fits = from->map.m[0][2] + half_rows(&from->map) < bottom;
    next = b->next_segment[k];
    // Blood of one segment: scatterers on their streamlines outside clot.
    enum { AT_ONCE = STREAMLINES_AT_ONCE };
    float x[AT_ONCE], y[AT_ONCE], z[AT_ONCE], sign[AT_ONCE];
    const scatter_pool *blood = &echo->blood, streams = {x, y, z, sign};
    SONDE_ASSERT(from->count <= SONDE_BLOOD && from->solid < 1);
    splat_map one = from->map;
    for (uint32_t i = 0; i < from->count; i += AT_ONCE) {
      const uint32_t length = from->count - i < AT_ONCE ? from->count - i : AT_ONCE;
      const stream_job job = {.z = blood->z + i,
                              .speed = blood->sign + i,
                              .bundle = echo->bundle + i,
                              .count = length,
                              .first = i,
                              .flowed = from->flowed,
                              .streaks = from->streaks,
                              .segment = from->segment,
                              .salt = from->salt,
                              .at = z,
                              .sign = sign};
      echo->kernels->stream(&job);
      memcpy(x, blood->x + i, length * sizeof *x);
      memcpy(y, blood->y + i, length * sizeof *y);
      uint32_t kept = from->solid > 0 ? 0 : length;
      for (uint32_t n = 0; n < length && from->solid > 0; ++n) {
        if (sonde_blood_in_clot(from, x[n], y[n], z[n])) continue;
        x[kept] = x[n], y[kept] = y[n], z[kept] = z[n], sign[kept++] = sign[n];
      }
      for (; kept % ECHO_ALIGN; ++kept) x[kept] = y[kept] = z[kept] = sign[kept] = 0;
      one.count = kept;
      if (kept > 0) splat(echo, &streams, &one, 1, fits ? all : some);
    }
    if (!fits && !is_last) append(&b->blood, b->next_segment, band + 1, k);
  }
}

// In blocks of one vector.
void sonde_bands_lay_points(sonde_echo *echo, const sonde_echo_point *points, uint32_t count,
                            uint32_t band) {
  const frame *f = &echo->frame;
  float x[ECHO_ALIGN], y[ECHO_ALIGN], z[ECHO_ALIGN], size[ECHO_ALIGN];
  const splat_map one = {.m = {{0, 0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .count = ECHO_ALIGN};
  splat_job job = splat_job_of(echo, rows_of(echo, band));
  job.x = x, job.y = y, job.z = z, job.sign = size, job.map = &one, job.maps = 1;
  uint32_t k = 0;
  for (uint32_t i = 0; i < count; ++i) {
    sonde_vec3 at = sonde_echo_unplace(f, vec3(points[i].x_m, points[i].y_m, points[i].z_m));
    x[k] = (float)(at.x * SONDE_FINE + echo->pad_lines),
    z[k] = (float)(at.z / f->step_m + echo->pad_samples);
    y[k] = (float)(at.y / sonde_echo_elevation(echo, at.z)), size[k] = (float)points[i].amplitude;
    if (z[k] >= job.rows.first - 1 && z[k] < job.rows.last + 1) ++k;
    if (k == ECHO_ALIGN) echo->kernels->splat(&job), k = 0;
  }
  for (uint32_t rest = k; rest < ECHO_ALIGN; ++rest)
    x[rest] = -1, y[rest] = z[rest] = size[rest] = 0;
  if (k > 0) echo->kernels->splat(&job);
}
