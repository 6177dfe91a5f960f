// Draws the surfaces of a scene's bodies as SVG.
//
// Faces turned to the viewer are cut into small pieces and painted from back to front in thin
// layers of depth; pieces of one body, shade and layer are one path.
//
// look         the camera: a parallel projection
// fit          its scale and place, so that all bodies are seen
// cut_face     pieces of a face, by halving its longest edge
// collect      the pieces of all bodies
// paint        paths in order of depth
// write_names  names in the colours of the bodies, and the time
// scene_figure
#include "scene_figure.h"

#include <math.h>
#include <stdlib.h>

enum { WIDTH = 520, TALLEST = 460, MARGIN = 12, LEGEND = 26, LAYERS = 240, SHADES = 48 };
enum { PIECES_MOST = 400000, DEEPEST = 12 };
static const double PIECE_PX = 22; // longest edge of a piece

typedef struct camera {
  sonde_vec3 right, up, toward;
  double scale, left, top, least, most; // pixels per metre, origin, range of depth
} camera;

typedef struct piece {
  double at[3][2];
  uint32_t layer, body, shade;
} piece;

typedef struct figure {
  const sonde_scene *scene;
  camera camera;
  double height;
  sonde_vec3 **place; // [bodies] vertices
  piece *pieces;
  uint32_t count, room;
} figure;

