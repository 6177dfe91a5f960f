// Scenes (first byte even) and tetrahedra of TetGen (odd: NAME.node, a line "--", NAME.ele). A
// small scene that is read is advanced by a few ticks, saved and loaded again.
#include "fuzz.h"
#include "scene/scene.h"

#include <math.h>

enum { TICKS = 3, MOST_NODES = 1500, MOST_PAIRS = 30 };

// Whether a few ticks of it take milliseconds.
static bool is_small(const sonde_scene *scene) {
  uint32_t count = sonde_scene_body_count(scene), nodes = 0;
  for (uint32_t b = 0; b < count; ++b) {
    sonde_body_info info = sonde_scene_body(scene, b);
    nodes += info.node_count + (info.surface ? info.surface->vertex_count : 0);
  }
  return nodes <= MOST_NODES && count * (count - 1) / 2 <= MOST_PAIRS;
}

static void simulate(sonde_scene *scene) {
  sonde_scene_state *state = NULL;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_scene_step step = sonde_scene_get_step(scene);
  if (step.newton_iterations > 4) step.newton_iterations = 4;
  if (step.solver.max_iterations > 300) step.solver.max_iterations = 300;
  if (step.substep_halvings > 3) step.substep_halvings = 3;
  FUZZ_CHECK(sonde_scene_set_step(scene, &step, &error) == SONDE_OK);
  sonde_status status = sonde_scene_state_create(scene, &state, &error);
  if (status) {
    FUZZ_CHECK(error.status == status && error.message[0]);
    return;
  }
  for (int k = 0; k < TICKS; ++k) sonde_scene_advance(state);
  const char *path = fuzz_path("scene.snapshot");
  FUZZ_CHECK(sonde_scene_state_save(state, path, &error) == SONDE_OK);
  uint64_t hash = sonde_scene_hash(state);
  status = sonde_scene_state_load(state, path, &error);
  if (status) fprintf(stderr, "%s\n", error.message);
  FUZZ_CHECK(status == SONDE_OK && sonde_scene_hash(state) == hash);
  sonde_scene_state_destroy(state);
}

// The mesh that scenes may name.
static void write_body(void) {
  sonde_probe probe;
  sonde_error error = {SONDE_OK, "", ""};
  static bool written;
  if (written) return;
  FUZZ_CHECK(sonde_probe_create("rect:10x10", &probe, &error) == SONDE_OK);
  FUZZ_CHECK(sonde_mesh_save(fuzz_path("body.ply"), 1e-3, &probe.body.hull, &error) == SONDE_OK);
  sonde_probe_clear(&probe);
  written = true;
}

static void run(const char *text) {
  write_body();
  sonde_scene *scene = NULL;
  sonde_error error = {SONDE_OK, "", ""};
  const char *name = fuzz_path("scene.yaml");
  bool good = fuzz_checked(sonde_scene_parse(text, name, fuzz_leg_file(), &scene, &error), &error);
  FUZZ_CHECK(good || strstr(error.message, "scene.yaml:"));
  if (good && is_small(scene)) simulate(scene);
  sonde_scene_destroy(scene);
}

static void run_tetrahedra(const char *text) {
  const char *cut = strstr(text, "\n--\n");
  size_t first = cut ? (size_t)(cut + 1 - text) : strlen(text);
  const char *second = cut ? cut + 4 : "";
  fuzz_file("solid.node", (const uint8_t *)text, first);
  fuzz_file("solid.ele", (const uint8_t *)second, strlen(second));
  run("sonde_scene: 1\nbodies:\n- {name: solid, kind: lattice, density_kg_m3: 1000, "
      "lattice: {tetrahedra: solid, youngs_pa: 1e4}}\n");
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  char *text = count > 1 ? fuzz_text(bytes + 1, count - 1) : NULL;
  if (!text) return 0;
  // A scene names other files; only those in the directory of the target are read.
  bool outside = strstr(text, "/") || strstr(text, "..");
  if (!outside && bytes[0] % 2)
    run_tetrahedra(text);
  else if (!outside)
    run(text);
  free(text);
  return 0;
}
