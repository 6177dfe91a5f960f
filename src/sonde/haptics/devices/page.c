// The device behind the page: creation, and the door for new goals.
#include "haptics/devices/devices.h"

#include "haptics/motion.h"

// Speed of a hand that moves a probe briskly, and a lag of 2/80 s that hides the page's frames.
static const double speed_m_s = 0.25, rotation_rad_s = 3.0, filter_rad_s = 80.0;

static void destroy(void *self) {
  sonde_page_device *page = self;
  if (!page) return;
  sonde_mailbox_destroy(page->goals);
  sonde_free(page);
}

sonde_status sonde_device_page(sonde_pose start, double dt_s, sonde_device *device,
                               sonde_error *error) {
  SONDE_ASSERT(device != NULL);
  *device = (sonde_device){0};
  if (!sonde_pose_usable(start))
    return sonde_fail(error, SONDE_ARGUMENT, "page device: the first pose is not finite");
  if (!(dt_s > 0.0) || !isfinite(dt_s))
    return sonde_fail(error, SONDE_ARGUMENT, "page device: a tick lasts %g s, expected more than 0",
                      dt_s);
  sonde_page_device *page = SONDE_NEW(sonde_page_device, 1);
  if (!page) return sonde_fail_memory(error);
  sonde_status status = sonde_mailbox_create(sizeof(sonde_pose), &page->goals, error);
  if (status) {
    destroy(page);
    return status;
  }
  page->goal = (sonde_pose){start.position, q_unit(start.rotation)};
  page->leader = page->middle = page->pose = page->goal;
  page->reach_m = speed_m_s * dt_s;
  page->rotation_rad = rotation_rad_s * dt_s;
  page->share = -expm1(-filter_rad_s * dt_s);
  *device = (sonde_device){"page", page, sonde_page_read, sonde_device_write_nothing, destroy};
  return SONDE_OK;
}

void sonde_device_page_goal(sonde_device *device, sonde_pose goal) {
  SONDE_ASSERT(device != NULL);
  if (device->read != sonde_page_read || !sonde_pose_usable(goal)) return;
  sonde_page_device *page = device->self;
  sonde_pose *slot = sonde_mailbox_write_slot(page->goals);
  *slot = (sonde_pose){goal.position, q_unit(goal.rotation)};
  sonde_mailbox_publish(page->goals);
}
