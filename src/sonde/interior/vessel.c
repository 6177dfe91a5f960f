// Vessels under the probe: load on the skin -> stress at the vessel -> area -> ellipse -> tissue
// around it (docs/interior_theory.md). Where a wall would fold the tissue it gives way.
#include "base/base.h"
#include "interior/fold_repair.h"
#include "interior/vessels.h"
#include "interior/window.h"

static const double engaged_pa = 200;       // from outside: a wall shapes the tissue beside it
static const double relaxation_s = 0.1;     // emptying of a vein segment (docs/interior_theory.md)
static const double least_ratio = 1e-12;    // a vein that is pressed flat is still an ellipse
static const double skin_spread_m = 1.8e-3; // the skin widens the loaded patch by its thickness
static const double reach_share = 0.65;     // of the way from the moment's side to the reach's
static const double least_half_m = 1.5e-3;  // a point probe still has a face
static const double least_share = 0.03;     // of the largest nodal force: belongs to the contact
static const double least_depth_m = 3e-3;
static const double bone_start = 0.30, bone_rise = 1.75; // rigid base, docs/interior_theory.md
static const double plane_reach_m = 40e-3;
static const double gradient_reach = 1.5, bend_reach = 2.5; // rest radii: where the field is read
static const double most_squeeze = 1.6; // a lumen's semi-axis over the tissue's stretch, rest radii
static const double least_tissue = 0.1, most_rotation = 0.5; // of the gradient beside a wall
static const double most_shear = 1; // over the stretch along the other axis
static const double gap_share = 0.2;
static const double gentle_squeeze = 0.45, gentle_bend = 0.02, probing_m = 0.1e-3;
static const double least_warped = 0.2; // volume of the warped tissue over that at rest
static const double most_lean = 0.4;    // tangent of the angle between a vessel and itself at rest
static const double safe_share = 0.2;
// From one section to the next a share changes by so much at most: what a wall does ends gently
// along its vessel as well.
static const double smoothing_step = 0.15, coupling_step = 0.25;
enum { PASSES = 10 };
// Tissue around a section is probed on rings within the reach of its wall, and between two walls at
// thirds of the gap: on the line between their middles and to both sides of it, where the gap is
// still narrow. A gap wider than twice the radii together is probed by the rings of both walls.
// Close to a wall that is pressed flat the volume changes within half a radius along the ring.
enum { RINGS = 3, GAP_WAYS = 3, GAP_SIDES = 5 };
static const int ring_sides[RINGS] = {20, 10, 10};
static const double ring_radii[RINGS] = {1.1, 1.9, 3.1}, gap_side_radii = 0.4, most_gap_radii = 2;
static const double bend_share = 0.2;   // of the tissue's least stretch that a bend may take
static const double beyond_share = 0.5; // of the way to where the field is read: the next ring

// Equivalent load of a probe on the skin, in the probe frame.
typedef struct load {
  double force_n;
  sonde_vec3 centre_m; // rest skin under the force's centre, world
  double half_x_m, half_y_m, pressure_pa;
  sonde_vec3 x, y, beam; // probe axes, world
} load;

// Half side of the uniform strip that stands for the load: between the one with the same second
// moment and the reach of the contact. The moment alone takes the peak under the middle of a flat
// face on a round leg at its full sharpness; the stiff skin smooths it (docs/interior_theory.md).
// Nodes just outside the face carry a share too: the strip is never wider than the face.
static double half_side(double moment, double low, double high, double face) {
  double half = sqrt(3 * fmax(0, moment)), reach = 0.5 * fmax(0, high - low);
  half = fmax(half + reach_share * fmax(reach - half, 0), least_half_m);
  return fmin(half, face) + skin_spread_m;
}

