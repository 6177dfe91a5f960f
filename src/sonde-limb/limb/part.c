// A measured subject takes its part of a limb: the body becomes as thick as the subject, and the
// nodes of the skin there get the subject's springs.
#include "limb/part.h"

#include "limb/bones.h"

enum { MOST_ROWS = 128, RAYS = 120 };
// Sections follow each other at ROW_M; the first and the last lie END_M from the subject's ends.
static const double ROW_M = 0.01, END_M = 0.012;
static const double FARTHEST_M = 0.3; // no skin is farther from a section's middle
// Springs change from the subject's to the limb's over this distance from the part's ends.
static const double BLEND_M = 0.03;
static const double LEAST_M = 0.1; // a subject is at least as long
// A body's girths of thigh and knee are measured at the levels THIGH and KNEE; a part lies between
// LOW and HIGH.
static const double THIGH = 0.12, KNEE = 0.88, LOW = -0.05, HIGH = 1.05;

typedef struct section {
  double z_m, girth_m, x_m, y_m; // centroid of the skin's line
} section;

struct limb_measured {
  const sonde_model *model;
  const limb_held *held; // the limb, or NULL
  double from_m;         // of the subject's z = 0 below the hip
  sonde_surface_index *skin;
  section row[MOST_ROWS]; // sections of the subject
  section own[MOST_ROWS]; // sections of the limb at the same heights, of a right limb at rest
  uint32_t rows;
};

// Measures the closed line that has these radii about a middle.
static section section_of(const double radius_m[RAYS], double x_m, double y_m, double z_m) {
  section s = {.z_m = z_m};
  double area = 0, sx = 0, sy = 0;
  for (int i = 0; i < RAYS; ++i) {
    const double a = 2 * SONDE_PI * i / RAYS, b = 2 * SONDE_PI * (i + 1) / RAYS;
    const double ra = radius_m[i], rb = radius_m[(i + 1) % RAYS];
    const double ax = ra * sin(a), ay = ra * cos(a), bx = rb * sin(b), by = rb * cos(b);
    const double twice = ay * bx - ax * by;
    area += twice, sx += twice * (ax + bx) / 3, sy += twice * (ay + by) / 3;
    s.girth_m += hypot(bx - ax, by - ay);
  }
  s.x_m = x_m + sx / area, s.y_m = y_m + sy / area;
  return s;
}

// Finds where a ray from a section's middle leaves the subject's skin; false when none does.
static bool find_skin(const limb_measured *m, double x_m, double y_m, double z_m, double angle_rad,
                      sonde_surface_point *hit) {
  return sonde_surface_raycast(m->skin, vec3(x_m, y_m, z_m),
                               vec3(sin(angle_rad), cos(angle_rad), 0), FARTHEST_M, hit);
}

static sonde_status measure(const sonde_limb_part *part, limb_measured *m, sonde_error *error) {
  const sonde_model *model = part->model;
  const sonde_vec3 *v = model->surface.vertices;
  double low = v[0].z, high = v[0].z;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    low = least_of(low, v[i].z), high = most_of(high, v[i].z);
  *m = (limb_measured){.model = model, .from_m = part->from_m};
  if (model->map_origin || model->kind != SONDE_TWO_LAYER || model->law.normal_exponent != 2)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "%s: expected a thigh of two layers with springs of exponent 2, as `sonde "
                      "fit` makes them",
                      model->name);
  m->rows = (uint32_t)((high - low - 2 * END_M) / ROW_M) + 1;
  if (high - low < LEAST_M || m->rows > MOST_ROWS)
    return sonde_fail(error, SONDE_ARGUMENT, "%s: is %.0f mm long, expected %.0f to %.0f",
                      model->name, 1e3 * (high - low), 1e3 * LEAST_M,
                      1e3 * (ROW_M * MOST_ROWS + 2 * END_M));
  sonde_status status = sonde_surface_index_create(&model->surface, &m->skin, error);
  double x = 0, y = 0;
  for (uint32_t k = 0; k < m->rows && !status; ++k) {
    const double z = low + END_M + k * ROW_M;
    double radius[RAYS];
    // Rays begin at the mean of the vertices near the section.
    uint32_t near = 0;
    sonde_vec3 sum = vec3(0, 0, 0);
    for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
      if (fabs(v[i].z - z) < ROW_M) sum = v_add(sum, v[i]), ++near;
    if (near) x = sum.x / near, y = sum.y / near;
    for (int i = 0; i < RAYS && !status; ++i) {
      sonde_surface_point hit;
      if (find_skin(m, x, y, z, 2 * SONDE_PI * i / RAYS, &hit))
        radius[i] = hit.distance_m;
      else
        status = sonde_fail(error, SONDE_ARGUMENT,
                            "%s: no closed section at z = %.0f mm, expected a thigh along z",
                            model->name, 1e3 * z);
    }
    if (!status) m->row[k] = section_of(radius, x, y, z);
  }
  return status;
}

