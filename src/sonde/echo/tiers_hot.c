// Which rows of the grid are laid when: tiers.h.
//
// sonde_tiers_window, _measure, _begin  rows kept at once, tiers of a frame
// reach, tier_of, append      where something begins
// sonde_echo_splat_job, sonde_echo_splat  maps into the grid
// sonde_tiers_add_map, _add_lumen, _add_segment
// lay_maps, lay_segments, sonde_tiers_lay  one tier
#include "echo/tiers.h"

#include "base/base.h"

#include <string.h>

enum { FEWEST_ROWS = 128, FEWEST_TIER_ROWS = 32 };

// Single precision and the spline: rows beyond a map's own.
static const float margin_rows = 1.5f + 0.02f;
static const double stretch = 1.25; // of tissue, that still fits

// Rows that a cube reaches over, standing on a corner.
static uint32_t cube_rows(double cell_m, double step_m) {
  double rows = sqrt(3) * stretch * cell_m / step_m + 2 * (double)margin_rows;
  return (uint32_t)clamp(ceil(rows), 1, 1 << 20);
}

uint32_t sonde_tiers_window(double cell_m, double step_m) {
  uint32_t rows = FEWEST_ROWS, least = cube_rows(cell_m, step_m) + FEWEST_TIER_ROWS;
  while (rows < least) rows *= 2;
  return rows;
}

void sonde_tiers_measure(sonde_echo *echo) {
  const double step_m = echo->frame.step_m;
  echo->window_rows = sonde_tiers_window(echo->cell_m, step_m);
  echo->tier_rows = echo->window_rows - cube_rows(echo->cell_m, step_m);
  if (echo->grid_samples <= echo->window_rows) echo->tier_rows = echo->grid_samples;
}

void sonde_tiers_begin(sonde_echo *echo) {
  sonde_tiers *t = echo->tiers;
  t->maps = t->lumens = t->segments = 0;
  SONDE_ASSERT(echo->tier_rows > 0 &&
               (echo->tier_rows + 2 <= echo->window_rows || echo->tier_rows >= echo->grid_samples));
  echo->tier_count = (echo->grid_samples + echo->tier_rows - 1) / echo->tier_rows;
  SONDE_ASSERT(echo->tier_count <= MOST_TIERS);
  tier_list *lists[] = {&t->tissue, &t->blood};
  for (size_t k = 0; k < SONDE_COUNT_OF(lists); ++k)
    for (uint32_t i = 0; i < echo->tier_count; ++i) lists[k]->first[i] = lists[k]->last[i] = -1;
}

// ---- waiting --------------------------------------------------------------------------------

typedef struct reach {
  float top, bottom; // rows
} reach;

static reach reach_of(const splat_map *m) {
  float half = 0.5f * (fabsf(m->m[1][2]) + fabsf(m->m[2][2]) + fabsf(m->m[3][2])) + margin_rows;
  return (reach){m->m[0][2] - half, m->m[0][2] + half};
}

// False outside the grid.
static bool tier_of(const sonde_echo *echo, reach r, uint32_t *tier) {
  if (!(r.bottom >= 0 && r.top < (float)echo->grid_samples)) return false;
  *tier = r.top > 0 ? (uint32_t)r.top / echo->tier_rows : 0;
  return true;
}

static void append(tier_list *list, int32_t *next, uint32_t tier, int32_t which) {
  SONDE_ASSERT(tier < MOST_TIERS && which >= 0);
  next[which] = -1;
  if (list->first[tier] < 0)
    list->first[tier] = which;
  else
    next[list->last[tier]] = which;
  list->last[tier] = which;
}

void sonde_tiers_add_map(sonde_echo *echo, const splat_map *one) {
  sonde_tiers *t = echo->tiers;
  uint32_t tier;
  SONDE_ASSERT(one->count % ECHO_ALIGN == 0 && one->lumen + one->lumens <= t->lumens);
  if (!tier_of(echo, reach_of(one), &tier)) return;
  if (t->maps == MOST_MAPS) {
    ++echo->lost;
    return;
  }
  t->map[t->maps] = *one;
  append(&t->tissue, t->next_map, tier, (int32_t)t->maps++);
}

void sonde_tiers_add_lumen(sonde_tiers *tiers, const splat_lumen *lumen) {
  SONDE_ASSERT(tiers->lumens < MOST_LUMENS);
  tiers->lumen[tiers->lumens++] = *lumen;
}

