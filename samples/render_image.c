// The echographic image below a pressed probe.  usage: sample_render_image MODEL PICTURE.png
#include "sonde/sonde.h"

#include <stdio.h>

typedef struct scene {
  sonde_model *model;
  sonde_state *state;
  sonde_interior *interior;
  sonde_echo *echo;
  sonde_probe probe;
  sonde_image image;
} scene;

static sonde_status build(scene *s, const char *path, sonde_error *error) {
  sonde_world_def def = sonde_world_def_default();
  sonde_echo_def image = sonde_echo_def_default();
  image.seed = 1;
  sonde_status status = sonde_model_load(path, &s->model, error);
  if (!status) status = sonde_probe_create("linear", &s->probe, error);
  if (!status) status = sonde_state_create(s->model, &def, &s->state, error);
  if (!status) status = sonde_interior_create(s->model, &s->interior, error);
  if (!status) status = sonde_echo_create(s->interior, &image, &s->echo, error);
  if (!status) status = sonde_image_create(512, 512, &s->image, error);
  return status;
}

// One state for all three: skin, inside and picture show the same moment.
static sonde_status render(scene *s, const sonde_pathology *pathology, sonde_error *error) {
  const sonde_site *site = &s->model->sites[0];
  sonde_pose pose = sonde_site_pose(site, 0.006);
  sonde_path_result press;
  sonde_status status = sonde_settle_path(s->state, &s->probe, sonde_site_pose(site, 0), pose, NULL,
                                          NULL, &press, error);
  if (status) return status;
  sonde_interior_input input = {sonde_state_positions(s->state),
                                sonde_state_contact_forces(s->state),
                                pose,
                                pathology,
                                -1.0,
                                0,
                                s->probe.half_x_m,
                                s->probe.half_y_m,
                                0,
                                SONDE_POSTURE_SUPINE,
                                NULL};
  sonde_interior_update(s->interior, &input);
  sonde_echo_settings settings = sonde_echo_settings_default();
  sonde_echo_render(s->echo, pose, 2 * s->probe.half_x_m, pathology, &settings, &s->image);
  return SONDE_OK;
}

int main(int argc, char **argv) {
  if (argc != 3) {
    fprintf(stderr, "usage: %s MODEL PICTURE.png\n", argv[0]);
    return 2;
  }
  scene s = {0};
  sonde_error error;
  sonde_pathology healthy;
  sonde_status status = build(&s, argv[1], &error);
  if (!status) status = sonde_pathology_preset("healthy", &healthy, &error);
  if (!status) status = render(&s, &healthy, &error);
  if (!status) status = sonde_image_save_png(&s.image, argv[2], &error);
  if (!status)
    printf("%s: %u x %u\n", argv[2], s.image.width, s.image.height);
  else
    fprintf(stderr, "%s\n", error.message);
  sonde_image_clear(&s.image);
  sonde_echo_destroy(s.echo);
  sonde_interior_destroy(s.interior);
  sonde_state_destroy(s.state);
  sonde_probe_clear(&s.probe);
  sonde_model_destroy(s.model);
  return status ? 1 : 0;
}
