// bench_pictures MODEL PREFIX VIEWS SEED SCANNER.yaml...: pictures of a model by the scanners in
// turn, PREFIX_<site>_<turn>_<scanner>.png. Sites go on by three from view to view, beginning at
// SEED's, every third picture is taken along the leg. The probe lies 3 mm deep, the skin at
// equilibrium below it: from rest by one search, not by a slow press.
#include "sonde/sonde.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double DEPTH_M = 3e-3, RESIDUAL = 3e-2;
enum { SITES = 14, SIZE = 512 }; // the first sites of a limb are its stations

static int fail(const sonde_error *error) {
  fprintf(stderr, "bench_pictures: %s\n", error->message);
  return 1;
}

typedef struct scene {
  sonde_model *model;
  sonde_state *state;
  sonde_interior *interior;
  sonde_probe probe;
  sonde_pathology pathology;
  sonde_image image;
} scene;

static sonde_status open_scene(scene *s, const char *path, sonde_error *error) {
  const sonde_world_def world = sonde_world_def_default();
  sonde_status status = sonde_limb_model_load(path, &s->model, error);
  if (!status) status = sonde_probe_create("linear", &s->probe, error);
  if (!status) status = sonde_state_create(s->model, &world, &s->state, error);
  if (!status) status = sonde_interior_create(s->model, &s->interior, error);
  if (!status) status = sonde_pathology_preset("healthy", &s->pathology, error);
  return status ? status : sonde_image_create(SIZE, SIZE, &s->image, error);
}

static sonde_status draw(scene *s, const sonde_scanner *scanner, uint32_t number, int turn_deg,
                         uint64_t seed, sonde_error *error) {
  const sonde_site *site = sonde_model_site(s->model, number);
  if (!site) return SONDE_NOT_FOUND;
  sonde_pose pose = sonde_site_pose(site, DEPTH_M);
  const sonde_quat q = pose.rotation;
  const double half = 0.5 * turn_deg * acos(-1) / 180, c = cos(half), h = sin(half);
  pose.rotation =
      (sonde_quat){c * q.w - h * q.z, c * q.x + h * q.y, c * q.y - h * q.x, c * q.z + h * q.w};
  sonde_state_reset(s->state);
  sonde_settle(s->state, &s->probe, pose, RESIDUAL, 30);
  sonde_interior_update(s->interior,
                        &(sonde_interior_input){sonde_state_positions(s->state),
                                                sonde_state_contact_forces(s->state), pose,
                                                &s->pathology, -1, 1, s->probe.half_x_m,
                                                s->probe.half_y_m, 0, SONDE_POSTURE_SUPINE, NULL});
  sonde_echo_def def = sonde_echo_def_default();
  def.seed = seed, def.scanner = scanner;
  sonde_echo *echo = NULL;
  sonde_status status = sonde_echo_create(s->interior, &def, &echo, error);
  const double aperture = scanner->aperture_m > 0 ? scanner->aperture_m : 2 * s->probe.half_x_m;
  if (!status)
    sonde_echo_render(echo, pose, aperture, &s->pathology, &scanner->settings, &s->image);
  sonde_echo_destroy(echo);
  return status;
}

int main(int count, char **word) {
  if (count < 6) {
    fprintf(stderr, "usage: bench_pictures MODEL PREFIX VIEWS SEED SCANNER.yaml...\n");
    return 2;
  }
  const long views = strtol(word[3], NULL, 10), seed = strtol(word[4], NULL, 10);
  scene s = {0};
  sonde_error error = {0};
  sonde_status status = open_scene(&s, word[1], &error);
  for (long view = 0; view < views && !status; ++view) {
    const char *file = word[5 + (view + seed) % (count - 5)];
    const uint32_t site = (uint32_t)((3 * view + seed) % SITES);
    const int turn_deg = view % 3 == 2 ? 90 : 0;
    sonde_scanner scanner;
    status = sonde_scanner_load(file, &scanner, NULL, 0, &error);
    if (!status) status = draw(&s, &scanner, site, turn_deg, (uint64_t)seed, &error);
    const char *name = strrchr(file, '/') ? strrchr(file, '/') + 1 : file;
    char out[4096];
    snprintf(out, sizeof out, "%s_%u_%d_%.*s.png", word[2], site, turn_deg, (int)strcspn(name, "."),
             name);
    if (!status) status = sonde_image_save_png(&s.image, out, &error);
  }
  sonde_image_clear(&s.image);
  sonde_interior_destroy(s.interior);
  sonde_state_destroy(s.state);
  sonde_probe_clear(&s.probe);
  sonde_model_destroy(s.model);
  return status ? fail(&error) : 0;
}
