// Model files. The first byte chooses: an even one is followed by a list of edits (three bytes of
// place, one byte of value) to a valid file, an odd one by the file itself. The checksum is made
// right so that the reader goes on. The reader has to refuse the file or hand out a model whose
// indices and sizes hold; the model is pressed and seen.
#include "fuzz.h"

#include <math.h>
#include <zlib.h>

static void check_model(const sonde_model *model) {
  uint32_t nodes = model->surface.vertex_count;
  FUZZ_CHECK(nodes > 0 && model->topology.vertex_count == nodes);
  for (uint32_t f = 0; f < model->surface.face_count; ++f)
    for (int k = 0; k < 3; ++k) FUZZ_CHECK(model->surface.faces[f][k] < nodes);
  for (uint32_t i = 0; i < nodes; ++i) {
    FUZZ_CHECK(isfinite(model->k0_n_m3[i]) && model->k0_n_m3[i] > 0);
    FUZZ_CHECK(isfinite(model->xm_m[i]) && model->xm_m[i] > 0 && model->mass_kg[i] > 0);
  }
  FUZZ_CHECK(model->vein.count <= SONDE_VESSEL_POINTS);
  FUZZ_CHECK(memchr(model->name, 0, sizeof model->name) != NULL);
}

// The file that the input means; *size receives its length, freed by the caller.
static uint8_t *file_of(const uint8_t *bytes, size_t count, size_t *size) {
  static char *valid;
  static size_t valid_count;
  sonde_error error = {SONDE_OK, "", ""};
  if (!valid)
    FUZZ_CHECK(sonde_file_load(fuzz_leg_file(), &valid, &valid_count, &error) == SONDE_OK);
  bool whole = bytes[0] % 2;
  *size = whole ? count - 1 : valid_count;
  uint8_t *file = malloc(*size + 4);
  FUZZ_CHECK(file);
  memcpy(file, whole ? bytes + 1 : (const uint8_t *)valid, *size);
  for (size_t i = 1; !whole && i + 4 <= count; i += 4) {
    size_t place = (size_t)bytes[i] | (size_t)bytes[i + 1] << 8 | (size_t)bytes[i + 2] << 16;
    file[place % (valid_count - 4)] = bytes[i + 3];
  }
  return file;
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  if (count < 1) return 0;
  size_t size;
  uint8_t *file = file_of(bytes, count, &size);
  if (size >= 4) {
    uint32_t sum = (uint32_t)crc32(0, file, (uInt)(size - 4));
    memcpy(file + size - 4, &sum, 4);
  }
  const char *path = fuzz_file("model.sonde", file, size);
  free(file);
  sonde_model *model = NULL;
  sonde_error error = {SONDE_OK, "", ""};
  if (fuzz_checked(sonde_model_load(path, &model, &error), &error)) {
    sonde_pathology healthy;
    FUZZ_CHECK(sonde_pathology_preset("healthy", &healthy, &error) == SONDE_OK);
    check_model(model);
    fuzz_step_model(model, NULL);
    if ((bytes[0] & 2) && fuzz_chosen(bytes, count, 8)) fuzz_picture(model, &healthy, NULL);
  }
  sonde_model_destroy(model);
  return 0;
}
