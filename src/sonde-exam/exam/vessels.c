// What the image plane cuts of the vessels.
#include "exam/vessels.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

// The image is the x-z plane of the probe.
static double tilt(sonde_pose pose, sonde_vec3 axis) {
  double along = v_dot(q_rotate(pose.rotation, vec3(0, 1, 0)), axis);
  return acos(fmin(1.0, fabs(along)));
}

// The deep femoral vein is left out: it lies behind the femur's front and does not close under a
// press from the front, in health either.
static void read_second_vein(const sonde_interior *in, sonde_snapshot *snapshot) {
  for (int which = 2; which < (int)sonde_interior_vessel_count(in); ++which) {
    sonde_vessel_state v;
    if (strcmp(sonde_interior_vessel_name(in, which), "second_femoral_vein") != 0) continue;
    if (sonde_interior_vessel_at_plane(in, which, snapshot->world_from_probe, &v))
      snapshot->other_vein_ratio = fmax(snapshot->other_vein_ratio, v.area_ratio);
  }
}

void sonde_snapshot_read_vessels(const sonde_interior *interior, sonde_snapshot *snapshot) {
  SONDE_ASSERT(interior != NULL && snapshot != NULL);
  sonde_vessel_state vein, artery;
  sonde_pose pose = snapshot->world_from_probe;
  if (sonde_interior_vessel_at_plane(interior, 0, pose, &vein)) {
    snapshot->vein_area_ratio = vein.area_ratio;
    snapshot->vein_short_m = 2.0 * vein.half_short_m;
    snapshot->vein_rest_m = vein.rest_centre_m;
    snapshot->vein_tilt_rad = tilt(pose, vein.axis);
  }
  if (sonde_interior_vessel_at_plane(interior, 1, pose, &artery))
    snapshot->artery_area_ratio = artery.area_ratio;
  read_second_vein(interior, snapshot);
}
