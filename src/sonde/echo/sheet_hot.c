// Interfaces between tissues as the beam sees them: smooth sheets, laid coherently on the columns
// of the grid before the lateral kernels.
//
// Where a line crosses an interface, the interface's tangent there is laid on the line's column
// and, at half the amplitude, on the columns beside it: neighbouring lines together make one sheet
// without gaps, and where an interface ends it fades within a line. By Kirchhoff's approximation a
// column holds as much at every slope: the sheet's area grows as its inclination to the beam takes
// away. So the lateral kernels alone decide what returns.
#include "base/base.h"
#include "echo/echo.h"

// Phase per column, half turns: up to the first a slope is laid whole, from the second on not at
// all, because at 1 it could not be told from a lesser slope. Where the columns are close enough
// for the beam, it receives nothing beyond the first.
static const float whole_up_to = 0.6f, none_from = 0.9f;

void sonde_sheet_begin(sonde_echo *echo) {
  SONDE_ASSERT(echo->grid_samples <= echo->samples + 2 * SONDE_MOST_TAPS);
  echo->sheet_count = 0;
  for (uint32_t n = 0; n < echo->grid_samples; ++n) echo->first_sheet[n] = -1;
}

// Beyond the outer lines the sheet goes on along its tangent as far as the kernels reach.
void sonde_sheet_add(sonde_echo *echo, uint32_t line, float depth_m, float rise_m,
                     float amplitude) {
  const frame *f = &echo->frame;
  const double turn = 4 * SONDE_PI / f->wavelength_m;
  // The lateral kernels undo the two linear taps that a scatterer is shared between; a sheet that
  // is spread over its columns by the same taps has the squared sinc of half the phase per column.
  const float half_turns = 4 * fabsf(rise_m) / (float)f->wavelength_m;
  const float u = 0.5f * (float)SONDE_PI * half_turns, sinc = u > 1e-3f ? sinf(u) / u : 1;
  const float t = fminf(fmaxf((half_turns - whole_up_to) / (none_from - whole_up_to), 0), 1);
  const float size = amplitude * (sinc * sinc * (1 - t * t * (3 - 2 * t)));
  SONDE_ASSERT(line < echo->lines && echo->pad_lines > 0);
  if (!(size > 0) || !(depth_m >= 0)) return;
  const int pad = (int)echo->pad_lines, column = pad + SONDE_FINE * (int)line;
  const int left = line == 0 ? -pad : -1, right = line + 1 == echo->lines ? pad : 1;
  for (int k = left; k <= right; ++k) {
    const bool shared = (k == -1 && line > 0) || (k == 1 && line + 1 < echo->lines);
    const float part = shared ? 0.5f * size : size, depth = depth_m + (float)k * rise_m;
    const float angle = (float)fmod(turn * (double)depth, 2 * SONDE_PI);
    // Into the list of the row nearest to it.
    const float row = depth / (float)f->step_m + (float)echo->pad_samples;
    const float nearest = floorf(row + 0.5f);
    SONDE_ASSERT(column + k >= 0 && column + k < (int)echo->grid_lines);
    if (!(nearest >= 0 && nearest < (float)echo->grid_samples)) continue;
    if (echo->sheet_count == SONDE_SHEET_POINTS) {
      ++echo->lost;
      continue;
    }
    int32_t *first = echo->first_sheet + (uint32_t)nearest;
    echo->sheet[echo->sheet_count] = (sheet_point){part * cosf(angle), -part * sinf(angle),
                                                   row - nearest, (uint32_t)(column + k), *first};
    *first = (int32_t)echo->sheet_count++;
  }
}

// Each point on the three rows about it, by a quadratic spline as scatterers are.
void sonde_sheet_lay(sonde_echo *echo, uint32_t row, float gain) {
  SONDE_ASSERT(row < echo->grid_samples);
  for (int side = -1; side <= 1; ++side) {
    const int64_t list = (int64_t)row + side;
    if (list < 0 || list >= echo->grid_samples) continue;
    for (int32_t k = echo->first_sheet[list]; k >= 0; k = echo->sheet[k].next) {
      const sheet_point *p = &echo->sheet[k];
      const float away = 0.5f - (float)side * p->beyond;
      const float share = gain * (side ? 0.5f * away * away : 0.75f - p->beyond * p->beyond);
      echo->line_re[p->column % SONDE_FINE][p->column / SONDE_FINE] += share * p->re;
      echo->line_im[p->column % SONDE_FINE][p->column / SONDE_FINE] += share * p->im;
    }
  }
}
