// Frames compared with those around them: each point of a frame lies between two other frames, and
// its grey is foretold by theirs at its feet, weighted by the distances.
//
// A foretold grey has noise of its own, of variance (1 - t)^2 + t^2 of that of one frame when t is
// the share of the way to the second frame: residuals are divided by the root of 1 + (1 - t)^2 +
// t^2, or frames would be drawn half way between others, where the noise is least.
//
// A turn of all frames of one pass shears what they show, and a shift moves it: the content stays
// as it is. Only points next to a frame of another time tell of the calibration.
#include "sweep/poses.h"

#include "base/parallel.h"

#include <string.h>

// Frames of other times that a frame is compared with, and how many frames away another time is.
enum { ELSEWHERE = 24, ANOTHER = 3 * POSE_SPAN };

// A frame seen from another one: its points in the other's axes.
typedef struct view {
  uint32_t frame;  // of the track
  int slot;        // among the frames before and behind; -1: of another time
  sonde_mat3 turn; // its axes
  sonde_vec3 at;   // its middle
} view;

// Grey and slope (per m) at a place of a frame in its own axes; false outside.
static bool read_at(const pose_content *c, uint32_t frame, double x, double y, double *grey,
                    double slope[2]) {
  const slice_bank *bank = c->bank;
  const slice_pyramid *p = &bank->pyramids[c->track->frames[frame]];
  const int k = c->level;
  const double scale = 1.0 / (1 << k), v0 = 0.5 * (bank->high[0] - 1),
               u0 = 0.5 * (bank->wide[0] - 1);
  const double rows = y / c->pixel_m[1];
  const float v = (float)((v0 + rows) * scale);
  const float u = (float)((u0 + (x - c->pixel_m[2] * rows) / c->pixel_m[0]) * scale);
  if (!(u >= 0.5f && v >= 0.5f && u <= (float)bank->wide[k] - 1.5f &&
        v <= (float)bank->high[k] - 1.5f))
    return false;
  *grey = (double)slice_level_at(bank, p, k, u, v);
  if (!slope) return true;
  const float across =
      slice_level_at(bank, p, k, u + 0.5f, v) - slice_level_at(bank, p, k, u - 0.5f, v);
  const float down =
      slice_level_at(bank, p, k, u, v + 0.5f) - slice_level_at(bank, p, k, u, v - 0.5f);
  slope[0] = (double)across * scale / c->pixel_m[0];
  slope[1] = ((double)down * scale - slope[0] * c->pixel_m[2]) / c->pixel_m[1];
  return true;
}

// The point at (x, y) of frame i, between two of the views; adds nothing where it is not.
static void add_point(const pose_content *c, uint32_t i, const view *views, int count, double x,
                      double y, pose_terms *to) {
  const view *both[2] = {NULL, NULL};
  double d[2] = {0}, grey[2], own, slope[2][2], foot[2][3];
  for (const view *v = views; v < views + count; ++v) {
    const double now = v->turn.m[2][0] * x + v->turn.m[2][1] * y + v->at.z;
    const int side = now < 0;
    if (fabs(now) < c->nearest_m || (both[side] && fabs(now) >= fabs(d[side]))) continue;
    both[side] = v, d[side] = now;
  }
  if (!both[0] || !both[1] || d[0] - d[1] > c->widest_m || !read_at(c, i, x, y, &own, NULL)) return;
  for (int side = 0; side < 2; ++side) {
    const view *v = both[side];
    for (int a = 0; a < 2; ++a)
      foot[side][a] = v->turn.m[a][0] * x + v->turn.m[a][1] * y + v_coordinate(v->at, a);
    foot[side][2] = d[side];
    if (!read_at(c, v->frame, foot[side][0], foot[side][1], &grey[side], slope[side])) return;
  }
  const double gap = d[0] - d[1], t = d[0] / gap, share[2] = {1 - t, t};
  const double variance = 1 + share[0] * share[0] + share[1] * share[1], scale = 1 / sqrt(variance);
  const double residual = (own - share[0] * grey[0] - share[1] * grey[1]) * scale;
  // By the share of the way; what the distance from either frame adds to the share.
  const double by_share = (grey[0] - grey[1]) * scale - residual * (2 * t - 1) / variance;
  double motion[3][POSE_AXES] = {{0}}; // of both frames, of frame i
  for (int side = 0; side < 2; ++side) {
    const double by[3] = {-scale * share[side] * slope[side][0],
                          -scale * share[side] * slope[side][1], by_share * share[side] / gap};
    // d grey / d motion of that frame: its point moves when the frame moves.
    for (int a = 0; a < 3; ++a) {
      const int next = (a + 1) % 3, last = (a + 2) % 3;
      motion[side][a] = -by[a];
      motion[side][3 + a] = -(by[last] * foot[side][next] - by[next] * foot[side][last]);
    }
    // The same point, moved with frame i: its step in the other's axes, turned into those of i.
    double own_by[3];
    for (int a = 0; a < 3; ++a)
      own_by[a] = both[side]->turn.m[0][a] * by[0] + both[side]->turn.m[1][a] * by[1] +
                  both[side]->turn.m[2][a] * by[2];
    for (int a = 0; a < 3; ++a) motion[2][a] += own_by[a];
    motion[2][3] += own_by[2] * y;
    motion[2][4] -= own_by[2] * x;
    motion[2][5] += own_by[1] * x - own_by[0] * y;
  }
  // The near frames' motions; where a frame of another time takes part also the common numbers.
  struct {
    int first, count;
    double by[POSE_COMMON];
  } parts[4] = {{POSE_OTHERS, 0, {0}}};
  const bool crossed = both[0]->slot < 0 || both[1]->slot < 0;
  if (crossed) parts[0].count = POSE_COMMON;
  int used = 1;
  for (int k = 0; k < 3; ++k) {
    const int slot = k < 2 ? both[k]->slot : POSE_SPAN;
    for (int a = 0; a < POSE_AXES && crossed; ++a) {
      if (slot < 0) parts[0].by[0] += motion[k][a] * c->velocity[both[k]->frame][a];
      parts[0].by[1 + a] += motion[k][a];
    }
    if (slot < 0) continue;
    parts[used].first = slot * POSE_AXES, parts[used].count = POSE_AXES;
    memcpy(parts[used++].by, motion[k], sizeof motion[k]);
  }
  for (int k = 0; k < used; ++k)
    for (int a = 0; a < parts[k].count; ++a) {
      to->slope[parts[k].first + a] += parts[k].by[a] * residual;
      for (int l = 0; l < used; ++l)
        for (int b = 0; b < parts[l].count && parts[l].first <= parts[k].first; ++b)
          to->matrix[parts[k].first + a][parts[l].first + b] += parts[k].by[a] * parts[l].by[b];
    }
  to->square += residual * residual;
  ++to->points;
}

