// Inside of the colour estimate.
#ifndef SONDE_SRC_FLOW_COLOUR_H
#define SONDE_SRC_FLOW_COLOUR_H

#include "echo/lines.h"
#include "sonde/flow_colour.h"

enum { COLOUR_PACKET = 16, COLOUR_ORDER = 3, COLOUR_NORMALS = 1 << 16 };
#define COLOUR_SOUND_M_S 1540.0
// Velocity along the beam from which pulses of a rate fold.
static inline double doppler_limit(double frequency_hz, double pulse_hz) {
  return COLOUR_SOUND_M_S * pulse_hz / (4 * frequency_hz);
}

// The lines of a box, and where line k, from 0, of its cells' middles leaves the face.
static inline sight_lines colour_sight(const sonde_colour_box *box) {
  return (sight_lines){box->radius_m, box->steer_rad};
}
static inline double colour_line(const sonde_colour_box *box, double k) {
  return box->left_m + (box->right_m - box->left_m) * (k + 0.5) / SONDE_COLOUR_LINES;
}

struct sonde_colour {
  sonde_colour_def def;
  uint64_t frame; // number of the next one
  bool holds;     // whether it keeps a share of the one before
  float normal[COLOUR_NORMALS + SONDE_COLOUR_CELLS];
  float poly[COLOUR_ORDER + 1][COLOUR_PACKET]; // orthonormal over the packet
  uint32_t blood_count;
  uint32_t blood[SONDE_COLOUR_CELLS];               // cells with blood
  float pattern[SONDE_COLOUR_CELLS][2];             // of the blood of each of them
  float turn[SONDE_COLOUR_CELLS][2];                // of its phase from pulse to pulse
  float keep[SONDE_COLOUR_CELLS];                   // of its pattern
  float loss[SONDE_COLOUR_CELLS];                   // of its amplitude
  float echo[COLOUR_PACKET][2][SONDE_COLOUR_CELLS]; // the packet
  float drift[2][SONDE_COLOUR_CELLS];               // of the tissue's phase from pulse to pulse
  float lag[3][SONDE_COLOUR_CELLS];                 // autocorrelation at 1, complex, and at 0
  float held[3][SONDE_COLOUR_CELLS];                // its averages
  sonde_colour_value value[SONDE_COLOUR_CELLS];
  float shown[3][SONDE_COLOUR_CELLS]; // of a picture: power times the phase, complex; power
};

// Stages of a frame, in order (colour_hot.c); `drawn` counts random numbers.
void colour_begin_echoes(sonde_colour *c, const sonde_colour_cell *cells, uint32_t *drawn);
void colour_begin_blood(sonde_colour *c, const sonde_colour_cell *cells, uint32_t *drawn);
void colour_add_blood(sonde_colour *c, uint32_t pulse, uint32_t *drawn);
void colour_correlate(sonde_colour *c);
void colour_average(sonde_colour *c);

#endif
