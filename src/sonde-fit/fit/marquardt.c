// Levenberg-Marquardt over the functions of a problem (Levenberg 1944; Marquardt 1963).
#include "fit/marquardt.h"

#include "base/base.h"

#include "base/elementary.h"

// Damps until a trial lowers the cost. *going: there is another step.
static sonde_status step(const sonde_marquardt *m, double *damping, sonde_marquardt_result *r,
                         bool *going, sonde_error *error) {
  uint32_t tried = 0;
  *going = false;
  while (*damping < m->most && (!m->trials_per_step || tried < m->trials_per_step)) {
    if (r->trials >= m->max_trials) return SONDE_OK;
    if (!m->propose(m->user, *damping, r->cost, &r->converged)) {
      *damping = fmax(m->rise * *damping, m->rise_least);
      continue;
    }
    if (r->converged) return SONDE_OK;
    double cost;
    sonde_status status = m->evaluate(m->user, &cost, error);
    if (status) return status;
    ++r->trials, ++tried;
    if (cost < r->cost) {
      double fall = r->cost - cost;
      r->cost = cost;
      *damping = fmax(m->fall * *damping, m->least);
      m->accept(m->user, cost, fall, &r->converged);
      *going = !r->converged;
      return SONDE_OK;
    }
    if (m->refuse)
      status = m->refuse(m->user, *damping, r->cost, cost - r->cost, &r->converged, going, error);
    if (status || r->converged || *going) return status;
    *damping = fmax(m->rise * *damping, m->rise_least);
  }
  r->converged = m->stall(m->user, r->cost);
  return SONDE_OK;
}

sonde_status sonde_marquardt_minimise(const sonde_marquardt *m, sonde_marquardt_result *r,
                                      sonde_error *error) {
  SONDE_ASSERT(m->linearise && m->propose && m->evaluate && m->accept && m->stall);
  SONDE_ASSERT(m->damping >= 0 && m->rise > 1 && m->fall < 1);
  *r = (sonde_marquardt_result){0};
  double damping = m->damping;
  for (bool going = true; going;) {
    sonde_status status = m->linearise(m->user, &r->cost, &r->converged, error);
    if (status) return status;
    SONDE_ASSERT(isfinite(r->cost) && r->cost >= 0);
    if (!r->steps) r->start_cost = r->cost;
    if (r->converged || r->steps >= m->max_steps) break;
    r->cancelled = !sonde_progress_report(m->progress, (double)r->steps / m->max_steps, "fitting");
    if (r->cancelled) break;
    ++r->steps;
    status = step(m, &damping, r, &going, error);
    if (status) return status;
  }
  return SONDE_OK;
}
