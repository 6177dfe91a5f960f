// Newton's method in two levels: the solid is linearised and condensed on the skin that may touch;
// there the contact is solved with all of its nonlinearity; then the energy of both has to fall.
#include "equilibrium.h"

#include "base/base.h"
#include "elements/hexahedron.h"
#include "sparse/dense.h"

#include <float.h>
#include <string.h>

enum { STEPS_MOST = 60, INNER_MOST = 60, FRICTION_MOST = 150, HALVINGS = 12, SHIFTS_MOST = 8 };
static const double first_shift = 1e-3, more_shift = 5, armijo = 1e-4;
static const double rounding = 1e-9, inner_rounding = 1e-13; // of energies, over themselves
static const double force_rounding = 32 * DBL_EPSILON; // of an element's, over modulus times area
static const double least_load_n = 1e-4;               // that residuals are compared with

static double norm(const double *x, size_t count) {
  double sum = 0;
  for (size_t k = 0; k < count; ++k) sum += x[k] * x[k];
  return sqrt(sum);
}

static double product(const double *x, const double *y, size_t count) {
  double sum[8] = {0};
  size_t k = 0;
  for (; k + 8 <= count; k += 8)
    for (size_t i = 0; i < 8; ++i) sum[i] += x[k + i] * y[k + i];
  for (; k < count; ++k) sum[0] += x[k] * y[k];
  return ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
}

// ---- the solid ----------------------------------------------------------------------------

static const sonde_hyperelastic *corners_of(const sonde_equilibrium *e, const sonde_vec3 *u,
                                            uint32_t hex, sonde_vec3 rest[8], sonde_vec3 now[8]) {
  SONDE_ASSERT(hex < e->mesh->count);
  for (int c = 0; c < 8; ++c) {
    const uint32_t node = e->mesh->corner[hex][c];
    rest[c] = e->mesh->node[node], now[c] = v_add(rest[c], u[node]);
  }
  return &e->def.layer[e->mesh->layer[hex]];
}

bool sonde_equilibrium_add_forces(const sonde_equilibrium *e, const uint32_t *hexes, uint32_t count,
                                  const sonde_vec3 *u, double *energy_j, double *force) {
  SONDE_ASSERT(u != NULL && energy_j != NULL && force != NULL);
  for (uint32_t n = 0; n < count; ++n) {
    const uint32_t h = hexes ? hexes[n] : n;
    sonde_vec3 rest[8], now[8];
    double part, f[24];
    const sonde_hyperelastic *material = corners_of(e, u, h, rest, now);
    if (!e->kernels->evaluate(material, rest, now, &part, f, NULL)) return false;
    *energy_j += part;
    for (int k = 0; k < 24; ++k) {
      const uint32_t at = e->corner[h][k / 3];
      if (at == SONDE_HELD_CORNER || e->mesh->held[e->mesh->corner[h][k / 3]] >> k % 3 & 1)
        continue;
      force[3 * (size_t)at + (size_t)(k % 3)] += f[k];
    }
  }
  return true;
}

void sonde_equilibrium_stiffness(const sonde_equilibrium *e, const sonde_vec3 *u, double shift,
                                 uint32_t hex, double (*k)[24]) {
  sonde_vec3 rest[8], now[8];
  double energy, f[24], trace = 0;
  const sonde_hyperelastic *material = corners_of(e, u, hex, rest, now);
  bool whole = e->kernels->evaluate(material, rest, now, &energy, f, k);
  SONDE_ASSERT(whole); // the state's energy was finite
  for (int i = 0; i < 24; ++i) trace += k[i][i];
  for (int i = 0; i < 24; ++i) k[i][i] += shift * trace / 24;
  for (int row = 0; row < 24; ++row)
    for (int i = 0; i < 24 && (e->mesh->held[e->mesh->corner[hex][row / 3]] >> row % 3 & 1); ++i)
      if (i != row) k[row][i] = k[i][row] = 0;
}