void sonde_tiers_add_segment(sonde_echo *echo, const blood_segment *segment) {
  sonde_tiers *t = echo->tiers;
  uint32_t tier;
  SONDE_ASSERT(segment->count > 0 && segment->solid < 1);
  if (!tier_of(echo, reach_of(&segment->map), &tier)) return;
  if (t->segments == MOST_SEGMENTS) {
    ++echo->lost;
    return;
  }
  t->segment[t->segments] = *segment;
  append(&t->blood, t->next_segment, tier, (int32_t)t->segments++);
}

// ---- laying ---------------------------------------------------------------------------------

splat_job sonde_echo_splat_job(sonde_echo *echo) {
  const frame *f = &echo->frame;
  return (splat_job){.grid = echo->grid,
                     .stride = echo->grid_stride,
                     .mask = echo->window_rows - 1,
                     .turns = (float)(2 * f->step_m / f->wavelength_m),
                     .right = (float)(echo->grid_lines - 1)};
}

void sonde_echo_splat(sonde_echo *echo, const scatter_pool *pool, const splat_map *first,
                      uint32_t maps, const splat_lumen *lumen, splat_limits rows) {
  splat_job job = sonde_echo_splat_job(echo);
  job.x = pool->x, job.y = pool->y, job.z = pool->z, job.sign = pool->sign;
  job.map = first, job.maps = maps, job.lumen = lumen;
  job.cube = true, job.rows = rows;
  echo->kernels->splat(&job);
}

// A scatterer reaches the row above its nearest one: that row's tier lays it.
splat_limits sonde_tiers_limits(const sonde_echo *echo, uint32_t tier) {
  const float last = (float)(echo->grid_samples - 1);
  const uint32_t first = tier * echo->tier_rows + 1;
  return (splat_limits){(float)first, fminf((float)(first + echo->tier_rows), last)};
}

// What fits into the window goes at once, what does not tier by tier.
typedef struct tier_limits {
  splat_limits all, some;
  float bottom; // below the window
} tier_limits;

static tier_limits limits_of(const sonde_echo *echo, uint32_t tier) {
  const splat_limits some = sonde_tiers_limits(echo, tier);
  return (tier_limits){{some.first, (float)(echo->grid_samples - 1)},
                       some,
                       (float)(tier * echo->tier_rows + echo->window_rows)};
}

// Takes what waits in a tier off its list; what is too long for the window waits in the next, too.
static int32_t take(const sonde_echo *echo, tier_list *list, int32_t *next, uint32_t tier,
                    bool fits, int32_t which) {
  int32_t after = next[which];
  if (!fits && tier + 1 < echo->tier_count) append(list, next, tier + 1, which);
  return after;
}

static void lay_maps(sonde_echo *echo, uint32_t tier) {
  sonde_tiers *t = echo->tiers;
  const tier_limits limits = limits_of(echo, tier);
  uint32_t count = 0;
  for (int32_t k = t->tissue.first[tier]; k >= 0;) {
    const splat_map *one = &t->map[k];
    bool fits = reach_of(one).bottom < limits.bottom;
    if (fits)
      t->batch[count++] = *one;
    else
      sonde_echo_splat(echo, &echo->pool, one, 1, t->lumen, limits.some);
    if (count == MAPS_AT_ONCE) {
      sonde_echo_splat(echo, &echo->pool, t->batch, count, t->lumen, limits.all);
      count = 0;
    }
    k = take(echo, &t->tissue, t->next_map, tier, fits, k);
  }
  if (count > 0) sonde_echo_splat(echo, &echo->pool, t->batch, count, t->lumen, limits.all);
}

static void lay_segments(sonde_echo *echo, uint32_t tier) {
  sonde_tiers *t = echo->tiers;
  const tier_limits limits = limits_of(echo, tier);
  for (int32_t k = t->blood.first[tier]; k >= 0;) {
    bool fits = reach_of(&t->segment[k].map).bottom < limits.bottom;
    sonde_blood_lay(echo, &t->segment[k], fits ? limits.all : limits.some);
    k = take(echo, &t->blood, t->next_segment, tier, fits, k);
  }
}

void sonde_tiers_lay(sonde_echo *echo, uint32_t tier) {
  SONDE_ASSERT(tier < echo->tier_count);
  lay_maps(echo, tier);
  lay_segments(echo, tier);
}