static load measure_load(const sonde_model *model, const sonde_interior_input *input) {
  sonde_mat3 r = q_matrix(input->world_from_probe.rotation);
  load l = {.x = m_column(&r, 0), .y = m_column(&r, 1), .beam = m_column(&r, 2)};
  double low_x = INFINITY, high_x = -INFINITY, low_y = INFINITY, high_y = -INFINITY, largest = 0;
  double force = 0, sum_x = 0, sum_y = 0, sum_xx = 0, sum_yy = 0;
  if (input->tissue != NULL) return l; // which has the stress itself
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    largest = fmax(largest, v_dot(input->contact_forces_n[i], l.beam));
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    double f = v_dot(input->contact_forces_n[i], l.beam);
    if (!(f > 0)) continue;
    sonde_vec3 d = v_sub(input->positions_m[i], input->world_from_probe.position);
    double x = v_dot(d, l.x), y = v_dot(d, l.y);
    force += f;
    sum_x += f * x, sum_y += f * y, sum_xx += f * x * x, sum_yy += f * y * y;
    l.centre_m = v_madd(l.centre_m, f, model->surface.vertices[i]);
    if (f < least_share * largest) continue;
    low_x = fmin(low_x, x), high_x = fmax(high_x, x);
    low_y = fmin(low_y, y), high_y = fmax(high_y, y);
  }
  if (!(force > 1e-6)) return (load){.x = l.x, .y = l.y, .beam = l.beam};
  double s = 1 / force;
  l.force_n = force;
  l.centre_m = v_scale(l.centre_m, s);
  l.half_x_m = half_side(sum_xx * s - sum_x * s * sum_x * s, low_x, high_x, input->face_half_x_m);
  l.half_y_m = half_side(sum_yy * s - sum_y * s * sum_y * s, low_y, high_y, input->face_half_y_m);
  l.pressure_pa = l.force_n / (4 * l.half_x_m * l.half_y_m);
  return l;
}

// (4 s2 - s_axial)/3 with s2 the mean normal stress in the vessel's cross-section, compression
// positive.
static double effective(double trace, double axial) {
  return fmax(0, (4 * 0.5 * (trace - axial) - axial) / 3);
}

// Effective pressure on a vessel's wall: from the stress of the given tissue or of the solid, and
// until the solid is factored from the half space under the equivalent rectangle.
static double pressure_on(const sonde_interior *in, const sonde_vessel_section *section,
                          const load *l) {
  if (in->tissue != NULL || (in->solid && in->live->stress_scale > 0)) {
    sonde_mat3 s;
    if (!sonde_interior_stress(in, section->rest_m, &s)) return 0;
    double axial = -v_dot(section->axis, m_mul_v(s, section->axis));
    return effective(-(s.m[0][0] + s.m[1][1] + s.m[2][2]), axial);
  }
  sonde_vec3 d = v_sub(section->rest_m, l->centre_m);
  if (!(l->force_n > 0) || v_norm2(d) > 0.12 * 0.12) return 0;
  sonde_surface_point hit; // of the rest skin, against the beam
  double z = section->depth_m;
  if (sonde_surface_raycast(in->skin, section->rest_m, v_neg(l->beam), 0.1, &hit))
    z = v_distance(hit.point_m, section->rest_m);
  z = fmax(z, least_depth_m);
  sonde_vec3 s = sonde_rectangle_stress(l->pressure_pa, l->half_x_m, l->half_y_m, v_dot(d, l->x),
                                        v_dot(d, l->y), z);
  sonde_vec3 a =
      vec3(v_dot(section->axis, l->x), v_dot(section->axis, l->y), v_dot(section->axis, l->beam));
  double axial = a.x * a.x * s.x + a.y * a.y * s.y + a.z * a.z * s.z;
  double base = 1 + bone_rise * fmax(0, fmin(z / section->tissue_m, 1) - bone_start);
  return base * effective(s.x + s.y + s.z, axial);
}

// What a vessel holds without and with clot under a pressure over the groin's, and its radius at
// rest there over the model's, between muscles and in the fat where it lies so.
typedef struct rest_size {
  sonde_pathology held[2];
  double scale[2][2];
} rest_size;

