// Inside of the echo room: buffers of one renderer and the stages that fill them.
#ifndef SONDE_SRC_ECHO_H
#define SONDE_SRC_ECHO_H

#include "base/maths.h"
#include "echo/kernel.h"
#include "echo/plane.h"
#include "echo/psf.h"
#include "interior/interior.h"
#include "sonde/echo.h"
#include "sonde/echo_scanner.h"
#include "echo/reference.h"

enum {
  SONDE_PLANE_COLUMNS = 25, // coarse nodes across the lines
  SONDE_PLANE_ROWS = 57,    // and down, at most
  SONDE_PLANE_NODES = SONDE_PLANE_COLUMNS * SONDE_PLANE_ROWS,
  SONDE_MEDIUM_ROWS = 256,                    // steps of the march along the lines
  SONDE_SHEET_POINTS = 64 * SONDE_MOST_LINES, // of the interfaces
  SONDE_POOL = 16384,                         // random scatterers shared by all cubes
  SONDE_LOOSE = 8192,                         // the same for pieces of cubes
  SONDE_BLOOD = 16384,                        // streamlines of one vessel
  SONDE_NOISE = 65536,
  SONDE_BOX_CUBES = 1 << 24, // cubes of the box around the slab
  // Cubes that the slab touches. The widest view that sonde_echo_check_view() allows is a sector of
  // 0.05 m^2, its slab at most 16 mm thick with a cube's width: 100,000 cubes of 2 mm.
  SONDE_MAX_CELLS = 1 << 17,
  SONDE_SLAB_ROWS = 256,  // depths at which the slab's height is tabulated
  SONDE_MAP_STEPS = 4080, // of the grey map
  DISPLAY_MARGIN = 16,    // columns beside the picture that the filter reads
};

_Static_assert((int)MOST_LESIONS == (int)SONDE_LESIONS, "lesions in view");

// An interface on one column of the grid, carrier phase included.
typedef struct sheet_point {
  float re, im;
  float beyond; // its depth beyond the row nearest to it, rows
  uint32_t column;
  int32_t next; // in the list of its row, -1 at the end
} sheet_point;

// What the stages of one frame share.
typedef struct frame {
  sonde_pose probe;
  sonde_mat3 from_world;                       // rotation world -> probe
  double aperture_m, depth_m, pitch_m, step_m; // line pitch at the face, sample step
  double reach_m;  // depth down to which tissue is drawn: fast tissue shows what lies deeper
  double radius_m; // of a curved face, else 0
  double frequency_hz, wavelength_m, focus_m;
  double first_line, edge_lines; // line at x = 0; lines beyond the outer ones that matter
  const sonde_pathology *pathology;
  sonde_echo_settings settings;
  double tgc_db_per_m;
  const sonde_scanner *scanner;
} frame;

// A node of the coarse plane. `in` turns small rest vectors into (columns, metres beside the
// plane, rows) of the plane.
typedef struct plane_node {
  sonde_vec3 rest;
  sonde_vec3 side;   // where a step of 1 m beside the plane in rest coordinates leads: same units
  sonde_vec3 beside; // rest step per metre beside the plane
  sonde_mat3 in;
} plane_node;

// Scatterers in a unit cube about 0, amplitude +-1.
typedef struct scatter_pool {
  float *x, *y, *z, *sign;
} scatter_pool;

// Grouped by the stage that writes them, in their order.
struct sonde_echo {
  // Creation and settings (echo.c).
  const sonde_interior *interior;
  const echo_kernels *kernels;
  uint32_t lines, samples;
  uint32_t padded; // lines in whole vectors
  double density_m3, cell_m;
  uint32_t per_cell, per_piece; // scatterers of a cube and of an eighth of it
  uint64_t seed;
  bool plain;      // no texture
  float *coupling; // [padded] share of the amplitude that passes the face, 0..1
  sonde_echo_flow flow;
  sonde_scanner scanner;
  bool bare;    // the plain scanner: the axial kernels' grey values are shown as they are
  bool rolling; // one look per picture
  char *block;  // of all float buffers but the coarse plane

  // Random tables (scatterers.c).
  // [POOL + LOOSE + POOL] sorted by z within each cube's share; then unsorted ones for pieces; then
  // the shares again, each in the order of its parts: a quarter, a quarter, a half.
  scatter_pool pool;
  uint32_t *tile[SONDE_TILES]; // [TILE_SIDE^3] of fat and muscle (tiles.c)
  scatter_pool blood; // [BLOOD] streamlines: place in a lumen of unit width, speed over the mean
  uint32_t *bundle;   // [BLOOD] of neighbouring streamlines
  float *noise;       // [NOISE]

