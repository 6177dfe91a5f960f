// The exact echo of a point: all paths from transmitting to receiving elements.
#include "base/base.h"
#include "base/maths.h"
#include "echo/echo.h"
#include "echo/reference.h"

enum { MOST = 257, TABLE = 4096, PER_SIGMA = 24, STRIPS = 64 };

static const double half_values = 2.3548200450309493; // full width over sigma

sonde_array sonde_array_default(void) {
  return (sonde_array){.frequency_hz = 7.5e6,
                       .sound_m_s = sonde_sound_m_s,
                       .focus_m = 0.025,
                       .transmit_f = 2.5,
                       .receive_f = 2,
                       .pitch_m = 0.3e-3,
                       .width_m = 0.27e-3,
                       .pulse_wavelengths = 1.1,
                       .height_m = 3e-3,
                       .lens_m = 0.025,
                       .most_elements = 128};
}

static double wavelength(const sonde_array *a) { return a->sound_m_s / a->frequency_hz; }
static double pulse_sigma(const sonde_array *a) {
  return a->pulse_wavelengths * wavelength(a) / half_values;
}

// Elements to either side of the middle one that an aperture reaches, at least one.
static double reach(const sonde_array *a, double aperture_m) {
  return clamp(0.5 * aperture_m / a->pitch_m, 1, 0.5 * a->most_elements);
}
// The outermost element counts in part, so that the aperture grows without steps.
static double share(double reach_elements, int i) {
  return clamp(reach_elements + 0.5 - abs(i), 0, 1);
}

static void element(const sonde_array *a, int i, double place[2], double normal[2]) {
  double at = i * a->pitch_m, angle = a->radius_m > 0 ? at / a->radius_m : 0;
  normal[0] = sin(angle), normal[1] = cos(angle);
  place[0] = a->radius_m > 0 ? a->radius_m * normal[0] : at;
  place[1] = a->radius_m > 0 ? a->radius_m * (normal[1] - 1) : 0;
}

// Way between element i and (x, z): length, and amplitude from obliquity, width and spreading.
static double aim(const sonde_array *a, int i, double x, double z, double *amplitude) {
  double place[2], normal[2];
  element(a, i, place, normal);
  double dx = x - place[0], dz = z - place[1], length = sqrt(dx * dx + dz * dz);
  double cosine = (dx * normal[0] + dz * normal[1]) / fmax(length, 1e-9);
  double sine = (dx * normal[1] - dz * normal[0]) / fmax(length, 1e-9);
  double u = SONDE_PI * a->width_m * sine / wavelength(a);
  double wide = fabs(u) < 1e-6 ? 1 : sin(u) / u;
  *amplitude = fmax(cosine, 0) * wide / sqrt(fmax(length, a->pitch_m));
  return length;
}

// What focusing at depth z subtracts from the path of element i.
static double delay(const sonde_array *a, int i, double z) {
  double place[2], normal[2];
  element(a, i, place, normal);
  z -= place[1];
  return sqrt(place[0] * place[0] + z * z) - (z + place[1]);
}

void sonde_array_echo(const sonde_array *a, double x_m, double z_m, double depth_m,
                      double echo[2]) {
  SONDE_ASSERT(a != NULL && echo != NULL);
  double sigma = pulse_sigma(a), k = 2 * SONDE_PI / wavelength(a), total = 0;
  double send = reach(a, a->focus_m / a->transmit_f), take = reach(a, depth_m / a->receive_f);
  echo[0] = echo[1] = 0;
  for (int j = -(int)(take + 0.5); j <= (int)(take + 0.5); ++j) {
    double back, out, home = aim(a, j, x_m, z_m, &back) - delay(a, j, depth_m);
    total += share(take, j);
    for (int i = -(int)(send + 0.5); i <= (int)(send + 0.5); ++i) {
      double path = home + aim(a, i, x_m, z_m, &out) - delay(a, i, a->focus_m);
      double off = (depth_m - 0.5 * path) / sigma;
      double size = share(send, i) * share(take, j) * out * back * exp(-0.5 * off * off);
      echo[0] += size * cos(k * path), echo[1] -= size * sin(k * path);
    }
  }
  echo[0] /= total, echo[1] /= total;
}

// The transmitted wave at a scatterer over half its path, from `first` in steps.
typedef struct wave {
  double first, step;
  int count;
  double value[TABLE][2];
} wave;

