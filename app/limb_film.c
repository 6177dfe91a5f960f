#include "limb_film.h"

#include "replay_export.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Section on the left, seen from the feet with the front above; on the right the limb from the
// front with the vein and the place of the section.
enum { SIDE = 300, STRIP = 110, WIDTH = SIDE + STRIP, HEIGHT = SIDE + 22, MOST_FRAMES = 120 };
static const double PIXEL_M = 0.0008, STEP_M = 0.012, FRAME_S = 0.16;

// Numbers of colours; muscles have eight tones from MUSCLE on.
enum {
  WHITE,
  SKIN,
  FAT,
  SHEET,
  TENDON,
  SHEATH,
  NODE,
  NERVE,
  ARTERY_WALL,
  ARTERY,
  VEIN_WALL,
  VEIN,
  BONE,
  SILHOUETTE,
  MARK,
  DEEP_FAT,
  MUSCLE = 16,
  CAPTION = 220,
  COLOURS
};
static const uint8_t PALETTE[COLOURS][3] = {[WHITE] = {255, 255, 255},
                                            [SKIN] = {217, 166, 136},
                                            [FAT] = {246, 223, 154},
                                            [SHEET] = {236, 230, 212},
                                            [TENDON] = {246, 244, 238},
                                            [SHEATH] = {250, 238, 190},
                                            [NODE] = {143, 184, 122},
                                            [NERVE] = {242, 211, 60},
                                            [ARTERY_WALL] = {165, 34, 28},
                                            [ARTERY] = {224, 68, 58},
                                            [VEIN_WALL] = {37, 74, 140},
                                            [VEIN] = {95, 143, 216},
                                            [BONE] = {239, 230, 200},
                                            [SILHOUETTE] = {236, 214, 200},
                                            [MARK] = {30, 30, 30},
                                            [DEEP_FAT] = {247, 236, 200},
                                            [MUSCLE] = {186, 96, 84},
                                            {196, 110, 96},
                                            {178, 90, 86},
                                            {190, 104, 84},
                                            {182, 84, 74},
                                            {200, 104, 100},
                                            {174, 98, 88},
                                            {192, 90, 90},
                                            [CAPTION] = {20, 20, 20}};

typedef struct stop {
  const char *name;
  sonde_vec3 section; // middle of the limb at the vein's level
  sonde_limb_vessel_point at;
} stop;

// Places every STEP_M along the main vein.
static uint32_t plan_walk(const sonde_limb *limb, const sonde_limb_pose *pose, stop *stops) {
  static const char *const VEINS[] = {
      "external iliac vein", "common femoral vein",      "femoral vein",
      "popliteal vein",      "tibioperoneal trunk vein", "posterior tibial vein"};
  uint32_t count = 0;
  double from = 0;
  for (size_t v = 0; v < sizeof VEINS / sizeof *VEINS; ++v) {
    uint32_t b = sonde_limb_vessel_find(limb, VEINS[v]);
    if (b == SONDE_LIMB_NO_VESSEL) continue;
    double length = sonde_limb_vessel_get(limb, b).length_m;
    for (; from < length && count < MOST_FRAMES; from += STEP_M) {
      sonde_limb_vessel_point rest = sonde_limb_vessel_place(limb, b, from);
      double level, angle, f;
      sonde_limb_polar(limb, rest.centre_m, &level, &angle, &f);
      sonde_vec3 middle = sonde_limb_point(limb, level, 0, 0);
      stops[count++] = (stop){VEINS[v], pose ? sonde_limb_pose_point(pose, middle) : middle,
                              pose ? sonde_limb_pose_place(pose, b, from) : rest};
    }
    from -= length;
  }
  return count;
}

