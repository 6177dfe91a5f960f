// What lies below the skin: interface depths, leg axis, femoral vessels.
// depth_along:    depth of an interface along a node's inward normal.
// measure_layers: fat, muscle and bone depth of every node.
// place_vessels:  vein and artery as depth profiles along a line of the examined area.
#include "tissue/model.h"

#include "base/base.h"
#include "base/maths.h"

static const double SKIN_THICKNESS_M = 0.0018, FAT_DEPTH_M = 0.012;
static const double VEIN_RADIUS_M = 0.0045, ARTERY_RADIUS_M = 0.0035, VESSEL_OFFSET_M = 0.011;
static const double VEIN_DEPTH_M = 0.018; // at the central site

static double depth_along(const sonde_surface_index *index, sonde_vec3 point, sonde_vec3 inward) {
  sonde_surface_point hit;
  if (sonde_surface_raycast(index, point, inward, 0.06, &hit)) return hit.distance_m;
  return sonde_surface_closest(index, point).distance_m;
}

static sonde_status measure_interface(sonde_model *model, const sonde_mesh *mesh, double fallback,
                                      double *depth, sonde_error *error) {
  uint32_t n = model->surface.vertex_count;
  for (uint32_t i = 0; i < n; ++i) depth[i] = fallback;
  if (!mesh) return SONDE_OK;
  sonde_surface_index *index;
  sonde_status status = sonde_surface_index_create(mesh, &index, error);
  if (status) return status;
  for (uint32_t i = 0; i < n; ++i)
    depth[i] = depth_along(index, model->surface.vertices[i], v_neg(model->normal[i]));
  sonde_surface_index_destroy(index);
  return SONDE_OK;
}

// Without a bone: half the way to the other side of the body.
static sonde_status measure_body(sonde_model *model, sonde_error *error) {
  const double skip_m = 1e-4, far_m = 1;
  sonde_surface_index *index;
  sonde_status status = sonde_surface_index_create(&model->surface, &index, error);
  if (status) return status;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 in = v_neg(model->normal[i]), p = model->surface.vertices[i];
    sonde_surface_point hit;
    bool found = sonde_surface_raycast(index, v_madd(p, skip_m, in), in, far_m, &hit);
    model->bone_depth_m[i] = found ? 0.5 * (hit.distance_m + skip_m) : skip_m;
  }
  sonde_surface_index_destroy(index);
  return SONDE_OK;
}

static sonde_status measure_bone(sonde_model *model, sonde_error *error) {
  sonde_surface_index *index;
  if (!model->femur.vertex_count) return measure_body(model, error);
  sonde_status status = sonde_surface_index_create(&model->femur, &index, error);
  if (status) return status;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    model->bone_depth_m[i] = sonde_surface_closest(index, model->surface.vertices[i]).distance_m;
  sonde_surface_index_destroy(index);
  return SONDE_OK;
}

sonde_status sonde_model_measure_layers(sonde_model *model, const sonde_mesh *fat,
                                        const sonde_mesh *muscle, sonde_error *error) {
  sonde_status status = measure_interface(model, fat, SKIN_THICKNESS_M, model->fat_depth_m, error);
  if (!status) status = measure_interface(model, muscle, FAT_DEPTH_M, model->muscle_depth_m, error);
  if (!status) status = measure_bone(model, error);
  if (status) return status;
  // Order of the layers holds everywhere, also at the end faces.
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    model->fat_depth_m[i] = fmin(model->fat_depth_m[i], 0.4 * model->bone_depth_m[i]);
    model->muscle_depth_m[i] =
        clamp(model->muscle_depth_m[i], model->fat_depth_m[i], 0.9 * model->bone_depth_m[i]);
  }
  return SONDE_OK;
}

static sonde_vec3 mean_vertex(const sonde_mesh *mesh) {
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t i = 0; i < mesh->vertex_count; ++i) sum = v_add(sum, mesh->vertices[i]);
  return mesh->vertex_count ? v_scale(sum, 1.0 / mesh->vertex_count) : sum;
}

// The sites' v axes run along the leg; the line passes through the femur when there is one.
sonde_leg_axis sonde_model_axis(const sonde_model *model) {
  sonde_vec3 direction = vec3(0, 0, 0);
  for (uint32_t k = 0; k < model->site_count; ++k) direction = v_add(direction, model->sites[k].v);
  const sonde_mesh *through = model->femur.vertex_count ? &model->femur : &model->surface;
  return (sonde_leg_axis){mean_vertex(through), v_unit(direction, vec3(0, 0, 1))};
}

uint32_t sonde_model_central_site(const sonde_model *model) {
  SONDE_ASSERT(model->site_count > 0);
  sonde_vec3 middle = vec3(0, 0, 0);
  for (uint32_t k = 0; k < model->site_count; ++k)
    middle = v_madd(middle, 1.0 / model->site_count, model->sites[k].position_m);
  double nearest = INFINITY;
  for (uint32_t k = 0; k < model->site_count; ++k)
    nearest = fmin(nearest, v_distance(model->sites[k].position_m, middle));
  // Near ties go to the first site, so that the choice does not hang on rounding.
  for (uint32_t k = 0; k < model->site_count; ++k)
    if (v_distance(model->sites[k].position_m, middle) <= 1.25 * nearest) return k;
  return 0;
}

