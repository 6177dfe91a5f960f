// The device that stands still: creation.
#include "haptics/devices/devices.h"

#include "haptics/motion.h"

sonde_status sonde_device_null(sonde_pose pose, sonde_device *device, sonde_error *error) {
  SONDE_ASSERT(device != NULL);
  *device = (sonde_device){0};
  if (!sonde_pose_usable(pose))
    return sonde_fail(error, SONDE_ARGUMENT, "null device: the pose is not finite");
  sonde_null_device *null = SONDE_NEW(sonde_null_device, 1);
  if (!null) return sonde_fail_memory(error);
  null->pose = (sonde_pose){pose.position, q_unit(pose.rotation)};
  *device = (sonde_device){"null", null, sonde_null_read, sonde_device_write_nothing, sonde_free};
  return SONDE_OK;
}
