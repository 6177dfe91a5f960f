// Weights for pictures between frames, from how alike the frames are.
//
// A frame is the sum of scales: differences of a pyramid's levels, the coarsest level last. Of each
// scale the covariance between frames is measured over a grid of points for all pairs up to LAGS
// frames apart, and r(d) = exp(-(d/L)^p) is fitted to its fall with the distance d. Simple kriging
// then gives the weights of least expected square error for each scale: fine grain, which no other
// frame shares, fades away from the frames; coarse structure is interpolated smoothly. The mean of
// the coarsest scale is not known: its weights add up to one.
#include "sweep/slice.h"

#include <string.h>

enum { LAGS = SLICE_LAGS, BINS = 32, LENGTHS = 96, POWERS = 17 };
enum { STILL = 3 }; // grey levels
enum { MOST_POINTS = 16000, FEWEST_POINTS = 1000, ALL_POINTS = 1200000 };

static const double SHORTEST_M = 2e-5, LONGEST_M = 20, FIRST_POWER = 0.3, POWER_STEP = 0.1;
static const float MIDDLE = 128;    // grey level that the coarsest scale is counted from
static const double ORDER_M = 1e-3; // one frame, where distance goes by number

typedef slice_decay decay;

typedef struct bin {
  double log_m, likeness, weight;
} bin;

static const uint32_t BINOMIAL[5] = {1, 4, 6, 4, 1};

static uint32_t bounded(int at, uint32_t count) {
  return at < 0 ? 0 : at >= (int)count ? count - 1 : (uint32_t)at;
}

// Binomial weights along both axes, the edge repeated; pixels that never change (share 0) do not
// count. Level k + 1 and, from level 0, its shares.
static void halve(const slice_bank *bank, int k, const uint8_t *from, uint8_t *to) {
  const uint8_t *share = bank->shares[k];
  uint32_t wide = bank->wide[k], high = bank->high[k], w2 = bank->wide[k + 1];
  for (uint32_t y = 0; y < bank->high[k + 1]; ++y)
    for (uint32_t x = 0; x < w2; ++x) {
      uint32_t sum = 0, weight = 0;
      for (int j = 0; j < 5; ++j) {
        uint32_t row = bounded((int)(2 * y) + j - 2, high);
        for (int i = 0; i < 5; ++i) {
          uint32_t column = bounded((int)(2 * x) + i - 2, wide);
          uint32_t w = BINOMIAL[i] * BINOMIAL[j] * share[(size_t)row * wide + column];
          sum += w * from[row * bank->stride[k] + column], weight += w;
        }
      }
      to[(size_t)y * w2 + x] = weight ? (uint8_t)((sum + weight / 2) / weight) : 0;
    }
}

// (u, v) counts from the corner of the used part.
static void scales_at(const slice_bank *bank, uint32_t frame, float u, float v,
                      float scales[SLICE_LEVELS]) {
  const slice_pyramid *p = &bank->pyramids[frame];
  float finer = slice_level_at(bank, p, 0, u, v);
  for (int k = 1; k < SLICE_LEVELS; ++k) {
    float scale = 1.0f / (float)(1 << k);
    float level = slice_level_at(bank, p, k, u * scale, v * scale);
    scales[k - 1] = finer - level;
    finer = level;
  }
  scales[SLICE_LEVELS - 1] = finer - MIDDLE;
}

static sonde_vec3 middle(const sonde_sequence *s, uint32_t frame) {
  double u = s->clip[0] + 0.5 * (s->clip[2] - 1), v = s->clip[1] + 0.5 * (s->clip[3] - 1);
  return affine_apply(&s->frames[frame].world_from_pixel, vec3(u, v, 0));
}

static sonde_vec3 normal_of(const sonde_sequence *s, uint32_t frame) {
  const sonde_affine *a = &s->frames[frame].world_from_pixel;
  return v_unit(v_cross(affine_column(a, 0), affine_column(a, 1)), vec3(0, 0, 0));
}

// From the middle of either frame to the plane of the other, mean of both.
static double apart(const sonde_sequence *s, uint32_t a, uint32_t b) {
  sonde_vec3 step = v_sub(middle(s, a), middle(s, b));
  return 0.5 * (fabs(v_dot(step, normal_of(s, a))) + fabs(v_dot(step, normal_of(s, b))));
}

