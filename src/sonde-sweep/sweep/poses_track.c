// The trajectory of the tracker: its noise, what is smooth in it, and the equations of all frames.
//
// The probe's velocity is taken as a random walk, the tracker's errors as independent. What the
// velocity changes by from one step to the next then has the covariance drive diag(mean steps) +
// noise^2 D D^T, D the second divided difference: the likeliest noise and drive are looked for,
// axis by axis. The smooth trajectory is the likeliest one; deviations from it have the precision
// 1 / noise^2 + D^T diag(1 / (drive mean step)) D.
#include "sweep/poses.h"

#include "sparse/dense.h"

#include <string.h>

enum { PIECE = 64, RATIOS = 37, ROUNDS = 4 };

static const double PINNED = 1e-9; // m and rad: a tracker without noise
static const double LIKELIER = 2;  // logarithm of the likelihood that noise must gain

sonde_status sonde_pose_system_create(uint32_t frames, pose_system *s, sonde_error *error) {
  SONDE_ASSERT(frames > 0 && s != NULL);
  *s = (pose_system){.blocks = (frames + POSE_BLOCK - 1) / POSE_BLOCK};
  const size_t square = (size_t)POSE_SIDE * POSE_SIDE;
  s->own = SONDE_NEW(double, s->blocks *square);
  s->next = SONDE_NEW(double, s->blocks *square);
  s->border = SONDE_NEW(double, s->blocks *(size_t)POSE_SIDE *(POSE_COMMON + 1));
  s->step = SONDE_NEW(double, s->blocks *(size_t)POSE_SIDE);
  if (s->own && s->next && s->border && s->step) return SONDE_OK;
  sonde_pose_system_clear(s);
  return sonde_fail_memory(error);
}

void sonde_pose_system_clear(pose_system *s) {
  sonde_free(s->own);
  sonde_free(s->next);
  sonde_free(s->border);
  sonde_free(s->step);
  *s = (pose_system){0};
}

void sonde_pose_system_reset(pose_system *s, uint32_t frames) {
  const size_t square = (size_t)POSE_SIDE * POSE_SIDE;
  memset(s->own, 0, s->blocks * square * sizeof *s->own);
  memset(s->next, 0, s->blocks * square * sizeof *s->next);
  memset(s->border, 0, s->blocks * (size_t)POSE_SIDE * (POSE_COMMON + 1) * sizeof *s->border);
  memset(s->corner, 0, sizeof s->corner);
  for (uint32_t i = frames; i < s->blocks * POSE_BLOCK; ++i)
    for (int a = 0; a < POSE_AXES; ++a) pose_system_add(s, i, a, i, a, 1);
}

// Block by block: L of a block; what it takes from the next block, the border and the corner.
bool sonde_pose_system_solve(pose_system *s) {
  enum { N = POSE_SIDE, C = POSE_COMMON, WIDE = N + C + 1 };
  double *rows = SONDE_NEW(double, (size_t)s->blocks *N *WIDE);
  bool good = rows != NULL;
  for (uint32_t g = 0; g < s->blocks && good; ++g) {
    double *own = s->own + (size_t)g * N * N, *to = rows + (size_t)g * N * WIDE;
    const double *next = s->next + (size_t)g * N * N;
    double *border = s->border + (size_t)g * N * (C + 1);
    for (int c = 0; c < N; ++c) {
      for (int r = 0; r < N; ++r) to[c * WIDE + r] = next[r * N + c];
      memcpy(to + c * WIDE + N, border + (size_t)c * (C + 1), (C + 1) * sizeof *to);
    }
    good = sonde_cholesky(own, N);
    if (!good) break;
    sonde_cholesky_forward_many(own, N, to, WIDE);
    for (int c = 0; c < N; ++c) {
      const double *row = to + c * WIDE, *last = row + N;
      for (int r = 0; r < N && g + 1 < s->blocks; ++r) {
        if (row[r] == 0) continue;
        for (int k = 0; k <= r; ++k) own[(N + r) * N + k] -= row[r] * row[k];
        for (int k = 0; k <= C; ++k) border[(N + r) * (C + 1) + k] -= row[r] * last[k];
      }
      for (int k = 0; k < C; ++k)
        for (int l = 0; l <= C; ++l) s->corner[k][l] -= last[k] * last[l];
    }
  }
  double common[C][C];
  for (int k = 0; k < C; ++k) {
    memcpy(common[k], s->corner[k], sizeof common[k]);
    s->common[k] = s->corner[k][C];
  }
  good = good && sonde_cholesky(common[0], C);
  if (good) {
    sonde_cholesky_solve(common[0], C, s->common);
    sonde_cholesky_invert(common[0], C, s->covariance[0]);
  }
  for (uint32_t g = s->blocks; g-- > 0 && good;) {
    const double *own = s->own + (size_t)g * N * N, *from = rows + (size_t)g * N * WIDE;
    double *x = s->step + (size_t)g * N;
    for (int c = N - 1; c >= 0; --c) {
      const double *row = from + c * WIDE;
      x[c] = row[N + C];
      for (int k = 0; k < C; ++k) x[c] -= row[N + k] * s->common[k];
      for (int r = 0; r < N && g + 1 < s->blocks; ++r) x[c] -= row[r] * x[N + r];
      for (int r = c + 1; r < N; ++r) x[c] -= own[r * N + c] * x[r];
      x[c] /= own[c * N + c];
    }
  }
  sonde_free(rows);
  return good;
}

