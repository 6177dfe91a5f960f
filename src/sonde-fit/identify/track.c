// Straight moves behind noisy samples: short pieces are joined as long as noise explains the loss,
// and each boundary moves to where both lines fit best.
#include "identify/track.h"

#include "base/maths.h"
#include "base/order.h"

#include <string.h>

sonde_status sonde_track_create(uint32_t room, sonde_track *track, sonde_error *error) {
  SONDE_ASSERT(room > 0);
  *track = (sonde_track){0};
  track->time_s = SONDE_NEW(double, 2 * (size_t)room);
  if (!track->time_s) return sonde_fail_memory(error);
  track->value = track->time_s + room;
  return SONDE_OK;
}

void sonde_track_clear(sonde_track *track) {
  sonde_free(track->time_s);
  *track = (sonde_track){0};
}

double sonde_track_slope(const sonde_track *track, uint32_t k) {
  if (k + 1 >= track->count) return 0;
  return (track->value[k + 1] - track->value[k]) / (track->time_s[k + 1] - track->time_s[k]);
}

double sonde_track_at(const sonde_track *track, double time_s) {
  SONDE_ASSERT(track->count >= 1 && isfinite(time_s));
  if (time_s <= track->time_s[0]) return track->value[0];
  // The last knot that is not after the time.
  uint32_t k = 0, high = track->count;
  while (high - k > 1) {
    uint32_t middle = k + (high - k) / 2;
    if (track->time_s[middle] <= time_s)
      k = middle;
    else
      high = middle;
  }
  return track->value[k] + sonde_track_slope(track, k) * (time_s - track->time_s[k]);
}

// Running sums of 1, t, v, tt, tv, vv before each sample, and the starts of the pieces.
typedef struct pieces {
  uint32_t samples, count;
  double (*sum)[5]; // [samples + 1] t, v, tt, tv, vv
  uint32_t *start;  // [count + 1], the last one is samples
  double noise;
} pieces;

typedef struct line {
  double mean_t, mean_v, slope;
} line;

// Sum of squared distances from the least-squares line of samples [from, to).
static double misfit(const pieces *p, uint32_t from, uint32_t to, line *fitted) {
  SONDE_ASSERT(from < to && to <= p->samples);
  double s[5], n = (double)(to - from);
  for (int k = 0; k < 5; ++k) s[k] = p->sum[to][k] - p->sum[from][k];
  double tt = s[2] - s[0] * s[0] / n, tv = s[3] - s[0] * s[1] / n, vv = s[4] - s[1] * s[1] / n;
  double slope = to - from > 1 && tt > 0 ? tv / tt : 0;
  if (fitted) *fitted = (line){s[0] / n, s[1] / n, slope};
  return fmax(0, vv - slope * tv);
}

// Two lines where one would do fit better by about 2 variances; a real corner by far more than 40.
static void merge(pieces *p) {
  while (p->count > 1) {
    uint32_t best = 0;
    double least = INFINITY;
    for (uint32_t k = 0; k + 1 < p->count; ++k) {
      const uint32_t *at = p->start + k;
      double loss = misfit(p, at[0], at[2], NULL) - misfit(p, at[0], at[1], NULL) -
                    misfit(p, at[1], at[2], NULL);
      if (loss < least) least = loss, best = k;
    }
    if (least > 40 * p->noise * p->noise) return;
    memmove(&p->start[best + 1], &p->start[best + 2], (p->count - best - 1) * sizeof *p->start);
    p->count--;
  }
}

static double line_at(const line *l, double t) { return l->mean_v + l->slope * (t - l->mean_t); }

// First pieces of ten samples; the merging keeps those with a corner inside, shifting the boundary
// frees them for the second merging.
sonde_status sonde_track_fit(const double *time_s, const double *value, size_t stride,
                             uint32_t count, sonde_track *track, sonde_error *error) {
  enum { FIRST = 10 };
  SONDE_ASSERT(count >= 3);
  pieces p = {.samples = count, .count = (count + FIRST - 1) / FIRST};
  *track = (sonde_track){0};
  p.sum = sonde_calloc(count + (size_t)1, sizeof *p.sum);
  p.start = SONDE_NEW(uint32_t, p.count + 1);
  double *bend = SONDE_NEW(double, count - 2);
  sonde_status status = p.sum && p.start && bend ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    // Median of |v[k-1] - 2 v[k] + v[k+1]|: 0.6745 sqrt(6) standard deviations of white noise;
    // corners are too few to move it. At least a micrometre.
    for (uint32_t k = 0; k + 2 < count; ++k)
      bend[k] = fabs(value[k * stride] - 2 * value[(k + 1) * stride] + value[(k + 2) * stride]);
    qsort(bend, count - 2, sizeof *bend, sonde_compare_reals);
    p.noise = fmax(1e-6, bend[(count - 2) / 2] / (0.67449 * sqrt(6.0)));
    for (uint32_t k = 0; k < count; ++k) {
      double t = time_s[k * stride] - time_s[0], v = value[k * stride];
      const double term[5] = {t, v, t * t, t * v, v * v};
      for (int m = 0; m < 5; ++m) p.sum[k + 1][m] = p.sum[k][m] + term[m];
    }
    for (uint32_t k = 0; k < p.count; ++k) p.start[k] = k * FIRST;
    p.start[p.count] = count;
    for (int round = 0; round < 4; ++round) {
      merge(&p);
      for (uint32_t k = 0; k + 1 < p.count; ++k) {
        uint32_t from = p.start[k], to = p.start[k + 2], best = p.start[k + 1];
        double least = INFINITY;
        for (uint32_t at = from + 2; at + 2 <= to; ++at) {
          double sum = misfit(&p, from, at, NULL) + misfit(&p, at, to, NULL);
          if (sum < least) least = sum, best = at;
        }
        p.start[k + 1] = best;
      }
    }
    merge(&p);
    status = sonde_track_create(p.count + 1, track, error);
  }
  if (!status) {
    // Times in the sums, and so those of the lines, count from the first sample.
    double origin = time_s[0], end = time_s[(p.samples - 1) * stride] - origin;
    line now, before = {0};
    for (uint32_t k = 0; k < p.count; ++k) {
      misfit(&p, p.start[k], p.start[k + 1], &now);
      if (k > 0) {
        // Between the middles of both pieces; lines that do not cross there meet at the boundary.
        double boundary = time_s[p.start[k] * stride] - origin, slope = before.slope - now.slope;
        double cross = (line_at(&now, boundary) - line_at(&before, boundary)) / slope + boundary;
        bool meet = fabs(slope) > 0 && cross > before.mean_t && cross < now.mean_t;
        double time = meet ? cross : boundary;
        track->time_s[track->count] = time;
        track->value[track->count++] = 0.5 * (line_at(&before, time) + line_at(&now, time));
      } else {
        track->value[track->count++] = line_at(&now, 0); // at time 0
      }
      before = now;
    }
    track->time_s[track->count] = end;
    track->value[track->count++] = line_at(&before, end);
    for (uint32_t k = 0; k < track->count; ++k) track->time_s[k] += origin;
  }
  sonde_free(p.sum);
  sonde_free(p.start);
  sonde_free(bend);
  return status;
}
