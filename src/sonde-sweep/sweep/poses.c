// Poses of tracked frames corrected by their content: per frame a deviation from the smooth
// trajectory, for all of them a time offset and a calibration, by Gauss and Newton's method from
// coarse to fine pictures.
#include "sweep/poses.h"

#include "base/order.h"
#include "sparse/dense.h"

#include <string.h>

enum { FEWEST = 8, STEPS = 8, COARSER = 2, POINTS = 5000, SMALLEST = 10, ROUNDS = 5 };

static const double FINEST_M = 0.25e-3;   // pixel of the finest pictures that are compared
static const double OFFSET_PRIOR_S = 0.5; // deviations before the content has been seen
static const double SHIFT_PRIOR_M = 5e-3, TURN_PRIOR = 0.05;
// Steps between frames: closer ones are not compared, wider gaps not bridged.
static const double NEAREST = 0.3, WIDEST = 4;
static const double LEAST_SQUARE = 4;  // grey^2: greys are foretold no better than by two levels
static const double INDEPENDENT = 100; // points of a frame: interpolation errs alike over its tenth
static const double KEPT = 1e24;       // precision of a number that is kept
static const double SIGMAS = 3;        // how many deviations a number that is found is from zero
static const double MOST_SHIFT_SD_M = 0.5e-3, MOST_TURN_SD = 0.0087; // of numbers that are found
static const double MOST_OFFSET_SD = 0.5;                            // steps between frames
static const double MOST_SHIFT_M = 3e-3, MOST_TURN = 0.0524, MOST_OFFSET_S = 0.25;
static const double LEAST_GAIN = 0.03; // share of the mean square that the common numbers take

// All frames' poses and how alike the frames are with them.
typedef struct solution {
  sonde_pose *poses;                                  // [count]
  double (*motions)[POSE_AXES];                       // [count] from the smooth trajectory
  double common[POSE_COMMON], deviation[POSE_COMMON]; // offset (s), calibration
  double mean_square;                                 // of the content, at the finest level
} solution;

typedef struct work {
  sonde_sequence *sequence;
  pose_track track;
  pose_content content;
  pose_system system;
  bool *hidden; // [count of the track]
  int finest;
  double (*velocity)[POSE_AXES], *scatter; // [count]
  solution solutions[3];                   // given poses, and two more:
  solution *best, *trial;
} work;

// Used frames, their poses in their own axes, their times.
static sonde_status take_frames(work *w, const bool *hidden, sonde_error *error) {
  const sonde_sequence *s = w->sequence;
  pose_track *t = &w->track;
  t->frames = SONDE_NEW(uint32_t, s->count);
  t->time_s = SONDE_NEW(double, s->count);
  t->given = SONDE_NEW(sonde_pose, s->count);
  t->smooth = SONDE_NEW(sonde_pose, s->count);
  w->hidden = SONDE_NEW(bool, s->count);
  w->scatter = SONDE_NEW(double, s->count);
  w->velocity = sonde_calloc(s->count, sizeof *w->velocity);
  w->content.terms = SONDE_NEW(pose_terms, s->count);
  bool enough = t->frames && t->time_s && t->given && t->smooth && w->hidden && w->scatter &&
                w->velocity && w->content.terms;
  for (size_t k = 0; k < SONDE_COUNT_OF(w->solutions); ++k) {
    solution *one = &w->solutions[k];
    one->poses = SONDE_NEW(sonde_pose, s->count);
    one->motions = sonde_calloc(s->count, sizeof *one->motions);
    enough = enough && one->poses && one->motions;
  }
  if (!enough) return sonde_fail_memory(error);
  t->timed = true;
  for (uint32_t i = 0; i < s->count; ++i) {
    if (!s->frames[i].used) continue;
    const sonde_affine *a = &s->frames[i].world_from_pixel;
    const sonde_vec3 u = affine_column(a, 0), v = affine_column(a, 1);
    const sonde_vec3 x = v_unit(u, vec3(1, 0, 0)), n = v_unit(v_cross(u, v), vec3(0, 0, 1));
    const sonde_vec3 y = v_cross(n, x);
    if (t->count == 0) {
      w->content.pixel_m[0] = v_norm(u), w->content.pixel_m[1] = v_dot(v, y);
      w->content.pixel_m[2] = v_dot(v, x);
    }
    const sonde_vec3 middle =
        vec3(s->clip[0] + 0.5 * (s->clip[2] - 1), s->clip[1] + 0.5 * (s->clip[3] - 1), 0);
    t->given[t->count] = (sonde_pose){affine_apply(a, middle), q_from_matrix(m_columns(x, y, n))};
    const char *stamp = sonde_sequence_get(s, i, "Timestamp"), *end = NULL;
    const double time_s = stamp ? sonde_parse_real(stamp, &end) : (double)NAN;
    t->timed = t->timed && stamp && end != stamp && isfinite(time_s) &&
               (t->count == 0 || time_s > t->time_s[t->count - 1]);
    t->time_s[t->count] = time_s;
    w->hidden[t->count] = hidden && hidden[i];
    t->frames[t->count++] = i;
  }
  for (uint32_t k = 0; k < t->count && !t->timed; ++k) t->time_s[k] = t->frames[k];
  uint32_t shown = 0;
  for (uint32_t k = 0; k < t->count; ++k) shown += !w->hidden[k];
  if (shown < FEWEST)
    return sonde_fail(error, SONDE_MISMATCH,
                      "%u frames with a pose: expected at least %d to correct poses by", shown,
                      FEWEST);
  return SONDE_OK;
}

