// Labelled sections in the style of an anatomical atlas, seen from the feet.
#include "limb/bones.h"
#include "limb/muscles.h"
#include "limb/trace.h"
#include "sonde/files.h"

#include <string.h>

enum { PIXELS = 560, STRUCTURES = 240, OUTLINE = 16384, WIDTH = 1180, HEIGHT = 760 };
static const double LEFT_PX = 310, TOP_PX = 70;

// A structure of the drawing: where a leader line begins, and how it is filled.
typedef struct structure {
  sonde_limb_label label;
  const char *name;
  uint32_t pixels;
  double x, y; // centroid, then the pixel of the structure that is nearest to it
} structure;

typedef struct atlas {
  const sonde_limb *limb;
  double level, metres; // of a pixel
  sonde_vec3 centre;    // of the drawing, in the limb's own frame
  limb_raster raster;
  uint32_t count;
  structure list[STRUCTURES];
  double (*outline)[2];
} atlas;

// Labels of all pixels as numbers of structures + 1.
static void label_pixels(atlas *a) {
  for (uint32_t j = 1; j + 1 < PIXELS; ++j)
    for (uint32_t i = 1; i + 1 < PIXELS; ++i) {
      sonde_vec3 p = vec3(a->centre.x + (i + 0.5 - PIXELS / 2) * a->metres,
                          a->centre.y - (j + 0.5 - PIXELS / 2) * a->metres, a->centre.z);
      sonde_limb_label label = sonde_limb_at(a->limb, p);
      // Fat, skin and fascia are the ground; the others are drawn by themselves.
      if (label.tissue != SONDE_LIMB_MUSCLE && label.tissue != SONDE_LIMB_TENDON &&
          label.tissue < SONDE_LIMB_NODE)
        continue;
      uint32_t k = 0;
      while (k < a->count &&
             (a->list[k].label.tissue != label.tissue || a->list[k].label.index != label.index))
        ++k;
      if (k == STRUCTURES) continue;
      structure *s = &a->list[k];
      if (k == a->count) {
        *s = (structure){.label = label, .name = sonde_limb_name(a->limb, label)};
        ++a->count;
      }
      ++s->pixels, s->x += i, s->y += j;
      a->raster.value[j * PIXELS + i] = (uint16_t)(k + 1);
    }
  // The leader's end: the structure's own pixel nearest to the centroid.
  double nearest[STRUCTURES];
  for (uint32_t k = 0; k < a->count; ++k) {
    SONDE_ASSERT(a->list[k].pixels > 0);
    a->list[k].x /= a->list[k].pixels, a->list[k].y /= a->list[k].pixels, nearest[k] = INFINITY;
  }
  double at[STRUCTURES][2];
  for (uint32_t j = 0; j < PIXELS; ++j)
    for (uint32_t i = 0; i < PIXELS; ++i) {
      uint32_t k = a->raster.value[j * PIXELS + i];
      if (!k--) continue;
      double d = hypot(i - a->list[k].x, j - a->list[k].y);
      if (d < nearest[k]) nearest[k] = d, at[k][0] = i, at[k][1] = j;
    }
  for (uint32_t k = 0; k < a->count; ++k) a->list[k].x = at[k][0], a->list[k].y = at[k][1];
}

static void choose_look(const structure *s, char *look, size_t room) {
  const char *fill = "#e8e8e8", *line = "#555";
  char colour[16];
  double thin = 0.5;
  if (s->label.tissue == SONDE_LIMB_MUSCLE) {
    // Reds whose tone tells neighbours apart.
    uint32_t h = s->label.index * 2654435761U;
    snprintf(colour, sizeof colour, "#%02x%02x%02x", 176 + (h >> 28), 88 + (h >> 24 & 15) * 2,
             80 + (h >> 20 & 15) * 2);
    fill = colour, line = "#6d2a26";
  } else if (s->label.tissue == SONDE_LIMB_BONE) {
    fill = "#efe6c8", line = "#7a6a3a", thin = 1.4;
  } else if (s->label.tissue == SONDE_LIMB_TENDON) {
    fill = "#f6f4ee", line = "#8a8a80";
  } else if (s->label.tissue == SONDE_LIMB_NERVE) {
    fill = "#f2d33c", line = "#8a7410";
  } else if (s->label.tissue == SONDE_LIMB_NODE) {
    fill = "#8fb87a", line = "#4a6a3a";
  } else {
    bool artery = strstr(s->name, "arter") || strstr(s->name, "iliac a");
    bool wall = s->label.tissue == SONDE_LIMB_WALL;
    fill = artery ? (wall ? "#a5221c" : "#e0443a") : (wall ? "#254a8c" : "#5f8fd8"), line = "none";
  }
  snprintf(look, room, "fill='%s' stroke='%s' stroke-width='%g'", fill, line, thin);
}

