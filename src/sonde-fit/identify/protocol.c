// A protocol driven over the model: knots of ramp and hold or of slides, sensors with noise.
#include "base/maths.h"
#include "base/random.h"
#include "sonde/world_path.h"
#include "identify/forward.h"

#include <string.h>

enum {
  MOST_ROUNDS = 8, // to and fro at one speed
  MOST_KNOTS = 5 * SONDE_PROTOCOL_SPEEDS * MOST_ROUNDS + 8,
  MOST_SAMPLES = 1000000
};
static const double LEAD_M = 1e-3;       // the probe waits this far above the skin
static const double APPROACH_M_S = 0.05; // speed of pressing in and out around a slide
static const double DEEPEST_M = 0.06;

sonde_protocol sonde_protocol_default(sonde_protocol_kind kind) {
  sonde_protocol p = {.kind = kind,
                      .probe = "linear",
                      .axis = 'u',
                      .depth_m = 0.012,
                      .speed_m_s = {0.02, 0.04, 0.08},
                      .speed_count = 3,
                      .hold_s = 0.2,
                      .slide_m = 0.012,
                      .rate_hz = 1000,
                      .seed = 1};
  if (kind == SONDE_PROTOCOL_RAMP_HOLD) return p;
  const double speeds[] = {0.01, 0.02, 0.06};
  memcpy(p.speed_m_s, speeds, sizeof speeds);
  p.depth_m = 0.005;
  p.hold_s = 0.1;
  return p;
}

// Where a slow press meets the force.
static sonde_status find_depth(const sonde_model *model, const sonde_drive *drive, double force_n,
                               double *depth_m, sonde_error *error) {
  const sonde_site *site = drive->site;
  sonde_vec3 z = v_neg(site->normal), y = v_cross(z, site->u);
  sonde_pose above = {site->position_m, q_from_matrix(m_columns(site->u, y, z))}, deep = above;
  deep.position = v_madd(site->position_m, -DEEPEST_M, site->normal);
  sonde_path_def def = sonde_path_def_default();
  def.force_n = force_n;
  def.relative_residual = 1e-6;
  sonde_path_result result = {0};
  sonde_state *state;
  sonde_status status = sonde_state_create(model, NULL, &state, error);
  if (status) return status;
  status = sonde_settle_path(state, &drive->probe, above, deep, &def, NULL, &result, error);
  *depth_m = result.way_m;
  sonde_state_destroy(state);
  return status;
}

// Both coordinates get a knot at the same time.
typedef struct plan {
  double time_s, penetration_m, slide_m;
  sonde_track *penetration, *slide;
} plan;

static void put_knot(plan *p) {
  sonde_track *tracks[] = {p->penetration, p->slide};
  const double value[] = {p->penetration_m, p->slide_m};
  for (int k = 0; k < 2; ++k) {
    tracks[k]->time_s[tracks[k]->count] = p->time_s;
    tracks[k]->value[tracks[k]->count++] = value[k];
  }
}

static void move_to(plan *p, double penetration_m, double slide_m, double speed_m_s) {
  SONDE_ASSERT(speed_m_s > 0);
  double distance_m = fabs(penetration_m - p->penetration_m) + fabs(slide_m - p->slide_m);
  p->time_s += distance_m / speed_m_s;
  p->penetration_m = penetration_m;
  p->slide_m = slide_m;
  put_knot(p);
}

static void wait(plan *p, double seconds) {
  p->time_s += seconds;
  put_knot(p);
}

