// Friction from slides: coefficients read off the records, then by simulation.
//
// Where friction falls with speed the probe may stick and slip, and the phase of that sawtooth is
// as unpredictable as it is uninteresting. Means over windows and the ripple about them do not have
// it.
#include "identify/inverse.h"
#include "identify/summary.h"

#include "base/maths.h"

enum { KINETIC, STATIC, SPEED, COUNT };
enum { WINDOWS = 3, LOOKS = WINDOWS + 1 };

static const double SHORTEST_M = 3e-3;  // of a slide
static const double LEAST_PUSH_N = 0.1; // below it the ratio of forces means nothing

static void apply(const double *theta, sonde_surface_law *law, sonde_world_def *def,
                  double *scale) {
  (void)law, (void)scale;
  double kinetic = exp(theta[KINETIC]), rest = exp(theta[STATIC]);
  def->friction = (sonde_friction){.mu_kinetic = kinetic,
                                   .mu_static = fmax(rest, kinetic),
                                   .stribeck_speed_m_s = exp(theta[SPEED])};
}

// The next slide from knot *k on: its second half as a span of samples.
static bool next_slide(const sonde_motion_record *record, const sonde_track *slide, uint32_t *k,
                       sonde_span *half) {
  for (; *k + 1 < slide->count; ++*k) {
    double start = slide->time_s[*k], end = slide->time_s[*k + 1];
    bool slides = fabs(slide->value[*k + 1] - slide->value[*k]) >= SHORTEST_M &&
                  fabs(sonde_track_slope(slide, *k)) > SONDE_STANDS_M_S;
    if (!slides) continue;
    *half = sonde_span_between(record, 0.5 * (start + end), end);
    if (half->to - half->from < 10 * WINDOWS) continue;
    ++*k;
    return true;
  }
  return false;
}

static uint32_t count_looks(const sonde_motion_record *record, const sonde_drive *drive) {
  uint32_t count = 0, k = 0;
  sonde_span half;
  while (next_slide(record, &drive->slide, &k, &half)) count += LOOKS;
  return count;
}

// Forces at the samples of a record, measured (samples) or simulated (arrays).
typedef struct forces {
  const sonde_motion_sample *samples;
  const double *normal_n, *tangential_n;
} forces;

static double normal_at(const forces *f, uint32_t k) {
  return f->samples ? f->samples[k].normal_n : f->normal_n[k];
}
static double tangential_at(const forces *f, uint32_t k) {
  return f->samples ? f->samples[k].tangential_n : f->tangential_n[k];
}

static double ratio_of(const forces *f, sonde_span span) {
  double normal = 0, tangential = 0;
  for (uint32_t k = span.from; k < span.to; ++k) {
    normal += normal_at(f, k);
    tangential += tangential_at(f, k);
  }
  return normal > LEAST_PUSH_N * (span.to - span.from) ? tangential / normal : 0;
}

static void look_at(const forces *f, sonde_span half, double looks[LOOKS]) {
  uint32_t length = (half.to - half.from) / WINDOWS;
  SONDE_ASSERT(length > 2);
  for (uint32_t w = 0; w < WINDOWS; ++w) {
    uint32_t from = half.from + w * length;
    looks[w] = ratio_of(f, (sonde_span){from, from + length});
  }
  // Standard deviation of T - ratio N over the mean push, without the part of white noise: that has
  // a mean square of second differences of 6 variances, ripple has next to none.
  const double ratio = ratio_of(f, half);
  double sum = 0, squares = 0, bends = 0, push = 0, last[2] = {0};
  uint32_t count = half.to - half.from;
  for (uint32_t k = half.from; k < half.to; ++k) {
    double e = tangential_at(f, k) - ratio * normal_at(f, k);
    if (k >= half.from + 2) bends += (e - 2 * last[0] + last[1]) * (e - 2 * last[0] + last[1]);
    last[1] = last[0];
    last[0] = e;
    sum += e;
    squares += e * e;
    push += normal_at(f, k);
  }
  double noise = bends / (6.0 * (count - 2)),
         variance = squares / count - sum * sum / count / count;
  looks[WINDOWS] = push > LEAST_PUSH_N * count ? sqrt(fmax(0, variance - noise)) * count / push : 0;
}

static void compare(const sonde_motion_record *record, const sonde_drive *drive,
                    const double *normal_n, const double *tangential_n, double *residual) {
  const forces measured = {record->samples, NULL, NULL}, simulated = {NULL, normal_n, tangential_n};
  uint32_t k = 0;
  sonde_span half;
  while (next_slide(record, &drive->slide, &k, &half)) {
    double seen[LOOKS], model[LOOKS];
    look_at(&measured, half, seen);
    look_at(&simulated, half, model);
    // The noise of a mean of n ratios is that of a sample over push and sqrt(n). The ripple's, near
    // no ripple, is larger.
    double sum = 0;
    for (uint32_t i = half.from; i < half.to; ++i) sum += normal_at(&measured, i);
    double push = fmax(LEAST_PUSH_N, (sum / (half.to - half.from)));
    double scale = push * sqrt((half.to - half.from) / WINDOWS);
    for (int i = 0; i < LOOKS; ++i)
      *residual++ = (model[i] - seen[i]) * (i == WINDOWS ? 0.3 : 1) * scale;
  }
}

