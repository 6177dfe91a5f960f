// Relaxation of held skin: static force and up to two falling exponentials behind each hold that
// follows a ramp in, their times by search over a grid in the logarithms that is refined.
#include "identify/summary.h"

#include "base/maths.h"
#include "base/order.h"

static const double SHORTEST_M = 1e-3; // a ramp goes at least this far
enum { GRID = 16, ROUNDS = 4, FEWEST = 20 };

sonde_span sonde_span_between(const sonde_motion_record *record, double start_s, double end_s) {
  sonde_span span = {0, record->count};
  while (span.from < record->count && record->samples[span.from].time_s < start_s) ++span.from;
  span.to = span.from;
  while (span.to < record->count && record->samples[span.to].time_s < end_s) ++span.to;
  return span;
}

double sonde_median(double *values, uint32_t count) {
  SONDE_ASSERT(count > 0);
  qsort(values, count, sizeof *values, sonde_compare_reals);
  return 0.5 * (values[(count - 1) / 2] + values[count / 2]);
}

// Force after the start of the hold.
typedef struct decay {
  const sonde_motion_sample *sample; // [count]
  uint32_t count;
  double start_s;
} decay;

typedef struct exponentials {
  double level, amplitude[2], tau_s[2], squares;
} exponentials;

// Normal equations of 1, e1, e2 with the first `terms` of them; false when they are dependent.
static bool solve_three(double a[3][4], int terms, double x[3]) {
  for (int p = 0; p < terms; ++p) {
    if (!(a[p][p] > 1e-9)) return false;
    for (int r = p + 1; r < terms; ++r) {
      double factor = a[r][p] / a[p][p];
      for (int c = p; c < 3; ++c) a[r][c] -= factor * a[p][c];
      a[r][3] -= factor * a[p][3];
    }
  }
  for (int p = terms - 1; p >= 0; --p) {
    x[p] = a[p][3];
    for (int c = p + 1; c < terms; ++c) x[p] -= a[p][c] * x[c];
    x[p] /= a[p][p];
  }
  return true;
}

// Best static force and amplitudes >= 0 for given times; squares is infinite when there are none.
static exponentials fit_amplitudes(const decay *d, double tau1_s, double tau2_s, int terms) {
  double a[3][4] = {{0}}, x[3] = {0}, total = 0;
  for (uint32_t k = 0; k < d->count; ++k) {
    double t = d->sample[k].time_s - d->start_s, f = d->sample[k].normal_n;
    const double g[3] = {1, exp(-t / tau1_s), exp(-t / tau2_s)};
    for (int p = 0; p < 3; ++p) {
      a[p][3] += g[p] * f;
      for (int q = 0; q < 3; ++q) a[p][q] += g[p] * g[q];
    }
    total += f * f;
  }
  const double right[3] = {a[0][3], a[1][3], a[2][3]};
  bool good = solve_three(a, terms, x) && x[1] >= 0 && x[2] >= 0;
  exponentials e = {x[0], {x[1], x[2]}, {tau1_s, tau2_s}, INFINITY};
  if (good) e.squares = fmax(0, total - x[0] * right[0] - x[1] * right[1] - x[2] * right[2]);
  return e;
}

static double grid_point(double low, double high, int k) {
  return low * pow(high / low, (double)k / (GRID - 1));
}

// Each round narrows both ranges about the best pair.
static exponentials fit_times(const decay *d, double shortest_s, double longest_s, int terms) {
  SONDE_ASSERT(d->count >= FEWEST && shortest_s > 0 && longest_s > shortest_s && terms >= 2);
  exponentials best = {.squares = INFINITY};
  double low[2] = {shortest_s, shortest_s}, high[2] = {longest_s, longest_s};
  for (int round = 0; round < ROUNDS; ++round) {
    exponentials now = best;
    for (int i = 0; i < GRID; ++i)
      for (int j = 0; j < (terms == 3 ? GRID : 1); ++j) {
        double first = grid_point(low[0], high[0], i), second = grid_point(low[1], high[1], j);
        if (terms == 3 && second < 1.5 * first) continue;
        exponentials e = fit_amplitudes(d, first, second, terms);
        if (e.squares < now.squares) now = e;
      }
    best = now;
    if (!isfinite(best.squares)) return best;
    for (int k = 0; k < 2; ++k) {
      double factor = pow(high[k] / low[k], 1.5 / (GRID - 1));
      low[k] = fmax(shortest_s, best.tau_s[k] / factor);
      high[k] = fmin(longest_s, best.tau_s[k] * factor);
    }
  }
  return best;
}

