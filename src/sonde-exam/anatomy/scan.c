// From scanned surfaces of a leg to the shape of a thigh.
#include "anatomy/scan.h"
#include "anatomy/shape.h"

#include <stdlib.h>

static const double CUT_TOP = 0.09, CUT_BOTTOM = 0.80; // of the femur's length, from the head
static const double HEAD = 0.05, CONDYLES = 0.12;      // ends of the femur, of its length
static const double LEAST_HEAD_M = 0.02, LEAST_BEHIND_M = 0.004, MOST_MISSED = 0.05;
static const double LEAST_FEMUR_M = 0.25, MOST_FEMUR_M = 0.7;
// Skin alone: longest and shortest piece; from where on it is a whole leg, of which a thigh from
// the groin crease to above the knee is this share (Winter: 0.75 of 0.245 of a stature whose legs
// are 0.47 long); and what is left out below the upper end, where a scan is cut unevenly.
static const double LEAST_SKIN_M = 0.2, MOST_SKIN_M = 1.3, WHOLE_LEG_M = 0.6, THIGH_OF_LEG = 0.39;
static const double UPPER_END_M = 0.005, WIDEST_LEG_M = 0.12;
static const double REACH_M = 0.25, BONE_REACH_M = 0.07, WIDEST_BONE = 1.6; // of the shaft

// Largest principal direction of the vertices within [low, high] along the axis, by power
// iteration.
static sonde_vec3 wide_direction(const sonde_mesh *mesh, const scan_frame *f, double low,
                                 double high, bool only_across) {
  sonde_vec3 mean = vec3(0, 0, 0);
  sonde_mat3 moment = m_zero();
  uint32_t count = 0;
  for (int pass = 0; pass < 2; ++pass)
    for (uint32_t i = 0; i < mesh->vertex_count; ++i) {
      sonde_vec3 d = v_sub(mesh->vertices[i], f->origin);
      double s = v_dot(d, f->z);
      if (s < low || s > high) continue;
      if (only_across) d = scan_across(d, f->z);
      if (pass == 0)
        mean = v_add(mean, d), ++count;
      else
        moment = m_add(moment, m_rank1(v_madd(d, -1.0 / count, mean), 1, 0));
    }
  sonde_vec3 direction = vec3(0.48, 0.6, 0.64);
  for (int k = 0; k < 300; ++k) direction = v_unit(m_mul_v(moment, direction), direction);
  return direction;
}

void scan_extent(const sonde_mesh *femur, scan_frame *f) {
  SONDE_ASSERT(femur->vertex_count > 0 && v_norm2(f->z) > 0.5);
  f->low = INFINITY, f->high = -INFINITY;
  for (uint32_t i = 0; i < femur->vertex_count; ++i) {
    double s = v_dot(v_sub(femur->vertices[i], f->origin), f->z);
    f->low = fmin(f->low, s), f->high = fmax(f->high, s);
  }
}

// Mean of the femur's surface between two heights, by area.
bool scan_slab_centre(const sonde_mesh *femur, const scan_frame *f, double low, double high,
                      sonde_vec3 *centre) {
  SONDE_ASSERT(low <= high);
  double area = 0;
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t k = 0; k < femur->face_count; ++k) {
    const uint32_t *v = femur->faces[k];
    sonde_vec3 a = femur->vertices[v[0]], b = femur->vertices[v[1]], c = femur->vertices[v[2]];
    sonde_vec3 middle = v_scale(v_add(a, v_add(b, c)), 1.0 / 3);
    double s = v_dot(v_sub(middle, f->origin), f->z);
    if (s < low || s > high) continue;
    double part = v_norm(v_cross(v_sub(b, a), v_sub(c, a)));
    area += part;
    sum = v_madd(sum, part, middle);
  }
  *centre = area > 0 ? v_scale(sum, 1 / area) : sum;
  return area > 0;
}

