// A clutch between a handle and the probe: one tick.
#include "haptics/devices/devices.h"

#include "haptics/motion.h"

void sonde_clutch_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  sonde_clutch_device *clutch = self;
  SONDE_ASSERT(clutch->inner.read != NULL);
  clutch->inner.read(clutch->inner.self, tick, sample);
  sonde_pose handle = sample->world_from_probe;
  bool usable = sonde_pose_usable(handle);
  if (usable) handle.rotation = q_unit(handle.rotation);
  if (!usable) sample->present = false;
  if (!sample->present || (sample->buttons & clutch->buttons)) {
    clutch->holds = false;
  } else {
    if (!clutch->holds) {
      // The hold leaves the probe where it is.
      clutch->offset_m = v_sub(clutch->probe.position, handle.position);
      clutch->grip = q_mul(q_conj(handle.rotation), clutch->probe.rotation);
      clutch->gain = 0.0;
      clutch->holds = true;
    }
    clutch->probe.position = v_add(handle.position, clutch->offset_m);
    clutch->probe.rotation = q_unit(q_mul(handle.rotation, clutch->grip));
    clutch->gain = fmin(clutch->gain + clutch->gain_step, 1.0);
  }
  sample->world_from_probe = clutch->probe;
}

void sonde_clutch_write(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m) {
  sonde_clutch_device *clutch = self;
  double gain = clutch->holds ? clutch->gain : 0.0;
  SONDE_ASSERT(gain >= 0.0 && gain <= 1.0);
  clutch->inner.write(clutch->inner.self, v_scale(force_n, gain), v_scale(torque_n_m, gain));
}
