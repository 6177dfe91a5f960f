// The device that sonde run follows: its driver, its limits, where it stands.
#ifndef SONDE_APP_RUN_DEVICE_H
#define SONDE_APP_RUN_DEVICE_H

#include "sonde/sonde.h"

// The command line's part of it; zero where nothing was said.
typedef struct run_device {
  const char *name;    // page, script, hand, replay, a driver or a row of the limits; NULL: default
  const char *at;      // a site's number or a landmark's name; NULL: site 27
  const char *limits;  // a row of the limits; NULL: the device's own
  const char *from;    // recording to replay
  const char *library; // of the driver
  long port;           // of its service
  long clutch;         // button, from 1; 0: none
  double force_scale;  // 0: from the limits
  double seconds;      // that the scripted exam has to last
  bool headless, lockstep;
} run_device;

// Fills in the default name. false after saying what is wrong.
bool run_device_check(run_device *device);
// Where the probe starts. @return NOT_FOUND, MISMATCH for a model without sites
sonde_status run_device_site(const run_device *device, const sonde_model *model, sonde_site *site,
                             sonde_error *error);
// Limits and rendering of the device into the session's definition.
void run_device_limits(const run_device *device, sonde_session_def *def);
// @return DEVICE with the reason when it is not there
sonde_status run_device_create(const run_device *device, const sonde_site *site,
                               const sonde_session_def *def, sonde_device *out, sonde_error *error);

#endif
