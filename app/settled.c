// A probe settled on a model: a slow press to a depth or a force, and what it says of jumps.
#include "settled.h"

#include "app.h"
#include "pose.h"

#include "sonde/trainer.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double DEEPEST_M = 0.06; // how far a press to a force goes
static const double RESIDUAL = 1e-6;  // of the force, unbalanced at the end

sonde_status settled_open(settled *s, const char *model, const char *probe,
                          const sonde_preset *preset, bool needs_interior, sonde_error *error) {
  sonde_world_def world = sonde_world_def_default();
  world.engine = SONDE_ENGINE_DOUBLE; // nothing but equilibria
  sonde_status status = sonde_probe_create(probe, &s->probe, error);
  if (!status) status = sonde_limb_model_load(model, &s->model, error);
  if (!status && preset) status = sonde_preset_apply(preset, s->model, &world, error);
  if (!status && !s->without_springs)
    status = sonde_state_create(s->model, &world, &s->state, error);
  if (status || (!needs_interior && !s->model->femur.vertex_count)) return status;
  return sonde_interior_create(s->model, &s->interior, error);
}

void settled_close(settled *s) {
  sonde_interior_destroy(s->interior);
  sonde_solid_tissue_destroy(s->tissue);
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
  return app_error(error, SONDE_NOT_FOUND, "%.400s: no site %ld, the model has %u sites", model,
                   number, s->model->site_count);
}

// Whether a station is meant by what was typed: its name or its first letters, '-' and ' ' as '_'.
static bool begins(const char *name, const char *typed) {
  for (; *typed; ++name, ++typed) {
    char c = *typed == '-' || *typed == ' ' ? '_' : *typed;
    if (c >= 'A' && c <= 'Z') c = (char)(c - 'A' + 'a');
    if (c != *name) return false;
  }
  return true;
}

sonde_status settled_place(const settled *s, const char *model, long number, const char *station,
                           sonde_pose *above, char at[64], sonde_error *error) {
  const sonde_thigh_anatomy *a = s->model->anatomy;
  const uint32_t count = a ? a->landmark_count : 0;
  snprintf(at, 64, "site %ld", number);
  if (number >= 0) return settled_site(s, model, number, above, error);
  if (count == 0)
    return app_error(error, SONDE_NOT_FOUND,
                     "%.400s names no stations: give --site K, one of its %u sites", model,
                     s->model->site_count);
  uint32_t found = station ? count : 0, meant = 0;
  for (uint32_t k = 0; station && k < count; ++k) {
    if (!begins(a->landmark[k].name, station)) continue;
    if (meant++ == 0 || strlen(a->landmark[k].name) == strlen(station)) found = k;
  }
  if (meant > 1 && strlen(a->landmark[found].name) != strlen(station)) found = count; // several
  const sonde_landmark *mark = found < count ? &a->landmark[found] : NULL;
  const sonde_site *site = mark ? sonde_model_site(s->model, mark->site) : NULL;
  if (!site) {
    char list[400] = "";
    for (uint32_t k = 0; k < count; ++k) {
      size_t used = strlen(list);
      snprintf(list + used, sizeof list - used, "%s%s", k ? ", " : "", a->landmark[k].name);
    }
    return app_error(error, SONDE_NOT_FOUND, "no station '%.60s', expected one of %s",
                     station ? station : mark->name, list);
  }
  snprintf(at, 64, "%s", mark->name);
  sonde_vein_map map;
  sonde_status status = sonde_vein_map_make(s->model, &map, error);
  if (status) return status;
  if (found < map.station_count) { // of a limb: as its view is taken, in an exam too
    *above = map.station[found].probe;
  } else { // as at the nearest site, but over the vein itself; the pose makes the axes square
    sonde_site here = *site;
    here.position_m = mark->skin_m, here.normal = mark->normal;
    *above = sonde_site_pose(&here, 0);
  }
  return SONDE_OK;
}

bool settled_on_skin(const settled *s, sonde_pose *pose) {
  const double back_m = 0.1, reach_m = 0.3;
  sonde_error error = {0};
  sonde_surface_index *skin = NULL;
  sonde_surface_point hit;
  if (sonde_surface_index_create(&s->model->surface, &skin, &error)) return false;
  sonde_pose outside = pose_shift(*pose, -back_m, pose_axis(*pose, 2));
  bool found = sonde_surface_raycast(skin, outside.position, pose_axis(*pose, 2), reach_m, &hit);
  if (found) pose->position = hit.point_m;
  sonde_surface_index_destroy(skin);
  return found;
}

