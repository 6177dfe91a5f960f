// The cost of the explicit and the implicit step at equal error, and the explicit step's limit.
#include "step_cost.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const double END_S = 0.05, WANTED = 0.01;
enum { HALVINGS = 13, COARSEST = 5, TIMED = 3 };

const step_method STEP_METHOD[STEP_METHODS] = {
    {"explicit, eq. (3)", "#b2182b", 0, 0, SONDE_ENGINE_DOUBLE},
    {"eq. (4), lambda = 1", "#2166ac", 1, 0, SONDE_ENGINE_DOUBLE},
    {"lambda = 1/2, 2 Newton", "#1b7837", 0.5, 2, SONDE_ENGINE_DOUBLE},
    {"lambda = 1, fast engine", "#762a83", 1, 2, SONDE_ENGINE_FAST}};

// Time of this process: others on the same machine count less than on the clock of the wall.
static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct study {
  bench_ellipsoid scene;
  sonde_model *model;
  sonde_probe probe;
  sonde_vec3 *exact;
} study;

// Runs to END_S in `steps` steps; *state stays for a look at the positions.
static sonde_status run(const study *s, const step_method *m, long steps, double residual,
                        sonde_state **state, step_cost *out, sonde_error *error) {
  sonde_world_def def = bench_ellipsoid_world(END_S / (double)steps);
  def.implicitness = m->implicitness;
  def.newton_iterations = m->newton;
  def.engine = m->engine;
  def.pcg = (sonde_pcg_options){residual, 1e-14, 2000};
  def.sleep_displacement_m = 0;
  sonde_status status = sonde_state_create(s->model, &def, state, error);
  *out = (step_cost){.dt_s = def.dt_s, .steps = steps};
  double start = now();
  for (long k = 1; !status && k <= steps; ++k) {
    sonde_step(*state, &s->probe, bench_ellipsoid_pose(&s->scene, (double)k * def.dt_s));
    out->products += sonde_state_solver(*state).iterations;
    if (sonde_state_flags(*state) & SONDE_FLAG_NON_FINITE) break;
  }
  out->seconds = now() - start;
  return status;
}

static double error_of(const study *s, sonde_state *state) {
  const sonde_vec3 *x = sonde_state_positions(state), *y = s->exact,
                   *r = s->model->surface.vertices;
  double difference = 0, size = 0;
  if (sonde_state_flag_count(state) > 0) return INFINITY;
  for (uint32_t i = 0; i < s->model->surface.vertex_count; ++i) {
    difference += pow(x[i].x - y[i].x, 2) + pow(x[i].y - y[i].y, 2) + pow(x[i].z - y[i].z, 2);
    size += pow(y[i].x - r[i].x, 2) + pow(y[i].y - r[i].y, 2) + pow(y[i].z - r[i].z, 2);
  }
  return sqrt(difference / size);
}

// The largest step that is accurate enough, then its best time.
static sonde_status find_cost(const study *s, const step_method *m, step_cost *best,
                              sonde_error *error) {
  long steps = COARSEST;
  sonde_status status = SONDE_OK;
  best->error = INFINITY;
  for (int k = 0, timed = 0; !status && k < HALVINGS && timed < TIMED;) {
    sonde_state *state = NULL;
    step_cost c;
    status = run(s, m, steps, 1e-3, &state, &c, error);
    if (!status) c.error = error_of(s, state);
    sonde_state_destroy(state);
    if (!status && c.error <= WANTED) {
      if (timed++ == 0 || c.seconds < best->seconds) *best = c;
    } else {
      k++, steps *= 2;
    }
  }
  return status;
}

sonde_status step_cost_study(const bench_ellipsoid *scene, long fine, step_cost *costs,
                             sonde_error *error) {
  assert(fine > 0);
  const step_method finest = {"", "", 0.5, 2, SONDE_ENGINE_DOUBLE};
  study s = {.scene = *scene};
  sonde_state *state = NULL;
  step_cost ignored;
  sonde_status status = bench_ellipsoid_build(&s.scene, &s.model, error);
  if (!status) status = sonde_probe_create("ball:30", &s.probe, error);
  if (!status) status = run(&s, &finest, fine, 1e-8, &state, &ignored, error);
  if (!status) {
    size_t bytes = s.model->surface.vertex_count * sizeof *s.exact;
    s.exact = malloc(bytes);
    if (s.exact) memcpy(s.exact, sonde_state_positions(state), bytes);
    if (!s.exact) status = error->status = SONDE_MEMORY;
  }
  for (int m = 0; !status && m < STEP_METHODS; ++m)
    status = find_cost(&s, &STEP_METHOD[m], &costs[m], error);
  sonde_state_destroy(state);
  free(s.exact);
  sonde_probe_clear(&s.probe);
  sonde_model_destroy(s.model);
  return status;
}

