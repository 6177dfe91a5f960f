// From a shape to a model.
#include "anatomy/shape.h"

#include "tissue/layer_springs.h"

#include <string.h>

enum { SITES = SONDE_THIGH_COLUMNS * SONDE_THIGH_ROWS, LEVELS = 32 };
// At the cut ends the bone comes to the skin.
static const double LEAST_TISSUE_M = 0.02;
static const double SITE_STEP_M = 0.015, FINE_REACH_M = 0.005; // between columns; round footprints

sonde_thigh_def sonde_thigh_def_default(void) {
  return (sonde_thigh_def){"thigh", "Generated, not measured", 0.006, 0.003};
}

/* ---- names -------------------------------------------------------------------------------- */

static void mark(sonde_model *model, const sonde_thigh *thigh, const sonde_thigh_shape *shape,
                 const char *name, double share) {
  sonde_thigh_anatomy *a = model->anatomy;
  SONDE_ASSERT(a->landmark_count < SONDE_LANDMARKS);
  sonde_landmark *m = &a->landmark[a->landmark_count++];
  double angle = sonde_course_angle(thigh, share), z = share * shape->skin.length_m;
  snprintf(m->name, sizeof m->name, "%s", name);
  m->skin_m = v_whole_nm(sonde_tube_point(&shape->skin, angle, z));
  m->normal = sonde_tube_normal(&shape->skin, angle, z);
  double nearest = INFINITY;
  for (uint32_t k = 0; k < model->site_count; ++k) {
    double d = v_distance(model->sites[k].position_m, m->skin_m);
    if (d < nearest) nearest = d, m->site = model->sites[k].id;
  }
  nearest = INFINITY;
  for (uint32_t k = 0; k < model->vein.count; ++k) {
    sonde_vec3 d = v_sub(model->vein.point[k].centre_m, m->skin_m);
    double beside = v_norm(v_madd(d, -v_dot(d, m->normal), m->normal));
    if (beside < nearest) nearest = beside, m->vein_m = model->vein.point[k].centre_m;
  }
}

// Vessels, landmarks, segments of the vein and compartments of the muscles.
static sonde_status name_parts(const sonde_thigh *thigh, const sonde_thigh_shape *shape,
                               const sonde_course *course, sonde_model *model, sonde_error *error) {
  sonde_thigh_anatomy *a = model->anatomy = SONDE_NEW(sonde_thigh_anatomy, 1);
  if (!a) return sonde_fail_memory(error);
  model->vein = course->vein;
  model->artery = course->artery;
  a->branch_count = course->branch_count;
  memcpy(a->branch, course->branch, sizeof a->branch);
  // Landmarks, and segments of the vein from one to the next.
  double length = shape->skin.length_m, meet = sonde_course_confluence(thigh);
  mark(model, thigh, shape, "common_femoral", 0.06);
  mark(model, thigh, shape, "saphenofemoral_junction", sonde_course_junction());
  mark(model, thigh, shape, "femoral_confluence", meet);
  mark(model, thigh, shape, "femoral_proximal", 0.35);
  mark(model, thigh, shape, "femoral_mid", 0.5);
  mark(model, thigh, shape, "femoral_distal", 0.75);
  mark(model, thigh, shape, "popliteal", 0.94);
  const struct {
    const char *name;
    double to;
  } segment[] = {{"common_femoral", meet},
                 {"femoral_proximal", fmax(0.4, meet + 0.05)},
                 {"femoral_mid", 0.65},
                 {"femoral_distal", 0.88},
                 {"popliteal", 1}};
  a->segment_count = (uint32_t)SONDE_COUNT_OF(segment);
  for (uint32_t k = 0; k < a->segment_count; ++k) {
    snprintf(a->segment[k].name, sizeof a->segment[k].name, "%s", segment[k].name);
    a->segment[k].from_m = k > 0 ? a->segment[k - 1].to_m : 0;
    a->segment[k].to_m = whole_nm(segment[k].to * length);
  }
  // The medial sheet passes through the femoral vessels; the lateral one stands behind the femur's
  // outer side; adductors give way to the hamstrings towards the knee.
  const sonde_vessel *vein = &model->vein;
  double turn = 2 * SONDE_PI, degree = SONDE_PI / 180;
  a->level_count = LEVELS;
  for (uint32_t k = 0; k < LEVELS; ++k) {
    double t = (double)k / (LEVELS - 1), z = t * shape->skin.length_m;
    uint32_t near = (uint32_t)lround(t * (vein->count - 1));
    sonde_vec3 v = vein->point[near].centre_m;
    uint32_t row = (uint32_t)lround(t * (SONDE_TUBE_ROWS - 1));
    sonde_muscle_level *l = &a->level[k];
    *l = (sonde_muscle_level){whole_nm(z), shape->femur.x_m[row], shape->femur.y_m[row], {0}};
    double at = whole_nm(atan2(v.y - l->bone_y_m, v.x - l->bone_x_m));
    l->septum_rad[0] = at;
    l->septum_rad[1] = 215 * degree;
    l->septum_rad[2] = fmax(at + turn - (95 - 60 * t) * degree, l->septum_rad[1] + 20 * degree);
  }
  const double pennation[SONDE_COMPARTMENTS] = {12 * degree, 18 * degree, 10 * degree};
  memcpy(a->pennation_rad, pennation, sizeof pennation);
  a->fascia_medial_m = 0.0006;
  a->fascia_lateral_m = 0.0016;
  return SONDE_OK;
}