static rest_size rest_size_of(const sonde_interior *in, uint32_t which, double raised_pa) {
  const bool artery = in->course[which].kind == SONDE_VESSEL_ARTERY;
  rest_size r = {.held = {in->pathology[which], in->pathology[which]}};
  for (int clot = 0; clot < 2; ++clot)
    r.held[clot].venous_pressure_pa += raised_pa, r.held[clot].arterial_pressure_pa += raised_pa;
  r.held[0].thrombus_fraction = 0;
  const double filled = artery ? sonde_artery_rest_scale(&r.held[0]) : 1;
  for (int fat = 0; fat < 2; ++fat) {
    if (!in->course[which].lies[fat]) continue;
    r.scale[0][fat] = artery ? filled : sonde_vein_rest_scale(&r.held[0], false, fat);
    r.scale[1][fat] = artery || !(r.held[1].thrombus_fraction > 0)
                          ? r.scale[0][fat]
                          : sonde_vein_rest_scale(&r.held[1], true, fat);
  }
  return r;
}

// Areas follow the pressures with the time constant of emptying; directions follow the middles.
static void update_vessel(sonde_interior *in, uint32_t which, const load *l,
                          const sonde_interior_input *input) {
  const bool artery = in->course[which].kind == SONDE_VESSEL_ARTERY;
  const sonde_pathology *all = &in->pathology[which];
  const uint32_t count = in->course[which].count;
  sonde_vessel_state *state = in->state[which];
  if (count == 0) return;
  // Sizes at the lowest and the highest pressure along the vessel; between them they are taken to
  // change evenly.
  double low_pa = INFINITY, high_pa = -INFINITY, blend = 1;
  for (uint32_t i = 0; i < count; ++i) {
    double p = sonde_hydrostatic_pressure(in, input->posture, in->course[which].kind,
                                          in->section[which][i].rest_m);
    low_pa = fmin(low_pa, p), high_pa = fmax(high_pa, p);
  }
  const rest_size low = rest_size_of(in, which, low_pa);
  const rest_size high = high_pa > low_pa ? rest_size_of(in, which, high_pa) : low;
  // Beyond the window's ends the solid is at rest.
  const double from = in->solid ? in->live->grid.s[0] : -INFINITY,
               to = in->solid ? in->live->grid.s[SONDE_WINDOW_S - 1] : INFINITY;
  if (!(input->dt_s < 0) && in->ready) blend = 1 - exp(-input->dt_s / relaxation_s);
  for (uint32_t i = 0; i < count; ++i) {
    const sonde_vessel_section *section = &in->section[which][i];
    sonde_vessel_state *v = &state[i];
    const bool clot = !artery && sonde_pathology_clot(all, section->rest_m.z);
    const bool within = section->s_m >= from && section->s_m <= to;
    double half_short, half_long, goal = 1; // most sections, most of the time
    sonde_pathology held[2] = {low.held[0], low.held[1]};
    double scale = low.scale[clot][section->in_fat];
    if (high_pa > low_pa) {
      double p =
          sonde_hydrostatic_pressure(in, input->posture, in->course[which].kind, section->rest_m) -
          low_pa;
      held[clot].venous_pressure_pa += p, held[clot].arterial_pressure_pa += p;
      scale += p / (high_pa - low_pa) * (high.scale[clot][section->in_fat] - scale);
    }
    v->outside_pa = (within ? pressure_on(in, section, l) : 0) + input->cuff_pa;
    if (artery)
      goal = sonde_artery_area_ratio(&held[clot], v->outside_pa);
    else if (v->outside_pa > 0 || clot)
      goal = sonde_vein_area_in(&held[clot], v->outside_pa, section->in_fat);
    v->area_ratio = fmax(v->area_ratio + (goal - v->area_ratio) * blend, least_ratio);
    // A mouth is a hole in the wall of the vein that it opens into: it closes with it, but for
    // clot.
    if (section->opens_into < which) {
      const double parent = in->state[section->opens_into][section->opens_at].area_ratio;
      v->area_ratio = fmin(v->area_ratio, fmax(parent, held[clot].thrombus_fraction));
    }
    double engaged = fmax(fabs(1 - v->area_ratio) / sonde_engaged_loss, v->outside_pa / engaged_pa);
    v->coupling = section->coupling * clamp(engaged, 0, 1);
    v->rest_radius_m = section->radius_m * scale;
    sonde_vessel_shape(in->course[which].kind, &held[clot], clot, v->area_ratio, &half_short,
                       &half_long);
    v->half_short_m = half_short * v->rest_radius_m;
    v->half_long_m = half_long * v->rest_radius_m;
    v->rest_centre_m = section->rest_m;
    v->centre_m = section->rest_m;
    if (within) v->centre_m = v_add(section->rest_m, sonde_interior_field(in, section->rest_m));
  }
  // A vessel leans away from its course at rest by so much at most: its cross-sections stay apart.
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t a = i > 0 ? i - 1 : 0, b = i + 1 < count ? i + 1 : i;
    const sonde_vec3 rest = in->section[which][i].axis;
    sonde_vec3 axis = v_unit(v_sub(state[b].centre_m, state[a].centre_m), rest);
    double along = v_dot(axis, rest);
    sonde_vec3 aside = v_madd(axis, -along, rest);
    double across = v_norm(aside);
    if (!(along > 0 && across <= most_lean * fmax(along, 0)))
      axis = v_unit(v_madd(rest, most_lean / fmax(across, 1e-9), aside), rest);
    state[i].axis = axis;
    sonde_vec3 up = v_madd(v_neg(l->beam), v_dot(l->beam, axis), axis);
    if (v_norm2(up) > 1e-4) state[i].flat_axis = v_unit(up, state[i].flat_axis);
  }
}

