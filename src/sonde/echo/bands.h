// The grid holds a window of rows that moves down the image and stays in the processor's second
// cache. Maps of tissue and segments of blood wait in the band of rows where they begin; once a
// band has been laid, no later one reaches its rows.
#ifndef SONDE_SRC_ECHO_BANDS_H
#define SONDE_SRC_ECHO_BANDS_H

#include "echo/echo.h"
#include "interior/clot.h"

enum {
  MOST_BANDS = 256,
  MOST_MAPS = 3 * SONDE_MAX_CELLS, // of cubes near vessels eight, of others one
  MOST_LUMENS = SONDE_MAX_CELLS,
  MOST_SEGMENTS = 256 * MOST_VESSELS,
  MAPS_AT_ONCE = 128,
};

// Scatterers on the streamlines of one segment of a vessel.
typedef struct blood_segment {
  splat_map map;
  double flowed;  // by the mean flow, in segments
  double streaks; // share by which the amplitudes of streaks differ from each other
  double solid;   // share of the lumen that clot fills
  sonde_clot_form form;
  uint32_t count; // streamlines
  uint32_t salt, vessel;
  int32_t segment;
} blood_segment;

static const double sonde_segment_m = 2e-3; // along the leg's axis

// Whether a place of a segment lies in clot: coordinates in the segment's unit lumen.
static inline bool sonde_blood_in_clot(const blood_segment *s, float x, float y, float z) {
  double along_m = (s->segment + 0.5 + (double)z) * sonde_segment_m;
  const double a = 2 * (double)x, b = 2 * (double)y;
  return sonde_clot_holds(s->form, s->solid, s->vessel, along_m, a, b);
}

// What waits, per band in the order in which it came; ends are negative.
typedef struct band_list {
  int32_t first[MOST_BANDS], last[MOST_BANDS];
} band_list;

typedef struct sonde_bands {
  uint32_t maps, lumens, segments;
  band_list tissue, blood;
  int32_t next_map[MOST_MAPS], next_segment[MOST_SEGMENTS];
  splat_map map[MOST_MAPS];
  splat_lumen lumen[MOST_LUMENS];
  blood_segment segment[MOST_SEGMENTS];
  splat_map batch[MAPS_AT_ONCE];
} sonde_bands;

// Rows of the window for maps of cubes of that size: a power of two.
uint32_t sonde_bands_window(double cell_m, double step_m);
// Rows of the window and of each band, for the frame's rows.
void sonde_bands_measure(sonde_echo *echo);
// Nothing waits.
void sonde_bands_begin(sonde_echo *echo);
// A map whose lumina are the last ones added.
void sonde_bands_add_map(sonde_echo *echo, const splat_map *one);
void sonde_bands_add_segment(sonde_echo *echo, const blood_segment *segment);
// Lays a band into the grid; all before it have been laid.
void sonde_bands_lay(sonde_echo *echo, uint32_t band);
// Those of the points, in the probe frame, that belong to a band.
void sonde_bands_lay_points(sonde_echo *echo, const sonde_echo_point *points, uint32_t count,
                            uint32_t band);

#endif
