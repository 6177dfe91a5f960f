// Vessels under the probe: load on the skin -> stress at the vessel -> area -> ellipse.
//
// sonde_interior_update           field, then vessels
// sonde_interior_vessels          all stations of all vessels
// find_course                     what a vessel holds this time
// measure_load, half_side         equivalent uniform rectangle of the contact forces
// solid_pressure                  effective pressure on the wall from the solid's stress
// rectangle_pressure              the same below a rectangle on a half space
// update_station                  dynamics and shape
// sonde_vessel_stations, sonde_vessel_at  state between stations
// sonde_vessel_gather, sonde_vessel_tissue  the tissue around a moving wall
// sonde_interior_vessel_at_plane  where the image plane cuts
#include "base/base.h"
#include "interior/interior.h"
#include "interior/window.h"

static const double relaxation_s = 0.1;     // emptying of a vein segment (docs/interior.md)
static const double least_ratio = 1e-12;    // a vein that is pressed flat is still an ellipse
static const double skin_spread_m = 1.8e-3; // the skin widens the loaded patch by its thickness
static const double reach_share = 0.65;     // of the way from the moment's side to the reach's
static const double least_half_m = 1.5e-3;  // a point probe still has a face
static const double least_share = 0.03;     // of the largest nodal force: belongs to the contact
static const double least_depth_m = 3e-3;
static const double bone_start = 0.30, bone_rise = 1.75; // rigid base, docs/interior.md
static const double carry_reach = 3.0; // rest radii over which the wall's motion fades
static const double plane_reach_m = 40e-3;
static const double gradient_reach = 1.5, bend_reach = 2.5; // rest radii: where the field is read
static const double most_squeeze = 1.6; // a lumen's semi-axis over the tissue's stretch, rest radii
static const double least_tissue = 0.1, most_turn = 0.5; // of the gradient beside a wall
static const double most_shear = 1;                      // over the stretch along the other axis
static const double gap_share = 0.2;
static const double gentle_squeeze = 0.45, gentle_bend = 0.02, probing_m = 0.1e-3;
static const double least_gathered = 0.2; // volume of the gathered tissue over that at rest
static const double most_lean = 0.4; // tangent of the angle between a vessel and itself at rest
static const double safe_share = 0.2, even_step = 0.15, lead_step = 0.25;
enum { PASSES = 10 };
static const double bend_share = 0.2;   // of the tissue's least stretch that a bend may take
static const double beyond_share = 0.5; // of the way to where the field is read: the next ring

// Equivalent load of a probe on the skin, in the probe frame.
typedef struct load {
  double force_n;
  sonde_vec3 centre_m; // rest skin under the force's centre, world
  double half_x_m, half_y_m, pressure_pa;
  sonde_vec3 x, y, beam; // probe axes, world
} load;

// Sums over the loaded nodes, probe frame.
typedef struct sums {
  double force, x, y, xx, yy;
  double low_x, high_x, low_y, high_y; // extent of the nodes that carry a share
} sums;

static void add_node(sums *t, double f, double x, double y, double least) {
  t->force += f;
  t->x += f * x, t->y += f * y, t->xx += f * x * x, t->yy += f * y * y;
  if (f < least) return;
  t->low_x = fmin(t->low_x, x), t->high_x = fmax(t->high_x, x);
  t->low_y = fmin(t->low_y, y), t->high_y = fmax(t->high_y, y);
}

// Half side of the uniform strip that stands for the load: between the one with the same second
// moment and the reach of the contact. The moment alone takes the peak under the middle of a flat
// face on a round leg at its full sharpness; the stiff skin evens it out (docs/interior.md). Nodes
// just outside the face carry a share too: the strip is never wider than the face.
static double half_side(double moment, double low, double high, double face) {
  double half = sqrt(3 * fmax(0, moment)), reach = 0.5 * fmax(0, high - low);
  half = fmax(half + reach_share * fmax(reach - half, 0), least_half_m);
  return fmin(half, face) + skin_spread_m;
}

