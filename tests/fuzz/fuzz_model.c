// Model files: the input is a list of edits (three bytes of place, one byte of value) to a valid
// file, whose checksum is then made right again so that the reader goes on. It has to refuse the
// file or hand out a model whose indices and sizes hold.
#include "fuzz.h"

#include <math.h>
#include <zlib.h>

static char *valid;
static size_t valid_count;

// A small closed skin: a box of 8 vertices, big enough for the default vessels.
static void make_skin(sonde_mesh *skin, sonde_error *error) {
  static const uint32_t faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                        {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                        {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  FUZZ_CHECK(sonde_mesh_create(skin, 8, 12, error) == SONDE_OK);
  for (uint32_t i = 0; i < 8; ++i)
    skin->vertices[i] = (sonde_vec3){i & 1 ? 0.08 : -0.08, i & 2 ? 0.08 : -0.08, i & 4 ? 0.2 : 0.0};
  memcpy(skin->faces, faces, sizeof faces);
}

static void make_valid(void) {
  sonde_error error = {SONDE_OK, "", ""};
  sonde_mesh skin;
  make_skin(&skin, &error);
  sonde_site site = {1, {0.08, 0, 0.1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, 2e5, 0.05, 1.2, 0.9};
  sonde_model_def def = sonde_model_def_default();
  def.name = "box";
  def.provenance = "made for the fuzzer";
  def.skin = &skin;
  def.sites = &site;
  def.site_count = 1;
  def.fine_edge_m = 0.05;
  sonde_model *model = NULL;
  sonde_status status = sonde_model_build(&def, &model, &error);
  if (status) fprintf(stderr, "%s\n", error.message);
  FUZZ_CHECK(status == SONDE_OK);
  const char *path = fuzz_file("sonde", (const uint8_t *)"", 0);
  FUZZ_CHECK(sonde_model_save(model, path, &error) == SONDE_OK);
  FUZZ_CHECK(sonde_file_load(path, &valid, &valid_count, &error) == SONDE_OK);
  unlink(path);
  sonde_model_destroy(model);
  sonde_mesh_clear(&skin);
}

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

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  if (!valid) make_valid();
  uint8_t *file = malloc(valid_count);
  FUZZ_CHECK(file);
  memcpy(file, valid, valid_count);
  for (size_t i = 0; i + 4 <= count; i += 4) {
    size_t place = (size_t)bytes[i] | (size_t)bytes[i + 1] << 8 | (size_t)bytes[i + 2] << 16;
    file[place % (valid_count - 4)] = bytes[i + 3];
  }
  uint32_t sum = (uint32_t)crc32(0, file, (uInt)(valid_count - 4));
  memcpy(file + valid_count - 4, &sum, 4);
  const char *path = fuzz_file("sonde", file, valid_count);
  sonde_model *model = NULL;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_model_load(path, &model, &error);
  if (count < 4)
    FUZZ_CHECK(status == SONDE_OK); // the untouched file: the checksum is where we think
  if (status)
    fuzz_check_error(status, &error);
  else
    check_model(model);
  sonde_model_destroy(model);
  unlink(path);
  free(file);
  return 0;
}
