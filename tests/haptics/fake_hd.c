// A fake libHD: the functions that the driver uses, a device that a test can unplug.
#include "fake.h"

typedef struct hd_error {
  unsigned code;
  int internal;
  unsigned device;
} hd_error;

fake_control fake;
static unsigned problem;
static bool in_frame, running, enabled;

unsigned hdInitDevice(const char *name);
void hdDisableDevice(unsigned device);
void hdMakeCurrentDevice(unsigned device);
void hdBeginFrame(unsigned device);
void hdEndFrame(unsigned device);
void hdEnable(unsigned what);
void hdStartScheduler(void);
void hdStopScheduler(void);
void hdGetDoublev(unsigned what, double *values);
void hdGetIntegerv(unsigned what, int *values);
void hdSetDoublev(unsigned what, const double *values);
void hdScheduleSynchronous(unsigned (*call)(void *), void *user, unsigned short priority);
hd_error hdGetError(void);
const char *hdGetErrorString(unsigned code);

unsigned hdInitDevice(const char *name) {
  (void)name;
  problem = fake.plugged ? 0 : 0x0201;
  if (problem) return 0xffffffffu;
  fake.opened++;
  return 7;
}
void hdDisableDevice(unsigned device) {
  if (device == 7) fake.closed++;
}
void hdMakeCurrentDevice(unsigned device) { problem = device == 7 ? 0 : 0x0100; }
void hdBeginFrame(unsigned device) {
  in_frame = device == 7;
  if (!fake.plugged) problem = 0x0201;
}
void hdEndFrame(unsigned device) {
  (void)device;
  in_frame = false;
}
void hdEnable(unsigned what) { enabled = what == 0x4000; }
void hdStartScheduler(void) { running = true; }
void hdStopScheduler(void) { running = false; }
void hdGetDoublev(unsigned what, double *values) {
  if (!in_frame || what != 0x2052) {
    problem = 0x0204;
    return;
  }
  // columns of a quarter turn about z, then the position in mm
  const double t[16] = {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  memcpy(values, t, sizeof t);
  for (int i = 0; i < 3; ++i) values[12 + i] = 1e3 * fake.position_m[i];
}
void hdGetIntegerv(unsigned what, int *values) {
  if (what == 0x2000) *values = 1;
}
void hdSetDoublev(unsigned what, const double *values) {
  if (!in_frame || !enabled || what != 0x2700) problem = 0x0204;
  for (int i = 0; i < 3; ++i) fake.force_n[i] = values[i];
}
void hdScheduleSynchronous(unsigned (*call)(void *), void *user, unsigned short priority) {
  if (!running || !priority) return;
  call(user);
  fake.exchanges++;
}
hd_error hdGetError(void) {
  hd_error error = {problem, 0, 7};
  problem = 0;
  return error;
}
const char *hdGetErrorString(unsigned code) { return code ? "HD_COMM_ERROR" : "HD_SUCCESS"; }
