// A picture of the thigh at rest, pressed with the mechanical model.
//
// press_check      options
// place            where the picture lies on the model
// deform           interior and picture
// press_picture
#include "frames_press.h"
#include "settled.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct work {
  settled scene;
  sonde_pathology pathology;
  sonde_pose rest_pose;
  double target_n, at_mm[2];
} work;

static bool parse(const char *verb, const press_options *o, long *site, work *w) {
  double venous = 10, arterial = 95;
  return (!o->site || app_parse_integer(verb, "--site", o->site, 0, 1000000, site)) &&
         (!o->force || app_parse_real(verb, "--force-n", o->force, 0.01, 200, &w->target_n)) &&
         (!o->venous || app_parse_real(verb, "--venous-mmhg", o->venous, 0.1, 200, &venous)) &&
         (!o->arterial || app_parse_real(verb, "--arterial-mmhg", o->arterial, 1, 300, &arterial));
}

bool press_check(const char *verb, const press_options *o) {
  bool any =
      o->site || o->force || o->probe || o->pathology || o->venous || o->arterial || o->vein_at;
  work w = {0};
  long site = 0;
  if (!o->model && !any) return true;
  if (!o->model || !o->site || !o->force) {
    app_usage_error(verb, "--press MODEL, --site K and --force-n F belong together");
    return false;
  }
  if (o->vein_at && !frames_numbers(o->vein_at, 2, ',', w.at_mm)) {
    app_usage_error(verb, "--vein-at expects X,Z in mm, got '%s'", o->vein_at);
    return false;
  }
  return parse(verb, o, &site, &w);
}

static sonde_status prepare(const char *verb, const press_options *o, work *w, sonde_error *error) {
  long site = 0;
  sonde_status status =
      sonde_pathology_preset(o->pathology ? o->pathology : "healthy", &w->pathology, error);
  if (!status)
    status = settled_open(&w->scene, o->model, o->probe ? o->probe : "linear", NULL, true, error);
  if (status) return status;
  (void)parse(verb, o, &site, w);
  if (o->venous) w->pathology.venous_pressure_pa = atof(o->venous) * 133.322387415;
  if (o->arterial) w->pathology.arterial_pressure_pa = atof(o->arterial) * 133.322387415;
  return settled_site(&w->scene, o->model, site, &w->rest_pose, error);
}

// Rest vein of the model -> the place of the vein in the picture.
static sonde_status place(const press_options *o, const work *w, sonde_image_press *press,
                          sonde_error *error) {
  sonde_vessel_state vein;
  if (!o->vein_at) return SONDE_OK;
  if (!sonde_interior_vessel_at_plane(w->scene.interior, 0, press->rest_pose, &vein))
    return frames_fail(error, SONDE_MISMATCH, "--vein-at: the model's vein is not under site %s",
                       o->site);
  double at_mm[2];
  (void)frames_numbers(o->vein_at, 2, ',', at_mm);
  const sonde_vec3 c = vein.rest_centre_m, p = press->rest_pose.position;
  const sonde_quat q = press->rest_pose.rotation;
  // Axes of the probe in the world: x across the beam, z along it.
  double x[3] = {1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y + q.w * q.z),
                 2 * (q.x * q.z - q.w * q.y)};
  double z[3] = {2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x),
                 1 - 2 * (q.x * q.x + q.y * q.y)};
  double d[3] = {c.x - p.x, c.y - p.y, c.z - p.z};
  press->shift_m[0] = at_mm[0] * 1e-3 - (d[0] * x[0] + d[1] * x[1] + d[2] * x[2]);
  press->shift_m[1] = at_mm[1] * 1e-3 - (d[0] * z[0] + d[1] * z[1] + d[2] * z[2]);
  return SONDE_OK;
}

static void update(const work *w) {
  settled_update(&w->scene, &w->pathology, sonde_state_tick(w->scene.state));
}

static sonde_status deform(const press_options *o, work *w, sonde_image *image, uint8_t *known,
                           press_result *r, sonde_error *error) {
  settled *scene = &w->scene;
  sonde_image_press press = {.interior = scene->interior, .rest_pose = w->rest_pose};
  sonde_image out;
  scene->pose = w->rest_pose;
  update(w); // at rest
  sonde_status status = place(o, w, &press, error);
  if (!status) status = settled_force(scene, w->rest_pose, w->target_n, error);
  settled_warn(scene, "slice");
  if (!status) status = sonde_image_create(image->width, image->height, &out, error);
  if (status) return status;
  update(w);
  out.width_m = image->width_m, out.height_m = image->height_m;
  press.pose = scene->pose;
  sonde_image_pressed(image, &press, &out, known);
  memcpy(image->pixels, out.pixels, (size_t)image->width * image->height);
  sonde_image_clear(&out);
  sonde_vessel_state v;
  *r = (press_result){scene->force_n, scene->depth_m, NAN, NAN};
  if (sonde_interior_vessel_at_plane(scene->interior, 0, scene->pose, &v))
    r->vein_area_ratio = v.area_ratio;
  if (sonde_interior_vessel_at_plane(scene->interior, 1, scene->pose, &v))
    r->artery_area_ratio = v.area_ratio;
  return SONDE_OK;
}

sonde_status press_picture(const char *verb, const press_options *o, sonde_image *image,
                           uint8_t *known, press_result *result, sonde_error *error) {
  work w = {0};
  sonde_status status = prepare(verb, o, &w, error);
  if (!status) status = deform(o, &w, image, known, result, error);
  settled_close(&w.scene);
  return status;
}