static load measure_load(const sonde_model *model, const sonde_interior_input *input) {
  sonde_mat3 r = q_matrix(input->world_from_probe.rotation);
  load l = {.x = m_column(&r, 0), .y = m_column(&r, 1), .beam = m_column(&r, 2)};
  sums t = {.low_x = INFINITY, .high_x = -INFINITY, .low_y = INFINITY, .high_y = -INFINITY};
  double largest = 0;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    largest = fmax(largest, v_dot(input->contact_forces_n[i], l.beam));
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    double f = v_dot(input->contact_forces_n[i], l.beam);
    if (!(f > 0)) continue;
    sonde_vec3 d = v_sub(input->positions_m[i], input->world_from_probe.position);
    add_node(&t, f, v_dot(d, l.x), v_dot(d, l.y), least_share * largest);
    l.centre_m = v_madd(l.centre_m, f, model->surface.vertices[i]);
  }
  if (!(t.force > 1e-6)) return (load){.x = l.x, .y = l.y, .beam = l.beam};
  double s = 1 / t.force;
  l.force_n = t.force;
  l.centre_m = v_scale(l.centre_m, s);
  l.half_x_m = half_side(t.xx * s - t.x * s * t.x * s, t.low_x, t.high_x, input->face_half_x_m);
  l.half_y_m = half_side(t.yy * s - t.y * s * t.y * s, t.low_y, t.high_y, input->face_half_y_m);
  l.pressure_pa = l.force_n / (4 * l.half_x_m * l.half_y_m);
  return l;
}

// Depth of a rest point below the rest skin against the beam.
static double depth_along_beam(const sonde_interior *in, const sonde_station *station,
                               sonde_vec3 beam) {
  sonde_surface_point hit;
  if (!sonde_surface_raycast(in->skin, station->rest_m, v_neg(beam), 0.1, &hit))
    return station->depth_m;
  return v_distance(hit.point_m, station->rest_m);
}

// (4 s2 - s_axial)/3 with s2 the mean normal stress in the vessel's cross-section, compression
// positive.
static double effective(double trace, double axial) {
  return fmax(0, (4 * 0.5 * (trace - axial) - axial) / 3);
}

// From the solid's stress; false where it has none.
static bool solid_pressure(const sonde_interior *in, const sonde_station *station, double *out) {
  sonde_mat3 s;
  if (!in->solid || !(in->live->stress_scale > 0)) return false;
  *out = 0;
  if (!sonde_interior_stress(in, station->rest_m, &s)) return true;
  double axial = -v_dot(station->axis, m_mul_v(s, station->axis));
  *out = effective(-(s.m[0][0] + s.m[1][1] + s.m[2][2]), axial);
  return true;
}

// From the half space under the equivalent rectangle, until the solid is factored.
static double rectangle_pressure(const sonde_interior *in, const sonde_station *station,
                                 const load *l) {
  sonde_vec3 d = v_sub(station->rest_m, l->centre_m);
  if (!(l->force_n > 0) || v_norm2(d) > 0.12 * 0.12) return 0;
  double z = fmax(depth_along_beam(in, station, l->beam), least_depth_m);
  sonde_vec3 s = sonde_rectangle_stress(l->pressure_pa, l->half_x_m, l->half_y_m, v_dot(d, l->x),
                                        v_dot(d, l->y), z);
  sonde_vec3 a =
      vec3(v_dot(station->axis, l->x), v_dot(station->axis, l->y), v_dot(station->axis, l->beam));
  double axial = a.x * a.x * s.x + a.y * a.y * s.y + a.z * a.z * s.z;
  double base = 1 + bone_rise * fmax(0, fmin(z / station->tissue_m, 1) - bone_start);
  return base * effective(s.x + s.y + s.z, axial);
}

// A vessel's state with and without clot, and the radii over the model's that belong to them.
typedef struct course {
  sonde_vessel_kind kind;
  const sonde_pathology *all;
  sonde_pathology of[2]; // [clot]
  double scale[2];
} course;

static course find_course(const sonde_interior *in, uint32_t which) {
  const sonde_pathology *p = &in->pathology[which];
  course c = {.kind = in->kind[which], .all = p, .of = {*p, *p}};
  c.of[0].thrombus_fraction = 0;
  if (c.kind == SONDE_VESSEL_ARTERY) {
    c.scale[0] = c.scale[1] = sonde_artery_rest_scale(p);
  } else {
    c.scale[0] = sonde_vein_rest_scale(&c.of[0], false);
    c.scale[1] = p->thrombus_fraction > 0 ? sonde_vein_rest_scale(p, true) : c.scale[0];
  }
  return c;
}

