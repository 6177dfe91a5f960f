// Colour Doppler over a picture: the network's flow in the pressed vessels, its estimate, and both
// in one picture of few colours.
#include "image_colour.h"

#include "replay_export.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

// Of the palette: greys, then colours from the fastest away to the fastest towards the probe.
enum { GREYS = 128, COLOURS = 127, FRAMES = 5, BAR = 10 };

static void make_palette(bool power, uint8_t palette[GREYS + COLOURS][3]) {
  for (int k = 0; k < GREYS; ++k)
    for (int c = 0; c < 3; ++c) palette[k][c] = (uint8_t)(k * 255 / (GREYS - 1));
  for (int k = 0; k < COLOURS; ++k) {
    uint8_t *rgb = palette[GREYS + k];
    const double v = 2.0 * k / (COLOURS - 1) - 1, m = fabs(v);
    if (power) {
      const double u = 0.5 * (v + 1);
      rgb[0] = (uint8_t)(255 * fmin(0.25 + 1.1 * u, 1)), rgb[1] = (uint8_t)(220 * u * u);
      rgb[2] = (uint8_t)(90 * u * u * u);
    } else if (v >= 0) { // red to yellow: towards the probe
      rgb[0] = (uint8_t)(255 * fmin(0.35 + 1.1 * m, 1)), rgb[1] = (uint8_t)(235 * m * m);
      rgb[2] = (uint8_t)(40 * m * m);
    } else { // blue to cyan: away from it
      rgb[0] = (uint8_t)(40 * m * m), rgb[1] = (uint8_t)(235 * m * m);
      rgb[2] = (uint8_t)(255 * fmin(0.4 + 1.1 * m, 1));
    }
  }
}

// The frame of colour in a picture.
static void paint(const image_colour *of, const sonde_colour_box *box, sonde_colour *colour,
                  const sonde_image *image, uint8_t *scratch, uint8_t *pixels) {
  sonde_colour_overlay over = {.pixels = scratch};
  sonde_colour_paint(colour, box, 0, of->power, image, &over);
  for (size_t i = 0; i < (size_t)image->width * image->height; ++i)
    pixels[i] = (uint8_t)(image->pixels[i] * (GREYS - 1) / 255);
  for (uint32_t y = 0; y < over.height; ++y)
    for (uint32_t x = 0; x < over.width; ++x) {
      const uint8_t shown = over.pixels[(size_t)y * over.width + x];
      if (shown)
        pixels[(size_t)(over.top + y) * image->width + over.left + x] =
            (uint8_t)(GREYS + (shown - 1) * (COLOURS - 1) / 254);
    }
}

// Whether the box holds a pixel's middle.
static bool holds(const sonde_colour_box *box, const sonde_image *image, double column,
                  double row) {
  const double size = image->width_m / image->width, edge = 0.5 + 1e-9;
  double at[2];
  (void)sonde_colour_find(box, (column + 0.5 - 0.5 * image->width) * size,
                          image->top_m + (row + 0.5) * size, at);
  return at[0] >= -edge && at[0] <= SONDE_COLOUR_LINES - 1 + edge && at[1] >= -edge &&
         at[1] <= SONDE_COLOUR_ROWS - 1 + edge;
}

// The bar at the right edge, and the box's outline.
static void draw_frame(const image_colour *of, const sonde_colour_box *box, double limit,
                       const sonde_image *image, uint8_t *pixels) {
  const uint32_t width = image->width, height = image->height, top = height / 16 + 12,
                 length = height / 3;
  // Pixels in the box, some of whose neighbours are not.
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x)
      if (holds(box, image, x, y) &&
          !(holds(box, image, x - 1.0, y) && holds(box, image, x + 1.0, y) &&
            holds(box, image, x, y - 1.0) && holds(box, image, x, y + 1.0)))
        pixels[(size_t)y * width + x] = GREYS - 30;
  for (uint32_t y = 0; y < length && top + y < height; ++y)
    for (uint32_t x = 0; x < BAR && x + BAR + 4 < width; ++x)
      pixels[(size_t)(top + y) * width + width - 4 - BAR + x] =
          (uint8_t)(GREYS + (length - 1 - y) * (COLOURS - 1) / (length - 1));
  // The scale in cm/s at both ends, drawn by a grey picture of its own.
  char text[16];
  uint8_t *grey = calloc((size_t)width * height, 1);
  snprintf(text, sizeof text, "%.0f", 100 * limit);
  const uint32_t wide = (uint32_t)strlen(text) * CAPTION_WIDTH + 4;
  if (grey && !of->power && width > 2 * wide && top > 12) {
    caption_draw(grey, width, height, width - wide, top - 11, 1, text);
    caption_draw(grey, width, height, width - wide, top + length + 3, 1, text);
    caption_draw(grey, width, height, width - wide - CAPTION_WIDTH, top + length + 3, 1, "-");
    for (size_t i = 0; i < (size_t)width * height; ++i)
      if (grey[i]) pixels[i] = GREYS - 1;
  }
  free(grey);
}

