// The fast image measured against the exact one.
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"
#include "sonde/echo_validate.h"

enum { PLACES = 161, FRACTIONS = 8, SINC = 8 };

static const double block_x_m = 7e-3, block_z_m = 3e-3;
static const double rim_x_m = 1.5e-3, rim_z_m = 0.5e-3;

// Random scatterers in a block about the middle line.
static void fill_block(sonde_echo_point *p, uint32_t count, double depth_m, uint64_t seed) {
  for (uint32_t i = 0; i < count; ++i)
    p[i] = (sonde_echo_point){.x_m = block_x_m * (sonde_random_uniform(seed, 3 * i) - 0.5),
                              .z_m = depth_m +
                                     block_z_m * (sonde_random_uniform(seed, 3 * i + 1) - 0.5),
                              .amplitude = sonde_random_bits(seed, 3 * i + 2) & 1024 ? 1 : -1};
}

// First and last that count.
typedef struct window {
  uint32_t lines[2], samples[2];
} window;

// Lines and samples that lie near a depth on the middle line.
static window window_of(const sonde_echo_view *view, double depth_m, double half_x, double half_z) {
  double pitch = view->aperture_m / (view->echo->lines - 1), middle = 0.5 * (view->echo->lines - 1);
  double step = view->settings.depth_m / (view->echo->samples - 1);
  uint32_t last = view->echo->samples - 1;
  window w = {{(uint32_t)fmax(0, ceil(middle - half_x / pitch)),
               (uint32_t)fmin(2 * middle, floor(middle + half_x / pitch))},
              {(uint32_t)fmax(0, ceil((depth_m - half_z) / step)),
               (uint32_t)fmin(last, floor((depth_m + half_z) / step))}};
  SONDE_ASSERT(w.lines[0] <= w.lines[1] && w.samples[0] <= w.samples[1]);
  return w;
}

// Envelope of the fast image.
static const float *draw(const sonde_echo_view *v, const sonde_echo_point *p, uint32_t count) {
  uint32_t lines, samples;
  sonde_echo_render_points(v->echo, v->aperture_m, &v->settings, p, count);
  return sonde_echo_envelope(v->echo, &lines, &samples);
}

sonde_status sonde_echo_likeness(const sonde_echo_view *view, double depth_m, uint32_t count,
                                 uint64_t seed, double *likeness, sonde_error *error) {
  SONDE_ASSERT(view != NULL && likeness != NULL && count > 0);
  size_t pixels = (size_t)view->echo->lines * view->echo->samples;
  sonde_echo_point *points = SONDE_NEW(sonde_echo_point, count);
  float *exact = SONDE_NEW(float, pixels);
  sonde_status status = points && exact ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    window w = window_of(view, depth_m, 0.5 * block_x_m - rim_x_m, 0.5 * block_z_m - rim_z_m);
    fill_block(points, count, depth_m, seed);
    status = sonde_echo_reference_points(view->echo, view->aperture_m, &view->settings, points,
                                         count, w.lines, w.samples, exact, error);
    if (!status) {
      // Pearson's coefficient over the window.
      const float *fast = draw(view, points, count);
      double n = 0, sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
      for (uint32_t s = w.samples[0]; s <= w.samples[1]; ++s)
        for (uint32_t l = w.lines[0]; l <= w.lines[1]; ++l) {
          double x = (double)fast[(size_t)s * view->echo->lines + l],
                 y = (double)exact[(size_t)s * view->echo->lines + l];
          n += 1, sa += x, sb += y, aa += x * x, bb += y * y, ab += x * y;
        }
      *likeness = (ab - sa * sb / n) / sqrt((aa - sa * sa / n) * (bb - sb * sb / n));
    }
  }
  sonde_free(points);
  sonde_free(exact);
  return status;
}

// Largest value of a window.
static double peak(const float *image, uint32_t stride, const window *w) {
  double most = 0;
  for (uint32_t s = w->samples[0]; s <= w->samples[1]; ++s)
    for (uint32_t l = w->lines[0]; l <= w->lines[1]; ++l)
      most = fmax(most, (double)image[(size_t)s * stride + l]);
  return most;
}

// Full width at half the largest value of a profile.
static double half_width(const double *p, double step) {
  int top = 0, left, right;
  for (int i = 0; i < PLACES; ++i)
    if (p[i] > p[top]) top = i;
  double half = 0.5 * p[top];
  for (left = top; left > 0 && p[left] > half;) --left;
  for (right = top; right < PLACES - 1 && p[right] > half;) ++right;
  double a = left + (half - p[left]) / fmax(p[left + 1] - p[left], 1e-12);
  double b = right - (half - p[right]) / fmax(p[right - 1] - p[right], 1e-12);
  return (b - a) * step;
}