// How far the middle of an end stands beside the shaft's line.
static sonde_vec3 end_offset(const sonde_mesh *femur, const scan_frame *f, bool far) {
  double length = f->high - f->low;
  sonde_vec3 centre;
  double low = far ? f->high - HEAD * length : f->low, high = low + HEAD * length;
  if (!scan_slab_centre(femur, f, low, high, &centre)) return vec3(0, 0, 0);
  return scan_across(v_sub(centre, f->origin), f->z);
}

// What to say about a length that lies in the range when it is taken in another unit.
static const char *unit_hint(double length_m, double low, double high) {
  if (length_m * 1e3 >= low && length_m * 1e3 <= high) return "; the numbers seem to be m, not mm";
  if (length_m * 10 >= low && length_m * 10 <= high) return "; the numbers seem to be cm, not mm";
  if (length_m * 1e-3 >= low && length_m * 1e-3 <= high)
    return "; the numbers seem to be um, not mm";
  return "";
}

// The patient's right, front and head side in the scan's coordinates; x and z of the leg in them.
void scan_patient_axes(const sonde_leg_scan *scan, sonde_vec3 *medial, sonde_vec3 *front,
                       sonde_vec3 *down) {
  SONDE_ASSERT(scan->axes != SONDE_AXES_ANY);
  double sign = scan->axes == SONDE_AXES_RAS ? 1 : -1;
  *medial = vec3(scan->left ? sign : -sign, 0, 0);
  *front = vec3(0, sign, 0);
  *down = vec3(0, 0, -1);
}

sonde_status scan_femur_frame(const sonde_leg_scan *scan, scan_frame *f, sonde_error *error) {
  // z runs along the straight line through the middles of the shaft's middle third.
  const sonde_mesh *femur = scan->femur;
  if (femur->vertex_count < 50 || femur->face_count < 50)
    return sonde_fail(error, SONDE_MESH, "the femur has %u vertices, expected a surface",
                      femur->vertex_count);
  f->origin = femur->vertices[0];
  f->z = vec3(0, 0, 1);
  f->z = wide_direction(femur, f, -INFINITY, INFINITY, false);
  for (int pass = 0; pass < 3; ++pass) {
    scan_extent(femur, f);
    double long_m = f->high - f->low;
    sonde_vec3 a, b;
    if (!scan_slab_centre(femur, f, f->low + 0.3 * long_m, f->low + 0.4 * long_m, &a) ||
        !scan_slab_centre(femur, f, f->low + 0.6 * long_m, f->low + 0.7 * long_m, &b))
      return sonde_fail(error, SONDE_MESH, "the femur has no shaft");
    f->origin = a;
    f->z = v_unit(v_sub(b, a), f->z);
  }
  scan_extent(femur, f);
  // The head stands beside the shaft, farther than the condyles do.
  sonde_vec3 head = end_offset(scan->femur, f, false), other = end_offset(scan->femur, f, true);
  if (v_norm(other) > v_norm(head)) {
    head = other;
    f->z = v_neg(f->z);
    scan_extent(scan->femur, f);
  }
  double length = f->high - f->low;
  if (!(v_norm(head) > LEAST_HEAD_M) || !(length > LEAST_FEMUR_M && length < MOST_FEMUR_M))
    return sonde_fail(error, SONDE_MESH,
                      "the femur is %.3g mm long and its head stands %.2g mm beside the shaft, "
                      "expected 250 to 700 and more than 20: a whole femur in mm%s",
                      length * 1e3, v_norm(head) * 1e3,
                      unit_hint(length, LEAST_FEMUR_M, MOST_FEMUR_M));
  sonde_vec3 wide = wide_direction(scan->femur, f, f->high - CONDYLES * length, f->high, true);
  wide = v_unit(scan_across(wide, f->z), head);
  f->x = v_dot(wide, head) < 0 ? v_neg(wide) : wide;
  f->y = v_cross(f->z, f->x);
  if (scan->left) f->y = v_neg(f->y);
  double behind = -v_dot(end_offset(femur, f, true), f->y);
  f->origin = v_madd(f->origin, f->low + CUT_TOP * length, f->z);

  // Condyles reach far behind the shaft's line and little in front of it: a mirrored leg turns
  // that.
  const char *side = scan->left ? "left" : "right", *mirrored = scan->left ? "right" : "left";
  if (behind < -LEAST_BEHIND_M)
    return sonde_fail(
        error, SONDE_MESH,
        "the femur's condyles stand %.0f mm in front of its shaft as a %s leg, expected "
        "behind: it is a %s leg, or its coordinates are mirrored",
        -behind * 1e3, side, mirrored);
  if (scan->axes == SONDE_AXES_ANY) return SONDE_OK;
  sonde_vec3 medial, front, down;
  scan_patient_axes(scan, &medial, &front, &down);
  const bool x = v_dot(f->x, medial) < -0.5, y = v_dot(f->y, front) < -0.5;
  const bool z = v_dot(f->z, down) < -0.5, ras = scan->axes == SONDE_AXES_RAS;
  if (!x && !y && !z) return SONDE_OK;
  return sonde_fail(
      error, SONDE_MESH, "the %s femur's %s the wrong way in %s coordinates: %s", side,
      z        ? "knee points"
      : x && y ? "head and back point"
      : x      ? "head points"
               : "back points",
      ras ? "RAS" : "LPS",
      z     ? "the leg stands on its head"
      : ras ? "x and y seem to run to the left and back (LPS), expected right and front"
            : "x and y seem to run to the right and front (RAS), expected left and back");
}