// A second exponential must explain more than noise would (a factor of 1 + 12/count); a constant
// stays when no falling exponential fits.
static exponentials fit_decay(const decay *d, double length_s) {
  double step = length_s / d->count;
  exponentials one = fit_times(d, step, 2 * length_s, 2);
  exponentials two = fit_times(d, step, 2 * length_s, 3);
  if (two.squares * (1 + 12.0 / d->count) < one.squares) return two;
  if (isfinite(one.squares)) {
    one.tau_s[1] = one.amplitude[1] = 0;
    return one;
  }
  exponentials none = {0};
  for (uint32_t k = 0; k < d->count; ++k) none.level += d->sample[k].normal_n / d->count;
  for (uint32_t k = 0; k < d->count; ++k) {
    double e = d->sample[k].normal_n - none.level;
    none.squares += e * e;
  }
  return none;
}

static double excess(const exponentials *e, double t) {
  double sum = 0;
  for (int k = 0; k < 2; ++k)
    if (e->amplitude[k] > 0) sum += e->amplitude[k] * exp(-t / e->tau_s[k]);
  return sum;
}

// Bisection for excess(t) = excess(0)/e; 0 when nothing relaxes.
static double relaxation_time(const exponentials *e) {
  double low = 0, high = fmax(e->tau_s[0], e->tau_s[1]), target = excess(e, 0) * exp(-1.0);
  if (!(target > 0)) return 0;
  for (int k = 0; k < 60; ++k) {
    double middle = 0.5 * (low + high);
    if (excess(e, middle) > target)
      low = middle;
    else
      high = middle;
  }
  return high;
}

sonde_status sonde_relaxation_read(const sonde_motion_record *record, sonde_relaxation *holds,
                                   uint32_t *count, sonde_error *error) {
  const sonde_motion_sample *s = record->samples;
  sonde_track track;
  *count = 0;
  sonde_status status = sonde_track_fit(&s->time_s, &s->penetration_m, sizeof *s / sizeof(double),
                                        record->count, &track, error);
  if (status) return status;
  for (uint32_t k = 1; k + 1 < track.count && *count < SONDE_HOLDS; ++k) {
    double ramp = sonde_track_slope(&track, k - 1), way = track.value[k] - track.value[k - 1];
    bool in = ramp > SONDE_STANDS_M_S && way > SHORTEST_M && track.value[k] > 0;
    if (!in || fabs(sonde_track_slope(&track, k)) > fmax(SONDE_STANDS_M_S, 0.05 * ramp)) continue;
    // The static force, the exponentials above it and the power law of one hold.
    double start_s = track.time_s[k], end_s = track.time_s[k + 1];
    sonde_span span = sonde_span_between(record, start_s, end_s);
    decay d = {record->samples + span.from, span.to - span.from, start_s};
    if (d.count < FEWEST) continue;
    sonde_relaxation *hold = &holds[(*count)++];
    *hold = (sonde_relaxation){.depth_m = track.value[k],
                               .speed_m_s = ramp,
                               .start_s = start_s,
                               .length_s = end_s - start_s};
    exponentials e = fit_decay(&d, end_s - start_s);
    hold->static_n = e.level;
    hold->peak_n = e.level + excess(&e, 0);
    hold->ratio = hold->peak_n / hold->static_n;
    hold->relaxation_s = relaxation_time(&e);
    for (int i = 0; i < 2; ++i) {
      hold->tau_s[i] = e.tau_s[i];
      hold->amplitude_n[i] = e.amplitude[i];
    }
    // Slope of ln F over ln t, by least squares over the samples with F > 0 and t > 0.
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    for (uint32_t i = 0; i < d.count; ++i) {
      double t = d.sample[i].time_s - start_s, f = d.sample[i].normal_n;
      if (!(t > 0) || !(f > 0)) continue;
      double lx = log(t), ly = log(f);
      n += 1, x += lx, y += ly, xx += lx * lx, xy += lx * ly;
    }
    double spread = n * xx - x * x;
    hold->power = spread > 0 ? (n * xy - x * y) / spread : 0;
    hold->rms_n = sqrt(e.squares / d.count);
  }
  sonde_track_clear(&track);
  return *count ? SONDE_OK
                : sonde_fail(error, SONDE_FORMAT,
                             "no ramp into the skin with a hold after it, expected at least one of "
                             "%g mm and %d samples",
                             SHORTEST_M * 1e3, FEWEST);
}
