// The displacement field: one solve per update, closed evaluation anywhere
// (docs/interior_theory.md).
//
// With p(theta, s, zeta) the column map, J = H r its volume density and U a field without
// divergence in (theta, s, zeta), u = (1/J) (U^zeta dp/dzeta + U^theta dp/dtheta + U^s dp/ds) has
// none in space, whatever the shape of the leg. Two such fields are added; at the bone both vanish:
// - inflow, the flux through the skin: U^zeta = g W, U^i = g' V^i with d_i V^i = -W.
// - slide, the skin's motion along itself: U^i = g S^i + g'/2 V'^i with S^i = H R t^i,
//   U^zeta = -(z - 3/2 z^2 + z^4/2) D, D = d_i S^i = d_i V'^i: what follows the skin below it comes
//   back at mid-depth.
// V + V'/2 = -grad Phi takes one solve.
#include "base/base.h"
#include "interior/clot.h"
#include "interior/vessels.h"
#include "interior/fold_repair.h"
#include "interior/window.h"

#include <string.h>

static const double inversion_tolerance_m = 1e-7;
// Beyond this area strain the skin's gathering under a probe is not followed by the depth: springs
// alone let it crumple, and squeezed-out tissue would lift a vessel out of the leg.
static const double most_slide_strain = 0.05;

// ---- update -------------------------------------------------------------------------------

static double bone_of(const sonde_interior *in, uint32_t column) {
  return in->bone ? (double)in->bone[column].radius_m : in->bone_radius_m;
}

void sonde_interior_solve(sonde_interior *in, const sonde_vec3 *positions) {
  SONDE_ASSERT(positions != NULL && in->surface != NULL);
  const uint32_t n = in->theta_count, count = n * in->s_count;
  // Motion of the skin at each column, through it and along it.
  for (uint32_t k = 0; k < count; ++k) {
    const sonde_column *c = &in->column[k];
    sonde_vec3 now = vec3(0, 0, 0);
    for (int v = 0; v < 3; ++v) now = v_madd(now, c->weight[v], positions[c->node[v]]);
    sonde_vec3 move = v_sub(now, c->rest_m);
    double height = c->radius_m - bone_of(in, k);
    sonde_bend bend = sonde_bend_at(in, in->s_first_m + in->s_step_m * (k / n));
    sonde_vec3 lean = v_madd(v_scale(in->e1, bend.slope_x), bend.slope_y, in->e2);
    double along = v_dot(move, in->axis);
    in->field[k].inflow = (float)-v_dot(move, c->flux_normal);
    in->field[k].slide_theta =
        (float)(height * (v_dot(move, c->round) - along * v_dot(lean, c->round)));
    in->field[k].slide_s = (float)(height * c->radius_m * along);
  }
  // Divergence of the slide, and the source of the potential.
  const double cell = in->theta_step * in->s_step_m;
  for (uint32_t k = 0; k < count; ++k) {
    const uint32_t i = k % n, j = k / n;
    const uint32_t below = j > 0 ? j - 1 : 0, above = j + 1 < in->s_count ? j + 1 : j;
    const sonde_column_field *row = in->field + j * n;
    const sonde_column *c = &in->column[k];
    double a = row[(i + 1) % n].slide_theta - row[(i + n - 1) % n].slide_theta;
    double b = in->field[above * n + i].slide_s - in->field[below * n + i].slide_s;
    double bound = most_slide_strain * (c->radius_m - bone_of(in, k)) * c->radius_m;
    double ds = (above - below) * in->s_step_m;
    double spread = clamp(a / (2 * in->theta_step) + b / ds, -bound, bound);
    in->field[k].spread = (float)spread;
    in->potential[k] = (0.5 * spread - row[i].inflow) * cell;
  }
  sonde_direct_solve(in->surface, in->potential);
  // V at i+1/2 and j+1/2; the potential is zero beyond both ends.
  for (uint32_t k = 0; k < count; ++k) {
    const uint32_t right = k / n * n + (k + 1) % n, up = k + n;
    const bool last = up >= count;
    double phi = in->potential[k], beyond = last ? 0 : in->potential[up];
    double ra = 0.5 * (in->column[k].radius_m + in->column[right].radius_m);
    double rb = 0.5 * (in->column[k].radius_m + in->column[last ? k : up].radius_m);
    in->field[k].flux_theta = (float)((phi - in->potential[right]) / (ra * in->theta_step));
    in->field[k].flux_s = (float)((phi - beyond) * rb / in->s_step_m);
  }
}

