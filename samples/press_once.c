// Presses the linear probe at the first site of a model: 8 mm deep, then to a force of 5 N, on the
// model's tissue and on tissue half as stiff again.  usage: sample_press_once MODEL
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
  sonde_status status = sonde_model_load(argv[1], &model, &error);
  if (status == SONDE_OK) status = sonde_probe_create("linear", &probe, &error);
  if (status == SONDE_OK) status = sonde_state_create(model, &def, &state, &error);

  const double stiffness[] = {1, 1.5};
  for (int k = 0; k < 2 && status == SONDE_OK; ++k) {
    sonde_tuning tissue = sonde_tuning_default();
    tissue.stiffness_scale = stiffness[k];
    sonde_state_reset(state);
    status = sonde_state_tune(state, &tissue, &error);

    // To a depth: the probe goes straight from the skin to a pose below it.
    const sonde_site *site = &model->sites[0];
    sonde_pose skin = sonde_site_pose(site, 0), deep = sonde_site_pose(site, 0.008);
    sonde_path_result press;
    if (status == SONDE_OK)
      status = sonde_settle_path(state, &probe, skin, deep, NULL, NULL, &press, &error);
    if (status != SONDE_OK) break;
    printf("stiffness x %.1f: 8 mm deep %.3f N on %.1f mm^2, %s, %u jumps\n", stiffness[k],
           press.force_n, sonde_state_contact(state)->area_m2 * 1e6,
           press.settled.converged ? "at rest" : "not at rest", press.jump_count);

    // To a force: the same way, no farther than to where the force is met.
    sonde_state_reset(state);
    sonde_path_def to_force = sonde_path_def_default();
    to_force.force_n = 5;
    status = sonde_settle_path(state, &probe, skin, sonde_site_pose(site, 0.030), &to_force, NULL,
                               &press, &error);
    if (status == SONDE_OK)
      printf("stiffness x %.1f: %.3f N at %.2f mm\n", stiffness[k], press.force_n,
             press.way_m * 1e3);
  }
  if (status != SONDE_OK) fprintf(stderr, "%s\n", error.message);
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  sonde_model_destroy(model);
  return status == SONDE_OK ? 0 : 1;
}
