// The column table, built once from the rest skin and the femur: axis and radius of the bone, a
// skin point per column, the layers below it, and the factored Laplacian of the skin.
#include "base/base.h"
#include "interior/interior.h"
#include "interior/window.h"

enum { THETA_COUNT = 128, S_COUNT_MAX = 256 };

static const double row_step_m = 3e-3;
static const double end_margin_m = 2.5e-3; // rays near a cap would hit the cap

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

static sonde_vec3 spoke(const sonde_interior *in, double theta) {
  return v_add(v_scale(in->e1, cos(theta)), v_scale(in->e2, sin(theta)));
}

// Whether the axis is inside the skin at s, with room for the bone to all sides.
static bool holds_bone(const sonde_interior *in, double s) {
  enum { RAYS = THETA_COUNT / 2 };
  sonde_vec3 from = v_madd(in->origin, s, in->axis);
  if (!sonde_surface_inside(in->skin, from)) return false;
  for (int k = 0; k < RAYS; ++k) {
    sonde_surface_point hit;
    if (!sonde_surface_raycast(in->skin, from, spoke(in, 2 * SONDE_PI * k / RAYS), 1.0, &hit))
      return false;
    if (!(hit.distance_m > in->bone_radius_m * 1.1)) return false;
  }
  return true;
}

// The skin of a whole leg bends away from the axis of a part: only as far as the axis stays inside.
static double clip_end(const sonde_interior *in, double end) {
  double step = end < 0 ? -row_step_m : row_step_m, last = end - copysign(end_margin_m, end);
  for (double s = 0; fabs(s) < fabs(last); s += step)
    if (!holds_bone(in, s)) return s;
  return holds_bone(in, last) ? end : last;
}

static sonde_status cast_columns(sonde_interior *in, sonde_error *error) {
  for (uint32_t j = 0; j < in->s_count; ++j) {
    double s = in->s_first_m + in->s_step_m * j;
    for (uint32_t i = 0; i < in->theta_count; ++i) {
      sonde_column *c = &in->column[j * in->theta_count + i];
      sonde_surface_point hit;
      sonde_vec3 from = v_madd(in->origin, s, in->axis);
      if (!sonde_surface_raycast(in->skin, from, spoke(in, i * in->theta_step), 1.0, &hit))
        return sonde_fail(error, SONDE_MESH, "no skin above the femur at %.4f m, angle %.3f", s,
                          i * in->theta_step);
      for (int k = 0; k < 3; ++k) {
        c->node[k] = in->model->surface.faces[hit.face][k];
        c->weight[k] = hit.weight[k];
      }
      c->rest_m = hit.point_m;
      c->radius_m = v_distance(hit.point_m, from);
      if (!(c->radius_m > in->bone_radius_m * 1.05))
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
      c->flux_normal = v_madd(flux, -c->radius_m * c->slope_s, in->axis);
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
  if (status == SONDE_OK) status = find_axis(in, error);
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
  status = cast_columns(in, error);
  if (status != SONDE_OK) return status;
  store_layers(in);
  return factor_surface(in, error);
}

void sonde_columns_refresh(sonde_interior *in) {
  SONDE_ASSERT(in != NULL && in->field != NULL);
  store_layers(in);
  in->live->ready = in->next->ready = in->building = in->solid = false;
  for (uint32_t k = 0; k < in->cache_count; ++k)
    if (in->cache[k]) in->cache[k]->ready = false;
}
