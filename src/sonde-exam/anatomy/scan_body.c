// From scanned surfaces of a leg to the body of a limb (docs/limb_scan.md).
#include "sonde/anatomy_limb.h"

#include "anatomy/scan.h"

static const double STEP_M = 0.005; // between sections
static const double LEAST_LEG_M = 0.6, MOST_LEG_M = 1.3, LEAST_GIRTH_M = 0.28, MOST_GIRTH_M = 0.95;
static const double USUAL_SKIN_M = 0.0018;
// The ends of a scan are cut unevenly and aslant.
static const double UPPER_END_M = 0.005, LOWER_END_M = 0.01;
// A limb has the girth of its calf at level CALF, the least above its ankle at ANKLE and the mean
// of both at HALF_CALF (40 drawn limbs, standard deviation 0.004); its girths of thigh and knee are
// measured at THIGH and KNEE; a skin without a femur begins at the groin crease.
static const double CALF = 1.28, HALF_CALF = 1.594, ANKLE = 1.866, CREASE = 0.05, THIGH = 0.12,
                    KNEE = 0.88;
static const double HIGHEST_CALF_M = 0.24; // above the ankle
static const double LEAST_CALF = 1.2;      // girths of the calf over the ankle's
static const double HEAD_SHARE = 0.05;     // of the femur's length: its head lies there
static const double CONDYLES_M = 0.035;    // above the femur's lower end: its condyles lie there

typedef struct section {
  double z_m, girth_m; // below the frame's origin
  sonde_vec3 middle;   // in the frame
} section;

typedef struct leg {
  const sonde_leg_scan *scan;
  scan_frame f; // z from the hip to the knee, or along the skin's middles from its upper end
  sonde_surface_index *skin, *muscle;
  section row[SONDE_LEG_GIRTHS];
  uint32_t count;
  uint32_t calf, ankle;   // rows of the largest girth below the knee and of the least
  bool calf_shown, falls; // above the calf the girth falls towards the knee
  double hip_m, thigh_m, calf_m;
} leg;

// Turns the frame until z points down and x lies across it; of a left leg the frame is left-handed.
static void turn_z(scan_frame *f, sonde_vec3 down, bool left) {
  f->z = v_unit(down, f->z);
  f->x = v_unit(scan_across(f->x, f->z), f->x);
  f->y = v_cross(f->z, f->x);
  if (left) f->y = v_neg(f->y);
}

// Lays the frame from the hip's centre through the middle of the condyles; the thigh ends where the
// condyles end.
static sonde_status begin_at_hip(leg *l, double *head_m, sonde_error *error) {
  const sonde_mesh *femur = l->scan->femur;
  scan_frame *f = &l->f;
  sonde_status status = scan_femur_frame(l->scan, f, error);
  if (status) return status;
  scan_extent(femur, f);
  double radius_m = 0;
  sonde_vec3 hip, knee;
  if (!scan_slab_centre(femur, f, f->low, f->low + HEAD_SHARE * (f->high - f->low), &hip) ||
      !scan_slab_centre(femur, f, f->high - CONDYLES_M, f->high, &knee))
    return sonde_fail(error, SONDE_MESH, "the femur has no surface at its ends");
  // A sphere through the half of the head that looks away from the neck.
  const sonde_vec3 away = v_unit(v_madd(v_scale(f->x, 0.75), -0.66, f->z), f->x);
  for (int pass = 0; pass < 20; ++pass) {
    const double reach = pass < 3 ? 0.035 : 1.15 * radius_m;
    sonde_vec3 mean = vec3(0, 0, 0), b = mean;
    sonde_mat3 a = m_zero();
    uint32_t count = 0;
    double square = 0;
    for (int moments = 0; moments < 2; ++moments)
      for (uint32_t i = 0; i < femur->vertex_count; ++i) {
        const sonde_vec3 p = v_sub(femur->vertices[i], hip);
        if (v_norm(p) > reach || v_dot(p, away) < 0) continue;
        if (moments == 0) {
          mean = v_add(mean, p), ++count;
          continue;
        }
        const sonde_vec3 d = v_madd(p, -1.0 / count, mean);
        a = m_add(a, m_rank1(d, 1, 0));
        b = v_madd(b, 0.5 * v_norm2(d), d);
        square += v_norm2(d) / count;
      }
    // |p - c|^2 = r^2 in the least squares: a (c - mean) = b, by Cramer's rule.
    const sonde_vec3 x = m_column(&a, 0), y = m_column(&a, 1), z = m_column(&a, 2);
    const double volume = v_dot(x, v_cross(y, z));
    if (count < 12 || !(fabs(volume) > 0)) break;
    const sonde_vec3 c = vec3(v_dot(b, v_cross(y, z)) / volume, v_dot(x, v_cross(b, z)) / volume,
                              v_dot(x, v_cross(y, b)) / volume);
    radius_m = sqrt(square + v_norm2(c));
    hip = v_add(hip, v_madd(c, 1.0 / count, mean));
  }
  f->origin = hip;
  turn_z(f, v_sub(knee, hip), l->scan->left);
  scan_extent(femur, f);
  l->thigh_m = f->high, *head_m = 2 * radius_m;
  return SONDE_OK;
}

