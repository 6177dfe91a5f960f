// The device families of this build.
#include "sonde/haptics.h"

#include "base/base.h"

static const sonde_device_info families[] = {
    {"null", "stands still at one pose", true, "built in; needs no hardware"},
    {"hand", "simulated operator that feels the force", true, "built in; needs no hardware"},
    {"script", "follows a list of poses in time", true, "built in; needs no hardware"},
    {"replay", "plays recorded poses again", true, "built in; needs a recording"},
    {"page", "mouse and keys in the browser", true, "built in; started by `sonde run`"},
};

const sonde_device_info *sonde_devices(uint32_t *count) {
  SONDE_ASSERT(count != NULL);
  *count = SONDE_COUNT_OF(families);
  return families;
}
