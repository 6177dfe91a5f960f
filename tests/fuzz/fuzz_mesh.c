// Mesh files: any bytes are either a mesh whose faces name existing, finite vertices, or an error.
// A mesh that is read is inspected and made a hull. The first byte chooses the format.
#include "fuzz.h"

#include <math.h>

static void use(const sonde_mesh *mesh) {
  sonde_mesh_report report;
  sonde_mass mass;
  sonde_error error = {SONDE_OK, "", ""};
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k) FUZZ_CHECK(mesh->faces[f][k] < mesh->vertex_count);
  for (uint32_t v = 0; v < mesh->vertex_count; ++v) FUZZ_CHECK(isfinite(mesh->vertices[v].x));
  sonde_status status = sonde_mesh_inspect(mesh, &report, &error);
  if (status) FUZZ_CHECK(error.status == status && error.message[0]);
  if (!status && report.closed) {
    status = sonde_mesh_mass(mesh, 1000, &mass, &error);
    FUZZ_CHECK(status || mass.mass_kg > 0);
  }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  static const char *const names[] = {"mesh.ply", "mesh.obj", "mesh.stl"};
  if (count < 1) return 0;
  const char *path = fuzz_file(names[bytes[0] % 3], bytes + 1, count - 1);
  sonde_mesh mesh;
  sonde_error error = {SONDE_OK, "", ""};
  if (fuzz_checked(sonde_mesh_load(path, 1e-3, &mesh, &error), &error))
    use(&mesh);
  else
    FUZZ_CHECK(!mesh.vertices && !mesh.faces);
  sonde_mesh_clear(&mesh);
  return 0;
}
