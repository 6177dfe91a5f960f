// The truth beside a picture, as files in a folder: label maps with their colours, and vectors.
#include "image_truth.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>

// Colours of the tissues, in the order of sonde_label.
static const uint8_t TISSUE[SONDE_LABEL_COUNT][3] = {
    {0, 0, 0},       {255, 205, 178}, {255, 230, 128}, {178, 76, 76},
    {240, 240, 220}, {120, 140, 230}, {40, 60, 200},   {130, 30, 130},
    {240, 140, 120}, {220, 20, 20},   {90, 170, 90},   {60, 200, 220},
    {110, 60, 20},   {200, 200, 200}, {230, 170, 220}, {250, 210, 40}};

sonde_status image_truth_write(const char *folder, const sonde_echo *echo,
                               const sonde_interior *interior, const sonde_image *image,
                               sonde_error *error) {
  assert(folder && echo && interior && image);
  sonde_truth truth = {0};
  char path[4096];
  uint8_t vessel[256][3];
  // Colours of vessels are far apart for neighbours.
  for (uint32_t k = 0; k < 256; ++k)
    for (int c = 0; c < 3; ++c)
      vessel[k][c] = k ? (uint8_t)(64 + (k * 2654435761u >> (8 * c) & 191)) : 0;
  sonde_status status = sonde_directory_make(folder, 0777, true, error);
  if (!status) status = sonde_truth_create(echo, image, &truth, error);
  const struct {
    const char *name;
    const uint8_t *pixels, (*palette)[3];
    uint32_t colours;
  } maps[] = {{"tissue.png", truth.tissue, TISSUE, SONDE_LABEL_COUNT},
              {"vessel.png", truth.vessel, (const uint8_t(*)[3])vessel, 256}};
  for (size_t k = 0; k < sizeof maps / sizeof *maps && !status; ++k) {
    const sonde_colours picture = {.width = truth.width,
                                   .height = truth.height,
                                   .frames = 1,
                                   .colours = maps[k].colours,
                                   .palette = maps[k].palette,
                                   .pixels = maps[k].pixels};
    snprintf(path, sizeof path, "%s/%s", folder, maps[k].name);
    status = sonde_colours_save_png(&picture, path, error);
  }
  const struct {
    const char *name, *unit;
    const float (*vectors)[3];
  } fields[] = {{"place.nrrd", "m", (const float(*)[3])truth.place_m},
                {"displacement.nrrd", "m", (const float(*)[3])truth.displacement_m},
                {"velocity.nrrd", "m/s", (const float(*)[3])truth.velocity_m_s}};
  for (size_t k = 0; k < sizeof fields / sizeof *fields && !status; ++k) {
    snprintf(path, sizeof path, "%s/%s", folder, fields[k].name);
    status = sonde_truth_save_vectors(&truth, fields[k].vectors, fields[k].unit, path, error);
  }
  snprintf(path, sizeof path, "%s/labels.csv", folder);
  sonde_file *file = NULL;
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_printf(file, "picture,value,name,red,green,blue\n");
    for (int k = 0; k < SONDE_LABEL_COUNT; ++k)
      sonde_file_printf(file, "tissue,%d,%s,%d,%d,%d\n", k, sonde_truth_label_name((sonde_label)k),
                        TISSUE[k][0], TISSUE[k][1], TISSUE[k][2]);
    const uint32_t count = sonde_interior_vessel_count(interior);
    for (uint32_t k = 0; k <= count && k < 256; ++k)
      sonde_file_printf(file, "vessel,%u,%s,%d,%d,%d\n", k,
                        k ? sonde_interior_vessel_name(interior, (int)k - 1) : "none", vessel[k][0],
                        vessel[k][1], vessel[k][2]);
    status = sonde_file_commit(file, error);
  }
  sonde_truth_clear(&truth);
  return status;
}
