// sonde devices: the input devices of this machine.
#include "app.h"

#include <getopt.h>
#include <stdio.h>

static const char help[] =
    "usage: sonde devices [--probe] [--json]\n"
    "\n"
    "Lists the input devices that hold the probe and whether this machine has them.\n"
    "\n"
    "  --probe  open each device for a moment instead of only looking for its library\n"
    "  --json   print one JSON object\n"
    "  --help   this text\n";

static void print_json(const sonde_device_info *info, uint32_t count) {
  app_json_begin();
  for (uint32_t i = 0; i < count; ++i) {
    app_json_object(info[i].name);
    app_json_text("description", info[i].description);
    app_json_bool("available", info[i].available);
    app_json_text("reason", info[i].reason);
    app_json_close();
  }
  app_json_end();
}

static void print_table(const sonde_device_info *info, uint32_t count) {
  printf("%-14s %-9s %-48s %s\n", "device", "available", "what it does", "why");
  for (uint32_t i = 0; i < count; ++i)
    printf("%-14s %-9s %-48s %s\n", info[i].name, info[i].available ? "yes" : "no",
           info[i].description, info[i].reason);
}

int cmd_devices(int argc, char **argv) {
  static const struct option options[] = {{"json", no_argument, NULL, 'j'},
                                          {"probe", no_argument, NULL, 'p'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
  bool json = false, probe = false;
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
    if (option == 'h') {
      fputs(help, stdout);
      return APP_OK;
    }
    if (option != 'j' && option != 'p')
      return app_usage_error("devices", "unknown option '%s'", argv[optind - 1]);
    json |= option == 'j';
    probe |= option == 'p';
  }
  if (optind < argc) return app_usage_error("devices", "unexpected argument '%s'", argv[optind]);
  sonde_device_info info[32];
  uint32_t count = sonde_devices_find(probe, info, 32);
  if (json)
    print_json(info, count);
  else
    print_table(info, count);
  return APP_OK;
}