static double level_of(const sonde_limb *limb, const limb_measured *m, double z_m) {
  return limb_level(limb, -(m->from_m + z_m));
}

// Finds the levels of the subject's ends on a limb, and from_m where it is not given.
static sonde_status place(const sonde_limb *limb, limb_measured *m, double level[2],
                          sonde_error *error) {
  const double first = m->row[0].z_m - END_M, last = m->row[m->rows - 1].z_m + END_M;
  const double thigh = sonde_limb_body_of(limb)->thigh_length_m;
  if (isnan(m->from_m)) m->from_m = 0.5 * (thigh - first - last);
  level[0] = level_of(limb, m, first), level[1] = level_of(limb, m, last);
  if (level[0] >= LOW && level[1] <= HIGH) return SONDE_OK;
  return sonde_fail(error, SONDE_ARGUMENT,
                    "%s: lies from level %.2f to %.2f of a thigh of %.0f mm, expected %.2f to %.2f",
                    m->model->name, level[0], level[1], 1e3 * thigh, LOW, HIGH);
}

// Interpolates a number of the subject's nodes to where a ray meets the skin.
static double at_hit(const limb_measured *m, const double *number, const sonde_surface_point *hit) {
  const uint32_t *face = m->model->surface.faces[hit->face];
  double sum = 0;
  for (int i = 0; i < 3; ++i) sum += hit->weight[i] * number[face[i]];
  return sum;
}

// Measures the subject's fat, skin and bone at the middle of the limb's thigh, or as near to it as
// the subject reaches.
static void find_layers(const sonde_limb *limb, const limb_measured *m, sonde_limb_body *found) {
  const sonde_model *model = m->model;
  const double half_m = 0.5 * sonde_limb_body_of(limb)->thigh_length_m - m->from_m;
  const uint32_t k = (uint32_t)clamp(nearbyint((half_m - m->row[0].z_m) / ROW_M), 0, m->rows - 1);
  const section *s = &m->row[k];
  double *const fat[4] = {&found->fat_front_m, &found->fat_medial_m, &found->fat_back_m,
                          &found->fat_lateral_m};
  found->skin_m = 0;
  for (int side = 0; side < 4; ++side) {
    sonde_surface_point hit;
    if (!find_skin(m, s->x_m, s->y_m, s->z_m, side * SONDE_PI / 2, &hit)) continue;
    const double skin = at_hit(m, model->fat_depth_m, &hit);
    *fat[side] = at_hit(m, model->muscle_depth_m, &hit) - skin;
    found->skin_m += 0.25 * skin;
  }
  sonde_vec3 sum = vec3(0, 0, 0);
  double radius = 0;
  uint32_t near = 0;
  for (int pass = 0; pass < 2; ++pass)
    for (uint32_t i = 0; i < model->femur.vertex_count; ++i) {
      const sonde_vec3 v = model->femur.vertices[i];
      if (fabs(v.z - s->z_m) > ROW_M) continue;
      if (pass == 0)
        sum = v_add(sum, v), ++near;
      else
        radius += hypot(v.x - sum.x / near, v.y - sum.y / near) / near;
    }
  if (near > 8) found->shaft_m = 2 * radius;
}

