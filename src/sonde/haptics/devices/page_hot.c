// The device behind the page: one tick.
//
// The goal may jump. A leader follows it at bounded speed; the pose follows the leader through two
// equal first-order lags, which is the critically damped second-order filter with impulse response
// w^2 t exp(-w t) >= 0. An average of the leader's motion with positive weights, the pose is never
// faster than the leader, its acceleration stays below 2 (w/e) times the speed limit, and it never
// overshoots. The same holds for the rotation by the triangle inequality on arcs.
#include "haptics/devices/devices.h"

#include "haptics/motion.h"

void sonde_page_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  (void)tick;
  sonde_page_device *page = self;
  SONDE_ASSERT(page->share > 0.0 && page->share <= 1.0);
  const sonde_pose *goal = sonde_mailbox_read(page->goals);
  if (goal) page->goal = *goal;
  page->leader = sonde_pose_approach(page->leader, page->goal, page->reach_m, page->rotation_rad);
  page->middle = sonde_pose_blend(page->middle, page->leader, page->share);
  page->pose = sonde_pose_blend(page->pose, page->middle, page->share);
  *sample = (sonde_device_sample){page->pose, 0, true};
}
