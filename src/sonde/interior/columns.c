// The column table, built once from the rest skin and the bones: axis and radius of the bone, a
// skin point per column, the layers below it, and the factored Laplacian of the skin.
#include "base/base.h"
#include "interior/interior.h"
#include "interior/window.h"

enum { THETA_COUNT = 128, S_COUNT_MAX = 384 };

static const double row_step_m = 3e-3;
static const double end_margin_m = 2.5e-3; // rays near a cap would hit the cap
// Of a limb: what PLANE_BONE of the picture counts from, the least bone, the least tissue over it,
// and the reach of the smoothing of the bones' middle.
static const double shaft_m = 12e-3, least_bone_m = 4e-3, least_tissue_m = 2.5e-3;
static const double least_tissue_share = 0.08, bend_reach_m = 12e-3;
enum { BEND_TAPS = 8, SMOOTHINGS_AROUND = 12, SMOOTHINGS_ALONG = 3 };

static sonde_vec3 face_centre(const sonde_mesh *mesh, uint32_t f) {
  const uint32_t *v = mesh->faces[f];
  sonde_vec3 sum = v_add(v_add(mesh->vertices[v[0]], mesh->vertices[v[1]]), mesh->vertices[v[2]]);
  return v_scale(sum, 1.0 / 3);
}

static double face_area(const sonde_mesh *mesh, uint32_t f) {
  const uint32_t *v = mesh->faces[f];
  sonde_vec3 a = mesh->vertices[v[0]];
  return 0.5 * v_norm(v_cross(v_sub(mesh->vertices[v[1]], a), v_sub(mesh->vertices[v[2]], a)));
}

static sonde_status find_axis(sonde_interior *in, sonde_error *error) {
  const sonde_mesh *femur = &in->model->femur;
  double area = 0, low = INFINITY, high = -INFINITY, volume = 0;
  sonde_vec3 centre = vec3(0, 0, 0);
  for (uint32_t f = 0; f < femur->face_count; ++f) {
    centre = v_madd(centre, face_area(femur, f), face_centre(femur, f));
    area += face_area(femur, f);
  }
  if (!(area > 0)) return sonde_fail(error, SONDE_MESH, "the model's femur has no surface");
  in->origin = v_scale(centre, 1 / area);
  // Axis: the largest principal direction of the surface's second moments, by power iteration.
  sonde_mat3 moment = m_zero();
  for (uint32_t f = 0; f < femur->face_count; ++f)
    moment =
        m_add(moment, m_rank1(v_sub(face_centre(femur, f), in->origin), face_area(femur, f), 0));
  sonde_vec3 axis = v_unit(vec3(0.1, 0.1, 1), vec3(0, 0, 1));
  for (int i = 0; i < 200; ++i) axis = v_unit(m_mul_v(moment, axis), axis);
  in->axis = axis.z < 0 ? v_neg(axis) : axis;
  // Radius: of the cylinder of the femur's volume and length.
  for (uint32_t v = 0; v < femur->vertex_count; ++v) {
    double s = v_dot(v_sub(femur->vertices[v], in->origin), in->axis);
    low = fmin(low, s), high = fmax(high, s);
  }
  for (uint32_t f = 0; f < femur->face_count; ++f) {
    const uint32_t *v = femur->faces[f];
    volume += v_dot(v_sub(femur->vertices[v[0]], in->origin),
                    v_cross(v_sub(femur->vertices[v[1]], in->origin),
                            v_sub(femur->vertices[v[2]], in->origin)));
  }
  volume = fabs(volume / 6);
  if (!(high > low) || !(volume > 0))
    return sonde_fail(error, SONDE_MESH, "the model's femur encloses no volume");
  in->bone_radius_m = sqrt(volume / (SONDE_PI * (high - low)));
  sonde_vec3 across = fabs(in->axis.x) < 0.9 ? vec3(1, 0, 0) : vec3(0, 1, 0);
  in->e1 = v_unit(v_madd(across, -v_dot(across, in->axis), in->axis), across);
  in->e2 = v_cross(in->axis, in->e1);
  return SONDE_OK;
}