// Distance to the first hit from a point of the frame, NaN when there is none.
double scan_cast(const sonde_surface_index *index, const scan_frame *f, sonde_vec3 from,
                 sonde_vec3 to, double reach) {
  sonde_surface_point hit;
  sonde_vec3 origin = scan_point(f, from),
             direction = v_sub(scan_point(f, v_add(from, to)), origin);
  if (!sonde_surface_raycast(index, origin, direction, reach, &hit)) return NAN;
  return v_distance(hit.point_m, origin);
}

// Least squares through points at equal steps: value at the middle and change over the whole.
static void fit_line(const sonde_vec3 *point, int count, sonde_vec3 *mean, sonde_vec3 *slope) {
  SONDE_ASSERT(count > 1);
  double weight = 0;
  *mean = *slope = vec3(0, 0, 0);
  for (int k = 0; k < count; ++k) {
    double t = (double)k / (count - 1) - 0.5;
    *mean = v_madd(*mean, 1.0 / count, point[k]);
    *slope = v_madd(*slope, t, point[k]);
    weight += t * t;
  }
  *slope = v_scale(*slope, 1 / weight);
}

bool scan_section(const sonde_surface_index *skin, const scan_frame *f, sonde_vec3 *middle,
                  double *girth_m) {
  enum { RAYS = 72 };
  double area = 0, x = 0, y = 0, last = NAN, last_angle = 0;
  bool closed = true;
  *girth_m = 0;
  for (int k = 0; k <= RAYS; ++k) {
    double angle = 2 * SONDE_PI * k / RAYS;
    double r = scan_cast(skin, f, *middle, vec3(cos(angle), sin(angle), 0), REACH_M);
    closed &= isfinite(r);
    if (isfinite(last) && isfinite(r)) { // triangle of the middle and two skin points
      double ax = last * cos(last_angle), ay = last * sin(last_angle);
      double bx = r * cos(angle), by = r * sin(angle);
      double part = 0.5 * last * r * sin(angle - last_angle);
      area += part;
      x += part * (ax + bx) / 3;
      y += part * (ay + by) / 3;
      *girth_m += hypot(bx - ax, by - ay);
    }
    last = r, last_angle = angle;
  }
  if (area > 0) *middle = v_add(*middle, vec3(x / area, y / area, 0));
  return closed;
}