// Second divided difference at frame i: weights of the frames before, at and behind it.
static double difference(const pose_track *t, uint32_t i, double weights[3]) {
  const double before = t->time_s[i] - t->time_s[i - 1], behind = t->time_s[i + 1] - t->time_s[i];
  weights[0] = 1 / before, weights[1] = -1 / before - 1 / behind, weights[2] = 1 / behind;
  return 0.5 * (before + behind);
}

// What the velocity changes by at frame i.
static void bend(const pose_track *t, const sonde_pose *poses, uint32_t i,
                 double change[POSE_AXES]) {
  double w[3], before[POSE_AXES], behind[POSE_AXES];
  difference(t, i, w);
  pose_between(poses[i], poses[i - 1], before);
  pose_between(poses[i], poses[i + 1], behind);
  for (int a = 0; a < POSE_AXES; ++a) change[a] = w[0] * before[a] + w[2] * behind[a];
}

// Twice the negative logarithm of the likelihood of changes[count] at a ratio noise^2 / drive, up
// to a constant; pieces are taken as independent. *drive becomes the likeliest one.
static double unlikelihood(const pose_track *t, const double *changes, double ratio,
                           double *drive) {
  double matrix[PIECE * PIECE], right[PIECE], square = 0, logarithm = 0;
  const uint32_t all = t->count - 2;
  for (uint32_t from = 0; from < all; from += PIECE) {
    const uint32_t n = all - from < PIECE ? all - from : PIECE;
    memset(matrix, 0, sizeof matrix);
    for (uint32_t r = 0; r < n; ++r) {
      double own[3], other[3];
      const double step = difference(t, from + r + 1, own);
      for (uint32_t c = r < 2 ? 0 : r - 2; c <= r; ++c) {
        difference(t, from + c + 1, other);
        // Rows r and c share the frames r .. c + 2 of the piece.
        double sum = 0;
        for (uint32_t k = r; k <= c + 2; ++k) sum += own[k - r] * other[k - c];
        matrix[r * n + c] = ratio * sum + (r == c ? step : 0);
      }
      right[r] = changes[from + r];
    }
    if (!sonde_cholesky(matrix, n)) return (double)INFINITY;
    for (uint32_t r = 0; r < n; ++r) logarithm += 2 * log(matrix[r * n + r]);
    double kept[PIECE];
    memcpy(kept, right, n * sizeof *kept);
    sonde_cholesky_solve(matrix, n, right);
    for (uint32_t r = 0; r < n; ++r) square += kept[r] * right[r];
  }
  *drive = square / all;
  return all * log(*drive) + logarithm;
}

static void measure_noise(pose_track *t, const double *changes, int axis) {
  // The ratio is looked for around the cube of the mean step, where both show alike.
  const double step = (t->time_s[t->count - 1] - t->time_s[0]) / (t->count - 1);
  double drive, least = unlikelihood(t, changes, 0, &drive);
  t->noise[axis] = 0, t->drive[axis] = drive;
  if (!(drive > 0)) { // it never bends
    t->drive[axis] = PINNED * PINNED / (step * step * step);
    return;
  }
  const double still = least;
  double best = 0;
  for (int k = 0; k < RATIOS; ++k) {
    const double ratio = step * step * step * pow(10, -3 + 0.25 * k);
    const double now = unlikelihood(t, changes, ratio, &drive);
    if (now < least) least = now, best = ratio, t->drive[axis] = drive;
  }
  if (least > still - 2 * LIKELIER) best = 0, (void)unlikelihood(t, changes, 0, &t->drive[axis]);
  t->noise[axis] = sqrt(best * t->drive[axis]);
}

void sonde_pose_track_prior(const pose_track *t, double (*motions)[POSE_AXES], pose_system *s) {
  for (int a = 0; a < POSE_AXES; ++a) {
    const double noise = fmax(t->noise[a], PINNED);
    for (uint32_t i = 0; i < t->count; ++i) {
      pose_system_add(s, i, a, i, a, 1 / (noise * noise));
      pose_system_border(s, i, a)[POSE_COMMON] -= motions[i][a] / (noise * noise);
      if (i == 0 || i + 1 == t->count) continue;
      double w[3];
      const double precision = 1 / (difference(t, i, w) * t->drive[a]);
      double bent = 0;
      for (uint32_t k = 0; k < 3; ++k) bent += w[k] * motions[i - 1 + k][a];
      for (uint32_t k = 0; k < 3; ++k) {
        for (uint32_t l = 0; l <= k; ++l)
          pose_system_add(s, i - 1 + k, a, i - 1 + l, a, precision * w[k] * w[l]);
        pose_system_border(s, i - 1 + k, a)[POSE_COMMON] -= precision * w[k] * bent;
      }
    }
  }
}

