// A clutch between a handle and the probe: creation.
#include "haptics/devices/devices.h"
#include "sonde/haptics_devices.h"

#include "haptics/motion.h"

#include <string.h>

sonde_clutch_def sonde_clutch_def_default(void) {
  return (sonde_clutch_def){.version = SONDE_DEF_VERSION};
}

static void destroy(void *self) {
  sonde_clutch_device *clutch = self;
  if (!clutch) return;
  if (clutch->inner.destroy) clutch->inner.destroy(clutch->inner.self);
  sonde_free(clutch);
}

sonde_status sonde_device_clutch(const sonde_clutch_def *def, sonde_device *inner,
                                 sonde_device *device, sonde_error *error) {
  SONDE_ASSERT(def != NULL && inner != NULL && device != NULL);
  *device = (sonde_device){0};
  sonde_status status = sonde_def_check("clutch", def->version, error);
  if (status) return status;
  if (!inner->read || !inner->write)
    return sonde_fail(error, SONDE_ARGUMENT, "clutch: no device to put it around");
  sonde_pose start = def->world_from_probe;
  const sonde_quat none = {0, 0, 0, 0};
  if (memcmp(&start.rotation, &none, sizeof none) == 0) start.rotation = quat_identity();
  if (!sonde_pose_usable(start))
    return sonde_fail(error, SONDE_ARGUMENT, "clutch: the first pose is not finite");
  double ramp_s = def->ramp_s > 0.0 ? def->ramp_s : 0.1, dt_s = def->dt_s > 0.0 ? def->dt_s : 1e-3;
  sonde_clutch_device *clutch = SONDE_NEW(sonde_clutch_device, 1);
  if (!clutch) return sonde_fail_memory(error);
  clutch->inner = *inner;
  *inner = (sonde_device){0};
  clutch->buttons = def->buttons;
  clutch->probe = (sonde_pose){start.position, q_unit(start.rotation)};
  clutch->gain_step = fmin(dt_s / ramp_s, 1.0);
  *device =
      (sonde_device){clutch->inner.name, clutch, sonde_clutch_read, sonde_clutch_write, destroy};
  return SONDE_OK;
}