// Measures girths from the upper end of the skin downwards, until a section is not closed.
static void measure_girths(leg *l) {
  const sonde_mesh *skin = l->scan->skin;
  l->count = 0;
  scan_extent(skin, &l->f);
  bool inside = false;
  sonde_vec3 middle = vec3(0, 0, 0);
  for (double z_m = l->f.low + UPPER_END_M; z_m < l->f.high - LOWER_END_M; z_m += STEP_M) {
    sonde_vec3 sum = vec3(0, 0, 0);
    uint32_t near = 0;
    for (uint32_t i = 0; i < skin->vertex_count && !inside; ++i) {
      const sonde_vec3 p = scan_local(&l->f, skin->vertices[i]);
      if (fabs(p.z - z_m) < 2 * STEP_M) sum = v_add(sum, p), ++near;
    }
    if (near) middle = v_scale(sum, 1.0 / near);
    double girth_m = 0;
    bool closed = true;
    middle.z = z_m;
    for (int pass = 0; pass < 3; ++pass) closed = scan_section(l->skin, &l->f, &middle, &girth_m);
    if (closed && l->count < SONDE_LEG_GIRTHS) l->row[l->count++] = (section){z_m, girth_m, middle};
    if (inside && !closed) break;
    inside = closed;
  }
}

// Lays the frame along the middles of the skin's sections; the scan's axes say which side is where.
static sonde_status begin_at_skin(leg *l, sonde_error *error) {
  const sonde_leg_scan *scan = l->scan;
  scan_frame *f = &l->f;
  if (scan->axes == SONDE_AXES_ANY)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "without a femur the axes of the skin's coordinates must be known, expected "
                      "RAS or LPS");
  scan_patient_axes(scan, &f->x, &f->y, &f->z);
  scan_extent(scan->skin, f);
  const double length_m = f->high - f->low;
  if (length_m < LEAST_LEG_M || length_m > MOST_LEG_M)
    return sonde_fail(error, SONDE_MESH,
                      "the skin is %.3g mm long, expected a leg of %.0f to %.0f from the groin to "
                      "the ankle, or a femur",
                      length_m * 1e3, LEAST_LEG_M * 1e3, MOST_LEG_M * 1e3);
  for (int pass = 0; pass < 3; ++pass) {
    measure_girths(l);
    if (l->count < 80) break;
    const sonde_vec3 from = l->row[l->count / 10].middle, to = l->row[8 * l->count / 10].middle;
    const sonde_vec3 down = v_sub(scan_point(f, to), scan_point(f, from));
    f->origin = scan_point(f, from);
    turn_z(f, down, scan->left);
  }
  return SONDE_OK;
}

// Interpolates the skin's girth at a distance below the hip; NaN where no section shows it.
static double girth_at(const leg *l, double below_m) {
  const double z_m = l->hip_m + below_m;
  for (uint32_t k = 0; k + 1 < l->count; ++k) {
    const section *a = &l->row[k], *b = a + 1;
    if (z_m < a->z_m || z_m > b->z_m) continue;
    const double t = (z_m - a->z_m) / (b->z_m - a->z_m);
    return (1 - t) * a->girth_m + t * b->girth_m;
  }
  return NAN;
}

