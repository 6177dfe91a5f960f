// Reads a surface in millimetres, says what it is and may write it again in metres.
// usage: sample_load_mesh FILE [COPY]
#include "sonde/sonde.h"

#include <math.h>
#include <stdio.h>

int main(int argc, char **argv) {
  if (argc != 2 && argc != 3) {
    fprintf(stderr, "usage: %s FILE.ply|.obj|.stl [COPY.ply]\n", argv[0]);
    return 2;
  }
  sonde_error error;
  sonde_mesh mesh;
  if (sonde_mesh_load(argv[1], 1e-3, &mesh, &error) != SONDE_OK) {
    fprintf(stderr, "%s\n", error.message); // names file, line and what was expected
    return 1;
  }
  sonde_mesh_report report;
  sonde_status status = sonde_mesh_inspect(&mesh, &report, &error);
  if (status == SONDE_OK) {
    printf("%u vertices, %u faces, %s\n", mesh.vertex_count, mesh.face_count,
           report.closed ? "closed" : "open");
    printf("area %.1f cm^2, edges %.2f to %.2f mm, smallest angle %.1f degrees\n",
           report.area_m2 * 1e4, report.shortest_edge_m * 1e3, report.longest_edge_m * 1e3,
           report.smallest_angle_rad * 180 / 3.14159265358979);
  }
  if (status == SONDE_OK && report.closed) {
    sonde_mass mass;
    status = sonde_mesh_mass(&mesh, 1000.0, &mass, &error);
    if (status == SONDE_OK) printf("filled with water: %.3f kg\n", mass.mass_kg);
  }
  if (status == SONDE_OK && argc == 3) status = sonde_mesh_save(argv[2], 1.0, &mesh, &error);
  if (status != SONDE_OK) fprintf(stderr, "%s\n", error.message);
  sonde_mesh_clear(&mesh);
  return status == SONDE_OK ? 0 : 1;
}
