// Sections of the vessels: the model's centre lines in equal pieces, ascending along the femur's
// axis.
#include "base/base.h"
#include "interior/vessels.h"

#include <string.h>

static const double spacing_m = 5e-3;
static const double artery_aside_m = 11e-3; // between the middles, when they are placed
static const double least_advance_m = 1e-3;
static const double full_gap = 0.25;     // radii of a branch
static const double least_cosine = 0.45; // to the leg's axis, of a vessel that counts along it
static const double most_filled = 1.35;  // radius of a vein under any pressure over the model's
static const double meeting_radii = 9;   // of two vessels together, over which their walls may meet
enum { CONE_STEPS = 200 };
static const double clearance_m = 1.5e-3, bump_radius_m = 20e-3;

// Length of the piece that ends at point i of a line.
static double piece_of(const sonde_vessel *line, uint32_t i) {
  return v_distance(line->point[i].centre_m, line->point[i - 1].centre_m);
}

// A vessel's own line: the leg's axis, and in a limb the middle of the narrowest cone around all
// its directions where the vessel also runs across the leg.
static void find_line(sonde_interior *in, uint32_t which, const sonde_vessel *line) {
  sonde_vessel_course *course = &in->course[which];
  double least = 1, last = 1;
  if (which < 2 || in->model->bone_axis_m == NULL) return;
  sonde_vec3 chord = v_sub(line->point[line->count - 1].centre_m, line->point[0].centre_m);
  sonde_vec3 middle = v_unit(chord, in->axis);
  const double side = v_dot(middle, in->axis) < 0 ? -1 : 1;
  for (uint32_t step = 1; step < CONE_STEPS; ++step) {
    sonde_vec3 farthest = middle;
    last = INFINITY;
    for (uint32_t i = 1; i < line->count; ++i) {
      sonde_vec3 piece = v_sub(line->point[i].centre_m, line->point[i - 1].centre_m);
      sonde_vec3 along = v_unit(piece, middle);
      if (step == 1) least = fmin(least, side * v_dot(along, in->axis));
      if (v_dot(along, middle) < last) last = v_dot(along, middle), farthest = along;
    }
    middle = v_unit(v_lerp(middle, farthest, 1.0 / (step + 1)), middle);
  }
  if (least < least_cosine && last > least) course->line = middle, course->tilted = true;
}

// Room for a vessel's sections; the femoral vessels can be laid anew.
static sonde_status make_room(sonde_interior *in, uint32_t which, uint32_t count,
                              sonde_error *error) {
  if (in->section[which] != NULL) return SONDE_OK;
  if (which < 2) count = SONDE_SECTIONS;
  in->section[which] = SONDE_NEW(sonde_vessel_section, count);
  in->state[which] = SONDE_NEW(sonde_vessel_state, count);
  in->strained[which] = SONDE_NEW(bool, count);
  bool all = in->section[which] && in->state[which] && in->strained[which];
  return all ? SONDE_OK : sonde_fail_memory(error);
}

