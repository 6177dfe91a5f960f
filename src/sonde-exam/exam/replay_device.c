// The poses of a recording as a device.
#include "exam/record.h"

#include "base/base.h"

sonde_status sonde_device_recording(const char *path, sonde_device *device, sonde_error *error) {
  SONDE_ASSERT(path != NULL && device != NULL);
  *device = (sonde_device){0};
  sonde_recording recording;
  sonde_status status = sonde_recording_load(path, false, &recording, error);
  if (status) return status;
  uint64_t count = 0;
  sonde_device_sample *samples = SONDE_NEW(sonde_device_sample, recording.told.ticks + 1);
  sonde_record record;
  while (samples && sonde_recording_next(&recording, &record))
    if (record.tag == SONDE_RECORD_TICK) samples[count++] = record.sample;
  SONDE_ASSERT(!samples || count == recording.told.ticks);
  status = samples ? sonde_device_replay(samples, count, device, error) : sonde_fail_memory(error);
  sonde_free(samples);
  sonde_recording_clear(&recording);
  return status;
}
