// A pass: the skin near the probe by Newton's method with the contact inside, on the bulk that is
// condensed by an older factor; then the bulk follows, and its forces are taken afresh.
#include "live.h"

#include "base/base.h"

#include <string.h>

enum { HALVINGS = 8, SUMS = 8, SHIFTS_MOST = 6 };
static const double armijo = 1e-4, first_shift = 1e-3, more_shift = 5;
static const double tolerance = 1e-4;    // of the skin's residual over the contact's force
static const double least_load_n = 1e-3; // that residuals are compared with
// What a pass leaves without balance is compared with the contact's force, of at least so much:
// a probe that hardly touches has little to be balanced.
static const double least_borne_n = 0.05;

// ---- the bulk -------------------------------------------------------------------------------

// Stiffness of the bulk at the state that is being factored; the nonlinear skin has none.
static void stiffness_of(const void *user, uint32_t hex, double (*k)[24]) {
  const sonde_solid_live *l = user;
  if (l->is_skin[hex])
    memset(k, 0, 24 * sizeof *k);
  else
    sonde_equilibrium_stiffness(l->e, l->bulk_state, l->shift, hex, k);
}

void sonde_live_begin_factor(sonde_solid_live *l) {
  const sonde_matrix_source source = {.element = stiffness_of, .user = l};
  SONDE_ASSERT(!l->making);
  memcpy(l->bulk_state, l->e->moved, l->e->mesh->node_count * sizeof *l->bulk_state);
  l->bulk_pose[!l->serves] = l->e->pose;
  l->is_shifted[!l->serves] = l->shift > 0;
  l->of_rest[!l->serves] = true;
  for (uint32_t n = 0; n < l->e->mesh->node_count; ++n)
    if (v_norm2(l->bulk_state[n]) > 0) l->of_rest[!l->serves] = false;
  sonde_numeric_begin(&l->bulk[!l->serves], l->e->symbolic, &source);
  l->making = true;
}

bool sonde_live_share_factor(sonde_solid_live *l, uint64_t budget) {
  sonde_numeric *f = &l->bulk[!l->serves];
  if (!l->making || !sonde_numeric_step(f, budget)) return false;
  l->making = false;
  if (f->failed) { // the next one is shifted more
    l->shift = l->shift > 0 ? l->shift * more_shift : first_shift;
    return false;
  }
  l->shift = 0, l->serves = !l->serves;
  ++l->counts.factors;
  return true;
}

bool sonde_live_forces(sonde_solid_live *l) {
  sonde_equilibrium *e = l->e;
  double energy = 0;
  memset(e->force, 0, 3 * (size_t)e->unknown_count * sizeof *e->force);
  return sonde_equilibrium_add_forces(e, l->hex, l->bulk_count, e->moved, &energy, e->force);
}

void sonde_live_pull(sonde_solid_live *l) {
  sonde_equilibrium *e = l->e;
  const size_t first = 3 * (size_t)sonde_patch_first(e), side = sonde_live_side(l);
  // What the patch itself exerts keeps its precision.
  for (size_t k = 0; k < first + side; ++k) e->step[k] = k < first ? -e->force[k] : 0;
  sonde_numeric_reduce(&l->bulk[l->serves], e->step);
  for (size_t k = 0; k < side; ++k) l->pull[k] = e->step[first + k] - e->force[first + k];
}

// ---- the patch on the condensed bulk ----------------------------------------------------------

// The patch at displacements u: energies without those that do not change, right-hand side without
// the contact, and how far it is from balance.
typedef struct patch_standing {
  double energy_j, residual, load;
} patch_standing;

