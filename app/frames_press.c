// A picture of the thigh at rest, pressed with the mechanical model.
#include "frames_press.h"
#include "pose.h"
#include "settled.h"

#include <assert.h>
#include <math.h>
#include <string.h>

sonde_status press_picture(const press_options *o, sonde_image *image, uint8_t *known,
                           press_result *result, sonde_error *error) {
  assert(o->model && o->force_n > 0);
  settled scene = {0};
  sonde_pathology pathology;
  sonde_image_press press = {0};
  sonde_image out = {0};
  sonde_vessel_state v;
  sonde_status status = sonde_pathology_preset(o->pathology, &pathology, error);
  if (!status) status = settled_open(&scene, o->model, o->probe, NULL, true, error);
  if (!status) status = settled_site(&scene, o->model, o->site, &press.rest_pose, error);
  if (status) goto done;
  if (!isnan(o->venous_pa)) pathology.venous_pressure_pa = o->venous_pa;
  if (!isnan(o->arterial_pa)) pathology.arterial_pressure_pa = o->arterial_pa;

  // At rest: the picture is shifted so that its vein lies on the model's.
  press.interior = scene.interior;
  scene.pose = press.rest_pose;
  settled_update(&scene, &pathology, 0, sonde_state_tick(scene.state));
  if (!isnan(o->vein_mm[0])) {
    if (!sonde_interior_vessel_at_plane(scene.interior, 0, press.rest_pose, &v)) {
      status = app_error(error, SONDE_MISMATCH, "--vein-at: the model's vein is not under site %ld",
                         o->site);
      goto done;
    }
    sonde_vec3 c = v.rest_centre_m, p = press.rest_pose.position;
    sonde_vec3 d = {c.x - p.x, c.y - p.y, c.z - p.z};
    press.shift_m[0] = o->vein_mm[0] * 1e-3 - vec_dot(d, pose_axis(press.rest_pose, 0));
    press.shift_m[1] = o->vein_mm[1] * 1e-3 - vec_dot(d, pose_axis(press.rest_pose, 2));
  }

  // Pressed: every pixel moves as the tissue under it.
  status = settled_force(&scene, press.rest_pose, o->force_n, error);
  settled_warn(&scene, "slice");
  if (!status) status = sonde_image_create(image->width, image->height, &out, error);
  if (status) goto done;
  settled_update(&scene, &pathology, 0, sonde_state_tick(scene.state));
  out.width_m = image->width_m, out.height_m = image->height_m;
  press.pose = scene.pose;
  sonde_image_pressed(image, &press, &out, known);
  memcpy(image->pixels, out.pixels, (size_t)image->width * image->height);
  *result = (press_result){scene.force_n, scene.depth_m, NAN, NAN};
  if (sonde_interior_vessel_at_plane(scene.interior, 0, scene.pose, &v))
    result->vein_area_ratio = v.area_ratio;
  if (sonde_interior_vessel_at_plane(scene.interior, 1, scene.pose, &v))
    result->artery_area_ratio = v.area_ratio;
done:
  sonde_image_clear(&out);
  settled_close(&scene);
  return status;
}