static sonde_status make_plan(const sonde_model *model, const sonde_protocol *protocol,
                              sonde_drive *drive, sonde_error *error) {
  double depth_m = protocol->depth_m;
  sonde_status status = SONDE_OK;
  if (protocol->force_n > 0) status = find_depth(model, drive, protocol->force_n, &depth_m, error);
  if (!status) status = sonde_track_create(MOST_KNOTS, &drive->penetration, error);
  if (!status) status = sonde_track_create(MOST_KNOTS, &drive->slide, error);
  if (status) return status;
  plan p = {0, -LEAD_M, 0, &drive->penetration, &drive->slide};
  put_knot(&p);
  SONDE_ASSERT(depth_m > 0);
  bool slides = protocol->kind == SONDE_PROTOCOL_SLIDE;
  double slowest = INFINITY;
  for (uint32_t k = 0; k < protocol->speed_count; ++k)
    slowest = fmin(slowest, protocol->speed_m_s[k]);
  if (slides) {
    wait(&p, 0.1);
    move_to(&p, depth_m, 0, APPROACH_M_S);
    wait(&p, protocol->hold_s);
  }
  for (uint32_t k = 0; k < protocol->speed_count; ++k) {
    double speed = protocol->speed_m_s[k];
    // As many slides to and fro as take the time of the slowest speed's: the noise weighs the same.
    uint32_t rounds = slides ? (uint32_t)clamp(speed / slowest + 0.5, 1, MOST_ROUNDS) : 0;
    for (uint32_t round = 0; round < rounds; ++round) {
      move_to(&p, depth_m, protocol->slide_m, speed);
      wait(&p, protocol->hold_s);
      move_to(&p, depth_m, 0, speed);
      wait(&p, protocol->hold_s);
    }
    if (slides) continue;
    wait(&p, 0.1);
    move_to(&p, depth_m, 0, speed);
    wait(&p, protocol->hold_s);
    move_to(&p, -LEAD_M, 0, speed);
    wait(&p, 0.2);
  }
  if (slides) move_to(&p, -LEAD_M, 0, APPROACH_M_S);
  SONDE_ASSERT(drive->slide.count <= MOST_KNOTS);
  double samples = floor(p.time_s * protocol->rate_hz) + 1;
  if (samples > MOST_SAMPLES)
    return sonde_fail(error, SONDE_ARGUMENT, "the protocol takes %g s: %g samples, at most %d",
                      p.time_s, samples, MOST_SAMPLES);
  drive->count = (uint32_t)samples;
  sonde_free(drive->time_s);
  drive->time_s = SONDE_NEW(double, drive->count);
  if (!drive->time_s) return sonde_fail_memory(error);
  for (uint32_t k = 0; k < drive->count; ++k) drive->time_s[k] = k / protocol->rate_hz;
  return SONDE_OK;
}

sonde_status sonde_protocol_run(const sonde_model *model, const sonde_world_def *def,
                                const sonde_protocol *protocol, const sonde_progress *progress,
                                sonde_motion_record *record, sonde_error *error) {
  sonde_world_def world = def ? *def : sonde_identify_world();
  *record = (sonde_motion_record){.protocol = protocol->kind,
                                  .site = protocol->site,
                                  .axis = protocol->axis,
                                  .gel_film = world.friction.gel_film,
                                  .synthetic = true};
  snprintf(record->probe, sizeof record->probe, "%s", protocol->probe);
  sonde_status status = SONDE_OK;
  const sonde_bounded range[] = {{"depth_m", protocol->depth_m, 1e-4, DEEPEST_M},
                                 {"force_n", protocol->force_n, 0, 200},
                                 {"speed_count", protocol->speed_count, 1, SONDE_PROTOCOL_SPEEDS},
                                 {"hold_s", protocol->hold_s, 0.02, 60},
                                 {"slide_m", protocol->slide_m, 1e-3, 0.1},
                                 {"rate_hz", protocol->rate_hz, 50, 1 / world.dt_s + 1e-6},
                                 {"noise_force_n", protocol->noise_force_n, 0, 100},
                                 {"noise_position_m", protocol->noise_position_m, 0, 0.01}};
  status = sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
  if (status) return status;
  for (uint32_t k = 0; k < protocol->speed_count; ++k)
    if (!(protocol->speed_m_s[k] >= 1e-3 && protocol->speed_m_s[k] <= 1))
      return sonde_fail(error, SONDE_ARGUMENT, "speed %g m/s, expected 0.001 to 1",
                        protocol->speed_m_s[k]);
  sonde_drive drive;
  status =
      sonde_drive_create(model, protocol->site, protocol->probe, protocol->axis, 2, &drive, error);
  if (!status) status = make_plan(model, protocol, &drive, error);
  if (!status) {
    double *force = SONDE_NEW(double, 2 * (size_t)drive.count);
    record->samples = SONDE_NEW(sonde_motion_sample, drive.count);
    status = force && record->samples ? SONDE_OK : sonde_fail_memory(error);
    if (!status)
      status =
          sonde_drive_run(&drive, model, &world, NULL, progress, force, force + drive.count, error);
    for (uint32_t k = 0; !status && k < drive.count; ++k) {
      double t = drive.time_s[k];
      uint64_t counter = 4 * (uint64_t)k;
      double noise[4];
      for (uint32_t n = 0; n < 4; ++n)
        noise[n] = (n < 2 ? protocol->noise_position_m : protocol->noise_force_n) *
                   sonde_random_normal(protocol->seed, counter + n);
      record->samples[k] =
          (sonde_motion_sample){t, sonde_track_at(&drive.penetration, t) + noise[0],
                                sonde_track_at(&drive.slide, t) + noise[1], force[k] + noise[2],
                                force[drive.count + k] + noise[3]};
    }
    record->count = drive.count;
    sonde_free(force);
  }
  sonde_drive_clear(&drive);
  if (status) sonde_motion_record_clear(record);
  return status;
}
