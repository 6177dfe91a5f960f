// Residual and matrix of a footprint's equilibrium from the laws of tissue/laws.h, and their
// derivatives by every parameter.
#define SONDE_REAL_SCALAR
#include "tissue/laws.h"

#include "fit/shear.h"

#include "base/maths.h"

#include <string.h>

enum { BLOCK = 64 };
static const double FLAT = 1e-9; // slope whose secant modulus is the tangent

static double sum_of(const double *field, const uint32_t place[3]) {
  return field[place[0]] + field[place[1]] + field[place[2]];
}

void sonde_patch_solver_use(sonde_patch_solver *solver, const sonde_patch *patch,
                            const sonde_patch_law *law) {
  solver->factored = false;
  solver->settled_m = NULL;
  solver->patch = patch;
  solver->law = *law;
  const double *const from[] = {law->ln_k0, law->ln_xm, law->ln_shear, law->ln_limit};
  double *const to[] = {solver->k0_n_m3, solver->xm_m, solver->shear_share, solver->limit_share};
  for (uint32_t i = 0; i < patch->place_count; ++i) {
    const uint32_t *of = patch->parent[i];
    const double *share = patch->share[i];
    for (int f = 0; f < 4; ++f) {
      double ln = 0;
      for (int k = 0; k < 3 && from[f]; ++k) ln += share[k] * from[f][of[k]];
      to[f][i] = from[f] ? exp(ln) : 1;
    }
  }
  // A face takes the mean of its corners, as the model's two layers have it.
  for (uint32_t f = 0; f < patch->face_count; ++f) {
    const uint32_t *place = patch->face[f].place;
    double shear = sum_of(solver->shear_share, place), limit = sum_of(solver->limit_share, place);
    sonde_patch_face_law *own = &solver->face_law[f];
    own->shear_n_m = law->shear_n_m * shear / 3;
    own->limit = law->limit * limit / 3;
    own->by_shear = 1 / shear;
    own->by_limit = 1 / limit;
    solver->steepness[f] = 1 / (patch->face[f].area_m2 * own->limit * own->limit);
  }
}

// A membrane's tension: force q at slope g over g, and (q' - q/g)/square.
static void stretch_membrane(const sonde_patch_solver *solver, uint32_t f) {
  const sonde_patch_face_law *law = &solver->face_law[f];
  double g = sqrt(solver->square[f] / solver->patch->face[f].area_m2), c = solver->law.stiffening;
  double length = sqrt(1 + g * g), e = length - 1, steep = g / length;
  double tension = law->shear_n_m + law->limit * e * (1 + c * e * e);
  double slope =
      tension / (length * length * length) + law->limit * (1 + 3 * c * e * e) * steep * steep;
  solver->secant[f] = g > FLAT ? tension * steep / g : slope;
  solver->beyond[f] = g > FLAT ? (slope - solver->secant[f]) / solver->square[f] : 0;
}

// Secant moduli of some faces and the factors of the rank-one parts of their stiffness; those in
// the law's straight part are done again.
static void resist(const sonde_patch_solver *solver, uint32_t from, uint32_t count) {
  const double past = SONDE_SHEAR_GUARD * SONDE_SHEAR_GUARD;
  const double *square = solver->square, *bend = solver->steepness;
  const sonde_patch_face_law *law = solver->face_law;
  for (uint32_t f = from; f < from + count; ++f)
    shear_modulus_below(law[f].shear_n_m, bend[f], square[f] * bend[f], &solver->secant[f],
                        &solver->beyond[f]);
  for (uint32_t f = from; f < from + count; ++f) {
    if (solver->law.membrane)
      stretch_membrane(solver, f);
    else if (!(square[f] * bend[f] <= past))
      shear_modulus(law[f].shear_n_m, bend[f], square[f] * bend[f], &solver->secant[f],
                    &solver->beyond[f]);
  }
}