// ---- evaluation ---------------------------------------------------------------------------

typedef struct polar {
  double theta, s, r;
  sonde_vec3 e, round; // unit vectors outward and around
} polar;

static polar to_polar(const sonde_interior *in, sonde_vec3 p) {
  sonde_vec3 d = v_sub(p, in->origin);
  polar q = {.s = v_dot(d, in->axis)};
  sonde_bend bend = sonde_bend_at(in, q.s);
  double x = v_dot(d, in->e1) - bend.x, y = v_dot(d, in->e2) - bend.y;
  q.r = sqrt(x * x + y * y);
  q.theta = atan2(y, x);
  double cosine = q.r > 0 ? x / q.r : 1, sine = q.r > 0 ? y / q.r : 0;
  q.e = v_add(v_scale(in->e1, cosine), v_scale(in->e2, sine));
  q.round = v_sub(v_scale(in->e2, cosine), v_scale(in->e1, sine));
  return q;
}

// Four columns around a point of the table and the bilinear weights.
typedef struct stencil {
  const sonde_column_field *f[4];
  float w[4];
} stencil;

static stencil stencil_at(const sonde_interior *in, double i, double j) {
  SONDE_ASSERT(isfinite(i) && isfinite(j) && in->s_count >= 2);
  uint32_t n = in->theta_count;
  double last = in->s_count - 1;
  j = clamp(j, 0, last);
  double fi = floor(i), fj = fmin(floor(j), last - 1);
  float a = (float)(i - fi), b = (float)(j - fj);
  uint32_t i0 = (uint32_t)((int64_t)fi + 2 * (int64_t)n) % n, i1 = (i0 + 1) % n;
  const sonde_column_field *row = in->field + (size_t)fj * n;
  return (stencil){{row + i0, row + i1, row + n + i0, row + n + i1},
                   {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b}};
}

#define BLEND(st, member)                                                                          \
  ((double)((st).w[0] * (st).f[0]->member + (st).w[1] * (st).f[1]->member +                        \
            (st).w[2] * (st).f[2]->member + (st).w[3] * (st).f[3]->member))

// Radius of the bone and its slopes around and along, blended as the columns are.
static sonde_column_bone bone_at(const sonde_interior *in, const stencil *st) {
  sonde_column_bone sum = {0, 0, 0};
  for (int k = 0; k < 4 && in->bone != NULL; ++k) {
    const sonde_column_bone *b = &in->bone[st->f[k] - in->field];
    sum.radius_m += st->w[k] * b->radius_m;
    sum.slope_theta_m += st->w[k] * b->slope_theta_m, sum.slope_s += st->w[k] * b->slope_s;
  }
  return sum;
}

static sonde_vec3 column_field(const sonde_interior *in, polar q) {
  double i = q.theta / in->theta_step, j = (q.s - in->s_first_m) / in->s_step_m;
  stencil at = stencil_at(in, i, j);
  stencil mid_i = stencil_at(in, i - 0.5, j), mid_j = stencil_at(in, i, j - 0.5);
  const sonde_column_bone bone = bone_at(in, &at);
  const sonde_bend bend = sonde_bend_at(in, q.s);
  double radius = BLEND(at, radius_m);
  double height = radius - (in->bone ? (double)bone.radius_m : in->bone_radius_m);
  double z = clamp((radius - q.r) / height, 0, 1), r = radius - z * height;
  double rest_part = 1 - z;
  double g = rest_part * rest_part * (1 + 2 * z), slope = -6 * z * rest_part;
  double back = z * (1 - 1.5 * z + 0.5 * z * z * z);
  double down = g * BLEND(at, inflow) - back * BLEND(at, spread);
  double turn = slope * BLEND(mid_i, flux_theta) + g * BLEND(at, slide_theta);
  double shift = slope * BLEND(mid_j, flux_s) + g * BLEND(at, slide_s);
  double density = 1 / (height * r);
  double out = -down / r +
               density * rest_part * (turn * BLEND(at, slope_theta_m) + shift * BLEND(at, slope_s));
  out += density * z * (turn * (double)bone.slope_theta_m + shift * (double)bone.slope_s);
  sonde_vec3 u = v_scale(q.e, out);
  u = v_madd(u, density * turn * r, q.round);
  u = v_madd(v_madd(u, density * shift * bend.slope_x, in->e1), density * shift * bend.slope_y,
             in->e2);
  return v_madd(u, density * shift, in->axis);
}

sonde_vec3 sonde_interior_column_field(const sonde_interior *in, sonde_vec3 rest) {
  return column_field(in, to_polar(in, rest));
}

