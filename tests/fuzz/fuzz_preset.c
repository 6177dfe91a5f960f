// Presets: any bytes are either a preset, with which the leg is pressed, or an error. A preset that
// is read and written reads the same again.
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  sonde_preset preset, again;
  sonde_error error = {SONDE_OK, "", ""};
  const char *path = fuzz_file("preset.json", bytes, count);
  if (!fuzz_checked(sonde_preset_load(path, &preset, &error), &error)) return 0;
  sonde_model *model = NULL;
  sonde_world_def def = sonde_world_def_default();
  path = fuzz_path("again.json");
  FUZZ_CHECK(sonde_preset_save(path, &preset, &error) == SONDE_OK);
  FUZZ_CHECK(sonde_preset_load(path, &again, &error) == SONDE_OK);
  FUZZ_CHECK(sonde_model_load(fuzz_leg_file(), &model, &error) == SONDE_OK);
  FUZZ_CHECK(sonde_preset_apply(&preset, model, &def, &error) == SONDE_OK);
  fuzz_step_model(model, &def);
  sonde_model_destroy(model);
  return 0;
}