// A branch of a thigh may leave its parent across the leg: sections that do not advance along it
// are left out.
static sonde_status resample(sonde_interior *in, uint32_t which, const sonde_vessel *line,
                             sonde_error *error) {
  sonde_vessel_course *course = &in->course[which];
  course->count = 0, course->line = in->axis, course->tilted = false;
  if (line->count < 2) return make_room(in, which, 1, error); // a leg without this vessel
  SONDE_ASSERT(line->count <= SONDE_VESSEL_POINTS);
  double length = 0;
  for (uint32_t i = 1; i < line->count; ++i) length += piece_of(line, i);
  uint32_t count = (uint32_t)fmax(2, ceil(length / spacing_m) + 1), kept = 0;
  if (count > SONDE_SECTIONS) count = SONDE_SECTIONS;
  sonde_status status = make_room(in, which, count, error);
  if (status != SONDE_OK) return status;
  find_line(in, which, line);
  sonde_vec3 chord = v_sub(line->point[line->count - 1].centre_m, line->point[0].centre_m);
  const bool backward = v_dot(chord, course->line) < 0;
  sonde_vessel_section *section = in->section[which];
  for (uint32_t i = 0; i < count; ++i) {
    double arc = length * (backward ? count - 1 - i : i) / (count - 1);
    uint32_t end = 1;
    for (; arc > piece_of(line, end) && end + 1 < line->count; ++end) arc -= piece_of(line, end);
    const sonde_vessel_point *a = &line->point[end - 1], *b = &line->point[end];
    double piece = piece_of(line, end), t = piece > 0 ? clamp(arc / piece, 0, 1) : 0;
    sonde_vessel_section one = {.rest_m = v_lerp(a->centre_m, b->centre_m, t),
                                .radius_m = a->radius_m + t * (b->radius_m - a->radius_m),
                                .depth_m = a->depth_m + t * (b->depth_m - a->depth_m),
                                .coupling = 1,
                                .beside = UINT64_MAX,
                                .opens_into = SONDE_VESSELS};
    if (!(one.radius_m > 0) || !v_finite(one.rest_m))
      return sonde_fail(error, SONDE_ARGUMENT, "vessel %u has a point without radius", which);
    sonde_column_point at;
    (void)sonde_interior_locate(in, one.rest_m, &at);
    one.s_m = at.s, one.along_m = sonde_vessel_along(in, which, one.rest_m, at.s);
    one.tissue_m = at.radius_m - at.bone_m;
    if (!(one.depth_m > 0)) one.depth_m = at.depth_m;
    double advance = kept > 0 ? one.along_m - section[kept - 1].along_m : INFINITY;
    if (which < 2 && !(advance > 0))
      return sonde_fail(error, SONDE_ARGUMENT, "vessel %u turns back along the leg", which);
    section[kept] = one;
    if (which < 2 || advance > least_advance_m) ++kept;
  }
  sonde_vec3 low = section[0].rest_m, high = low;
  for (uint32_t i = 0; i < kept; ++i) {
    uint32_t a = i > 0 ? i - 1 : 0, b = i + 1 < kept ? i + 1 : i;
    section[i].axis = v_unit(v_sub(section[b].rest_m, section[a].rest_m), course->line);
    low = v_min(low, section[i].rest_m), high = v_max(high, section[i].rest_m);
  }
  course->count = kept < 2 ? 0 : kept;
  course->middle = v_lerp(low, high, 0.5), course->ball_m = 0.5 * v_distance(low, high);
  return SONDE_OK;
}

static void rest_state(sonde_interior *in, uint32_t which) {
  for (uint32_t i = 0; i < in->course[which].count; ++i) {
    const sonde_vessel_section *section = &in->section[which][i];
    double r = section->radius_m;
    sonde_column_point at;
    (void)sonde_interior_locate(in, section->rest_m, &at);
    sonde_vec3 out = v_add(v_scale(in->e1, cos(at.theta)), v_scale(in->e2, sin(at.theta)));
    out = v_madd(out, -v_dot(out, section->axis), section->axis);
    in->state[which][i] = (sonde_vessel_state){.rest_centre_m = section->rest_m,
                                               .centre_m = section->rest_m,
                                               .axis = section->axis,
                                               .flat_axis = v_unit(out, in->e1),
                                               .rest_radius_m = r,
                                               .area_ratio = 1,
                                               .half_short_m = r,
                                               .half_long_m = r,
                                               .tissue_short = 1,
                                               .tissue_long = 1,
                                               .tissue_smoothing = 1};
  }
}

static sonde_status lay_out(sonde_interior *in, const sonde_vessel *vein,
                            const sonde_vessel *artery, sonde_error *error) {
  sonde_status status = resample(in, 0, vein, error);
  if (status == SONDE_OK) status = resample(in, 1, artery, error);
  if (status != SONDE_OK) return status;
  in->course[0].kind = SONDE_VESSEL_VEIN, in->course[1].kind = SONDE_VESSEL_ARTERY;
  in->vessel_count = 2;
  in->course[0].lies[0] = in->course[1].lies[0] = true;
  for (uint32_t which = 0; which < 2; ++which) rest_state(in, which);
  // The fascia passes above the vessels, as it does in a thigh: the fat is thinner there. The
  // clearance leaves room for a dilated vein and its wall.
  for (uint32_t k = 0; in->model->map == NULL && k < 2 * in->s_count * in->theta_count; ++k) {
    const uint32_t which = k / (in->s_count * in->theta_count);
    const uint32_t column = k % (in->s_count * in->theta_count);
    const uint32_t i = column % in->theta_count, j = column / in->theta_count;
    sonde_vessel_state v;
    sonde_column_point at;
    if (!sonde_vessel_at(in, which, in->s_first_m + in->s_step_m * j, &v)) continue;
    (void)sonde_interior_locate(in, v.rest_centre_m, &at);
    double turn = remainder(i * in->theta_step - at.theta, 2 * SONDE_PI), y = at.r * turn;
    double limit = at.depth_m - 1.2 * v.rest_radius_m - clearance_m + y * y / (2 * bump_radius_m);
    sonde_column_field *f = &in->field[column];
    limit = fmax(limit, f->fat_m);
    if (limit < f->muscle_m) f->muscle_m = (float)limit;
  }
  return SONDE_OK;
}