// A file with a line for each cell that holds blood or colour.
static sonde_status write_cells(const char *path, const settled *s, const sonde_colour_box *box,
                                const sonde_colour_cell *cells, const sonde_colour_value *value,
                                sonde_error *error) {
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "x_mm,z_mm,vessel,true_cm_s,colour_cm_s,power_db,shown\n");
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    const bool blood = cells[i].vessel != SONDE_COLOUR_NO_VESSEL,
               shown = value[i].power > SONDE_COLOUR_POWER;
    double xz[2];
    if (!blood && !shown) continue;
    sonde_colour_place(box, i % SONDE_COLOUR_LINES, i / SONDE_COLOUR_LINES, xz);
    sonde_file_printf(file, "%.3f,%.3f,%s,%.3f,%.3f,%.1f,%d\n", 1e3 * xz[0], 1e3 * xz[1],
                      blood ? sonde_interior_vessel_name(s->interior, (int)cells[i].vessel) : "",
                      100 * (double)cells[i].towards_m_s, 100 * (double)value[i].velocity_m_s,
                      10 * log10(fmax((double)value[i].power, 1e-3)), shown);
  }
  return sonde_file_commit(file, error);
}

static void compare(const sonde_colour_cell *cells, const sonde_colour_value *value,
                    image_colour_result *r) {
  double sum = 0;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    const bool blood = cells[i].vessel != SONDE_COLOUR_NO_VESSEL,
               shown = value[i].power > SONDE_COLOUR_POWER;
    r->blood += blood, r->shown += blood && shown, r->beside += !blood && shown;
    if (!blood || !shown) continue;
    // The nearest of the velocities that fold to the same colour.
    double off = ((double)value[i].velocity_m_s - (double)cells[i].towards_m_s) / r->limit_m_s;
    off -= 2 * round(off / 2);
    sum += pow(off * r->limit_m_s, 2);
  }
  r->error_m_s = r->shown ? sqrt(sum / r->shown) : NAN;
}