// Gradient of the field across a vessel, over points on both sides of it, as a turn and a lower
// triangle; and how much of the bend by which the field differs from it ends at the wall. Returns
// whether the tissue may be close to folding.
static bool read_gradient(const sonde_interior *in, sonde_vessel_state *v) {
  enum { SIDES = 8 };
  v->tissue_short = v->tissue_long = v->tissue_smoothing = 1,
  v->tissue_shear = v->tissue_rotation = 0;
  if (!(v->coupling > 0)) return false;
  SONDE_ASSERT(v->rest_radius_m > 0);
  double f[2][2], most = 0, thin = INFINITY;
  sonde_vec3 side[2] = {v->flat_axis, v_cross(v->axis, v->flat_axis)};
  const double near = gradient_reach * v->rest_radius_m, far = bend_reach * v->rest_radius_m;
  for (int k = 0; k < 2; ++k) {
    sonde_vec3 low = sonde_interior_field(in, v_madd(v->rest_centre_m, -near, side[k]));
    sonde_vec3 high = sonde_interior_field(in, v_madd(v->rest_centre_m, near, side[k]));
    sonde_vec3 slope = v_scale(v_sub(high, low), 0.5 / near);
    for (int i = 0; i < 2; ++i) f[i][k] = (i == k) + v_dot(slope, side[i]);
  }
  // A wall that keeps its shape in tissue that is squeezed flat bounds the squeeze. The shear ends
  // beside the wall: its bound keeps the tissue there, which it shears unevenly, from folding.
  double least_short = v->half_short_m / (most_squeeze * v->rest_radius_m);
  double least_long = v->half_long_m / (most_squeeze * v->rest_radius_m);
  double size = hypot(f[0][0], f[0][1]);
  double half = clamp(-f[0][1] / fmax(size + f[0][0], 1e-3), -most_rotation, most_rotation);
  double whole = 2 / (1 + half * half), cosine = whole - 1, sine = half * whole;
  v->tissue_rotation = half;
  v->tissue_short = fmax(size, fmax(least_short, least_tissue));
  v->tissue_long = fmax(f[1][0] * sine + f[1][1] * cosine, fmax(least_long, least_tissue));
  double most_sheared = most_shear * v->tissue_long;
  double narrow = least_short / v->tissue_short * v->tissue_long / least_long;
  if (narrow > 1) most_sheared /= narrow;
  v->tissue_shear = clamp(f[1][0] * cosine - f[1][1] * sine, -most_sheared, most_sheared);
  // Where tissue is squeezed so thin that a bend which ends at the wall would fold it, less of the
  // bend ends there.
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
  if (most > bound) v->tissue_smoothing = bound / most;
  return fmin(v->tissue_short, v->tissue_long) < gentle_squeeze || most > gentle_bend * far;
}