// The straight line through the middles of the skin's sections.
static void centre_line(const sonde_surface_index *skin, const scan_frame *f, sonde_tube *tube) {
  enum { ROWS = 21, PASSES = 4 };
  sonde_vec3 middle[ROWS], mean, slope;
  double girth_m;
  SONDE_ASSERT(tube->length_m > 0);
  for (int n = 0; n < ROWS; ++n) {
    middle[n] = vec3(0, 0, (0.02 + 0.96 * n / (ROWS - 1)) * tube->length_m);
    for (int pass = 0; pass < PASSES; ++pass) scan_section(skin, f, &middle[n], &girth_m);
  }
  fit_line(middle, ROWS, &mean, &slope);
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j) {
    double t = (double)j / (SONDE_TUBE_ROWS - 1) - 0.5;
    tube->x_m[j] = whole_nm(mean.x + t * slope.x);
    tube->y_m[j] = whole_nm(mean.y + t * slope.y);
  }
}

// Turns the frame until z runs along a direction of the frame, and moves its origin.
static void turn(scan_frame *f, sonde_vec3 along, sonde_vec3 origin) {
  sonde_vec3 z = v_unit(along, vec3(0, 0, 1));
  sonde_vec3 x = v_unit(scan_across(vec3(1, 0, 0), z), vec3(1, 0, 0)), y = v_cross(z, x);
  scan_frame old = *f;
  f->origin = scan_point(&old, origin);
  f->x = v_sub(scan_point(&old, x), old.origin);
  f->y = v_sub(scan_point(&old, y), old.origin);
  f->z = v_sub(scan_point(&old, z), old.origin);
}

// Frame and length of a thigh that begins at the upper end of the skin.
static sonde_status skin_frame(const sonde_leg_scan *scan, const sonde_surface_index *index,
                               const sonde_thigh *thigh, sonde_tube *tube, scan_frame *f,
                               sonde_error *error) {
  if (scan->axes == SONDE_AXES_ANY)
    return sonde_fail(
        error, SONDE_ARGUMENT,
        "without a femur the axes of the skin's coordinates must be known, expected RAS "
        "or LPS");
  scan_patient_axes(scan, &f->x, &f->y, &f->z);
  f->origin = scan->skin->vertices[0];
  scan_extent(scan->skin, f);
  double high = f->high - f->low;
  if (!(high >= LEAST_SKIN_M && high <= MOST_SKIN_M))
    return sonde_fail(error, SONDE_MESH, "the skin is %.3g mm high, expected %.0f to %.0f%s",
                      high * 1e3, LEAST_SKIN_M * 1e3, MOST_SKIN_M * 1e3,
                      unit_hint(high, LEAST_SKIN_M, MOST_SKIN_M));
  double length = scan->length_m > 0   ? scan->length_m
                  : high > WHOLE_LEG_M ? THIGH_OF_LEG * high
                                       : thigh->length_m;
  tube->length_m = whole_nm(length);

  // The origin begins in the middle of the upper part.
  sonde_vec3 sum = vec3(0, 0, 0);
  uint32_t count = 0;
  for (uint32_t i = 0; i < scan->skin->vertex_count; ++i) {
    sonde_vec3 d = v_sub(scan->skin->vertices[i], f->origin);
    if (v_dot(d, f->z) > f->low + length) continue;
    sum = v_add(sum, d), ++count;
  }
  const sonde_vec3 upright = f->z;
  sonde_vec3 middle = scan_across(v_scale(sum, 1.0 / (count > 0 ? count : 1)), upright);
  f->origin = v_madd(v_add(f->origin, middle), f->low + UPPER_END_M, upright);
  for (int pass = 0; pass < 3; ++pass) {
    // z runs beside the middles of the sections by the slope that the femur has against them.
    const uint32_t last = SONDE_TUBE_ROWS - 1;
    const double swing = sonde_shape_swing(thigh);
    centre_line(index, f, tube);
    sonde_vec3 from = vec3(tube->x_m[0] - 0.5 * swing, tube->y_m[0], 0);
    sonde_vec3 to = vec3(tube->x_m[last] + 0.5 * swing, tube->y_m[last], length);
    turn(f, v_sub(to, from), from);

    // The upper end of a leg that leans slants: it begins as far above the end of the axis on one
    // side as it ends below it on the other. An open end is taken to lie across the patient.
    scan_extent(scan->skin, f);
    double slant = v_norm(scan_across(upright, f->z)) * WIDEST_LEG_M;
    double up = scan_cast(index, f, vec3(0, 0, 0.5 * length), vec3(0, 0, -1), high);
    if (isfinite(up)) slant = fmin(slant, 0.5 * length - up - f->low);
    double start = f->low + 2 * fmax(slant, 0) + UPPER_END_M;
    f->origin = v_madd(f->origin, start, f->z);
    f->high -= start;
  }
  if (f->high >= length) return SONDE_OK;
  return sonde_fail(error, SONDE_MESH,
                    "the skin shows %.0f mm below its upper end, expected the thigh's length of "
                    "%.0f: give a length-mm that it shows",
                    f->high * 1e3, length * 1e3);
}

