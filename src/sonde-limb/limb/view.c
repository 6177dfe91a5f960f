// A limb drawn in layers: shaded surfaces as pictures within an SVG, names at leader lines.
#include "limb/view.h"

#include "files/png.h"
#include "sonde/files.h"

#include <string.h>

enum { PICTURE_HEIGHT = 780, PICTURE_WIDTH = 240, FINE = 2, TOP = 46, NAMES = 200, PANELS = 5 };

// One panel: the side from which it is seen (right limb), what stands opaque, what is see-through,
// and what is named.
#define SHOWN(kind) (1u << (kind))
#define DEEP (SHOWN(VIEW_BONE) | SHOWN(VIEW_ARTERY) | SHOWN(VIEW_DEEP_VEIN) | SHOWN(VIEW_NERVE))
#define FLESH (SHOWN(VIEW_BONE) | SHOWN(VIEW_TENDON) | SHOWN(VIEW_MUSCLE) | SHOWN(VIEW_SUPERFICIAL))
static const struct panel {
  const char *title;
  sonde_vec3 toward;
  uint32_t opaque, glass, named;
} PANEL[PANELS] = {
    {"Muscles, from the front", {0, 1, 0}, FLESH, 0, SHOWN(VIEW_MUSCLE)},
    {"Vessels and nerves, from the front", {0, 1, 0}, DEEP, SHOWN(VIEW_MUSCLE), DEEP},
    {"Superficial veins, medial side",
     {1, 0, 0},
     FLESH,
     0,
     SHOWN(VIEW_SUPERFICIAL) | SHOWN(VIEW_MUSCLE)},
    {"Muscles, from behind", {0, -1, 0}, FLESH, 0, SHOWN(VIEW_MUSCLE)},
    {"Vessels and nerves, from behind", {0, -1, 0}, DEEP, SHOWN(VIEW_MUSCLE), DEEP}};

typedef struct sample {
  float depth; // towards the viewer, m
  float shade[3], facing;
  uint16_t solid; // + 1
} sample;

typedef struct painter {
  sonde_vec3 right, toward, middle;
  double pixels; // fine ones, per metre
  uint32_t width, height;
  sample *opaque, *glass, *veil; // [height][width]
} painter;

