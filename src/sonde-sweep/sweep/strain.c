// Axial strain from the envelopes of two pictures: cross-correlation of windows, then slopes.
#include "base/base.h"
#include "base/maths.h"
#include "sonde/sweep_strain.h"

enum { MOST_LAGS = 512 };

sonde_strain_def sonde_strain_def_default(void) {
  return (sonde_strain_def){.version = SONDE_DEF_VERSION,
                            .window_m = 2e-3,
                            .hop_m = 0.5e-3,
                            .most_m = 1e-3,
                            .slope_m = 4e-3,
                            .beside = 3};
}

// Two pictures, and the window whose place is sought.
typedef struct tracker {
  const float *before, *after;
  uint32_t lines, samples;
  int half, most;  // of the window and of the lags, samples
  uint32_t beside; // lines
} tracker;

// Displacement of a window about (sample, line), samples, and its likeness: the correlation with
// the window that lies so much deeper afterwards.
static double track(const tracker *t, int sample, uint32_t line, float *likeness) {
  const uint32_t left = line > t->beside ? line - t->beside : 0;
  const uint32_t right = line + t->beside < t->lines ? line + t->beside : t->lines - 1;
  double at[2 * MOST_LAGS + 1];
  int best = 0;
  SONDE_ASSERT(t->most > 0 && t->most <= MOST_LAGS);
  for (int lag = -t->most; lag <= t->most; ++lag) {
    double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    for (int k = sample - t->half; k <= sample + t->half; ++k) {
      if (k + lag < 0 || k + lag >= (int)t->samples) continue;
      const float *p = t->before + (size_t)k * t->lines;
      const float *q = t->after + (size_t)(k + lag) * t->lines;
      for (uint32_t l = left; l <= right; ++l) {
        const double x = (double)p[l], y = (double)q[l];
        n += 1, a += x, b += y, aa += x * x, bb += y * y, ab += x * y;
      }
    }
    const double both = n > 0 ? (aa - a * a / n) * (bb - b * b / n) : 0;
    at[lag + t->most] = both > 0 ? (ab - a * b / n) / sqrt(both) : 0;
    if (at[lag + t->most] > at[best]) best = lag + t->most;
  }
  *likeness = (float)at[best];
  if (best == 0 || best == 2 * t->most) return best - t->most;
  const double a = at[best - 1], b = at[best], c = at[best + 1], bend = a - 2 * b + c;
  return best - t->most + (bend < 0 ? 0.5 * (a - c) / bend : 0);
}

sonde_status sonde_strain_track(const float *before, const float *after, uint32_t lines,
                                uint32_t samples, double step_m, const sonde_strain_def *def,
                                sonde_strain *strain, sonde_error *error) {
  SONDE_ASSERT(before != NULL && after != NULL && strain != NULL && step_m > 0);
  const sonde_strain_def otherwise = sonde_strain_def_default();
  if (def == NULL) def = &otherwise;
  *strain = (sonde_strain){0};
  sonde_status status = sonde_def_check("strain", def->version, error);
  if (status) return status;
  const tracker t = {.before = before,
                     .after = after,
                     .lines = lines,
                     .samples = samples,
                     .half = (int)rint(0.5 * def->window_m / step_m),
                     .most = (int)ceil(def->most_m / step_m),
                     .beside = def->beside};
  const int hop = (int)fmax(rint(def->hop_m / step_m), 1);
  const int rows = ((int)samples - 1 - 2 * t.half) / hop + 1;
  if (t.half < 1 || rows < 2 || t.most < 1 || t.most > MOST_LAGS || !(def->slope_m > 0))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "windows of %g mm searched %g mm away do not fit into %u samples of %g mm",
                      1e3 * def->window_m, 1e3 * def->most_m, samples, 1e3 * step_m);
  const size_t places = (size_t)rows * lines;
  *strain = (sonde_strain){.rows = (uint32_t)rows,
                           .lines = lines,
                           .first_m = t.half * step_m,
                           .hop_m = hop * step_m,
                           .slope_m = def->slope_m,
                           .displacement_m = SONDE_NEW(float, places),
                           .likeness = SONDE_NEW(float, places),
                           .strain = SONDE_NEW(float, places)};
  if (!strain->displacement_m || !strain->likeness || !strain->strain) {
    sonde_strain_clear(strain);
    return sonde_fail_memory(error);
  }
  for (int row = 0; row < rows; ++row)
    for (uint32_t l = 0; l < lines; ++l) {
      const size_t i = (size_t)row * lines + l;
      strain->displacement_m[i] =
          (float)(step_m * track(&t, t.half + row * hop, l, &strain->likeness[i]));
    }
  sonde_strain_slopes(strain, strain->displacement_m, strain->likeness, strain->strain);
  return SONDE_OK;
}

void sonde_strain_slopes(const sonde_strain *s, const float *displacement_m, const float *weight,
                         float *slope) {
  SONDE_ASSERT(s != NULL && displacement_m != NULL && slope != NULL);
  const int half = (int)fmax(rint(0.5 * s->slope_m / s->hop_m), 1), last = (int)s->rows - 1;
  for (int row = 0; row <= last; ++row)
    for (uint32_t l = 0; l < s->lines; ++l) {
      double n = 0, z = 0, u = 0, zz = 0, zu = 0;
      for (int k = row - half < 0 ? 0 : row - half; k <= row + half && k <= last; ++k) {
        const size_t i = (size_t)k * s->lines + l;
        // Windows that are not alike say little.
        const double like = weight ? fmax((double)weight[i], 0) : 1, w = like * like + 1e-9;
        const double depth = k * s->hop_m, moved = (double)displacement_m[i];
        n += w, z += w * depth, u += w * moved, zz += w * depth * depth, zu += w * depth * moved;
      }
      const double spread = zz - z * z / n;
      slope[(size_t)row * s->lines + l] = (float)(spread > 0 ? (zu - z * u / n) / spread : 0);
    }
}

void sonde_strain_clear(sonde_strain *strain) {
  if (strain == NULL) return;
  sonde_free(strain->displacement_m), sonde_free(strain->likeness), sonde_free(strain->strain);
  *strain = (sonde_strain){0};
}