// Pixel (u, v, 1) of frame a -> its foot on frame b; false for a frame without a plane.
static bool foot_map(const sonde_sequence *s, uint32_t a, uint32_t b, float map[2][3]) {
  const sonde_affine *to = &s->frames[b].world_from_pixel;
  sonde_affine whole = affine_columns(affine_column(to, 0), affine_column(to, 1), normal_of(s, b),
                                      affine_column(to, 3));
  sonde_affine inverse;
  if (!affine_inverse(&whole, &inverse)) return false;
  sonde_affine m = affine_mul(&inverse, &s->frames[a].world_from_pixel);
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 3; ++j) map[k][j] = (float)m.m[k][j == 2 ? 3 : j];
  return true;
}

// Mean products of frames a and b; of b at the same pixel or at the foot.
static void compare(const slice_bank *bank, slice_likeness *pair) {
  const sonde_sequence *s = bank->sequence;
  uint32_t most = (uint32_t)clamp(ALL_POINTS / (bank->used + 1.0), FEWEST_POINTS, MOST_POINTS);
  uint32_t step = 1; // of the grid of points, pixels
  while ((bank->wide[0] / step) * (bank->high[0] / step) > most) ++step;
  uint32_t columns = bank->wide[0] / step, rows = bank->high[0] / step;
  float map[2][3], own[SLICE_LEVELS], other[SLICE_LEVELS];
  double sum[2][SLICE_LEVELS] = {{0}}, count[2] = {0};
  bool flat = !foot_map(s, pair->a, pair->b, map);
  for (uint32_t i = 0; i < columns * rows; ++i) {
    float u = (float)(i % columns * step + step / 2);
    float v = (float)(i / columns * step + step / 2);
    float x = u + (float)s->clip[0], y = v + (float)s->clip[1];
    // A pixel that never changes does not count.
    if (!bank->shares[0][(size_t)(v + 0.5f) * bank->wide[0] + (size_t)(u + 0.5f)]) continue;
    scales_at(bank, pair->a, u, v, own);
    for (int joining = 0; joining < 2; ++joining) {
      float p = u, q = v;
      if (joining == 0 && pair->a != pair->b) {
        p = map[0][0] * x + map[0][1] * y + map[0][2] - (float)s->clip[0];
        q = map[1][0] * x + map[1][1] * y + map[1][2] - (float)s->clip[1];
      }
      if (flat ||
          !(p >= 0 && q >= 0 && p <= (float)(bank->wide[0] - 1) && q <= (float)(bank->high[0] - 1)))
        continue;
      scales_at(bank, pair->b, p, q, other);
      for (int k = 0; k < SLICE_LEVELS; ++k) sum[joining][k] += (double)(own[k] * other[k]);
      count[joining] += 1;
    }
  }
  for (int joining = 0; joining < 2; ++joining)
    for (int k = 0; k < SLICE_LEVELS; ++k)
      pair->mean[joining][k] = count[joining] > 0 ? (float)(sum[joining][k] / count[joining]) : 0;
}

