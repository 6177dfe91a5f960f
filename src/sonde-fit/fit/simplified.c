// Stage 2: eq. (1) over a footprint with surface springs at its sides.
#include "fit/simplified.h"

#include "base/maths.h"

double sonde_site_force(const sonde_site_problem *p, uint32_t block, uint32_t row,
                        const double theta[2], const double *border, double jacobian[4]) {
  SONDE_ASSERT(block < p->plan->site_count && row < p->plan->row_count);
  sonde_law law = sonde_law_of(theta, p->floor_m[block]);
  const sonde_footprint *f = &p->footprint[p->plan->row_curve[row]];
  double x = p->m->data[p->plan->row[row]].penetration_m, normal = 0.0, by_xm = 0.0;
  // The normal law of the site over the footprint, and its derivative by xm.
  for (uint32_t k = 0; k < f->node_count; ++k) {
    double c = f->cosine[k], slope;
    double pressure = sonde_law_pressure(law.k0_n_m3, law.xm_m, x * c, &slope);
    normal += f->weight_m2[k] * c * pressure;
    by_xm += f->weight_m2[k] * c * slope;
  }
  jacobian[0] = normal;
  jacobian[1] = by_xm * law.above_m;
  jacobian[2] = p->edges ? exp(border[0]) * p->per_stiffness_m[row] : 0.0;
  jacobian[3] = p->tension ? exp(border[1]) * p->per_tension[row] : 0.0;
  return normal + jacobian[2] + jacobian[3];
}

void sonde_site_row(const void *user, uint32_t block, uint32_t row, const double theta[2],
                    const double *border, double *residual, double jacobian[4]) {
  const sonde_site_problem *p = user;
  double force = sonde_site_force(p, block, row, theta, border, jacobian);
  double weight = p->weight[row];
  *residual = weight * (force - p->m->data[p->plan->row[row]].force_n);
  for (int k = 0; k < 4; ++k) jacobian[k] *= weight;
}

sonde_status sonde_site_problem_create(const sonde_model *model, const sonde_site_table *sites,
                                       const sonde_fit_def *def, sonde_site_problem *p,
                                       sonde_error *error) {
  const sonde_fit_plan *plan = p->plan;
  bool relative = def->weights == SONDE_WEIGHTS_RELATIVE;
  p->footprint = SONDE_NEW(sonde_footprint, plan->curve_count);
  p->per_stiffness_m = SONDE_NEW(double, plan->row_count);
  p->per_tension = SONDE_NEW(double, plan->row_count);
  p->weight = SONDE_NEW(double, plan->row_count);
  p->floor_m = SONDE_NEW(double, plan->site_count);
  if (!p->footprint || !p->per_stiffness_m || !p->per_tension || !p->weight || !p->floor_m)
    return sonde_fail_memory(error);
  for (uint32_t k = 0; k < plan->probe_count && relative; ++k)
    if (!(plan->mean_force_n[k] > 0))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "probe %s has a mean force of %g N, expected > 0 for relative weights",
                        plan->probe[k], plan->mean_force_n[k]);
  for (uint32_t c = 0; c < plan->curve_count; ++c) {
    uint32_t probe = plan->curve_probe[c];
    sonde_status status = sonde_footprint_create(model, &sites->sites[plan->curve_site[c]],
                                                 plan->half_u_m[probe], plan->half_v_m[probe],
                                                 SONDE_COVERAGE_CLIPPED, &p->footprint[c], error);
    if (status) return status;
  }
  for (uint32_t r = 0; r < plan->row_count; ++r) {
    double x = p->m->data[plan->row[r]].penetration_m;
    sonde_footprint_edges(&p->footprint[plan->row_curve[r]], x, model->law.edge_compression,
                          &p->per_stiffness_m[r], &p->per_tension[r]);
    SONDE_ASSERT(x >= 0);
    p->weight[r] = relative ? 1.0 / plan->mean_force_n[plan->row_probe[r]] : 1.0;
  }
  for (uint32_t s = 0; s < plan->site_count; ++s)
    p->floor_m[s] = plan->site_deepest_m[s] / model->law.guard;
  return SONDE_OK;
}

void sonde_site_problem_clear(sonde_site_problem *p) {
  for (uint32_t c = 0; p->footprint && c < p->plan->curve_count; ++c)
    sonde_footprint_clear(&p->footprint[c]);
  sonde_free(p->footprint);
  sonde_free(p->per_stiffness_m);
  sonde_free(p->per_tension);
  sonde_free(p->weight);
  sonde_free(p->floor_m);
}
