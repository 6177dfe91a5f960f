// Strain beside a picture: the probe goes half a millimetre further, both envelopes are tracked,
// and the interior tells how the same places moved.
#include "image_strain.h"
#include "app.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double further_m = 0.5e-3, residual = 1e-6;
static const float alike = 0.8f; // correlation at which speckle counts as found again

// How much deeper each pixel of the grid is drawn now, m, for tissue that was there before.
static void find_moves(const image_strain *s, const settled *at, sonde_pose before,
                       const sonde_truth *truth, float *moved) {
  const double pitch = truth->width_m / truth->width;
  const double top = s->settings->depth_m - truth->height_m;
  assert(moved && pitch > 0);
  for (size_t i = 0; i < (size_t)truth->width * truth->height; ++i) {
    sonde_pose rest_at = before;
    for (int k = 0; k < 3; ++k)
      rest_at =
          pose_shift(rest_at, (double)truth->place_m[i][k] - (double)truth->displacement_m[i][k],
                     pose_axis(before, k));
    const sonde_vec3 rest = rest_at.position;
    const sonde_vec3 by = sonde_interior_displacement(at->interior, rest);
    const sonde_vec3 now = {rest.x + by.x, rest.y + by.y, rest.z + by.z};
    const double was = top + ((double)(i / truth->width) + 0.5) * pitch;
    moved[i] = (float)(sonde_truth_drawn(s->echo, now).z - was);
  }
}

// From blue (stiff) over green to red (twice the mean strain and more); black: not known.
static sonde_status write_picture(const char *path, const image_strain *s,
                                  const sonde_strain *tracked, const float *strain,
                                  const bool *known, sonde_error *error) {
  const uint32_t width = s->image->width, height = s->image->height;
  uint8_t palette[256][3] = {{0, 0, 0}}, *pixels = calloc(width, height);
  for (int k = 1; k < 256; ++k) {
    const double x = (k - 1) / 254.0;
    for (int c = 0; c < 3; ++c)
      palette[k][c] = (uint8_t)(255 * fmin(fmax(1.5 - fabs(4 * x - 3 + c), 0), 1));
  }
  const double pixel = s->image->width_m / width, pitch = s->aperture_m / (tracked->lines - 1);
  for (size_t i = 0; i < (size_t)width * height && pixels; ++i) {
    const double x = ((double)(i % width) + 0.5 - 0.5 * width) * pixel / pitch;
    const double line = floor(x + 0.5 * (tracked->lines - 1) + 0.5);
    const double depth = ((double)(i / width) + 0.5) * pixel;
    const double row = floor((depth - tracked->first_m) / tracked->hop_m + 0.5);
    if (line < 0 || line >= tracked->lines || row < 0 || row >= tracked->rows) continue;
    const size_t at = (size_t)row * tracked->lines + (size_t)line;
    const double share = -(double)strain[at] / (2 * fabs(s->mean) + 1e-12);
    if (known[at]) pixels[i] = (uint8_t)(1 + 254 * fmin(fmax(share, 0), 1));
  }
  const sonde_colours picture = {.width = width,
                                 .height = height,
                                 .frames = 1,
                                 .colours = 256,
                                 .palette = (const uint8_t(*)[3])palette,
                                 .pixels = pixels};
  const sonde_status status = pixels ? sonde_colours_save_png(&picture, path, error)
                                     : app_error(error, SONDE_MEMORY, "no memory");
  free(pixels);
  return status;
}

static sonde_status write_table(const char *path, const image_strain *s,
                                const sonde_strain *tracked, const float *moved, const float *slope,
                                const uint8_t *label, sonde_error *error) {
  sonde_file *file;
  const sonde_status status = sonde_file_create(path, &file, error);
  const double pitch = s->aperture_m / (tracked->lines - 1);
  if (status) return status;
  sonde_file_printf(file, "x_mm,depth_mm,tissue,displacement_um,true_displacement_um,strain,"
                          "true_strain,correlation\n");
  for (size_t i = 0; i < (size_t)tracked->rows * tracked->lines; ++i) {
    const double x = (double)(i % tracked->lines) - 0.5 * (tracked->lines - 1);
    sonde_file_printf(file, "%.3f,%.3f,%s,%.2f,%.2f,%.6f,%.6f,%.4f\n", 1e3 * x * pitch,
                      1e3 * (tracked->first_m + (double)(i / tracked->lines) * tracked->hop_m),
                      sonde_truth_label_name((sonde_label)label[i]),
                      1e6 * (double)tracked->displacement_m[i], 1e6 * (double)moved[i],
                      (double)tracked->strain[i], (double)slope[i], (double)tracked->likeness[i]);
  }
  return sonde_file_commit(file, error);
}

