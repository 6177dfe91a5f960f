// Sound speeds: where the tissue's own speeds draw it. The march goes down the true depths along
// bent rays, one per line; tables lead from true to drawn places and back.
#ifndef SONDE_SRC_ECHO_SOUND_H
#define SONDE_SRC_ECHO_SOUND_H

#include "base/vector_records.h"
#include "echo/echo.h"

enum {
  SOUND_EVERY = 3, // rows of the march per row of the tables
  SOUND_ROWS = (SONDE_MEDIUM_ROWS - 1) / SOUND_EVERY + 1,
  SOUND_MARGIN = 48, // half the widest beam, lines
  SOUND_WIDE = SONDE_MOST_LINES + 2 * SOUND_MARGIN,
  SHIFT_STEP = 8, // columns of the grid per column of the shifts
  SHIFT_COLUMNS =
      (SONDE_FINE * SONDE_MOST_LINES + 2 * SONDE_MOST_TAPS + 4 * ECHO_ALIGN) / SHIFT_STEP + 2,
};
enum {
  KEPT_DEPTHS = 12, // depths of the aberration's table, beside the face
  KEPT_COLUMNS = SONDE_MOST_LINES + SONDE_MOST_TAPS + 2 * ECHO_ALIGN
};
_Static_assert((SOUND_ROWS - 1) * SOUND_EVERY == SONDE_MEDIUM_ROWS - 1, "the last row is tabled");

typedef struct sonde_sound {
  // Of this row of the march, per line; beside the outer ones these go on.
  float wide_line[SOUND_WIDE];    // where the ray is, lines
  float wide_slow[SOUND_WIDE];    // assumed speed over the tissue's, less 1
  float *line, *slow;             // of the first line in them
  float turn[SONDE_MOST_LINES];   // its angle to the line, rad
  float shown[SONDE_MOST_LINES];  // depth at which it is drawn, m
  float before[SONDE_MOST_LINES]; // the same of the row above
  float mean[SONDE_MOST_LINES];   // slowness over the beam's width, less 1
  float spread[SONDE_MOST_LINES]; // amplitude that the rays' convergence leaves
  float gain[2][SONDE_MOST_LINES];
  uint32_t next[SONDE_MOST_LINES / 4]; // drawn row of the gains to come, per four lines
  // Rays by row and line.
  float trace_line[SOUND_ROWS][SONDE_MOST_LINES], trace_shown[SOUND_ROWS][SONDE_MOST_LINES];
  float trace_slow[SOUND_ROWS][SOUND_WIDE]; // way that it adds in one, m
  // Amplitude that aberration leaves of a point, by depth and even column of the grid, and where
  // the rest goes.
  float kept[KEPT_DEPTHS + 1][KEPT_COLUMNS];
  halo_taps halo;
  // From a true place to the drawn one: columns of the grid, 0, rows of the grid, 0.
  float_x4 shift[SOUND_ROWS][SHIFT_COLUMNS];
} sonde_sound;

// Whether tissues have their own speeds in this frame.
static inline bool sonde_sound_on(const sonde_echo *echo) { return echo->scanner.sound_speeds > 0; }

// Rays at the face.
void sonde_sound_begin(sonde_echo *echo);
// Coarse columns of the rays so many rows of the march on, for the upper or the lower coarse row.
void sonde_sound_aim(sonde_echo *echo, uint32_t which, float rows_on);
// A step to this row, whose levels are known.
void sonde_sound_step(sonde_echo *echo, uint32_t row);
// What the passage of an interface costs both ways, dB: between the tissues on both sides of a
// level, at that cosine between line and normal.
float sonde_sound_passage_db(const sonde_echo *echo, uint32_t level, float cosine);
// Drawn depth of a share of the way from the row above, and its rise per column where the true
// depth rises so.
float sonde_sound_depth(const sonde_echo *echo, uint32_t line, float share, float *rise_m);
// Gains of the march's row on to the drawn rows that it passes.
void sonde_sound_draw_gain(sonde_echo *echo, uint32_t row);
// The tables, after the last row.
void sonde_sound_end(sonde_echo *echo);
// What aberration leaves, after the last row.
void sonde_aberration_find(sonde_echo *echo);
// The true line and depth of a drawn one.
void sonde_sound_true_place(const sonde_echo *echo, double *line, double *depth_m);
// Takes an affine map of the grid to where it is drawn.
void sonde_sound_move(const sonde_echo *echo, splat_map *map);

#endif