// At the state, for a sonde_matrix_source.
static void stiffness_of(const void *user, uint32_t hex, double (*k)[24]) {
  const sonde_equilibrium *e = user;
  sonde_equilibrium_stiffness(e, e->moved, e->shift, hex, k);
}

// The stiffness at the state with this shift, condensed on the zone: e->schur.
// @return false: what lies below the zone is not positive definite
static bool condense(sonde_equilibrium *e, double shift) {
  const size_t side = 3 * (size_t)e->zone_count;
  const sonde_matrix_source source = {.element = stiffness_of, .user = e};
  e->shift = shift, e->factored = false;
  if (!sonde_numeric_factor(&e->numeric, e->symbolic, &source)) return false;
  const double *lower = sonde_numeric_condensed(&e->numeric);
  for (size_t j = 0; j < side; ++j)
    for (size_t i = j; i < side; ++i)
      e->schur[i * side + j] = e->schur[j * side + i] = lower[j * side + i];
  e->factored = shift == 0;
  return true;
}

// ---- the contact on the condensed solid -----------------------------------------------------

void sonde_equilibrium_face(const sonde_equilibrium *e, const sonde_vec3 *u, uint32_t face,
                            sonde_vec3 rest[4], sonde_vec3 now[4]) {
  SONDE_ASSERT(face < e->mesh->face_count);
  for (int c = 0; c < 4; ++c) {
    const uint32_t node = e->mesh->face[face][c];
    rest[c] = e->mesh->node[node], now[c] = v_add(rest[c], u[node]);
  }
}

void sonde_equilibrium_zone_face(const sonde_equilibrium *e, const sonde_vec3 *u, const double *v,
                                 uint32_t n, sonde_vec3 rest[4], sonde_vec3 now[4]) {
  SONDE_ASSERT(n < e->zone_faces);
  sonde_equilibrium_face(e, u, e->face[n], rest, now);
  for (int c = 0; c < 4 && v; ++c) {
    const uint32_t at = e->unknown[e->mesh->face[e->face[n]][c]] - sonde_zone_first(e);
    const double *way = v + 3 * (size_t)at;
    now[c] = v_add(now[c], vec3(way[0], way[1], way[2]));
  }
}

sonde_touch sonde_equilibrium_touch(const sonde_equilibrium *e, sonde_pose pose,
                                    const sonde_vec3 *u, const double *v, bool bend, double *f,
                                    double *matrix) {
  const size_t side = 3 * (size_t)e->zone_count;
  const uint32_t first = sonde_zone_first(e);
  sonde_touch sum = {0};
  memset(f, 0, side * sizeof *f);
  for (uint32_t n = 0; n < e->zone_faces && !e->def.bonded; ++n) {
    const uint32_t *node = e->mesh->face[e->face[n]];
    sonde_vec3 rest[4], now[4];
    size_t at[4];
    double force[12], k[12][12];
    const sonde_stick *stick = e->stick ? e->stick + SONDE_TOUCH_POINTS * n : NULL;
    sonde_equilibrium_zone_face(e, u, v, n, rest, now);
    for (int c = 0; c < 4; ++c) at[c] = 3 * (size_t)(e->unknown[node[c]] - first);
    if (!sonde_touch_face(&e->shape, pose, e->def.contact_n_m3, stick, rest, now, bend, &sum, force,
                          matrix ? k : NULL))
      continue;
    for (size_t i = 0; i < 12; ++i) {
      const size_t row = at[i / 3] + i % 3;
      const uint8_t *held = e->mesh->held;
      if (held[node[i / 3]] >> i % 3 & 1) continue;
      f[row] += force[i];
      for (size_t j = 0; j < 12 && matrix; ++j)
        if (!(held[node[j / 3]] >> j % 3 & 1)) matrix[row * side + at[j / 3] + j % 3] += k[i][j];
    }
  }
  return sum;
}

