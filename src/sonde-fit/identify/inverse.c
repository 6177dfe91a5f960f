// Levenberg-Marquardt over forward simulations, Huber weights about the scale of the residuals.
//
// A weak prior of one standard deviation PRIOR about the start keeps a parameter that the records
// do not hold where it was; its interval then says so.
#include "identify/inverse.h"

#include "base/maths.h"
#include "base/order.h"
#include "base/parallel.h"
#include "fit/marquardt.h"
#include "sparse/dense.h"

#include <string.h>

enum { P = SONDE_INVERSE_PARAMETERS, VECTORS = P + 1 };

static const double PRIOR = 2.0;   // e-folds
static const double LONGEST = 0.5; // step, e-folds

typedef struct workspace {
  sonde_inverse *in;
  sonde_drive *drive;        // [records]
  uint32_t *first;           // [records + 1] residuals before each record
  double *residual[VECTORS]; // [residuals] per parameter vector
  double theta[VECTORS][P];
  double start[P];
  double *weight; // [residuals]
  uint32_t residuals;
  atomic_uint *share; // [VECTORS * records] of each simulation, in thousandths
  double noise;       // robust scale of the residuals
  // At vector 0: normal equations, right-hand side.
  double normal[P * P], right[P];
  bool stale; // vector 1 is a trial: the derivatives are gone
} workspace;

// A simulation takes up to minutes: its own share is told, not only its end.
static bool note_share(double fraction, const char *what, void *user) {
  (void)what;
  atomic_store((atomic_uint *)user, (unsigned)(1000 * clamp(fraction, 0, 1)));
  return true;
}

// Vectors `from` to `to` (exclusive) of theta.
typedef struct batch {
  workspace *w;
  uint32_t from;
} batch;

static sonde_status simulate_item(void *user, uint32_t worker, uint32_t item,
                                  const atomic_bool *stop, sonde_error *error) {
  (void)worker;
  const batch *b = user;
  workspace *w = b->w;
  uint32_t r = item % w->in->record_count, vector = b->from + item / w->in->record_count;
  const sonde_motion_record *record = &w->in->records[r];
  sonde_surface_law law = w->in->model->law;
  sonde_world_def def = w->in->options->world;
  double scale = 1;
  w->in->apply(w->theta[vector], &law, &def, &scale);
  sonde_model model;
  double *force = SONDE_NEW(double, 2 * (size_t)record->count);
  sonde_status status = sonde_model_borrow(w->in->model, scale, &model, error);
  if (!status && !force) status = sonde_fail_memory(error);
  if (!status) {
    model.law = law;
    sonde_law_scale(&model.law, scale);
    const sonde_progress share = {note_share, &w->share[b->from * w->in->record_count + item]};
    status = sonde_drive_run(&w->drive[r], &model, &def, stop, &share, force, force + record->count,
                             error);
  }
  if (!status)
    w->in->compare(record, &w->drive[r], force, force + record->count,
                   w->residual[vector] + w->first[r]);
  sonde_model_return(&model);
  sonde_free(force);
  return status;
}

// Progress of a batch: the mean of its simulations' shares.
typedef struct batch_progress {
  const workspace *w;
  uint32_t first, items;
  char what[64];
} batch_progress;

static bool report_shares(double fraction, const char *what, void *user) {
  (void)fraction, (void)what;
  const batch_progress *b = user;
  double sum = 0;
  for (uint32_t k = 0; k < b->items; ++k) sum += atomic_load(&b->w->share[b->first + k]);
  return sonde_progress_report(b->w->in->progress, sum / (1000.0 * b->items), b->what);
}

static sonde_status simulate_all(workspace *w, uint32_t from, uint32_t to, const char *what,
                                 sonde_error *error) {
  SONDE_ASSERT(from < to && to <= VECTORS);
  uint32_t items = (to - from) * w->in->record_count;
  batch b = {w, from};
  batch_progress shares = {.w = w, .first = from * w->in->record_count, .items = items};
  snprintf(shares.what, sizeof shares.what, "round %u, %s", w->in->iterations + 1, what);
  for (uint32_t k = 0; k < items; ++k) atomic_store(&w->share[shares.first + k], 0);
  w->in->simulations += items;
  return sonde_parallel_run(items, sonde_parallel_workers(w->in->options->threads, items),
                            simulate_item, &b, &(sonde_progress){report_shares, &shares}, what,
                            error);
}

// Scale from the median of |r| (samples that do not count are 0); beyond 2.5 of it a residual
// counts as that much only.
static void weigh(workspace *w) {
  for (uint32_t k = 0; k < w->residuals; ++k) w->weight[k] = fabs(w->residual[0][k]);
  qsort(w->weight, w->residuals, sizeof *w->weight, sonde_compare_reals);
  uint32_t first = 0;
  while (first + 1 < w->residuals && !(w->weight[first] > 0)) ++first;
  w->noise = fmax(1e-9, w->weight[first + (w->residuals - first) / 2] / 0.67449);
  double most = 2.5 * w->noise;
  for (uint32_t k = 0; k < w->residuals; ++k) {
    double size = fabs(w->residual[0][k]);
    w->weight[k] = size > most ? most / size : 1;
  }
}

