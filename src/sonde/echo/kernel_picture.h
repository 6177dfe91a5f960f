// Scan conversion of one row of pixels, bilinear. Included by kernel.c only.
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
  const float *top = job->grey + (size_t)n * job->stride;
  mix(top, top + job->stride, sample - (float)n, mixed, job->stride);
  vstore(mixed + job->stride, vset(0)); // read beside the last line, not used
}

typedef uint8_t bytes_wide __attribute__((vector_size(VECTOR_BYTES / 4)));

static void convert(const convert_job *job) {
  SONDE_ASSERT(job->lines_per_m > 0 && job->stride <= SONDE_MOST_LINES);
  float ramp[FLOATS], mixed[SONDE_MOST_LINES + FLOATS + 1];
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
