// Rows of the march along the lines: the coarse plane between its nodes, and the gain of a row.
// Included by kernel.c only.
#ifndef SONDE_SRC_ECHO_KERNEL_ROWS_H
#define SONDE_SRC_ECHO_KERNEL_ROWS_H

#include "base/base.h"
#include "echo/kernel.h"
#include "echo/kernel_texture.h"

#include <string.h>

static void widen(const widen_job *job) {
  SONDE_ASSERT(job->lines % ECHO_ALIGN == 0);
  for (uint32_t l = 0; l < job->lines; l += FLOATS) {
    const int32_t from = job->column[l];
    ints column, at;
    memcpy(&column, job->column + l, sizeof column);
    at = column - from;
    floats left, right;
    if (job->column[l + FLOATS - 1] - from < FLOATS)
      left = vlook_up(job->in + from, at), right = vlook_up(job->in + from + 1, at);
    else
      left = vgather(job->in, column), right = vgather(job->in + 1, column);
    vstore(job->out + l, left + vload(job->share + l) * (right - left));
  }
}

// What is left of the scattered amplitude behind the losses, and the clutter beside it.
static void fade(const fade_job *job) {
  SONDE_ASSERT(job->lines % ECHO_ALIGN == 0);
  SONDE_ASSERT(job->clutter >= 0 && job->kept <= 1);
  for (uint32_t l = 0; l < job->lines; l += FLOATS) {
    floats loss = vmin(vload(job->loss_db + l), vset(600)), tail = vload(job->tail + l);
    floats left = power2(loss * -0.16609640474f), facets = vload(job->rough + l) * left;
    floats own = vload(job->scatter + l) * left, power = own * own;
    vstore(job->gain + l, vsqrt(power + facets * facets + job->clutter * tail));
    vstore(job->tail + l, job->kept * (tail + job->fresh * (power - tail)));
  }
}

#endif