// Compares girths: the logarithm of the subject's over the limb's, fitted by a line of the level.
// @return its root mean square
static double compare_girths(const sonde_limb *limb, const limb_measured *m, double line[2]) {
  double n = 0, sl = 0, sll = 0, sr = 0, slr = 0, squares = 0;
  for (uint32_t k = 0; k < m->rows; ++k) {
    const double level = level_of(limb, m, m->row[k].z_m);
    const double r = log(m->row[k].girth_m / sonde_limb_girth(limb, level));
    n += 1, sl += level, sll += level * level, sr += r, slr += level * r, squares += r * r;
  }
  line[1] = (n * slr - sl * sr) / (n * sll - sl * sl);
  line[0] = (sr - line[1] * sl) / n;
  return sqrt(squares / n);
}

sonde_status sonde_limb_part_body(const sonde_limb_part *part, uint64_t seed,
                                  sonde_limb_body *known, sonde_error *error) {
  SONDE_ASSERT(part && part->model && known);
  limb_measured m;
  sonde_limb_body body, found = *known;
  sonde_limb *limb = NULL;
  double level[2], line[2];
  sonde_status status = measure(part, &m, error);
  if (!status) status = sonde_limb_draw(known, seed, &body, error);
  if (!status) status = sonde_limb_create(&body, &limb, error);
  if (!status) status = place(limb, &m, level, error);
  if (!status) {
    find_layers(limb, &m, &found);
    compare_girths(limb, &m, line);
    found.girth_thigh_m = body.girth_thigh_m * exp(line[0] + THIGH * line[1]);
    found.girth_knee_m = body.girth_knee_m * exp(line[0] + KNEE * line[1]);
    uint32_t count;
    const sonde_parameter *p = sonde_limb_parameters(&count);
    for (uint32_t k = 0; k < count; ++k) { // within what a body may have, unless it was given
      double *to = sonde_parameter_of(known, &p[k]);
      const double from = *sonde_parameter_of(&found, &p[k]);
      if (isnan(*to) && !isnan(from)) *to = clamp(from, p[k].low, p[k].high);
    }
  }
  sonde_limb_destroy(limb);
  sonde_surface_index_destroy(m.skin);
  return status;
}

sonde_status sonde_limb_part_compare(const sonde_limb_part *part, const sonde_limb *limb,
                                     sonde_limb_part_fit *fit, sonde_error *error) {
  SONDE_ASSERT(part && part->model && limb && fit);
  limb_measured m;
  double level[2], line[2];
  *fit = (sonde_limb_part_fit){0};
  sonde_status status = measure(part, &m, error);
  if (!status) status = place(limb, &m, level, error);
  if (!status) *fit = (sonde_limb_part_fit){level[0], level[1], compare_girths(limb, &m, line)};
  sonde_surface_index_destroy(m.skin);
  return status;
}

// Interpolates the middles of the subject's and of the limb's sections at a z of the subject.
static void middles(const limb_measured *m, double z_m, double subject_m[2], double limb_m[2]) {
  const double at = clamp((z_m - m->row[0].z_m) / ROW_M, 0, m->rows - 1.000001);
  const uint32_t k = (uint32_t)at;
  const double t = at - k;
  const section *s = &m->row[k], *l = &m->own[k];
  subject_m[0] = s->x_m + t * (s[1].x_m - s->x_m), subject_m[1] = s->y_m + t * (s[1].y_m - s->y_m);
  limb_m[0] = l->x_m + t * (l[1].x_m - l->x_m), limb_m[1] = l->y_m + t * (l[1].y_m - l->y_m);
}

