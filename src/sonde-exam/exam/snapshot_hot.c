// What a snapshot holds of the world.
#include "exam/vessels.h"

#include "base/base.h"
#include "base/maths.h"

sonde_snapshot sonde_snapshot_of(const sonde_state *state, sonde_pose pose) {
  SONDE_ASSERT(state != NULL && v_finite(pose.position));
  const sonde_contact *contact = sonde_state_contact(state);
  sonde_vec3 axis = q_rotate(pose.rotation, vec3(0, 0, 1));
  const double nan_m = (double)NAN;
  return (sonde_snapshot){
      .tick = sonde_state_tick(state),
      .time_s = sonde_state_time(state),
      .world_from_probe = pose,
      .force_n = contact->force_n,
      .force_normal_n = -v_dot(contact->force_n, axis),
      .penetration_m = nan_m,
      .contact_volume_m3 = contact->volume_m3,
      .contact_area_m2 = contact->area_m2,
      .vein_area_ratio = nan_m,
      .artery_area_ratio = nan_m,
      .other_vein_ratio = nan_m,
      .vein_short_m = nan_m,
      .vein_rest_m = vec3(nan_m, nan_m, nan_m),
      .vein_tilt_rad = nan_m,
      .gel_volume_m3 = nan_m,
      .gel_coupling = nan_m,
      .awake_nodes = sonde_state_awake(state),
      .solver_iterations = sonde_state_solver(state).iterations,
      .flags = sonde_state_flags(state),
  };
}
