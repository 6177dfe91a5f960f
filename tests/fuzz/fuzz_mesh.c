// Mesh files: any bytes are either a mesh whose faces name existing, finite vertices, or an error.
// The first byte chooses the format.
#include "fuzz.h"

#include <math.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  static const char *const extensions[] = {"ply", "obj", "stl"};
  if (count < 1) return 0;
  const char *path = fuzz_file(extensions[bytes[0] % 3], bytes + 1, count - 1);
  sonde_mesh mesh;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_mesh_load(path, 1e-3, &mesh, &error);
  if (status) {
    fuzz_check_error(status, &error);
    FUZZ_CHECK(!mesh.vertices && !mesh.faces);
  } else {
    for (uint32_t f = 0; f < mesh.face_count; ++f)
      for (int k = 0; k < 3; ++k) FUZZ_CHECK(mesh.faces[f][k] < mesh.vertex_count);
    for (uint32_t v = 0; v < mesh.vertex_count; ++v) FUZZ_CHECK(isfinite(mesh.vertices[v].x));
    sonde_mesh_report report;
    status = sonde_mesh_inspect(&mesh, &report, &error);
    if (status) fuzz_check_error(status, &error);
    sonde_mesh_clear(&mesh);
  }
  unlink(path);
  return 0;
}
