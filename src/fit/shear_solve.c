// face_slope: gradient of s over a face. law_of_face, face_modulus: the shear layer there.
// assemble:  residual of every place and the matrix of the free ones at indentations s.
// factor:    orders and analyses at the first use on a patch, else numbers only.
// solve:     conjugate gradients preconditioned by the kept factor; a new factor when it is slow.
// search:    shortens a Newton step until the energy falls at its end.
// sonde_patch_settle: Newton. sonde_patch_force: force and its adjoint derivatives.
#include "fit/shear.h"

#include "base/maths.h"

#include <string.h>

enum { SHORTENINGS = 40, GRADIENT_STEPS = 5 };
static const double NEWTON_ACCURACY = 1e-2;
static const double NEGLIGIBLE_N = 1e-13;

// Slope of a face and its gradient: flux[k] = half the cotangent Laplacian of s at corner k, so
// that A |grad s|^2 = sum s flux.
static double face_slope(const sonde_patch_face *face, const double *s, double flux[3]) {
  double d[3], sum = 0;
  for (int k = 0; k < 3; ++k) {
    d[k] = s[face->place[(k + 1) % 3]] - s[face->place[(k + 2) % 3]]; // across corner k
    sum += face->half_cotangent[k] * d[k] * d[k];
  }
  for (int k = 0; k < 3; ++k)
    flux[k] = face->half_cotangent[(k + 2) % 3] * d[(k + 2) % 3] -
              face->half_cotangent[(k + 1) % 3] * d[(k + 1) % 3];
  return sqrt(fmax(sum, 0) / face->area_m2);
}

typedef struct face_law {
  double shear_n_m, limit;
} face_law;

static double sum_of(const double *field, const uint32_t place[3]) {
  return field[place[0]] + field[place[1]] + field[place[2]];
}

// As the model's two layers have it.
static face_law law_of_face(const sonde_patch_solver *solver, const sonde_patch_face *face) {
  return (face_law){solver->law.shear_n_m * sum_of(solver->shear_share, face->place) / 3,
                    solver->law.limit * sum_of(solver->limit_share, face->place) / 3};
}

// Secant modulus q/g and the factor of the rank-one part (q' - q/g)/(g^2 A) of a face's stiffness.
static double face_modulus(face_law law, const sonde_patch_face *face, double g, double *beyond) {
  double slope, q = sonde_shear_force(law.shear_n_m, law.limit, g, &slope);
  *beyond = 0;
  if (g < 1e-9) return slope;
  *beyond = (slope - q / g) / (g * g * face->area_m2);
  return q / g;
}

static void add_face(const sonde_patch_solver *solver, const sonde_patch_face *face,
                     const double *s, double *residual, double *value) {
  const sonde_patch *p = solver->patch;
  double flux[3], beyond, g = face_slope(face, s, flux);
  double modulus = face_modulus(law_of_face(solver, face), face, g, &beyond);
  for (int k = 0; k < 3; ++k) {
    uint32_t at = face->place[k], a = (uint32_t)(k + 1) % 3, b = (uint32_t)(k + 2) % 3;
    residual[at] += modulus * flux[k];
    if (at < p->free_count)
      value[p->diagonal[at]] += modulus * (face->half_cotangent[a] + face->half_cotangent[b]) +
                                beyond * flux[k] * flux[k];
    if (face->entry[k][0] == UINT32_MAX) continue;
    double pair = beyond * flux[a] * flux[b] - modulus * face->half_cotangent[k];
    value[face->entry[k][0]] += pair;
    value[face->entry[k][1]] += pair;
  }
}

// R_i = A p(s_i) + shear. Returns |R| over the free places; *load_n is the force of the held ones.
static double assemble(const sonde_patch_solver *solver, const double *s, double *load_n) {
  const sonde_patch *p = solver->patch;
  double *residual = solver->residual, *value = solver->value;
  memset(value, 0, p->row_start[p->free_count] * sizeof *value);
  for (uint32_t i = 0; i < p->place_count; ++i) {
    double slope;
    residual[i] =
        p->area_m2[i] * sonde_normal_pressure(solver->law.exponent, solver->k0_n_m3[i],
                                              solver->xm_m[i], solver->law.guard, s[i], &slope);
    if (i < p->free_count) value[p->diagonal[i]] = p->area_m2[i] * slope;
  }
  for (uint32_t f = 0; f < p->face_count; ++f) add_face(solver, &p->face[f], s, residual, value);
  double sum = 0, load = 0;
  for (uint32_t i = 0; i < p->free_count; ++i) sum += residual[i] * residual[i];
  for (uint32_t i = p->free_count; i < p->place_count; ++i) load += residual[i] * p->cosine[i];
  *load_n = load;
  return sqrt(sum);
}

