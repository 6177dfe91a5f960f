// Force Dimension and Novint devices through libdhd, opened at run time. SI units there.
#include "haptics/devices/pump.h"

#include "base/base.h"
#include "base/maths.h"

#include <dlfcn.h>

typedef struct forcedimension {
  void *library;
  signed char device;
  bool opened;
  int (*open)(void), (*close)(char), (*stop)(char);
  int (*enable)(unsigned char, char);
  int (*get_pose)(double *, double *, double *, double[3][3], char);
  int (*set_wrench)(double, double, double, double, double, double, char);
  unsigned (*get_buttons)(char);
  const char *(*error_text)(void);
} forcedimension;

static sonde_status bind(void *self, const sonde_device_open_def *def, sonde_error *error) {
  forcedimension *fd = self;
  static const char *const names[] = {"libdhd.so", "libdhd.so.3", NULL};
  const sonde_symbol symbols[] = {{"dhdOpen", &fd->open},
                                  {"dhdClose", &fd->close},
                                  {"dhdStop", &fd->stop},
                                  {"dhdEnableForce", &fd->enable},
                                  {"dhdGetPositionAndOrientationFrame", &fd->get_pose},
                                  {"dhdSetForceAndTorque", &fd->set_wrench},
                                  {"dhdGetButtonMask", &fd->get_buttons},
                                  {"dhdErrorGetLastStr", &fd->error_text}};
  return sonde_library_open(def->library, names, symbols, SONDE_COUNT_OF(symbols), &fd->library,
                            error);
}

static sonde_status open_device(void *self, const sonde_device_open_def *def, sonde_error *error) {
  forcedimension *fd = self;
  (void)def;
  int device = fd->open();
  if (device < 0) return sonde_fail(error, SONDE_DEVICE, "no device answers: %s", fd->error_text());
  fd->device = (signed char)device;
  fd->opened = true;
  if (fd->enable(1, (char)fd->device) < 0)
    return sonde_fail(error, SONDE_DEVICE, "the device refuses forces: %s", fd->error_text());
  return SONDE_OK;
}

static int exchange(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                    sonde_device_sample *sample) {
  forcedimension *fd = self;
  SONDE_ASSERT(fd->opened);
  double r[3][3];
  sonde_pose *pose = &sample->world_from_probe;
  char id = (char)fd->device;
  // a positive answer only says that the call came sooner than the device refreshes
  if (fd->set_wrench(force_n.x, force_n.y, force_n.z, torque_n_m.x, torque_n_m.y, torque_n_m.z,
                     id) < 0)
    return -1;
  if (fd->get_pose(&pose->position.x, &pose->position.y, &pose->position.z, r, id) < 0) return -1;
  sonde_mat3 m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m.m[i][j] = r[i][j];
  pose->rotation = q_from_matrix(m);
  sample->buttons = fd->get_buttons(id);
  return 1;
}

static void close_device(void *self) {
  forcedimension *fd = self;
  if (fd->opened) {
    fd->stop((char)fd->device);
    fd->close((char)fd->device);
  }
  if (fd->library) dlclose(fd->library);
  *fd = (forcedimension){0};
}

// x towards the user, y to the right, z up
const sonde_driver sonde_driver_forcedimension = {"forcedimension",
                                                  "omega, delta, sigma, lambda, Falcon (libdhd)",
                                                  {0.5, -0.5, -0.5, -0.5},
                                                  sizeof(forcedimension),
                                                  bind,
                                                  open_device,
                                                  exchange,
                                                  close_device};