typedef struct course {
  const sonde_model *model;
  const sonde_surface_index *skin;
  sonde_leg_axis axis;
  double reference; // position of the central site along the axis
} course;

// Depth of the vein's centre below the skin: 18 mm at the central site, shallower towards the groin
// (3 mm per 100 mm), deeper towards the knee (8 mm per 100 mm): docs/interior.md.
static double vein_depth(double along) {
  return along < 0 ? fmax(VEIN_DEPTH_M + 0.03 * along, 0.012)
                   : fmin(VEIN_DEPTH_M + 0.08 * along, 0.035);
}

static sonde_vec3 smooth_normal(const sonde_model *model, const sonde_surface_point *hit) {
  const uint32_t *v = model->surface.faces[hit->face];
  sonde_vec3 n = vec3(0, 0, 0);
  for (int k = 0; k < 3; ++k) n = v_madd(n, hit->weight[k], model->normal[v[k]]);
  return v_unit(n, vec3(0, 0, 1));
}

// Skin point seen from the axis at `along` in the direction `out`, and its normal.
static bool skin_at(const course *c, double along, sonde_vec3 out, sonde_vec3 *point,
                    sonde_vec3 *normal) {
  sonde_vec3 from = v_madd(c->axis.origin, c->reference + along, c->axis.direction);
  sonde_surface_point hit;
  if (!sonde_surface_raycast(c->skin, from, out, 0.5, &hit)) return false;
  *point = hit.point_m;
  *normal = smooth_normal(c->model, &hit);
  return true;
}

static void add_station(sonde_vessel *vessel, sonde_vec3 centre, double radius, double depth) {
  if (vessel->count >= SONDE_VESSEL_POINTS) return;
  vessel->point[vessel->count++] = (sonde_vessel_point){centre, radius, depth};
}

static void trace(sonde_model *model, const course *c, sonde_vec3 out, double from, double to) {
  const double spacing = fmax(0.004, (to - from) / (SONDE_VESSEL_POINTS - 1));
  for (double along = from; along <= to + 1e-9; along += spacing) {
    sonde_vec3 skin, normal;
    if (!skin_at(c, along, out, &skin, &normal)) continue;
    double depth = vein_depth(along);
    sonde_vec3 vein = v_madd(skin, -depth, normal);
    sonde_vec3 side = v_unit(v_cross(c->axis.direction, normal), vec3(1, 0, 0));
    sonde_vec3 artery = v_madd(vein, VESSEL_OFFSET_M, side);
    add_station(&model->vein, vein, VEIN_RADIUS_M, depth);
    add_station(&model->artery, artery, ARTERY_RADIUS_M,
                sonde_surface_closest(c->skin, artery).distance_m);
  }
}

static double along_axis(const sonde_leg_axis *axis, sonde_vec3 point) {
  return v_dot(v_sub(point, axis->origin), axis->direction);
}

sonde_status sonde_model_place_vessels(sonde_model *model, bool beside_bone, sonde_error *error) {
  sonde_surface_index *skin;
  sonde_status status = sonde_surface_index_create(&model->surface, &skin, error);
  if (status) return status;
  course c = {model, skin, sonde_model_axis(model), 0};
  sonde_vec3 site = model->sites[sonde_model_central_site(model)].position_m;
  c.reference = along_axis(&c.axis, site);
  sonde_vec3 foot = v_madd(c.axis.origin, c.reference, c.axis.direction);
  sonde_vec3 out = v_unit(v_sub(site, foot), vec3(1, 0, 0));
  double low = INFINITY, high = -INFINITY, end_low = INFINITY, end_high = -INFINITY;
  for (uint32_t k = 0; k < model->site_count; ++k) {
    low = fmin(low, along_axis(&c.axis, model->sites[k].position_m));
    high = fmax(high, along_axis(&c.axis, model->sites[k].position_m));
  }
  const sonde_mesh *ends = beside_bone ? &model->femur : &model->surface;
  for (uint32_t i = 0; i < ends->vertex_count; ++i) {
    end_low = fmin(end_low, along_axis(&c.axis, ends->vertices[i]));
    end_high = fmax(end_high, along_axis(&c.axis, ends->vertices[i]));
  }
  double from = fmax(low - 0.04, end_low + 0.005), to = fmin(high + 0.04, end_high - 0.005);
  model->vein.count = model->artery.count = 0;
  trace(model, &c, out, from - c.reference, to - c.reference);
  sonde_surface_index_destroy(skin);
  if (model->vein.count < 2)
    return sonde_fail(error, SONDE_MESH, "no vessel could be placed below the sites");
  return SONDE_OK;
}