// Energy of the condensed solid and the contact at ways v: v S v / 2 - load v + contact. Forces of
// the contact go to touch, right = load - S v + touch; zero where nodes are imposed.
static double energy_of(sonde_equilibrium *e, sonde_pose pose, const double *v, double *touch) {
  const size_t side = 3 * (size_t)e->zone_count;
  double energy = sonde_equilibrium_touch(e, pose, e->moved, v, false, touch, NULL).energy_j;
  double solid = 0;
  for (size_t i = 0; i < side; ++i) {
    const double pull = product(e->schur + i * side, v, side);
    solid += v[i] * (0.5 * pull - e->load[i]);
    e->right[i] = e->imposed[i / 3] ? 0 : e->load[i] - pull + touch[i];
  }
  return solid + energy;
}

uint32_t sonde_equilibrium_contact(sonde_equilibrium *e, sonde_pose pose, bool moving) {
  const size_t side = 3 * (size_t)e->zone_count, stride = sonde_front_stride((uint32_t)side);
  // First guess: imposed nodes go to their targets. When the probe has just moved, the skin that it
  // would contain moves with it: left where it is, skin near an edge would be nearer to the probe's
  // side than to its front and leave it there.
  for (size_t i = 0; i < side; ++i) {
    const sonde_vec3 gap = v_sub(e->target[i / 3], e->moved[e->zone_node[i / 3]]);
    e->way[i] = e->imposed[i / 3] ? v_coordinate(gap, (int)(i % 3)) : 0;
  }
  for (uint32_t n = 0; n < e->zone_faces && moving && !e->def.bonded; ++n) {
    const uint32_t *node = e->mesh->face[e->face[n]];
    sonde_vec3 rest[4], now[4];
    sonde_touch sum = {0};
    double force[12];
    sonde_equilibrium_face(e, e->moved, e->face[n], rest, now);
    if (!sonde_touch_face(&e->shape, pose, e->def.contact_n_m3, NULL, rest, now, false, &sum, force,
                          NULL))
      continue;
    for (int c = 0; c < 4; ++c) {
      double *way = e->way + 3 * (size_t)(e->unknown[node[c]] - sonde_zone_first(e));
      const sonde_vec3 with = pose_apply(pose, pose_apply_inverse(e->pose, now[c]));
      way[0] = with.x - now[c].x, way[1] = with.y - now[c].y, way[2] = with.z - now[c].z;
    }
  }
  // Friction's limits follow the pressure whenever a tenth of the residual is left; in between they
  // stay, so that there is an energy that falls.
  const uint32_t most = e->stick ? FRICTION_MOST : INNER_MOST;
  double energy = 0, begin = 0;
  for (uint32_t n = 1; n <= most; ++n) {
    double size = n > 1 ? norm(e->right, side) : 0, scale = norm(e->load, side);
    scale += n > 1 ? norm(e->touch, side) : 0;
    if (n == 1 || (e->stick && size <= fmax(0.1 * begin, 1e-10 * scale))) {
      sonde_friction_look(e, pose, e->moved, e->way, SONDE_FRICTION_PRESSURE);
      energy = energy_of(e, pose, e->way, e->touch);
      begin = size = norm(e->right, side), scale = norm(e->load, side) + norm(e->touch, side);
    }
    if (size <= 1e-10 * scale && n > 1) return n;
    double *way = e->way_trial, *at = e->matrix, share = 1;
    memcpy(way, e->right, side * sizeof *way);
    // What the bending of the probe takes from the contact's stiffness is left out where the matrix
    // would not be positive definite.
    bool definite = false;
    for (int bend = 1; bend >= 0 && !definite; --bend) {
      memcpy(e->matrix, e->schur, side * side * sizeof *e->matrix);
      (void)sonde_equilibrium_touch(e, pose, e->moved, e->way, bend, e->touch_trial, e->matrix);
      for (size_t i = 0; i < side; ++i) {
        if (!e->imposed[i / 3]) continue;
        for (size_t j = 0; j < side; ++j) e->matrix[i * side + j] = e->matrix[j * side + i] = 0;
        e->matrix[i * side + i] = 1;
      }
      // A direction needs single precision; what is left of it, the next one takes.
      for (size_t j = 0; j < side; ++j)
        for (size_t i = j; i < side; ++i) e->front[j * stride + i] = (float)e->matrix[j * side + i];
      definite = e->numeric.kernels->eliminate_single(e->front, (uint32_t)side, 0, (uint32_t)side);
    }
    if (!definite) return 0;
    sonde_front_forward(e->front, (uint32_t)side, (uint32_t)side, e->right);
    sonde_front_backward(e->front, (uint32_t)side, (uint32_t)side, e->right);
    const double fall = product(way, e->right, side), before = energy;
    memcpy(way, e->right, side * sizeof *way);
    for (int half = 0; half < HALVINGS; ++half, share *= 0.5) {
      for (size_t i = 0; i < side; ++i) at[i] = e->way[i] + share * way[i];
      energy = energy_of(e, pose, at, e->touch_trial);
      if (energy <= before - armijo * share * fall + inner_rounding * fabs(before)) break;
    }
    memcpy(e->way, at, side * sizeof *e->way);
    memcpy(e->touch, e->touch_trial, side * sizeof *e->touch);
    if (fall > 1e-24) continue;
    if (!e->stick || size == begin) return n + 1;
    begin = INFINITY;
  }
  return most;
}