sonde_status sonde_sections_create(sonde_interior *in, sonde_error *error) {
  const sonde_thigh_anatomy *anatomy = in->model->anatomy;
  const struct sonde_tissue_map *map = in->model->map;
  sonde_status status = lay_out(in, &in->model->vein, &in->model->artery, error);
  uint32_t all = in->course[0].count + in->course[1].count;
  for (uint32_t b = 0; anatomy != NULL && b < anatomy->branch_count && !status; ++b) {
    const uint32_t which = in->vessel_count++;
    SONDE_ASSERT(which < SONDE_VESSELS);
    in->course[which].kind = anatomy->branch[b].kind;
    status = resample(in, which, &anatomy->branch[b].line, error);
    if (status != SONDE_OK) return status;
    all += in->course[which].count;
    if (all > SONDE_MEMORY_SECTIONS)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "the leg's vessels have more than %d sections of %g mm",
                        SONDE_MEMORY_SECTIONS, 1e3 * spacing_m);
    rest_state(in, which);
    for (uint32_t i = 0; i < in->course[which].count; ++i) {
      sonde_vessel_section *section = &in->section[which][i];
      sonde_column_point at;
      sonde_tissue_depths depths;
      (void)sonde_interior_locate(in, section->rest_m, &at);
      section->in_fat = at.depth_m < at.muscle_m;
      if (map != NULL) {
        map->depths(map->self, section->rest_m, &depths);
        section->in_fat = depths.fascia_m > 0;
      }
      // Where a branch opens into another vessel two walls would move the same tissue: there that
      // of the branch does not, and beyond it leads the more the farther the two walls are apart.
      for (uint32_t other = 0; other < which; ++other) {
        sonde_vessel_state v;
        double along = sonde_vessel_along(in, other, section->rest_m, section->s_m);
        if (!sonde_vessel_at(in, other, along, &v)) continue;
        sonde_vec3 d = v_sub(section->rest_m, v.rest_centre_m);
        d = v_madd(d, -v_dot(d, v.axis), v.axis);
        double gap = v_norm(d) - v.rest_radius_m - section->radius_m;
        section->coupling =
            fmin(section->coupling, clamp(gap / (full_gap * section->radius_m), 0, 1));
      }
      in->course[which].lies[section->in_fat] = true;
    }
    sonde_sections_find_mouths(in, which);
  }
  // Of a limb's many branches each section knows those that its wall may meet.
  for (uint32_t which = 0; which < in->vessel_count && in->model->bone_axis_m != NULL; ++which)
    for (uint32_t i = 0; i < in->course[which].count; ++i) {
      sonde_vessel_section *section = &in->section[which][i];
      section->beside = 0;
      for (uint32_t other = 2; other < in->vessel_count; ++other) {
        sonde_vessel_state v;
        double along = sonde_vessel_along(in, other, section->rest_m, section->s_m);
        if (!sonde_vessel_at(in, other, along, &v)) continue;
        double most = meeting_radii * (v.rest_radius_m + section->radius_m);
        if (v_distance(v.rest_centre_m, section->rest_m) < most)
          section->beside |= (uint64_t)1 << (other - 2);
      }
    }
  const size_t cells = (size_t)in->s_count * in->theta_count;
  if (status == SONDE_OK && in->vessel_count > 2) {
    in->reached = SONDE_NEW(uint64_t, cells);
    if (in->reached == NULL) return sonde_fail_memory(error);
    sonde_sections_mark(in);
  }
  return status;
}