// Middle of a limb's bones at a height, smoothed along it; beyond the ends it goes straight on.
static sonde_vec3 middle_at(const sonde_interior *in, double s) {
  const sonde_vec3 *line = in->model->bone_axis_m;
  const uint32_t last = in->model->bone_axis_count - 1;
  if (line == NULL) return v_madd(in->origin, s, in->axis);
  sonde_vec3 sum = vec3(0, 0, 0);
  double total = 0;
  for (int tap = -BEND_TAPS; tap <= BEND_TAPS; ++tap) {
    double z = in->origin.z + s + bend_reach_m * tap / BEND_TAPS, weight = 1 + BEND_TAPS - abs(tap);
    uint32_t k = 0;
    while (k + 1 < last && line[k + 1].z < z) ++k;
    double height = line[k + 1].z - line[k].z;
    double t = height > 0 ? clamp((z - line[k].z) / height, 0, 1) : 0;
    sum = v_madd(sum, weight, v_lerp(line[k], line[k + 1], t)), total += weight;
  }
  return vec3(sum.x / total, sum.y / total, in->origin.z + s);
}

static sonde_vec3 spoke(const sonde_interior *in, double theta) {
  return v_add(v_scale(in->e1, cos(theta)), v_scale(in->e2, sin(theta)));
}

// Whether the axis is inside the skin at s, with room for the bone to all sides.
static bool holds_bone(const sonde_interior *in, double s) {
  enum { RAYS = THETA_COUNT / 2 };
  const double least = in->model->bone_axis_m ? least_bone_m + least_tissue_m : in->bone_radius_m;
  sonde_vec3 from = middle_at(in, s);
  if (!sonde_surface_inside(in->skin, from)) return false;
  for (int k = 0; k < RAYS; ++k) {
    sonde_surface_point hit;
    if (!sonde_surface_raycast(in->skin, from, spoke(in, 2 * SONDE_PI * k / RAYS), 1.0, &hit))
      return false;
    if (!(hit.distance_m > least * 1.1)) return false;
  }
  return true;
}

// The skin of a whole leg bends away from the axis of a part: only as far as the axis stays inside.
// Where the end of a bent limb is cut aslant its axis comes near to the skin within a row.
static double clip_end(const sonde_interior *in, double end) {
  double step = end < 0 ? -row_step_m : row_step_m, last = end - copysign(end_margin_m, end);
  for (double s = 0; fabs(s) < fabs(last); s += step)
    if (!holds_bone(in, s)) return in->model->bone_axis_m ? s - step : s;
  return holds_bone(in, last) ? end : last;
}

// A smoothing step of a value per column: a quarter of each neighbour's around, or along.
static void smooth_bone(sonde_interior *in, float *spare, bool around) {
  const uint32_t n = in->theta_count, count = n * in->s_count;
  for (uint32_t k = 0; k < count; ++k) spare[k] = in->bone[k].radius_m;
  for (uint32_t k = 0; k < count; ++k) {
    const uint32_t i = k % n, row = k - i;
    const uint32_t a = around ? row + (i + n - 1) % n : k >= n ? k - n : k;
    const uint32_t b = around ? row + (i + 1) % n : k + n < count ? k + n : k;
    in->bone[k].radius_m = 0.25f * (spare[a] + 2 * spare[k] + spare[b]);
  }
}

