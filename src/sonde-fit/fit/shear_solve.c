// Equilibria of a footprint by Newton, its force and the adjoint derivatives.
#include "fit/shear.h"

#include "base/maths.h"

#include <string.h>

enum { SHORTENINGS = 40, GRADIENT_STEPS = 5, POLISHING_STEPS = 8 };
static const double NEWTON_ACCURACY = 1e-2;
static const double NEGLIGIBLE_N = 1e-13;

static sonde_status factor(sonde_patch_solver *solver, sonde_error *error) {
  const sonde_patch *p = solver->patch;
  const sonde_matrix_source source = {.value = solver->value};
  solver->factored = sonde_numeric_factor(&solver->factor, p->symbolic, &source);
  if (solver->factored) return SONDE_OK;
  return sonde_fail(error, SONDE_CONVERGENCE, "the stiffness of the skin is not positive definite");
}

static void multiply(const void *user, const double *x, double *y) {
  const sonde_patch_solver *solver = user;
  const sonde_patch *p = solver->patch;
  sonde_rows_multiply(p->free_count, p->row_start, p->column, solver->value, x, y);
}

static double precondition(const void *user, const double *r, double *z) {
  const sonde_patch_solver *solver = user;
  memcpy(z, r, solver->patch->free_count * sizeof *z);
  sonde_numeric_solve(&solver->factor, z);
  return sonde_dot(r, z, solver->patch->free_count);
}

// x arrives as right-hand side and leaves as solution; false, with x unchanged, when the kept
// factor is too far from the matrix: the residual would not fall far enough at its pace.
static bool solve_by_gradients(sonde_patch_solver *solver, double *x, double accuracy,
                               uint32_t most) {
  const uint32_t n = solver->patch->free_count;
  const sonde_operator matrix = {
      .count = n, .width = 1, .multiply = multiply, .precondition = precondition, .user = solver};
  const sonde_pcg_vectors vectors = {solver->right, solver->preconditioned, solver->direction,
                                     solver->product};
  const sonde_pcg_goal goal = {
      .relative = accuracy, .max_iterations = most, .from_zero = true, .foresee = true};
  memset(solver->trial, 0, n * sizeof *x);
  bool solved = sonde_pcg(&matrix, x, solver->trial, &vectors, &goal).converged;
  if (solved) memcpy(x, solver->trial, n * sizeof *x);
  return solved;
}

static sonde_status solve(sonde_patch_solver *solver, double *x, double accuracy,
                          sonde_error *error) {
  if (solver->factored && solve_by_gradients(solver, x, accuracy, GRADIENT_STEPS)) return SONDE_OK;
  sonde_status status = factor(solver, error);
  // Single precision needs a few steps for the finest accuracy; what they do not reach is rounding.
  if (!status && !solve_by_gradients(solver, x, accuracy, POLISHING_STEPS))
    sonde_numeric_solve(&solver->factor, x);
  return status;
}

static double along_step(const sonde_patch_solver *solver) {
  double sum = 0;
  for (uint32_t i = 0; i < solver->patch->free_count; ++i)
    sum += solver->residual[i] * solver->step[i];
  return sum;
}

// The energy is convex: it is lower at the end of a step when it still falls there. Near the
// solution, where that is a matter of rounding, a smaller residual counts too.
static bool search(sonde_patch_solver *solver, double *s, double *residual, double *load_n) {
  const sonde_patch *p = solver->patch;
  double start = -along_step(solver), share = 1.0;
  SONDE_ASSERT(p && start >= 0);
  for (int k = 0; k < SHORTENINGS; ++k) {
    memcpy(solver->trial, s, p->place_count * sizeof *s);
    for (uint32_t i = 0; i < p->free_count; ++i) solver->trial[i] += share * solver->step[i];
    double next = sonde_patch_assemble(solver, solver->trial, load_n), end = along_step(solver);
    if (isfinite(next) && (end <= 0 || next < *residual)) {
      memcpy(s, solver->trial, p->free_count * sizeof *s);
      *residual = next;
      return true;
    }
    share *= isfinite(end) ? clamp(start / (start + end), 0.1, 0.7) : 0.1;
  }
  return false;
}

static bool is_small(const sonde_patch_solver *solver, double residual, double relative) {
  return residual <= relative * fabs(solver->load_n) || residual <= NEGLIGIBLE_N;
}

sonde_status sonde_patch_settle(sonde_patch_solver *solver, double depth_m, double relative,
                                uint32_t max_iterations, double *s_m, sonde_error *error) {
  const sonde_patch *p = solver->patch;
  SONDE_ASSERT(p && depth_m >= 0 && relative > 0);
  for (uint32_t i = p->free_count; i < p->place_count; ++i) s_m[i] = depth_m * p->cosine[i];
  double residual = sonde_patch_assemble(solver, s_m, &solver->load_n);
  solver->settled_m = s_m;
  for (uint32_t k = 0; k < max_iterations; ++k) {
    if (is_small(solver, residual, relative)) return SONDE_OK;
    for (uint32_t i = 0; i < p->free_count; ++i) solver->step[i] = -solver->residual[i];
    // The factor of another depth would cost more in conjugate gradients than a new one.
    sonde_status status =
        k ? solve(solver, solver->step, NEWTON_ACCURACY, error) : factor(solver, error);
    if (status) return status;
    if (!k) sonde_numeric_solve(&solver->factor, solver->step);
    if (!search(solver, s_m, &residual, &solver->load_n)) break;
  }
  residual = sonde_patch_assemble(solver, s_m, &solver->load_n);
  if (is_small(solver, residual, relative)) return SONDE_OK;
  return sonde_fail(error, SONDE_CONVERGENCE,
                    "no equilibrium at a depth of %.1f mm: residual %.3g N of %.3g N",
                    depth_m * 1e3, residual, solver->load_n);
}

