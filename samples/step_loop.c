// Presses and releases in lockstep: a step per millisecond of simulated time, a line per 50 ms.
// The hash at the end is the same on every run.  usage: sample_step_loop MODEL
#include "sonde/sonde.h"

#include <math.h>
#include <stdio.h>

static double norm(sonde_vec3 v) { return sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

int main(int argc, char **argv) {
  if (argc != 2) {
    fprintf(stderr, "usage: %s MODEL\n", argv[0]);
    return 2;
  }
  sonde_model *model = NULL;
  sonde_state *state = NULL;
  sonde_probe probe = {0};
  sonde_world_def def = sonde_world_def_default();
  sonde_error error;
  int result = 1;
  if (sonde_model_load(argv[1], &model, &error) != SONDE_OK ||
      sonde_probe_create("square", &probe, &error) != SONDE_OK ||
      sonde_state_create(model, &def, &state, &error) != SONDE_OK) {
    fprintf(stderr, "%s\n", error.message);
    goto done;
  }
  for (int tick = 1; tick <= 500; ++tick) {
    double t = tick * def.dt_s;
    double depth_m = 0.010 * sin(3.14159265358979 * t / 0.5); // down and up in half a second
    sonde_step(state, &probe, sonde_site_pose(&model->sites[0], depth_m));
    if (tick % 50 == 0)
      printf("%3d ms  depth %5.2f mm  force %6.3f N  %5u nodes awake\n", tick, depth_m * 1e3,
             norm(sonde_state_contact(state)->force_n), sonde_state_awake(state));
  }
  printf("hash %016llx\n", (unsigned long long)sonde_state_hash(state));
  result = sonde_state_flags(state) & SONDE_FLAG_NON_FINITE ? 1 : 0;
done:
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  sonde_model_destroy(model);
  return result;
}