// Poses of the motions and common numbers of a solution.
static void place(work *w, solution *s) {
  for (uint32_t i = 0; i < w->track.count; ++i) {
    const sonde_pose smooth = sonde_pose_track_at(&w->track, i, s->common[0], w->velocity[i]);
    s->poses[i] = pose_moved(pose_moved(smooth, s->motions[i]), s->common + 1);
  }
}

static sonde_status compare(work *w, solution *s, int level, sonde_error *error) {
  pose_content *c = &w->content;
  const double all = (double)c->bank->wide[level] * c->bank->high[level];
  c->poses = s->poses;
  c->level = level, c->stride = (uint32_t)fmax(1, ceil(sqrt(all / POINTS)));
  sonde_status status = sonde_pose_content_compare(c, error);
  double square = 0, points = 0;
  for (uint32_t i = 0; i < w->track.count; ++i)
    square += c->terms[i].square, points += c->terms[i].points;
  s->mean_square = points > 0 ? square / points : 0;
  if (!status && !(points > 0))
    status = sonde_fail(error, SONDE_MISMATCH, "no frame lies between others");
  return status;
}

// What one point tells, in independent points with a residual of one: residuals near each other
// are alike, so that the slopes of the frames scatter more than the matrices say.
static double weigh(work *w, double mean_square) {
  uint32_t count = 0;
  for (uint32_t i = 0; i < w->track.count; ++i) {
    const pose_terms *t = &w->content.terms[i];
    enum { FIRST = POSE_SPAN * POSE_AXES };
    double matrix[POSE_AXES][POSE_AXES], x[POSE_AXES], sum = 0;
    for (int a = 0; a < POSE_AXES; ++a) {
      memcpy(matrix[a], t->matrix[FIRST + a] + FIRST, sizeof matrix[a]);
      x[a] = t->slope[FIRST + a];
      matrix[a][a] *= 1 + 1e-9;
    }
    if (t->points < 10 * POSE_AXES || !sonde_cholesky(matrix[0], POSE_AXES)) continue;
    sonde_cholesky_solve(matrix[0], POSE_AXES, x);
    for (int a = 0; a < POSE_AXES; ++a) sum += x[a] * t->slope[FIRST + a];
    w->scatter[count++] = sum / (POSE_AXES * mean_square);
  }
  qsort(w->scatter, count, sizeof *w->scatter, sonde_compare_reals);
  double points = 0;
  for (uint32_t i = 0; i < w->track.count; ++i) points += w->content.terms[i].points;
  double alike = count ? fmax(1, w->scatter[count / 2]) : 1;
  alike = fmax(alike, points / (w->track.count * INDEPENDENT));
  return 1 / (alike * fmax(mean_square, LEAST_SQUARE));
}