sonde_status sonde_pose_track_smooth(pose_track *t, sonde_error *error) {
  SONDE_ASSERT(t->count > 2);
  pose_system system;
  sonde_status status = sonde_pose_system_create(t->count, &system, error);
  if (status) return status;
  double(*motions)[POSE_AXES] = sonde_calloc(t->count, sizeof *motions);
  double *changes = SONDE_NEW(double, POSE_AXES *(size_t)t->count);
  if (!motions || !changes) status = sonde_fail_memory(error);
  for (uint32_t i = 1; i + 1 < t->count && !status; ++i) {
    double change[POSE_AXES];
    bend(t, t->given, i, change);
    for (size_t a = 0; a < POSE_AXES; ++a) changes[a * (t->count - 2) + i - 1] = change[a];
  }
  for (int a = 0; a < POSE_AXES && !status; ++a)
    measure_noise(t, changes + (size_t)a * (t->count - 2), a);
  if (!status) memcpy(t->smooth, t->given, t->count * sizeof *t->smooth);
  for (int round = 0; round < ROUNDS && !status; ++round) {
    // The prior of zero motions gives the matrix; the slope is that of noise and bends as they are.
    sonde_pose_system_reset(&system, t->count);
    memset(motions, 0, t->count * sizeof *motions);
    sonde_pose_track_prior(t, motions, &system);
    for (int k = 0; k < POSE_COMMON; ++k) system.corner[k][k] = 1;
    for (uint32_t i = 0; i < t->count; ++i) {
      double off[POSE_AXES], change[POSE_AXES], w[3];
      const bool inner = i > 0 && i + 1 < t->count;
      pose_between(t->given[i], t->smooth[i], off);
      if (inner) bend(t, t->smooth, i, change);
      for (int a = 0; a < POSE_AXES; ++a) {
        const double noise = fmax(t->noise[a], PINNED);
        pose_system_border(&system, i, a)[POSE_COMMON] -= off[a] / (noise * noise);
        if (!inner) continue;
        const double pull = change[a] / (difference(t, i, w) * t->drive[a]);
        for (uint32_t k = 0; k < 3; ++k)
          pose_system_border(&system, i - 1 + k, a)[POSE_COMMON] -= pull * w[k];
      }
    }
    if (!sonde_pose_system_solve(&system))
      status = sonde_fail(error, SONDE_MISMATCH, "the trajectory of the frames is not finite");
    for (uint32_t i = 0; i < t->count && !status; ++i)
      t->smooth[i] = pose_moved(t->smooth[i], system.step + (size_t)i * POSE_AXES);
  }
  sonde_free(motions);
  sonde_free(changes);
  sonde_pose_system_clear(&system);
  return status;
}

// Lagrange's polynomial through the two frames before and behind; a line beyond the ends.
static sonde_pose between_frames(const pose_track *t, double time_s) {
  uint32_t low = 0, high = t->count - 1;
  while (high - low > 1) {
    const uint32_t middle = (low + high) / 2;
    *(t->time_s[middle] <= time_s ? &low : &high) = middle;
  }
  uint32_t first = low, last = high;
  if (time_s >= t->time_s[0] && time_s <= t->time_s[t->count - 1]) {
    first = low > 0 ? low - 1 : low;
    last = high + 1 < t->count ? high + 1 : high;
  }
  double sum[POSE_AXES] = {0};
  for (uint32_t i = first; i <= last; ++i) {
    double weight = 1, motion[POSE_AXES];
    for (uint32_t k = first; k <= last; ++k)
      if (k != i) weight *= (time_s - t->time_s[k]) / (t->time_s[i] - t->time_s[k]);
    pose_between(t->smooth[low], t->smooth[i], motion);
    for (int a = 0; a < POSE_AXES; ++a) sum[a] += weight * motion[a];
  }
  return pose_moved(t->smooth[low], sum);
}

sonde_pose sonde_pose_track_at(const pose_track *t, uint32_t frame, double later_s,
                               double velocity[POSE_AXES]) {
  SONDE_ASSERT(frame < t->count && t->count > 1);
  const double step = 1e-3 * (t->time_s[t->count - 1] - t->time_s[0]) / (t->count - 1);
  const double time_s = t->time_s[frame] + later_s;
  pose_between(between_frames(t, time_s - step), between_frames(t, time_s + step), velocity);
  for (int a = 0; a < POSE_AXES; ++a) velocity[a] /= 2 * step;
  return later_s == 0 ? t->smooth[frame] : between_frames(t, time_s);
}
