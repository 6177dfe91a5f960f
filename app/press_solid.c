// The depth at which a solid bears a force: Newton's method with the tangent of the equilibrium.
#include "press_solid.h"

#include "options.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

enum { STEPS_MOST = 30 };
static const double DEEPEST_M = 0.06, LONGEST_M = 4e-3, LEAST_N_M = 50, TOLERANCE = 1e-4;

static sonde_status press_to(press_solid *p, sonde_equilibrium *e, sonde_pose start, double depth_m,
                             sonde_error *error) {
  const sonde_vec3 way = pose_axis(start, 2);
  assert(e != NULL && isfinite(depth_m));
  // With friction the force depends on the way: every depth is pressed from the skin at rest.
  if (p->friction > 0) sonde_equilibrium_restore(e, start, p->rest);
  const sonde_status status =
      sonde_equilibrium_find(e, pose_shift(start, depth_m, way), &p->result, error);
  p->reaction_n = sqrt(vec_dot(p->result.force_n, p->result.force_n));
  return status;
}

static sonde_status seek_force(press_solid *p, sonde_equilibrium *e, sonde_pose start,
                               sonde_error *error) {
  const sonde_vec3 way = pose_axis(start, 2);
  sonde_status status = SONDE_OK;
  p->depth_m = 0.5 * LONGEST_M;
  for (int n = 0; n < STEPS_MOST && !status; ++n) {
    sonde_force_change change;
    status = press_to(p, e, start, p->depth_m, error);
    const double lack = p->force_n + vec_dot(p->result.force_n, way);
    if (status || fabs(lack) <= TOLERANCE * p->force_n) return status;
    status = sonde_equilibrium_change(e, way, &change, error);
    if (status) return status;
    const double step = lack / fmax(change.way_n_m, LEAST_N_M);
    p->depth_m += fmin(fmax(step, -LONGEST_M), LONGEST_M);
    if (p->depth_m > DEEPEST_M) break;
  }
  return app_error(error, SONDE_CONVERGENCE, "no depth up to %g mm bears %g N", 1e3 * DEEPEST_M,
                   p->force_n);
}

sonde_status press_solid_find(press_solid *p, sonde_error *error) {
  assert(isnan(p->depth_m) != isnan(p->force_n));
  sonde_model *model = NULL;
  sonde_equilibrium *e = NULL;
  sonde_probe probe = {0};
  sonde_hexes mesh = {0};
  sonde_hexes_def how = sonde_hexes_def_default();
  sonde_equilibrium_def def = sonde_equilibrium_def_default();
  sonde_status status = sonde_probe_create(p->probe, &probe, error);
  if (!status && p->moduli) status = sonde_moduli_load(p->moduli, def.layer, error);
  if (!status) status = sonde_limb_model_load(p->model, &model, error);
  const sonde_site *site = status ? NULL : sonde_model_site(model, (uint32_t)p->site);
  if (!status && !site)
    status = app_error(error, SONDE_NOT_FOUND, "%.400s: no site %ld, the model has %u sites",
                       p->model, p->site, model->site_count);
  how.half_u_m = probe.half_x_m, how.half_v_m = probe.half_y_m;
  if (!status) status = sonde_hexes_ring(model, site, &how, &mesh, error);
  const sonde_pose start = site ? sonde_site_pose(site, 0) : (sonde_pose){0};
  def.friction = p->friction;
  if (!status && !(p->rest = calloc(mesh.node_count, sizeof *p->rest)))
    status = app_error(error, SONDE_MEMORY, "no memory for %u nodes", mesh.node_count);
  if (!status) status = sonde_equilibrium_create(&mesh, &probe, start, &def, &e, error);
  if (!status && isnan(p->depth_m))
    status = seek_force(p, e, start, error);
  else if (!status)
    status = press_to(p, e, start, p->depth_m, error);
  if (!status) p->force_n = -vec_dot(p->result.force_n, pose_axis(start, 2));
  free(p->rest);
  p->rest = NULL;
  sonde_equilibrium_destroy(e);
  sonde_hexes_clear(&mesh);
  sonde_probe_clear(&probe);
  sonde_model_destroy(model);
  return status;
}