// Huber's loss in units of the scale squared, plus the prior.
static double loss(const workspace *w, uint32_t vector) {
  double sum = 0, most = 2.5;
  for (uint32_t k = 0; k < w->residuals; ++k) {
    double x = fabs(w->residual[vector][k]) / w->noise;
    sum += x > most ? most * (x - 0.5 * most) : 0.5 * x * x;
  }
  for (uint32_t p = 0; p < w->in->parameter_count; ++p) {
    double away = (w->theta[vector][p] - w->start[p]) / PRIOR;
    sum += 0.5 * away * away;
  }
  return sum;
}

static double slope_of(const workspace *w, uint32_t p, uint32_t k) {
  return (w->residual[1 + p][k] - w->residual[0][k]) / (w->theta[1 + p][p] - w->theta[0][p]);
}

static void build(workspace *w) {
  uint32_t n = w->in->parameter_count;
  memset(w->normal, 0, sizeof w->normal);
  memset(w->right, 0, sizeof w->right);
  for (uint32_t k = 0; k < w->residuals; ++k) {
    double j[P], weight = w->weight[k] / (w->noise * w->noise);
    for (uint32_t p = 0; p < n; ++p) j[p] = slope_of(w, p, k);
    for (uint32_t p = 0; p < n; ++p) {
      w->right[p] -= weight * j[p] * w->residual[0][k];
      for (uint32_t q = 0; q < n; ++q) w->normal[p * n + q] += weight * j[p] * j[q];
    }
  }
  for (uint32_t p = 0; p < n; ++p) {
    w->normal[p * n + p] += 1 / (PRIOR * PRIOR);
    w->right[p] -= (w->theta[0][p] - w->start[p]) / (PRIOR * PRIOR);
  }
}

// Vector 1 + p differs from vector 0 in parameter p, away from a bound.
static sonde_status differentiate(workspace *w, sonde_error *error) {
  for (uint32_t p = 0; p < w->in->parameter_count; ++p) {
    memcpy(w->theta[1 + p], w->theta[0], sizeof w->theta[0]);
    bool up = w->theta[0][p] + w->in->step[p] <= w->in->high[p];
    w->theta[1 + p][p] += up ? w->in->step[p] : -w->in->step[p];
  }
  return simulate_all(w, 1, 1 + w->in->parameter_count, "sensitivities", error);
}

static sonde_status linearise(void *user, double *cost, bool *done, sonde_error *error) {
  (void)done;
  workspace *w = user;
  sonde_status status = w->stale ? differentiate(w, error) : SONDE_OK;
  w->stale = false;
  if (status) return status;
  weigh(w);
  build(w);
  *cost = loss(w, 0);
  return SONDE_OK;
}

// The trial takes the place of the first derivative vector, which is made anew afterwards.
static bool propose(void *user, double damping, double cost, bool *done) {
  (void)cost;
  workspace *w = user;
  uint32_t n = w->in->parameter_count;
  double factor[P * P], step[P], trial[P], moved = 0, gain = 0;
  memcpy(factor, w->normal, sizeof factor);
  memcpy(step, w->right, sizeof step);
  memcpy(trial, w->theta[0], sizeof trial); // parameters that are not sought stay
  for (uint32_t p = 0; p < n; ++p) factor[p * n + p] *= 1 + damping;
  if (!sonde_cholesky(factor, n)) return false;
  sonde_cholesky_solve(factor, n, step);
  for (uint32_t p = 0; p < n; ++p) {
    double to = w->theta[0][p] + clamp(step[p], -LONGEST, LONGEST);
    trial[p] = clamp(to, w->in->low[p], w->in->high[p]);
    moved = fmax(moved, fabs(trial[p] - w->theta[0][p]) / w->in->step[p]);
    gain += 0.5 * w->right[p] * (trial[p] - w->theta[0][p]);
  }
  // Nothing to gain but what noise gives: the derivatives stay those of theta[0].
  *done = moved < 0.05 || gain < 0.05;
  if (*done) return true;
  memcpy(w->theta[1], trial, sizeof trial);
  w->stale = true;
  return true;
}

static sonde_status evaluate(void *user, double *cost, sonde_error *error) {
  workspace *w = user;
  sonde_status status = simulate_all(w, 1, 2, "trial", error);
  if (!status) *cost = loss(w, 1);
  return status;
}

static void accept(void *user, double cost, double fall, bool *done) {
  (void)cost;
  workspace *w = user;
  double *swap = w->residual[0];
  w->residual[0] = w->residual[1];
  w->residual[1] = swap;
  memcpy(w->theta[0], w->theta[1], sizeof w->theta[0]);
  *done = fall < 0.05;
  w->in->iterations++;
}