static sonde_status make(const sonde_thigh *thigh, const sonde_thigh_shape *shape,
                         const sonde_thigh_def *def, sonde_mesh *skin, sonde_mesh *femur,
                         sonde_course *course, sonde_model **model, sonde_error *error) {
  SONDE_ASSERT(thigh->stiffness > 0 && shape->skin.length_m > 0);
  const sonde_tube *outer = &shape->skin;
  sonde_site sites[SITES];
  sonde_status status = sonde_tube_mesh(&shape->skin, def->edge_m, skin, error);
  if (!status) status = sonde_tube_mesh(&shape->femur, 0.004, femur, error);
  if (!status) status = sonde_course_place(thigh, shape, skin, course, error);
  if (status) return status;
  // Columns at equal steps around the leg, the middle one above the vein.
  for (uint32_t k = 0; k < SITES; ++k) {
    uint32_t row = k / SONDE_THIGH_COLUMNS;
    double t = 0.06 + 0.88 * row / (SONDE_THIGH_ROWS - 1), z = t * outer->length_m;
    double step = (double)(k % SONDE_THIGH_COLUMNS) - (SONDE_THIGH_COLUMNS - 1) / 2;
    double angle = sonde_course_angle(thigh, t);
    angle += step * SITE_STEP_M / sonde_tube_radius(outer, angle, z);
    sonde_vec3 n = sonde_tube_normal(outer, angle, z), axis = vec3(0, 0, 1);
    sonde_vec3 u = v_unit(v_cross(axis, n), vec3(1, 0, 0));
    sonde_site *s = &sites[k];
    *s = (sonde_site){.id = k,
                      .position_m = v_whole_nm(sonde_tube_point(outer, angle, z)),
                      .normal = n,
                      .u = u,
                      .v = v_cross(n, u)};
    double fat = sonde_shape_fat(shape, s->position_m);
    double bone = sonde_tube_outside(&shape->femur, s->position_m);
    sonde_layer_springs(fat, bone - fat - thigh->skin_m, LEAST_TISSUE_M, thigh->stiffness,
                        &s->k0_n_m3, &s->xm_m);
  }
  sonde_model_def built = sonde_model_def_default();
  built.name = def->name;
  built.provenance = def->provenance;
  built.skin = skin;
  built.femur = femur;
  built.sites = sites;
  built.site_count = SITES;
  built.fine_edge_m = def->fine_edge_m;
  built.fine_reach_m = FINE_REACH_M;
  built.law = sonde_layered_law(thigh->stiffness, thigh->damping_s);
  status = sonde_model_build(&built, model, error);
  if (status) return status;
  // Layers and springs of every node.
  sonde_model *m = *model;
  for (uint32_t i = 0; i < m->surface.vertex_count; ++i) {
    double bone = m->bone_depth_m[i], fat = sonde_shape_fat(shape, m->surface.vertices[i]);
    m->fat_depth_m[i] = fmin(whole_nm(thigh->skin_m), 0.4 * bone);
    m->muscle_depth_m[i] = clamp(whole_nm(thigh->skin_m + fat), m->fat_depth_m[i], 0.9 * bone);
    sonde_layer_springs(m->muscle_depth_m[i] - m->fat_depth_m[i], bone - m->muscle_depth_m[i],
                        LEAST_TISSUE_M, thigh->stiffness, &m->k0_n_m3[i], &m->xm_m[i]);
  }
  return name_parts(thigh, shape, course, m, error);
}

sonde_status sonde_thigh_build(const sonde_thigh *thigh, const sonde_thigh_shape *shape,
                               const sonde_thigh_def *def, sonde_model **model,
                               sonde_error *error) {
  SONDE_ASSERT(thigh && shape && def && model);
  *model = NULL;
  sonde_status status = sonde_thigh_check(thigh, error);
  if (status) return status;
  if (!(def->edge_m >= 0.002 && def->edge_m <= 0.02))
    return sonde_fail(error, SONDE_ARGUMENT, "edge_m is %g, expected 0.002 to 0.02", def->edge_m);
  sonde_mesh skin = {0}, femur = {0};
  sonde_course *course = SONDE_NEW(sonde_course, 1);
  status = course ? make(thigh, shape, def, &skin, &femur, course, model, error)
                  : sonde_fail_memory(error);
  if (status) {
    sonde_model_destroy(*model);
    *model = NULL;
  }
  sonde_free(course);
  sonde_mesh_clear(&skin);
  sonde_mesh_clear(&femur);
  return status;
}
