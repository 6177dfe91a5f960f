// Snapshots of a scene: the checksum is made right so that the reader goes on; what is loaded is
// advanced by a few ticks.
#include "fuzz.h"
#include "scene/scene.h"

#include "fuzz_scene_text.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  enum { HEADER = 40 };
  static sonde_scene *scene;
  static sonde_scene_state *state;
  sonde_error error = {SONDE_OK, "", ""};
  if (!scene) {
    FUZZ_CHECK(sonde_scene_parse(FUZZ_SCENE, "snapshot.yaml", NULL, &scene, &error) == SONDE_OK);
    FUZZ_CHECK(sonde_scene_state_create(scene, &state, &error) == SONDE_OK);
  }
  uint8_t *file = malloc(count + 1);
  FUZZ_CHECK(file);
  memcpy(file, bytes, count);
  if (count > HEADER) {
    uint64_t hash = sonde_hash(0, file + HEADER, count - HEADER);
    memcpy(file + HEADER - sizeof hash, &hash, sizeof hash);
  }
  const char *path = fuzz_file("scene.snapshot", file, count);
  free(file);
  if (fuzz_checked(sonde_scene_state_load(state, path, &error), &error))
    for (int k = 0; k < 3; ++k) sonde_scene_advance(state);
  return 0;
}
