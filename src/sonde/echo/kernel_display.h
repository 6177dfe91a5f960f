// A scanner's display on scan lines: smoothing along lines of tissue, sharpening, persistence, grey
// map. Included by kernel.c only.
#ifndef SONDE_SRC_ECHO_KERNEL_DISPLAY_H
#define SONDE_SRC_ECHO_KERNEL_DISPLAY_H

#include "base/base.h"
#include "echo/kernel.h"

_Static_assert((int)SMOOTH_LINES == 8, "a vector");

static void smooth_lines(const smooth_job *job) {
  SONDE_ASSERT(job->end <= job->samples && job->samples > 0);
  const int32_t last = (int32_t)job->samples - 1;
  for (uint32_t n = job->first; n < job->end; ++n) {
    float_x8 value = vload_float_x8(job->log + (size_t)n * job->stride);
    if (job->weight > 0) {
      float_x8 smooth = vset_float_x8(0);
      UNROLL for (int t = 0; t < SMOOTH_TAPS; ++t) {
        int32_t at = (int32_t)n + job->row[t];
        at = at < 0 ? 0 : at > last ? last : at;
        const float *p = job->log + (ptrdiff_t)at * job->stride + job->line[t];
        const float_x8 left = vload_float_x8(p), right = vload_float_x8(p + 1);
        smooth = smooth + smooth_bell[t] * (left + job->next[t] * (right - left));
      }
      value = value + job->weight * (smooth - value);
    }
    vstore(job->out + (size_t)(n - job->first) * job->out_stride, value);
  }
}

static void show(const show_job *job) {
  SONDE_ASSERT(job->lines % ECHO_ALIGN == 0);
  for (uint32_t l = 0; l < job->lines; l += FLOATS) {
    floats value = vload(job->grey + l);
    if (job->sharp > 0) {
      const floats top = vload(job->top + l), low = vload(job->low + l);
      value = value + job->sharp * (value - (top + job->share * (low - top)));
    }
    // A live picture follows changes of more than 20 grey levels at once.
    if (job->keep > 0) {
      const floats before = vload(job->held + l), change = value - before;
      const floats still = vmin(vmax(2 - vabs(change) * 0.05f, vset(0)), vset(1));
      value = before + (1 - job->keep * still) * change;
    }
    if (job->held) vstore(job->held + l, value);
    const floats shown = vmin(vmax(value, vset(0)), vset(255));
    vstore(job->grey + l, vgather(job->map, vint(shown * (job->steps / 255.0f) + 0.5f)));
  }
}

#endif