// The true displacement at the tracked places, its slope and the label there; means over what is
// tissue and was found again.
static void compare(image_strain *s, const sonde_truth *truth, const float *moves,
                    const sonde_strain *tracked, float *moved, float *slope, uint8_t *label,
                    bool *known) {
  static const bool IS_TISSUE[SONDE_LABEL_COUNT] = {
      [SONDE_LABEL_SKIN] = true,   [SONDE_LABEL_FAT] = true,     [SONDE_LABEL_MUSCLE] = true,
      [SONDE_LABEL_FASCIA] = true, [SONDE_LABEL_NODE] = true,    [SONDE_LABEL_TENDON] = true,
      [SONDE_LABEL_NERVE] = true,  [SONDE_LABEL_THROMBUS] = true};
  const double pitch = truth->width_m / truth->width;
  const double top = s->settings->depth_m - truth->height_m;
  assert(tracked->lines == truth->width && truth->height >= 2);
  for (size_t i = 0; i < (size_t)tracked->rows * tracked->lines; ++i) {
    const size_t row = i / tracked->lines, line = i % tracked->lines;
    const double at = (tracked->first_m + (double)row * tracked->hop_m - top) / pitch - 0.5;
    const double low = fmin(fmax(floor(at), 0), truth->height - 2), t = at - low;
    const size_t from = (size_t)low * truth->width + line;
    moved[i] = moves[from] + (float)t * (moves[from + truth->width] - moves[from]);
    label[i] = truth->tissue[from + (t > 0.5 ? truth->width : 0)];
  }
  sonde_strain_slopes(tracked, moved, tracked->likeness, slope);
  double n = 0, sum = 0, square = 0, all = 0;
  for (size_t i = 0; i < (size_t)tracked->rows * tracked->lines; ++i) {
    known[i] = IS_TISSUE[label[i]] && tracked->likeness[i] > alike;
    all += IS_TISSUE[label[i]];
    if (!known[i]) continue;
    const double off = (double)tracked->strain[i] - (double)slope[i];
    n += 1, sum += (double)slope[i], square += off * off;
  }
  s->mean = n > 0 ? sum / n : NAN, s->error = n > 0 ? sqrt(square / n) : NAN;
  s->tracked = all > 0 ? n / all : 0;
}

sonde_status image_strain_write(const char *folder, settled *s, image_strain *strain,
                                sonde_error *error) {
  assert(folder && s && strain && strain->echo);
  uint32_t lines, samples;
  const float *envelope = sonde_echo_envelope(strain->echo, &lines, &samples);
  float *before = malloc((size_t)lines * samples * sizeof *before);
  const double pitch = strain->aperture_m / (lines - 1);
  // The picture's lines and depths as pixels, which the truth takes.
  const uint32_t down = (uint32_t)(strain->settings->depth_m / pitch);
  const sonde_image grid = {
      .width = lines, .height = down, .width_m = lines * pitch, .height_m = down * pitch};
  sonde_image after = {0};
  const size_t pixels = (size_t)grid.width * grid.height;
  float *moves = malloc(pixels * sizeof *moves);
  sonde_truth truth = {0};
  sonde_strain tracked = {0};
  sonde_status status =
      before && moves ? SONDE_OK : app_error(error, SONDE_MEMORY, "no memory for strain");
  if (!status) memcpy(before, envelope, (size_t)lines * samples * sizeof *before);
  if (!status) status = sonde_truth_create(strain->echo, &grid, &truth, error);
  if (!status)
    status = sonde_image_create(strain->image->width, strain->image->height, &after, error);
  if (!status) {
    // The probe goes on along its beam from where the press began.
    const sonde_pose pose = s->pose;
    const sonde_pose start = pose_shift(pose, -s->depth_m, pose_axis(pose, 2));
    settled_at(s, start, s->depth_m + further_m, residual);
    settled_update(s, strain->pathology, 0, sonde_state_tick(s->state));
    sonde_echo_render(strain->echo, s->pose, strain->aperture_m, strain->pathology,
                      strain->settings, &after);
    find_moves(strain, s, pose, &truth, moves);
    envelope = sonde_echo_envelope(strain->echo, &lines, &samples);
    status = sonde_strain_track(before, envelope, lines, samples,
                                strain->settings->depth_m / (samples - 1), NULL, &tracked, error);
  }
  const size_t places = (size_t)tracked.rows * tracked.lines + 1;
  float *moved = calloc(places, sizeof *moved), *slope = calloc(places, sizeof *slope);
  uint8_t *label = calloc(places, 1);
  bool *known = calloc(places, sizeof *known);
  if (!status && !(moved && slope && label && known))
    status = app_error(error, SONDE_MEMORY, "no memory for strain");
  if (!status) {
    char path[4096];
    compare(strain, &truth, moves, &tracked, moved, slope, label, known);
    status = sonde_directory_make(folder, 0777, true, error);
    for (int which = 0; which < 2 && !status; ++which) {
      snprintf(path, sizeof path, "%s/%s", folder, which ? "strain_true.png" : "strain.png");
      status = write_picture(path, strain, &tracked, which ? slope : tracked.strain, known, error);
    }
    snprintf(path, sizeof path, "%s/strain.csv", folder);
    if (!status) status = write_table(path, strain, &tracked, moved, slope, label, error);
  }
  free(moved), free(slope), free(label), free(known), free(before), free(moves);
  sonde_strain_clear(&tracked), sonde_truth_clear(&truth), sonde_image_clear(&after);
  return status;
}