// ---- the whole ----------------------------------------------------------------------------

// Where the state is: energies, forces, how far from equilibrium.
typedef struct standing {
  double energy_j, residual, load;
  sonde_touch touch;
  double tissue_j;
} standing;

// With the tissue's forces at displacements u at hand.
static void balance(sonde_equilibrium *e, sonde_pose pose, const sonde_vec3 *u, standing *s) {
  const size_t side = 3 * (size_t)e->zone_count, first = 3 * (size_t)sonde_zone_first(e);
  s->touch = sonde_equilibrium_touch(e, pose, u, NULL, false, e->touch, NULL);
  s->energy_j = s->tissue_j + s->touch.energy_j;
  double rest = product(e->force, e->force, first), load = 0;
  for (size_t i = 0; i < side; ++i) {
    const double f = e->force[first + i], r = e->touch[i] - f;
    if (e->imposed[i / 3])
      load += f * f;
    else
      rest += r * r, load += e->touch[i] * e->touch[i];
  }
  s->residual = sqrt(rest), s->load = fmax(sqrt(load), e->least_load_n);
}

// @return false: turned inside out
static bool stand(sonde_equilibrium *e, sonde_pose pose, const sonde_vec3 *u, standing *s) {
  s->tissue_j = 0;
  memset(e->force, 0, 3 * (size_t)e->unknown_count * sizeof *e->force);
  if (!sonde_equilibrium_add_forces(e, NULL, e->mesh->count, u, &s->tissue_j, e->force))
    return false;
  balance(e, pose, u, s);
  return isfinite(s->energy_j);
}

// Goes along e->step as far as the energy falls, or the residual where the fall is lost in the
// energy's rounding; a step that imposes displacements has to do work and is taken whole.
// @return false: it does not fall
static bool search_line(sonde_equilibrium *e, sonde_pose pose, bool imposing, standing *s) {
  const size_t side = 3 * (size_t)e->zone_count, first = 3 * (size_t)sonde_zone_first(e);
  double fall = -product(e->step, e->force, first), share = 1;
  for (size_t i = 0; i < side; ++i)
    if (!e->imposed[i / 3]) fall += e->step[first + i] * (e->touch[i] - e->force[first + i]);
  const double before = s->energy_j, residual = s->residual;
  for (int half = 0; half < HALVINGS; ++half, share *= 0.5) {
    for (uint32_t n = 0; n < e->mesh->node_count; ++n) {
      e->trial[n] = e->moved[n];
      if (e->unknown[n] == SONDE_HELD_CORNER) continue;
      const double *x = e->step + 3 * (size_t)e->unknown[n];
      const uint8_t held = e->mesh->held[n];
      e->trial[n] = v_madd(e->moved[n], share,
                           vec3(held & 1 ? 0 : x[0], held & 2 ? 0 : x[1], held & 4 ? 0 : x[2]));
    }
    const bool whole = stand(e, pose, e->trial, s);
    if (imposing && !whole) return false;
    const bool unseen = share * fall < rounding * before && s->residual < residual;
    if (whole && (imposing || unseen || s->energy_j <= before - armijo * share * fall)) {
      sonde_vec3 *other = e->moved;
      e->moved = e->trial, e->trial = other;
      return true;
    }
  }
  return false;
}

