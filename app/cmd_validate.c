// sonde validate WHAT: measures a room against its targets.
#include "options.h"
#include "validate.h"

#include <assert.h>
#include <string.h>

typedef struct options {
  const char *what, *model, *pressing;
  long sites;
  bool quick, json;
} options;

static const app_option TABLE[] = {
    OPT_ARGUMENT(
        what, "WHAT",
        "image: the echographic image on synthetic legs, against the exact reference, path "
        "integrals and the mechanics: likeness, speckle, attenuation, shadows, vessels; "
        "haptics: forces in the hand, without hardware: compute time of the full model, the "
        "local model fed at 100 Hz, stability of simulated operators of 0.1 to 2 kg and 0 "
        "to 5 N s/m with the limits of three devices, injected faults, friction"),
    OPT_MODEL(model),
    OPT_FLAG(quick, "quick", "image: fewer scatterers and frames"),
    OPT_TEXT(pressing, "pressing", "FILE",
             "haptics: also plays a recorded hand: lines of time in s and position x, y, z in m, "
             "pressed along -y; a third of the motion is used, at most 30 mm"),
    OPT_INTEGER(sites, "sites", "N", 1, 1000,
                "haptics: press at N of the model's sites; default all"),
    OPT_FLAG(json, "json",
             "print one JSON object: of each measure its value, least and most allowed, target in "
             "words, pass; then how many passed and failed")};

static int check(void *from) {
  options *o = from;
  if (!o->what)
    return app_usage_error("validate", "nothing to validate, expected image or haptics");
  if (strcmp(o->what, "haptics") == 0)
    return o->quick ? app_usage_error("validate", "--quick belongs to image") : APP_OK;
  if (strcmp(o->what, "image") != 0)
    return app_usage_error("validate", "unknown '%s', expected image or haptics", o->what);
  if (o->model) return app_usage_error("validate", "unexpected argument after image");
  if (o->pressing || o->sites)
    return app_usage_error("validate", "--pressing and --sites belong to haptics");
  o->model = ""; // none is read
  return APP_OK;
}

static int run(void *from) {
  const options *o = from;
  assert(o->what && o->model);
  if (strcmp(o->what, "image") == 0) return validate_image(o->quick, o->json);
  return validate_haptics(o->model, o->pressing, o->sites, o->json);
}

const app_command cmd_validate = {
    .verb = "validate",
    .summary = "measure a room against its targets",
    .usage = "image [--quick] [--json]\nhaptics [MODEL] [--pressing FILE] [--sites N] [--json]",
    .text = "Measures a room against its targets: prints each measure with its target and whether "
            "it was reached; exit code 1 when one is missed.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .check = check,
    .run = run};
