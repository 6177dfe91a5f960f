// The device that plays samples again: one tick.
#include "haptics/devices/devices.h"

void sonde_replay_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  const sonde_replay_device *replay = self;
  SONDE_ASSERT(replay->count > 0);
  bool over = tick >= replay->count;
  *sample = replay->samples[over ? replay->count - 1 : tick];
  if (over) sample->present = false;
}
