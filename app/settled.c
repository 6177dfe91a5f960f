// A probe settled on a model.
// beam_of:         axis of a pose, in the world.
// bracket, refine: steps out, then the Illinois form of regula falsi.
// settled_force:   both, and exact at its end.
#include "settled.h"

#include "app.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double COARSE = 1e-6, RESIDUAL = 1e-9; // relative residual on the way and at the end
static const double DEEPEST_M = 0.06, STEP_M = 0.002, CLOSE = 1e-4, ENOUGH = 5e-3;

sonde_status settled_open(settled *s, const char *model, const char *probe,
                          const sonde_preset *preset, sonde_error *error) {
  sonde_world_def world = sonde_world_def_default();
  sonde_status status = sonde_probe_create(probe, &s->probe, error);
  if (!status) status = sonde_model_load(model, &s->model, error);
  if (!status && preset) status = sonde_preset_apply(preset, s->model, &world, error);
  if (!status) status = sonde_state_create(s->model, &world, &s->state, error);
  return status ? status : sonde_interior_create(s->model, &s->interior, error);
}

void settled_close(settled *s) {
  sonde_interior_destroy(s->interior);
  sonde_state_destroy(s->state);
  sonde_probe_clear(&s->probe);
  sonde_model_destroy(s->model);
}

sonde_status settled_site(const settled *s, const char *model, long number, sonde_pose *above,
                          sonde_error *error) {
  const sonde_site *site = sonde_model_site(s->model, (uint32_t)number);
  if (site) {
    *above = sonde_site_pose(site, 0);
    return SONDE_OK;
  }
  error->status = SONDE_NOT_FOUND;
  snprintf(error->message, sizeof error->message, "%.400s: no site %ld, the model has %u sites",
           model, number, s->model->site_count);
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
  s->depth_m = depth_m;
  s->pose = settled_advance(start, depth_m);
  s->result = sonde_settle(s->state, &s->probe, s->pose, residual, 400);
  s->iterations += s->result.iterations;
  sonde_vec3 f = sonde_state_contact(s->state)->force_n, z = beam_of(start);
  s->force_n = -(f.x * z.x + f.y * z.y + f.z * z.z);
}

// Skin of the deepest state known that has less than the force: every trial is pressed on from
// there, since a skin that comes back from deeper may settle elsewhere.
typedef struct way {
  settled *scene;
  sonde_pose start;
  double force_n, low, low_f, high, high_f;
  sonde_vec3 *skin;
} way;

static void keep_low(way *w) {
  const settled *s = w->scene;
  w->low = s->depth_m, w->low_f = s->force_n - w->force_n;
  memcpy(w->skin, sonde_state_positions(s->state),
         s->model->surface.vertex_count * sizeof *w->skin);
}

// Steps out to a bracket; false when cancelled.
static bool bracket(way *w, const sonde_progress *progress) {
  settled *s = w->scene;
  for (w->high = STEP_M;; w->high += STEP_M) {
    settled_at(s, w->start, w->high, COARSE);
    w->high_f = s->force_n - w->force_n;
    double fraction = fmin(s->force_n / w->force_n, 1);
    if (!progress->report(fraction, "pressing", progress->user)) return false;
    if (w->high_f >= 0 || w->high >= DEEPEST_M) return true;
    keep_low(w);
  }
}

static void refine(way *w) {
  settled *s = w->scene;
  for (int k = 0; k < 60 && fabs(s->force_n - w->force_n) > CLOSE * w->force_n; ++k) {
    double depth = w->low - w->low_f * (w->high - w->low) / (w->high_f - w->low_f);
    sonde_state_set(s->state, w->skin, NULL);
    settled_at(s, w->start, depth, COARSE);
    if (s->force_n < w->force_n) {
      keep_low(w);
      w->high_f *= k % 3 == 2 ? 0.5 : 1;
    } else {
      w->high = depth, w->high_f = s->force_n - w->force_n;
      w->low_f *= k % 3 == 2 ? 0.5 : 1;
    }
  }
}

sonde_status settled_force(settled *s, sonde_pose start, double force_n, sonde_error *error) {
  sonde_progress progress = app_progress();
  size_t nodes = s->model->surface.vertex_count;
  way w = {.scene = s, .start = start, .force_n = force_n, .low_f = -force_n};
  w.skin = malloc(nodes * sizeof *w.skin);
  if (!w.skin) return error->status = SONDE_MEMORY;
  memcpy(w.skin, sonde_state_positions(s->state), nodes * sizeof *w.skin);
  bool done = bracket(&w, &progress);
  if (done && w.high_f >= 0) refine(&w);
  app_progress_end();
  free(w.skin);
  if (!done) return SONDE_CANCELLED;
  settled_at(s, start, s->depth_m, RESIDUAL);
  if (fabs(s->force_n - force_n) <= ENOUGH * force_n && s->result.converged) return SONDE_OK;
  error->status = SONDE_CONVERGENCE;
  snprintf(error->message, sizeof error->message,
           "%g N was not reached: %g N at %g mm, residual %.2g", force_n, s->force_n,
           s->depth_m * 1e3, s->result.residual);
  return SONDE_CONVERGENCE;
}

void settled_update(const settled *s, const sonde_pathology *pathology, uint64_t tick) {
  sonde_interior_update(s->interior, &(sonde_interior_input){sonde_state_positions(s->state),
                                                             sonde_state_contact_forces(s->state),
                                                             s->pose, pathology, -1, tick,
                                                             s->probe.half_x_m, s->probe.half_y_m});
}
