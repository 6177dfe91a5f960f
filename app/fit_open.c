// press_at: settles a probe a little below a site.
#include "fit_open.h"

#include "app.h"

#include <math.h>
#include <sys/stat.h>

enum { MOST_ITERATIONS = 400 };
static const double DEPTH_M = 2e-3, RESIDUAL = 1e-6;

static const sonde_site *middle_site(const sonde_model *model) {
  sonde_vec3 middle = {0, 0, 0};
  const sonde_site *best = model->sites;
  double nearest = INFINITY;
  for (uint32_t k = 0; k < model->site_count; ++k) {
    middle.x += model->sites[k].position_m.x / model->site_count;
    middle.y += model->sites[k].position_m.y / model->site_count;
    middle.z += model->sites[k].position_m.z / model->site_count;
  }
  for (uint32_t k = 0; k < model->site_count; ++k) {
    sonde_vec3 p = model->sites[k].position_m;
    double away = hypot(hypot(p.x - middle.x, p.y - middle.y), p.z - middle.z);
    if (away < nearest) nearest = away, best = &model->sites[k];
  }
  return best;
}

static sonde_status press_at(const sonde_model *model, const sonde_site *site, const char *name,
                             sonde_error *error) {
  sonde_world_def world = sonde_world_def_default();
  sonde_state *state = NULL;
  sonde_probe probe = {0};
  sonde_status status = sonde_probe_create(name, &probe, error);
  if (!status) status = sonde_state_create(model, &world, &state, error);
  if (!status) {
    sonde_settle_result r =
        sonde_settle(state, &probe, sonde_site_pose(site, DEPTH_M), RESIDUAL, MOST_ITERATIONS);
    if (!r.converged || !isfinite(r.reaction_n))
      status = app_error(error, SONDE_CONVERGENCE,
                         "the fitted model does not come to rest under the probe %s at site %u, "
                         "%g mm deep: residual %.2g; nothing was written",
                         name, site->id, 1e3 * DEPTH_M, r.residual);
  }
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  return status;
}

sonde_status fit_open_check(const sonde_model *model, const char *probe, sonde_error *error) {
  sonde_status status = SONDE_OK;
  if (model->femur.face_count) {
    sonde_interior *interior = NULL;
    status = sonde_interior_create(model, &interior, error);
    sonde_interior_destroy(interior);
  }
  return status ? status : press_at(model, middle_site(model), probe, error);
}

sonde_status fit_open_written(const sonde_model *model, const char *path, sonde_error *error) {
  struct stat facts;
  sonde_model *read = NULL;
  if (stat(path, &facts) != 0 || !S_ISREG(facts.st_mode)) return SONDE_OK;
  sonde_status status = sonde_model_load(path, &read, error);
  if (!status && read->checksum != model->checksum)
    status = app_error(error, SONDE_IO, "%.300s: holds another model than was written", path);
  sonde_model_destroy(read);
  return status;
}
