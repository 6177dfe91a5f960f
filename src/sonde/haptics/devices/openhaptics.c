// 3D Systems devices through libHD, opened at run time. Millimetres and newtons there.
#include "haptics/devices/pump.h"

#include "base/base.h"
#include "base/maths.h"

#include <dlfcn.h>

// Numbers of the vendor's interface.
enum {
  HD_CURRENT_BUTTONS = 0x2000,
  HD_CURRENT_TRANSFORM = 0x2052,
  HD_CURRENT_FORCE = 0x2700,
  HD_FORCE_OUTPUT = 0x4000,
  HD_CALLBACK_DONE = 0,
  HD_PRIORITY = 0xffff,
  HD_WARM_MOTORS = 0x0300 // from here on errors are about too much force, not about the link
};
static const unsigned invalid_handle = 0xffffffffu;

typedef struct hd_error {
  unsigned code;
  int internal;
  unsigned device;
} hd_error;

typedef struct openhaptics {
  void *library;
  unsigned device;
  bool opened, scheduler;
  unsigned (*init)(const char *);
  void (*disable)(unsigned), (*make_current)(unsigned), (*begin)(unsigned), (*end)(unsigned);
  void (*enable)(unsigned), (*start)(void), (*stop)(void);
  void (*get_doubles)(unsigned, double *), (*get_integers)(unsigned, int *);
  void (*set_doubles)(unsigned, const double *);
  void (*schedule)(unsigned (*)(void *), void *, unsigned short);
  hd_error (*error)(void);
  const char *(*error_text)(unsigned);
  // of the exchange that is under way
  double force_n[3], transform[16];
  int buttons;
  bool lost;
} openhaptics;

static sonde_status bind(void *self, const sonde_device_open_def *def, sonde_error *error) {
  openhaptics *hd = self;
  static const char *const names[] = {"libHD.so", "libHD.so.3.4", "libHD.so.3", NULL};
  const sonde_symbol symbols[] = {{"hdInitDevice", &hd->init},
                                  {"hdDisableDevice", &hd->disable},
                                  {"hdMakeCurrentDevice", &hd->make_current},
                                  {"hdBeginFrame", &hd->begin},
                                  {"hdEndFrame", &hd->end},
                                  {"hdEnable", &hd->enable},
                                  {"hdStartScheduler", &hd->start},
                                  {"hdStopScheduler", &hd->stop},
                                  {"hdGetDoublev", &hd->get_doubles},
                                  {"hdGetIntegerv", &hd->get_integers},
                                  {"hdSetDoublev", &hd->set_doubles},
                                  {"hdScheduleSynchronous", &hd->schedule},
                                  {"hdGetError", &hd->error},
                                  {"hdGetErrorString", &hd->error_text}};
  return sonde_library_open(def->library, names, symbols, SONDE_COUNT_OF(symbols), &hd->library,
                            error);
}

static sonde_status open_device(void *self, const sonde_device_open_def *def, sonde_error *error) {
  openhaptics *hd = self;
  (void)def;
  hd->device = hd->init(NULL);
  hd_error problem = hd->error();
  hd->opened = hd->device != invalid_handle && problem.code == 0;
  if (!hd->opened)
    return sonde_fail(error, SONDE_DEVICE, "no device answers: %s (code 0x%x)",
                      hd->error_text(problem.code), problem.code);
  hd->make_current(hd->device);
  hd->enable(HD_FORCE_OUTPUT);
  hd->start();
  hd->scheduler = true;
  problem = hd->error();
  if (problem.code)
    return sonde_fail(error, SONDE_DEVICE, "the vendor's scheduler does not start: %s",
                      hd->error_text(problem.code));
  return SONDE_OK;
}

static unsigned frame(void *self) {
  openhaptics *hd = self;
  hd->begin(hd->device);
  hd->set_doubles(HD_CURRENT_FORCE, hd->force_n);
  hd->get_doubles(HD_CURRENT_TRANSFORM, hd->transform);
  hd->get_integers(HD_CURRENT_BUTTONS, &hd->buttons);
  hd->end(hd->device);
  unsigned code = hd->error().code;
  hd->lost = code != 0 && code < HD_WARM_MOTORS;
  return HD_CALLBACK_DONE;
}

static int exchange(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                    sonde_device_sample *sample) {
  openhaptics *hd = self;
  (void)torque_n_m; // these handles have passive wrists
  SONDE_ASSERT(hd->opened);
  hd->force_n[0] = force_n.x;
  hd->force_n[1] = force_n.y;
  hd->force_n[2] = force_n.z;
  hd->lost = true; // until the frame has run
  hd->schedule(frame, hd, HD_PRIORITY);
  if (hd->lost) return -1;
  const double *t = hd->transform; // columns
  sonde_mat3 r = m_columns(vec3(t[0], t[1], t[2]), vec3(t[4], t[5], t[6]), vec3(t[8], t[9], t[10]));
  sample->world_from_probe =
      (sonde_pose){v_scale(vec3(t[12], t[13], t[14]), 1e-3), q_from_matrix(r)};
  sample->buttons = (uint32_t)hd->buttons;
  return 1;
}

static void close_device(void *self) {
  openhaptics *hd = self;
  if (hd->scheduler) hd->stop();
  if (hd->opened) hd->disable(hd->device);
  if (hd->library) dlclose(hd->library);
  *hd = (openhaptics){0};
}

const sonde_driver sonde_driver_openhaptics = {"openhaptics", "Touch, Touch X, Premium (libHD)",
                                               {1, 0, 0, 0},  sizeof(openhaptics),
                                               bind,          open_device,
                                               exchange,      close_device};