// A start and how far from it the parameters may go.
static void put_start(sonde_inverse *in, uint32_t p, double value, double low, double high) {
  in->theta[p] = log(value);
  in->low[p] = log(low);
  in->high[p] = log(high);
}

// A copy of a record less the tangential force that the model shows without friction: slope of the
// skin and what piles up before the probe.
static sonde_status less_pile_up(const sonde_inverse *in, const sonde_motion_record *record,
                                 sonde_motion_record *copy, sonde_error *error) {
  sonde_drive drive;
  double *force = SONDE_NEW(double, 2 * (size_t)record->count);
  *copy = *record;
  copy->samples = SONDE_NEW(sonde_motion_sample, record->count);
  sonde_world_def def = in->options->world;
  def.friction.mu_static = def.friction.mu_kinetic = 0;
  sonde_status status = sonde_drive_from_record(in->model, record, &drive, error);
  if (!status && (!force || !copy->samples)) status = sonde_fail_memory(error);
  if (!status)
    status = sonde_drive_run(&drive, in->model, &def, NULL, in->progress, force,
                             force + record->count, error);
  for (uint32_t k = 0; !status && k < record->count; ++k) {
    copy->samples[k] = record->samples[k];
    copy->samples[k].tangential_n -= force[record->count + k];
  }
  sonde_drive_clear(&drive);
  sonde_free(force);
  if (status) sonde_motion_record_clear(copy);
  return status;
}

typedef struct ratios {
  double low, high, slow_m_s, fast_m_s;
} ratios;

// The coefficients are near those ratios; the Stribeck speed is near the speeds or of no effect.
static sonde_status guess(sonde_inverse *in, sonde_error *error) {
  ratios seen = {INFINITY, 0, INFINITY, 0};
  for (uint32_t r = 0; r < in->record_count; ++r) {
    // Lowest and highest ratio over the speeds of one record.
    sonde_slide slides[SONDE_HOLDS];
    sonde_motion_record copy;
    uint32_t found = 0;
    sonde_status status = less_pile_up(in, &in->records[r], &copy, error);
    if (status) return status;
    status = sonde_slide_read(&copy, slides, &found, error);
    for (uint32_t k = 0; k < found; ++k) {
      seen.low = fmin(seen.low, slides[k].ratio);
      seen.high = fmax(seen.high, slides[k].ratio);
      seen.slow_m_s = fmin(seen.slow_m_s, slides[k].speed_m_s);
      seen.fast_m_s = fmax(seen.fast_m_s, slides[k].speed_m_s);
    }
    sonde_motion_record_clear(&copy);
    if (status) return status;
  }
  double kinetic = clamp(seen.low, 0.005, 4), rest = clamp(1.1 * seen.high, kinetic, 4.5);
  put_start(in, KINETIC, kinetic, kinetic / 4, kinetic * 4);
  put_start(in, STATIC, rest, rest / 4, rest * 4);
  put_start(in, SPEED, sqrt(seen.slow_m_s * seen.fast_m_s), seen.slow_m_s / 3, seen.fast_m_s * 3);
  return SONDE_OK;
}

sonde_status sonde_identify_friction(const sonde_model *model, const sonde_motion_record *records,
                                     uint32_t count, const sonde_identify_options *options,
                                     const sonde_progress *progress, sonde_friction_result *result,
                                     sonde_error *error) {
  sonde_identify_options fallback = sonde_identify_options_default();
  *result = (sonde_friction_result){0};
  sonde_inverse in = {.model = model,
                      .records = records,
                      .record_count = count,
                      .options = options ? options : &fallback,
                      .progress = progress,
                      .parameter_count = COUNT,
                      .simulations = count,
                      .apply = apply,
                      .count = count_looks,
                      .compare = compare,
                      .step = {0.1, 0.1, 0.3}};
  if (!count) return sonde_fail(error, SONDE_ARGUMENT, "no record, expected at least one");
  for (uint32_t r = 1; r < count; ++r)
    if (records[r].gel_film > records[0].gel_film || records[r].gel_film < records[0].gel_film)
      return sonde_fail(error, SONDE_MISMATCH,
                        "records with gel films %g and %g, expected one film for all",
                        records[0].gel_film, records[r].gel_film);
  sonde_status status = guess(&in, error);
  if (!status) status = sonde_inverse_solve(&in, error);
  if (status) return status;
  *result = (sonde_friction_result){.mu_static = sonde_inverse_estimate(&in, STATIC),
                                    .mu_kinetic = sonde_inverse_estimate(&in, KINETIC),
                                    .stribeck_speed_m_s = sonde_inverse_estimate(&in, SPEED),
                                    .gel_film = records[0].gel_film,
                                    .residual_n = in.rms,
                                    .iterations = in.iterations,
                                    .simulations = in.simulations,
                                    .samples = in.samples};
  return SONDE_OK;
}