// ---- stability ----------------------------------------------------------------------------

// Whether a disturbance of 1 um has grown after `steps` explicit steps.
static sonde_status grows(const sonde_model *model, const sonde_tuning *tuning, double dt_s,
                          long steps, bool *grown, sonde_error *error) {
  const double DISTURBED_M = 1e-6;
  sonde_world_def def = bench_ellipsoid_world(dt_s);
  def.implicitness = 0, def.newton_iterations = 0, def.engine = SONDE_ENGINE_DOUBLE;
  def.sleep_displacement_m = 0;
  sonde_state *state = NULL;
  uint32_t n = model->surface.vertex_count;
  sonde_vec3 *x = malloc(n * sizeof *x);
  sonde_status status = x ? SONDE_OK : (error->status = SONDE_MEMORY);
  if (!status) status = sonde_state_create(model, &def, &state, error);
  if (!status) status = sonde_state_tune(state, tuning, error);
  if (!status) {
    for (uint32_t i = 0; i < n; ++i) {
      x[i] = model->surface.vertices[i];
      x[i].x += 0.5 * DISTURBED_M, x[i].y += 0.5 * DISTURBED_M, x[i].z += 0.5 * DISTURBED_M;
    }
    sonde_state_set(state, x, NULL);
    for (long k = 0; k < steps && !sonde_state_flags(state); ++k)
      sonde_step(state, NULL, (sonde_pose){{0, 0, 0}, {1, 0, 0, 0}});
    double most = 0;
    for (uint32_t i = 0; i < n; ++i) {
      sonde_vec3 a = sonde_state_positions(state)[i], b = model->surface.vertices[i];
      most = fmax(most, hypot(hypot(a.x - b.x, a.y - b.y), a.z - b.z));
    }
    *grown = sonde_state_flag_count(state) > 0 || !(most <= DISTURBED_M);
  }
  sonde_state_destroy(state);
  free(x);
  return status;
}

sonde_status step_limit_find(double stiffness_scale, long nodes, step_limit *limit,
                             sonde_error *error) {
  enum { BISECTIONS = 10, STEPS = 3000 };
  const double PI = 3.14159265358979;
  bench_ellipsoid scene = {nodes, 1e-6, 1}; // surface springs next to none
  sonde_model *model = NULL;
  sonde_tuning tuning = sonde_tuning_default();
  tuning.stiffness_scale = stiffness_scale;
  *limit = (step_limit){.stiffness_scale = stiffness_scale, .steps = STEPS};
  sonde_status status = bench_ellipsoid_build(&scene, &model, error);
  double low = 0, high = 0;
  if (!status) {
    model->law.tangential_stiffness_n_m3 = model->k0_n_m3[0]; // as stiff along the skin as across
    // A node on its normal spring: m x'' + tau k x' + k x = 0, w^2 = k/m. Of the explicit step's
    // matrix [1, h; -h w^2, 1 - h tau w^2] both eigenvalues lie within the unit circle when
    // h < tau (determinant) and h^2 w^2 - 2 h tau w^2 + 4 > 0 (an eigenvalue of -1).
    double tau = model->law.normal_damping_s, w2 = 0;
    for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
      w2 = fmax(w2, stiffness_scale * model->k0_n_m3[i] * model->area_m2[i] / model->mass_kg[i]);
    double root = tau * tau - 4 / w2;
    limit->theory_s = root > 0 ? fmin(tau, tau - sqrt(root)) : tau;
    limit->frequency_hz = sqrt(w2) / (2 * PI);
    limit->damping_ratio = 0.5 * tau * sqrt(w2);
    low = 0.5 * limit->theory_s, high = 2 * limit->theory_s;
  }
  for (int k = 0; k < BISECTIONS && !status; ++k, ++limit->runs) {
    double middle = sqrt(low * high);
    bool grown = false;
    status = grows(model, &tuning, middle, STEPS, &grown, error);
    *(grown ? &high : &low) = middle;
  }
  limit->measured_s = sqrt(low * high);
  sonde_model_destroy(model);
  return status;
}