static sonde_status build_pyramids(slice_bank *bank, sonde_error *error) {
  const sonde_sequence *s = bank->sequence;
  size_t bytes = 0; // of the levels above 0
  bank->wide[0] = s->clip[2], bank->high[0] = s->clip[3], bank->stride[0] = s->width;
  for (int k = 1; k < SLICE_LEVELS; ++k) {
    bank->wide[k] = (bank->wide[k - 1] + 1) / 2, bank->high[k] = (bank->high[k - 1] + 1) / 2;
    bank->stride[k] = bank->wide[k];
    bytes += bank->stride[k] * bank->high[k];
  }
  size_t own = (size_t)bank->wide[0] * bank->high[0];
  bank->levels = SONDE_NEW(uint8_t, bytes * bank->used + 1);
  bank->pyramids = SONDE_NEW(slice_pyramid, s->count);
  bank->shares[0] = SONDE_NEW(uint8_t, own + bytes);
  if (!bank->levels || !bank->pyramids || !bank->shares[0]) return sonde_fail_memory(error);
  // What never changes by more than a few grey levels is surround or writing, not tissue.
  for (uint32_t y = 0; y < bank->high[0]; ++y)
    for (uint32_t x = 0; x < bank->wide[0]; ++x) {
      size_t at = (size_t)(y + s->clip[1]) * s->width + x + s->clip[0];
      int low = 255, high = 0;
      for (uint32_t i = 0; i < s->count; ++i) {
        if (!s->frames[i].used) continue;
        int grey = s->pixels[(size_t)i * s->width * s->height + at];
        low = grey < low ? grey : low, high = grey > high ? grey : high;
      }
      bank->shares[0][(size_t)y * bank->wide[0] + x] = high - low > STILL ? 255 : 0;
    }
  for (int k = 1; k < SLICE_LEVELS; ++k) {
    bank->shares[k] = bank->shares[k - 1] + (size_t)bank->wide[k - 1] * bank->high[k - 1];
    // The share of what changes: 255 for a pixel that does, of the levels above the mean below.
    const uint8_t *from = bank->shares[k - 1];
    uint32_t wide = bank->wide[k - 1], high = bank->high[k - 1];
    for (size_t p = 0; p < (size_t)bank->wide[k] * bank->high[k]; ++p) {
      int column = (int)(p % bank->wide[k]) * 2 - 2, row = (int)(p / bank->wide[k]) * 2 - 2;
      uint32_t sum = 0;
      for (int n = 0; n < 25; ++n)
        sum += BINOMIAL[n % 5] * BINOMIAL[n / 5] *
               from[(size_t)bounded(row + n / 5, high) * wide + bounded(column + n % 5, wide)];
      bank->shares[k][p] = (uint8_t)((sum + 255) >> 8); // what has any keeps some
    }
  }
  uint8_t *levels = bank->levels;
  for (uint32_t i = 0; i < s->count; ++i) {
    if (!s->frames[i].used) continue;
    slice_pyramid *p = &bank->pyramids[i];
    p->level[0] = s->pixels + ((size_t)i * s->height + s->clip[1]) * s->width + s->clip[0];
    for (int k = 1; k < SLICE_LEVELS; ++k) {
      halve(bank, k - 1, p->level[k - 1], levels);
      p->level[k] = levels;
      levels += bank->stride[k] * bank->high[k];
    }
  }
  return SONDE_OK;
}

sonde_status sonde_slice_bank_create(const sonde_sequence *s, slice_bank **out,
                                     sonde_error *error) {
  SONDE_ASSERT(s != NULL && out != NULL && s->clip[2] > 1 && s->clip[3] > 1);
  *out = NULL;
  slice_bank *bank = SONDE_NEW(slice_bank, 1);
  if (!bank) return sonde_fail_memory(error);
  bank->sequence = s;
  for (uint32_t i = 0; i < s->count; ++i) bank->used += s->frames[i].used;
  sonde_status status = build_pyramids(bank, error);
  bank->frames = SONDE_NEW(uint32_t, bank->used);
  bank->pairs = SONDE_NEW(slice_likeness, (size_t)bank->used * (LAGS + 1));
  if (!status && (!bank->frames || !bank->pairs)) status = sonde_fail_memory(error);
  // Every frame is compared with itself and the next LAGS.
  uint32_t n = 0;
  for (uint32_t i = 0; i < s->count && !status; ++i)
    if (s->frames[i].used) bank->frames[n++] = i;
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t lag = 0; lag <= LAGS && i + lag < n; ++lag) {
      slice_likeness *pair = &bank->pairs[i * (LAGS + 1) + lag];
      *pair = (slice_likeness){.a = bank->frames[i], .b = bank->frames[i + lag]};
      pair->distance_m = (float)apart(s, pair->a, pair->b);
      compare(bank, pair);
    }
  if (status) sonde_slice_bank_destroy(bank);
  *out = status ? NULL : bank;
  return status;
}

void sonde_slice_bank_destroy(slice_bank *bank) {
  if (!bank) return;
  sonde_free(bank->levels);
  sonde_free(bank->pyramids);
  sonde_free(bank->pairs);
  sonde_free(bank->frames);
  sonde_free(bank->shares[0]);
  sonde_free(bank);
}

static bool is_out(const sonde_slicer *s, uint32_t frame) {
  return sonde_slice_is_left_out(s->bank->sequence, &s->options, frame);
}

// Mean product of two used frames at most LAGS apart; their places among the used ones.
static double product(const slice_bank *bank, uint32_t a, uint32_t b, int joining, int level) {
  uint32_t low = a < b ? a : b, high = a < b ? b : a;
  SONDE_ASSERT(high < bank->used && high - low <= LAGS);
  return (double)bank->pairs[low * (LAGS + 1) + high - low].mean[joining][level];
}