// Of a limb: the first bone that each column meets from the skin inwards, a column wider than it
// is, then smoothed: neighbours differ gently where a fibula or a patella lies before another bone.
static sonde_status cast_bones(sonde_interior *in, sonde_error *error) {
  const uint32_t n = in->theta_count, count = n * in->s_count;
  sonde_surface_index *bones = NULL;
  sonde_status status = sonde_surface_index_create(&in->model->femur, &bones, error);
  float *met = SONDE_NEW(float, count);
  if (status == SONDE_OK && met == NULL) status = sonde_fail_memory(error);
  for (uint32_t k = 0; k < count && status == SONDE_OK; ++k) {
    const sonde_column *c = &in->column[k];
    sonde_surface_point hit;
    sonde_vec3 inward = v_neg(spoke(in, k % n * in->theta_step));
    bool meets = sonde_surface_raycast(bones, c->rest_m, inward, c->radius_m, &hit);
    met[k] = (float)(meets ? c->radius_m - hit.distance_m : 0);
  }
  for (uint32_t k = 0; k < count && status == SONDE_OK; ++k) {
    const uint32_t i = k % n, row = k - i;
    in->bone[k].radius_m = fmaxf(met[k], fmaxf(met[row + (i + 1) % n], met[row + (i + n - 1) % n]));
  }
  for (int step = 0; step < SMOOTHINGS_AROUND && status == SONDE_OK; ++step) {
    smooth_bone(in, met, true);
    if (step < SMOOTHINGS_ALONG) smooth_bone(in, met, false);
  }
  for (uint32_t k = 0; k < count && status == SONDE_OK; ++k) {
    const double skin = in->column[k].radius_m;
    const double most = skin - fmax(least_tissue_m, least_tissue_share * skin);
    in->bone[k].radius_m = (float)fmin(fmax((double)in->bone[k].radius_m, least_bone_m), most);
  }
  for (uint32_t k = 0; k < count && status == SONDE_OK; ++k) {
    const uint32_t i = k % n, j = k / n, row = k - i;
    const uint32_t below = j > 0 ? k - n : k, above = j + 1 < in->s_count ? k + n : k;
    float round = in->bone[row + (i + 1) % n].radius_m - in->bone[row + (i + n - 1) % n].radius_m;
    float along = in->bone[above].radius_m - in->bone[below].radius_m;
    in->bone[k].slope_theta_m = round / (float)(2 * in->theta_step);
    in->bone[k].slope_s = along / (float)((above - below) / n * in->s_step_m);
  }
  sonde_surface_index_destroy(bones);
  sonde_free(met);
  return status;
}

static sonde_status cast_columns(sonde_interior *in, sonde_error *error) {
  const double least = in->bend ? least_bone_m + least_tissue_m : in->bone_radius_m * 1.05;
  for (uint32_t j = 0; j < in->s_count; ++j) {
    double s = in->s_first_m + in->s_step_m * j;
    for (uint32_t i = 0; i < in->theta_count; ++i) {
      sonde_column *c = &in->column[j * in->theta_count + i];
      sonde_surface_point hit;
      sonde_vec3 from = middle_at(in, s);
      if (!sonde_surface_raycast(in->skin, from, spoke(in, i * in->theta_step), 1.0, &hit))
        return sonde_fail(error, SONDE_MESH, "no skin above the femur at %.4f m, angle %.3f", s,
                          i * in->theta_step);
      for (int k = 0; k < 3; ++k) {
        c->node[k] = in->model->surface.faces[hit.face][k];
        c->weight[k] = hit.weight[k];
      }
      c->rest_m = hit.point_m;
      c->radius_m = v_distance(hit.point_m, from);
      if (!(c->radius_m > least))
        return sonde_fail(error, SONDE_MESH, "the femur reaches the skin at %.4f m", s);
    }
  }
  const uint32_t n = in->theta_count;
  for (uint32_t j = 0; j < in->s_count; ++j) {
    uint32_t below = j > 0 ? j - 1 : 0, above = j + 1 < in->s_count ? j + 1 : j;
    for (uint32_t i = 0; i < n; ++i) {
      sonde_column *c = &in->column[j * n + i];
      double next = in->column[j * n + (i + 1) % n].radius_m;
      double last = in->column[j * n + (i + n - 1) % n].radius_m;
      c->slope_theta = (next - last) / (2 * in->theta_step);
      c->slope_s = (in->column[above * n + i].radius_m - in->column[below * n + i].radius_m) /
                   ((above - below) * in->s_step_m);
      sonde_vec3 e = spoke(in, i * in->theta_step);
      c->round = v_cross(in->axis, e);
      sonde_vec3 flux = v_scale(e, c->radius_m);
      flux = v_madd(flux, -c->slope_theta, c->round);
      // The planes of a limb's rows are sheared by the slope of its bones' middle.
      sonde_bend bend = sonde_bend_at(in, in->s_first_m + in->s_step_m * j);
      sonde_vec3 lean = v_madd(v_scale(in->e1, bend.slope_x), bend.slope_y, in->e2);
      double shear = c->slope_theta * v_dot(lean, c->round) - c->radius_m * v_dot(lean, e);
      c->flux_normal = v_madd(flux, -c->radius_m * c->slope_s + shear, in->axis);
      sonde_column_field *f = &in->field[j * n + i];
      f->radius_m = (float)c->radius_m;
      f->slope_theta_m = (float)c->slope_theta;
      f->slope_s = (float)c->slope_s;
      f->cosine = (float)(c->radius_m / v_norm(c->flux_normal));
    }
  }
  return SONDE_OK;
}