sonde_status limb_measured_make(const limb_held *held, const sonde_limb_part *part,
                                limb_measured **out, sonde_error *error) {
  SONDE_ASSERT(held && part && part->model && out);
  double level[2];
  limb_measured *m = *out = SONDE_NEW(limb_measured, 1);
  if (!m) return sonde_fail_memory(error);
  sonde_status status = measure(part, m, error);
  m->held = held;
  if (!status) status = place(held->limb, m, level, error);
  for (uint32_t k = 0; k < m->rows && !status; ++k) {
    const double at = level_of(held->limb, m, m->row[k].z_m);
    const sonde_vec3 c = limb_centre(held->limb, at);
    double radius[RAYS];
    for (int i = 0; i < RAYS; ++i)
      radius[i] = limb_skin_radius(held->limb, at, 2 * SONDE_PI * i / RAYS);
    m->own[k] = section_of(radius, c.x, c.y, m->row[k].z_m);
  }
  return status;
}

void limb_measured_destroy(limb_measured *m) {
  if (!m) return;
  sonde_surface_index_destroy(m->skin);
  sonde_free(m);
}

void limb_measured_site(const limb_measured *m, uint32_t k, double *level, double *angle_rad) {
  SONDE_ASSERT(m && k < m->model->site_count && level && angle_rad);
  const sonde_vec3 p = m->model->sites[k].position_m;
  double from[2], to[2], reach = 0;
  middles(m, p.z, from, to);
  *level = level_of(m->held->limb, m, p.z);
  // The skin in the same direction from the limb's middle, which is not where its angles are about.
  const double direction = atan2(p.x - from[0], p.y - from[1]);
  const sonde_vec3 c = limb_centre(m->held->limb, *level);
  *angle_rad = direction;
  for (int pass = 0; pass < 20; ++pass) {
    const double x = to[0] + reach * sin(direction) - c.x, y = to[1] + reach * cos(direction) - c.y;
    *angle_rad = atan2(x, y);
    reach += limb_skin_radius(m->held->limb, *level, *angle_rad) - hypot(x, y);
  }
}

void limb_measured_springs(const limb_measured *m, sonde_model *model) {
  const limb_held *held = m->held;
  const sonde_model *from = m->model;
  const double shear = from->law.shear_stiffness_n_m / model->law.shear_stiffness_n_m;
  const double limit = from->law.shear_limit / model->law.shear_limit;
  for (uint32_t n = 0; n < model->surface.vertex_count; ++n) {
    sonde_vec3 p = sonde_limb_to_model(held->limb, model->surface.vertices[n]), rest;
    if (held->pose && sonde_limb_pose_rest(held->pose, p, &rest)) p = rest;
    p = limb_side_point(held->limb, p);
    const double z = -p.z - m->from_m;
    const double inside = least_of(z - m->row[0].z_m, m->row[m->rows - 1].z_m - z);
    if (inside <= 0) continue;
    // The subject's skin in the same direction from the middle of the section.
    double subject[2], limb[2];
    sonde_surface_point hit;
    middles(m, z, subject, limb);
    if (!find_skin(m, subject[0], subject[1], z, atan2(p.x - limb[0], p.y - limb[1]), &hit))
      continue;
    const double w = smooth_step(inside / BLEND_M);
    double *k0 = &model->k0_n_m3[n], *xm = &model->xm_m[n];
    *k0 *= pow(at_hit(m, from->k0_n_m3, &hit) / *k0, w);
    *xm *= pow(at_hit(m, from->xm_m, &hit) / *xm, w);
    *xm = least_of(*xm, model->bone_depth_m[n]);
    double *g = &model->shear_share[n], *gm = &model->limit_share[n];
    *g += w * (shear * at_hit(m, from->shear_share, &hit) - *g);
    *gm += w * (limit * at_hit(m, from->limit_share, &hit) - *gm);
  }
}