double sonde_equilibrium_least_load(const sonde_equilibrium *e) {
  SONDE_ASSERT(e != NULL && e->def.tolerance > 0);
  double lost = 0; // sum of the squares of the forces that rounding loses, N^2
  for (uint32_t h = 0; h < e->mesh->count; ++h) {
    sonde_vec3 rest[8], now[8], g[8];
    const double bulk_pa = corners_of(e, e->moved, h, rest, now)->bulk_pa;
    const double edge = cbrt(8 * fabs(sonde_hexahedron_gradients(rest, 0, 0, 0, g)));
    lost += pow(force_rounding * bulk_pa * edge * edge, 2);
  }
  return fmax(least_load_n, sqrt(lost) / e->def.tolerance);
}

bool sonde_equilibrium_solve(sonde_equilibrium *e, sonde_pose pose,
                             sonde_equilibrium_result *result) {
  SONDE_ASSERT(e != NULL && result != NULL);
  const size_t side = 3 * (size_t)e->zone_count, first = 3 * (size_t)sonde_zone_first(e);
  standing s;
  if (!stand(e, pose, e->moved, &s)) return false;
  for (uint32_t n = 0; n < STEPS_MOST; ++n) {
    bool imposing = false;
    for (uint32_t k = 0; k < e->zone_count; ++k)
      imposing |= e->imposed[k] && v_distance(e->target[k], e->moved[e->zone_node[k]]) > 1e-12;
    result->residual = s.residual / s.load;
    if (!imposing && result->residual <= e->def.tolerance) {
      result->tissue_j = s.tissue_j, result->slipped_j += s.touch.slipped_j;
      result->contact_j = s.touch.energy_j - s.touch.slipped_j;
      result->force_n = s.touch.force_n, result->torque_nm = s.touch.torque_nm;
      result->area_m2 = s.touch.area_m2, result->deepest_m = s.touch.deepest_m;
      return true;
    }
    // The condensed stiffness; shifted as little as makes it positive definite.
    uint32_t inner = 0;
    for (int shifts = 0; shifts < SHIFTS_MOST && !inner; ++shifts) {
      if (!condense(e, shifts == 0 ? 0 : shifts == 1 ? first_shift : e->shift * more_shift))
        continue;
      // What the zone itself exerts keeps its precision.
      for (size_t k = 0; k < first + side; ++k) e->step[k] = k < first ? -e->force[k] : 0;
      sonde_numeric_reduce(&e->numeric, e->step);
      for (size_t k = 0; k < side; ++k) e->load[k] = e->step[first + k] - e->force[first + k];
      inner = sonde_equilibrium_contact(e, pose, n == 0);
    }
    if (!inner || (e->stick && inner >= FRICTION_MOST)) return false;
    memcpy(e->step + first, e->way, side * sizeof *e->way);
    sonde_numeric_expand(&e->numeric, e->step);
    memcpy(e->step + first, e->way, side * sizeof *e->way);
    ++result->steps, result->inner_steps += inner, result->shifts += e->shift > 0;
    // The forces at the state again: the contact's were those of the last trial, and friction's
    // limits are those of the contact's solution.
    balance(e, pose, e->moved, &s);
    if (!search_line(e, pose, imposing, &s)) return false;
    if (!e->stick) continue;
    sonde_friction_look(e, pose, e->moved, NULL, SONDE_FRICTION_PRESSURE);
    balance(e, pose, e->moved, &s);
  }
  return false;
}

