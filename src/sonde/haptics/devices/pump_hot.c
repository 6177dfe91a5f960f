// The tick's side of a hardware driver: newest pose in, newest force out, nothing waits.
#include "base/base.h"
#include "base/maths.h"
#include "haptics/devices/pump.h"
#include "haptics/motion.h"

void sonde_pump_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  sonde_pump *pump = self;
  (void)tick;
  SONDE_ASSERT(pump->samples != NULL);
  const sonde_device_sample *newest = sonde_mailbox_read(pump->samples);
  pump->silent_ticks = newest ? 0 : pump->silent_ticks + 1;
  if (newest && sonde_pose_usable(newest->world_from_probe)) {
    pump->last = *newest;
    sonde_pose *pose = &pump->last.world_from_probe;
    pose->position = v_scale(pose->position, pump->def.motion_scale);
    *pose = pose_mul(pump->def.world_from_base, *pose);
    pose->rotation = q_unit(pose->rotation);
  } else if (newest) {
    pump->last.present = false;
  }
  *sample = pump->last;
  if ((double)pump->silent_ticks * 1e-3 > pump->def.silence_s) sample->present = false;
}

void sonde_pump_write(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m) {
  sonde_pump *pump = self;
  SONDE_ASSERT(pump->commands != NULL);
  sonde_quat base_from_world = q_conj(pump->def.world_from_base.rotation);
  sonde_command *slot = sonde_mailbox_write_slot(pump->commands);
  *slot =
      (sonde_command){q_rotate(base_from_world, force_n), q_rotate(base_from_world, torque_n_m)};
  sonde_mailbox_publish(pump->commands);
}
