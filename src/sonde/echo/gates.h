// What can matter between two coarse rows of the plane: most vessels, muscles and bodies in view
// are far from most lines.
#ifndef SONDE_SRC_ECHO_GATES_H
#define SONDE_SRC_ECHO_GATES_H

#include "echo/echo.h"

enum { GATE_THINGS = MOST_VESSELS + MOST_BODIES };
_Static_assert(GATE_THINGS < 32 && MOST_CELLS < 32, "a bit each");

// A coarse row with the vessels, then the bodies, side by side, and the cells.
typedef struct gate_row {
  float place[3][SONDE_PLANE_COLUMNS][GATE_THINGS]; // over the semi-axes; third one where it counts
  float half[SONDE_PLANE_COLUMNS][GATE_THINGS];     // least semi-axis, m
  float power[SONDE_PLANE_COLUMNS][MOST_CELLS];     // mm^2
} gate_row;

typedef struct sonde_gates {
  uint32_t row; // the coarse row above
  // Between which coarse columns the lines are, at the coarse rows above and below.
  int32_t column[2][SONDE_MOST_LINES]; // to the left of each line, ascending
  float share[2][SONDE_MOST_LINES];    // of the distance to the next
  tissue_gate block[SONDE_MOST_LINES / ECHO_ALIGN];
  uint32_t vessels, cells, bodies; // of any block, a bit each
  gate_row turned[2];              // even and odd rows
  float reach[GATE_THINGS];        // m beyond a circle as wide as the least semi-axis
  float cell_x[MOST_CELLS], cell_y[MOST_CELLS], cell_number[MOST_CELLS]; // mm
} sonde_gates;

// Vessels, cells and bodies of the job that can matter to blocks of lines between the coarse rows j
// and j + 1, j ascending from 0. What is left out changes nothing that a row of the march makes.
void sonde_gates_find(sonde_echo *echo, const tissue_job *job, uint32_t j);

#endif