static void draw_section(const sonde_limb *limb, const sonde_limb_pose *pose, sonde_vec3 middle,
                         sonde_vec3 right, sonde_vec3 up, uint8_t *frame) {
  static const uint8_t PLAIN[SONDE_LIMB_TISSUES] = {
      [SONDE_LIMB_OUTSIDE] = WHITE, [SONDE_LIMB_SKIN] = SKIN,
      [SONDE_LIMB_FAT] = FAT,       [SONDE_LIMB_SUPERFICIAL_FASCIA] = SHEET,
      [SONDE_LIMB_FASCIA] = SHEET,  [SONDE_LIMB_SEPTUM] = SHEET,
      [SONDE_LIMB_TENDON] = TENDON, [SONDE_LIMB_SHEATH] = SHEATH,
      [SONDE_LIMB_NODE] = NODE,     [SONDE_LIMB_NERVE] = NERVE,
      [SONDE_LIMB_BONE] = BONE};
  for (int j = 0; j < SIDE; ++j)
    for (int i = 0; i < SIDE; ++i) {
      double x = (i + 0.5 - SIDE / 2) * PIXEL_M, y = (SIDE / 2 - j - 0.5) * PIXEL_M;
      sonde_vec3 p = {middle.x + x * right.x + y * up.x, middle.y + x * right.y + y * up.y,
                      middle.z + x * right.z + y * up.z};
      sonde_limb_label at = pose ? sonde_limb_pose_at(pose, p) : sonde_limb_at(limb, p);
      uint8_t colour = PLAIN[at.tissue];
      bool wall = at.tissue == SONDE_LIMB_WALL;
      if (at.tissue == SONDE_LIMB_MUSCLE) colour = (uint8_t)(MUSCLE + (at.index * 5 + 3) % 8);
      if (at.tissue == SONDE_LIMB_FAT && at.index == 1) colour = DEEP_FAT;
      if (wall || at.tissue == SONDE_LIMB_LUMEN) {
        bool artery = sonde_limb_vessel_get(limb, at.index).kind == SONDE_LIMB_ARTERY;
        colour = artery ? (wall ? ARTERY_WALL : ARTERY) : (wall ? VEIN_WALL : VEIN);
      }
      frame[j * WIDTH + i] = colour;
    }
}

// The limb from the front as a silhouette with the walk on it; *low, *scale: of the drawing.
static sonde_status draw_strip(const sonde_limb *limb, const sonde_limb_pose *pose,
                               uint8_t strip[HEIGHT][STRIP], sonde_vec3 *corner, double *scale,
                               sonde_error *error) {
  sonde_mesh skin = {0};
  sonde_status status = pose ? sonde_limb_pose_skin(pose, 0.006, &skin, error)
                             : sonde_limb_skin(limb, 0.006, &skin, error);
  if (status) return status;
  sonde_vec3 low = skin.vertices[0], high = low;
  for (uint32_t i = 0; i < skin.vertex_count; ++i) {
    low.x = fmin(low.x, skin.vertices[i].x), high.x = fmax(high.x, skin.vertices[i].x);
    low.z = fmin(low.z, skin.vertices[i].z), high.z = fmax(high.z, skin.vertices[i].z);
  }
  *scale = fmin((HEIGHT - 12) / (high.z - low.z), (STRIP - 8) / (high.x - low.x));
  *corner = (sonde_vec3){low.x - 4 / *scale, 0, high.z + 6 / *scale};
  memset(strip, WHITE, (size_t)HEIGHT * STRIP);
  // Between the outermost corners of each row; rows without a corner are as the one above.
  int edge[HEIGHT][2];
  for (int j = 0; j < HEIGHT; ++j) edge[j][0] = STRIP, edge[j][1] = -1;
  for (uint32_t n = 0; n < skin.vertex_count; ++n) {
    int i = (int)((skin.vertices[n].x - corner->x) * *scale),
        j = (int)((corner->z - skin.vertices[n].z) * *scale);
    if (j < 0 || j >= HEIGHT) continue;
    if (i < edge[j][0]) edge[j][0] = i;
    if (i > edge[j][1]) edge[j][1] = i;
  }
  for (int j = 0; j < HEIGHT; ++j) {
    const int *row = edge[j];
    if (row[1] < 0 && j > 0 && (corner->z - low.z) * *scale > j)
      edge[j][0] = edge[j - 1][0], edge[j][1] = edge[j - 1][1];
    for (int i = row[0]; i <= row[1] && i < STRIP; ++i)
      if (i >= 0) strip[j][i] = SILHOUETTE;
  }
  sonde_mesh_clear(&skin);
  return SONDE_OK;
}