// What walls do to the tissue beside a section.
typedef struct strain {
  double warped; // least volume after warping
  double smooth; // largest share of the present smoothing that surely folds nothing
} strain;

static sonde_mat3 per_step(const sonde_vec3 at[4], double step) {
  return m_scale(m_columns(v_sub(at[1], at[0]), v_sub(at[2], at[0]), v_sub(at[3], at[0])),
                 1 / step);
}

// At a rest position beside a section, by differences over a step, to both sides of the section in
// turn. The tissue's gradient without smoothing is M, smoothing adds B: no fold where e times
// the size of B stays below the least stretch under M, which is at least M's volume over the size
// of its cofactors.
static void probe_strain(const sonde_interior *in, const sonde_vessel_state *v, double section_s,
                         sonde_vec3 offset, int number, strain *least) {
  const double step = number % 2 ? probing_m : -probing_m;
  const double s = section_s + v_dot(offset, in->axis);
  const sonde_vec3 at = v_add(v->rest_centre_m, offset);
  sonde_vec3 warped[4], moved[4], smooth[4];
  sonde_vessel_state near[SONDE_VESSELS];
  uint32_t count = sonde_vessels_near(in, at, s, near);
  for (int c = 0; c < 4; ++c) {
    sonde_vec3 side = c == 1 ? in->e1 : c == 2 ? in->e2 : in->axis;
    sonde_vec3 from = c > 0 ? v_madd(at, step, side) : at;
    if (c == 3) count = sonde_vessels_near(in, from, s + step, near);
    sonde_wall_steps to = sonde_vessels_trace(in, near, count, from);
    warped[c] = to.warped_m, moved[c] = to.moved_m, smooth[c] = v_sub(to.smoothed_m, to.moved_m);
  }
  const sonde_mat3 to_world = m_transpose(m_columns(in->e1, in->e2, in->axis));
  sonde_mat3 g = m_mul(per_step(warped, step), to_world),
             m = m_mul(per_step(moved, step), to_world);
  sonde_mat3 bend = per_step(smooth, step);
  sonde_vec3 a = m_column(&g, 0), b = m_column(&g, 1), c = m_column(&g, 2);
  least->warped = fmin(least->warped, v_dot(a, v_cross(b, c)));
  a = m_column(&m, 0), b = m_column(&m, 1), c = m_column(&m, 2);
  sonde_vec3 bc = v_cross(b, c), ca = v_cross(c, a), ab = v_cross(a, b);
  double stretch = v_dot(a, bc) / sqrt(v_norm2(bc) + v_norm2(ca) + v_norm2(ab));
  a = m_column(&bend, 0), b = m_column(&bend, 1), c = m_column(&bend, 2);
  double size = sqrt(v_norm2(a) + v_norm2(b) + v_norm2(c));
  least->smooth = fmin(least->smooth, safe_share * fmax(0, stretch) / fmax(size, 1e-9));
}

static bool may_meet(const sonde_vessel_section *section, uint32_t other) {
  return other < 2 || (section->beside >> (other - 2) & 1) != 0;
}

