// bench_legs OUT.csv [COUNT [SEED]]: what whole legs cost, a row for each of COUNT (10) drawn
// limbs: making and saving it, loading its file, its inside, a static press to 8 N at mid-thigh,
// the steps of a session's world at 1 kHz and pictures at 25 Hz while a probe presses and slides at
// four stations. Making and loading by the wall clock, since they take two threads, all else
// processor times of this thread; memory as the system counts it.
#include "sonde/limb_model.h"
#include "sonde/sonde.h"

#include "bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const double LIFT_M = 2e-3, DEPTH_M = 12e-3, SLIDE_M = 20e-3, FORCE_N = 8, DEEPEST_M = 0.04;
static const char *const PLACES[] = {"common_femoral", "femoral_mid", "popliteal",
                                     "posterior_tibial"};
enum {
  PLACE_COUNT = 4,
  PRESS_TICKS = 400,
  HOLD_TICKS = 200,
  SLIDE_TICKS = 400,
  TICKS = PRESS_TICKS + HOLD_TICKS + SLIDE_TICKS,
  PICTURE_TICKS = 40,
  PICTURE_SIZE = 512
};

static double resident_mb(void) {
  long pages = 0, skipped;
  FILE *file = fopen("/proc/self/statm", "r");
  if (!file) return (double)NAN;
  if (fscanf(file, "%ld %ld", &skipped, &pages) != 2) pages = 0;
  fclose(file);
  return 1e-6 * (double)pages * (double)sysconf(_SC_PAGESIZE);
}

typedef struct leg {
  sonde_model *model;
  sonde_state *state;
  sonde_interior *interior;
  sonde_echo *echo;
  sonde_image image;
  sonde_probe probe;
  sonde_pathology healthy;
} leg;

typedef struct cost {
  double build_s, load_s, inside_s, press_s, update_s, memory_mb;
  double tick_s[PLACE_COUNT * TICKS];
  double picture_s[PLACE_COUNT * (TICKS / PICTURE_TICKS)];
} cost;

static sonde_site station_of(const sonde_model *model, const char *name) {
  const sonde_thigh_anatomy *a = model->anatomy;
  for (uint32_t k = 0; k < a->landmark_count; ++k)
    if (strcmp(a->landmark[k].name, name) == 0)
      return *sonde_model_site(model, a->landmark[k].site);
  return model->sites[0];
}

static void update(const leg *l, sonde_state *state, sonde_pose pose, double dt_s) {
  sonde_interior_update(
      l->interior, &(sonde_interior_input){.positions_m = sonde_state_positions(state),
                                           .contact_forces_n = sonde_state_contact_forces(state),
                                           .world_from_probe = pose,
                                           .pathology = &l->healthy,
                                           .dt_s = dt_s,
                                           .face_half_x_m = l->probe.half_x_m,
                                           .face_half_y_m = l->probe.half_y_m});
}

// Makes the limb, saves it and loads the file; what follows is of the loaded one.
static sonde_status make(uint64_t seed, const char *path, leg *l, cost *c, sonde_error *error) {
  sonde_limb_body body = sonde_limb_unknown();
  const sonde_limb_model_def def = sonde_limb_model_def_default();
  sonde_model *made = NULL;
  double start = bench_wall_seconds();
  sonde_status status = sonde_limb_draw(&body, seed, &body, error);
  if (!status) status = sonde_limb_model(&body, &def, &made, error);
  if (!status) status = sonde_model_save(made, path, error);
  c->build_s = bench_wall_seconds() - start;
  sonde_model_destroy(made);
  const double before_mb = resident_mb();
  start = bench_wall_seconds();
  if (!status) status = sonde_limb_model_load(path, &l->model, error);
  c->load_s = bench_wall_seconds() - start;
  const sonde_world_def world = sonde_session_def_default().world;
  const sonde_echo_def echo = sonde_echo_def_default();
  start = bench_seconds();
  if (!status) status = sonde_interior_create(l->model, &l->interior, error);
  c->inside_s = bench_seconds() - start;
  if (!status) status = sonde_state_create(l->model, &world, &l->state, error);
  if (!status) status = sonde_echo_create(l->interior, &echo, &l->echo, error);
  if (!status) status = sonde_image_create(PICTURE_SIZE, PICTURE_SIZE, &l->image, error);
  if (!status) status = sonde_probe_create("linear", &l->probe, error);
  if (!status) status = sonde_pathology_preset("healthy", &l->healthy, error);
  c->memory_mb = resident_mb() - before_mb;
  return status;
}