sonde_status image_colour_draw(const image_colour *of, const settled *s, const sonde_echo *echo,
                               const sonde_image *image, double aperture_m, double radius_m,
                               double frequency_hz, uint64_t seed, const char *path,
                               image_colour_result *result, sonde_error *error) {
  sonde_flow_scene *scene = NULL;
  sonde_colour *colour = NULL;
  // The network in the pressed vessels.
  const sonde_limb *limb = sonde_limb_of(s->model);
  sonde_flow_def blood = sonde_flow_def_default(limb);
  sonde_flow flow;
  sonde_flow_def_hold(sonde_limb_pose_of(s->model), &blood);
  if (!isnan(of->squeeze_s)) blood.squeeze_from_s = of->squeeze_s;
  sonde_status status = sonde_flow_scene_create(limb, s->interior, &scene, error);
  if (!status) sonde_flow_scene_narrow(scene, &blood);
  if (!status) status = sonde_flow_start(&blood, &flow, error);
  if (!status) sonde_flow_scene_run(scene, &flow, of->at_s);
  sonde_colour_cell *cells = calloc(SONDE_COLOUR_CELLS, sizeof *cells);
  uint8_t *pixels = malloc((size_t)image->width * image->height);
  uint8_t *scratch = malloc((size_t)image->width * image->height);
  if (!status && !(cells && pixels && scratch))
    status = app_error(error, SONDE_MEMORY, "out of memory");
  const double margin = 1e-3;
  const bool given = !isnan(of->box_m[0]);
  sonde_colour_box box = {given ? of->box_m[0] : -0.5 * aperture_m + margin,
                          given ? of->box_m[1] : 0.5 * aperture_m - margin,
                          given ? of->box_m[2] : 2 * margin,
                          given ? of->box_m[3] : image->top_m + image->height_m - margin,
                          isnan(of->steer_rad) ? 0 : of->steer_rad,
                          radius_m};
  sonde_colour_def def = sonde_colour_def_default();
  def.frequency_hz = fmin(frequency_hz, 5e6), def.seed = seed, def.persistence = 0.5;
  if (!status) {
    // Steered by 20 degrees to the side on which the blood is faster along the beam.
    static const double TRY[] = {0, 0.349, -0.349};
    double best = -1, chosen = box.steer_rad;
    for (size_t k = 0; k < (radius_m > 0 ? 1 : sizeof TRY / sizeof *TRY) && isnan(of->steer_rad);
         ++k) {
      double sum = 0;
      box.steer_rad = TRY[k];
      sonde_flow_scene_cells(scene, echo, &box, cells);
      for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) sum += fabs((double)cells[i].towards_m_s);
      if (sum > 1.3 * best) best = sum, chosen = TRY[k];
    }
    box.steer_rad = chosen;
    sonde_flow_scene_cells(scene, echo, &box, cells);
    double fastest = 0.04;
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
      fastest = fmax(fastest, fabs((double)cells[i].towards_m_s));
    const double scale = isnan(of->scale_m_s) ? 1.25 * fastest : of->scale_m_s;
    def.pulse_hz = fmin(fmax(def.pulse_hz * scale / sonde_colour_limit(&def), 100), 2e4);
    status = sonde_colour_create(&def, &colour, error);
  }
  if (!status) {
    *result =
        (image_colour_result){.limit_m_s = sonde_colour_limit(&def), .steer_rad = box.steer_rad};
    // As of a live picture: frames that hold on, the first of which is not timed.
    const sonde_colour_value *value = NULL;
    clock_t from = 0;
    for (int k = 0; k <= FRAMES; ++k) {
      if (k == 1) from = clock();
      sonde_flow_scene_cells(scene, echo, &box, cells);
      value = sonde_colour_frame(colour, cells);
      paint(of, &box, colour, image, scratch, pixels);
    }
    result->frame_s = (double)(clock() - from) / CLOCKS_PER_SEC / FRAMES;
    compare(cells, value, result);
    draw_frame(of, &box, result->limit_m_s, image, pixels);
    uint8_t palette[GREYS + COLOURS][3];
    make_palette(of->power, palette);
    const sonde_colours picture = {
        image->width, image->height, 1, 1, GREYS + COLOURS, (const uint8_t(*)[3])palette, pixels};
    status = sonde_colours_save_png(&picture, path, error);
    for (uint32_t v = 0; v < sonde_interior_vessel_count(s->interior) && v < IMAGE_VESSELS; ++v)
      result->mean_m_s[v] = sonde_flow_scene_velocity(scene, v, s->pose);
    if (!status && of->cells) status = write_cells(of->cells, s, &box, cells, value, error);
  }
  free(cells), free(pixels), free(scratch);
  sonde_colour_destroy(colour);
  sonde_flow_scene_destroy(scene);
  return status;
}

void image_colour_tell(const image_colour_result *r, const settled *s, bool json) {
  if (!json) {
    printf("colour  %.1f cm/s, steered by %.0f degrees: %u of %u cells with blood in colour, %u "
           "beside, within %.1f cm/s\n",
           100 * r->limit_m_s, r->steer_rad * 180 / M_PI, r->shown, r->blood, r->beside,
           100 * r->error_m_s);
    return;
  }
  app_json_object("colour");
  app_json("limit_cm_s:%g steer_deg:%g frame_ms:%g", 100 * r->limit_m_s, r->steer_rad * 180 / M_PI,
           1e3 * r->frame_s);
  app_json("blood_cells:%u shown_cells:%u shown_beside:%u error_cm_s:%g", r->blood, r->shown,
           r->beside, 100 * r->error_m_s);
  app_json_object("mean_cm_s");
  for (uint32_t v = 0; v < sonde_interior_vessel_count(s->interior) && v < IMAGE_VESSELS; ++v) {
    sonde_vessel_state at;
    if (sonde_interior_vessel_at_plane(s->interior, (int)v, s->pose, &at))
      app_json_real(sonde_interior_vessel_name(s->interior, (int)v), 100 * r->mean_m_s[v]);
  }
  app_json_close();
  app_json_close();
}