  // Constants of a frame (frame_hot.c).
  frame frame;
  beam_psf *psf, *spare;                       // in use; being built or the one before
  uint32_t grid_stride, gain_stride;           // floats per row of the grid, gains
  uint32_t grid_lines, grid_samples;           // columns and rows of the grid
  uint32_t pad_lines, pad_samples;             // of them beside the image
  uint32_t window_rows, band_rows, band_count; // of the grid's rows, bands.h
  uint32_t plane_rows;                         // of the coarse plane
  double lines_per_column, depth_per_row;      // of it; depth in m
  double slab_m[SONDE_SLAB_ROWS + 1];          // half height, depths in even steps
  double spare_octaves[SONDE_SLAB_ROWS + 1];   // of scatterers there, beyond what speckle needs
  uint32_t lost;                               // cubes, maps and lumina for which there was no room
  sonde_echo_times times;

  // The coarse plane at rest (plane_hot.c).
  double theta_centre;
  bool vessels;                 // any
  uint32_t shown[MOST_VESSELS]; // vessels in view: the femoral ones, then branches
  uint32_t shown_count;
  sonde_vessel_blood moves[MOST_VESSELS]; // of those shown (blood_hot.c)
  uint32_t lesion[MOST_LESIONS];          // lesions in view
  uint32_t lesion_count;
  uint32_t cell[MOST_CELLS]; // seeds in view, of a model with a tissue map
  uint32_t cell_count;
  uint32_t body[MOST_BODIES]; // nerves, tendons and nodes in view, of such a model
  uint32_t body_count;
  uint32_t fields, levels;     // of the plane and of the medium
  plane_node *node;            // [PLANE_NODES]
  float *plane;                // [MOST_FIELDS][PLANE_NODES] and a vector
  struct sonde_fields *motion; // of this frame

  // The march along the lines (medium_hot.c).
  struct sonde_gates *gates; // gates.h
  float *wide[2];            // [fields][padded] two coarse rows, per line
  float wide_share;          // of the way from one to the other, of this row of the march
  float *septum[3]; // [padded] distance to the fat's septa of this row and the last, their strength
  float wall_m[MOST_VESSELS];    // of those shown
  float *level[2];               // [levels][padded] of this row and the last
  float *knots;                  // [padded][TEXTURES][KNOT_FLOATS] of the textures, kernel.h
  float *scatter, *loss, *rough; // [padded] of this row
  float *loss_db;                // [padded] accumulated
  float *tail;                   // [padded] power that reverberates, kernel.h
  uint8_t *air;                  // [padded]
  struct sonde_sound *sound;     // sound.h
  bool some_air;
  float *gain; // [MEDIUM_ROWS][gain_stride] of the grid's even columns: beside the outer lines
               // those go on
  sheet_point *sheet; // [SHEET_POINTS]
  uint32_t sheet_count;
  int32_t *first_sheet; // [samples + 2 MOST_TAPS] list of those nearest to each row of the grid

  // Scatterers on their path (cubes_hot.c to bands_hot.c).
  int32_t box_first[3]; // cubes of the box around the slab at rest
  uint32_t box_size[3];
  uint64_t *seen;            // [BOX_CUBES / 64] a bit per cube of the box, x fastest
  struct sonde_cubes *cubes; // cubes.h
  struct sonde_bands *bands; // bands.h
  uint32_t moved, bled;      // scatterers of the last frame, blood among them
  float *grid; // [window_rows + 2][grid_stride] scattered field, kernel.h; zero between frames

  // The beam (beam_hot.c).
  float *line_re[SONDE_FINE], *line_im[SONDE_FINE]; // a row with its gain: [grid_lines / FINE]
  float *ring;                    // [looks][2*MOST_TAPS+AXIAL_MOST][RING_PLANES][padded]
  uint32_t looks;                 // of the scanner
  uint32_t first_look, now_looks; // that this picture draws
  uint32_t drawn_looks;           // that are fresh: of this beam and of these settings
  float *ramp_re[SONDE_MOST_LOOKS][SONDE_FINE], *ramp_im[SONDE_MOST_LOOKS][SONDE_FINE];
  float *look_re[SONDE_FINE], *look_im[SONDE_FINE]; // a row under a look's ramp
  float *look[SONDE_MOST_LOOKS];                    // [samples][padded] its envelope
  haze_taps haze;
  float *envelope;      // [samples][padded]
  float *flat_envelope; // [samples][lines], what readers see
  float *grey;          // [samples][padded]

