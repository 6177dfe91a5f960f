// bench_poke_solid MODEL [TICKS [SEED]]: random poking of a session whose tissue is the live solid,
// in lockstep: presses to 22 mm, slides, rolls and tilts at 2 to 200 mm/s, lifts, trembling, and
// jumps into the skin at other sites, with every built-in probe in turn. After each tick the force
// is finite, does not draw the probe into the skin, and changes by no more than 20 N; the hand
// never gets back more work than it has done. Prints a JSON object; exit code 1 when a law is
// broken.
#include "poke.h"
#include "pose.h"
#include "sonde/exam_solid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double DRAWN_N = 0.01, WORK_J = 1e-3;
enum { PROBES = 3, RUN_TICKS = 20000 };

typedef struct hand {
  poke path;
  sonde_pose pose, before;
  sonde_vec3 force_n;
  double work_j, least_work_j; // done by the hand since the solid was at rest
  double most_n, most_change_n, most_drawn_n;
  long ticks, touching, not_finite, drawn, gains;
} hand;

static sonde_vec3 minus(sonde_vec3 a, sonde_vec3 b) {
  return (sonde_vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}

static void read_pose(void *self, uint64_t tick, sonde_device_sample *sample) {
  hand *h = self;
  (void)tick;
  h->before = h->pose;
  h->pose = poke_next(&h->path, sqrt(vec_dot(h->force_n, h->force_n)));
  *sample = (sonde_device_sample){.world_from_probe = h->pose, .present = true};
}

static void feel(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m) {
  hand *h = self;
  const double size = sqrt(vec_dot(force_n, force_n));
  const sonde_vec3 change = minus(force_n, h->force_n);
  const double drawn = vec_dot(force_n, pose_axis(h->pose, 2));
  ++h->ticks, h->touching += size > 0;
  if (!isfinite(size + vec_dot(torque_n_m, torque_n_m))) {
    ++h->not_finite;
    return;
  }
  h->most_n = fmax(h->most_n, size), h->most_drawn_n = fmax(h->most_drawn_n, drawn);
  h->most_change_n = fmax(h->most_change_n, sqrt(vec_dot(change, change)));
  h->drawn += drawn > DRAWN_N;
  // Jumps through the skin are none of the hand's work; turns are left out of it.
  const sonde_vec3 way = minus(h->pose.position, h->before.position);
  if (vec_dot(way, way) < 1e-6)
    h->work_j -= 0.5 * vec_dot(force_n, way) + 0.5 * vec_dot(h->force_n, way);
  if (size == 0)
    h->gains += h->work_j < -WORK_J, h->least_work_j = fmin(h->least_work_j, h->work_j),
                                     h->work_j = 0;
  h->force_n = force_n;
}

static void keep(void *self) { (void)self; } // the hand outlives the session

int main(int count, char **word) {
  if (count < 2 || count > 4) {
    fprintf(stderr, "usage: bench_poke_solid MODEL [TICKS [SEED]]\n");
    return 2;
  }
  const long ticks = count > 2 ? atol(word[2]) : 60000;
  const uint64_t seed = count > 3 ? strtoull(word[3], NULL, 10) : 1;
  sonde_error error = {0};
  sonde_model *model = NULL;
  sonde_status status = sonde_model_load(word[1], &model, &error);
  hand h = {0};
  sonde_session_solid_counts all = {0};
  for (long done = 0, run = 0; done < ticks && !status; done += RUN_TICKS, ++run) {
    const poke_def path = {
        .dt_s = 1e-3, .fastest_m_s = 0.2, .deepest_m = 22e-3, .most_force_n = 30};
    sonde_device device = {"poke", &h, read_pose, feel, keep};
    const sonde_session_solid solid = sonde_session_solid_default();
    sonde_session_def def = sonde_session_def_default();
    sonde_session *session = NULL;
    def.model = model, def.solid = &solid, def.controls.probe = (uint32_t)(run % PROBES);
    def.image_width = def.image_height = 64, def.ticks_per_image = 1000;
    h.path = poke_begin(model, &path, seed * 1000 + (uint64_t)run);
    h.force_n = (sonde_vec3){0, 0, 0}, h.work_j = 0;
    status = sonde_session_create(&def, &device, &session, &error);
    for (long t = 0; t < RUN_TICKS && !status; ++t) {
      sonde_session_tick(session);
    }
    if (status) break;
    const sonde_session_solid_counts c = sonde_session_solid_count(session);
    all.passes += c.passes, all.factors += c.factors, all.places += c.places;
    all.refused += c.refused, all.ticks_without_place += c.ticks_without_place;
    all.handed_over_n = fmax(all.handed_over_n, c.handed_over_n);
    status = sonde_session_destroy(session, &error);
  }
  const long broken = h.not_finite + h.drawn + h.gains;
  printf(
      "{\"ticks\": %ld, \"touching\": %ld, \"broken\": %ld, \"not_finite\": %ld, \"drawn\": %ld, "
      "\"gains\": %ld, \"most_n\": %.4g, \"most_change_n\": %.4g, "
      "\"most_drawn_n\": %.4g, \"least_work_mj\": %.4g, \"passes\": %llu, \"factors\": %llu, "
      "\"places\": %u, \"refused\": %u, \"ticks_without_place\": %llu, \"handed_over_n\": %.4g}\n",
      h.ticks, h.touching, broken, h.not_finite, h.drawn, h.gains, h.most_n, h.most_change_n,
      h.most_drawn_n, 1e3 * h.least_work_j, (unsigned long long)all.passes,
      (unsigned long long)all.factors, all.places, all.refused,
      (unsigned long long)all.ticks_without_place, all.handed_over_n);
  if (status) fprintf(stderr, "bench_poke_solid: %s\n", error.message);
  sonde_model_destroy(model);
  return status ? 2 : broken > 0;
}