// Puts the triangles of a solid into a layer where they are nearest to the viewer.
static void paint(const painter *p, const view_solid *solid, uint16_t number, sample *layer) {
  const sonde_vec3 light = v_unit(
      v_madd(v_madd(v_scale(p->toward, 0.75), -0.45, p->right), 0.5, vec3(0, 0, 1)), p->toward);
  for (uint32_t f = 0; f < solid->mesh.face_count; ++f) {
    double x[3], y[3], depth[3], lit[3], facing[3];
    for (int k = 0; k < 3; ++k) {
      uint32_t v = solid->mesh.faces[f][k];
      sonde_vec3 q = v_sub(solid->mesh.vertices[v], p->middle), n = solid->normal[v];
      x[k] = p->width / 2.0 + p->pixels * v_dot(q, p->right);
      y[k] = p->height / 2.0 - p->pixels * q.z;
      depth[k] = v_dot(q, p->toward), facing[k] = v_dot(n, p->toward), lit[k] = v_dot(n, light);
    }
    double area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (fabs(area) < 1e-12 || facing[0] + facing[1] + facing[2] < 0) continue;
    int left = (int)fmax(ceil(fmin(x[0], fmin(x[1], x[2]))), 0),
        right = (int)fmin(floor(fmax(x[0], fmax(x[1], x[2]))), p->width - 1.0),
        top = (int)fmax(ceil(fmin(y[0], fmin(y[1], y[2]))), 0),
        foot = (int)fmin(floor(fmax(y[0], fmax(y[1], y[2]))), p->height - 1.0);
    for (int j = top; j <= foot; ++j)
      for (int i = left; i <= right; ++i) {
        double b = ((i - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (j - y[0])) / area,
               c = ((x[1] - x[0]) * (j - y[0]) - (i - x[0]) * (y[1] - y[0])) / area, a = 1 - b - c;
        if (a < -1e-9 || b < -1e-9 || c < -1e-9) continue;
        sample *s = &layer[(size_t)j * p->width + (size_t)i];
        float d = (float)(a * depth[0] + b * depth[1] + c * depth[2]);
        if (s->solid && s->depth >= d) continue;
        double light_here = a * lit[0] + b * lit[1] + c * lit[2];
        s->facing = (float)clamp(a * facing[0] + b * facing[1] + c * facing[2], 0, 1);
        // Ambient and diffuse light, a gloss, darker edges.
        double bright = (0.42 + 0.62 * fmax(light_here, 0)) * (0.7 + 0.3 * s->facing),
               gloss = 70 * pow(fmax(light_here, 0), 22);
        for (int k = 0; k < 3; ++k)
          s->shade[k] = (float)fmin(solid->colour[k] * bright + gloss, 255);
        s->depth = d, s->solid = number;
      }
  }
}

// At most 96 colours of a picture: those that most pixels have, strong ones counting more, others
// by the nearest. White is the last.
static uint32_t choose_palette(const view_scene *scene, const uint8_t (*rgb)[3], uint32_t count,
                               uint8_t palette[256][3], uint8_t *index, sonde_error *error) {
  enum { CELLS = 32 * 32 * 32 };
  uint32_t *weight = SONDE_NEW(uint32_t, CELLS);
  uint16_t *of = SONDE_NEW(uint16_t, CELLS);
  uint32_t colours = 0;
  if (!weight || !of) {
    (void)sonde_fail_memory(error);
    goto end;
  }
#define CELL(c) ((uint32_t)((c)[0] >> 3) << 10 | (uint32_t)((c)[1] >> 3) << 5 | (c)[2] >> 3)
  for (uint32_t i = 0; i < count; ++i) ++weight[CELL(rgb[i])];
  for (uint32_t kind = VIEW_ARTERY; kind < VIEW_KINDS; ++kind)
    for (uint32_t k = 0; k < scene->count; ++k) {
      if (scene->solid[k].kind != kind) continue;
      for (int shade = 0; shade < 6; ++shade, ++colours)
        for (int c = 0; c < 3; ++c)
          palette[colours][c] = (uint8_t)(scene->solid[k].colour[c] * (0.45 + 0.11 * shade));
      break;
    }
  for (; colours < 95; ++colours) {
    uint32_t best = 0;
    for (uint32_t c = 1; c < CELLS; ++c)
      if (weight[c] > weight[best]) best = c;
    if (!weight[best]) break;
    weight[best] = 0, of[best] = (uint16_t)(colours + 1);
    palette[colours][0] = (uint8_t)((best >> 10) * 8 + 4);
    palette[colours][1] = (uint8_t)((best >> 5 & 31) * 8 + 4);
    palette[colours][2] = (uint8_t)((best & 31) * 8 + 4);
  }
  memset(palette[colours], 255, 3);
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t c = CELL(rgb[i]);
    if (!of[c]) {
      int least = INT32_MAX;
      for (uint32_t k = 0; k < colours; ++k) {
        int r = palette[k][0] - rgb[i][0], g = palette[k][1] - rgb[i][1],
            b = palette[k][2] - rgb[i][2];
        if (r * r + g * g + b * b < least) least = r * r + g * g + b * b, of[c] = (uint16_t)(k + 1);
      }
    }
    bool white = rgb[i][0] > 252 && rgb[i][1] > 252 && rgb[i][2] > 252;
    index[i] = (uint8_t)(white ? colours : of[c] - 1u);
  }
#undef CELL
  ++colours;
end:
  sonde_free(weight);
  sonde_free(of);
  return colours;
}