// The circle of radii about the section's centre, as corners of an outline.
static void put_contour(const atlas *a, sonde_file *file,
                        double (*radius)(const sonde_limb *, double, double), const char *look) {
  enum { CORNERS = 240 };
  double xy[CORNERS][2], mirror = a->limb->body.side == SONDE_LIMB_LEFT ? -1 : 1;
  sonde_vec3 c = limb_centre(a->limb, a->level);
  for (uint32_t k = 0; k < CORNERS; ++k) {
    double angle = 2 * SONDE_PI * k / CORNERS, r = radius(a->limb, a->level, angle);
    double x = mirror * (c.x + r * sin(angle)) - a->centre.x,
           y = c.y + r * cos(angle) - a->centre.y;
    xy[k][0] = LEFT_PX + PIXELS / 2 + x / a->metres, xy[k][1] = TOP_PX + PIXELS / 2 - y / a->metres;
  }
  sonde_svg_put_outlines(file, (const double(*)[2])xy, CORNERS, CORNERS, look);
}

static double under_skin(const sonde_limb *limb, double level, double angle) {
  return limb_skin_radius(limb, level, angle) - limb->body.skin_m;
}
static double superficial_fascia(const sonde_limb *limb, double level, double angle) {
  return limb_fascia_radius(limb, level, angle) + limb_deep_fat(limb, level, angle);
}

static void put_structures(atlas *a, sonde_file *file) {
  put_contour(a, file, limb_skin_radius, "fill='#d9a688' stroke='#7d5138' stroke-width='0.8'");
  put_contour(a, file, under_skin, "fill='#f6df9a'");
  put_contour(a, file, superficial_fascia,
              "fill='none' stroke='#c9a85a' stroke-width='0.7' stroke-dasharray='5 2'");
  put_contour(a, file, limb_fascia_radius, "fill='#f7ecc8' stroke='#f4f1e6' stroke-width='3'");
  put_contour(a, file, limb_fascia_radius, "fill='none' stroke='#8f8468' stroke-width='0.6'");
  static const sonde_limb_tissue ORDER[] = {SONDE_LIMB_MUSCLE, SONDE_LIMB_TENDON, SONDE_LIMB_BONE,
                                            SONDE_LIMB_NODE,   SONDE_LIMB_NERVE,  SONDE_LIMB_WALL,
                                            SONDE_LIMB_LUMEN};
  for (size_t o = 0; o < SONDE_COUNT_OF(ORDER); ++o)
    for (uint32_t k = 0; k < a->count; ++k) {
      if (a->list[k].label.tissue != ORDER[o]) continue;
      char look[120];
      choose_look(&a->list[k], look, sizeof look);
      memset(a->raster.done, 0, (size_t)PIXELS * PIXELS);
      uint32_t start = 0, corners;
      while ((corners = limb_trace(&a->raster, (uint16_t)(k + 1), a->outline, OUTLINE, &start))) {
        for (uint32_t i = 0; i < corners; ++i)
          a->outline[i][0] += LEFT_PX, a->outline[i][1] += TOP_PX;
        sonde_svg_put_outlines(file, (const double(*)[2])a->outline, corners, corners, look);
      }
    }
}

