// The grid holds a window of rows that moves down the image and stays in the processor's second
// cache. What is to be laid waits in the tier of rows where it begins; once a tier has been laid,
// no later one reaches its rows.
#ifndef SONDE_SRC_ECHO_TIERS_H
#define SONDE_SRC_ECHO_TIERS_H

#include "echo/echo.h"

enum {
  MOST_TIERS = 256,
  MOST_MAPS = 3 * SONDE_MAX_CELLS, // of cubes near vessels eight, of others one
  MOST_LUMENS = SONDE_MAX_CELLS,
  MOST_SEGMENTS = 256 * MOST_VESSELS,
  MAPS_AT_ONCE = 128,
};

// Scatterers on the streamlines of one segment of a vessel.
typedef struct blood_segment {
  splat_map map;
  double way;     // of the mean flow, in segments
  double solid;   // share of the short axis that clot fills, from the far side
  uint32_t count; // streamlines
  uint32_t salt, vessel;
  int32_t segment;
} blood_segment;

// What waits, per tier in the order in which it came; ends are negative.
typedef struct tier_list {
  int32_t first[MOST_TIERS], last[MOST_TIERS];
} tier_list;

typedef struct sonde_tiers {
  uint32_t maps, lumens, segments;
  tier_list tissue, blood;
  int32_t next_map[MOST_MAPS], next_segment[MOST_SEGMENTS];
  splat_map map[MOST_MAPS];
  splat_lumen lumen[MOST_LUMENS];
  blood_segment segment[MOST_SEGMENTS];
  splat_map batch[MAPS_AT_ONCE];
} sonde_tiers;

// Rows of the window for maps of cubes of that size: a power of two.
uint32_t sonde_tiers_window(double cell_m, double step_m);
// Rows of the window and of each tier, for the frame's rows.
void sonde_tiers_measure(sonde_echo *echo);
// Nothing waits.
void sonde_tiers_begin(sonde_echo *echo);
// A map whose lumina are the last ones added, and one more of them.
void sonde_tiers_add_map(sonde_echo *echo, const splat_map *one);
void sonde_tiers_add_lumen(sonde_tiers *tiers, const splat_lumen *lumen);
void sonde_tiers_add_segment(sonde_echo *echo, const blood_segment *segment);
// Lays a tier; all before it have been laid.
void sonde_tiers_lay(sonde_echo *echo, uint32_t tier);
// Rows that scatterers of a tier are nearest to, where not all that begins there is laid at once.
splat_limits sonde_tiers_limits(const sonde_echo *echo, uint32_t tier);
// Blood of one segment in these rows.
void sonde_blood_lay(sonde_echo *echo, const blood_segment *segment, splat_limits rows);

#endif