static void fit(const sonde_slicer *slicer, slice_model *m, int level) {
  bin bins[BINS];
  double sum = 0, count = 0;
  for (uint32_t i = 0; i < slicer->bank->used; ++i) {
    if (is_out(slicer, slicer->bank->frames[i])) continue;
    sum += product(slicer->bank, i, i, 1, level);
    count += 1;
  }
  decay best = {count > 0 ? sum / count : 0, LONGEST_M, 1};
  m->decays[level] = best;
  if (!(best.variance > 0)) return;
  // Likeness of the frames in use, 1 - variogram / variance, in bins of the logarithm of the
  // distance.
  const slice_bank *bank = slicer->bank;
  double variance = m->decays[level].variance;
  memset(bins, 0, BINS * sizeof *bins);
  for (uint32_t i = 0; i < bank->used && variance > 0; ++i) {
    if (is_out(slicer, bank->frames[i])) continue;
    for (uint32_t lag = 1; lag <= LAGS && i + lag < bank->used; ++lag) {
      if (is_out(slicer, bank->frames[i + lag])) continue;
      const slice_likeness *p = &bank->pairs[i * (LAGS + 1) + lag];
      double d = m->by_order ? lag * ORDER_M : fmax((double)p->distance_m, SHORTEST_M);
      double own = product(bank, i, i, m->along_sweep, level) +
                   product(bank, i + lag, i + lag, m->along_sweep, level);
      // Four bins per doubling, the first one ends at 0.05 mm.
      int at = (int)clamp(1 + 4 * log2(d / 5e-5), 0, BINS - 1);
      bins[at].log_m += log(d);
      bins[at].likeness += 1 - (0.5 * own - (double)p->mean[m->along_sweep][level]) / variance;
      bins[at].weight += 1;
    }
  }
  for (int i = 0; i < BINS; ++i)
    if (bins[i].weight > 0) bins[i].log_m /= bins[i].weight, bins[i].likeness /= bins[i].weight;
  double least = (double)INFINITY;
  for (int i = 0; i < LENGTHS; ++i)
    for (int j = 0; j < POWERS; ++j) {
      decay d = {best.variance, SHORTEST_M * pow(LONGEST_M / SHORTEST_M, i / (LENGTHS - 1.0)),
                 FIRST_POWER + POWER_STEP * j};
      // The misfit is that of the variogram, relative as Cressie weighs it: short distances, where
      // frames are most alike, count as much as long ones.
      double error = 0, log_m = log(d.length_m);
      for (int b = 0; b < BINS; ++b) {
        if (!(bins[b].weight > 0)) continue;
        double unlike = -expm1(-exp(d.power * (bins[b].log_m - log_m)));
        double off = (1 - bins[b].likeness) / fmax(unlike, 1e-6) - 1;
        error += bins[b].weight * off * off;
      }
      if (error < least) least = error, best = d;
    }
  m->decays[level] = best;
}

// Gauss with the largest pivot; a system without one leaves zeros.
static void solve(int n, double a[][SLICE_JOINED + 1], double *b) {
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (fabs(a[i][k]) > fabs(a[pivot][k])) pivot = i;
    if (!(fabs(a[pivot][k]) > 1e-12)) {
      memset(b, 0, (size_t)n * sizeof *b);
      return;
    }
    for (int j = 0; j < n; ++j) {
      double kept = a[k][j];
      a[k][j] = a[pivot][j], a[pivot][j] = kept;
    }
    double kept = b[k];
    b[k] = b[pivot], b[pivot] = kept;
    for (int i = k + 1; i < n; ++i) {
      double factor = a[i][k] / a[k][k];
      for (int j = k; j < n; ++j) a[i][j] -= factor * a[k][j];
      b[i] -= factor * b[k];
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    for (int j = k + 1; j < n; ++j) b[k] -= a[k][j] * b[j];
    b[k] /= a[k][k];
  }
}

void slice_krige_scale(const decay *d, int n, const double *at, double x, bool whole, double *w) {
  double a[SLICE_JOINED + 1][SLICE_JOINED + 1], b[SLICE_JOINED + 1];
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) a[i][j] = slice_likeness_at(d, fabs(at[i] - at[j]));
    b[i] = slice_likeness_at(d, fabs(at[i] - x));
    a[i][n] = a[n][i] = b[n] = 1;
  }
  a[n][n] = 0;
  solve(whole ? n + 1 : n, a, b);
  memcpy(w, b, (size_t)n * sizeof *w);
}

