// Friction of sliding: plateau and breakaway of tangential over normal force in straight moves, put
// together by speed.
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

sonde_status sonde_slide_read(const sonde_motion_record *record, sonde_slide *slides,
                              uint32_t *count, sonde_error *error) {
  const sonde_motion_sample *s = record->samples;
  move moves[MOST_MOVES];
  uint32_t found = 0;
  sonde_track track;
  *count = 0;
  sonde_status status = sonde_track_fit(&s->time_s, &s->slide_m, sizeof *s / sizeof(double),
                                        record->count, &track, error);
  // Straight moves.
  for (uint32_t k = 0; !status && k + 1 < track.count && found < MOST_MOVES; ++k) {
    double speed = sonde_track_slope(&track, k);
    bool moved = fabs(track.value[k + 1] - track.value[k]) >= SHORTEST_M;
    if (!moved || fabs(speed) < SONDE_STANDS_M_S) continue;
    double start_s = track.time_s[k], end_s = track.time_s[k + 1];
    sonde_span span = sonde_span_between(record, start_s, end_s);
    sonde_span half = sonde_span_between(record, 0.5 * (start_s + end_s), end_s);
    uint32_t samples = half.to - half.from;
    if (samples < FEWEST) continue;
    double *ratio = SONDE_NEW(double, samples);
    if (!ratio) {
      status = sonde_fail_memory(error);
      break;
    }
    for (uint32_t i = 0; i < samples; ++i) ratio[i] = ratio_at(record, half.from + i);
    move *now = &moves[found++];
    *now = (move){speed, sonde_median(ratio, samples), -INFINITY};
    sonde_free(ratio);
    // Largest mean of neighbouring ratios along the direction of the move.
    for (uint32_t i = span.from; i + SMOOTH <= span.to; ++i) {
      double sum = 0;
      for (uint32_t j = 0; j < SMOOTH; ++j) sum += ratio_at(record, i + j);
      now->peak = fmax(now->peak, (speed < 0 ? -1 : 1) * sum / SMOOTH);
    }
  }
  // Their speeds, ascending.
  for (uint32_t k = 0; !status && k < found && *count < SONDE_HOLDS; ++k) {
    double speed = fabs(moves[k].speed_m_s);
    bool known = false;
    for (uint32_t n = 0; n < *count && !known; ++n)
      known =
          speed <= slides[n].speed_m_s * SAME_SPEED && speed * SAME_SPEED >= slides[n].speed_m_s;
    if (known) continue;
    uint32_t at = (*count)++;
    for (; at > 0 && slides[at - 1].speed_m_s > speed; --at) slides[at] = slides[at - 1];
    // Half the sum of the directions is what leans against the probe on sloping skin; half their
    // difference is friction.
    SONDE_ASSERT(speed > 0 && found <= MOST_MOVES);
    double sum[2] = {0}, peak = 0;
    uint32_t n[2] = {0};
    for (uint32_t i = 0; i < found; ++i) {
      double size = fabs(moves[i].speed_m_s);
      if (size > speed * SAME_SPEED || size * SAME_SPEED < speed) continue;
      int back = moves[i].speed_m_s < 0;
      sum[back] += moves[i].plateau;
      n[back]++;
      peak = fmax(peak, moves[i].peak);
    }
    double there = n[0] ? sum[0] / n[0] : 0, back = n[1] ? sum[1] / n[1] : 0;
    bool both = n[0] && n[1];
    slides[at] = (sonde_slide){.speed_m_s = speed,
                               .ratio = both ? 0.5 * (there - back) : fabs(there + back),
                               .breakaway = peak,
                               .lean = both ? 0.5 * (there + back) : 0,
                               .moves = n[0] + n[1]};
  }
  sonde_track_clear(&track);
  if (status || *count) return status;
  return sonde_fail(error, SONDE_FORMAT,
                    "no slide, expected at least one straight move of %g mm and %d samples",
                    SHORTEST_M * 1e3, 2 * FEWEST);
}
