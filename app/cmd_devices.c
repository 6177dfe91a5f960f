// sonde devices: the input devices of this machine.
#include "options.h"

#include <assert.h>
#include <stdio.h>

typedef struct options {
  bool probe, json;
} options;

static const app_option TABLE[] = {
    OPT_FLAG(probe, "probe",
             "open each device for a moment instead of only looking for its library"),
    OPT_JSON(json)};

static int run(void *from) {
  const options *o = from;
  sonde_device_info info[32];
  uint32_t count = sonde_devices_find(o->probe, info, 32);
  assert(count <= 32);
  if (o->json)
    app_json_begin();
  else
    printf("%-14s %-9s %-48s %s\n", "device", "available", "what it does", "why");
  for (const sonde_device_info *d = info; d < info + count; ++d) {
    if (!o->json) {
      printf("%-14s %-9s %-48s %s\n", d->name, d->available ? "yes" : "no", d->description,
             d->reason);
      continue;
    }
    app_json_object(d->name);
    app_json("description:%s available:%hhd reason:%s", d->description, d->available, d->reason);
    app_json_close();
  }
  if (o->json) app_json_end();
  return APP_OK;
}

const app_command cmd_devices = {
    .verb = "devices",
    .summary = "list the input devices of this machine",
    .usage = "[--probe] [--json]",
    .text = "Lists the input devices that hold the probe and whether this machine has them.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .run = run};