static double area_goal(const course *c, bool clot, double outside, double hold) {
  const sonde_pathology *p = &c->of[clot];
  if (c->kind == SONDE_VESSEL_ARTERY) return sonde_artery_area_ratio(p, outside);
  if (!(outside > 0) && !clot) return 1; // most stations, most of the time
  return sonde_vein_area_in(p, outside, hold);
}

static void update_station(sonde_interior *in, uint32_t which, uint32_t i, const course *c,
                           const load *l, const sonde_interior_input *input) {
  const sonde_station *station = &in->station[which][i];
  sonde_vessel_state *v = &in->state[which][i];
  bool clot = c->kind == SONDE_VESSEL_VEIN && sonde_pathology_clot(c->all, station->rest_m.z);
  double outside;
  if (!solid_pressure(in, station, &outside)) outside = rectangle_pressure(in, station, l);
  double goal = area_goal(c, clot, outside, station->hold);
  double blend = input->dt_s < 0 || !in->ready ? 1 : 1 - exp(-input->dt_s / relaxation_s);
  v->outside_pa = outside;
  v->area_ratio = fmax(v->area_ratio + (goal - v->area_ratio) * blend, least_ratio);
  v->lead = station->lead * clamp(fabs(1 - v->area_ratio) / sonde_engaged_loss, 0, 1);
  v->rest_radius_m = station->radius_m * c->scale[clot];
  double half_short, half_long;
  sonde_vessel_shape(c->kind, &c->of[clot], clot, v->area_ratio, &half_short, &half_long);
  v->half_short_m = half_short * v->rest_radius_m;
  v->half_long_m = half_long * v->rest_radius_m;
  v->rest_centre_m = station->rest_m;
  v->centre_m = v_add(station->rest_m, sonde_interior_field(in, station->rest_m));
}

// Gradient f of the field across a vessel, over points on both sides of it, as a turn and a lower
// triangle. A wall that keeps its shape in tissue that is squeezed flat bounds the squeeze. The
// shear ends beside the wall: its bound keeps the tissue there, which it shears unevenly, from
// folding.
static void split_gradient(double f[2][2], sonde_vessel_state *v) {
  SONDE_ASSERT(v->rest_radius_m > 0);
  double least_short = v->half_short_m / (most_squeeze * v->rest_radius_m);
  double least_long = v->half_long_m / (most_squeeze * v->rest_radius_m);
  double size = hypot(f[0][0], f[0][1]);
  double half = clamp(-f[0][1] / fmax(size + f[0][0], 1e-3), -most_turn, most_turn);
  double whole = 2 / (1 + half * half), cosine = whole - 1, sine = half * whole;
  v->tissue_turn = half;
  v->tissue_short = fmax(size, fmax(least_short, least_tissue));
  v->tissue_long = fmax(f[1][0] * sine + f[1][1] * cosine, fmax(least_long, least_tissue));
  double bound = most_shear * v->tissue_long;
  double narrow = least_short / v->tissue_short * v->tissue_long / least_long;
  if (narrow > 1) bound /= narrow;
  v->tissue_shear = clamp(f[1][0] * cosine - f[1][1] * sine, -bound, bound);
}