static double at_column(const sonde_column *c, const double *per_node) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += c->weight[k] * per_node[c->node[k]];
  return sum;
}

static void store_layers(sonde_interior *in) {
  for (uint32_t k = 0; k < in->theta_count * in->s_count; ++k) {
    in->field[k].fat_m = (float)at_column(&in->column[k], in->model->fat_depth_m);
    in->field[k].muscle_m = (float)at_column(&in->column[k], in->model->muscle_depth_m);
  }
}

// Conductances of the edges to the next column around and along.
static double around(const sonde_interior *in, uint32_t i, uint32_t j) {
  uint32_t n = in->theta_count;
  double r = 0.5 * (in->column[j * n + i].radius_m + in->column[j * n + (i + 1) % n].radius_m);
  return in->s_step_m / (r * in->theta_step);
}
static double along(const sonde_interior *in, uint32_t i, uint32_t j) {
  uint32_t n = in->theta_count, up = j + 1 < in->s_count ? j + 1 : j;
  double r = 0.5 * (in->column[j * n + i].radius_m + in->column[up * n + i].radius_m);
  return r * in->theta_step / in->s_step_m;
}

// Rows of the matrix have ascending columns; beyond the ends the potential is zero.
static sonde_status factor_surface(sonde_interior *in, sonde_error *error) {
  SONDE_ASSERT(in->surface == NULL && in->s_count >= 4);
  sonde_status status = SONDE_OK;
  const uint32_t n = in->theta_count, count = n * in->s_count;
  uint32_t filled = 0;
  uint32_t *start = SONDE_NEW(uint32_t, count + 1),
           *column = SONDE_NEW(uint32_t, 5 * (size_t)count);
  double *value = SONDE_NEW(double, 5 * (size_t)count);
  sonde_vec3 *points = SONDE_NEW(sonde_vec3, count);
  if (!start || !column || !value || !points) {
    status = sonde_fail_memory(error);
    goto done;
  }
  for (uint32_t k = 0; k < count; ++k) {
    const uint32_t i = k % n, j = k / n, last = (i + n - 1) % n, next = (i + 1) % n;
    const double down = along(in, i, j > 0 ? j - 1 : 0), up = along(in, i, j);
    const double left = around(in, last, j), right = around(in, i, j);
    if (j > 0) column[filled] = k - n, value[filled++] = -down;
    // The circle wraps: the first column's left neighbour is the row's last, and the other way.
    if (next == 0) column[filled] = j * n, value[filled++] = -right;
    if (i > 0) column[filled] = j * n + last, value[filled++] = -left;
    column[filled] = k, value[filled++] = down + up + left + right;
    if (next > 0) column[filled] = j * n + next, value[filled++] = -right;
    if (i == 0) column[filled] = j * n + last, value[filled++] = -left;
    if (j + 1 < in->s_count) column[filled] = k + n, value[filled++] = -up;
    start[k + 1] = filled;
    points[k] = in->column[k].rest_m;
  }
  status = sonde_direct_create(count, start, column, value, points, &in->surface, error);
done:
  sonde_free(start);
  sonde_free(column);
  sonde_free(value);
  sonde_free(points);
  return status;
}

