// Scan conversion of one row of pixels, bilinear or bicubic. Included by kernel.c only.
#ifndef SONDE_SRC_ECHO_KERNEL_PICTURE_H
#define SONDE_SRC_ECHO_KERNEL_PICTURE_H

#include "base/base.h"
#include "echo/kernel_rows.h"

#include <string.h>

// Angle of (z, x), |x| < 2 z: arctangent of less than 50 degrees.
INLINE floats angle_of(floats x, floats z) {
  floats t = x / (z + vsqrt(x * x + z * z)), u = t * t; // half the angle
  floats p = 0.19961517305842502f + u * (-0.13722131260315293f + u * 0.07586774308787624f);
  return 2 * t * (0.9999999631898905f + u * (-0.33332396678715026f + u * p));
}

// A Catmull-Rom spline through four values, between the second and the third, within the grey
// scale.
INLINE floats cubic(floats t, floats a, floats b, floats c, floats d) {
  floats u = c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a));
  return vmin(vmax(b + 0.5f * t * u, vset(0)), vset(255));
}

// Grey of pixels below a curved face.
INLINE floats pixel_of(const convert_job *job, floats x) {
  floats from = vset(job->z + job->radius_m), v = angle_of(x, from) * job->radius_m;
  floats depth = vsqrt(x * x + from * from) - job->radius_m;
  floats line = v * job->lines_per_m + job->first_line, sample = depth * job->samples_per_m;
  float right = (float)(job->lines - 1), bottom = (float)(job->samples - 1);
  ints in = (line >= 0) & (line < right) & (sample >= 0) & (sample < bottom);
  line = vonly(in, line), sample = vonly(in, sample);
  ints l = vint(line), n = vint(sample), at = n * (int32_t)job->stride + l;
  floats a = line - vreal(l), b = sample - vreal(n);
  if (job->cubic) { // samples are closer than pixels
    const int32_t next = (int32_t)job->stride;
    const ints first = at + (l > 0), last = at + 2 + (l + 2 > (int32_t)job->lines - 1);
    const ints places[4] = {first, at, at + 1, last};
    floats mixed[4];
    for (int k = 0; k < 4; ++k) {
      floats top = vgather(job->grey, places[k]);
      mixed[k] = top + b * (vgather(job->grey, places[k] + next) - top);
    }
    return vonly(in, cubic(a, mixed[0], mixed[1], mixed[2], mixed[3]) + 0.5f);
  }
  floats p = vgather(job->grey, at), q = vgather(job->grey, at + 1);
  at = at + (int32_t)job->stride;
  floats r = vgather(job->grey, at), s = vgather(job->grey, at + 1);
  p = p + a * (q - p), r = r + a * (s - r);
  return vonly(in, p + b * (r - p) + 0.5f);
}

// One depth for the whole row of pixels: first between samples, then between lines.
INLINE floats pixel_between(const convert_job *job, const float *mixed, bool close, floats x) {
  floats line = x * job->lines_per_m + job->first_line;
  ints in = (line >= 0) & (line < (float)(job->lines - 1));
  if (!vany(in)) return vset(0);
  line = vonly(in, line);
  ints l = vint(line);
  floats a = line - vreal(l), p, q;
  if (job->cubic) {
    floats value[4];
    const int32_t from = in[0] ? l[0] : 0;
    const ints at = in & (l - from);
    for (int k = 0; k < 4; ++k)
      value[k] = close ? vlook_up(mixed + from + k - 1, at) : vgather(mixed + k - 1, l);
    return vonly(in, cubic(a, value[0], value[1], value[2], value[3]) + 0.5f);
  }
  if (close) {
    const int32_t from = in[0] ? l[0] : 0;
    const ints at = in & (l - from);
    p = vlook_up(mixed + from, at), q = vlook_up(mixed + from + 1, at);
  } else {
    p = vgather(mixed, l), q = vgather(mixed, l + 1);
  }
  return vonly(in, p + a * (q - p) + 0.5f);
}

// Grey of all lines at the depth of a row of pixels.
INLINE void mix_samples(const convert_job *job, float *mixed) {
  float sample = job->z * job->samples_per_m;
  uint32_t n = (uint32_t)sample < job->samples - 2 ? (uint32_t)sample : job->samples - 2;
  const float *top = job->grey + (size_t)n * job->stride, *low = top + job->stride;
  if (!job->cubic) {
    for (uint32_t l = 0; l < job->stride; l += FLOATS)
      vstore(mixed + l, vload(top + l) + (sample - (float)n) * (vload(low + l) - vload(top + l)));
    vstore(mixed + job->stride, vset(0)); // read beside the last line, not used
    return;
  }
  const float *above = n > 0 ? top - job->stride : top;
  const float *below = n + 2 < job->samples ? low + job->stride : low;
  const floats t = vset(sample - (float)n);
  for (uint32_t l = 0; l < job->stride; l += FLOATS)
    vstore(mixed + l, cubic(t, vload(above + l), vload(top + l), vload(low + l), vload(below + l)));
  mixed[-1] = mixed[0];
  mixed[job->lines] = mixed[job->lines - 1];
}

typedef uint8_t bytes_wide __attribute__((vector_size(VECTOR_BYTES / 4)));

static void convert(const convert_job *job) {
  SONDE_ASSERT(job->lines_per_m > 0 && job->stride <= SONDE_MOST_LINES);
  float ramp[FLOATS], room[SONDE_MOST_LINES + 2 * FLOATS + 1], *mixed = room + FLOATS;
  for (int k = 0; k < FLOATS; ++k) ramp[k] = (float)k;
  const bool flat = !(job->radius_m > 0),
             close = (FLOATS - 1) * job->dx * job->lines_per_m < FLOATS - 2;
  if (flat) mix_samples(job, mixed);
  for (uint32_t c = 0; c < job->width; c += FLOATS) {
    floats x = job->x + ((float)c + vload(ramp)) * job->dx;
    ints grey = vint(flat ? pixel_between(job, mixed, close, x) : pixel_of(job, x));
    bytes_wide bytes = __builtin_convertvector(grey, bytes_wide);
    if (c + FLOATS <= job->width)
      memcpy(job->out + c, &bytes, FLOATS);
    else
      memcpy(job->out + c, &bytes, job->width - c);
  }
}

#endif