  // The display (display_hot.c).
  float *log;         // [samples][padded + 2 DISPLAY_MARGIN] grey before the filter, edges repeated
  float *coarse;      // [samples][padded + 2 DISPLAY_MARGIN] means over some rows of it
  float *blurred;     // [samples][padded + 2 DISPLAY_MARGIN] means of 3 x 3 of these
  float (*tensor)[3]; // [samples][padded / 8] of their slopes
  float *held;        // [samples][padded] the picture before, for persistence
  bool is_held;       // there is one
  float map[SONDE_MAP_STEPS + 1]; // grey values of the scanner's map
};

// Tables of scatterers, streamlines and noise of a new renderer.
void sonde_scatterers_draw(sonde_echo *echo);
// Amplitudes of fat and muscle, [TILE_SIDE^3] each; false: no memory.
bool sonde_tiles_draw(uint32_t *fat, uint32_t *muscle);
// Lines, samples and focus from what the operator sets; the key of the beam they need.
void sonde_echo_geometry(sonde_echo *echo, double aperture_m, const sonde_echo_settings *settings);
beam_key sonde_echo_key(const frame *f);
// Stages of a frame, in order.
void sonde_echo_frame(sonde_echo *echo, sonde_pose world_from_probe, double aperture_m,
                      const sonde_echo_settings *settings);
void sonde_echo_plane(sonde_echo *echo);
void sonde_echo_medium(sonde_echo *echo);
// Interfaces: none; one that crosses a line, `rise_m` deeper on each column to the right, its echo
// where it is level over the rms of muscle speckle; those near one row, times a gain, into the
// row's columns.
void sonde_sheet_begin(sonde_echo *echo);
void sonde_sheet_add(sonde_echo *echo, uint32_t line, float depth_m, float rise_m, float amplitude);
void sonde_sheet_lay(sonde_echo *echo, uint32_t row, float gain);
// Tissue (cubes.h) and blood, which then wait for their bands of rows (bands.h).
void sonde_echo_scatter(sonde_echo *echo);
void sonde_echo_blood(sonde_echo *echo);
// The rows of a band that has been laid.
void sonde_echo_beam(sonde_echo *echo, uint32_t band, bool tissue);
// Time-gain compensation at a depth, dB: the operator's slope up to the scanner's ceiling.
double sonde_echo_compensation_db(const frame *f, double depth_m);
// After the last one.
void sonde_echo_beam_end(sonde_echo *echo);
// Looks that this picture draws, and their ramps.
void sonde_looks_begin(sonde_echo *echo);
// Echoes of interfaces that the probe's face sends back into the tissue once more.
void sonde_echo_ghosts(sonde_echo *echo);
// Grey values of the picture from the looks' envelopes.
void sonde_echo_display(sonde_echo *echo);
// Checks and copies a scanner; NULL: the plain one.
sonde_status sonde_scanner_take(sonde_echo *echo, const sonde_scanner *scanner, sonde_error *error);
void sonde_echo_picture(sonde_echo *echo, sonde_image *image);

// Point of the image in the probe frame: line, depth.
sonde_vec3 sonde_echo_place(const frame *f, double line, double depth_m);
// Its inverse: (line, metres beside the plane, depth).
sonde_vec3 sonde_echo_unplace(const frame *f, sonde_vec3 local_m);

// The middle of what a picture shows of the muscles, at 0.4 of its depth.
static inline sonde_vec3 sonde_echo_middle(const frame *f) {
  return pose_apply(f->probe, vec3(0, 0, 0.4 * f->depth_m));
}

// What a vessel holds: the frame's own pathology in the femoral vein.
const sonde_pathology *sonde_echo_pathology(const sonde_echo *echo, uint32_t which);
// Share of a vessel's short axis that clot fills at a rest height, from the far side.
double sonde_echo_solid(const sonde_echo *echo, uint32_t which, double z_m);

// Image coordinates (columns, metres beside the plane, rows) and world.
sonde_vec3 sonde_echo_to_world(const sonde_echo *echo, sonde_vec3 at);
sonde_vec3 sonde_echo_from_world(const sonde_echo *echo, sonde_vec3 point_m);
// Half height of the slab at a depth.
double sonde_echo_elevation(const sonde_echo *echo, double depth_m);
// Share of the amplitude in a lumen that is clutter and moves with the tissue; the blood has the
// rest of the power. Measurements without texture are without clutter.
static inline float sonde_clutter(const sonde_echo *echo) { return echo->plain ? 0 : 0.7f; }

// Speed of sound that the scanner assumes, m/s.
static const double sonde_sound_m_s = 1540;

// Decibels to amplitude.
static inline float amplitude_of_db(float db) { return exp2f(db * 0.16609640474f); }

#endif