// @param slots where the n frames stand in the weights
static void weights_at(const decay decays[SLICE_LEVELS], int n, const double *at, const int *slots,
                       double x, slice_weights *out) {
  double w[SLICE_JOINED], finer[SLICE_JOINED] = {0};
  memset(out, 0, sizeof *out);
  for (int k = 0; k < SLICE_LEVELS; ++k) {
    slice_krige_scale(&decays[k], n, at, x, k + 1 == SLICE_LEVELS, w);
    for (int i = 0; i < n; ++i) {
      out->of[slots[i]][k] = (float)(w[i] - finer[i]); // scales are differences of levels
      finer[i] = w[i];
    }
  }
}

// Mean square error of frame i made from the two before and the two behind; false when one of them
// is left out.
static bool foretell(const sonde_slicer *s, const slice_model *m, uint32_t i, double *error) {
  static const int steps[SLICE_JOINED] = {-2, -1, 1, 2};
  const slice_bank *bank = s->bank;
  double at[SLICE_JOINED], w[SLICE_JOINED];
  uint32_t from[SLICE_JOINED];
  if (i < 2 || i + 2 >= bank->used || is_out(s, bank->frames[i])) return false;
  for (int k = 0; k < SLICE_JOINED; ++k) {
    from[k] = (uint32_t)((int)i + steps[k]);
    if (is_out(s, bank->frames[from[k]])) return false;
    double d = m->by_order ? ORDER_M * abs(steps[k])
                           : apart(bank->sequence, bank->frames[i], bank->frames[from[k]]);
    at[k] = steps[k] < 0 ? -d : d;
  }
  for (int level = 0; level < SLICE_LEVELS; ++level) {
    slice_krige_scale(&m->decays[level], SLICE_JOINED, at, 0, level + 1 == SLICE_LEVELS, w);
    double square = product(bank, i, i, m->along_sweep, level);
    for (int k = 0; k < SLICE_JOINED; ++k) {
      square -= 2 * w[k] * product(bank, i, from[k], m->along_sweep, level);
      for (int j = 0; j < SLICE_JOINED; ++j)
        square += w[k] * w[j] * product(bank, from[k], from[j], m->along_sweep, level);
    }
    *error += square;
  }
  return true;
}

static uint32_t frame_of(const sonde_slicer *slicer, int32_t plane) {
  return slicer->planes[plane].frame;
}

// A plane beyond an end of the gap that goes on alike and is not too far.
static bool goes_on(const sonde_slicer *s, int32_t plane, int32_t end, int32_t other,
                    double *beyond) {
  *beyond = 0;
  if (plane < 0 || plane >= (int32_t)s->count) return false;
  const sonde_sequence *q = s->bank->sequence;
  double gap = apart(q, frame_of(s, end), frame_of(s, other));
  double all = apart(q, frame_of(s, plane), frame_of(s, other));
  *beyond = apart(q, frame_of(s, plane), frame_of(s, end));
  return *beyond > 0.05 * gap && *beyond <= s->options.gap_m &&
         fabs(all - gap - *beyond) < 0.25 * all;
}

static void make_map(const sonde_slicer *s, int32_t from, int32_t to, float map[2][3]) {
  static const float same[2][3] = {{1, 0, 0}, {0, 1, 0}};
  memcpy(map, same, sizeof same);
  if (to >= 0 && !s->options.along_sweep)
    (void)foot_map(s->bank->sequence, frame_of(s, from), frame_of(s, to), map);
}

