// Inside of the judge: what it keeps of an exam. Nothing grows with time but the list of presses.
#ifndef SONDE_SRC_TRAINER_JUDGE_H
#define SONDE_SRC_TRAINER_JUDGE_H

#include "trainer/trainer.h"
#include "sonde/trainer_worksheet.h"

enum { JUDGE_BINS = 1024, FORCE_BINS = 256 };
// Stretches of vein are kept in steps of half a millimetre; force against time in steps of 1/4 N.
static const double JUDGE_BIN_M = 0.0005, FORCE_BIN_N = 0.25;
// Beyond the reach of a place a press still covers this much vein, so that neighbours 20 mm apart
// which are missed by a millimetre or two leave no gap.
static const double COVER_EXTRA_M = 0.0025;
// Lighter contact than this is not pressing.
static const double CONTACT_N = 1.0;
// A press begins at this force.
static const double BEGIN_N = 3;

// The probe's path on a fixed grid of time, whatever the rate of the snapshots.
typedef struct sonde_motion {
  bool started;
  double last_s, next_s;
  sonde_vec3 last_m;
  sonde_vec3 stage_m[2];  // low-pass
  sonde_vec3 before_m[3]; // filtered, newest first
  uint32_t filled;
  double path_m;
  double jerk_sum, speed_peak_m_s, time_s; // since the last press
  double smooth_sum;                       // over the approaches to the presses before
  uint32_t approaches;
} sonde_motion;
void sonde_motion_feed(sonde_motion *motion, double time_s, sonde_vec3 position_m);
// A press has ended, and with it the approach to it.
void sonde_motion_pressed(sonde_motion *motion);
// Log dimensionless jerk, mean over the approaches; NaN before the probe has moved.
double sonde_motion_smoothness(const sonde_motion *motion);

// One segment's veins in the press under way; those of the main vein share the first segment's.
typedef struct sonde_vein_view {
  double now; // greatest area ratio of its veins in the newest snapshot; NaN: not in view
  bool seen_at_peak;
  double ratio, artery_ratio; // least of the press, and the artery's at that moment
  double tilt_rad;            // of the main vein then
  sonde_vec3 probe_y;         // normal of the image plane then
  sonde_vec3 start_m;         // where the plane cut the vein first; NaN: not yet
} sonde_vein_view;

struct sonde_judge {
  sonde_vein_map map, first; // of the setup in whose position the patient is; of the first setup
  sonde_plan plan;
  uint32_t held;   // the setup of the map
  double before_s; // time of the positions before
  uint32_t restores_before;
  sonde_decision decision[SONDE_SEGMENTS];
  uint32_t hints;
  double hint_s; // when the last one was asked for

  // presses
  sonde_compression *press; // [capacity]
  uint32_t press_count, capacity;
  uint32_t result_count[SONDE_PRESS_RESULTS];
  double closed_sum; // of 1 - ratio, complete presses
  bool done[SONDE_PLAN_POINTS];
  uint32_t at_place[SONDE_PLAN_POINTS], hard_at_place[SONDE_PLAN_POINTS]; // presses by place
  uint32_t open[SONDE_SEGMENTS], complete[SONDE_SEGMENTS];
  uint32_t seen; // segment of the last valid press, SONDE_SEGMENTS: none
  bool covered[JUDGE_BINS], wanted[JUDGE_BINS];

  // the press under way
  bool pressing;
  sonde_compression now;
  sonde_vein_view view[SONDE_SEGMENTS];
  double trough_n; // least force since the last press

  // time
  bool started;
  double first_s;
  sonde_snapshot last;
  double force_s[FORCE_BINS]; // contact time by force
  double force_peak_n, contact_s;
  uint32_t restores;
  sonde_motion motion;
};

// An examination takes full points for its time up to this.
static const double SONDE_SCORE_TIME_S = 600;

static inline bool sonde_press_is_valid(sonde_press_result result) {
  return result == SONDE_PRESS_COMPLETE || result == SONDE_PRESS_OPEN;
}
// Steps of JUDGE_BIN_M that the vein has, the last one perhaps cut short.
uint32_t sonde_vein_steps(const sonde_vein_map *map);
// Marks the steps whose middle lies within a stretch of vein. @param bins [JUDGE_BINS]
void sonde_vein_mark(const sonde_vein_map *map, bool *bins, double from_m, double to_m);
// Steps [from, to).
typedef struct sonde_vein_run {
  uint32_t from, to;
} sonde_vein_run;
// The longest run of planned steps that no good press covers; empty: there is none.
sonde_vein_run sonde_vein_longest_gap(const bool *planned, const bool *covered, uint32_t steps);
// Ends of a segment as distances along the vein, the one at the groin first.
void sonde_vein_segment_ends(const sonde_vein_map *map, uint32_t segment, double *from_m,
                             double *to_m);
// Slot of sonde_judge.view that holds a segment's veins.
static inline uint32_t sonde_segment_slot(const sonde_vein_map *map, uint32_t segment) {
  return map->segment[segment].vein_count > 0 ? segment : 0;
}
// A good press examined the place.
bool sonde_place_is_done(const sonde_plan *plan, uint32_t place, const sonde_compression *presses,
                         uint32_t count);

// What the press under way is so far, with the places that it examines and the area that says so.
sonde_compression sonde_press_weigh(const sonde_judge *judge);
// The force of the place where the press under way is, NaN without a place.
sonde_force_target sonde_press_target(const sonde_judge *judge);
// A press is under way within reach of no place of the plan.
bool sonde_press_is_astray(const sonde_judge *judge);

// The way from the probe to the view of a place, into a picture whose vessels are known: a vein
// that is in it already is brought to its middle. None where there is nothing to slide.
struct sonde_picture;
void sonde_guide_way(const sonde_judge *judge, const sonde_plan_point *point, sonde_pose pose,
                     struct sonde_picture *picture);

// Age of a clot by Young's modulus (docs/interior.md).
sonde_sheet_age sonde_clot_age(double modulus_pa);

#endif