// Beyond the ends of the window the solid is at rest.
sonde_vec3 sonde_interior_field(const sonde_interior *in, sonde_vec3 rest) {
  if (in->tissue != NULL) return in->tissue->moved(in->tissue, rest);
  polar q = to_polar(in, rest);
  if (!in->solid) {
    sonde_vec3 kept, plain = column_field(in, q);
    double share = sonde_column_grid_at(in->column_grid, q.theta, q.s, q.r, &kept);
    return share > 0 ? v_lerp(plain, kept, share) : plain;
  }
  double u[3];
  (void)sonde_window_field(in->live, q.theta, q.s, q.r, u);
  return v_madd(v_madd(v_scale(in->e1, u[0]), u[1], in->e2), u[2], in->axis);
}

uint64_t sonde_vessels_reaching(const sonde_interior *in, sonde_vec3 rest, double s) {
  if (in->reached == NULL) return 0;
  const double i = floor(to_polar(in, rest).theta / in->theta_step);
  const double j = clamp(floor((s - in->s_first_m) / in->s_step_m), 0, in->s_count - 1);
  const uint32_t n = in->theta_count, column = (uint32_t)((int64_t)i + n) % n;
  return in->reached[(uint32_t)j * n + column];
}

void sonde_interior_column(const sonde_interior *in, double theta, double s,
                           sonde_column_point *at) {
  stencil st = stencil_at(in, theta / in->theta_step, (s - in->s_first_m) / in->s_step_m);
  at->theta = theta, at->s = s, at->depth_m = 0;
  at->r = at->radius_m = BLEND(st, radius_m);
  at->cosine = BLEND(st, cosine);
  at->fat_m = BLEND(st, fat_m), at->muscle_m = BLEND(st, muscle_m);
  at->bone_m = in->bone ? (double)bone_at(in, &st).radius_m : in->bone_radius_m;
}

bool sonde_interior_locate(const sonde_interior *in, sonde_vec3 rest, sonde_column_point *at) {
  polar q = to_polar(in, rest);
  sonde_interior_column(in, q.theta, q.s, at);
  at->r = q.r;
  at->depth_m = (at->radius_m - q.r) * at->cosine;
  return q.s >= in->s_low_m && q.s <= in->s_high_m;
}

bool sonde_interior_in_bone(const sonde_interior *in, sonde_vec3 rest,
                            const sonde_column_point *at) {
  const struct sonde_tissue_map *map = in->model->map;
  sonde_tissue_depths depths;
  if (map == NULL) return at->r <= at->bone_m;
  map->depths(map->self, rest, &depths);
  return depths.bone_m <= 0;
}

bool sonde_interior_stress(const sonde_interior *in, sonde_vec3 rest, sonde_mat3 *stress) {
  SONDE_ASSERT(in != NULL && stress != NULL);
  sonde_column_point at;
  *stress = m_zero();
  if (!(in->solid || in->tissue) || !sonde_interior_locate(in, rest, &at)) return false;
  // A limb's column calls bone what lies below an outer bone: vessels there take the stress on it.
  if (at.depth_m < 0 || (in->bone == NULL && at.r <= at.bone_m)) return false;
  if (in->tissue != NULL) {
    *stress = in->tissue->stress(in->tissue, rest);
    return true;
  }
  sonde_mat3 local, world_from_leg = m_columns(in->e1, in->e2, in->axis);
  if (!sonde_window_stress(in->live, at.theta, at.s, at.r, &local)) return false;
  *stress = m_mul(world_from_leg, m_mul(local, m_transpose(world_from_leg)));
  return true;
}

// Fixed point q <- q - (q + u(q) - p). Where the map contracts strongly the plain step would
// oscillate; a step that does not shrink the mismatch is halved.
sonde_vec3 sonde_interior_invert(const sonde_interior *in, sonde_vec3 point, sonde_vec3 guess,
                                 int iterations, double *error_m) {
  sonde_vec3 q = guess, best = guess;
  double damping = 1, least = INFINITY;
  for (int i = 0; i < iterations; ++i) {
    sonde_vec3 miss = v_sub(v_add(q, sonde_interior_field(in, q)), point);
    double size = v_norm(miss);
    if (size < least)
      least = size, best = q;
    else
      damping *= 0.5;
    if (size < inversion_tolerance_m) break;
    q = v_madd(q, -damping, miss);
  }
  if (error_m != NULL) *error_m = least;
  return best;
}