void settled_at(settled *s, sonde_pose start, double depth_m, double residual) {
  assert(residual > 0);
  s->depth_m = depth_m;
  s->pose = pose_shift(start, depth_m, pose_axis(start, 2));
  s->result = sonde_settle(s->state, &s->probe, s->pose, residual, 400);
  s->iterations += s->result.iterations;
  s->force_n = -vec_dot(sonde_state_contact(s->state)->force_n, pose_axis(start, 2));
}

sonde_status settled_press(settled *s, sonde_pose start, double depth_m, double force_n,
                           sonde_error *error) {
  assert(s->state && depth_m >= -0.01);
  sonde_progress progress = app_progress();
  sonde_path_def def = sonde_path_def_default();
  def.force_n = force_n, def.relative_residual = RESIDUAL;
  sonde_status status =
      sonde_settle_path(s->state, &s->probe, start, pose_shift(start, depth_m, pose_axis(start, 2)),
                        &def, &progress, &s->path, error);
  app_progress_end();
  s->depth_m = depth_m < 0 ? depth_m : s->path.way_m;
  s->pose = s->path.pose;
  s->result = s->path.settled;
  s->force_n = s->path.force_n;
  s->iterations = s->path.iterations;
  return status;
}

sonde_status settled_force(settled *s, sonde_pose start, double force_n, sonde_error *error) {
  return settled_press(s, start, DEEPEST_M, force_n, error);
}

void settled_warn(const settled *s, const char *verb) {
  const sonde_path_result *p = &s->path;
  for (uint32_t k = 0; k < p->jump_count && k < SONDE_PATH_JUMPS; ++k)
    fprintf(stderr,
            "sonde %s: the skin jumped between %.2f and %.2f mm (%.3f N before, then %.3f or "
            "%.3f N by the step): the force from there on is that of one of several equilibria\n",
            verb, p->jump[k].from_m * 1e3, p->jump[k].to_m * 1e3, p->jump[k].before_n,
            p->jump[k].whole_n, p->jump[k].two_n);
}

void settled_json_jumps(const settled *s) {
  const sonde_path_result *p = &s->path;
  app_json_array("branch_jumps");
  for (uint32_t k = 0; k < p->jump_count && k < SONDE_PATH_JUMPS; ++k) {
    app_json_object(NULL);
    app_json("from_mm:%g to_mm:%g force_before_n:%g force_one_step_n:%g force_two_steps_n:%g",
             p->jump[k].from_m * 1e3, p->jump[k].to_m * 1e3, p->jump[k].before_n,
             p->jump[k].whole_n, p->jump[k].two_n);
    app_json_close();
  }
  app_json_close();
}

void settled_update(const settled *s, const sonde_pathology *pathology, double cuff_pa,
                    uint64_t tick) {
  if (!s->interior) return;
  const sonde_interior_input input = {
      .positions_m = s->tissue ? NULL : sonde_state_positions(s->state),
      .contact_forces_n = s->tissue ? NULL : sonde_state_contact_forces(s->state),
      .world_from_probe = s->pose,
      .pathology = pathology,
      .dt_s = -1,
      .tick = tick,
      .face_half_x_m = s->probe.half_x_m,
      .face_half_y_m = s->probe.half_y_m,
      .cuff_pa = cuff_pa,
      .posture = SONDE_POSTURE_SUPINE,
      .tissue = s->tissue};
  sonde_interior_update(s->interior, &input);
}

void settled_branches(const settled *s, bool json) {
  if (json) app_json_object("branches");
  for (int k = 2; k < (int)sonde_interior_vessel_count(s->interior); ++k) {
    sonde_vessel_state v;
    const char *name = sonde_interior_vessel_name(s->interior, k);
    if (!sonde_interior_vessel_at_plane(s->interior, k, s->pose, &v)) continue;
    if (json)
      app_json_real(name, v.area_ratio);
    else
      printf("%s %.1f mm front to back, %.0f %% of its rest area\n", name, 2e3 * v.half_short_m,
             100 * v.area_ratio);
  }
  if (json) app_json_close();
}