// Adds what frame i tells, times a weight.
static void add_terms(work *w, uint32_t i, double weight) {
  pose_terms *t = &w->content.terms[i];
  pose_system *s = &w->system;
  double common[POSE_LOCAL][POSE_COMMON] = {{0}}, product[POSE_COMMON + 1];
  for (int p = 0; p < POSE_LOCAL; ++p)
    for (int q = p + 1; q < POSE_LOCAL; ++q) t->matrix[p][q] = t->matrix[q][p];
  const int64_t first = (int64_t)i - POSE_SPAN;
  for (int p = 0; p < POSE_LOCAL; ++p) { // what they depend on by the common numbers
    const int64_t frame = first + p / POSE_AXES;
    if (p >= POSE_OTHERS) {
      common[p][p - POSE_OTHERS] = 1;
    } else if (frame >= 0 && frame < (int64_t)w->track.count) {
      common[p][0] = w->velocity[frame][p % POSE_AXES];
    }
  }
  for (int p = 0; p < POSE_LOCAL; ++p) {
    const int64_t frame = first + p / POSE_AXES;
    if (p < POSE_OTHERS && (frame < 0 || frame >= (int64_t)w->track.count)) continue;
    memset(product, 0, sizeof product);
    for (int q = 0; q < POSE_LOCAL; ++q) {
      if (t->matrix[p][q] == 0) continue;
      for (int k = 0; k < POSE_COMMON; ++k) product[k] += t->matrix[p][q] * common[q][k];
      if (q <= p && p < POSE_OTHERS)
        pose_system_add(s, (uint32_t)frame, p % POSE_AXES, (uint32_t)(first + q / POSE_AXES),
                        q % POSE_AXES, weight * t->matrix[p][q]);
    }
    product[POSE_COMMON] = -t->slope[p];
    for (int k = 0; k <= POSE_COMMON; ++k) {
      if (p < POSE_OTHERS)
        pose_system_border(s, (uint32_t)frame, p % POSE_AXES)[k] += weight * product[k];
      for (int l = 0; l < POSE_COMMON; ++l) s->corner[l][k] += weight * common[p][l] * product[k];
    }
  }
}

// Gauss and Newton from zero with the common numbers that are free.
static sonde_status solve(work *w, const bool free[POSE_COMMON], solution *s, sonde_error *error) {
  const double priors[POSE_COMMON] = {OFFSET_PRIOR_S, SHIFT_PRIOR_M, SHIFT_PRIOR_M, SHIFT_PRIOR_M,
                                      TURN_PRIOR,     TURN_PRIOR,    TURN_PRIOR};
  const slice_bank *bank = w->content.bank;
  sonde_status status = SONDE_OK;
  memset(s->motions, 0, w->track.count * sizeof *s->motions);
  memset(s->common, 0, sizeof s->common);
  int level = w->finest + COARSER;
  while (level > w->finest &&
         (level >= SLICE_LEVELS || bank->wide[level] < SMALLEST || bank->high[level] < SMALLEST))
    --level;
  for (; level >= w->finest && !status; --level)
    for (int step = 0; step < STEPS && !status; ++step) {
      place(w, s);
      status = compare(w, s, level, error);
      if (status) break;
      const double weight = weigh(w, s->mean_square);
      pose_system *y = &w->system;
      sonde_pose_system_reset(y, w->track.count);
      sonde_pose_track_prior(&w->track, s->motions, y);
      for (uint32_t i = 0; i < w->track.count; ++i) add_terms(w, i, weight);
      for (int k = 0; k < POSE_COMMON; ++k) {
        y->corner[k][k] += free[k] ? 1 / (priors[k] * priors[k]) : KEPT;
        y->corner[k][POSE_COMMON] -= free[k] ? s->common[k] / (priors[k] * priors[k]) : 0;
      }
      if (!sonde_pose_system_solve(y))
        return sonde_fail(error, SONDE_MISMATCH, "the frames' equations cannot be solved");
      double most = 0; // of a step, in deviations
      // Which frames a point lies between changes with the poses: half steps do not swing.
      const double share = step < 2 ? 1 : 0.5;
      for (uint32_t i = 0; i < w->track.count; ++i)
        for (int a = 0; a < POSE_AXES; ++a) {
          const double by = share * y->step[i * POSE_AXES + (uint32_t)a];
          s->motions[i][a] += by;
          if (w->track.noise[a] > 0) most = fmax(most, fabs(by) / w->track.noise[a]);
        }
      for (int k = 0; k < POSE_COMMON; ++k) {
        s->deviation[k] = free[k] ? sqrt(y->covariance[k][k]) : 0;
        s->common[k] += free[k] ? share * y->common[k] : 0;
        if (free[k]) most = fmax(most, fabs(y->common[k]) / s->deviation[k]);
      }
      if (most < 0.02) break;
    }
  if (status) return status;
  place(w, s);
  return compare(w, s, w->finest, error);
}