sonde_status sonde_columns_create(sonde_interior *in, sonde_error *error) {
  SONDE_ASSERT(in->model != NULL && in->skin == NULL);
  sonde_status status = sonde_surface_index_create(&in->model->surface, &in->skin, error);
  const bool limb = in->model->bone_axis_m != NULL;
  if (limb && in->model->bone_axis_count < 2)
    return sonde_fail(error, SONDE_ARGUMENT, "expected two points or more of the bones' middle");
  if (status == SONDE_OK && limb) {
    // A limb's axis is the model's z; its columns turn about the middles of the bones.
    const sonde_mesh *surface = &in->model->surface;
    double first = INFINITY, last = -INFINITY;
    for (uint32_t v = 0; v < surface->vertex_count; ++v)
      first = fmin(first, surface->vertices[v].z), last = fmax(last, surface->vertices[v].z);
    in->origin = vec3(0, 0, 0.5 * (first + last));
    in->e1 = vec3(1, 0, 0), in->e2 = vec3(0, 1, 0), in->axis = vec3(0, 0, 1);
    in->bone_radius_m = shaft_m;
  }
  if (status == SONDE_OK && !limb) status = find_axis(in, error);
  if (status != SONDE_OK) return status;
  // Rows between the ends of the skin along the femur.
  const sonde_mesh *skin = &in->model->surface;
  double low = INFINITY, high = -INFINITY;
  for (uint32_t v = 0; v < skin->vertex_count; ++v) {
    double s = v_dot(v_sub(skin->vertices[v], in->origin), in->axis);
    low = fmin(low, s), high = fmax(high, s);
  }
  low = clip_end(in, low), high = clip_end(in, high);
  if (!(high - low > 4 * end_margin_m))
    return sonde_fail(error, SONDE_MESH, "the skin is shorter than %g m along the femur",
                      4 * end_margin_m);
  double length = high - low - 2 * end_margin_m;
  uint32_t rows = (uint32_t)ceil(length / row_step_m) + 1;
  rows = rows < 4 ? 4 : rows > S_COUNT_MAX ? (uint32_t)S_COUNT_MAX : rows;
  in->s_low_m = low, in->s_high_m = high;
  in->s_first_m = low + end_margin_m;
  in->s_step_m = length / (rows - 1);
  in->s_count = rows;
  in->theta_count = THETA_COUNT;
  in->theta_step = 2 * SONDE_PI / THETA_COUNT;
  size_t count = (size_t)in->theta_count * in->s_count;
  in->column = SONDE_NEW(sonde_column, count);
  in->field = SONDE_NEW(sonde_column_field, count);
  in->potential = SONDE_NEW(double, count);
  if (!in->column || !in->field || !in->potential) return sonde_fail_memory(error);
  if (limb) {
    in->bend = SONDE_NEW(sonde_bend, in->s_count);
    in->bone = SONDE_NEW(sonde_column_bone, count);
    if (!in->bend || !in->bone) return sonde_fail_memory(error);
    for (uint32_t j = 0; j < in->s_count; ++j) {
      sonde_vec3 middle = middle_at(in, in->s_first_m + in->s_step_m * j);
      in->bend[j].x = middle.x - in->origin.x, in->bend[j].y = middle.y - in->origin.y;
    }
  }
  status = cast_columns(in, error);
  if (status == SONDE_OK && limb) status = cast_bones(in, error);
  if (status != SONDE_OK) return status;
  store_layers(in);
  return factor_surface(in, error);
}

void sonde_columns_refresh(sonde_interior *in) {
  SONDE_ASSERT(in != NULL && in->field != NULL);
  store_layers(in);
  in->live->ready = in->next->ready = in->building = in->solid = false;
  in->tissue = NULL;
  for (uint32_t k = 0; k < in->cache_count; ++k)
    if (in->cache[k]) in->cache[k]->ready = false;
}