// @param ways, stretch of the patch since the state; right receives pull - stretch - forces of the
//   skin. The contact's forces go to e->touch. @return false: turned inside out
static bool stand(sonde_solid_live *l, sonde_pose pose, const sonde_vec3 *u, const double *ways,
                  const double *stretch, double *right, patch_standing *s) {
  sonde_equilibrium *e = l->e;
  const size_t first = 3 * (size_t)sonde_patch_first(e), side = sonde_live_side(l);
  const size_t zone = side - 3 * (size_t)e->zone_count;
  double load = 0, rest = 0;
  s->energy_j = 0;
  memset(e->force + first, 0, side * sizeof *e->force);
  if (!sonde_equilibrium_add_forces(e, l->hex + l->bulk_count, l->skin_count, u, &s->energy_j,
                                    e->force))
    return false;
  const sonde_touch touch = sonde_equilibrium_touch(e, pose, u, NULL, false, e->touch, NULL);
  s->energy_j += touch.energy_j;
  for (size_t k = 0; k < side; ++k) {
    const double push = k < zone ? 0 : e->touch[k - zone];
    s->energy_j += ways[k] * (0.5 * stretch[k] - l->pull[k]);
    right[k] = l->pull[k] - stretch[k] - e->force[first + k];
    load += push * push, rest += (right[k] + push) * (right[k] + push);
  }
  s->load = fmax(sqrt(load), least_load_n), s->residual = sqrt(rest);
  return isfinite(s->energy_j);
}

// The tangent of bulk and skin at displacements u, eliminated down to the zone, which receives
// e->schur; `left` = right goes along as far, and e->load. @return false: not positive definite
static bool condense(sonde_solid_live *l, const sonde_vec3 *u, const double *right) {
  sonde_equilibrium *e = l->e;
  const size_t side = sonde_live_side(l), zone = 3 * (size_t)e->zone_count, own = side - zone;
  const size_t stride = sonde_front_stride((uint32_t)side);
  const uint32_t first = sonde_patch_first(e);
  const sonde_numeric *bulk = &l->bulk[l->serves];
  double shift = 0;
  for (int n = 0; n < SHIFTS_MOST; ++n, shift = n == 1 ? first_shift : shift * more_shift) {
    const float *from = sonde_numeric_condensed_single(bulk);
    for (size_t j = 0; j < side; ++j)
      memcpy(l->tangent + j * stride + j, from + j * side + j, (side - j) * sizeof *from);
    for (uint32_t h = 0; h < l->skin_count; ++h) {
      const uint32_t hex = l->hex[l->bulk_count + h], *corner = e->corner[hex];
      double k[24][24];
      sonde_equilibrium_stiffness(e, u, shift, hex, k);
      for (int i = 0; i < 24; ++i)
        for (int j = 0; j < 24; ++j) {
          if (corner[i / 3] == SONDE_HELD_CORNER || corner[j / 3] == SONDE_HELD_CORNER) continue;
          const size_t row = 3 * (size_t)(corner[i / 3] - first) + (size_t)(i % 3);
          const size_t column = 3 * (size_t)(corner[j / 3] - first) + (size_t)(j % 3);
          if (row >= column) l->tangent[column * stride + row] += (float)k[i][j];
        }
    }
    if (!bulk->kernels->eliminate_single(l->tangent, (uint32_t)side, 0, (uint32_t)own)) continue;
    memcpy(l->left, right, side * sizeof *right);
    sonde_front_forward(l->tangent, (uint32_t)side, (uint32_t)own, l->left);
    memcpy(e->load, l->left + own, zone * sizeof *e->load);
    for (size_t j = 0; j < zone; ++j)
      for (size_t i = j; i < zone; ++i)
        e->schur[i * zone + j] = e->schur[j * zone + i] =
            (double)l->tangent[(own + j) * stride + own + i];
    return true;
  }
  return false;
}

// Displacements of the nodes from unknown `from` on: base + share ways.
static void displace(const sonde_solid_live *l, uint32_t from, const double *ways, double share,
                     const sonde_vec3 *base, sonde_vec3 *to) {
  const sonde_equilibrium *e = l->e;
  for (uint32_t n = 0; n < e->mesh->node_count; ++n) {
    const uint32_t at = e->unknown[n], held = e->mesh->held[n];
    if (at == SONDE_HELD_CORNER || at < from) continue;
    const double *x = ways + 3 * (size_t)(at - from);
    to[n] =
        v_madd(base[n], share, vec3(held & 1 ? 0 : x[0], held & 2 ? 0 : x[1], held & 4 ? 0 : x[2]));
  }
}