// cos and sin by their series on a quarter turn, error 6e-9: the sums need very many.
static void turn(double angle, double *c, double *s) {
  double half_turns = floor(angle / SONDE_PI + 0.5), x = angle - half_turns * SONDE_PI, u = x * x;
  double sign = half_turns - 2 * floor(0.5 * half_turns) > 0.5 ? -1 : 1;
  double p = 1.0 / 479001600 * u - 1.0 / 3628800, q = 1.0 / 6227020800 * u - 1.0 / 39916800;
  p = ((((p * u + 1.0 / 40320) * u - 1.0 / 720) * u + 1.0 / 24) * u - 0.5) * u + 1;
  q = ((((q * u + 1.0 / 362880) * u - 1.0 / 5040) * u + 1.0 / 120) * u - 1.0 / 6) * u + 1;
  *c = sign * p, *s = sign * x * q;
}

void sonde_array_line(const sonde_array *a, double x_m, double z_m, double first_m, double step_m,
                      uint32_t count, double *echo) {
  SONDE_ASSERT(a != NULL && echo != NULL && step_m > 0);
  wave w;
  double length[MOST], back[MOST];
  const double k = 2 * SONDE_PI / wavelength(a), last = first_m + step_m * count;
  const int most = (int)(reach(a, fmax(last, z_m) / a->receive_f) + 0.5);
  SONDE_ASSERT(2 * most + 1 <= MOST);
  for (int j = -most; j <= most; ++j) length[j + most] = aim(a, j, x_m, z_m, &back[j + most]);
  // The transmitted wave's table: Gaussian pulses of all transmitting elements, each on equal steps
  // by two multiplications per value.
  double sigma = pulse_sigma(a);
  double send = reach(a, a->focus_m / a->transmit_f), path[MOST], weight[MOST];
  int sending = (int)(send + 0.5);
  SONDE_ASSERT(2 * sending + 1 <= MOST);
  double low = 1e9, high = -1e9;
  for (int i = -sending; i <= sending; ++i) {
    double p = 0.5 * (aim(a, i, x_m, z_m, &weight[i + sending]) - delay(a, i, a->focus_m));
    path[i + sending] = p;
    weight[i + sending] *= share(send, i);
    low = fmin(low, p), high = fmax(high, p);
  }
  w.first = low - 5 * sigma;
  w.step = fmax(sigma / PER_SIGMA, (high - low + 10 * sigma) / (TABLE - 2));
  w.count = (int)((high - low + 10 * sigma) / w.step) + 2;
  for (int n = 0; n < w.count; ++n) w.value[n][0] = w.value[n][1] = 0;
  const double q = w.step / sigma, shrink = exp(-q * q);
  for (int i = 0; i <= 2 * sending; ++i) {
    const double at = path[i], re = weight[i] * cos(2 * k * at), im = -weight[i] * sin(2 * k * at);
    int from = (int)ceil((at - 5 * sigma - w.first) / w.step);
    int to = (int)floor((at + 5 * sigma - w.first) / w.step);
    from = from < 0 ? 0 : from, to = to < w.count ? to : w.count - 1;
    double start = (w.first + from * w.step - at) / sigma;
    double g = exp(-0.5 * start * start), ratio = exp(-start * q - 0.5 * q * q);
    for (int n = from; n <= to; ++n) {
      w.value[n][0] += g * re, w.value[n][1] += g * im;
      g *= ratio, ratio *= shrink;
    }
  }
  for (uint32_t sample = 0; sample < count; ++sample, echo += 2) {
    // Sum over the receiving elements of the aperture that belongs to the depth.
    const double depth = first_m + sample * step_m, take = reach(a, depth / a->receive_f);
    const int half = (int)(take + 0.5);
    double total = 0;
    SONDE_ASSERT(half <= most);
    echo[0] = echo[1] = 0;
    for (int j = -half; j <= half; ++j) {
      double part = share(take, j), home = length[j + most] - delay(a, j, depth);
      total += part;
      double at = (depth - 0.5 * home - w.first) / w.step;
      if (!(at >= 0 && at < w.count - 1)) continue;
      int n = (int)at;
      double b = at - n, re = w.value[n][0] + b * (w.value[n + 1][0] - w.value[n][0]);
      double im = w.value[n][1] + b * (w.value[n + 1][1] - w.value[n][1]);
      double c, s, size = part * back[j + most];
      turn(k * home, &c, &s);
      echo[0] += size * (re * c + im * s), echo[1] += size * (im * c - re * s);
    }
    echo[0] /= total, echo[1] /= total;
  }
}