enum { KNOTS = 5 };

// The bone's middle at some heights, by the surface within 8 mm; straight in between and beyond.
static void bone_line(const sonde_mesh *femur, const scan_frame *f, double length,
                      sonde_vec3 knot[KNOTS]) {
  for (int k = 0; k < KNOTS; ++k) {
    double z = (0.15 + 0.2 * k) * length;
    if (!scan_slab_centre(femur, f, z - 0.008, z + 0.008, &knot[k]))
      knot[k] = k > 0 ? scan_point(f, knot[k - 1]) : f->origin;
    knot[k] = scan_local(f, knot[k]);
    knot[k].z = z;
  }
}

/* ---- tables ------------------------------------------------------------------------------- */

// Fills NaN entries from the nearest ones of the row on both sides; a row without any from the row
// before it.
static void fill_row(double *row, const double *before) {
  for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i) {
    if (isfinite(row[i])) continue;
    uint32_t a = 1, b = 1;
    const uint32_t n = SONDE_TUBE_COLUMNS;
    while (a < n && !isfinite(row[(i + n - a) % n])) ++a;
    while (b < n && !isfinite(row[(i + b) % n])) ++b;
    if (a == n)
      row[i] = before ? before[i] : 0;
    else
      row[i] = (b * row[(i + n - a) % n] + a * row[(i + b) % n]) / (a + b);
  }
}

static void fill_table(double (*table)[SONDE_TUBE_COLUMNS]) {
  uint32_t first = 0;
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j) { // a row that has something to begin with
    uint32_t i = 0;
    while (i < SONDE_TUBE_COLUMNS && !isfinite(table[j][i])) ++i;
    if (i < SONDE_TUBE_COLUMNS) {
      first = j;
      break;
    }
  }
  for (uint32_t j = first; j < SONDE_TUBE_ROWS; ++j)
    fill_row(table[j], j > first ? table[j - 1] : NULL);
  for (uint32_t j = first; j-- > 0;) fill_row(table[j], table[j + 1]);
}

static void smooth(double (*table)[SONDE_TUBE_COLUMNS], int passes) {
  double old[SONDE_TUBE_ROWS];
  const uint32_t n = SONDE_TUBE_COLUMNS, rows = SONDE_TUBE_ROWS;
  for (int pass = 0; pass < passes; ++pass) {
    for (uint32_t j = 0; j < rows; ++j) {
      double row[SONDE_TUBE_COLUMNS];
      for (uint32_t i = 0; i < n; ++i)
        row[i] = 0.25 * (table[j][(i + n - 1) % n] + 2 * table[j][i] + table[j][(i + 1) % n]);
      for (uint32_t i = 0; i < n; ++i) table[j][i] = row[i];
    }
    for (uint32_t i = 0; i < n; ++i) {
      for (uint32_t j = 0; j < rows; ++j) old[j] = table[j][i];
      for (uint32_t j = 0; j < rows; ++j)
        table[j][i] =
            whole_nm(0.25 * (old[j > 0 ? j - 1 : 0] + 2 * old[j] + old[j + 1 < rows ? j + 1 : j]));
    }
  }
}