sonde_status limb_film_write(const sonde_limb *limb, const sonde_limb_pose *pose, const char *path,
                             sonde_error *error) {
  assert(limb && path);
  stop *stops = calloc(MOST_FRAMES, sizeof *stops);
  uint8_t(*strip)[STRIP] = calloc(HEIGHT, STRIP);
  uint32_t count = stops ? plan_walk(limb, pose, stops) : 0;
  size_t size = (size_t)WIDTH * HEIGHT;
  uint8_t *frames = calloc(count ? count : 1, size);
  sonde_vec3 corner = {0, 0, 0};
  double scale = 1;
  sonde_status status = SONDE_OK;
  if (!stops || !strip || !frames) status = app_error(error, SONDE_MEMORY, "out of memory");
  if (!status) status = draw_strip(limb, pose, strip, &corner, &scale, error);
  for (uint32_t f = 0; f < count && !status; ++f) {
    uint8_t *frame = frames + f * size;
    for (int j = 0; j < HEIGHT; ++j) memcpy(frame + j * WIDTH + SIDE, strip[j], STRIP);
    for (uint32_t k = 0; k < count; ++k) {
      // The vein's course, and a bar where the section is.
      int i = (int)((stops[k].at.centre_m.x - corner.x) * scale),
          j = (int)((corner.z - stops[k].at.centre_m.z) * scale);
      for (int n = -2; n < 3; ++n)
        if (i > 0 && i + 1 < STRIP && j + n >= 0 && j + n < HEIGHT)
          frame[(j + n) * WIDTH + SIDE + i] = frame[(j + n) * WIDTH + SIDE + i + 1] = VEIN_WALL;
      for (int n = -26; k == f && n <= 26; ++n)
        if (i + n >= 0 && i + n < STRIP && j >= 0 && j < HEIGHT)
          frame[j * WIDTH + SIDE + i + n] = MARK;
    }
    // Across the vein's mean direction, right to the limb's +x, up to its front.
    const sonde_vec3 *a = &stops[f > 4 ? f - 4 : 0].at.centre_m,
                     *b = &stops[f + 4 < count ? f + 4 : count - 1].at.centre_m;
    sonde_vec3 d = {b->x - a->x, b->y - a->y, b->z - a->z};
    double length = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    d.x /= length, d.y /= length, d.z /= length;
    double across = sqrt(1 - d.x * d.x);
    sonde_vec3 right = {across, -d.x * d.y / across, -d.x * d.z / across};
    sonde_vec3 up = {d.z * right.y - d.y * right.z, d.x * right.z - d.z * right.x,
                     d.y * right.x - d.x * right.y};
    double turn = up.y < 0 ? -1 : 1;
    up.x *= turn, up.y *= turn, up.z *= turn;
    // The middle of the limb, moved into the plane across the vein.
    const sonde_vec3 *vein = &stops[f].at.centre_m;
    sonde_vec3 middle = stops[f].section;
    double off =
        (middle.x - vein->x) * d.x + (middle.y - vein->y) * d.y + (middle.z - vein->z) * d.z;
    middle.x -= off * d.x, middle.y -= off * d.y, middle.z -= off * d.z;
    draw_section(limb, pose, middle, right, up, frame);
    caption_draw(frame, WIDTH, HEIGHT, 6, SIDE + 6, 1, stops[f].name);
  }
  if (!status) {
    sonde_colours walk = {.width = WIDTH,
                          .height = HEIGHT,
                          .frames = count,
                          .frame_s = FRAME_S,
                          .colours = COLOURS,
                          .palette = PALETTE,
                          .pixels = frames};
    status = sonde_colours_save_png(&walk, path, error);
  }
  free(stops);
  free(strip);
  free(frames);
  return status;
}