// Goes along `left` as far as the patch's energy falls. @return false: it does not fall
static bool search_line(sonde_solid_live *l, sonde_pose pose, patch_standing *s) {
  sonde_equilibrium *e = l->e;
  const size_t side = sonde_live_side(l), zone = side - 3 * (size_t)e->zone_count;
  const double before = s->energy_j;
  double fall = 0, share = 1;
  for (size_t k = 0; k < side; ++k)
    fall += l->left[k] * (l->right[k] + (k < zone ? 0 : e->touch[k - zone]));
  const float *column = sonde_numeric_condensed_single(&l->bulk[l->serves]);
  const double *x = l->left;
  memset(l->rest, 0, side * sizeof *l->rest);
  for (size_t j = 0; j < side; ++j, column += side) { // of the lower triangle
    double sum[SUMS] = {(double)column[j] * x[j]};
    size_t i = j + 1;
    for (; i + SUMS <= side; i += SUMS)
      for (size_t k = 0; k < SUMS; ++k) {
        const double stiff = (double)column[i + k];
        l->rest[i + k] += stiff * x[j], sum[k] += stiff * x[i + k];
      }
    for (; i < side; ++i)
      l->rest[i] += (double)column[i] * x[j], sum[0] += (double)column[i] * x[i];
    for (size_t k = 0; k < SUMS; ++k) l->rest[j] += sum[k];
  }
  for (int half = 0; half < HALVINGS; ++half, share *= 0.5) {
    const double more = half ? -share : 1; // each trial from the last one
    for (size_t k = 0; k < side; ++k)
      l->ways[k] += more * l->left[k], l->stretch[k] += more * l->rest[k];
    displace(l, sonde_patch_first(e), l->left, share, e->moved, e->trial);
    if (!stand(l, pose, e->trial, l->ways, l->stretch, l->trial, s) ||
        s->energy_j > before - armijo * share * fall + 1e-9 * fabs(before))
      continue;
    memcpy(l->right, l->trial, side * sizeof *l->right);
    displace(l, sonde_patch_first(e), l->left, share, e->moved, e->moved);
    return true;
  }
  for (size_t k = 0; k < side; ++k)
    l->ways[k] -= 2 * share * l->left[k], l->stretch[k] -= 2 * share * l->rest[k];
  return false;
}

// Such a probe leaves the skin there: no state has less energy.
bool sonde_live_is_clear(sonde_solid_live *l, sonde_pose pose) {
  sonde_equilibrium *e = l->e;
  memset(e->trial, 0, e->mesh->node_count * sizeof *e->trial);
  return sonde_equilibrium_touch(e, pose, e->trial, NULL, false, e->touch, NULL).energy_j == 0;
}

