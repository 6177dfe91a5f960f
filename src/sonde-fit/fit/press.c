// probe_pose: beam axis against the normal, image plane along u.
// sonde_bonded_*:      prescribed footprint. sonde_press_probe: convex body.
#include "fit/press.h"

#include "base/maths.h"
#include "sonde/world_path.h"
#include "tissue/bulk/bulk.h"

sonde_status sonde_press_create(const sonde_model *model, double relative_residual,
                                uint32_t max_iterations, sonde_press *press, sonde_error *error) {
  *press = (sonde_press){
      .model = model, .relative_residual = relative_residual, .max_iterations = max_iterations};
  sonde_world_def def = sonde_world_def_default();
  def.engine = SONDE_ENGINE_DOUBLE; // nothing but equilibria
  press->position_m = SONDE_NEW(sonde_vec3, model->surface.vertex_count);
  sonde_status status = press->position_m ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_state_create(model, &def, &press->state, error);
  if (status) sonde_press_clear(press);
  return status;
}

void sonde_press_clear(sonde_press *press) {
  if (press->state) sonde_state_destroy(press->state);
  sonde_free(press->position_m);
  *press = (sonde_press){0};
}

sonde_status sonde_press_pool_create(const sonde_model *model, double relative_residual,
                                     uint32_t max_iterations, uint32_t workers, sonde_press **pool,
                                     sonde_error *error) {
  *pool = SONDE_NEW(sonde_press, workers);
  if (!*pool) return sonde_fail_memory(error);
  for (uint32_t w = 0; w < workers; ++w) {
    sonde_status status =
        sonde_press_create(model, relative_residual, max_iterations, &(*pool)[w], error);
    if (status) {
      sonde_press_pool_destroy(*pool, workers);
      *pool = NULL;
      return status;
    }
  }
  return SONDE_OK;
}

void sonde_press_pool_destroy(sonde_press *pool, uint32_t workers) {
  for (uint32_t w = 0; pool && w < workers; ++w) sonde_press_clear(&pool[w]);
  sonde_free(pool);
}

sonde_status sonde_bonded_create(const sonde_model *model, const sonde_site *site, double half_u_m,
                                 double half_v_m, double relative_residual, uint32_t max_iterations,
                                 sonde_bonded *b, sonde_error *error) {
  *b = (sonde_bonded){0};
  if (!model->bulk)
    return sonde_bonded_create_on(model, site, half_u_m, half_v_m, relative_residual,
                                  max_iterations, b, error);
  sonde_model *local;
  sonde_status status = sonde_bulk_refine_at(model, site->position_m, &local, error);
  if (status) return status;
  status = sonde_bonded_create_on(local, site, half_u_m, half_v_m, relative_residual,
                                  max_iterations, b, error);
  if (status)
    sonde_model_destroy(local);
  else
    b->cut_model = local;
  return status;
}

sonde_status sonde_bonded_create_on(const sonde_model *model, const sonde_site *site,
                                    double half_u_m, double half_v_m, double relative_residual,
                                    uint32_t max_iterations, sonde_bonded *b, sonde_error *error) {
  *b = (sonde_bonded){.normal = site->normal};
  sonde_status status;
  if (model->law.shear_stiffness_n_m > 0 && !model->bulk) {
    // The skin is cut along the footprint; what lies within is held.
    sonde_cut cut;
    status = sonde_cut_create(model, site, half_u_m, half_v_m, INFINITY, &cut, error);
    if (!status) status = sonde_cut_model(model, &cut, &b->cut_model, error);
    if (!status) b->held = SONDE_NEW(uint32_t, cut.held_count);
    if (!status && !b->held) status = sonde_fail_memory(error);
    for (uint32_t v = 0; v < cut.vertex_count && !status; ++v)
      if (cut.held[v]) b->held[b->held_count++] = v;
    sonde_cut_clear(&cut);
  } else {
    sonde_footprint footprint;
    status = sonde_footprint_create(model, site, half_u_m, half_v_m, SONDE_COVERAGE_CLIPPED,
                                    &footprint, error);
    if (!status) {
      b->held = footprint.held;
      b->held_count = footprint.held_count;
      footprint.held = NULL;
      sonde_footprint_clear(&footprint);
    }
  }
  if (!status)
    status = sonde_press_create(b->cut_model ? b->cut_model : model, relative_residual,
                                max_iterations, &b->press, error);
  if (status) sonde_bonded_clear(b);
  return status;
}

void sonde_bonded_clear(sonde_bonded *b) {
  sonde_press_clear(&b->press);
  sonde_model_destroy(b->cut_model);
  sonde_free(b->held);
  *b = (sonde_bonded){0};
}

double sonde_bonded_force(sonde_bonded *b, double depth_m) {
  SONDE_ASSERT(depth_m >= 0 && b->held_count > 0);
  SONDE_ASSERT(b->held_count <= b->press.model->surface.vertex_count);
  bool linear = b->press.model->kind == SONDE_LINEAR_SOLID;
  if (linear && b->stiffness_n_m > 0) return b->stiffness_n_m * depth_m;
  const sonde_vec3 *rest = b->press.model->surface.vertices;
  for (uint32_t h = 0; h < b->held_count; ++h)
    b->press.position_m[h] = v_madd(rest[b->held[h]], -depth_m, b->normal);
  sonde_vec3 force_n = vec3(0, 0, 0);
  sonde_settle_result result =
      sonde_settle_bonded(b->press.state, b->held, b->press.position_m, b->held_count,
                          b->press.relative_residual, b->press.max_iterations, &force_n);
  if (linear && result.converged && depth_m > 0)
    b->stiffness_n_m = v_dot(force_n, b->normal) / depth_m;
  return result.converged ? v_dot(force_n, b->normal) : NAN;
}

sonde_status sonde_bonded_curve(sonde_bonded *bonded, const sonde_fit_plan *plan, uint32_t curve,
                                const sonde_datum *data, const atomic_bool *stop, double *force_n,
                                sonde_error *error) {
  SONDE_ASSERT(curve < plan->curve_count);
  double force = 0;
  for (uint32_t r = plan->curve_start[curve]; r < plan->curve_start[curve + 1]; ++r) {
    uint32_t row = plan->row[r];
    if (atomic_load(stop)) return sonde_fail(error, SONDE_CANCELLED, "cancelled");
    if (!isnan(force)) force = sonde_bonded_force(bonded, data[row].penetration_m);
    force_n[row] = force;
  }
  return SONDE_OK;
}

static sonde_pose probe_pose(const sonde_site *site, double depth_m) {
  sonde_vec3 z = v_neg(site->normal), x = site->u, y = v_cross(z, x);
  return (sonde_pose){v_madd(site->position_m, -depth_m, site->normal),
                      q_from_matrix(m_columns(x, y, z))};
}

double sonde_press_probe(sonde_press *press, const sonde_site *site, const sonde_probe *probe,
                         double from_m, double to_m) {
  SONDE_ASSERT(from_m >= 0 && to_m >= from_m);
  sonde_path_def def = sonde_path_def_default();
  def.relative_residual = press->relative_residual;
  def.max_iterations = press->max_iterations;
  sonde_path_result result;
  if (sonde_settle_path(press->state, probe, probe_pose(site, from_m), probe_pose(site, to_m), &def,
                        NULL, &result, NULL))
    return NAN;
  return result.force_n;
}