// The field beside a wall differs from its gradient by a bend that ends at the wall. Where tissue
// is squeezed so thin that a bend which ends so soon would fold it, less of the bend ends. Returns
// whether the tissue may be close to folding.
static bool find_tissue(const sonde_interior *in, sonde_vessel_state *v) {
  enum { SIDES = 8 };
  v->tissue_short = v->tissue_long = v->tissue_even = 1, v->tissue_shear = v->tissue_turn = 0;
  if (!(v->lead > 0)) return false;
  double f[2][2], most = 0, thin = INFINITY;
  sonde_vec3 side[2] = {v->flat_axis, v_cross(v->axis, v->flat_axis)};
  const double near = gradient_reach * v->rest_radius_m, far = bend_reach * v->rest_radius_m;
  for (int k = 0; k < 2; ++k) {
    sonde_vec3 low = sonde_interior_field(in, v_madd(v->rest_centre_m, -near, side[k]));
    sonde_vec3 high = sonde_interior_field(in, v_madd(v->rest_centre_m, near, side[k]));
    sonde_vec3 slope = v_scale(v_sub(high, low), 0.5 / near);
    for (int i = 0; i < 2; ++i) f[i][k] = (i == k) + v_dot(slope, side[i]);
  }
  split_gradient(f, v);
  for (int k = 0; k < SIDES; ++k) {
    double x = far * cos(2 * SONDE_PI * k / SIDES), y = far * sin(2 * SONDE_PI * k / SIDES);
    double a = x, b = y;
    sonde_vec3 at = v_madd(v_madd(v->rest_centre_m, x, side[0]), y, side[1]);
    sonde_vec3 beyond = v_madd(v_madd(at, beyond_share * x, side[0]), beyond_share * y, side[1]);
    sonde_vec3 field = sonde_interior_field(in, at);
    sonde_vec3 u = v_sub(field, v_sub(v->centre_m, v->rest_centre_m));
    sonde_vec3 apart = v_add(v_sub(beyond, at), v_sub(sonde_interior_field(in, beyond), field));
    thin = fmin(thin, v_norm(apart) / (beyond_share * far));
    sonde_vessel_tissue(v, &a, &b);
    most = fmax(most, hypot(v_dot(u, side[0]) - a + x, v_dot(u, side[1]) - b + y));
  }
  double bound = bend_share * fmin(thin, fmin(v->tissue_short, v->tissue_long)) * far;
  if (most > bound) v->tissue_even = bound / most;
  return fmin(v->tissue_short, v->tissue_long) < gentle_squeeze || most > gentle_bend * far;
}

// Two vessels side by side leave tissue between them: towards the other a lumen takes a share of
// the gap at rest, as the tissue's gradient stretches it, and is as much larger across; its area
// stays.
static void keep_clear(sonde_interior *in, uint32_t which, uint32_t other) {
  for (uint32_t i = 0; i < in->station_count[which]; ++i) {
    sonde_vessel_state *v = &in->state[which][i], beside;
    if (!(v->lead > 0) || !sonde_vessel_at(in, other, in->station[which][i].s_m, &beside)) continue;
    sonde_vec3 d = v_sub(beside.rest_centre_m, v->rest_centre_m);
    d = v_madd(d, -v_dot(d, v->axis), v->axis);
    double apart = v_norm(d), gap = apart - v->rest_radius_m - beside.rest_radius_m;
    if (!(gap > 0)) continue;
    double cosine = v_dot(d, v->flat_axis) / apart, sine2 = fmax(0, 1 - cosine * cosine);
    double a = v->half_short_m / v->tissue_short, b = v->half_long_m / v->tissue_long;
    double toward = a * a * cosine * cosine + b * b * sine2;
    double bound = v->rest_radius_m + gap_share * gap;
    if (toward <= bound * bound) continue;
    double share = bound / sqrt(toward);
    bool by_long = b * b * sine2 > a * a * cosine * cosine;
    v->half_long_m *= by_long ? share : 1 / share;
    v->half_short_m *= by_long ? 1 / share : share;
  }
}

// What walls do to the tissue beside a station.
typedef struct strain {
  double gathered; // least volume after gathering
  double even;     // largest share of the present evening out that surely folds nothing
} strain;

static sonde_mat3 per_step(const sonde_vec3 at[4], double step) {
  return m_scale(m_columns(v_sub(at[1], at[0]), v_sub(at[2], at[0]), v_sub(at[3], at[0])),
                 1 / step);
}

static double volume_of(const sonde_mat3 *m) {
  sonde_vec3 a = m_column(m, 0), b = m_column(m, 1), c = m_column(m, 2);
  return v_dot(a, v_cross(b, c));
}

// A bound from below of the least stretch under a gradient: its volume over the size of its
// cofactors.
static double least_stretch(const sonde_mat3 *m) {
  sonde_vec3 a = m_column(m, 0), b = m_column(m, 1), c = m_column(m, 2);
  sonde_vec3 bc = v_cross(b, c), ca = v_cross(c, a), ab = v_cross(a, b);
  return v_dot(a, bc) / sqrt(v_norm2(bc) + v_norm2(ca) + v_norm2(ab));
}

