/* One function of each further library, called on a file that is not there: each tells so. */
#include <sonde/sonde.h>

#include <stdio.h>

int main(void) {
  sonde_image image;
  sonde_sequence sequence;
  sonde_scene *scene = NULL;
  sonde_site_table table;
  sonde_recording_info info;
  sonde_limb_body body = sonde_limb_unknown();
  sonde_error error;
  if (sonde_image_create(2, 2, &image, &error) != SONDE_OK) return 1;
  int good = sonde_image_save_png(&image, "/nowhere/a.png", &error) == SONDE_IO;
  good = good && sonde_sequence_load("/nowhere/a.mha", &sequence, &error) == SONDE_IO;
  good = good && sonde_scene_load("/nowhere/a.yaml", NULL, &scene, &error) == SONDE_IO;
  good = good && sonde_site_table_load("/nowhere/a.csv", &table, &error) == SONDE_IO;
  good = good && sonde_recording_inspect("/nowhere/a.rec", false, &info, &error) == SONDE_IO;
  sonde_hexes hexes;
  sonde_hexes_def fine = sonde_hexes_def_default();
  fine.edge_m = 0;
  good = good && sonde_hexes_block(0.02, 0, 0, &fine, &hexes, &error) == SONDE_ARGUMENT;
  body.bmi = 99;
  good = good && sonde_limb_draw(&body, 1, &body, &error) == SONDE_ARGUMENT;
  sonde_image_clear(&image);
  printf("files, solid, limb, sweep, scene, fit, exam: %s\n", good ? "work" : "FAIL");
  return !good;
}