// No better point within the noise of the forward model.
static bool stall(void *user, double cost) {
  (void)user, (void)cost;
  return true;
}

static sonde_status prepare(workspace *w, sonde_error *error) {
  sonde_inverse *in = w->in;
  w->drive = SONDE_NEW(sonde_drive, in->record_count);
  w->first = SONDE_NEW(uint32_t, in->record_count + 1);
  if (!w->drive || !w->first) return sonde_fail_memory(error);
  in->samples = 0;
  for (uint32_t r = 0; r < in->record_count; ++r) {
    sonde_status status = sonde_drive_from_record(in->model, &in->records[r], &w->drive[r], error);
    if (status) return status;
    w->first[r + 1] = w->first[r] + in->count(&in->records[r], &w->drive[r]);
    in->samples += in->records[r].count;
  }
  w->residuals = w->first[in->record_count];
  if (w->residuals <= in->parameter_count)
    return sonde_fail(error, SONDE_ARGUMENT, "the records give %u values for %u parameters",
                      w->residuals, in->parameter_count);
  w->weight = SONDE_NEW(double, w->residuals);
  w->share = SONDE_NEW(atomic_uint, VECTORS * in->record_count);
  bool ok = w->weight != NULL && w->share != NULL;
  for (uint32_t v = 0; v <= in->parameter_count; ++v) {
    w->residual[v] = SONDE_NEW(double, w->residuals);
    ok &= w->residual[v] != NULL;
  }
  memcpy(w->theta[0], in->theta, sizeof in->theta);
  memcpy(w->start, in->theta, sizeof in->theta);
  return ok ? SONDE_OK : sonde_fail_memory(error);
}

sonde_status sonde_inverse_solve(sonde_inverse *in, sonde_error *error) {
  SONDE_ASSERT(in->parameter_count >= 1 && in->parameter_count <= P && in->record_count > 0);
  workspace w = {.in = in};
  sonde_status status = prepare(&w, error);
  if (!status) status = simulate_all(&w, 0, 1, "first simulation", error);
  const sonde_marquardt marquardt = {.user = &w,
                                     .linearise = linearise,
                                     .propose = propose,
                                     .evaluate = evaluate,
                                     .accept = accept,
                                     .stall = stall,
                                     .damping = 1e-3,
                                     .fall = 0.1,
                                     .rise = 10,
                                     .rise_least = 0.1,
                                     .most = INFINITY,
                                     .trials_per_step = 4,
                                     .max_steps = in->options->max_iterations,
                                     .max_trials = UINT32_MAX};
  sonde_marquardt_result found = {0};
  w.stale = true;
  if (!status) status = sonde_marquardt_minimise(&marquardt, &found, error);
  in->iterations = found.steps, in->converged = found.converged;
  if (!status && w.stale) status = differentiate(&w, error);
  if (!status) {
    // Covariance of the parameters, what each does to the residuals, and their root mean square.
    uint32_t n = in->parameter_count;
    double inverse[P * P], sum = 0;
    weigh(&w);
    build(&w);
    bool definite = sonde_cholesky(w.normal, n);
    SONDE_ASSERT(definite); // by its prior
    (void)definite;
    sonde_cholesky_invert(w.normal, n, inverse);
    for (uint32_t p = 0; p < n; ++p) {
      memcpy(in->covariance[p], inverse + p * n, n * sizeof *inverse);
      double squares = 0;
      for (uint32_t k = 0; k < w.residuals; ++k) squares += slope_of(&w, p, k) * slope_of(&w, p, k);
      in->sensitivity[p] = sqrt(squares / w.residuals);
    }
    for (uint32_t k = 0; k < w.residuals; ++k) sum += w.residual[0][k] * w.residual[0][k];
    in->rms = sqrt(sum / w.residuals);
    memcpy(in->theta, w.theta[0], sizeof in->theta);
    if (!in->converged && in->options->max_iterations > 0)
      status = sonde_fail(error, SONDE_CONVERGENCE,
                          "no end after %u iterations, RMS of the residuals %g", in->iterations,
                          in->rms);
  }
  for (uint32_t r = 0; w.drive && r < w.in->record_count; ++r) sonde_drive_clear(&w.drive[r]);
  for (uint32_t v = 0; v < VECTORS; ++v) sonde_free(w.residual[v]);
  sonde_free(w.drive);
  sonde_free(w.first);
  sonde_free(w.share);
  sonde_free(w.weight);
  return status;
}

sonde_estimate sonde_inverse_estimate(const sonde_inverse *in, uint32_t p) {
  SONDE_ASSERT(p < in->parameter_count);
  const double normal_95 = 1.959964;
  double sd = sqrt(in->covariance[p][p]), value = exp(in->theta[p]);
  return (sonde_estimate){value, value * exp(-normal_95 * sd), value * exp(normal_95 * sd), sd,
                          normal_95 * sd < log(1.5)};
}