static double size_of(const sonde_mat3 *m) {
  sonde_vec3 a = m_column(m, 0), b = m_column(m, 1), c = m_column(m, 2);
  return sqrt(v_norm2(a) + v_norm2(b) + v_norm2(c));
}

// At a place of rest, by differences over a step: stations before and after it differ. The tissue's
// gradient without evening out is M, evening out adds B: no fold where e times the size of B stays
// below the least stretch under M.
static void strain_at(const sonde_interior *in, sonde_vec3 at, double s, double step,
                      strain *least) {
  sonde_vec3 gathered[4], place[4], even[4];
  sonde_vessel_state near[SONDE_VESSELS];
  uint32_t count = sonde_vessels_near(in, at, s, near);
  for (int c = 0; c < 4; ++c) {
    sonde_vec3 side = c == 1 ? in->e1 : c == 2 ? in->e2 : in->axis;
    sonde_vec3 from = c > 0 ? v_madd(at, step, side) : at;
    if (c == 3) count = sonde_vessels_near(in, from, s + step, near);
    sonde_carried to = sonde_vessels_carry(in, near, count, from);
    gathered[c] = to.gathered_m, place[c] = to.place_m, even[c] = v_sub(to.even_m, to.place_m);
  }
  const sonde_mat3 turn = m_transpose(m_columns(in->e1, in->e2, in->axis));
  sonde_mat3 g = m_mul(per_step(gathered, step), turn), m = m_mul(per_step(place, step), turn);
  sonde_mat3 b = per_step(even, step);
  least->gathered = fmin(least->gathered, volume_of(&g));
  double room = safe_share * fmax(0, least_stretch(&m));
  least->even = fmin(least->even, room / fmax(size_of(&b), 1e-9));
}

// Around a station, and between its wall and those of other vessels.
static strain strain_beside(const sonde_interior *in, uint32_t which, uint32_t i) {
  enum { SIDES = 10, RINGS = 3, WAYS = 3 };
  static const double ring[RINGS] = {1.1, 1.9, 3.1}; // rest radii
  const sonde_vessel_state *v = &in->state[which][i];
  const sonde_vec3 side[2] = {v->flat_axis, v_cross(v->axis, v->flat_axis)};
  const double s = in->station[which][i].s_m;
  strain least = {INFINITY, INFINITY};
  for (int k = 0; k < SIDES * RINGS; ++k) {
    double a = 2 * SONDE_PI * (k % SIDES) / SIDES, r = ring[k / SIDES] * v->rest_radius_m;
    sonde_vec3 way = v_madd(v_scale(side[0], r * cos(a)), r * sin(a), side[1]);
    strain_at(in, v_add(v->rest_centre_m, way), s + v_dot(way, in->axis),
              k % 2 ? probing_m : -probing_m, &least);
  }
  for (uint32_t other = 0; other < in->vessel_count; ++other) {
    sonde_vessel_state beside;
    if (other == which || !sonde_vessel_at(in, other, s, &beside)) continue;
    sonde_vec3 d = v_sub(beside.rest_centre_m, v->rest_centre_m);
    double apart = v_norm(d), gap = apart - v->rest_radius_m - beside.rest_radius_m;
    if (!(gap > 0) || gap > 2 * (v->rest_radius_m + beside.rest_radius_m)) continue;
    for (int k = 0; k < WAYS * 5; ++k) {
      double r = (v->rest_radius_m + gap * (k % WAYS + 1) / (WAYS + 1)) / apart;
      sonde_vec3 across = v_unit(v_cross(d, in->axis), side[1]);
      sonde_vec3 way = v_madd(v_scale(d, r), (k / WAYS - 2) * 0.4 * v->rest_radius_m, across);
      strain_at(in, v_add(v->rest_centre_m, way), s + v_dot(way, in->axis),
                k % 2 ? probing_m : -probing_m, &least);
    }
  }
  return least;
}