// Where walls would fold a layer that is squeezed very thin around a section, or the tissue between
// two of them, they give way to it, and less of the bends ends at them. True when walls gave way.
static bool yield_to_folding(sonde_interior *in, uint32_t which, uint32_t i) {
  const sonde_vessel_state *v = &in->state[which][i];
  const sonde_vec3 side[2] = {v->flat_axis, v_cross(v->axis, v->flat_axis)};
  const sonde_vessel_section *section = &in->section[which][i];
  const double s = section->s_m;
  strain least = {INFINITY, INFINITY};
  for (int ring = 0; ring < RINGS; ++ring)
    for (int k = 0; k < ring_sides[ring]; ++k) {
      double a = 2 * SONDE_PI * k / ring_sides[ring], r = ring_radii[ring] * v->rest_radius_m;
      sonde_vec3 offset = v_madd(v_scale(side[0], r * cos(a)), r * sin(a), side[1]);
      probe_strain(in, v, s, offset, k, &least);
    }
  for (uint32_t other = 0; other < in->vessel_count; ++other) {
    sonde_vessel_state beside;
    if (other == which || !may_meet(section, other)) continue;
    const double along = sonde_vessel_along(in, other, v->rest_centre_m, s);
    if (!sonde_vessel_at(in, other, along, &beside)) continue;
    sonde_vec3 d = v_sub(beside.rest_centre_m, v->rest_centre_m);
    double apart = v_norm(d), gap = apart - v->rest_radius_m - beside.rest_radius_m;
    if (!(gap > 0) || gap > most_gap_radii * (v->rest_radius_m + beside.rest_radius_m)) continue;
    sonde_vec3 across = v_unit(v_cross(d, in->axis), side[1]);
    for (int k = 0; k < GAP_WAYS * GAP_SIDES; ++k) {
      double r = (v->rest_radius_m + gap * (k % GAP_WAYS + 1) / (GAP_WAYS + 1)) / apart;
      double aside = (k / GAP_WAYS - GAP_SIDES / 2) * gap_side_radii * v->rest_radius_m;
      probe_strain(in, v, s, v_madd(v_scale(d, r), aside, across), k, &least);
    }
  }
  const bool folding = least.warped < least_warped;
  in->strained[which][i] = folding; // to be looked at again
  if (!folding && least.smooth >= 1) return false;
  for (uint32_t other = 0; other < in->vessel_count; ++other) {
    uint32_t at;
    double share;
    if (other != which && !may_meet(section, other)) continue;
    const double along = sonde_vessel_along(in, other, v->rest_centre_m, s);
    if (!sonde_vessel_sections(in, other, along, &at, &share)) continue;
    sonde_vessel_state *w = &in->state[other][at + (share > 0.5)];
    SONDE_ASSERT(w->rest_radius_m > 0 && w->tissue_short > 0 && w->tissue_long > 0);
    w->tissue_smoothing *= fmin(least.smooth, 1);
    if (!folding) continue;
    // The wall leads less, and a lumen that stands up against the squeeze goes half the way to
    // where the tissue's gradient takes it.
    double with_short = w->tissue_short * w->rest_radius_m;
    double with_long = w->tissue_long * w->rest_radius_m;
    w->coupling *= 0.5;
    if (w->half_short_m <= with_short) continue;
    w->half_short_m += 0.5 * (with_short - w->half_short_m);
    w->half_long_m += 0.5 * (with_long - w->half_long_m);
  }
  return folding;
}

// Bounds a section's shares by those of its neighbour.
static void bound_by_neighbour(sonde_interior *in, uint32_t which, uint32_t i, uint32_t from) {
  sonde_vessel_state *v = &in->state[which][i];
  const sonde_vessel_state *w = &in->state[which][from];
  const double most = in->section[which][i].coupling, beside = in->section[which][from].coupling;
  v->tissue_smoothing = fmin(v->tissue_smoothing, w->tissue_smoothing + smoothing_step);
  if (beside > 0)
    v->coupling = fmin(v->coupling, most * fmin(1, w->coupling / beside + coupling_step));
}

