// What a pixel of a picture shows: the true place of its line and depth, the tissue that came there
// from rest, and the lumina of the sections as they are now.
#include "echo/truth.h"

#include "base/base.h"
#include "echo/sound.h"
#include "interior/clot.h"
#include "interior/vessels.h"

sonde_pose sonde_truth_pose(const sonde_echo *echo) {
  SONDE_ASSERT(echo != NULL);
  return echo->frame.probe;
}

sonde_truth_view sonde_truth_view_of(const sonde_echo *echo) {
  SONDE_ASSERT(echo != NULL);
  const frame *f = &echo->frame;
  return (sonde_truth_view){f->radius_m, f->aperture_m, f->depth_m};
}

sonde_vec3 sonde_truth_drawn_at(const sonde_echo *echo, sonde_vec3 point_m) {
  SONDE_ASSERT(echo != NULL);
  const frame *f = &echo->frame;
  sonde_vec3 at = sonde_echo_unplace(f, pose_apply_inverse(f->probe, point_m));
  if (sonde_sound_on(echo)) {
    splat_map map = {.m = {{(float)((at.x + f->edge_lines) * SONDE_FINE), 0,
                            (float)(at.z / f->step_m) + (float)echo->pad_samples}}};
    sonde_sound_move(echo, &map);
    at.x = (double)map.m[0][0] / SONDE_FINE - f->edge_lines;
    at.z = ((double)map.m[0][2] - echo->pad_samples) * f->step_m;
  }
  const sonde_vec3 drawn = sonde_echo_place(f, at.x, at.z);
  return vec3(drawn.x, at.y, drawn.z);
}

bool sonde_truth_at(const sonde_echo *echo, const sonde_image *image, uint32_t column, uint32_t row,
                    sonde_truth_pixel *pixel) {
  SONDE_ASSERT(echo != NULL && image != NULL && column < image->width && row < image->height);
  const frame *f = &echo->frame;
  const double size = image->width_m / image->width, top = f->depth_m - image->height_m;
  const sonde_vec3 drawn = sonde_echo_unplace(
      f, vec3((column + 0.5 - 0.5 * image->width) * size, 0, top + (row + 0.5) * size));
  *pixel = (sonde_truth_pixel){.label = SONDE_LABEL_OUTSIDE};
  if (!(drawn.x >= 0 && drawn.x <= echo->lines - 1 && drawn.z >= 0 && drawn.z <= f->depth_m))
    return false;
  double line = drawn.x, depth_m = drawn.z;
  if (sonde_sound_on(echo)) sonde_sound_true_place(echo, &line, &depth_m);
  pixel->point_m = pose_apply(f->probe, sonde_echo_place(f, line, depth_m));
  pixel->rest_m = sonde_interior_rest_point(echo->interior, pixel->point_m);
  sonde_column_point at;
  (void)sonde_interior_locate(echo->interior, pixel->rest_m, &at);
  pixel->label = sonde_interior_label(echo->interior, pixel->rest_m, NULL);
  uint32_t which;
  const bool vessel =
      pixel->label != SONDE_LABEL_OUTSIDE && pixel->label != SONDE_LABEL_BONE &&
      sonde_vessels_label(echo->interior, pixel->rest_m, at.s, &which) != SONDE_LABEL_COUNT;
  pixel->vessel = vessel ? which + 1 : 0;
  if (pixel->label == SONDE_LABEL_OUTSIDE || pixel->label == SONDE_LABEL_BONE) return true;
  // The vessel in whose section of now the point lies. At rest a lumen, now beside it: what the
  // wall's motion leaves out is wall.
  bool was_lumen = false, artery = false;
  for (uint32_t k = 0; k < echo->shown_count; ++k) {
    const uint32_t number = echo->shown[k];
    const double along_m = sonde_vessel_along(echo->interior, number, pixel->rest_m, at.s);
    sonde_vessel_state v;
    if (!sonde_vessel_at(echo->interior, number, along_m, &v)) continue;
    const bool here = echo->interior->course[number].kind == SONDE_VESSEL_ARTERY;
    const sonde_vec3 d = v_sub(pixel->point_m, v.centre_m);
    const double a = v_dot(d, v.flat_axis) / v.half_short_m;
    const double b = v_dot(d, v_cross(v.axis, v.flat_axis)) / v.half_long_m;
    if (!(a * a + b * b < 1)) {
      if (vessel && pixel->vessel == number + 1) was_lumen = true, artery = here;
      continue;
    }
    pixel->vessel = number + 1;
    pixel->label = here ? SONDE_LABEL_ARTERY : SONDE_LABEL_VEIN;
    const double solid = sonde_echo_solid(echo, number, v.rest_centre_m.z);
    const sonde_clot_form form = sonde_echo_pathology(echo, number)->form;
    if (sonde_clot_holds(form, solid, number, along_m, a, b)) {
      pixel->label = SONDE_LABEL_THROMBUS;
      return true;
    }
    const double speed = echo->moves[k].speed_m_s * 2 * (1 - a * a - b * b);
    pixel->velocity_m_s = v_scale(v.axis, solid < 1 ? speed : 0);
    return true;
  }
  if (was_lumen) pixel->label = artery ? SONDE_LABEL_ARTERY_WALL : SONDE_LABEL_VEIN_WALL;
  return true;
}