// Names of what is seen, beside the picture, with a line to a place on each.
static void put_names(const painter *p, const view_scene *scene, const struct panel *panel,
                      double left, sonde_file *file) {
  typedef struct seen {
    double x, y, nearest, at_x, at_y;
    uint32_t pixels;
  } seen;
  seen list[VIEW_SOLIDS] = {{0}};
  for (int pass = 0; pass < 2; ++pass)
    for (uint32_t j = 0; j < p->height; ++j)
      for (uint32_t i = 0; i < p->width; ++i) {
        uint32_t k = p->opaque[(size_t)j * p->width + i].solid;
        if (!k) continue;
        seen *s = &list[k - 1];
        if (pass == 0) {
          s->x += i, s->y += j, ++s->pixels, s->nearest = INFINITY;
          continue;
        }
        double far = hypot(i - s->x / s->pixels, j - s->y / s->pixels);
        if (far < s->nearest) s->nearest = far, s->at_x = i, s->at_y = j;
      }
  // The largest of each name, in the order of height.
  uint32_t order[VIEW_SOLIDS], count = 0;
  for (uint32_t k = 0; k < scene->count; ++k) {
    const view_solid *solid = &scene->solid[k];
    uint32_t enough = solid->kind == VIEW_MUSCLE ? 500 : solid->kind == VIEW_BONE ? 900 : 130;
    if (!solid->name || !(panel->named & SHOWN(solid->kind)) || list[k].pixels < enough) continue;
    if (!strncmp(solid->name, "second ", 7) || !strncmp(solid->name, "third ", 6) ||
        strstr(solid->name, "perforator"))
      continue;
    uint32_t at = count++;
    while (at > 0 && list[order[at - 1]].at_y > list[k].at_y) order[at] = order[at - 1], --at;
    order[at] = k;
  }
  // Each name as near to its place as those above it allow; then up from the foot.
  double y[VIEW_SOLIDS];
  const double line = 11.5;
  for (uint32_t n = 0; n < count; ++n) {
    y[n] = TOP + list[order[n]].at_y / FINE;
    if (n > 0) y[n] = fmax(y[n], y[n - 1] + line);
  }
  for (uint32_t n = count; n-- > 0;)
    y[n] = fmin(y[n], n + 1 < count ? y[n + 1] - line : TOP + PICTURE_HEIGHT - 6.0);
  for (uint32_t n = 0; n < count; ++n) {
    const seen *s = &list[order[n]];
    double x = left + PICTURE_WIDTH - 4;
    const double leader[3][2] = {
        {left + s->at_x / FINE, TOP + s->at_y / FINE}, {x - 12, y[n]}, {x, y[n]}};
    sonde_svg_put_line(file, leader, 3,
                       "fill='none' stroke='#fff' stroke-width='1.6' stroke-opacity='.7'");
    sonde_svg_put_line(file, leader, 3, "fill='none' stroke='#333' stroke-width='.6'");
    sonde_svg_put_text(file, x + 3, y[n] + 3.2, "style='font-size:9.2px'",
                       scene->solid[order[n]].name);
  }
}