// A wall leads less, and a lumen that stands up against the squeeze goes half the way to where the
// tissue's gradient takes it.
static void give_way(sonde_vessel_state *v) {
  SONDE_ASSERT(v->rest_radius_m > 0 && v->tissue_short > 0 && v->tissue_long > 0);
  double with_short = v->tissue_short * v->rest_radius_m;
  double with_long = v->tissue_long * v->rest_radius_m;
  v->lead *= 0.5;
  if (v->half_short_m <= with_short) return;
  v->half_short_m += 0.5 * (with_short - v->half_short_m);
  v->half_long_m += 0.5 * (with_long - v->half_long_m);
}

// From one station to the next a share changes by so much at most: what a wall does ends gently
// along its vessel as well.
static void spread_along(sonde_interior *in, uint32_t which) {
  const uint32_t count = in->station_count[which];
  for (uint32_t n = 1; n < 2 * count; ++n) {
    bool back = n >= count;
    uint32_t i = back ? 2 * count - 1 - n : n, from = back ? i + 1 : i - 1;
    if (from >= count) continue;
    sonde_vessel_state *v = &in->state[which][i], *w = &in->state[which][from];
    const double most = in->station[which][i].lead, beside = in->station[which][from].lead;
    v->tissue_even = fmin(v->tissue_even, w->tissue_even + even_step);
    if (beside > 0) v->lead = fmin(v->lead, most * fmin(1, w->lead / beside + lead_step));
  }
}

// Where walls would fold a layer that is squeezed very thin, or the tissue between two of them,
// they give way to it, and less of the bends ends at them.
static void yield_to_squeeze(sonde_interior *in) {
  bool changed = true;
  for (int pass = 0; pass < PASSES && changed; ++pass) {
    changed = false;
    for (uint32_t which = 0; which < in->vessel_count; ++which)
      for (uint32_t i = 0; i < in->station_count[which]; ++i) {
        if (!in->strained[which][i]) continue;
        strain least = strain_beside(in, which, i);
        in->strained[which][i] = least.gathered < least_gathered; // to be looked at again
        if (least.gathered >= least_gathered && least.even >= 1) continue;
        for (uint32_t other = 0; other < in->vessel_count; ++other) {
          uint32_t at;
          double share;
          if (!sonde_vessel_stations(in, other, in->station[which][i].s_m, &at, &share)) continue;
          sonde_vessel_state *v = &in->state[other][at + (share > 0.5)];
          v->tissue_even *= fmin(least.even, 1);
          if (least.gathered < least_gathered) give_way(v), changed = true;
        }
      }
    for (uint32_t which = 0; which < in->vessel_count; ++which) spread_along(in, which);
  }
}

// The direction of a vessel that runs along `way`, at most so far from where it runs at rest: its
// cross-sections stay apart.
static sonde_vec3 lean(sonde_vec3 rest, sonde_vec3 way) {
  sonde_vec3 axis = v_unit(way, rest);
  double along = v_dot(axis, rest);
  sonde_vec3 aside = v_madd(axis, -along, rest);
  double across = v_norm(aside), most = most_lean * fmax(along, 0);
  if (along > 0 && across <= most) return axis;
  return v_unit(v_madd(rest, most_lean / fmax(across, 1e-9), aside), rest);
}

void sonde_interior_vessels(sonde_interior *in, const sonde_interior_input *input) {
  load l = measure_load(in->model, input);
  for (uint32_t which = 0; which < in->vessel_count; ++which) {
    uint32_t count = in->station_count[which];
    sonde_vessel_state *v = in->state[which];
    course c = find_course(in, which);
    for (uint32_t i = 0; i < count; ++i) update_station(in, which, i, &c, &l, input);
    for (uint32_t i = 0; i < count; ++i) {
      uint32_t a = i > 0 ? i - 1 : 0, b = i + 1 < count ? i + 1 : i;
      v[i].axis = lean(in->station[which][i].axis, v_sub(v[b].centre_m, v[a].centre_m));
      sonde_vec3 up = v_madd(v_neg(l.beam), v_dot(l.beam, v[i].axis), v[i].axis);
      if (v_norm2(up) > 1e-4) v[i].flat_axis = v_unit(up, v[i].flat_axis);
    }
  }
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    for (uint32_t i = 0; i < in->station_count[which]; ++i)
      in->strained[which][i] = find_tissue(in, &in->state[which][i]);
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    for (uint32_t other = 0; other < in->vessel_count; ++other)
      if (other != which) keep_clear(in, which, other);
  yield_to_squeeze(in);
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    for (uint32_t i = 0; i < in->station_count[which]; ++i) {
      sonde_vessel_state *v = &in->state[which][i];
      double thin = sonde_least_lumen * v->rest_radius_m * v->tissue_short;
      v->half_short_m = fmax(v->half_short_m, thin);
    }
}

