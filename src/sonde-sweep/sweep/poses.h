// Inside of the correction of poses: small motions of a frame, the smooth trajectory, the content.
//
// A frame's pose is that of its picture's middle: x along columns, y along rows, z along the
// normal. A motion of it is a shift (m) and a rotation vector (rad) in its own axes.
#ifndef SONDE_SRC_SWEEP_POSES_H
#define SONDE_SRC_SWEEP_POSES_H

#include "sonde/sweep_poses.h"
#include "sweep/slice.h"

enum {
  POSE_AXES = 6,
  POSE_SPAN = 4,                 // a frame is compared with as many on either side
  POSE_NEAR = 2 * POSE_SPAN + 1, // with itself
  POSE_COMMON = 7,               // time offset, calibration
  POSE_OTHERS = POSE_NEAR * POSE_AXES,
  POSE_LOCAL = POSE_OTHERS + POSE_COMMON, // what its comparison depends on
  POSE_BLOCK = 2 * POSE_SPAN,             // frames of a block: those a comparison joins are in two
  POSE_SIDE = POSE_BLOCK * POSE_AXES,
};

// A pose that is moved by a motion in its own axes.
static inline sonde_pose pose_moved(sonde_pose pose, const double by[POSE_AXES]) {
  const sonde_quat turn = q_spun(vec3(by[3], by[4], by[5]), 1);
  pose = pose_mul(pose, (sonde_pose){vec3(by[0], by[1], by[2]), turn});
  pose.rotation = q_unit(pose.rotation);
  return pose;
}

// The motion that takes pose a to pose b.
static inline void pose_between(sonde_pose a, sonde_pose b, double motion[POSE_AXES]) {
  const sonde_pose step = pose_mul(pose_inverse(a), b);
  const sonde_vec3 turn = q_spin(step.rotation, 1);
  motion[0] = step.position.x, motion[1] = step.position.y, motion[2] = step.position.z;
  motion[3] = turn.x, motion[4] = turn.y, motion[5] = turn.z;
}

// Normal equations of all frames' motions and the common numbers. Frames that are at most
// POSE_BLOCK apart may be joined; only lower triangles are read.
typedef struct pose_system {
  uint32_t blocks;
  double *own;    // [blocks][POSE_SIDE][POSE_SIDE]
  double *next;   // [blocks][POSE_SIDE of the next block][POSE_SIDE]
  double *border; // [blocks][POSE_SIDE][POSE_COMMON + 1], last: the right-hand side
  double corner[POSE_COMMON + 1][POSE_COMMON + 1]; // last column: the right-hand side
  double *step;                                    // [blocks][POSE_SIDE] solution
  double common[POSE_COMMON];
  double covariance[POSE_COMMON][POSE_COMMON]; // of the common numbers, the motions free
} pose_system;

sonde_status sonde_pose_system_create(uint32_t frames, pose_system *system, sonde_error *error);
void sonde_pose_system_clear(pose_system *system);
// Zero, but ones for the frames that do not fill the last block.
void sonde_pose_system_reset(pose_system *system, uint32_t frames);
// Adds to the entry of component a of frame i and component b of frame j.
static inline void pose_system_add(pose_system *s, uint32_t i, int a, uint32_t j, int b, double x) {
  if (i < j) {
    const uint32_t frame = i;
    const int axis = a;
    i = j, a = b, j = frame, b = axis;
  }
  const uint32_t p = i / POSE_BLOCK, q = j / POSE_BLOCK;
  double *of = (p == q ? s->own : s->next) + (size_t)q * POSE_SIDE * POSE_SIDE;
  of[(i % POSE_BLOCK * POSE_AXES + (uint32_t)a) * POSE_SIDE + j % POSE_BLOCK * POSE_AXES +
     (uint32_t)b] += x;
}
static inline double *pose_system_border(pose_system *s, uint32_t frame, int axis) {
  return s->border + ((size_t)frame * POSE_AXES + (size_t)axis) * (POSE_COMMON + 1);
}
// Solves; what stood in it is lost. False: not positive definite.
bool sonde_pose_system_solve(pose_system *system);

// The tracker's poses and what is smooth in them.
typedef struct pose_track {
  uint32_t count;
  uint32_t *frames; // [count] of the sequence
  double *time_s;   // [count] growing; frame numbers without time stamps
  bool timed;
  sonde_pose *given, *smooth; // [count]
  double noise[POSE_AXES];    // deviation of the tracker, m and rad
  double drive[POSE_AXES];    // variance that the velocity gains in a second, m^2/s^3, rad^2/s^3
} pose_track;

// Measures noise and drive, fills `smooth`.
sonde_status sonde_pose_track_smooth(pose_track *track, sonde_error *error);
// Adds the precision of the smooth trajectory; its gradient at motions [count] is taken from the
// right-hand side.
void sonde_pose_track_prior(const pose_track *track, double (*motions)[POSE_AXES],
                            pose_system *system);
// The smooth pose at the time of a frame and this much later, and its velocity (per s) there.
sonde_pose sonde_pose_track_at(const pose_track *track, uint32_t frame, double later_s,
                               double velocity[POSE_AXES]);

// A frame compared with those around it: by the motions of the frames before and behind it and,
// from POSE_OTHERS on, by the common numbers through frames that show the same place at other
// times, which are taken as they are.
typedef struct pose_terms {
  double matrix[POSE_LOCAL][POSE_LOCAL]; // lower triangle
  double slope[POSE_LOCAL];
  double square; // sum over the points
  uint32_t points;
} pose_terms;

// The frames, read at one resolution.
typedef struct pose_content {
  const slice_bank *bank;
  const pose_track *track;
  const bool *hidden;            // [count of the track] content is not read
  const sonde_pose *poses;       // [count]
  double (*velocity)[POSE_AXES]; // [count] of the smooth trajectory
  double pixel_m[3]; // steps along columns and rows, what a row is shifted along the columns
  double nearest_m;  // frames that are closer to a point are passed over
  double widest_m;   // gap between two frames that foretell
  int level;         // of the pyramids
  uint32_t stride;   // of the points, pixels of the level
  pose_terms *terms; // [count]
} pose_content;

sonde_status sonde_pose_content_compare(pose_content *content, sonde_error *error);

#endif
