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
  p->depth_m = depth_m;
  return status;
}

static sonde_status seek_force(press_solid *p, sonde_equilibrium *e, sonde_pose start,
                               sonde_error *error) {
  const sonde_vec3 way = pose_axis(start, 2);
  sonde_status status = SONDE_OK;
  double depth_m = 0.5 * LONGEST_M;
  for (int n = 0; n < STEPS_MOST && !status; ++n) {
    sonde_force_change change;
    status = press_to(p, e, start, depth_m, error);
    const double lack = p->force_n + vec_dot(p->result.force_n, way);
    if (status || fabs(lack) <= TOLERANCE * p->force_n) return status;
    status = sonde_equilibrium_change(e, way, &change, error);
    if (status) return status;
    const double step = lack / fmax(change.way_n_m, LEAST_N_M);
    depth_m += fmin(fmax(step, -LONGEST_M), LONGEST_M);
    if (depth_m > DEEPEST_M) break;
  }
  return app_error(error, SONDE_CONVERGENCE, "no depth up to %g mm bears %g N", 1e3 * DEEPEST_M,
                   p->force_n);
}

sonde_status press_solid_find(press_solid *p, settled *s, sonde_pose start, sonde_error *error) {
  assert(isnan(p->depth_m) != isnan(p->force_n) && s->model != NULL);
  const sonde_vec3 way = pose_axis(start, 2), normal = {-way.x, -way.y, -way.z};
  const sonde_site place = {.position_m = start.position,
                            .normal = normal,
                            .u = pose_axis(start, 0),
                            .v = pose_axis(start, 1)};
  sonde_equilibrium *e = NULL;
  sonde_hexes_def how = sonde_hexes_def_default();
  sonde_equilibrium_def def = sonde_equilibrium_def_default();
  how.half_u_m = s->probe.half_x_m, how.half_v_m = s->probe.half_y_m;
  def.friction = p->friction;
  sonde_status status = p->moduli ? sonde_moduli_load(p->moduli, def.layer, error) : SONDE_OK;
  if (!status) status = sonde_hexes_ring(s->model, &place, &how, &p->mesh, error);
  if (!status && !(p->rest = calloc(p->mesh.node_count, sizeof *p->rest)))
    status = app_error(error, SONDE_MEMORY, "no memory for %u nodes", p->mesh.node_count);
  if (!status) status = sonde_equilibrium_create(&p->mesh, &s->probe, start, &def, &e, error);
  if (!status && isnan(p->depth_m))
    status = seek_force(p, e, start, error);
  else if (!status)
    status = press_to(p, e, start, p->depth_m, error);
  if (!status) status = sonde_equilibrium_tissue(e, &s->tissue, error);
  s->depth_m = p->depth_m, s->pose = pose_shift(start, p->depth_m, way);
  s->force_n = -vec_dot(p->result.force_n, way);
  s->result.reaction_n = s->result.contact_n = sqrt(vec_dot(p->result.force_n, p->result.force_n));
  s->result.residual = p->result.residual, s->iterations = p->result.steps;
  sonde_equilibrium_destroy(e);
  return status;
}

void press_solid_clear(press_solid *p) {
  free(p->rest);
  sonde_hexes_clear(&p->mesh);
}