sonde_status sonde_patch_force(sonde_patch_solver *solver, double depth_m, const double *s_m,
                               double *force_n, sonde_patch_gradient *gradient,
                               sonde_error *error) {
  SONDE_ASSERT(solver->settled_m == s_m);
  *force_n = solver->load_n + solver->patch->drag_n_m * depth_m;
  if (!gradient) return SONDE_OK;
  // mu: cosines on the held places; on the free ones minus the solution of K lambda = K_fh c, so
  // that dF/dtheta = sum mu_i dR_i/dtheta. A footprint that moves by c moves the free places by mu.
  const sonde_patch *p = solver->patch;
  double *mu = solver->multiplier;
  memcpy(mu, p->cosine, p->place_count * sizeof *mu);
  for (uint32_t h = 0; h < p->side_count; ++h) {
    const sonde_patch_face *face = &p->face[p->side[h]];
    const double *flux = solver->flux[p->side[h]];
    double modulus = solver->secant[p->side[h]], beyond = solver->beyond[p->side[h]];
    for (int k = 0; k < 3; ++k) {
      int ends[2] = {(k + 1) % 3, (k + 2) % 3};
      uint32_t a = face->place[ends[0]], b = face->place[ends[1]];
      if ((a < p->free_count) == (b < p->free_count)) continue;
      uint32_t in = a < p->free_count ? a : b, out = a < p->free_count ? b : a;
      double pair = beyond * flux[ends[0]] * flux[ends[1]] - modulus * face->half_cotangent[k];
      mu[in] -= pair * p->cosine[out];
    }
  }
  sonde_status status = solve(solver, mu, solver->adjoint_accuracy, error);
  if (status) return status;
  // The last Newton step would change the force by c K_hf ds = -mu K ds = mu R.
  *force_n += sonde_dot(mu, solver->residual, p->free_count);
  sonde_patch_differentiate(solver, s_m, mu, gradient);
  return SONDE_OK;
}

static size_t larger(size_t a, size_t b) { return a > b ? a : b; }

// Every array [places] of a solver.
enum { PLACE_ARRAYS = 14 };
static void place_arrays(sonde_patch_solver *s, double **array[PLACE_ARRAYS]) {
  double **const all[PLACE_ARRAYS] = {
      &s->k0_n_m3, &s->xm_m,    &s->shear_share, &s->limit_share,   &s->residual,
      &s->step,    &s->trial,   &s->multiplier,  &s->normal_n,      &s->normal_slope,
      &s->right,   &s->product, &s->direction,   &s->preconditioned};
  memcpy(array, all, sizeof all);
}

sonde_status sonde_patch_solver_create(const sonde_patch *patches, uint32_t count,
                                       sonde_patch_solver *solver, sonde_error *error) {
  size_t places = 0, faces = 0, entries = 0;
  for (uint32_t k = 0; k < count; ++k) {
    const sonde_patch *p = &patches[k];
    places = larger(places, p->place_count);
    faces = larger(faces, p->face_count);
    entries = larger(entries, p->row_start[p->free_count]);
  }
  double **array[PLACE_ARRAYS];
  SONDE_ASSERT(places > 0 && entries > 0);
  *solver = (sonde_patch_solver){.adjoint_accuracy = 1e-6,
                                 .face_law = SONDE_NEW(sonde_patch_face_law, faces),
                                 .steepness = SONDE_NEW(double, faces),
                                 .flux = sonde_calloc(faces, sizeof *solver->flux),
                                 .square = SONDE_NEW(double, faces),
                                 .secant = SONDE_NEW(double, faces),
                                 .beyond = SONDE_NEW(double, faces),
                                 .value = SONDE_NEW(double, entries)};
  bool ok = solver->face_law && solver->steepness && solver->flux && solver->square &&
            solver->secant && solver->beyond && solver->value;
  place_arrays(solver, array);
  for (int k = 0; k < PLACE_ARRAYS; ++k) ok = (*array[k] = SONDE_NEW(double, places)) != NULL && ok;
  sonde_status status = ok ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t k = 0; k < count && !status; ++k)
    status = sonde_numeric_reserve(&solver->factor, patches[k].symbolic, error);
  if (status) sonde_patch_solver_clear(solver);
  return status;
}

void sonde_patch_solver_clear(sonde_patch_solver *solver) {
  double **array[PLACE_ARRAYS];
  place_arrays(solver, array);
  for (int k = 0; k < PLACE_ARRAYS; ++k) sonde_free(*array[k]);
  sonde_free(solver->face_law);
  sonde_free(solver->steepness);
  sonde_free(solver->flux);
  sonde_free(solver->square);
  sonde_free(solver->secant);
  sonde_free(solver->beyond);
  sonde_free(solver->value);
  sonde_numeric_clear(&solver->factor);
  *solver = (sonde_patch_solver){0};
}
