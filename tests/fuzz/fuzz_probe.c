// Probes: a name (first byte even) or a mesh file (odd). A probe that is made presses the leg.
#include "fuzz.h"

#include <math.h>

static void press(const sonde_probe *probe) {
  static sonde_state *state;
  sonde_error error = {SONDE_OK, "", ""};
  FUZZ_CHECK(probe->half_x_m >= 0 && probe->half_y_m >= 0 && isfinite(probe->half_x_m));
  FUZZ_CHECK(probe->body.plane_count >= 4 && probe->body.plane_count <= SONDE_MAX_PROBE_PLANES);
  FUZZ_CHECK(memchr(probe->name, 0, sizeof probe->name) && probe->name[0]);
  if (!state) FUZZ_CHECK(sonde_state_create(fuzz_leg(), NULL, &state, &error) == SONDE_OK);
  sonde_state_reset(state);
  for (int k = 0; k < 3; ++k) sonde_step(state, probe, fuzz_press(fuzz_leg(), 2e-3 * k));
  sonde_vec3 f = sonde_state_contact(state)->force_n;
  FUZZ_CHECK(isfinite(f.x) && isfinite(f.y) && isfinite(f.z));
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  static const char *const names[] = {"probe.ply", "probe.obj", "probe.stl"};
  if (count < 1) return 0;
  sonde_probe probe;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status;
  if (bytes[0] % 2) {
    const char *path = fuzz_file(names[bytes[0] / 2 % 3], bytes + 1, count - 1);
    status = sonde_probe_create(path, &probe, &error);
  } else {
    char *name = fuzz_text(bytes + 1, count - 1);
    bool other_file = !name || strpbrk(name, "/.");
    if (!other_file) status = sonde_probe_create(name, &probe, &error);
    free(name);
    if (other_file) return 0;
  }
  if (fuzz_checked(status, &error)) press(&probe);
  sonde_probe_clear(&probe);
  return 0;
}