sonde_status sonde_slicer_krige(sonde_slicer *s, sonde_error *error) {
  SONDE_ASSERT(s->bank != NULL && s->count > 0);
  s->joins = SONDE_NEW(slice_join, s->count);
  s->far = SONDE_NEW(slice_weights, SLICE_FAR * (SLICE_STEPS + 1));
  if (!s->joins || !s->far) return sonde_fail_memory(error);
  for (int k = 0; k < 4; ++k) {
    slice_model m = {.along_sweep = k & 1, .by_order = k & 2};
    double sum = 0, count = 0;
    for (int level = 0; level < SLICE_LEVELS; ++level) fit(s, &m, level);
    for (uint32_t i = 0; i < s->bank->used; ++i) count += foretell(s, &m, i, &sum);
    m.error = count > 0 ? sum / count : m.decays[0].variance * m.along_sweep;
    if (k == 0 || m.error < s->model.error) s->model = m;
    if (k == 0 || (k == 1 && m.error < s->pose_model.error)) s->pose_model = m;
  }
  if (s->options.method == SONDE_SLICE_KRIGE) s->options.along_sweep = s->pose_model.along_sweep;
  for (uint32_t i = 0; i + 1 < s->count; ++i) {
    // Weights between a plane and the next one, with the planes beyond both where they go on alike.
    int32_t lower = (int32_t)i;
    slice_join *join = &s->joins[lower];
    int32_t upper = lower + 1;
    double gap = apart(s->bank->sequence, frame_of(s, lower), frame_of(s, upper)), beyond[2];
    bool before = goes_on(s, lower - 1, lower, upper, &beyond[0]);
    bool behind = goes_on(s, upper + 1, upper, lower, &beyond[1]);
    join->before = before ? lower - 1 : -1, join->behind = behind ? upper + 1 : -1;
    make_map(s, lower, join->before, join->to_before);
    make_map(s, upper, join->behind, join->to_behind);
    double place[SLICE_JOINED] = {0};
    int slots[SLICE_JOINED], joined = 0;
    if (before) place[joined] = -beyond[0], slots[joined++] = 0;
    place[joined] = 0, slots[joined++] = 1;
    place[joined] = gap, slots[joined++] = 2;
    if (behind) place[joined] = gap + beyond[1], slots[joined++] = 3;
    for (int t = 0; t <= SLICE_STEPS; ++t)
      weights_at(s->pose_model.decays, joined, place, slots, gap * t / SLICE_STEPS,
                 &join->steps[t]);
  }
  for (int k = 0; k < SLICE_FAR; ++k) {
    double gap = s->options.gap_m * (k + 0.5) / SLICE_FAR, at[2] = {0, gap};
    for (int t = 0; t <= SLICE_STEPS; ++t)
      weights_at(s->pose_model.decays, 2, at, (const int[]){1, 2}, gap * t / SLICE_STEPS,
                 &s->far[k * (SLICE_STEPS + 1) + t]);
  }
  return SONDE_OK;
}

// ---- a picture of the sweep's own ------------------------------------------------------------

uint64_t sonde_slicer_render_place(sonde_slicer *s, double place,
                                   const sonde_affine *world_from_pixel, const uint32_t corner[2],
                                   sonde_image *image, uint8_t *known) {
  SONDE_ASSERT(s != NULL && s->bank != NULL && image != NULL && s->count > 0);
  slice_sum sum = {.slicer = s, .image = image, .known = known};
  // Two planes lie before the place and two behind it, as far as there are; none twice.
  int slots[SLICE_JOINED];
  int32_t upper = 0;
  while (upper < (int32_t)s->count && s->planes[upper].frame <= place) ++upper;
  if (upper == (int32_t)s->count && upper > 1) --upper; // the last frame itself
  for (int k = 0; k < SLICE_JOINED; ++k) {
    int32_t plane = upper - 2 + k;
    if (plane < 0 || plane >= (int32_t)s->count) continue;
    sum.planes[sum.n] = &s->planes[plane];
    slots[sum.n++] = k;
  }
  // Their distances from the picture's middle give the weights; the maps lead from its pixels.
  double at[SLICE_JOINED] = {0};
  sonde_vec3 here =
      affine_apply(world_from_pixel, vec3(0.5 * (image->width - 1), 0.5 * (image->height - 1), 0));
  for (int k = 0; k < sum.n; ++k) {
    const slice_plane *p = sum.planes[k];
    double d = fabs(affine_apply(&p->local_from_world, here).z);
    at[k] = s->model.by_order ? ORDER_M * (p->frame - place) : (p->frame <= place ? -1 : 1) * d;
    sonde_affine m = affine_mul(&p->local_from_world, world_from_pixel);
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 3; ++j)
        sum.maps[k][i][j] = s->model.along_sweep ? (j == 2 ? (float)corner[i] : i == j)
                                                 : (float)m.m[i][j == 2 ? 3 : j];
  }
  slice_weights weights;
  weights_at(s->model.decays, sum.n, at, slots, 0, &weights);
  for (int k = 0; k < sum.n; ++k)
    memcpy(sum.weights[k], weights.of[slots[k]], sizeof sum.weights[k]);
  return s->kernels->sum(&sum);
}