// Solves with common numbers free, drops those that the content does not hold (and an offset that
// may be none), and takes the solution when it is sound: no number larger than a given one can be
// off, one of them not zero, and the frames more alike than with the best solution so far.
static sonde_status attempt(work *w, bool free[POSE_COMMON], bool found[POSE_COMMON],
                            sonde_pose_findings *f, sonde_error *error) {
  const pose_track *t = &w->track;
  const double step_s = (t->time_s[t->count - 1] - t->time_s[0]) / (t->count - 1);
  bool any = false, dropped = true, sure = false, sound = true;
  for (int round = 0; round < ROUNDS && dropped; ++round) {
    any = dropped = false;
    for (int k = 0; k < POSE_COMMON; ++k) any |= free[k];
    sonde_status status = any ? solve(w, free, w->trial, error) : SONDE_OK;
    if (status || !any) return status;
    for (int k = 0; k < POSE_COMMON; ++k) {
      if (!free[k]) continue;
      const double value = w->trial->common[k], deviation = w->trial->deviation[k];
      if (k == 0) f->offset_s = value, f->offset_sd_s = deviation;
      if (k > 0) f->calibration[k - 1] = value, f->calibration_sd[k - 1] = deviation;
      const double most = k == 0   ? MOST_OFFSET_SD * step_s
                          : k <= 3 ? MOST_SHIFT_SD_M
                                   : MOST_TURN_SD;
      free[k] = deviation < most && (k > 0 || fabs(value) > SIGMAS * deviation);
      dropped |= !free[k];
    }
  }
  for (int k = 0; k < POSE_COMMON; ++k) {
    const double most = k == 0 ? MOST_OFFSET_S : k <= 3 ? MOST_SHIFT_M : MOST_TURN;
    sound &= !free[k] || fabs(w->trial->common[k]) <= most;
    sure |= free[k] && fabs(w->trial->common[k]) > SIGMAS * w->trial->deviation[k];
  }
  if (dropped || !sound || !sure || w->trial->mean_square > (1 - LEAST_GAIN) * w->best->mean_square)
    return SONDE_OK;
  solution *const worse = w->best;
  w->best = w->trial, w->trial = worse;
  memcpy(found, free, POSE_COMMON * sizeof *found);
  return SONDE_OK;
}

// Moves the frames' maps as stiff bodies, so that their pixels keep their size.
static void move_frames(work *w, const solution *to, sonde_pose_findings *f) {
  const pose_track *t = &w->track;
  for (uint32_t i = 0; i < t->count; ++i) {
    double moved[POSE_AXES];
    pose_between(t->given[i], to->poses[i], moved);
    for (int a = 0; a < 3; ++a) {
      f->moved_m += moved[a] * moved[a] / t->count;
      f->moved_rad += moved[3 + a] * moved[3 + a] / t->count;
    }
    sonde_affine *map = &w->sequence->frames[t->frames[i]].world_from_pixel;
    const sonde_pose change = pose_mul(to->poses[i], pose_inverse(t->given[i]));
    const sonde_vec3 at = pose_apply(change, affine_column(map, 3));
    *map = affine_columns(q_rotate(change.rotation, affine_column(map, 0)),
                          q_rotate(change.rotation, affine_column(map, 1)),
                          q_rotate(change.rotation, affine_column(map, 2)), at);
  }
  f->moved_m = sqrt(f->moved_m), f->moved_rad = sqrt(f->moved_rad);
}