void sonde_sections_mark(sonde_interior *in) {
  SONDE_ASSERT(in != NULL);
  const uint32_t n = in->theta_count;
  if (in->reached == NULL) return;
  memset(in->reached, 0, (size_t)in->s_count * n * sizeof *in->reached);
  for (uint32_t which = 2; which < in->vessel_count; ++which) {
    const sonde_vessel_section *section = in->section[which];
    double widest = most_filled;
    for (uint32_t k = 0; k < in->findings.branch_count; ++k) // of any branch: few are named
      widest = fmax(widest, most_filled * in->findings.branch[k].pathology.lumen_scale);
    for (uint32_t i = 0; i < in->course[which].count; ++i) {
      // A ball around the section: what its wall reaches in the plane across the vessel's line, and
      // half the way to its neighbours.
      const uint32_t a = i > 0 ? i - 1 : 0, b = i + 1 < in->course[which].count ? i + 1 : i;
      double cosine = fmax(v_dot(section[i].axis, in->course[which].line), 0.1);
      double reach = (1 + sonde_wall_reach) * section[i].radius_m * widest / cosine;
      reach += fmax(v_distance(section[i].rest_m, section[a].rest_m),
                    v_distance(section[i].rest_m, section[b].rest_m));
      sonde_column_point at;
      (void)sonde_interior_locate(in, section[i].rest_m, &at);
      double half = reach < at.r ? asin(reach / at.r) / in->theta_step + 1 : n;
      double middle = at.theta / in->theta_step, row = (at.s - in->s_first_m) / in->s_step_m;
      double rows = reach / in->s_step_m + 1, last = in->s_count - 1;
      uint32_t from = (uint32_t)clamp(floor(row - rows), 0, last);
      uint32_t to = (uint32_t)clamp(ceil(row + rows), 0, last);
      int32_t first = (int32_t)floor(middle - half), wide = (int32_t)fmin(ceil(2 * half) + 1, n);
      for (uint32_t j = from; j <= to; ++j)
        for (int32_t k = 0; k < wide; ++k)
          in->reached[j * n + (uint32_t)(first + k + 2 * (int32_t)n) % n] |= (uint64_t)1
                                                                             << (which - 2);
    }
  }
}

// The line keeps its course and its radii, at `depth` below the skin and turned about the femur's
// axis by `turn`.
static void move_line(const sonde_interior *in, sonde_vessel *line, double turn, double depth) {
  for (uint32_t i = 0; i < line->count; ++i) {
    sonde_column_point at;
    (void)sonde_interior_locate(in, line->point[i].centre_m, &at);
    const double theta = at.theta + turn, s = at.s;
    sonde_interior_column(in, theta, s, &at);
    double r = at.radius_m - depth / at.cosine;
    const sonde_bend bend = sonde_bend_at(in, s);
    sonde_vec3 p = v_madd(v_madd(in->origin, bend.x, in->e1), bend.y, in->e2);
    p = v_madd(p, s, in->axis);
    line->point[i].centre_m = v_madd(v_madd(p, r * cos(theta), in->e1), r * sin(theta), in->e2);
    line->point[i].depth_m = depth;
  }
}

// Angle of the line at row s.
static double angle_at(const sonde_interior *in, const sonde_vessel *line, double s) {
  double nearest = INFINITY, theta = 0;
  for (uint32_t i = 0; i < line->count; ++i) {
    sonde_column_point at;
    (void)sonde_interior_locate(in, line->point[i].centre_m, &at);
    if (fabs(at.s - s) < nearest) nearest = fabs(at.s - s), theta = at.theta;
  }
  return theta;
}

sonde_status sonde_interior_set_vein_depth(sonde_interior *in, sonde_vec3 below_m, double depth_m,
                                           sonde_error *error) {
  SONDE_ASSERT(in != NULL && v_finite(below_m));
  sonde_vessel vein = in->model->vein, artery = in->model->artery;
  sonde_column_point at;
  bool within = sonde_interior_locate(in, below_m, &at);
  double deepest = (at.radius_m - at.bone_m) * at.cosine - 8e-3;
  if (!within || vein.count < 2)
    return sonde_fail(error, SONDE_ARGUMENT, "expected a point of a leg with a vein");
  if (!(depth_m >= 8e-3) || !(depth_m <= deepest))
    return sonde_fail(error, SONDE_ARGUMENT, "vein depth %g mm, expected 8 to %.0f mm here",
                      depth_m * 1e3, deepest * 1e3);
  double side =
      artery.count >= 2
          ? remainder(angle_at(in, &artery, at.s) - angle_at(in, &vein, at.s), 2 * SONDE_PI)
          : 0;
  double beside = asin(fmin(artery_aside_m / (at.radius_m - depth_m), 0.9));
  double turn = at.theta - angle_at(in, &vein, at.s);
  move_line(in, &vein, turn, depth_m);
  move_line(in, &artery, turn + (side < 0 ? -beside : beside) - side, depth_m);
  sonde_columns_refresh(in);
  sonde_status status = lay_out(in, &vein, &artery, error);
  sonde_sections_mark(in); // no branches any more
  return status;
}