// One-way amplitude at (y, z) of an aperture whose lens focuses at lens_m, Fresnel approximation.
static double fresnel(const sonde_array *a, double y, double z) {
  double k = 2 * SONDE_PI / wavelength(a), re = 0, im = 0;
  for (int i = 0; i < STRIPS; ++i) {
    double e = a->height_m * ((i + 0.5) / STRIPS - 0.5);
    double phase = k * (0.5 * e * e * (1 / z - 1 / a->lens_m) - e * y / z);
    re += cos(phase), im += sin(phase);
  }
  return sqrt(re * re + im * im) / STRIPS;
}

double sonde_array_elevation(const sonde_array *a, double y_m, double z_m) {
  SONDE_ASSERT(a != NULL && z_m > 0);
  double ratio = fresnel(a, y_m, z_m) / fmax(fresnel(a, 0, z_m), 1e-9);
  return ratio * ratio;
}

double sonde_array_elevation_half(const sonde_array *a, double z_m) {
  SONDE_ASSERT(a != NULL && a->height_m > 0);
  // The kernel is at its half value at y = h sqrt(1/2). The outermost half value of the
  // beam counts: near the face it is as wide as the aperture and ripples.
  double z = fmax(z_m, 1e-3), step = 0.1e-3, centre = fresnel(a, 0, z), outside = 0, y = 0;
  for (y = 1.5 * a->height_m; y > step; y -= step) {
    double ratio = fresnel(a, y, z) / fmax(centre, 1e-9), level = ratio * ratio;
    if (level > 0.5) {
      y += step * (level - 0.5) / fmax(level - outside, 1e-9);
      break;
    }
    outside = level;
  }
  return y / 0.7071067811865476;
}

// ---- images of points ------------------------------------------------------------------------

sonde_status sonde_echo_reference_points(const sonde_echo *echo, double aperture_m,
                                         const sonde_echo_settings *settings,
                                         const sonde_echo_point *points, uint32_t count,
                                         const uint32_t lines[2], const uint32_t samples[2],
                                         float *envelope, sonde_error *error) {
  SONDE_ASSERT(echo != NULL && points != NULL && envelope != NULL && settings != NULL);
  if (lines[0] > lines[1] || lines[1] >= echo->lines || samples[0] > samples[1] ||
      samples[1] >= echo->samples)
    return sonde_fail(error, SONDE_ARGUMENT, "window beyond the %u lines of %u samples",
                      echo->lines, echo->samples);
  sonde_echo view = {.lines = echo->lines, .samples = echo->samples, .scanner = echo->scanner};
  view.frame.radius_m = echo->frame.radius_m;
  sonde_echo_geometry(&view, aperture_m, settings);
  const frame *f = &view.frame;
  const uint32_t height = samples[1] - samples[0] + 1;
  double *column = SONDE_NEW(double, 4 * (size_t)echo->samples);
  if (column == NULL) return sonde_fail_memory(error);
  double *one = column + 2 * (size_t)echo->samples;
  const beam_key key = sonde_echo_key(f);
  const sonde_array array = sonde_beam_array(&key);
  const double near = 8 * array.pulse_wavelengths * f->wavelength_m, wide = 20 * f->wavelength_m;
  for (uint32_t l = lines[0]; l <= lines[1]; ++l) {
    for (uint32_t n = 0; n < 2 * height; ++n) column[n] = 0;
    for (const sonde_echo_point *p = points; p < points + count; ++p) {
      // The point in the line's own frame, which turns about the centre of a curved face.
      double x = p->x_m, z = p->z_m, v = (l - f->first_line) * f->pitch_m;
      if (f->radius_m > 0) {
        double angle = v / f->radius_m, c = cos(angle), s = sin(angle), from = p->z_m + f->radius_m;
        x = p->x_m * c - from * s, z = p->x_m * s + from * c - f->radius_m;
      } else {
        x -= v;
      }
      if (fabs(x) > wide || !(z > 0)) continue;
      // Its echo at the samples about it.
      int64_t low = (int64_t)floor((z - near) / f->step_m);
      int64_t high = (int64_t)ceil((z + near) / f->step_m);
      if (low < samples[0]) low = samples[0];
      if (high > samples[1]) high = samples[1];
      if (low > high) continue;
      const uint32_t some = (uint32_t)(high - low + 1);
      const double size = p->amplitude * sonde_array_elevation(&array, p->y_m, z);
      sonde_array_line(&array, x, z, (double)low * f->step_m, f->step_m, some, one);
      double *out = column + 2 * (low - samples[0]);
      for (uint32_t n = 0; n < 2 * some; ++n) out[n] += size * one[n];
    }
    for (uint32_t n = 0; n < height; ++n)
      envelope[(size_t)(samples[0] + n) * echo->lines + l] =
          (float)hypot(column[2 * n], column[2 * n + 1]);
  }
  sonde_free(column);
  return SONDE_OK;
}