static sonde_status press(const leg *l, cost *c, sonde_error *error) {
  const sonde_site site = station_of(l->model, "femoral_mid");
  sonde_path_def def = sonde_path_def_default();
  sonde_path_result path;
  sonde_world_def world = sonde_world_def_default();
  sonde_state *state = NULL;
  world.engine = SONDE_ENGINE_DOUBLE; // nothing but equilibria
  def.force_n = FORCE_N;
  double start = bench_seconds();
  sonde_status status = sonde_state_create(l->model, &world, &state, error);
  if (!status)
    status = sonde_settle_path(state, &l->probe, sonde_site_pose(&site, 0),
                               sonde_site_pose(&site, DEEPEST_M), &def, NULL, &path, error);
  c->press_s = bench_seconds() - start;
  start = bench_seconds();
  if (!status) update(l, state, path.pose, -1);
  c->update_s = bench_seconds() - start;
  sonde_state_destroy(state);
  return status;
}

// Presses, holds and slides along the limb at each place; a picture every 40 ticks.
static void examine(leg *l, cost *c) {
  uint32_t ticks = 0, pictures = 0;
  const sonde_echo_settings settings = sonde_echo_settings_default();
  for (int p = 0; p < PLACE_COUNT; ++p) {
    const sonde_site site = station_of(l->model, PLACES[p]);
    sonde_state_reset(l->state);
    for (int k = 1; k <= TICKS; ++k) {
      const double down = fmin(1, (double)k / PRESS_TICKS);
      const double along = fmax(0, (double)(k - PRESS_TICKS - HOLD_TICKS) / SLIDE_TICKS);
      sonde_pose pose = sonde_site_pose(&site, -LIFT_M + down * (DEPTH_M + LIFT_M));
      pose.position.x += along * SLIDE_M * site.v.x;
      pose.position.y += along * SLIDE_M * site.v.y;
      pose.position.z += along * SLIDE_M * site.v.z;
      double start = bench_seconds();
      sonde_step(l->state, &l->probe, pose);
      c->tick_s[ticks++] = bench_seconds() - start;
      if (k % PICTURE_TICKS != 0) continue;
      start = bench_seconds();
      update(l, l->state, pose, 1e-3 * PICTURE_TICKS);
      sonde_echo_render(l->echo, pose, 2 * l->probe.half_x_m, &l->healthy, &settings, &l->image);
      c->picture_s[pictures++] = bench_seconds() - start;
    }
  }
  bench_sort(c->tick_s, ticks);
  bench_sort(c->picture_s, pictures);
}

static void clear(leg *l) {
  sonde_image_clear(&l->image);
  sonde_echo_destroy(l->echo);
  sonde_interior_destroy(l->interior);
  sonde_state_destroy(l->state);
  sonde_probe_clear(&l->probe);
  sonde_model_destroy(l->model);
}

int main(int argc, char **argv) {
  static cost c;
  const long count = argc > 2 ? atol(argv[2]) : 10, first = argc > 3 ? atol(argv[3]) : 1;
  if (argc < 2 || argc > 4 || count < 1 || first < 0) {
    fprintf(stderr, "usage: bench_legs OUT.csv [COUNT [SEED]]: COUNT limbs from SEED on\n");
    return 2;
  }
  char path[4096];
  snprintf(path, sizeof path, "%.4000s.sonde", argv[1]);
  FILE *out = fopen(argv[1], "w");
  if (!out) {
    fprintf(stderr, "bench_legs: %s cannot be written\n", argv[1]);
    return 1;
  }
  fprintf(out, "seed,nodes,build_s,load_s,inside_s,memory_mb,press_s,first_update_s,tick_ms,"
               "tick_p99_ms,tick_p999_ms,tick_max_ms,picture_ms,picture_p99_ms\n");
  sonde_status status = SONDE_OK;
  for (long k = 0; k < count && !status; ++k) {
    leg l = {0};
    sonde_error error = {0};
    status = make((uint64_t)(first + k), path, &l, &c, &error);
    if (!status) status = press(&l, &c, &error);
    if (!status) {
      const int ticks = PLACE_COUNT * TICKS, pictures = ticks / PICTURE_TICKS;
      examine(&l, &c);
      fprintf(out, "%ld,%u,%.3f,%.3f,%.3f,%.0f,%.3f,%.3f,%.4f,%.4f,%.4f,%.4f,%.2f,%.2f\n",
              first + k, l.model->surface.vertex_count, c.build_s, c.load_s, c.inside_s,
              c.memory_mb, c.press_s, c.update_s, 1e3 * c.tick_s[ticks / 2],
              1e3 * c.tick_s[ticks * 99 / 100], 1e3 * c.tick_s[ticks * 999 / 1000],
              1e3 * c.tick_s[ticks - 1], 1e3 * c.picture_s[pictures / 2],
              1e3 * c.picture_s[pictures * 99 / 100]);
      fflush(out);
    } else {
      fprintf(stderr, "bench_legs: seed %ld: %s\n", first + k, error.message);
    }
    clear(&l);
  }
  remove(path);
  return fclose(out) != 0 || status;
}
