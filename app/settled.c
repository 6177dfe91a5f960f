// A probe settled on a model.
// axis:           of a pose, in the world.
// settled_force:  steps out to a bracket, then the Illinois form of regula falsi.
#include "settled.h"

#include "app.h"

#include <math.h>
#include <stdio.h>

static const double COARSE = 1e-6, RESIDUAL = 1e-9; // relative residual on the way and at the end
static const double DEEPEST_M = 0.06, STEP_M = 0.002;

sonde_status settled_open(settled *s, const char *model, const char *probe, sonde_error *error) {
  sonde_world_def world = sonde_world_def_default();
  sonde_status status = sonde_probe_create(probe, &s->probe, error);
  if (!status) status = sonde_model_load(model, &s->model, error);
  if (!status) status = sonde_state_create(s->model, &world, &s->state, error);
  return status ? status : sonde_interior_create(s->model, &s->interior, error);
}

void settled_close(settled *s) {
  sonde_interior_destroy(s->interior);
  sonde_state_destroy(s->state);
  sonde_probe_clear(&s->probe);
  sonde_model_destroy(s->model);
}

sonde_status settled_site(const settled *s, long number, sonde_pose *above, sonde_error *error) {
  const sonde_site *site = sonde_model_site(s->model, (uint32_t)number);
  if (site) {
    *above = sonde_site_pose(site, 0);
    return SONDE_OK;
  }
  error->status = SONDE_NOT_FOUND;
  snprintf(error->message, sizeof error->message, "no site %ld, the model has %u sites", number,
           s->model->site_count);
  return SONDE_NOT_FOUND;
}

// Third column of the rotation.
static sonde_vec3 beam_of(sonde_pose p) {
  sonde_quat q = p.rotation;
  return (sonde_vec3){2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x),
                      1 - 2 * (q.x * q.x + q.y * q.y)};
}

sonde_pose settled_advance(sonde_pose pose, double along_beam_m) {
  sonde_vec3 z = beam_of(pose);
  pose.position.x += along_beam_m * z.x;
  pose.position.y += along_beam_m * z.y;
  pose.position.z += along_beam_m * z.z;
  return pose;
}

bool settled_on_skin(const settled *s, sonde_pose *pose) {
  const double back_m = 0.1, reach_m = 0.3;
  sonde_error error = {0};
  sonde_surface_index *skin = NULL;
  sonde_surface_point hit;
  if (sonde_surface_index_create(&s->model->surface, &skin, &error)) return false;
  sonde_pose outside = settled_advance(*pose, -back_m);
  bool found = sonde_surface_raycast(skin, outside.position, beam_of(*pose), reach_m, &hit);
  if (found) pose->position = hit.point_m;
  sonde_surface_index_destroy(skin);
  return found;
}

void settled_at(settled *s, sonde_pose start, double depth_m, double residual) {
  s->pose = settled_advance(start, depth_m);
  sonde_settle(s->state, &s->probe, s->pose, residual, 400);
  sonde_vec3 f = sonde_state_contact(s->state)->force_n, z = beam_of(start);
  s->force_n = -(f.x * z.x + f.y * z.y + f.z * z.z);
}

sonde_status settled_force(settled *s, sonde_pose start, double force_n, sonde_error *error) {
  sonde_progress progress = app_progress();
  double low = -STEP_M, low_f = -force_n, high = 0, high_f, depth = 0;
  for (;; high += STEP_M) {
    settled_at(s, start, high, COARSE);
    high_f = s->force_n - force_n;
    if (!progress.report(fmin(s->force_n / force_n, 1), "pressing", progress.user))
      return SONDE_CANCELLED;
    if (high_f >= 0 || high >= DEEPEST_M) break;
    low = high, low_f = high_f;
  }
  for (int k = 0; k < 40 && fabs(s->force_n - force_n) > 1e-3 * force_n && high_f >= 0; ++k) {
    depth = low - low_f * (high - low) / (high_f - low_f);
    settled_at(s, start, depth, COARSE);
    double f = s->force_n - force_n;
    if (f < 0)
      low = depth, low_f = f, high_f *= k % 3 == 2 ? 0.5 : 1;
    else
      high = depth, high_f = f, low_f *= k % 3 == 2 ? 0.5 : 1;
  }
  app_progress_end();
  settled_at(s, start, depth, RESIDUAL);
  if (fabs(s->force_n - force_n) <= 1e-2 * force_n) return SONDE_OK;
  error->status = SONDE_CONVERGENCE;
  snprintf(error->message, sizeof error->message, "%g N was not reached: %g N at %g mm", force_n,
           s->force_n, depth * 1e3);
  return SONDE_CONVERGENCE;
}

void settled_update(const settled *s, const sonde_pathology *pathology, uint64_t tick) {
  sonde_interior_update(s->interior, &(sonde_interior_input){sonde_state_positions(s->state),
                                                             sonde_state_contact_forces(s->state),
                                                             s->pose, pathology, -1, tick,
                                                             s->probe.half_x_m, s->probe.half_y_m});
}