static double below_hip(const leg *l, double level) {
  return level <= 1 ? level * l->thigh_m : l->thigh_m + (level - 1) * l->calf_m;
}

// Measures the fat between skin and muscle along rays to the section's middle: the median of nine
// rays around a place, NaN where fewer than five meet both surfaces.
static double fat_at(const leg *l, double level, double angle_rad, double skin_m) {
  enum { ASIDE = 1 };
  const double aside_rad = 0.14, along_m = 0.008, most_m = 0.12, far_m = 0.25;
  double found[9];
  size_t count = 0;
  for (int i = -ASIDE; i <= ASIDE; ++i)
    for (int j = -ASIDE; j <= ASIDE; ++j) {
      const double z_m = l->hip_m + below_hip(l, level) + i * along_m;
      const double a = angle_rad + j * aside_rad;
      const sonde_vec3 out = vec3(sin(a), cos(a), 0);
      uint32_t k = 0;
      while (k + 1 < l->count && l->row[k].z_m < z_m) ++k;
      if (!l->count || fabs(l->row[k].z_m - z_m) > STEP_M) continue;
      const sonde_vec3 middle = vec3(l->row[k].middle.x, l->row[k].middle.y, z_m);
      const double r = scan_cast(l->skin, &l->f, middle, out, far_m);
      const double depth =
          scan_cast(l->muscle, &l->f, v_madd(middle, r, out), v_neg(out), most_m) - skin_m;
      size_t at = count;
      for (; isfinite(depth) && at > 0 && found[at - 1] > depth; --at) found[at] = found[at - 1];
      if (isfinite(depth)) found[at] = depth, ++count;
    }
  if (count < 5) return NAN;
  return found[count / 2];
}

// Sets a member that is not known to a measured value that lies in the parameter's range.
static void set(sonde_limb_body *body, double *member, double value) {
  uint32_t count;
  const sonde_parameter *p = sonde_limb_parameters(&count);
  for (uint32_t k = 0; k < count; ++k)
    if (sonde_parameter_of(body, &p[k]) == member && isnan(*member) && value >= p[k].low &&
        value <= p[k].high)
      *member = whole_nm(value);
}

// Finds the value of a member that is not known from which the rules, for this seed, draw the
// measured member as it was measured.
static void infer(sonde_limb_body *body, uint64_t seed, double *member, double low, double high,
                  double *measured) {
  const double wanted = *measured;
  if (!isnan(*member) || isnan(wanted)) return;
  sonde_limb_body drawn;
  sonde_status status = SONDE_OK;
  *measured = NAN;
  for (int k = 0; k < 40 && !status; ++k) {
    *member = 0.5 * (low + high);
    status = sonde_limb_draw(body, seed, &drawn, NULL);
    const double got = *(double *)((char *)&drawn + ((char *)measured - (char *)body));
    *(got < wanted ? &low : &high) = *member;
  }
  *measured = wanted;
  if (status) *member = NAN;
}