static sonde_status factor(sonde_patch_solver *solver, sonde_error *error) {
  const sonde_patch *p = solver->patch;
  if (solver->ldl) return sonde_ldl_refactor(solver->ldl, solver->value, error);
  sonde_status status = sonde_ldl_create(p->free_count, p->row_start, p->column, solver->value,
                                         p->point_m, &solver->ldl, error);
  SONDE_ASSERT(status || sonde_ldl_scratch(solver->ldl, 1) <= p->place_count);
  return status;
}

static void multiply(const sonde_patch_solver *solver, const double *x, double *y) {
  const sonde_patch *p = solver->patch;
  for (uint32_t i = 0; i < p->free_count; ++i) {
    double sum = 0;
    for (uint32_t k = p->row_start[i]; k < p->row_start[i + 1]; ++k)
      sum += solver->value[k] * x[p->column[k]];
    y[i] = sum;
  }
}

static double dot(const double *a, const double *b, uint32_t n) {
  double sum = 0;
  for (uint32_t i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

// x arrives as right-hand side and leaves as solution; false, with x unchanged, when the kept
// factor is too far from the matrix.
static bool solve_by_gradients(sonde_patch_solver *solver, double *x, double accuracy) {
  uint32_t n = solver->patch->free_count;
  double *r = solver->right, *z = solver->preconditioned, *d = solver->direction;
  double *sum = solver->trial, goal = accuracy * accuracy * dot(x, x, n), before = 1;
  memcpy(r, x, n * sizeof *r);
  memset(sum, 0, n * sizeof *sum);
  memset(d, 0, n * sizeof *d);
  for (int k = 0; k < GRADIENT_STEPS; ++k) {
    memcpy(z, r, n * sizeof *z);
    sonde_ldl_solve(solver->ldl, 1, z, solver->scratch);
    double rz = dot(r, z, n), keep = k ? rz / before : 0;
    for (uint32_t i = 0; i < n; ++i) d[i] = z[i] + keep * d[i];
    multiply(solver, d, solver->product);
    double curvature = dot(d, solver->product, n);
    if (!(curvature > 0)) return false;
    double length = rz / curvature;
    for (uint32_t i = 0; i < n; ++i) sum[i] += length * d[i];
    for (uint32_t i = 0; i < n; ++i) r[i] -= length * solver->product[i];
    before = rz;
    if (dot(r, r, n) > goal) continue;
    memcpy(x, sum, n * sizeof *x);
    return true;
  }
  return false;
}

static sonde_status solve_directly(sonde_patch_solver *solver, double *x, sonde_error *error) {
  sonde_status status = factor(solver, error);
  if (!status) sonde_ldl_solve(solver->ldl, 1, x, solver->scratch);
  return status;
}

static sonde_status solve(sonde_patch_solver *solver, double *x, double accuracy,
                          sonde_error *error) {
  if (solver->ldl && solve_by_gradients(solver, x, accuracy)) return SONDE_OK;
  return solve_directly(solver, x, error);
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
    double next = assemble(solver, solver->trial, load_n), end = along_step(solver);
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
  double residual = assemble(solver, s_m, &solver->load_n);
  solver->settled_m = s_m;
  for (uint32_t k = 0; k < max_iterations; ++k) {
    if (is_small(solver, residual, relative)) return SONDE_OK;
    for (uint32_t i = 0; i < p->free_count; ++i) solver->step[i] = -solver->residual[i];
    // The factor of another depth would cost more in conjugate gradients than a new one.
    sonde_status status = k ? solve(solver, solver->step, NEWTON_ACCURACY, error)
                            : solve_directly(solver, solver->step, error);
    if (status) return status;
    if (!search(solver, s_m, &residual, &solver->load_n)) break;
  }
  residual = assemble(solver, s_m, &solver->load_n);
  if (is_small(solver, residual, relative)) return SONDE_OK;
  return sonde_fail(error, SONDE_CONVERGENCE,
                    "no equilibrium at a depth of %.1f mm: residual %.3g N of %.3g N",
                    depth_m * 1e3, residual, solver->load_n);
}

// mu: cosines on the held places; on the free ones minus the solution of K lambda = K_fh c, so that
// dF/dtheta = sum mu_i dR_i/dtheta. A footprint that moves by c moves the free places by mu.
static sonde_status adjoint(sonde_patch_solver *solver, const double *s, double *mu,
                            sonde_error *error) {
  const sonde_patch *p = solver->patch;
  memcpy(mu, p->cosine, p->place_count * sizeof *mu);
  for (uint32_t f = 0; f < p->face_count; ++f) {
    const sonde_patch_face *face = &p->face[f];
    int held = 0;
    for (int k = 0; k < 3; ++k) held += face->place[k] >= p->free_count;
    if (held == 0 || held == 3) continue;
    double flux[3], beyond, g = face_slope(face, s, flux);
    double modulus = face_modulus(law_of_face(solver, face), face, g, &beyond);
    for (int k = 0; k < 3; ++k) {
      int ends[2] = {(k + 1) % 3, (k + 2) % 3};
      uint32_t a = face->place[ends[0]], b = face->place[ends[1]];
      if ((a < p->free_count) == (b < p->free_count)) continue;
      uint32_t in = a < p->free_count ? a : b, out = a < p->free_count ? b : a;
      double pair = beyond * flux[ends[0]] * flux[ends[1]] - modulus * face->half_cotangent[k];
      mu[in] -= pair * p->cosine[out];
    }
  }
  return solve(solver, mu, solver->adjoint_accuracy, error);
}

// A share counts in its face by its part of the sum.
static void add_by_shares(const sonde_patch_solver *solver, const sonde_patch_face *face,
                          double by_shear, double by_limit, sonde_patch_gradient *gradient) {
  double shear = sum_of(solver->shear_share, face->place);
  double limit = sum_of(solver->limit_share, face->place);
  gradient->by_ln_shear += by_shear;
  gradient->by_ln_limit += by_limit;
  for (int k = 0; k < 3; ++k) {
    uint32_t at = face->place[k];
    gradient->by_place[2][at] += by_shear * solver->shear_share[at] / shear;
    gradient->by_place[3][at] += by_limit * solver->limit_share[at] / limit;
  }
}

// p(s; k0, xm) = k0 xm f(s/xm), so k0 dp/dk0 = p and xm dp/dxm = p - s p', straight part included;
// the same holds for q(g; G, gm).
static void differentiate(const sonde_patch_solver *solver, const double *s, const double *mu,
                          sonde_patch_gradient *gradient) {
  const sonde_patch *p = solver->patch;
  gradient->by_ln_shear = gradient->by_ln_limit = 0;
  for (uint32_t i = 0; i < p->place_count; ++i) {
    double slope, scale = mu[i] * p->area_m2[i];
    double pressure = sonde_normal_pressure(solver->law.exponent, solver->k0_n_m3[i],
                                            solver->xm_m[i], solver->law.guard, s[i], &slope);
    gradient->by_place[0][i] = scale * pressure;
    gradient->by_place[1][i] = scale * (pressure - s[i] * slope);
    gradient->by_place[2][i] = gradient->by_place[3][i] = 0;
  }
  for (uint32_t f = 0; f < p->face_count; ++f) {
    const sonde_patch_face *face = &p->face[f];
    double flux[3], g = face_slope(face, s, flux), slope, along = 0;
    if (g < 1e-9) continue;
    face_law law = law_of_face(solver, face);
    double q = sonde_shear_force(law.shear_n_m, law.limit, g, &slope);
    for (int k = 0; k < 3; ++k) along += mu[face->place[k]] * flux[k];
    add_by_shares(solver, face, along * q / g, along * (q - g * slope) / g, gradient);
  }
}

sonde_status sonde_patch_force(sonde_patch_solver *solver, double depth_m, const double *s_m,
                               double *force_n, sonde_patch_gradient *gradient,
                               sonde_error *error) {
  SONDE_ASSERT(solver->settled_m == s_m);
  *force_n = solver->load_n + solver->law.tangential_n_m3 * solver->patch->sliding_m2 * depth_m;
  if (!gradient) return SONDE_OK;
  sonde_status status = adjoint(solver, s_m, solver->multiplier, error);
  if (status) return status;
  // The last Newton step would change the force by c K_hf ds = -mu K ds = mu R.
  *force_n += dot(solver->multiplier, solver->residual, solver->patch->free_count);
  differentiate(solver, s_m, solver->multiplier, gradient);
  return SONDE_OK;
}

sonde_status sonde_patch_solver_create(const sonde_patch *patches, uint32_t count,
                                       sonde_patch_solver *solver, sonde_error *error) {
  size_t places = 0, entries = 0;
  for (uint32_t k = 0; k < count; ++k) {
    const sonde_patch *p = &patches[k];
    if (p->place_count > places) places = p->place_count;
    if (p->row_start[p->free_count] > entries) entries = p->row_start[p->free_count];
  }
  SONDE_ASSERT(places > 0 && entries > 0);
  *solver = (sonde_patch_solver){.adjoint_accuracy = 1e-6,
                                 .k0_n_m3 = SONDE_NEW(double, places),
                                 .xm_m = SONDE_NEW(double, places),
                                 .shear_share = SONDE_NEW(double, places),
                                 .limit_share = SONDE_NEW(double, places),
                                 .residual = SONDE_NEW(double, places),
                                 .step = SONDE_NEW(double, places),
                                 .trial = SONDE_NEW(double, places),
                                 .multiplier = SONDE_NEW(double, places),
                                 .value = SONDE_NEW(double, entries),
                                 .scratch = SONDE_NEW(double, places),
                                 .right = SONDE_NEW(double, places),
                                 .preconditioned = SONDE_NEW(double, places),
                                 .direction = SONDE_NEW(double, places),
                                 .product = SONDE_NEW(double, places)};
  if (solver->k0_n_m3 && solver->xm_m && solver->shear_share && solver->limit_share &&
      solver->residual && solver->step && solver->trial && solver->multiplier && solver->value &&
      solver->scratch && solver->right && solver->preconditioned && solver->direction &&
      solver->product)
    return SONDE_OK;
  sonde_patch_solver_clear(solver);
  return sonde_fail_memory(error);
}

void sonde_patch_solver_use(sonde_patch_solver *solver, const sonde_patch *patch,
                            const sonde_patch_law *law) {
  if (solver->ldl) sonde_ldl_destroy(solver->ldl);
  solver->ldl = NULL;
  solver->settled_m = NULL;
  solver->patch = patch;
  solver->law = *law;
  const double *const from[] = {law->ln_k0, law->ln_xm, law->ln_shear, law->ln_limit};
  double *const to[] = {solver->k0_n_m3, solver->xm_m, solver->shear_share, solver->limit_share};
  for (uint32_t i = 0; i < patch->place_count; ++i) {
    const uint32_t *of = patch->parent[i];
    const double *t = patch->share[i];
    for (int f = 0; f < 4; ++f) {
      const double *x = from[f];
      to[f][i] = x ? exp(t[0] * x[of[0]] + t[1] * x[of[1]] + t[2] * x[of[2]]) : 1;
    }
  }
}

void sonde_patch_solver_clear(sonde_patch_solver *solver) {
  if (solver->ldl) sonde_ldl_destroy(solver->ldl);
  sonde_free(solver->k0_n_m3);
  sonde_free(solver->xm_m);
  sonde_free(solver->shear_share);
  sonde_free(solver->limit_share);
  sonde_free(solver->residual);
  sonde_free(solver->step);
  sonde_free(solver->trial);
  sonde_free(solver->multiplier);
  sonde_free(solver->value);
  sonde_free(solver->scratch);
  sonde_free(solver->right);
  sonde_free(solver->preconditioned);
  sonde_free(solver->direction);
  sonde_free(solver->product);
  *solver = (sonde_patch_solver){0};
}
