// SpaceMouse through libspnav, opened at run time; it steers. No force.
#include "haptics/devices/pump.h"

#include "base/base.h"
#include "base/maths.h"

#include <dlfcn.h>

enum { SPNAV_MOTION = 1, SPNAV_BUTTON = 2 };

typedef union spnav_event {
  int type;
  struct {
    int type, axis[6];
    unsigned period;
    int *data;
  } motion;
  struct {
    int type, press, number;
  } button;
  int room[32]; // later versions have larger events
} spnav_event;

typedef struct spacenav {
  void *library;
  bool opened, placed;
  int (*open)(void), (*close)(void), (*poll)(spnav_event *), (*fd)(void);
  double axis[6];
  uint32_t buttons;
  sonde_pose pose;
} spacenav;

static sonde_status bind(void *self, const sonde_device_open_def *def, sonde_error *error) {
  spacenav *nav = self;
  static const char *const names[] = {"libspnav.so.0", "libspnav.so", NULL};
  const sonde_symbol symbols[] = {{"spnav_open", &nav->open},
                                  {"spnav_close", &nav->close},
                                  {"spnav_poll_event", &nav->poll},
                                  {"spnav_fd", &nav->fd}};
  return sonde_library_open(def->library, names, symbols, SONDE_COUNT_OF(symbols), &nav->library,
                            error);
}

static sonde_status open_device(void *self, const sonde_device_open_def *def, sonde_error *error) {
  spacenav *nav = self;
  (void)def;
  sonde_pose kept = nav->pose;
  nav->opened = nav->open() != -1;
  if (!nav->opened) return sonde_fail(error, SONDE_DEVICE, "the daemon spacenavd does not answer");
  nav->pose = nav->placed ? kept : (sonde_pose){vec3(0, 0, 0), quat_identity()};
  nav->placed = true;
  return SONDE_OK;
}

static int exchange(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                    sonde_device_sample *sample) {
  spacenav *nav = self;
  (void)force_n;
  (void)torque_n_m;
  SONDE_ASSERT(nav->opened);
  spnav_event event = {0};
  for (int polls = 0; polls < 64 && nav->poll(&event) > 0; ++polls) {
    for (int i = 0; i < 6 && event.type == SPNAV_MOTION; ++i)
      nav->axis[i] = event.motion.axis[i] / 350.0; // its full deflection
    if (event.type == SPNAV_BUTTON && event.button.number >= 0 && event.button.number < 32) {
      uint32_t bit = 1u << event.button.number;
      nav->buttons = event.button.press ? nav->buttons | bit : nav->buttons & ~bit;
    }
  }
  if (nav->fd() < 0) return -1; // the daemon has gone
  sonde_steer(&nav->pose, nav->axis, 1e-3);
  sample->world_from_probe = nav->pose;
  sample->buttons = nav->buttons;
  return 1;
}

static void close_device(void *self) {
  spacenav *nav = self;
  if (nav->opened) nav->close();
  if (nav->library) dlclose(nav->library);
  *nav = (spacenav){.pose = nav->pose, .placed = nav->placed};
}

// x to the right, y up, z towards the user: not verified
const sonde_driver sonde_driver_spacenav = {"spacenav",   "SpaceMouse steers, no force (libspnav)",
                                            {1, 0, 0, 0}, sizeof(spacenav),
                                            bind,         open_device,
                                            exchange,     close_device};
