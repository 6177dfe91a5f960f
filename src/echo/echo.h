// Inside of the echo room: buffers of one renderer and the stages that fill them.
#ifndef SONDE_SRC_ECHO_H
#define SONDE_SRC_ECHO_H

#include "base/maths.h"
#include "interior/interior.h"
#include "sonde/echo.h"

enum {
  SONDE_PLANE_COLUMNS = 41, // coarse nodes across the image plane
  SONDE_PLANE_ROWS = 81,    // and down
  SONDE_MEDIUM_ROWS = 256,  // steps of the march along the lines
  SONDE_LINE_PAD = 12,      // lines beyond the aperture that the beam still reaches
  SONDE_SAMPLE_PAD = 12,
  SONDE_MAX_TAPS = 12,   // half width of the beam's kernels
  SONDE_MAX_ECHOES = 16, // specular echoes per line
  SONDE_POOL = 32768,    // random scatterers shared by all cells
  SONDE_NOISE = 65536,
  SONDE_PHASES = 4096,
  SONDE_CELL_SET = 65536, // hash set of visited cells
  SONDE_MAX_CELLS = 40000,
};

// Smooth fields over the image plane.
typedef enum plane_field {
  PLANE_THETA, // radians, unwrapped around the picture's centre
  PLANE_S,
  PLANE_DEPTH,
  PLANE_FAT,
  PLANE_MUSCLE,
  PLANE_R,
  PLANE_VEIN_SHORT, // coordinates in the vessel's deformed cross-section over its semi-axes
  PLANE_VEIN_LONG,
  PLANE_ARTERY_SHORT,
  PLANE_ARTERY_LONG,
  PLANE_VEIN_HALF_SHORT, // semi-axes, m
  PLANE_VEIN_HALF_LONG,
  PLANE_ARTERY_HALF_SHORT,
  PLANE_ARTERY_HALF_LONG,
  PLANE_CLOT, // 1 where a thrombus lies
  PLANE_FIELDS
} plane_field;

typedef struct specular {
  float depth_m, amplitude;
} specular;

// What the stages of one frame share.
typedef struct frame {
  sonde_pose probe;
  sonde_mat3 from_world;                       // rotation world -> probe
  double aperture_m, depth_m, pitch_m, step_m; // line pitch, sample step
  double frequency_hz, wavelength_m, focus_m;
  const sonde_pathology *pathology;
  sonde_echo_settings settings;
  double tgc_db_per_m;
} frame;

struct sonde_echo {
  const sonde_interior *interior;
  uint32_t lines, samples, grid_lines, grid_samples;
  double density_m3, cell_m;
  uint32_t per_cell;
  uint64_t seed;
  bool plain; // no texture
  frame frame;
  sonde_vec3 *rest;                            // [rows*columns] rest points of the coarse plane
  float *plane;                                // [PLANE_FIELDS][rows*columns]
  float *row;                                  // [PLANE_FIELDS][lines], one row of the march
  float *last_row;                             // the row before
  float *gain;                                 // [MEDIUM_ROWS][lines]
  float *loss_db;                              // [lines] accumulated
  uint8_t *air;                                // [lines]
  uint8_t *echo_count;                         // [lines]
  specular *echoes;                            // [lines*MAX_ECHOES]
  float *grid;                                 // [grid_samples][grid_lines][2] scattered field
  float *beam;                                 // [grid_samples][lines][2] after the lateral kernel
  float *sum;                                  // [lines][2]
  float *envelope;                             // [samples][lines]
  float *grey;                                 // [samples][lines]
  float *pool_x, *pool_y, *pool_z, *pool_sign; // scatterers in a unit cube about 0, +-1
  float *noise;                                // [NOISE]
  float *phase;                                // [PHASES][2] cos, -sin
  uint64_t *cell_set;                          // [CELL_SET] keys, 0 empty
  int32_t (*cells)[3];                         // [MAX_CELLS]
  uint32_t cell_count;
};

// Stages of a frame, in order.
void sonde_echo_plane(sonde_echo *echo);
void sonde_echo_medium(sonde_echo *echo);
void sonde_echo_scatter(sonde_echo *echo);
void sonde_echo_beam(sonde_echo *echo);
void sonde_echo_picture(sonde_echo *echo, sonde_image *image);

// Half width of the elevation kernel (1 - (y/h)^2)^2: 2.4 mm between its half values.
static const double sonde_elevation_half_m = 2.2e-3;
// Speed of sound that the scanner assumes, m/s.
static const double sonde_sound_m_s = 1540;

// Decibels to amplitude.
static inline float amplitude_of_db(float db) { return exp2f(db * 0.16609640474f); }

#endif