double sonde_patch_assemble(sonde_patch_solver *solver, const double *s, double *load_n) {
  const sonde_patch *p = solver->patch;
  double *residual = solver->residual, *value = solver->value;
  SONDE_ASSERT(p && p->free_count > 0);
  memset(value, 0, p->row_start[p->free_count] * sizeof *value);
  // Normal springs of all places.
  const double *k0 = solver->k0_n_m3, *xm = solver->xm_m, *area = p->area_m2;
  const double guard = solver->law.guard;
  const int exponent = (int)solver->law.exponent;
  double *restrict normal = solver->normal_n, *restrict slope = solver->normal_slope;
  for (uint32_t i = 0; i < p->place_count; ++i) {
    double steep;
    normal[i] = area[i] * normal_pressure(exponent, k0[i], xm[i], guard * xm[i], s[i], &steep);
    slope[i] = area[i] * steep;
  }
  memcpy(residual, solver->normal_n, p->place_count * sizeof *residual);
  for (uint32_t i = 0; i < p->free_count; ++i) value[p->diagonal[i]] = solver->normal_slope[i];
  for (uint32_t f = 0; f < p->face_count; f += BLOCK) {
    uint32_t count = p->face_count - f < BLOCK ? p->face_count - f : BLOCK;
    // flux[k] = half the cotangent Laplacian of s at corner k, so that square = A |grad s|^2 = sum
    // s flux.
    for (uint32_t j = f; j < f + count; ++j) {
      const sonde_patch_face *face = &solver->patch->face[j];
      const double at[3] = {s[face->place[0]], s[face->place[1]], s[face->place[2]]};
      double across[3], square = square_slope(face->half_cotangent, at, across);
      double *flux = solver->flux[j];
      flux[0] = across[2] - across[1];
      flux[1] = across[0] - across[2];
      flux[2] = across[1] - across[0];
      solver->square[j] = square > 0 ? square : 0;
    }
    resist(solver, f, count);
    for (uint32_t j = f; j < f + count; ++j) {
      const sonde_patch_face *face = &p->face[j];
      const double *flux = solver->flux[j], *half = face->half_cotangent;
      double modulus = solver->secant[j], beyond = solver->beyond[j];
      for (int k = 0; k < 3; ++k) {
        uint32_t at = face->place[k];
        int a = (k + 1) % 3, b = (k + 2) % 3;
        residual[at] += modulus * flux[k];
        if (at < p->free_count)
          value[p->diagonal[at]] += modulus * (half[a] + half[b]) + beyond * flux[k] * flux[k];
        if (face->entry[k][0] == UINT32_MAX) continue;
        double pair = beyond * flux[a] * flux[b] - modulus * half[k];
        value[face->entry[k][0]] += pair;
        value[face->entry[k][1]] += pair;
      }
    }
  }
  double sum = 0, load = 0;
  for (uint32_t i = 0; i < p->free_count; ++i) sum += residual[i] * residual[i];
  for (uint32_t i = p->free_count; i < p->place_count; ++i) load += residual[i] * p->cosine[i];
  *load_n = load;
  return sqrt(sum);
}

// p(s; k0, xm) = k0 xm f(s/xm), so k0 dp/dk0 = p and xm dp/dxm = p - s p', straight part included.
void sonde_patch_differentiate(const sonde_patch_solver *solver, const double *s, const double *mu,
                               sonde_patch_gradient *gradient) {
  const sonde_patch *p = solver->patch;
  double **by = gradient->by_place;
  gradient->by_ln_shear = gradient->by_ln_limit = 0;
  for (uint32_t i = 0; i < p->place_count; ++i) {
    by[0][i] = mu[i] * solver->normal_n[i];
    by[1][i] = mu[i] * (solver->normal_n[i] - s[i] * solver->normal_slope[i]);
    by[2][i] = by[3][i] = 0;
  }
  // A corner's share counts in its face by its part of the sum.
  for (uint32_t f = 0; f < p->face_count; ++f) {
    const sonde_patch_face *face = &p->face[f];
    const double *flux = solver->flux[f];
    double part[2], along = 0;
    // What the first and the second parameter of a face's law count in q/g: q and q - g q' by ln G
    // and ln gm, since q(g; G, gm) = G gm f(g/gm), straight part included; a membrane is linear in
    // T and k.
    part[0] = solver->secant[f];
    part[1] = -solver->beyond[f] * solver->square[f];
    if (solver->law.membrane) {
      double stretch = sqrt(1 + solver->square[f] / solver->patch->face[f].area_m2);
      part[0] = solver->face_law[f].shear_n_m / stretch;
      part[1] = solver->secant[f] - part[0];
    }
    for (int k = 0; k < 3; ++k) along += mu[face->place[k]] * flux[k];
    gradient->by_ln_shear += along * part[0];
    gradient->by_ln_limit += along * part[1];
    double shear = along * part[0] * solver->face_law[f].by_shear;
    double limit = along * part[1] * solver->face_law[f].by_limit;
    for (int k = 0; k < 3; ++k) by[2][face->place[k]] += shear, by[3][face->place[k]] += limit;
  }
  for (uint32_t i = 0; i < p->place_count; ++i)
    by[2][i] *= solver->shear_share[i], by[3][i] *= solver->limit_share[i];
}

// mu^T K mu: the free places' part of it vanishes, since mu is their motion in equilibrium.
double sonde_patch_stiffness(const sonde_patch_solver *solver, const double *mu) {
  const sonde_patch *p = solver->patch;
  SONDE_ASSERT(p && solver->settled_m && mu);
  double sum = p->drag_n_m;
  for (uint32_t i = 0; i < p->place_count; ++i) sum += solver->normal_slope[i] * mu[i] * mu[i];
  for (uint32_t f = 0; f < p->face_count; ++f) {
    const sonde_patch_face *face = &p->face[f];
    const double *half = face->half_cotangent;
    double a = mu[face->place[0]], b = mu[face->place[1]], c = mu[face->place[2]], along = 0;
    double square =
        half[0] * (b - c) * (b - c) + half[1] * (c - a) * (c - a) + half[2] * (a - b) * (a - b);
    for (int k = 0; k < 3; ++k) along += mu[face->place[k]] * solver->flux[f][k];
    sum += solver->secant[f] * square + solver->beyond[f] * along * along;
  }
  return sum;
}