// Names in two columns beside the drawing, in the order of their heights, with leader lines.
static void put_names(atlas *a, sonde_file *file) {
  uint32_t order[STRUCTURES], named = 0;
  for (uint32_t k = 0; k < a->count; ++k) {
    bool twice = a->list[k].pixels < 6;
    // A wall has the name of its lumen.
    for (uint32_t i = 0; i < a->count && !twice; ++i)
      twice = a->list[k].label.tissue == SONDE_LIMB_WALL && i != k &&
              a->list[i].label.tissue == SONDE_LIMB_LUMEN &&
              !strcmp(a->list[i].name, a->list[k].name);
    if (!twice) order[named++] = k;
  }
  for (uint32_t i = 1; i < named; ++i)
    for (uint32_t j = i; j > 0 && a->list[order[j]].y < a->list[order[j - 1]].y; --j) {
      uint32_t k = order[j];
      order[j] = order[j - 1], order[j - 1] = k;
    }
  for (int side = 0; side < 2; ++side) {
    uint32_t members[STRUCTURES], count = 0;
    for (uint32_t i = 0; i < named; ++i)
      if ((a->list[order[i]].x >= PIXELS / 2) == side) members[count++] = order[i];
    if (!count) continue;
    double room = HEIGHT - 2 * TOP_PX, gap = fmin(24, room / count), y = TOP_PX,
           x = side ? LEFT_PX + PIXELS + 16 : LEFT_PX - 16;
    for (uint32_t i = 0; i < count; ++i) {
      const structure *s = &a->list[members[i]];
      double left = (count - i) * gap; // what the names below need
      y = fmin(fmax(y, TOP_PX + s->y), HEIGHT - TOP_PX - left + gap);
      double line[3][2] = {
          {x, y - 4}, {side ? x - 12 : x + 12, y - 4}, {LEFT_PX + s->x, TOP_PX + s->y}};
      sonde_svg_put_line(file, (const double(*)[2])line, 3,
                         "fill='none' stroke='#333' stroke-width='0.5'");
      sonde_svg_put_circle(file, line[2][0], line[2][1], 1.2, "fill='#111'");
      sonde_svg_put_text(file, side ? x + 4 : x - 4, y, side ? "" : "class='end'", s->name);
      y += gap;
    }
  }
}

sonde_status sonde_limb_section_svg(const sonde_limb *limb, double level, const char *path,
                                    sonde_error *error) {
  SONDE_ASSERT(limb && path);
  if (!(level >= LIMB_TOP && level <= 2))
    return sonde_fail(error, SONDE_ARGUMENT, "level is %g, expected %g to 2", level, LIMB_TOP);
  atlas *a = SONDE_NEW(atlas, 1);
  sonde_file *file = NULL;
  sonde_status status = a ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    double reach = 0;
    for (uint32_t k = 0; k < 72; ++k)
      reach = fmax(reach, limb_skin_radius(limb, level, 2 * SONDE_PI * k / 72));
    *a = (atlas){.limb = limb, .level = level, .metres = 2.06 * reach / PIXELS};
    a->centre = limb_centre(limb, level);
    if (limb->body.side == SONDE_LIMB_LEFT) a->centre.x = -a->centre.x;
    a->raster = (limb_raster){PIXELS, SONDE_NEW(uint16_t, PIXELS * PIXELS),
                              SONDE_NEW(uint8_t, PIXELS * PIXELS)};
    a->outline = sonde_calloc(OUTLINE, sizeof *a->outline);
    if (!a->raster.value || !a->raster.done || !a->outline) status = sonde_fail_memory(error);
  }
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    label_pixels(a);
    char title[160];
    bool left = limb->body.side == SONDE_LIMB_LEFT;
    snprintf(title, sizeof title,
             "%s %s, level %.2f, %.0f mm %s the hip joint's centre, seen from the feet",
             left ? "Left" : "Right",
             level < 0      ? "groin"
             : level < 0.85 ? "thigh"
             : level < 1.1  ? "knee"
                            : "leg",
             level, 1e3 * fabs(limb_z(limb, level)), level < 0 ? "above" : "below");
    sonde_svg_begin(file, title, WIDTH, HEIGHT);
    sonde_svg_put_text(file, 24, 30, "class='head'", title);
    put_structures(a, file);
    put_names(a, file);
    const char *const sides[] = {"front", "back", left ? "medial" : "lateral",
                                 left ? "lateral" : "medial"};
    double middle = LEFT_PX + PIXELS / 2;
    sonde_svg_put_text(file, middle, TOP_PX - 8, "class='tick middle'", sides[0]);
    sonde_svg_put_text(file, middle, TOP_PX + PIXELS + 16, "class='tick middle'", sides[1]);
    sonde_svg_put_text(file, LEFT_PX, TOP_PX + PIXELS + 16, "class='tick'", sides[2]);
    sonde_svg_put_text(file, LEFT_PX + PIXELS, TOP_PX + PIXELS + 16, "class='tick end'", sides[3]);
    const double bar[2][2] = {{LEFT_PX, HEIGHT - 40}, {LEFT_PX + 0.02 / a->metres, HEIGHT - 40}};
    sonde_svg_put_line(file, bar, 2, "stroke='#222' stroke-width='3'");
    sonde_svg_put_text(file, LEFT_PX, HEIGHT - 24, "class='tick'", "20 mm");
    status = sonde_svg_end(file, error);
  }
  if (a) {
    sonde_free(a->raster.value);
    sonde_free(a->raster.done);
    sonde_free(a->outline);
  }
  sonde_free(a);
  return status;
}