static double row_height(double length, uint32_t row) {
  const double inset = 1e-4; // a scan may be cut flat exactly at the ends
  return clamp(length * row / (SONDE_TUBE_ROWS - 1), inset, length - inset);
}

static int by_size(const void *a, const void *b) {
  double p = *(const double *)a, q = *(const double *)b;
  return (p > q) - (p < q);
}

// Rays come from outside; head, neck and trochanter are held within 1.6 times the shaft's radius.
static void sample_femur(const sonde_leg_scan *scan, const sonde_surface_index *bone,
                         const scan_frame *f, sonde_tube *tube) {
  sonde_vec3 knot[KNOTS];
  bone_line(scan->femur, f, tube->length_m, knot);
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j) {
    double z = row_height(tube->length_m, j);
    int k = 1;
    while (k + 1 < KNOTS && knot[k].z < z) ++k;
    double t = (z - knot[k - 1].z) / (knot[k].z - knot[k - 1].z);
    sonde_vec3 middle = v_lerp(knot[k - 1], knot[k], t);
    tube->x_m[j] = whole_nm(middle.x), tube->y_m[j] = whole_nm(middle.y);
    for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i) {
      sonde_vec3 out = vec3(cos(tube_angle(i)), sin(tube_angle(i)), 0);
      sonde_vec3 from = v_madd(vec3(middle.x, middle.y, z), BONE_REACH_M, out);
      tube->radius_m[j][i] = BONE_REACH_M - scan_cast(bone, f, from, v_neg(out), BONE_REACH_M);
    }
  }
  fill_table(tube->radius_m);
  double list[SONDE_TUBE_COLUMNS];
  for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i)
    list[i] = tube->radius_m[SONDE_TUBE_ROWS / 2][i];
  qsort(list, SONDE_TUBE_COLUMNS, sizeof *list, by_size);
  double shaft = list[SONDE_TUBE_COLUMNS / 2];
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j)
    for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i)
      tube->radius_m[j][i] = clamp(tube->radius_m[j][i], 0.6 * shaft, WIDEST_BONE * shaft);
  smooth(tube->radius_m, 3);
}

/* ---- the whole ---------------------------------------------------------------------------- */

typedef struct indices {
  sonde_surface_index *skin, *femur, *muscle;
} indices;

// A vessel's part below the fascia at some heights: middle, and the diameter of the round tube that
// has its area. False when there is none.
static bool measure_vessel(const sonde_mesh *vessel, const scan_frame *f, const sonde_thigh *thigh,
                           const sonde_thigh_shape *shape, double low, double high,
                           sonde_vec3 *middle, double *diameter_m) {
  SONDE_ASSERT(low < high);
  double area = 0;
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t k = 0; vessel && k < vessel->face_count; ++k) {
    sonde_vec3 p[3], centre = vec3(0, 0, 0);
    for (int c = 0; c < 3; ++c) {
      p[c] = scan_local(f, vessel->vertices[vessel->faces[k][c]]);
      centre = v_madd(centre, 1.0 / 3, p[c]);
    }
    if (centre.z < low || centre.z > high) continue;
    double deep = -sonde_tube_outside(&shape->skin, centre);
    if (deep < thigh->skin_m + sonde_shape_fat(shape, centre)) continue;
    double part = 0.5 * v_norm(v_cross(v_sub(p[1], p[0]), v_sub(p[2], p[0])));
    area += part;
    sum = v_madd(sum, part, centre);
  }
  *middle = v_scale(sum, area > 0 ? 1 / area : 0);
  *diameter_m = area / (high - low) / SONDE_PI;
  return area > 0;
}