static sonde_status refine(work *w, sonde_pose_findings *f, const sonde_progress *progress,
                           sonde_error *error) {
  const pose_track *t = &w->track;
  const slice_bank *bank = w->content.bank;
  double along = 0;
  for (uint32_t i = 0; i + 1 < t->count; ++i) {
    double step[POSE_AXES];
    pose_between(t->smooth[i], t->smooth[i + 1], step);
    along += fabs(step[2]) / (t->count - 1);
  }
  w->content.track = t, w->content.hidden = w->hidden, w->content.velocity = w->velocity;
  w->content.nearest_m = fmax(NEAREST * along, 1e-5),
  w->content.widest_m = fmax(WIDEST * along, 1e-4);
  const double pixel_m = sqrt(w->content.pixel_m[0] * w->content.pixel_m[1]);
  while (w->finest + 1 < SLICE_LEVELS &&
         (w->finest == 0 || pixel_m * (1 << w->finest) < FINEST_M) &&
         bank->wide[w->finest + 1] > 2 * SMALLEST && bank->high[w->finest + 1] > 2 * SMALLEST)
    ++w->finest;
  solution *given = &w->solutions[0];
  w->best = &w->solutions[1], w->trial = &w->solutions[2];
  memcpy(given->poses, t->given, t->count * sizeof *t->given);
  bool found[POSE_COMMON] = {false}, free[POSE_COMMON] = {t->timed};
  sonde_status status = compare(w, given, w->finest, error);
  if (!status) status = solve(w, found, w->best, error);
  for (int trial = 0; trial < 2 && !status; ++trial) { // the offset alone, then the calibration too
    if (!sonde_progress_report(progress, (1.0 + trial) / 3, "poses"))
      return sonde_fail(error, SONDE_CANCELLED, "cancelled while correcting poses");
    const solution *before = w->best;
    const double offset_s = f->offset_s, offset_sd_s = f->offset_sd_s;
    status = attempt(w, free, found, f, error);
    if (trial > 0 && w->best == before) f->offset_s = offset_s, f->offset_sd_s = offset_sd_s;
    free[0] = t->timed;
    for (int k = 1; k < POSE_COMMON; ++k) free[k] = true;
  }
  if (status) return status;
  f->kept = !(w->best->mean_square < given->mean_square);
  const solution *best = f->kept ? given : w->best;
  f->frames = t->count, f->timed = t->timed, f->offset_found = found[0] && !f->kept;
  for (int k = 1; k < POSE_COMMON; ++k) f->calibration_found[k - 1] = found[k] && !f->kept;
  f->rms_grey_before = sqrt(given->mean_square), f->rms_grey_after = sqrt(best->mean_square);
  for (int a = 0; a < 3; ++a) {
    f->jitter_m += t->noise[a] * t->noise[a] / 3;
    f->jitter_rad += t->noise[3 + a] * t->noise[3 + a] / 3;
  }
  f->jitter_m = sqrt(f->jitter_m), f->jitter_rad = sqrt(f->jitter_rad);
  move_frames(w, best, f);
  return SONDE_OK;
}

sonde_status sonde_sequence_refine_poses(sonde_sequence *s, const bool *hidden,
                                         sonde_pose_findings *findings,
                                         const sonde_progress *progress, sonde_error *error) {
  SONDE_ASSERT(s != NULL && s->frames != NULL && findings != NULL);
  *findings = (sonde_pose_findings){0};
  work w = {.sequence = s};
  slice_bank *bank = NULL;
  const sonde_slicer_options slicer = sonde_slicer_options_default();
  sonde_status status = sonde_slicer_check(s, &slicer, error);
  if (!status) status = take_frames(&w, hidden, error);
  if (!status) status = sonde_slice_bank_create(s, &bank, error);
  if (!status) status = sonde_pose_system_create(w.track.count, &w.system, error);
  if (!status) status = sonde_pose_track_smooth(&w.track, error);
  w.content.bank = bank;
  if (!status) status = refine(&w, findings, progress, error);
  for (size_t k = 0; k < SONDE_COUNT_OF(w.solutions); ++k) {
    sonde_free(w.solutions[k].poses);
    sonde_free(w.solutions[k].motions);
  }
  sonde_slice_bank_destroy(bank);
  sonde_pose_system_clear(&w.system);
  sonde_free(w.track.frames);
  sonde_free(w.track.time_s);
  sonde_free(w.track.given);
  sonde_free(w.track.smooth);
  sonde_free(w.hidden);
  sonde_free(w.scatter);
  sonde_free(w.velocity);
  sonde_free(w.content.terms);
  return status;
}
