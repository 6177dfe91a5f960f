// The device that stands still: one tick.
#include "haptics/devices/devices.h"

void sonde_device_write_nothing(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m) {
  (void)self;
  (void)force_n;
  (void)torque_n_m;
}

void sonde_null_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  (void)tick;
  const sonde_null_device *null = self;
  SONDE_ASSERT(null != NULL);
  *sample = (sonde_device_sample){null->pose, 0, true};
}