// The scan's own measures replace the parameters.
static void measure(const sonde_leg_scan *scan, const scan_frame *f, sonde_thigh_shape *shape,
                    sonde_thigh *thigh, sonde_leg_report *report) {
  const sonde_tube *skin = &shape->skin;
  const double length = skin->length_m, half = 0.5 * length;
  SONDE_ASSERT(length > 0);
  thigh->length_m = length;
  thigh->girth_m = sonde_tube_girth(skin, half);
  thigh->girth_proximal_m = fmax(sonde_tube_girth(skin, 0), thigh->girth_m);
  thigh->girth_distal_m = fmin(sonde_tube_girth(skin, length), thigh->girth_m);
  if (scan->femur) {
    const uint32_t middle = SONDE_TUBE_ROWS / 2;
    thigh->femur_m = whole_nm(sonde_tube_girth(&shape->femur, half) / SONDE_PI);
    thigh->femur_lateral_m = clamp(skin->x_m[0] - shape->femur.x_m[0], 0, 0.045);
    thigh->femur_anterior_m = clamp(shape->femur.y_m[middle] - skin->y_m[middle], 0, 0.025);
  }
  if (scan->muscle) {
    double *side[] = {&thigh->fat_inner_m, &thigh->fat_front_m, &thigh->fat_outer_m,
                      &thigh->fat_back_m};
    for (int k = 0; k < 4; ++k)
      *side[k] = whole_nm(
          clamp(sonde_tube_lookup(skin, shape->fat_m, 0.5 * SONDE_PI * k, half), 0.002, 0.06));
  }

  // Vein and artery below the groin; how deep the vein lies at mid-thigh.
  const double at[2][2] = {{0.01, 0.07}, {0.46, 0.54}};
  double *cover[2] = {&thigh->vein_cover_m, &thigh->canal_cover_m};
  sonde_vec3 middle;
  double diameter;
  for (int k = 0; k < 2; ++k) {
    if (!measure_vessel(scan->vein, f, thigh, shape, at[k][0] * length, at[k][1] * length, &middle,
                        &diameter) ||
        diameter < 0.004 || diameter > 0.018) // no femoral vein of these thighs: it is drawn
      continue;
    double deep = -sonde_tube_outside(&shape->skin, middle);
    double free_m = deep - sonde_shape_fat(shape, middle) - thigh->skin_m - 0.5 * diameter;
    *cover[k] = whole_nm(clamp(free_m, k ? 0.003 : 0.001, k ? 0.04 : 0.03));
    if (k > 0) continue;
    report->vein_found = true;
    thigh->vein_m = whole_nm(diameter);
    thigh->vein_angle_rad = clamp(sonde_tube_angle_of(&shape->skin, middle), 0.78, 1.57);
  }
  report->artery_found = measure_vessel(scan->artery, f, thigh, shape, at[0][0] * length,
                                        at[0][1] * length, &middle, &diameter) &&
                         diameter >= 0.003 && diameter <= 0.014;
  if (report->artery_found) thigh->artery_m = whole_nm(diameter);
}