static sonde_status put_panel(painter *p, const view_scene *scene, const struct panel *panel,
                              double left, sonde_file *file, sonde_error *error) {
  size_t fine = (size_t)p->width * p->height, coarse = fine / (FINE * FINE);
  memset(p->opaque, 0, fine * sizeof *p->opaque);
  memset(p->glass, 0, fine * sizeof *p->glass);
  memset(p->veil, 0, fine * sizeof *p->veil);
  for (uint32_t k = 0; k < scene->count; ++k) {
    uint32_t kind = SHOWN(scene->solid[k].kind);
    uint16_t number = (uint16_t)(k + 1);
    if (panel->opaque & kind) paint(p, &scene->solid[k], number, p->opaque);
    if (panel->glass & kind) paint(p, &scene->solid[k], number, p->glass);
    if (kind == SHOWN(VIEW_SKIN)) paint(p, &scene->solid[k], number, p->veil);
  }
  uint8_t(*rgb)[3] = sonde_calloc(coarse, 3), *index = SONDE_NEW(uint8_t, coarse), palette[256][3];
  sonde_status status = rgb && index ? SONDE_OK : sonde_fail_memory(error);
  for (size_t i = 0; i < coarse && !status; ++i) {
    float sum[3] = {0, 0, 0};
    size_t y = i / (p->width / FINE), x = i % (p->width / FINE);
    for (uint32_t n = 0; n < FINE * FINE; ++n) {
      size_t at = (y * FINE + n / FINE) * p->width + x * FINE + n % FINE;
      const sample *opaque = &p->opaque[at], *glass = &p->glass[at], *veil = &p->veil[at];
      // See-through muscles only before what is opaque; both are denser at their edges.
      bool before = glass->solid && (!opaque->solid || glass->depth > opaque->depth);
      float edge = 1 - glass->facing, rim = 1 - veil->facing;
      float muscle = before ? 0.3f + 0.4f * edge * edge : 0;
      float skin = veil->solid ? 0.08f + 0.5f * rim * rim * rim : 0;
      for (int k = 0; k < 3; ++k) {
        float colour = opaque->solid ? opaque->shade[k] : 255;
        colour += muscle * (glass->shade[k] - colour);
        sum[k] += colour + skin * (veil->shade[k] - colour);
      }
    }
    for (int k = 0; k < 3; ++k) rgb[i][k] = (uint8_t)(sum[k] / (FINE * FINE));
  }
  if (!status) {
    sonde_colours picture = {.width = p->width / FINE,
                             .height = p->height / FINE,
                             .frames = 1,
                             .palette = (const uint8_t(*)[3])palette,
                             .pixels = index};
    picture.colours =
        choose_palette(scene, (const uint8_t(*)[3])rgb, (uint32_t)coarse, palette, index, error);
    status = picture.colours ? sonde_svg_put_colours(file, left, TOP, PICTURE_WIDTH, PICTURE_HEIGHT,
                                                     &picture, error)
                             : SONDE_MEMORY;
  }
  sonde_free(rgb);
  sonde_free(index);
  if (status) return status;
  sonde_svg_put_text(file, left + PICTURE_WIDTH / 2.0, 34, "class='middle'", panel->title);
  put_names(p, scene, panel, left, file);
  return SONDE_OK;
}

sonde_status sonde_limb_view_svg(const sonde_limb *limb, const sonde_limb_pose *pose,
                                 const char *path, sonde_error *error) {
  SONDE_ASSERT(limb && path);
  view_scene *scene = SONDE_NEW(view_scene, 1);
  painter p = {.width = FINE * PICTURE_WIDTH, .height = FINE * PICTURE_HEIGHT};
  size_t fine = (size_t)p.width * p.height;
  p.opaque = SONDE_NEW(sample, fine), p.glass = SONDE_NEW(sample, fine);
  p.veil = SONDE_NEW(sample, fine);
  sonde_status status =
      scene && p.opaque && p.glass && p.veil ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = view_scene_make(limb, pose, scene, error);
  sonde_file *file = NULL;
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_vec3 low = vec3(INFINITY, INFINITY, INFINITY), high = v_neg(low);
    for (uint32_t i = 0; i < scene->solid[0].mesh.vertex_count; ++i)
      low = v_min(low, scene->solid[0].mesh.vertices[i]),
      high = v_max(high, scene->solid[0].mesh.vertices[i]);
    p.middle = v_lerp(low, high, 0.5);
    double wide = fmax(high.x - low.x, high.y - low.y);
    p.pixels = fmin((p.height - 8) / (high.z - low.z), (p.width - 8) / wide);
    bool left = limb->body.side == SONDE_LIMB_LEFT;
    char title[80];
    snprintf(title, sizeof title, "%s limb%s%s", left ? "Left" : "Right", pose ? ", " : "",
             pose ? sonde_limb_position_name(sonde_limb_pose_setting(pose).position) : "");
    sonde_svg_begin(file, title, PANELS * (PICTURE_WIDTH + NAMES), PICTURE_HEIGHT + TOP + 14);
    sonde_svg_put_text(file, 14, 16, "class='head'", title);
    for (uint32_t k = 0; k < PANELS && !status; ++k) {
      p.toward = limb_side_point(limb, PANEL[k].toward);
      p.right = v_cross(p.toward, vec3(0, 0, 1));
      status = put_panel(&p, scene, &PANEL[k], k * (PICTURE_WIDTH + NAMES), file, error);
    }
    if (status)
      sonde_file_discard(file);
    else
      status = sonde_svg_end(file, error);
  }
  if (scene) view_scene_clear(scene);
  sonde_free(scene);
  sonde_free(p.opaque);
  sonde_free(p.glass);
  sonde_free(p.veil);
  return status;
}
