// Two laws of the shear layer fitted and compared.
#include "fit/nearby_refit.h"
#include "sonde/fit_confidence.h"

#include "base/maths.h"

#include <string.h>

static const double LEAST_LN = 0, MOST_LN = 6, CLOSE_LN = 0.3; // of J's stiffening
static const double GOLDEN = 0.6180339887498949;

typedef struct comparison {
  sonde_nearby_refit again;
  const sonde_measurements *m; // fitted ones first
  uint32_t fitted;
  const sonde_progress *progress;
} comparison;

// The smoothness is chosen anew for every law.
static sonde_status settle(comparison *c, sonde_fit_layer *layer, sonde_error *error) {
  sonde_refit *r = c->again.refit;
  sonde_fit_confidence confidence = {0};
  sonde_refit_result found;
  c->again.def.smoothness_sd = c->again.def.shear_smoothness_sd = 0;
  r->confidence = &confidence;
  sonde_status status = sonde_nearby_refit_run(&c->again, c->progress, &found, error);
  r->confidence = NULL;
  layer->one_out = confidence.one_out;
  layer->smoothness_sd = confidence.smoothness_sd;
  layer->shear_smoothness_sd = confidence.shear_smoothness_sd;
  sonde_fit_confidence_clear(&confidence);
  if (status) return status;
  layer->cost = found.cost;
  layer->converged = found.converged;
  r->left_out = NULL;
  status = sonde_refit_forces(r, c->again.theta, c->again.force_n, NULL, c->progress, error);
  r->left_out = c->again.left_out;
  if (status) return status;
  // Errors of the fitted measurements and of those beside them.
  const sonde_fit_plan *plan = &c->again.plan;
  const sonde_datum *data = c->m->data;
  uint32_t count = c->m->count, n = c->again.parameters;
  double *model_n = SONDE_NEW(double, count);
  if (!model_n) return sonde_fail_memory(error);
  for (uint32_t k = 0; k < plan->row_count; ++k) model_n[plan->row[k]] = c->again.force_n[k];
  status = sonde_error_report_of(data, model_n, c->fitted, &layer->seen, error);
  if (!status && count > c->fitted)
    status = sonde_error_report_of(data + c->fitted, model_n + c->fitted, count - c->fitted,
                                   &layer->also, error);
  sonde_free(model_n);
  SONDE_ASSERT(n > 2);
  layer->parameters = n + (layer->kind == SONDE_LAYER_STIFFENING);
  layer->tension_n_m = exp(c->again.theta[n - 2]);
  layer->second = exp(c->again.theta[n - 1]);
  layer->stiffening = r->stiffening;
  return status;
}

static sonde_status cost_at(comparison *c, double ln_stiffening, double *cost, sonde_error *error) {
  sonde_refit_result found;
  c->again.refit->stiffening = exp(ln_stiffening);
  sonde_status status = sonde_nearby_refit_run(&c->again, c->progress, &found, error);
  *cost = found.cost;
  return status;
}

// Every refit starts where the one before ended.
static sonde_status search(comparison *c, const sonde_fit_layer *before, sonde_error *error) {
  double low = LEAST_LN, high = MOST_LN, x[2], cost[2];
  c->again.def.smoothness_sd = before->smoothness_sd;
  c->again.def.shear_smoothness_sd = before->shear_smoothness_sd;
  for (int k = 0; k < 2; ++k) {
    x[k] = k ? low + GOLDEN * (high - low) : high - GOLDEN * (high - low);
    sonde_status status = cost_at(c, x[k], &cost[k], error);
    if (status) return status;
  }
  while (high - low > CLOSE_LN) {
    int worse = cost[0] < cost[1]; // which point is dropped: the upper one when the lower is better
    if (worse)
      high = x[1], x[1] = x[0], cost[1] = cost[0], x[0] = high - GOLDEN * (high - low);
    else
      low = x[0], x[0] = x[1], cost[0] = cost[1], x[1] = low + GOLDEN * (high - low);
    sonde_status status = cost_at(c, x[worse ? 0 : 1], &cost[worse ? 0 : 1], error);
    if (status) return status;
  }
  c->again.refit->stiffening = exp(0.5 * (low + high));
  return SONDE_OK;
}

// From G g (1 + (g/gm)^2), the first terms of the result's law: T g + (k - T) g^3/2 has the same
// ones with T = G and k = T (1 + 2/gm^2).
static void start_membrane(sonde_nearby_refit *a) {
  uint32_t n = a->parameters, sites = a->refit->sites->count;
  double *theta = memcpy(a->theta, a->optimum, n * sizeof *a->theta), limit = theta[n - 1],
         mean = log1p(2 * exp(-2 * limit));
  theta[n - 1] = theta[n - 2] + mean;
  for (uint32_t s = 0; s < sites && a->refit->fields > 2; ++s) {
    double *to = &theta[3 * sites + s];
    *to = theta[2 * sites + s] + log1p(2 * exp(-2 * (limit + *to))) - mean;
  }
}

sonde_status sonde_fit_layers(const sonde_model *model, const sonde_site_table *sites,
                              const sonde_measurements *m, const sonde_measurements *also,
                              const sonde_fit_def *def, const sonde_fit_result *result,
                              const sonde_progress *progress, sonde_fit_layer *layers,
                              sonde_error *error) {
  sonde_measurements both = *m;
  sonde_status status = also ? sonde_measurements_join(m, also, &both, error) : SONDE_OK;
  if (status) return status;
  comparison c = {.m = &both, .fitted = m->count, .progress = progress};
  status = sonde_nearby_refit_create(model, sites, &both, def, result, &c.again, error);
  if (!status) {
    sonde_nearby_refit *a = &c.again;
    sonde_refit *r = a->refit;
    for (uint32_t k = 0; k < a->plan.row_count; ++k) a->left_out[k] = a->plan.row[k] >= c.fitted;
    r->left_out = a->left_out;
    for (int k = 0; k < SONDE_FIT_LAYERS; ++k)
      layers[k] = (sonde_fit_layer){.kind = (sonde_layer)k};
    r->near = true;
    status = settle(&c, &layers[SONDE_LAYER_LIMIT], error);
    if (!status) {
      r->membrane = true;
      sonde_refit_forget(r);
      start_membrane(a);
      status = settle(&c, &layers[SONDE_LAYER_TENSION], error);
      start_membrane(a); // T alone may have run to where J would not come back from
    }
    if (!status) status = search(&c, &layers[SONDE_LAYER_LIMIT], error);
    if (!status) status = settle(&c, &layers[SONDE_LAYER_STIFFENING], error);
    sonde_nearby_refit_clear(a);
  }
  if (also) sonde_free(both.data);
  return status;
}