static sonde_status sample(const sonde_leg_scan *scan, const indices *in, sonde_thigh *thigh,
                           sonde_thigh_shape *shape, sonde_leg_report *report, sonde_error *error) {
  scan_frame f = {0};
  sonde_tube *skin = &shape->skin;
  sonde_status status = scan->femur ? scan_femur_frame(scan, &f, error)
                                    : skin_frame(scan, in->skin, thigh, skin, &f, error);
  if (status) return status;
  if (scan->femur) {
    report->femur_length_m = f.high - f.low;
    skin->length_m = whole_nm((CUT_BOTTOM - CUT_TOP) * report->femur_length_m);
  }
  const double length = shape->femur.length_m = skin->length_m;
  SONDE_ASSERT(length > 0);

  // The frame rotates until z runs along the bone's middles in the thigh, x = y = 0 at their mean.
  for (int pass = 0; scan->femur && pass < 4; ++pass) {
    sonde_vec3 knot[KNOTS], mean, slope;
    bone_line(scan->femur, &f, length, knot);
    fit_line(knot, KNOTS, &mean, &slope);
    sonde_vec3 z = v_unit(slope, vec3(0, 0, 1));
    turn(&f, z, v_madd(mean, -mean.z / z.z, z));
  }

  centre_line(in->skin, &f, skin);
  for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j)
    for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i) {
      double angle = tube_angle(i), z = row_height(skin->length_m, j);
      sonde_vec3 middle = vec3(skin->x_m[j], skin->y_m[j], z);
      double r = scan_cast(in->skin, &f, middle, vec3(cos(angle), sin(angle), 0), REACH_M);
      skin->radius_m[j][i] = r;
      report->rays++;
      if (!isfinite(r)) report->missed++;
    }
  if (report->missed > MOST_MISSED * report->rays)
    return sonde_fail(error, SONDE_MESH,
                      "%u of %u rays from the middle of the thigh miss the skin, expected at most "
                      "5 %%: it must reach from the groin to the knee around the femur",
                      report->missed, report->rays);
  fill_table(skin->radius_m);
  smooth(skin->radius_m, 2);

  if (in->femur)
    sample_femur(scan, in->femur, &f, &shape->femur);
  else
    sonde_shape_place_femur(thigh, shape);
  sonde_shape_fill_fat(thigh, shape);
  if (in->muscle) {
    for (uint32_t j = 0; j < SONDE_TUBE_ROWS; ++j)
      for (uint32_t i = 0; i < SONDE_TUBE_COLUMNS; ++i) {
        double angle = tube_angle(i), z = row_height(length, j);
        sonde_vec3 inward = v_neg(sonde_tube_normal(skin, angle, z));
        double depth = scan_cast(in->muscle, &f, sonde_tube_point(skin, angle, z), inward, 0.06);
        shape->fat_m[j][i] = isfinite(depth) ? fmax(depth - thigh->skin_m, 0.002) : NAN;
      }
    fill_table(shape->fat_m);
    smooth(shape->fat_m, 12);
  }

  measure(scan, &f, shape, thigh, report);
  return sonde_thigh_check(thigh, error);
}

sonde_status sonde_thigh_shape_scan(const sonde_leg_scan *scan, sonde_thigh *thigh,
                                    sonde_thigh_shape **out, sonde_leg_report *report,
                                    sonde_error *error) {
  SONDE_ASSERT(scan->skin && thigh && report);
  *out = NULL;
  *report = (sonde_leg_report){0};
  indices in = {0};
  sonde_thigh_shape *shape = SONDE_NEW(sonde_thigh_shape, 1);
  sonde_status status = shape ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_surface_index_create(scan->skin, &in.skin, error);
  if (!status && scan->femur) status = sonde_surface_index_create(scan->femur, &in.femur, error);
  if (!status && scan->muscle) status = sonde_surface_index_create(scan->muscle, &in.muscle, error);
  if (!status) status = sample(scan, &in, thigh, shape, report, error);
  // What is drawn beside what is measured may be too much for the leg.
  double z_m = 0, least;
  if (!status && !(scan->femur && scan->muscle) &&
      (least = sonde_shape_least_muscle(shape, thigh, &z_m)) < SONDE_LEAST_MUSCLE_M)
    status =
        sonde_fail(error, SONDE_ARGUMENT,
                   "fat-mm and femur leave %.1f mm of muscle at %.0f mm from the groin in this "
                   "leg, expected 12: less fat would do",
                   least * 1e3, z_m * 1e3);
  sonde_surface_index_destroy(in.skin);
  sonde_surface_index_destroy(in.femur);
  sonde_surface_index_destroy(in.muscle);
  if (status)
    sonde_thigh_shape_destroy(shape);
  else
    *out = shape;
  return status;
}
