// read_move:  one straight move: plateau and breakaway of tangential over normal force.
// collect:    moves of one speed, both directions.
// sonde_slide_read: speeds in ascending order.
#include "identify/summary.h"

#include "base/maths.h"

static const double SHORTEST_M = 3e-3;  // of a move
static const double LEAST_PUSH_N = 0.2; // below it the ratio means nothing
static const double SAME_SPEED = 1.15;  // ratio of speeds that count as one
enum { FEWEST = 20, SMOOTH = 11, MOST_MOVES = 256 };

typedef struct move {
  double speed_m_s; // signed
  double plateau;   // tangential/normal, signed
  double peak;      // along the move, smoothed
} move;

static double ratio_at(const sonde_motion_record *record, uint32_t k) {
  const sonde_motion_sample *s = &record->samples[k];
  return s->normal_n > LEAST_PUSH_N ? s->tangential_n / s->normal_n : 0;
}

// Largest mean of SMOOTH neighbouring ratios along the direction of the move.
static double peak_of(const sonde_motion_record *record, sonde_span span, double direction) {
  double best = -INFINITY;
  for (uint32_t k = span.from; k + SMOOTH <= span.to; ++k) {
    double sum = 0;
    for (uint32_t j = 0; j < SMOOTH; ++j) sum += ratio_at(record, k + j);
    best = fmax(best, direction * sum / SMOOTH);
  }
  return best;
}

static sonde_status read_move(const sonde_motion_record *record, double start_s, double end_s,
                              double speed, move *found, sonde_error *error) {
  sonde_span span = sonde_span_between(record, start_s, end_s);
  sonde_span half = sonde_span_between(record, 0.5 * (start_s + end_s), end_s);
  uint32_t count = half.to - half.from;
  *found = (move){0};
  if (count < FEWEST) return SONDE_OK;
  double *ratio = SONDE_NEW(double, count);
  if (!ratio) return sonde_fail_memory(error);
  for (uint32_t k = 0; k < count; ++k) ratio[k] = ratio_at(record, half.from + k);
  *found = (move){speed, sonde_median(ratio, count), peak_of(record, span, speed < 0 ? -1 : 1)};
  sonde_free(ratio);
  return SONDE_OK;
}

// Half the sum of the directions is what leans against the probe on sloping skin; half their
// difference is friction.
static sonde_slide collect(const move *moves, uint32_t count, double speed) {
  double sum[2] = {0}, peak = 0;
  uint32_t n[2] = {0};
  for (uint32_t k = 0; k < count; ++k) {
    double size = fabs(moves[k].speed_m_s);
    if (size > speed * SAME_SPEED || size * SAME_SPEED < speed) continue;
    int back = moves[k].speed_m_s < 0;
    sum[back] += moves[k].plateau;
    n[back]++;
    peak = fmax(peak, moves[k].peak);
  }
  double there = n[0] ? sum[0] / n[0] : 0, back = n[1] ? sum[1] / n[1] : 0;
  bool both = n[0] && n[1];
  return (sonde_slide){.speed_m_s = speed,
                       .ratio = both ? 0.5 * (there - back) : fabs(there + back),
                       .breakaway = peak,
                       .lean = both ? 0.5 * (there + back) : 0,
                       .moves = n[0] + n[1]};
}

static void sort_in(sonde_slide *slides, uint32_t *count, sonde_slide added) {
  SONDE_ASSERT(*count < SONDE_HOLDS);
  uint32_t at = (*count)++;
  for (; at > 0 && slides[at - 1].speed_m_s > added.speed_m_s; --at) slides[at] = slides[at - 1];
  slides[at] = added;
}

static bool is_known(const sonde_slide *slides, uint32_t count, double speed) {
  for (uint32_t k = 0; k < count; ++k)
    if (speed <= slides[k].speed_m_s * SAME_SPEED && speed * SAME_SPEED >= slides[k].speed_m_s)
      return true;
  return false;
}

static sonde_status read_moves(const sonde_motion_record *record, const sonde_track *track,
                               move *moves, uint32_t *count, sonde_error *error) {
  for (uint32_t k = 0; k + 1 < track->count && *count < MOST_MOVES; ++k) {
    double speed = sonde_track_slope(track, k);
    bool moved = fabs(track->value[k + 1] - track->value[k]) >= SHORTEST_M;
    if (!moved || fabs(speed) < SONDE_STANDS_M_S) continue;
    move *found = &moves[*count];
    sonde_status status =
        read_move(record, track->time_s[k], track->time_s[k + 1], speed, found, error);
    if (status) return status;
    *count += fabs(found->speed_m_s) > 0;
  }
  return SONDE_OK;
}

sonde_status sonde_slide_read(const sonde_motion_record *record, sonde_slide *slides,
                              uint32_t *count, sonde_error *error) {
  const sonde_motion_sample *s = record->samples;
  move moves[MOST_MOVES];
  uint32_t found = 0;
  sonde_track track;
  *count = 0;
  sonde_status status = sonde_track_fit(&s->time_s, &s->slide_m, sizeof *s / sizeof(double),
                                        record->count, &track, error);
  if (!status) status = read_moves(record, &track, moves, &found, error);
  for (uint32_t k = 0; !status && k < found && *count < SONDE_HOLDS; ++k) {
    double speed = fabs(moves[k].speed_m_s);
    if (!is_known(slides, *count, speed)) sort_in(slides, count, collect(moves, found, speed));
  }
  sonde_track_clear(&track);
  if (status || *count) return status;
  return sonde_fail(error, SONDE_FORMAT,
                    "no slide, expected at least one straight move of %g mm and %d samples",
                    SHORTEST_M * 1e3, 2 * FEWEST);
}