void sonde_interior_update(sonde_interior *in, const sonde_interior_input *input) {
  SONDE_ASSERT(in != NULL && input != NULL && input->pathology != NULL);
  SONDE_ASSERT(input->positions_m != NULL && input->contact_forces_n != NULL);
  SONDE_ASSERT(input->face_half_x_m > 0 && input->face_half_y_m > 0);
  sonde_findings_apply(in, input->pathology);
  in->solid = sonde_interior_follow(in, input);
  if (!in->solid) {
    sonde_interior_solve(in, input->positions_m);
    sonde_bend_update(in->bend, in, input);
  }
  sonde_interior_vessels(in, input);
  in->tick = input->tick;
  in->ready = true;
}

// ---- reading ------------------------------------------------------------------------------

const sonde_vessel_state *sonde_interior_vessel(const sonde_interior *in, int which,
                                                uint32_t *count) {
  SONDE_ASSERT(in != NULL && which >= 0 && (uint32_t)which < in->vessel_count && count != NULL);
  *count = in->station_count[which];
  return in->state[which];
}

static sonde_vessel_state blend_states(const sonde_vessel_state *a, const sonde_vessel_state *b,
                                       double t) {
  sonde_vessel_state v = *a;
  v.rest_centre_m = v_lerp(a->rest_centre_m, b->rest_centre_m, t);
  v.centre_m = v_lerp(a->centre_m, b->centre_m, t);
  v.axis = v_unit(v_lerp(a->axis, b->axis, t), a->axis);
  v.flat_axis = v_lerp(a->flat_axis, b->flat_axis, t);
  v.flat_axis = v_unit(v_madd(v.flat_axis, -v_dot(v.flat_axis, v.axis), v.axis), a->flat_axis);
  v.rest_radius_m += t * (b->rest_radius_m - a->rest_radius_m);
  v.outside_pa += t * (b->outside_pa - a->outside_pa);
  v.area_ratio += t * (b->area_ratio - a->area_ratio);
  v.half_short_m += t * (b->half_short_m - a->half_short_m);
  v.half_long_m += t * (b->half_long_m - a->half_long_m);
  v.tissue_short += t * (b->tissue_short - a->tissue_short);
  v.tissue_long += t * (b->tissue_long - a->tissue_long);
  v.tissue_shear += t * (b->tissue_shear - a->tissue_shear);
  v.tissue_turn += t * (b->tissue_turn - a->tissue_turn);
  v.tissue_even += t * (b->tissue_even - a->tissue_even);
  v.lead += t * (b->lead - a->lead);
  return v;
}

bool sonde_vessel_stations(const sonde_interior *in, uint32_t which, double s, uint32_t *at,
                           double *share) {
  SONDE_ASSERT(which < in->vessel_count && at != NULL && share != NULL);
  uint32_t count = in->station_count[which];
  const sonde_station *station = in->station[which];
  if (count < 2 || s < station[0].s_m || s > station[count - 1].s_m) return false;
  double guess = (s - station[0].s_m) / (station[count - 1].s_m - station[0].s_m) * (count - 1);
  uint32_t i = (uint32_t)fmin(floor(guess), count - 2);
  while (i > 0 && station[i].s_m > s) --i;
  while (i + 2 < count && station[i + 1].s_m < s) ++i;
  double t = (s - station[i].s_m) / (station[i + 1].s_m - station[i].s_m);
  *at = i, *share = clamp(t, 0, 1);
  return true;
}

bool sonde_vessel_at(const sonde_interior *in, uint32_t which, double s,
                     sonde_vessel_state *state) {
  SONDE_ASSERT(which < in->vessel_count);
  uint32_t i;
  double t;
  if (!sonde_vessel_stations(in, which, s, &i, &t)) return false;
  *state = blend_states(&in->state[which][i], &in->state[which][i + 1], t);
  return true;
}