static void fill_body(const leg *l, double head_m, sonde_limb_body *body,
                      sonde_leg_girths *girths) {
  set(body, &body->thigh_length_m, l->thigh_m);
  set(body, &body->girth_thigh_m, girth_at(l, below_hip(l, THIGH)));
  set(body, &body->girth_knee_m, girth_at(l, below_hip(l, KNEE)));
  if (l->calf_shown) {
    set(body, &body->calf_length_m, l->calf_m);
    // A leg whose girth goes on rising to the knee has that of its calf at the calf's level.
    set(body, &body->girth_calf_m,
        l->falls ? l->row[l->calf].girth_m : girth_at(l, below_hip(l, CALF)));
    set(body, &body->girth_ankle_m, l->row[l->ankle].girth_m);
  }
  const struct {
    double level, turn, *member;
  } FAT[] = {{0, 0, &body->fat_groin_m},        {0.5, 0, &body->fat_front_m},
             {0.5, 0.25, &body->fat_medial_m},  {0.5, 0.5, &body->fat_back_m},
             {0.5, 0.75, &body->fat_lateral_m}, {1, 0.5, &body->fat_popliteal_m},
             {1.25, 0.5, &body->fat_calf_m},    {1.25, 0.25, &body->fat_calf_medial_m}};
  const double skin_m = isnan(body->skin_m) ? USUAL_SKIN_M : body->skin_m;
  for (size_t k = 0; l->muscle && k < SONDE_COUNT_OF(FAT); ++k)
    if (FAT[k].level <= 1 || l->calf_shown)
      set(body, FAT[k].member, fat_at(l, FAT[k].level, FAT[k].turn * 2 * SONDE_PI, skin_m));
  // The shaft is measured half-way down, the condyles by the extent of the lower end.
  const sonde_mesh *femur = l->scan->femur;
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, radius_m = 0;
  uint32_t near = 0;
  sonde_vec3 middle = vec3(0, 0, 0);
  for (int around = 0; femur && around < 2; ++around)
    for (uint32_t i = 0; i < femur->vertex_count; ++i) {
      const sonde_vec3 p = scan_local(&l->f, femur->vertices[i]);
      if (fabs(p.z - 0.5 * l->thigh_m) < STEP_M) {
        if (around)
          radius_m += hypot(p.x - middle.x / near, p.y - middle.y / near) / near;
        else
          middle = v_add(middle, p), ++near;
      }
      if (p.z < l->thigh_m - CONDYLES_M) continue;
      low[0] = fmin(low[0], p.x), high[0] = fmax(high[0], p.x);
      low[1] = fmin(low[1], p.y), high[1] = fmax(high[1], p.y);
    }
  if (femur) {
    set(body, &body->head_m, head_m);
    set(body, &body->shaft_m, near > 5 ? 2 * radius_m : NAN);
    set(body, &body->epicondylar_m, high[0] - low[0]);
    set(body, &body->condyle_m, high[1] - low[1]);
  }
  body->side = l->scan->left ? SONDE_LIMB_LEFT : SONDE_LIMB_RIGHT;
  girths->count = 0;
  for (uint32_t k = 0; k < l->count; ++k) {
    const double below_m = l->row[k].z_m - l->hip_m;
    if (below_m > l->thigh_m && !l->calf_shown) break;
    girths->level[girths->count] =
        below_m <= l->thigh_m ? below_m / l->thigh_m : 1 + (below_m - l->thigh_m) / l->calf_m;
    girths->girth_m[girths->count++] = l->row[k].girth_m;
  }
}