static sonde_vec3 along(sonde_vec3 a, double s, sonde_vec3 b) {
  return (sonde_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static double dot(sonde_vec3 a, sonde_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static sonde_vec3 cross(sonde_vec3 a, sonde_vec3 b) {
  return (sonde_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static sonde_vec3 unit(sonde_vec3 a) {
  double size = sqrt(dot(a, a));
  return along((sonde_vec3){0, 0, 0}, size > 0 ? 1 / size : 0, a);
}

static camera look(sonde_vec3 up) {
  const double AROUND = 0.55, ABOVE = 0.42; // rad
  if (!(dot(up, up) > 0)) up = (sonde_vec3){0, 0, 1};
  up = unit(up);
  sonde_vec3 side = fabs(up.x) < 0.9 ? (sonde_vec3){1, 0, 0} : (sonde_vec3){0, 0, 1};
  side = unit(along(side, -dot(side, up), up));
  sonde_vec3 front = cross(side, up), none = {0, 0, 0};
  sonde_vec3 level = along(along(none, cos(AROUND), front), sin(AROUND), side);
  camera c = {.toward = along(along(none, cos(ABOVE), level), sin(ABOVE), up), .scale = 1};
  c.right = unit(cross(up, c.toward));
  c.up = cross(c.toward, c.right);
  return c;
}

static void fit(figure *f) {
  camera *c = &f->camera;
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (uint32_t b = 0; b < sonde_scene_body_count(f->scene); ++b) {
    uint32_t count = sonde_scene_body(f->scene, b).surface->vertex_count;
    for (uint32_t i = 0; i < count; ++i) {
      sonde_vec3 p = f->place[b][i];
      const double at[3] = {dot(p, c->right), dot(p, c->up), dot(p, c->toward)};
      for (int k = 0; k < 3; ++k) low[k] = fmin(low[k], at[k]), high[k] = fmax(high[k], at[k]);
    }
  }
  double across = fmax(high[0] - low[0], 1e-9), tall = fmax(high[1] - low[1], 1e-9);
  c->scale = fmin((WIDTH - 2 * MARGIN) / across, TALLEST / tall);
  c->left = 0.5 * (WIDTH - c->scale * (low[0] + high[0]));
  c->top = MARGIN + c->scale * high[1];
  c->least = low[2];
  c->most = fmax(high[2], low[2] + 1e-9);
  f->height = 2 * MARGIN + LEGEND + c->scale * tall;
}

static void add_piece(figure *f, const sonde_vec3 p[3], uint32_t body, uint32_t shade) {
  const camera *c = &f->camera;
  if (f->count == f->room) return;
  piece *out = &f->pieces[f->count++];
  double depth = 0;
  for (int k = 0; k < 3; ++k) {
    out->at[k][0] = c->left + c->scale * dot(p[k], c->right);
    out->at[k][1] = c->top - c->scale * dot(p[k], c->up);
    depth += dot(p[k], c->toward) / 3;
  }
  out->layer = (uint32_t)fmin((depth - c->least) / (c->most - c->least) * LAYERS, LAYERS - 1);
  out->body = body;
  out->shade = shade;
}

static void cut_face(figure *f, const sonde_vec3 p[3], uint32_t body, uint32_t shade, int depth) {
  int longest = 0;
  double most = 0;
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 edge = along(p[(k + 1) % 3], -1, p[k]);
    if (dot(edge, edge) > most) most = dot(edge, edge), longest = k;
  }
  if (sqrt(most) * f->camera.scale < PIECE_PX || depth == DEEPEST) {
    add_piece(f, p, body, shade);
    return;
  }
  sonde_vec3 a = p[longest], b = p[(longest + 1) % 3], c = p[(longest + 2) % 3];
  sonde_vec3 middle = along(a, 0.5, along(b, -1, a));
  cut_face(f, (const sonde_vec3[3]){a, middle, c}, body, shade, depth + 1);
  cut_face(f, (const sonde_vec3[3]){middle, b, c}, body, shade, depth + 1);
}

// Light from above the viewer's left shoulder.
static void collect(figure *f) {
  const camera *c = &f->camera;
  sonde_vec3 light = unit(along(along(c->toward, 1.1, c->up), -0.5, c->right));
  for (uint32_t b = 0; b < sonde_scene_body_count(f->scene); ++b) {
    const sonde_mesh *mesh = sonde_scene_body(f->scene, b).surface;
    for (uint32_t i = 0; i < mesh->face_count; ++i) {
      const uint32_t *v = mesh->faces[i];
      const sonde_vec3 p[3] = {f->place[b][v[0]], f->place[b][v[1]], f->place[b][v[2]]};
      sonde_vec3 normal = unit(cross(along(p[1], -1, p[0]), along(p[2], -1, p[0])));
      if (!(dot(normal, c->toward) > 0)) continue;
      double lit = fmax(dot(normal, light), 0);
      cut_face(f, p, b, (uint32_t)fmin(lit * SHADES, SHADES - 1), 0);
    }
  }
}

static int back_to_front(const void *a, const void *b) {
  const piece *x = a, *y = b;
  if (x->layer != y->layer) return x->layer < y->layer ? -1 : 1;
  if (x->body != y->body) return x->body < y->body ? -1 : 1;
  return (x->shade > y->shade) - (x->shade < y->shade);
}

static uint32_t colour(uint32_t body, uint32_t shade) {
  static const uint8_t BASE[][3] = {{214, 196, 168}, {214, 106, 84},  {92, 138, 190},
                                    {128, 128, 134}, {112, 168, 110}, {186, 140, 190}};
  const uint8_t *base = BASE[body % (sizeof BASE / sizeof *BASE)];
  double light = 0.5 + 0.58 * shade / (SHADES - 1);
  uint32_t out = 0;
  for (int k = 0; k < 3; ++k) out = out << 8 | (uint32_t)fmin(base[k] * light, 255);
  return out;
}

static void paint(figure *f, sonde_file *file) {
  qsort(f->pieces, f->count, sizeof *f->pieces, back_to_front);
  for (uint32_t i = 0; i < f->count;) {
    const piece *first = &f->pieces[i];
    unsigned fill = colour(first->body, first->shade);
    sonde_file_printf(file, "<path fill='#%06x' stroke='#%06x' d='", fill, fill);
    for (; i < f->count && back_to_front(first, &f->pieces[i]) == 0; ++i) {
      const piece *p = &f->pieces[i];
      sonde_file_printf(file, "M%.1f %.1fL%.1f %.1f %.1f %.1fz", p->at[0][0], p->at[0][1],
                        p->at[1][0], p->at[1][1], p->at[2][0], p->at[2][1]);
    }
    sonde_file_printf(file, "'/>\n");
  }
}

// Names of bodies are letters, digits, '-' and '_': nothing to escape.
static void write_names(const figure *f, const sonde_scene_state *state, sonde_file *file) {
  double x = MARGIN, y = f->height - MARGIN;
  for (uint32_t b = 0; b < sonde_scene_body_count(f->scene) && x < WIDTH - 170; ++b) {
    const char *name = sonde_scene_body(f->scene, b).name;
    int written = 0;
    sonde_file_printf(file, "<rect x='%.0f' y='%.0f' width='11' height='11' fill='#%06x'/>\n", x,
                      y - 10, (unsigned)colour(b, SHADES - 2));
    sonde_file_printf(file, "<text x='%.0f' y='%.0f'>%s</text>\n", x + 16, y, name);
    while (name[written]) ++written;
    x += 34 + 7.5 * written;
  }
  sonde_file_printf(file, "<text x='%d' y='%.0f' text-anchor='end'>t = %.3f s</text>\n",
                    WIDTH - MARGIN, y, sonde_scene_time(state));
}

static sonde_status write_figure(figure *f, const sonde_scene_state *state, const char *path,
                                 sonde_error *error) {
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file,
                    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %d %.0f' width='%d' "
                    "height='%.0f' font-family='sans-serif' font-size='13'>\n"
                    "<rect width='100%%' height='100%%' fill='#fff'/>\n"
                    "<g stroke-width='.6' stroke-linejoin='round'>\n",
                    WIDTH, f->height, WIDTH, f->height);
  paint(f, file);
  sonde_file_printf(file, "</g>\n<g fill='#333'>\n");
  write_names(f, state, file);
  sonde_file_printf(file, "</g>\n</svg>\n");
  return sonde_file_commit(file, error);
}

sonde_status scene_figure(const sonde_scene *scene, const sonde_scene_state *state,
                          const char *path, sonde_error *error) {
  uint32_t bodies = sonde_scene_body_count(scene);
  figure f = {.scene = scene,
              .camera = look(along((sonde_vec3){0, 0, 0}, -1, sonde_scene_gravity(scene))),
              .room = PIECES_MOST};
  f.place = calloc(bodies, sizeof *f.place);
  f.pieces = malloc(PIECES_MOST * sizeof *f.pieces);
  bool good = f.place && f.pieces;
  for (uint32_t b = 0; b < bodies && good; ++b) {
    uint32_t count = sonde_scene_body(scene, b).surface->vertex_count;
    f.place[b] = calloc(count, sizeof **f.place);
    good = f.place[b] != NULL;
    if (good) sonde_scene_surface(state, b, f.place[b]);
  }
  sonde_status status = SONDE_MEMORY;
  if (good) {
    fit(&f);
    collect(&f);
    status = write_figure(&f, state, path, error);
  }
  for (uint32_t b = 0; f.place && b < bodies; ++b) free(f.place[b]);
  free(f.place);
  free(f.pieces);
  return status;
}
