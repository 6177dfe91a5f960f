// What the image plane cuts of the vessels.
#include "exam/vessels.h"

#include "base/base.h"
#include "base/maths.h"
#include "interior/interior.h"

#include <string.h>

// Half of the widest picture, and the deepest one.
static const double ASIDE_M = 0.035, DEEP_M = 0.15;

bool sonde_vein_is_double(const char *branch) {
  static const char *const DOUBLES[] = {"second_femoral_vein", "third_femoral_vein",
                                        "second_popliteal_vein"};
  for (size_t k = 0; k < SONDE_COUNT_OF(DOUBLES); ++k)
    if (strcmp(branch, DOUBLES[k]) == 0) return true;
  return false;
}

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
  snapshot->crossing_count = snapshot->view_count = 0;
  for (uint32_t which = 0; which < sonde_interior_vessel_count(interior); ++which) {
    sonde_vessel_state v;
    if (!sonde_interior_vessel_at_plane(interior, (int)which, pose, &v)) continue;
    const bool arterial =
        which == 1 || (which > 1 && interior->course[which].kind != SONDE_VESSEL_VEIN);
    const sonde_vec3 at = pose_apply_inverse(pose, v.centre_m);
    if (snapshot->view_count < SONDE_VESSEL_VIEWS && fabs(at.x) < ASIDE_M && at.z > 0 &&
        at.z < DEEP_M)
      snapshot->view[snapshot->view_count++] =
          (sonde_vessel_view){which,         arterial,       at.x,         at.z,
                              v.half_long_m, v.half_short_m, v.area_ratio, v.rest_centre_m.z};
    if (which < 2 || arterial) continue;
    if (sonde_vein_is_double(sonde_interior_vessel_name(interior, (int)which)))
      snapshot->other_vein_ratio = fmax(snapshot->other_vein_ratio, v.area_ratio);
    if (snapshot->crossing_count == SONDE_VEIN_CROSSINGS) continue;
    snapshot->crossing[snapshot->crossing_count++] = (sonde_vein_crossing){
        .vessel = which, .area_ratio = v.area_ratio, .aside_m = at.x, .rest_m = v.rest_centre_m};
  }
}
