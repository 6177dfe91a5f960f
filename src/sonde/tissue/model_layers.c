// What lies below the skin: interface depths, leg axis, femoral vessels.
#include "tissue/model.h"

#include "base/base.h"
#include "base/maths.h"

static const double SKIN_THICKNESS_M = 0.0018, FAT_DEPTH_M = 0.012;
static const double VEIN_RADIUS_M = 0.0045, ARTERY_RADIUS_M = 0.0035, VESSEL_OFFSET_M = 0.011;
static const double VEIN_DEPTH_M = 0.018; // at the central site

// Depth of an interface along each node's inward normal.
static sonde_status measure_interface(sonde_model *model, const sonde_mesh *mesh, double fallback,
                                      double *depth, sonde_error *error) {
  uint32_t n = model->surface.vertex_count;
  for (uint32_t i = 0; i < n; ++i) depth[i] = fallback;
  if (!mesh) return SONDE_OK;
  sonde_surface_index *index;
  sonde_status status = sonde_surface_index_create(mesh, &index, error);
  if (status) return status;
  for (uint32_t i = 0; i < n; ++i) {
    sonde_vec3 p = model->surface.vertices[i], in = v_neg(model->normal[i]);
    sonde_surface_point hit;
    depth[i] = sonde_surface_raycast(index, p, in, 0.06, &hit)
                   ? hit.distance_m
                   : sonde_surface_closest(index, p).distance_m;
  }
  sonde_surface_index_destroy(index);
  return SONDE_OK;
}

sonde_status sonde_model_measure_layers(sonde_model *model, const sonde_mesh *fat,
                                        const sonde_mesh *muscle, sonde_error *error) {
  SONDE_ASSERT(model && model->surface.vertex_count > 0);
  sonde_status status = measure_interface(model, fat, SKIN_THICKNESS_M, model->fat_depth_m, error);
  if (!status) status = measure_interface(model, muscle, FAT_DEPTH_M, model->muscle_depth_m, error);
  if (status) return status;

  // Distance of each node from the bone; without a bone half the path to the other side of the
  // body.
  const double skip_m = 1e-4, far_m = 1;
  bool bone = model->femur.vertex_count > 0;
  sonde_surface_index *index;
  status = sonde_surface_index_create(bone ? &model->femur : &model->surface, &index, error);
  if (status) return status;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 in = v_neg(model->normal[i]), p = model->surface.vertices[i];
    sonde_surface_point hit;
    if (bone)
      model->bone_depth_m[i] = sonde_surface_closest(index, p).distance_m;
    else if (sonde_surface_raycast(index, v_madd(p, skip_m, in), in, far_m, &hit))
      model->bone_depth_m[i] = 0.5 * (hit.distance_m + skip_m);
    else
      model->bone_depth_m[i] = skip_m;
  }
  sonde_surface_index_destroy(index);

  // Order of the layers holds everywhere, also at the end faces.
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    model->fat_depth_m[i] = fmin(model->fat_depth_m[i], 0.4 * model->bone_depth_m[i]);
    model->muscle_depth_m[i] =
        clamp(model->muscle_depth_m[i], model->fat_depth_m[i], 0.9 * model->bone_depth_m[i]);
  }
  return SONDE_OK;
}

// The sites' v axes run along the leg; the line passes through the femur when there is one.
sonde_leg_axis sonde_model_axis(const sonde_model *model) {
  sonde_vec3 direction = vec3(0, 0, 0);
  for (uint32_t k = 0; k < model->site_count; ++k) direction = v_add(direction, model->sites[k].v);
  const sonde_mesh *through = model->femur.vertex_count ? &model->femur : &model->surface;
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t i = 0; i < through->vertex_count; ++i) sum = v_add(sum, through->vertices[i]);
  if (through->vertex_count) sum = v_scale(sum, 1.0 / through->vertex_count);
  return (sonde_leg_axis){sum, v_unit(direction, vec3(0, 0, 1))};
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

