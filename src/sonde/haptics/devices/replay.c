// The device that plays samples again: creation.
#include "haptics/devices/devices.h"

#include "haptics/motion.h"

#include <string.h>

static void destroy(void *self) {
  sonde_replay_device *replay = self;
  if (!replay) return;
  sonde_free(replay->samples);
  sonde_free(replay);
}

sonde_status sonde_device_replay(const sonde_device_sample *samples, uint64_t count,
                                 sonde_device *device, sonde_error *error) {
  SONDE_ASSERT(device != NULL);
  *device = (sonde_device){0};
  if (!samples || count == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "replay device: no samples, expected 1 or more");
  for (uint64_t i = 0; i < count; ++i)
    if (!sonde_pose_usable(samples[i].world_from_probe))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "replay device: the pose of sample %llu is not finite",
                        (unsigned long long)i);
  sonde_replay_device *replay = SONDE_NEW(sonde_replay_device, 1);
  if (replay) replay->samples = SONDE_NEW(sonde_device_sample, (size_t)count);
  if (!replay || !replay->samples) {
    destroy(replay);
    return sonde_fail_memory(error);
  }
  memcpy(replay->samples, samples, (size_t)count * sizeof *samples);
  replay->count = count;
  *device =
      (sonde_device){"replay", replay, sonde_replay_read, sonde_device_write_nothing, destroy};
  return SONDE_OK;
}
