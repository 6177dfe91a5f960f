// What the image plane cuts of the vessels.
#include "exam/vessels.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

void sonde_snapshot_read_vessels(const sonde_interior *interior, sonde_snapshot *snapshot) {
  SONDE_ASSERT(interior != NULL && snapshot != NULL);
  sonde_vessel_state vein, artery;
  sonde_pose pose = snapshot->world_from_probe;
  if (sonde_interior_vessel_at_plane(interior, 0, pose, &vein)) {
    snapshot->vein_area_ratio = vein.area_ratio;
    snapshot->vein_short_m = 2.0 * vein.half_short_m;
    snapshot->vein_rest_m = vein.rest_centre_m;
    // The image is the x-z plane of the probe.
    double along = v_dot(q_rotate(pose.rotation, vec3(0, 1, 0)), vein.axis);
    snapshot->vein_tilt_rad = acos(fmin(1.0, fabs(along)));
  }
  if (sonde_interior_vessel_at_plane(interior, 1, pose, &artery))
    snapshot->artery_area_ratio = artery.area_ratio;
  // The deep femoral vein is left out: it lies behind the femur's front and does not close under a
  // press from the front, in health either.
  for (int which = 2; which < (int)sonde_interior_vessel_count(interior); ++which) {
    sonde_vessel_state v;
    if (strcmp(sonde_interior_vessel_name(interior, which), "second_femoral_vein") != 0) continue;
    if (sonde_interior_vessel_at_plane(interior, which, snapshot->world_from_probe, &v))
      snapshot->other_vein_ratio = fmax(snapshot->other_vein_ratio, v.area_ratio);
  }
}
