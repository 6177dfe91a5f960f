// Presses the linear probe 8 mm deep at the first site of a model, waits for rest and prints the
// force.  usage: sample_press_once MODEL
#include "sonde/sonde.h"

#include <stdio.h>

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
      sonde_probe_create("linear", &probe, &error) != SONDE_OK ||
      sonde_state_create(model, &def, &state, &error) != SONDE_OK) {
    fprintf(stderr, "%s\n", error.message);
    goto done;
  }
  const sonde_site *site = &model->sites[0];
  sonde_path_result press;
  sonde_status status = sonde_settle_path(state, &probe, sonde_site_pose(site, 0),
                                          sonde_site_pose(site, 0.008), NULL, NULL, &press, &error);
  if (status) fprintf(stderr, "%s\n", error.message);
  sonde_settle_result settled = press.settled;
  const sonde_contact *contact = sonde_state_contact(state);
  printf("%s after %u iterations, %u jumps\n", settled.converged ? "at rest" : "not at rest",
         press.iterations, press.jump_count);
  printf("probe %.3f N, tissue %.3f N, contact area %.1f mm^2\n", settled.contact_n,
         settled.reaction_n, contact->area_m2 * 1e6);
  result = status ? 1 : 0;
done:
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  sonde_model_destroy(model);
  return result;
}
