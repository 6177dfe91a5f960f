// sonde validate WHAT: measures a room against its targets.
#include "app.h"
#include "validate.h"

#include <stdio.h>
#include <string.h>

static const char HELP[] =
    "usage: sonde validate WHAT [MODEL] [options]\n"
    "\n"
    "Measures a room against its targets; exit code 1 when one is missed.\n"
    "\n"
    "  image             the echographic image: likeness to the exact reference, speckle,\n"
    "                    attenuation, shadows, vessels\n"
    "  haptics           forces in the hand: compute time, local model, stability of every\n"
    "                    operator, faults, friction\n"
    "\n"
    "  --quick           image: fewer scatterers and frames\n"
    "  --pressing FILE   haptics: a recorded pressing motion, columns time s, x y z m; pressed\n"
    "                    along -y\n"
    "  --sites N         haptics: press at N of the model's sites, 1 to 1000; default all\n"
    "  --json            print one JSON object\n"
    "  --help            this text\n";

static const struct {
  const char *name;
  int (*run)(int argc, char **argv);
} PARTS[] = {{"image", validate_image}, {"haptics", validate_haptics}};

int old_validate(int argc, char **argv);
int old_validate(int argc, char **argv) {
  if (argc < 2)
    return app_usage_error("validate", "nothing to validate, expected image or haptics");
  for (int i = 1; i < argc; ++i)
    if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
      fputs(HELP, stdout);
      return APP_OK;
    }
  for (size_t i = 0; i < sizeof PARTS / sizeof *PARTS; ++i)
    if (strcmp(argv[1], PARTS[i].name) == 0) return PARTS[i].run(argc - 1, argv + 1);
  return app_usage_error("validate", "unknown '%s', expected image or haptics", argv[1]);
}