sonde_status sonde_leg_scan_body(const sonde_leg_scan *scan, uint64_t seed, sonde_limb_body *body,
                                 sonde_leg_girths *girths, sonde_error *error) {
  SONDE_ASSERT(scan->skin && body && girths);
  leg *l = SONDE_NEW(leg, 1);
  if (!l) return sonde_fail_memory(error);
  l->scan = scan, l->thigh_m = l->calf_m = NAN;
  double head_m = NAN;
  sonde_status status = sonde_surface_index_create(scan->skin, &l->skin, error);
  if (!status && scan->muscle) status = sonde_surface_index_create(scan->muscle, &l->muscle, error);
  if (!status) status = scan->femur ? begin_at_hip(l, &head_m, error) : begin_at_skin(l, error);
  if (!status) {
    measure_girths(l);
    uint32_t first = 0;
    while (scan->femur && first < l->count && l->row[first].z_m < l->thigh_m + 6 * STEP_M) ++first;
    // The ankle has the least girth, the heel below it is wider; going up, the girth rises to the
    // calf and mostly falls then.
    uint32_t ankle = first, k;
    for (k = first; k < l->count; ++k)
      if (l->row[k].girth_m < l->row[ankle].girth_m) ankle = k;
    const double least_m = first < l->count ? l->row[ankle].girth_m : NAN;
    bool widens = false;
    for (k = ankle; k < l->count && !widens; ++k) widens = l->row[k].girth_m > 1.02 * least_m;
    uint32_t calf = ankle;
    for (k = ankle;
         widens && k > first && !l->falls && l->row[ankle].z_m - l->row[k].z_m < HIGHEST_CALF_M;
         --k) {
      if (l->row[k].girth_m > l->row[calf].girth_m) calf = k;
      // At the ankle itself the girth wavers.
      l->falls = l->row[calf].girth_m > LEAST_CALF * least_m &&
                 l->row[k].girth_m < 0.995 * l->row[calf].girth_m;
    }
    const bool shown = widens && l->row[calf].girth_m > LEAST_CALF * least_m;
    l->calf = calf, l->ankle = ankle, l->calf_shown = shown;
    // The ankle's height is the middle of the sections whose girths are within 2 % of the least.
    uint32_t upper = ankle, lower = ankle;
    while (upper > 0 && l->row[upper - 1].girth_m < 1.02 * least_m) --upper;
    while (lower + 1 < l->count && l->row[lower + 1].girth_m < 1.02 * least_m) ++lower;
    const double ankle_m = shown ? 0.5 * (l->row[upper].z_m + l->row[lower].z_m) : NAN;
    if (shown && scan->femur) l->calf_m = (ankle_m - l->thigh_m) / (ANKLE - 1);
    if (shown && !scan->femur) {
      // Half-way from the ankle's girth to the calf's the leg is steepest, and its height surest.
      const double half_m = 0.5 * (least_m + l->row[calf].girth_m);
      for (k = ankle; l->row[k].girth_m < half_m;) --k;
      const section *above = &l->row[k], *below = above + 1;
      const double t = (above->girth_m - half_m) / (above->girth_m - below->girth_m);
      l->calf_m = (ankle_m - above->z_m - t * (below->z_m - above->z_m)) / (ANKLE - HALF_CALF);
      // A length of the thigh that is given says how far the skin reaches above the groin.
      const double knee_m = ankle_m - (ANKLE - 1) * l->calf_m;
      l->thigh_m = isnan(body->thigh_length_m) ? (knee_m - l->row[0].z_m) / (1 - CREASE)
                                               : body->thigh_length_m;
      l->hip_m = knee_m - l->thigh_m;
    }
    if (!shown && !scan->femur)
      status = sonde_fail(error, SONDE_MESH,
                          "the skin's girths show no calf above an ankle in %u closed sections, "
                          "expected a leg from the groin to below the ankle, or a femur",
                          l->count);
  }
  // Half-way down the thigh rays from the line between hip and knee, or from the section's middle,
  // meet the skin on all sides.
  double half_m = 0;
  sonde_vec3 middle = vec3(0, 0, 0.5 * l->thigh_m);
  const bool around = !status && scan->femur && scan_section(l->skin, &l->f, &middle, &half_m);
  if (!status && !scan->femur) half_m = girth_at(l, 0.5 * l->thigh_m);
  if (!status && !((around || !scan->femur) && half_m > LEAST_GIRTH_M && half_m < MOST_GIRTH_M))
    status = sonde_fail(error, SONDE_MESH,
                        "the skin's girth half-way down the thigh is %.0f mm, expected a closed "
                        "section of %.0f to %.0f around the femur",
                        half_m * 1e3, LEAST_GIRTH_M * 1e3, MOST_GIRTH_M * 1e3);
  if (!status) {
    fill_body(l, head_m, body, girths);
    infer(body, seed, &body->stature_m, 1.4, 2.1, &body->thigh_length_m);
    infer(body, seed, &body->bmi, 15, 45, &body->girth_thigh_m);
  }
  sonde_surface_index_destroy(l->skin);
  sonde_surface_index_destroy(l->muscle);
  sonde_free(l);
  return status;
}

double sonde_leg_compare(const sonde_leg_girths *girths, const sonde_limb *limb) {
  double sum = 0;
  uint32_t count = 0;
  for (uint32_t k = 0; k < girths->count; ++k) {
    if (girths->level[k] < THIGH || girths->level[k] > 1.9) continue;
    const double off = log(sonde_limb_girth(limb, girths->level[k]) / girths->girth_m[k]);
    sum += off * off, ++count;
  }
  return count ? sqrt(sum / count) : NAN;
}