void sonde_interior_vessels(sonde_interior *in, const sonde_interior_input *input) {
  load l = measure_load(in->model, input);
  const sonde_vessel_course *course = in->course;
  for (uint32_t which = 0; which < in->vessel_count; ++which) update_vessel(in, which, &l, input);
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    for (uint32_t i = 0; i < course[which].count; ++i) {
      sonde_vessel_state *v = &in->state[which][i];
      if (in->vessels_only) v->coupling = 0; // no tissue follows the walls
      in->strained[which][i] = read_gradient(in, v);
    }
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    for (uint32_t i = 0; i < course[which].count; ++i) {
      // Two vessels side by side leave tissue between them: towards the other a lumen takes a share
      // of the gap at rest, as the tissue's gradient stretches it, and is as much larger across;
      // its area stays.
      sonde_vessel_state *v = &in->state[which][i], beside;
      for (uint32_t other = 0; other < in->vessel_count && v->coupling > 0; ++other) {
        const sonde_vessel_section *section = &in->section[which][i];
        if (other == which || !may_meet(section, other)) continue;
        const double along = sonde_vessel_along(in, other, v->rest_centre_m, section->s_m);
        if (!sonde_vessel_at(in, other, along, &beside)) continue;
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
  bool changed = true;
  for (int pass = 0; pass < PASSES && changed; ++pass) {
    changed = false;
    for (uint32_t which = 0; which < in->vessel_count; ++which)
      for (uint32_t i = 0; i < course[which].count; ++i)
        if (in->strained[which][i] && yield_to_folding(in, which, i)) changed = true;
    for (uint32_t which = 0; which < in->vessel_count; ++which) {
      for (uint32_t i = 1; i < course[which].count; ++i) bound_by_neighbour(in, which, i, i - 1);
      for (uint32_t i = course[which].count; i-- > 1;) bound_by_neighbour(in, which, i - 1, i);
    }
  }
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    for (uint32_t i = 0; i < course[which].count; ++i) {
      sonde_vessel_state *v = &in->state[which][i];
      double thin = sonde_least_lumen * v->rest_radius_m * v->tissue_short;
      v->half_short_m = fmax(v->half_short_m, thin);
    }
}

void sonde_interior_update(sonde_interior *in, const sonde_interior_input *input) {
  SONDE_ASSERT(in != NULL && input != NULL && input->pathology != NULL);
  SONDE_ASSERT(input->tissue != NULL || (input->positions_m != NULL && input->contact_forces_n));
  SONDE_ASSERT(input->face_half_x_m > 0 && input->face_half_y_m > 0);
  sonde_findings_apply(in, input->pathology);
  in->tissue = input->tissue;
  in->solid = in->tissue == NULL && sonde_interior_follow(in, input);
  if (!in->solid && in->tissue == NULL) {
    sonde_interior_solve(in, input->positions_m);
    if (in->vessels_only)
      in->column_grid->strength = 0;
    else
      sonde_column_grid_update(in->column_grid, in, input);
  }
  sonde_interior_vessels(in, input);
  in->tick = input->tick;
  in->ready = true;
}

// ---- reading ------------------------------------------------------------------------------

const sonde_vessel_state *sonde_interior_vessel(const sonde_interior *in, int which,
                                                uint32_t *count) {
  SONDE_ASSERT(in != NULL && which >= 0 && (uint32_t)which < in->vessel_count && count != NULL);
  *count = in->course[which].count;
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
  v.tissue_rotation += t * (b->tissue_rotation - a->tissue_rotation);
  v.tissue_smoothing += t * (b->tissue_smoothing - a->tissue_smoothing);
  v.coupling += t * (b->coupling - a->coupling);
  return v;
}

bool sonde_vessel_sections(const sonde_interior *in, uint32_t which, double along, uint32_t *at,
                           double *share) {
  SONDE_ASSERT(which < in->vessel_count && at != NULL && share != NULL);
  uint32_t count = in->course[which].count;
  const sonde_vessel_section *section = in->section[which];
  if (count < 2 || along < section[0].along_m || along > section[count - 1].along_m) return false;
  double length = section[count - 1].along_m - section[0].along_m;
  double guess = (along - section[0].along_m) / length * (count - 1);
  uint32_t i = (uint32_t)fmin(floor(guess), count - 2);
  while (i > 0 && section[i].along_m > along) --i;
  while (i + 2 < count && section[i + 1].along_m < along) ++i;
  double t = (along - section[i].along_m) / (section[i + 1].along_m - section[i].along_m);
  *at = i, *share = clamp(t, 0, 1);
  return true;
}

bool sonde_vessel_at(const sonde_interior *in, uint32_t which, double along,
                     sonde_vessel_state *state) {
  SONDE_ASSERT(which < in->vessel_count);
  uint32_t i;
  double t;
  if (!sonde_vessel_sections(in, which, along, &i, &t)) return false;
  *state = blend_states(&in->state[which][i], &in->state[which][i + 1], t);
  return true;
}

bool sonde_vessel_reaches(const sonde_interior *in, uint32_t which, double along, sonde_vec3 rest,
                          double beyond_m) {
  SONDE_ASSERT(which < in->vessel_count && beyond_m >= 0);
  uint32_t i;
  double t;
  if (!sonde_vessel_sections(in, which, along, &i, &t)) return false;
  const sonde_vessel_state *a = &in->state[which][i], *b = a + 1;
  sonde_vec3 d = v_sub(rest, v_lerp(a->rest_centre_m, b->rest_centre_m, t));
  double slant = fabs(v_dot(d, a->axis)); // lies along the vessel, not beside it
  double reach = (1 + sonde_wall_reach) * fmax(a->rest_radius_m, b->rest_radius_m) + beyond_m;
  return v_norm(d) < reach + slant;
}

// Turns a point by an angle of which `half` is the tangent of the half.
static void rotate_point(double half, double *x, double *y) {
  double whole = 2 / (1 + half * half), cosine = whole - 1, sine = half * whole, x0 = *x;
  *x = cosine * x0 - sine * *y;
  *y = sine * x0 + cosine * *y;
}

// The lumen goes to the ellipse from which the tissue's gradient leads to its present one. Outside
// circles become ellipses of half axes m - c and m + c whose area is that of the circle less what
// the lumen lost; loss, c, turn and shear fade out. Both half axes grow with the circle, and a turn
// or shear that depends on it alone keeps areas: no two points meet. A lumen that is pressed flat
// keeps a line of that thickness.
void sonde_vessel_warp(const sonde_vessel_state *v, double *short_m, double *long_m) {
  SONDE_ASSERT(v->rest_radius_m > 0 && v->half_short_m > 0);
  double rest = v->rest_radius_m, x = *short_m, y = *long_m, r = sqrt(x * x + y * y);
  double t = clamp((r / rest - 1) / sonde_wall_reach, 0, 1), fade = (1 - t) * (1 - t) * (1 + 2 * t);
  double half_short = fmax(v->half_short_m / v->tissue_short, sonde_least_lumen * rest);
  double half_long = v->half_long_m / v->tissue_long;
  if (r <= rest) {
    x *= half_short / rest, y *= half_long / rest;
  } else {
    double c = 0.5 * (half_long - half_short) * fade;
    double mean = sqrt(r * r - (rest * rest - half_short * half_long) * fade + c * c);
    rotate_point(v->tissue_rotation * (1 - fade), &x, &y);
    x *= (mean - c) / r, y *= (mean + c) / r;
  }
  y -= fade * v->tissue_shear / v->tissue_long * x;
  rotate_point(-v->tissue_rotation, &x, &y);
  *short_m = x, *long_m = y;
}

void sonde_vessel_tissue(const sonde_vessel_state *v, double *short_m, double *long_m) {
  SONDE_ASSERT(v != NULL && short_m != NULL && long_m != NULL);
  double a = *short_m, b = *long_m;
  rotate_point(v->tissue_rotation, &a, &b);
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
  for (uint32_t i = 0; i + 1 < in->course[which].count; ++i) {
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
