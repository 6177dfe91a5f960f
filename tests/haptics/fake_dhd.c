// A fake libdhd: the functions that the driver uses, a device that a test can unplug.
#include "fake.h"

fake_control fake;

int dhdOpen(void);
int dhdClose(char id);
int dhdStop(char id);
int dhdEnableForce(unsigned char on, char id);
int dhdGetPositionAndOrientationFrame(double *x, double *y, double *z, double r[3][3], char id);
int dhdSetForceAndTorque(double fx, double fy, double fz, double tx, double ty, double tz, char id);
unsigned dhdGetButtonMask(char id);
const char *dhdErrorGetLastStr(void);

int dhdOpen(void) {
  if (!fake.plugged) return -1;
  fake.opened++;
  return 3;
}
int dhdClose(char id) {
  fake.closed++;
  return id == 3 ? 0 : -1;
}
int dhdStop(char id) { return id == 3 ? 0 : -1; }
int dhdEnableForce(unsigned char on, char id) { return on && id == 3 ? 0 : -1; }
int dhdGetPositionAndOrientationFrame(double *x, double *y, double *z, double r[3][3], char id) {
  if (!fake.plugged || id != 3) return -1;
  const double turn[3][3] = {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}};
  memcpy(r, turn, sizeof turn);
  *x = fake.position_m[0];
  *y = fake.position_m[1];
  *z = fake.position_m[2];
  fake.exchanges++;
  return 1; // "sooner than the device refreshes" is no error
}
int dhdSetForceAndTorque(double fx, double fy, double fz, double tx, double ty, double tz,
                         char id) {
  if (!fake.plugged || id != 3) return -1;
  (void)tx, (void)ty, (void)tz;
  fake.force_n[0] = fx;
  fake.force_n[1] = fy;
  fake.force_n[2] = fz;
  return 0;
}
unsigned dhdGetButtonMask(char id) { return id == 3 ? 1 : 0; }
const char *dhdErrorGetLastStr(void) { return fake.plugged ? "no error" : "no device found"; }