bool sonde_live_follow(sonde_solid_live *l, sonde_pose pose) {
  sonde_equilibrium *e = l->e;
  const size_t side = sonde_live_side(l), nodes = e->mesh->node_count;
  const size_t own = side - 3 * (size_t)e->zone_count;
  const size_t first = 3 * (size_t)sonde_patch_first(e);
  patch_standing s;
  uint32_t steps = 0;
  memcpy(e->kept, e->moved, nodes * sizeof *e->moved);
  memset(l->ways, 0, side * sizeof *l->ways);
  memset(l->stretch, 0, side * sizeof *l->stretch);
  if (!stand(l, pose, e->moved, l->ways, l->stretch, l->right, &s)) return false;
  const bool stays = sonde_equilibrium_way(e->pose, pose) < sonde_live_still_m;
  l->settled = stays && s.residual <= tolerance * s.load ? l->settled + 1 : 0;
  while (steps < l->def.skin_steps) {
    if (!l->ready && !condense(l, e->moved, l->right)) break;
    l->ready = false;
    if (!sonde_equilibrium_contact(e, pose, steps == 0)) break;
    // Ways of the patch from those of the zone.
    memcpy(l->left + own, e->way, (side - own) * sizeof *l->left);
    sonde_front_backward(l->tangent, (uint32_t)side, (uint32_t)own, l->left);
    (void)sonde_equilibrium_touch(e, pose, e->moved, NULL, false, e->touch, NULL);
    if (!search_line(l, pose, &s)) break;
    ++steps;
    if (s.residual <= tolerance * s.load) break;
  }
  l->counts.skin_steps += steps;
  // The bulk follows the patch; shorter where an element would turn inside out.
  memcpy(e->step + first, l->ways, side * sizeof *l->ways);
  sonde_numeric_expand(&l->bulk[l->serves], e->step);
  memcpy(e->step + first, l->ways, side * sizeof *l->ways);
  double share = 1;
  for (int half = 0; half < HALVINGS && steps > 0; ++half, share *= 0.5) {
    displace(l, 0, e->step, share, e->kept, e->moved);
    l->counts.shortened += half == 1;
    if (sonde_live_forces(l)) return true;
  }
  memcpy(e->moved, e->kept, nodes * sizeof *e->moved);
  (void)sonde_live_forces(l);
  return false;
}

bool sonde_live_show(sonde_solid_live *l, sonde_live_tangent *shown) {
  sonde_equilibrium *e = l->e;
  const size_t side = sonde_live_side(l), zone = 3 * (size_t)e->zone_count;
  patch_standing s;
  memset(l->ways, 0, side * sizeof *l->ways);
  memset(l->stretch, 0, side * sizeof *l->stretch);
  const bool upright = stand(l, e->pose, e->moved, l->ways, l->stretch, l->right, &s);
  SONDE_ASSERT(upright); // the state is one that a pass has accepted
  l->unbalance = s.residual / fmax(s.load, least_borne_n);
  l->ready = condense(l, e->moved, l->right);
  if (!l->ready) return false;
  // Minus the inverse is what elimination leaves of 0 behind the identity.
  const size_t own = side - zone, both = 2 * zone, to = sonde_front_stride((uint32_t)both);
  memset(l->inverse, 0, both * to * sizeof *l->inverse);
  for (size_t j = 0; j < zone; ++j) {
    memcpy(l->inverse + j * to + j,
           l->tangent + (own + j) * sonde_front_stride((uint32_t)side) + own + j,
           (zone - j) * sizeof *l->inverse);
    l->inverse[j * to + zone + j] = 1;
  }
  const sonde_dense_kernels *kernels = l->bulk[l->serves].kernels;
  if (!kernels->eliminate_single(l->inverse, (uint32_t)both, 0, (uint32_t)zone)) return false;
  for (size_t j = 0; j < zone; ++j)
    for (size_t i = j; i < zone; ++i)
      shown->give_m_n[i * l->width + j] = shown->give_m_n[j * l->width + i] =
          -l->inverse[(zone + j) * to + zone + i];
  double whole[3][3] = {{0}}, square = 0;
  for (size_t i = 0; i < zone; ++i) {
    for (size_t j = 0; j < zone; ++j) whole[i % 3][j % 3] += e->schur[i * zone + j];
    e->way[i] = 0;
    for (size_t j = 0; j < zone; ++j)
      e->way[i] += (double)shown->give_m_n[j * l->width + i] * e->load[j];
  }
  for (int k = 0; k < 9; ++k) square += whole[k / 3][k % 3] * whole[k / 3][k % 3];
  shown->stiffness_n_m = sqrt(square);
  for (uint32_t k = 0; k < e->zone_count; ++k) {
    const uint32_t node = e->zone_node[k];
    const double *way = e->way + 3 * (size_t)k;
    shown->free_m[k] =
        v_add(v_add(e->mesh->node[node], e->moved[node]), vec3(way[0], way[1], way[2]));
  }
  return true;
}