static sonde_status compare_frame(void *user, uint32_t worker, uint32_t i, const atomic_bool *stop,
                                  sonde_error *error) {
  (void)worker, (void)stop, (void)error;
  const pose_content *c = user;
  const slice_bank *bank = c->bank;
  pose_terms *to = &c->terms[i];
  memset(to, 0, sizeof *to);
  if (c->hidden && c->hidden[i]) return SONDE_OK;
  // The frames of other times whose planes pass the middle closest, then those before and behind.
  view others[ELSEWHERE], near[POSE_NEAR];
  int count = 0, elsewhere = 0;
  const sonde_mat3 own = q_matrix(c->poses[i].rotation);
  for (uint32_t k = 0; k < c->track->count; ++k) {
    const int64_t later = (int64_t)k - i;
    if (k == i || (c->hidden && c->hidden[k])) continue;
    view v = {.frame = k, .slot = (int)later + POSE_SPAN};
    if (later < -POSE_SPAN || later > POSE_SPAN) v.slot = -1;
    if (v.slot < 0 && later >= -ANOTHER && later <= ANOTHER) continue;
    v.turn = m_mul(m_transpose(q_matrix(c->poses[k].rotation)), own);
    if (v.turn.m[2][2] < 0.5) continue; // frames that stand across tell little of each other
    v.at = pose_apply_inverse(c->poses[k], c->poses[i].position);
    if (v.slot >= 0) {
      near[count++] = v;
    } else {
      if (elsewhere == ELSEWHERE && fabs(others[elsewhere - 1].at.z) <= fabs(v.at.z)) continue;
      int at = elsewhere < ELSEWHERE ? elsewhere++ : ELSEWHERE - 1;
      for (; at > 0 && fabs(others[at - 1].at.z) > fabs(v.at.z); --at) others[at] = others[at - 1];
      others[at] = v;
    }
  }
  const uint32_t step = c->stride << c->level;
  for (uint32_t v = step / 2; v < bank->high[0]; v += step)
    for (uint32_t u = step / 2; u < bank->wide[0]; u += step) {
      // What never changes is writing or surround.
      if (!bank->shares[0][(size_t)v * bank->wide[0] + u]) continue;
      const double column = u - 0.5 * (bank->wide[0] - 1), row = v - 0.5 * (bank->high[0] - 1);
      const double x = column * c->pixel_m[0] + row * c->pixel_m[2], y = row * c->pixel_m[1];
      add_point(c, i, near, count, x, y, to);
      add_point(c, i, others, elsewhere, x, y, to);
    }
  return SONDE_OK;
}

sonde_status sonde_pose_content_compare(pose_content *c, sonde_error *error) {
  SONDE_ASSERT(c->bank != NULL && c->terms != NULL && c->stride > 0);
  return sonde_parallel_run(c->track->count, sonde_parallel_workers(0, c->track->count),
                            compare_frame, c, NULL, "poses", error);
}