bool sonde_vessel_reaches(const sonde_interior *in, uint32_t which, double s, sonde_vec3 rest,
                          double beyond_m) {
  SONDE_ASSERT(which < in->vessel_count && beyond_m >= 0);
  uint32_t i;
  double t;
  if (!sonde_vessel_stations(in, which, s, &i, &t)) return false;
  const sonde_vessel_state *a = &in->state[which][i], *b = a + 1;
  sonde_vec3 d = v_sub(rest, v_lerp(a->rest_centre_m, b->rest_centre_m, t));
  double slant = fabs(v_dot(d, a->axis)); // lies along the vessel, not beside it
  double reach = (1 + carry_reach) * fmax(a->rest_radius_m, b->rest_radius_m) + beyond_m;
  return v_norm(d) < reach + slant;
}

// Turns a point by an angle of which `half` is the tangent of the half.
static void turn_point(double half, double *x, double *y) {
  double whole = 2 / (1 + half * half), cosine = whole - 1, sine = half * whole, x0 = *x;
  *x = cosine * x0 - sine * *y;
  *y = sine * x0 + cosine * *y;
}

// The lumen goes to the ellipse from which the tissue's gradient leads to its present one. Outside
// circles become ellipses of half axes m - c and m + c whose area is that of the circle less what
// the lumen lost; loss, c, turn and shear fade out. Both half axes grow with the circle, and a turn
// or shear that depends on it alone keeps areas: no two points meet. A lumen that is pressed flat
// keeps a line of that thickness.
void sonde_vessel_gather(const sonde_vessel_state *v, double *short_m, double *long_m) {
  SONDE_ASSERT(v->rest_radius_m > 0 && v->half_short_m > 0);
  double rest = v->rest_radius_m, x = *short_m, y = *long_m, r = sqrt(x * x + y * y);
  double t = clamp((r / rest - 1) / carry_reach, 0, 1), fade = (1 - t) * (1 - t) * (1 + 2 * t);
  double half_short = fmax(v->half_short_m / v->tissue_short, sonde_least_lumen * rest);
  double half_long = v->half_long_m / v->tissue_long;
  if (r <= rest) {
    x *= half_short / rest, y *= half_long / rest;
  } else {
    double c = 0.5 * (half_long - half_short) * fade;
    double mean = sqrt(r * r - (rest * rest - half_short * half_long) * fade + c * c);
    turn_point(v->tissue_turn * (1 - fade), &x, &y);
    x *= (mean - c) / r, y *= (mean + c) / r;
  }
  y -= fade * v->tissue_shear / v->tissue_long * x;
  turn_point(-v->tissue_turn, &x, &y);
  *short_m = x, *long_m = y;
}

void sonde_vessel_tissue(const sonde_vessel_state *v, double *short_m, double *long_m) {
  SONDE_ASSERT(v != NULL && short_m != NULL && long_m != NULL);
  double a = *short_m, b = *long_m;
  turn_point(v->tissue_turn, &a, &b);
  *short_m = v->tissue_short * a;
  *long_m = v->tissue_long * b + v->tissue_shear * a;
}

// The image plane is y = 0 of the probe frame.
bool sonde_interior_vessel_at_plane(const sonde_interior *in, int which, sonde_pose probe,
                                    sonde_vessel_state *state) {
  SONDE_ASSERT(in != NULL && which >= 0 && (uint32_t)which < in->vessel_count && state != NULL);
  const sonde_vessel_state *v = in->state[which];
  double nearest = plane_reach_m;
  bool found = false;
  for (uint32_t i = 0; i + 1 < in->station_count[which]; ++i) {
    sonde_vec3 a = pose_apply_inverse(probe, v[i].centre_m);
    sonde_vec3 b = pose_apply_inverse(probe, v[i + 1].centre_m);
    if ((a.y > 0) == (b.y > 0)) continue;
    double t = a.y / (a.y - b.y), x = fabs(a.x + t * (b.x - a.x));
    if (x > nearest) continue;
    nearest = x, found = true;
    *state = blend_states(&v[i], &v[i + 1], t);
  }
  return found;
}

uint64_t sonde_interior_tick(const sonde_interior *in) { return in->tick; }
