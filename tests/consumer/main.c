/* A program of somebody else: presses a built-in probe's polyhedron through the public interface.
 */
#include <sonde/sonde.h>

#include <math.h>
#include <stdio.h>

int main(void) {
  sonde_error error = {SONDE_OK, "", ""};
  sonde_probe probe;
  if (sonde_probe_create("linear", &probe, &error) != SONDE_OK) {
    fprintf(stderr, "%s\n", error.message);
    return 1;
  }
  sonde_mass mass;
  sonde_status status = sonde_mesh_mass(&probe.body.hull, 1000.0, &mass, &error);
  int good = status == SONDE_OK && fabs(probe.half_x_m - 0.030) < 1e-12 && mass.mass_kg > 0;
  good = good && sonde_probe_create("finger", &probe, &error) == SONDE_NOT_FOUND;
  printf("libsonde %s: %s\n", sonde_version(), good ? "works" : "FAILS");
  return !good;
}