// Envelope that the middle line sees of a point at each place: beside it (largest along depth), or
// along it at one sample.
static sonde_status profile(const sonde_echo_view *v, double depth_m, bool beside, double step,
                            float *scratch, double *fast, double *exact, sonde_error *error) {
  double pitch = v->aperture_m / (v->echo->lines - 1);
  double sample_m = v->settings.depth_m / (v->echo->samples - 1);
  window w = window_of(v, depth_m, 0.6 * pitch, beside ? 0.6e-3 : 0.6 * sample_m);
  w.lines[1] = w.lines[0];
  if (!beside) w.samples[1] = w.samples[0];
  double x0 = (w.lines[0] - 0.5 * (v->echo->lines - 1)) * pitch, z0 = w.samples[0] * sample_m;
  for (int i = 0; i < PLACES; ++i) {
    double offset = (i - PLACES / 2) * step;
    sonde_echo_point p = {
        .x_m = beside ? x0 + offset : x0, .z_m = beside ? depth_m : z0 + offset, .amplitude = 1};
    fast[i] = peak(draw(v, &p, 1), v->echo->lines, &w);
    sonde_status status = sonde_echo_reference_points(v->echo, v->aperture_m, &v->settings, &p, 1,
                                                      w.lines, w.samples, scratch, error);
    if (status) return status;
    exact[i] = peak(scratch, v->echo->lines, &w);
  }
  return SONDE_OK;
}

sonde_status sonde_echo_point_widths(const sonde_echo_view *view, double depth_m,
                                     sonde_echo_widths *fast, sonde_echo_widths *reference,
                                     sonde_error *error) {
  SONDE_ASSERT(view != NULL && fast != NULL && reference != NULL);
  float *scratch = SONDE_NEW(float, (size_t)view->echo->lines * view->echo->samples);
  if (scratch == NULL) return sonde_fail_memory(error);
  double a[PLACES], b[PLACES], step = 0.1 * view->aperture_m / (view->echo->lines - 1);
  sonde_status status = profile(view, depth_m, true, step, scratch, a, b, error);
  fast->lateral_m = half_width(a, step), reference->lateral_m = half_width(b, step);
  step = 0.1 * view->settings.depth_m / (view->echo->samples - 1);
  if (!status) status = profile(view, depth_m, false, step, scratch, a, b, error);
  fast->axial_m = half_width(a, step), reference->axial_m = half_width(b, step);
  sonde_free(scratch);
  return status;
}

sonde_status sonde_echo_flicker(const sonde_echo_view *view, double depth_m, uint32_t count,
                                uint64_t seed, double *flicker, sonde_error *error) {
  SONDE_ASSERT(view != NULL && flicker != NULL && count > 0);
  uint32_t lines = view->echo->lines;
  size_t pixels = (size_t)lines * view->echo->samples;
  sonde_echo_point *points = SONDE_NEW(sonde_echo_point, count);
  float *still = SONDE_NEW(float, pixels);
  sonde_status status = points && still ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    window w = window_of(view, depth_m, 0.5 * block_x_m - rim_x_m, 0.5 * block_z_m - rim_z_m);
    double step = view->settings.depth_m / (view->echo->samples - 1), change = 0, size = 0;
    fill_block(points, count, depth_m, seed);
    // The image of still scatterers against those that moved down, moved back.
    const float *image = draw(view, points, count);
    for (size_t i = 0; i < pixels; ++i) still[i] = image[i];
    for (int k = 1; k < FRACTIONS; ++k) {
      for (uint32_t i = 0; i < count; ++i) points[i].z_m += step / FRACTIONS;
      image = draw(view, points, count);
      for (uint32_t s = w.samples[0]; s <= w.samples[1]; ++s)
        for (uint32_t l = w.lines[0]; l <= w.lines[1]; ++l) {
          double before = (double)still[(size_t)s * lines + l];
          // Envelope k / FRACTIONS of a sample further, from a windowed sinc of the intensity.
          double sum = 0;
          for (int j = 1 - SINC; j <= SINC; ++j) {
            double x = (double)k / FRACTIONS - j;
            double v = (double)image[(size_t)((int64_t)s + j) * lines + l];
            double taper = cos(0.5 * SONDE_PI * x / SINC);
            sum += v * v * sin(SONDE_PI * x) / (SONDE_PI * x) * taper * taper;
          }
          double off = sqrt(fmax(sum, 0)) - before;
          change += off * off, size += before * before;
        }
    }
    *flicker = sqrt(change / size);
  }
  sonde_free(points);
  sonde_free(still);
  return status;
}