// Vessel label of a rest point, LABEL_COUNT when it lies in none. A branch begins in the lumen of
// its parent: lumina hide walls. A mural clot fills the deep side of the lumen up to its free
// surface.
sonde_label sonde_vessels_label(const sonde_interior *in, sonde_vec3 rest, double s,
                                uint32_t *number) {
  static const double wall_m[2] = {0.7e-3, 0.9e-3}, wall_share = 0.25;
  sonde_label wall = SONDE_LABEL_COUNT;
  const uint64_t reaching = sonde_vessels_reaching(in, rest, s);
  for (uint32_t which = 0; which < in->vessel_count; ++which) {
    const bool artery = in->course[which].kind == SONDE_VESSEL_ARTERY;
    sonde_vessel_state v;
    if (which >= 2 && !(reaching >> (which - 2) & 1)) continue;
    const double along = sonde_vessel_along(in, which, rest, s);
    if (which >= 2 && !sonde_vessel_reaches(in, which, along, rest, 0)) continue;
    if (!sonde_vessel_at(in, which, along, &v)) continue;
    sonde_vec3 d = v_sub(rest, v.rest_centre_m);
    d = v_madd(d, -v_dot(d, v.axis), v.axis);
    double r = v_norm(d), thick = wall_m[in->course[which].kind];
    if (which >= 2) thick = fmin(thick, wall_share * v.rest_radius_m);
    if (r > v.rest_radius_m + thick) continue;
    if (r > v.rest_radius_m) {
      if (wall != SONDE_LABEL_COUNT) continue;
      wall = artery ? SONDE_LABEL_ARTERY_WALL : SONDE_LABEL_VEIN_WALL;
      if (number != NULL) *number = which;
      continue;
    }
    if (number != NULL) *number = which;
    if (artery) return SONDE_LABEL_ARTERY;
    const sonde_pathology *p = &in->pathology[which];
    if (!sonde_pathology_clot(p, rest.z)) return SONDE_LABEL_VEIN;
    double deep = -v_dot(d, v.flat_axis) / v.rest_radius_m;
    double across = v_dot(d, v_cross(v.axis, v.flat_axis)) / v.rest_radius_m;
    return sonde_clot_holds(p->form, p->thrombus_fraction, which, along, -deep, across)
               ? SONDE_LABEL_THROMBUS
               : SONDE_LABEL_VEIN;
  }
  return wall;
}

sonde_label sonde_interior_label(const sonde_interior *in, sonde_vec3 rest, double *depth_m) {
  SONDE_ASSERT(in != NULL);
  sonde_column_point at;
  bool within = sonde_interior_locate(in, rest, &at);
  if (depth_m != NULL) *depth_m = at.depth_m;
  if (!within || at.depth_m < 0) return SONDE_LABEL_OUTSIDE;
  const struct sonde_tissue_map *map = in->model->map;
  sonde_label known = SONDE_LABEL_COUNT;
  if (map != NULL) {
    static const sonde_label of[] = {
        [SONDE_TISSUE_OUTSIDE] = SONDE_LABEL_OUTSIDE, [SONDE_TISSUE_SKIN] = SONDE_LABEL_SKIN,
        [SONDE_TISSUE_FAT] = SONDE_LABEL_FAT,         [SONDE_TISSUE_FASCIA] = SONDE_LABEL_FASCIA,
        [SONDE_TISSUE_MUSCLE] = SONDE_LABEL_MUSCLE,   [SONDE_TISSUE_TENDON] = SONDE_LABEL_TENDON,
        [SONDE_TISSUE_NERVE] = SONDE_LABEL_NERVE,     [SONDE_TISSUE_NODE] = SONDE_LABEL_NODE,
        [SONDE_TISSUE_BONE] = SONDE_LABEL_BONE};
    known = of[map->tissue(map->self, rest)];
    if (known == SONDE_LABEL_OUTSIDE || known == SONDE_LABEL_BONE) return known;
  } else if (sonde_interior_in_bone(in, rest, &at)) {
    return SONDE_LABEL_BONE;
  }
  sonde_label vessel = sonde_vessels_label(in, rest, at.s, NULL);
  if (vessel != SONDE_LABEL_COUNT) return vessel;
  sonde_label lesion = sonde_lesion_label(in, rest);
  if (lesion != SONDE_LABEL_COUNT) return lesion;
  if (map != NULL) return known;
  if (at.depth_m < at.fat_m) return SONDE_LABEL_SKIN;
  return at.depth_m < at.muscle_m ? SONDE_LABEL_FAT : SONDE_LABEL_MUSCLE;
}
