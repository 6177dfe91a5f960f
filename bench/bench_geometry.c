// bench_geometry MESH [UNIT_M]: processor time of the geometry that runs once per subject, on a
// closed surface (PLY, OBJ or STL; UNIT_M metres per unit of the file, default 1e-3): reading the
// file, building the surface index, one inside test, and building a probe from the same vertices.
// Each figure is the median of REPEATS runs.
#include <sonde/sonde.h>

#include "bench.h"

#include <stdio.h>
#include <stdlib.h>

enum { REPEATS = 9, QUERIES = 20000 };

static double median(double *seconds) {
  bench_sort(seconds, REPEATS);
  return seconds[REPEATS / 2];
}

int main(int count, char **arguments) {
  if (count < 2 || count > 3) {
    fprintf(stderr, "usage: bench_geometry MESH [UNIT_M]\n");
    return 2;
  }
  double unit_m = count > 2 ? strtod(arguments[2], NULL) : 1e-3;
  double read_s[REPEATS], index_s[REPEATS], inside_s[REPEATS], probe_s[REPEATS];
  sonde_error error = {0};
  uint32_t faces = 0;
  int inside = 0;
  for (int k = 0; k < REPEATS; ++k) {
    sonde_mesh mesh;
    sonde_surface_index *index;
    double start_s = bench_seconds();
    if (sonde_mesh_load(arguments[1], unit_m, &mesh, &error)) break;
    read_s[k] = bench_seconds() - start_s;
    start_s = bench_seconds();
    sonde_status status = sonde_surface_index_create(&mesh, &index, &error);
    index_s[k] = bench_seconds() - start_s;
    faces = mesh.face_count;
    if (!status) {
      // Query points lie on the segments from each vertex to the opposite one in the list.
      start_s = bench_seconds();
      for (uint32_t q = 0; q < QUERIES; ++q) {
        sonde_vec3 a = mesh.vertices[q % mesh.vertex_count];
        sonde_vec3 b = mesh.vertices[(q + mesh.vertex_count / 2) % mesh.vertex_count];
        double share = 1.2 * q / QUERIES;
        inside += sonde_surface_inside(index, (sonde_vec3){a.x + share * (b.x - a.x),
                                                           a.y + share * (b.y - a.y),
                                                           a.z + share * (b.z - a.z)});
      }
      inside_s[k] = (bench_seconds() - start_s) / QUERIES;
      sonde_surface_index_destroy(index);
    }
    sonde_mesh_clear(&mesh);
    sonde_probe probe;
    start_s = bench_seconds();
    if (status || sonde_probe_create(arguments[1], &probe, &error)) break;
    probe_s[k] = bench_seconds() - start_s;
    sonde_probe_clear(&probe);
  }
  if (error.status) {
    fprintf(stderr, "bench_geometry: %s\n", error.message);
    return error.status == SONDE_MEMORY ? 1 : 2;
  }
  printf("%u faces: read %.1f ms, surface index %.1f ms, inside test %.2f us, probe hull %.1f ms\n",
         faces, 1e3 * median(read_s), 1e3 * median(index_s), 1e6 * median(inside_s),
         1e3 * median(probe_s));
  return inside > 0 ? 0 : 1;
}