static void add_point(sonde_vessel *vessel, sonde_vec3 centre, double radius, double depth) {
  SONDE_ASSERT(radius > 0 && depth >= 0);
  if (vessel->count >= SONDE_VESSEL_POINTS) return;
  vessel->point[vessel->count++] = (sonde_vessel_point){centre, radius, depth};
}

static double along_axis(const sonde_leg_axis *axis, sonde_vec3 point) {
  return v_dot(v_sub(point, axis->origin), axis->direction);
}

// Vein and artery as depth profiles below a line of the examined area.
sonde_status sonde_model_place_vessels(sonde_model *model, bool beside_bone, sonde_error *error) {
  sonde_surface_index *skin;
  sonde_status status = sonde_surface_index_create(&model->surface, &skin, error);
  if (status) return status;
  sonde_leg_axis axis = sonde_model_axis(model);
  sonde_vec3 site = model->sites[sonde_model_central_site(model)].position_m;
  double reference = along_axis(&axis, site); // of the central site
  sonde_vec3 foot = v_madd(axis.origin, reference, axis.direction);
  sonde_vec3 out = v_unit(v_sub(site, foot), vec3(1, 0, 0));

  // from 40 mm beyond the sites on one side to 40 mm on the other, within the leg
  double low = INFINITY, high = -INFINITY, end_low = INFINITY, end_high = -INFINITY;
  for (uint32_t k = 0; k < model->site_count; ++k) {
    low = fmin(low, along_axis(&axis, model->sites[k].position_m));
    high = fmax(high, along_axis(&axis, model->sites[k].position_m));
  }
  const sonde_mesh *ends = beside_bone ? &model->femur : &model->surface;
  for (uint32_t i = 0; i < ends->vertex_count; ++i) {
    end_low = fmin(end_low, along_axis(&axis, ends->vertices[i]));
    end_high = fmax(end_high, along_axis(&axis, ends->vertices[i]));
  }
  double from = fmax(low - 0.04, end_low + 0.005) - reference;
  double to = fmin(high + 0.04, end_high - 0.005) - reference;

  model->vein.count = model->artery.count = 0;
  const double spacing = fmax(0.004, (to - from) / (SONDE_VESSEL_POINTS - 1));
  for (double along = from; along <= to + 1e-9; along += spacing) {
    // skin point seen from the axis, and the normal there
    sonde_vec3 centre = v_madd(axis.origin, reference + along, axis.direction);
    sonde_surface_point hit;
    if (!sonde_surface_raycast(skin, centre, out, 0.5, &hit)) continue;
    const uint32_t *v = model->surface.faces[hit.face];
    sonde_vec3 normal = vec3(0, 0, 0);
    for (int k = 0; k < 3; ++k) normal = v_madd(normal, hit.weight[k], model->normal[v[k]]);
    normal = v_unit(normal, vec3(0, 0, 1));

    // The vein's centre is 18 mm below the skin at the central site, shallower towards the groin
    // (3 mm per 100 mm), deeper towards the knee (8 mm per 100 mm).
    double depth = along < 0 ? fmax(VEIN_DEPTH_M + 0.03 * along, 0.012)
                             : fmin(VEIN_DEPTH_M + 0.08 * along, 0.035);
    sonde_vec3 vein = v_madd(hit.point_m, -depth, normal);
    sonde_vec3 side = v_unit(v_cross(axis.direction, normal), vec3(1, 0, 0));
    sonde_vec3 artery = v_madd(vein, VESSEL_OFFSET_M, side);
    add_point(&model->vein, vein, VEIN_RADIUS_M, depth);
    add_point(&model->artery, artery, ARTERY_RADIUS_M,
              sonde_surface_closest(skin, artery).distance_m);
  }
  sonde_surface_index_destroy(skin);
  if (model->vein.count < 2)
    return sonde_fail(error, SONDE_MESH, "no vessel could be placed below the sites");
  return SONDE_OK;
}