// ---- how the force changes ------------------------------------------------------------------

// Motion of the zone with the probe's unit way: e->way; returns the tangent stiffness, NaN where
// none is positive definite. The contact moves with the probe: (S + C) way = C unit.
static double follow(sonde_equilibrium *e, sonde_vec3 way, bool bend) {
  const size_t side = 3 * (size_t)e->zone_count;
  double stiffness = 0;
  for (size_t i = 0; i < side; ++i) e->way[i] = v_coordinate(way, (int)(i % 3));
  if (e->def.bonded) {
    for (size_t i = 0; i < side; ++i)
      stiffness += e->way[i] * product(e->schur + i * side, e->way, side);
    return stiffness;
  }
  memset(e->matrix, 0, side * side * sizeof *e->matrix);
  (void)sonde_equilibrium_touch(e, e->pose, e->moved, NULL, bend, e->touch, e->matrix);
  for (size_t i = 0; i < side; ++i) e->load[i] = product(e->matrix + i * side, e->way, side);
  stiffness = product(e->load, e->way, side);
  for (size_t i = 0; i < side * side; ++i) e->matrix[i] += e->schur[i];
  if (!sonde_cholesky(e->matrix, (uint32_t)side)) return NAN;
  memcpy(e->way, e->load, side * sizeof *e->way);
  sonde_cholesky_solve(e->matrix, (uint32_t)side, e->way);
  return stiffness - product(e->load, e->way, side);
}

sonde_status sonde_equilibrium_change(sonde_equilibrium *e, sonde_vec3 way,
                                      sonde_force_change *change, sonde_error *error) {
  SONDE_ASSERT(e != NULL && change != NULL && fabs(v_norm(way) - 1) < 1e-6);
  const size_t side = 3 * (size_t)e->zone_count, first = 3 * (size_t)sonde_zone_first(e);
  *change = (sonde_force_change){.way_n_m = NAN};
  // Where a contact's edge takes more stiffness than there is, the change goes without it, as
  // Newton's steps do.
  if (e->factored || condense(e, 0)) change->way_n_m = follow(e, way, true);
  if (isnan(change->way_n_m) && e->factored) change->way_n_m = follow(e, way, false);
  if (isnan(change->way_n_m))
    return sonde_fail(error, SONDE_CONVERGENCE, "the equilibrium has no positive stiffness");
  memset(e->step, 0, first * sizeof *e->step);
  memcpy(e->step + first, e->way, side * sizeof *e->way);
  sonde_numeric_expand(&e->numeric, e->step);
  memcpy(e->step + first, e->way, side * sizeof *e->way);
  // The force is the change of the least energy with the way; its change with a parameter is that
  // of the tissue's forces at rest, along the motion.
  for (uint32_t h = 0; h < e->mesh->count; ++h) {
    sonde_vec3 rest[8], now[8];
    double energy, f[24], by_exponent[24], shear = 0, exponent = 0;
    const sonde_hyperelastic *material = corners_of(e, e->moved, h, rest, now);
    const bool whole = e->kernels->evaluate(material, rest, now, &energy, f, NULL) &&
                       e->kernels->by_exponent(material, rest, now, by_exponent);
    SONDE_ASSERT(whole); // the state's energy was finite
    for (int k = 0; k < 24; ++k) {
      const uint32_t at = e->corner[h][k / 3];
      if (at == SONDE_HELD_CORNER || e->mesh->held[e->mesh->corner[h][k / 3]] >> k % 3 & 1)
        continue;
      const double motion = e->step[3 * (size_t)at + (size_t)(k % 3)];
      shear += f[k] * motion, exponent += by_exponent[k] * motion;
    }
    change->ln_shear_n[e->mesh->layer[h]] += shear;
    change->exponent_n[e->mesh->layer[h]] += exponent;
  }
  return SONDE_OK;
}
