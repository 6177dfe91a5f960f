// The painter's algorithm: faces and lines are cut into small pieces, sorted into thin layers of
// depth, and pieces of one layer and look become one path.
#include "painter.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LAYERS = 1000, SHADES = 48, DEEPEST = 12, FIRST_ROOM = 4096 };
static const double PIECE_PX = 22; // longest edge of a piece

typedef struct piece {
  double xy[3][2], depth_m;
  uint32_t corners; // 3: of a face, 2: of a line, 1: a ball
  uint32_t rgb, layer;
  float opacity, width_px; // of a ball its radius
} piece;

struct painter {
  painter_camera camera;
  sonde_vec3 light; // towards it
  piece *pieces;
  uint32_t count, room;
  bool full; // a piece was left out for want of memory
};

static sonde_vec3 madd(sonde_vec3 a, double s, sonde_vec3 b) {
  return (sonde_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static double dot(sonde_vec3 a, sonde_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static sonde_vec3 cross(sonde_vec3 a, sonde_vec3 b) {
  return (sonde_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static sonde_vec3 unit(sonde_vec3 a) {
  double size = sqrt(dot(a, a));
  return madd((sonde_vec3){0, 0, 0}, size > 0 ? 1 / size : 0, a);
}

painter_camera painter_look(sonde_vec3 toward, sonde_vec3 up, sonde_vec3 centre_m,
                            double distance_m) {
  painter_camera c = {.toward = unit(toward), .centre_m = centre_m, .distance_m = distance_m};
  c.right = unit(cross(up, c.toward));
  assert(dot(c.right, c.right) > 0 && distance_m > 0);
  c.up = cross(c.toward, c.right);
  c.scale = 1;
  return c;
}

double painter_project(const painter_camera *c, sonde_vec3 point_m, double xy[2]) {
  sonde_vec3 d = madd(point_m, -1, c->centre_m);
  double depth = dot(d, c->toward);
  double nearer = isfinite(c->distance_m)
                      ? c->distance_m / fmax(c->distance_m - depth, 0.05 * c->distance_m)
                      : 1;
  xy[0] = c->left + c->scale * nearer * dot(d, c->right);
  xy[1] = c->top - c->scale * nearer * dot(d, c->up);
  return depth;
}

void painter_fit(painter_camera *c, const sonde_vec3 *points_m, uint32_t count, painter_box box) {
  assert(count > 0 && box.width > 0 && box.height > 0);
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, xy[2];
  c->scale = 1, c->left = c->top = 0;
  for (uint32_t i = 0; i < count; ++i) {
    painter_project(c, points_m[i], xy);
    for (int k = 0; k < 2; ++k) low[k] = fmin(low[k], xy[k]), high[k] = fmax(high[k], xy[k]);
  }
  c->scale =
      fmin(box.width / fmax(high[0] - low[0], 1e-9), box.height / fmax(high[1] - low[1], 1e-9));
  c->left = box.left + 0.5 * (box.width - c->scale * (low[0] + high[0]));
  c->top = box.top + 0.5 * (box.height - c->scale * (low[1] + high[1]));
}

sonde_status painter_create(const painter_camera *camera, painter **made, sonde_error *error) {
  assert(camera->scale > 0);
  painter *p = *made = calloc(1, sizeof *p);
  if (!p) return error->status = SONDE_MEMORY;
  p->camera = *camera;
  p->light = unit(madd(madd(camera->toward, 1.1, camera->up), -0.5, camera->right));
  return SONDE_OK;
}

void painter_destroy(painter *p) {
  if (p) free(p->pieces);
  free(p);
}

static void add_piece(painter *p, const piece *new_piece) {
  if (p->count == p->room) {
    uint32_t room = p->room ? 2 * p->room : FIRST_ROOM;
    piece *grown = realloc(p->pieces, room * sizeof *grown);
    if (!grown) {
      p->full = true;
      return;
    }
    p->pieces = grown, p->room = room;
  }
  p->pieces[p->count++] = *new_piece;
}

// Pieces of a face, by halving its longest edge.
static void split_face(painter *p, const sonde_vec3 corner_m[3], uint32_t rgb, double opacity,
                       int depth) {
  piece whole = {.corners = 3, .rgb = rgb, .opacity = (float)opacity};
  for (int k = 0; k < 3; ++k)
    whole.depth_m += painter_project(&p->camera, corner_m[k], whole.xy[k]) / 3;
  int longest = 0;
  double most = 0;
  for (int k = 0; k < 3; ++k) {
    const double *a = whole.xy[k], *b = whole.xy[(k + 1) % 3];
    double length = hypot(a[0] - b[0], a[1] - b[1]);
    if (length > most) most = length, longest = k;
  }
  if (most < PIECE_PX || depth == DEEPEST) {
    add_piece(p, &whole);
    return;
  }
  sonde_vec3 a = corner_m[longest], b = corner_m[(longest + 1) % 3];
  sonde_vec3 other = corner_m[(longest + 2) % 3], middle = madd(a, 0.5, madd(b, -1, a));
  split_face(p, (const sonde_vec3[3]){a, middle, other}, rgb, opacity, depth + 1);
  split_face(p, (const sonde_vec3[3]){middle, b, other}, rgb, opacity, depth + 1);
}

void painter_face(painter *p, const sonde_vec3 corner_m[3], uint32_t rgb, double opacity) {
  assert(p && opacity > 0 && opacity <= 1);
  split_face(p, corner_m, rgb, opacity, 0);
}

static sonde_vec3 normal_of(const sonde_vec3 corner_m[3]) {
  return unit(cross(madd(corner_m[1], -1, corner_m[0]), madd(corner_m[2], -1, corner_m[0])));
}

bool painter_sees(const painter *p, const sonde_vec3 corner_m[3]) {
  const painter_camera *c = &p->camera;
  sonde_vec3 to_eye = c->toward;
  if (isfinite(c->distance_m))
    to_eye = madd(madd(c->centre_m, c->distance_m, c->toward), -1, corner_m[0]);
  return dot(normal_of(corner_m), to_eye) > 0;
}

void painter_lit_face(painter *p, const sonde_vec3 corner_m[3], uint32_t rgb, double opacity) {
  if (!painter_sees(p, corner_m)) return;
  double lit = fmin(fmax(dot(normal_of(corner_m), p->light), 0) * SHADES, SHADES - 1);
  double bright = 0.5 + 0.58 * (uint32_t)lit / (SHADES - 1);
  uint32_t shaded = 0;
  for (int k = 16; k >= 0; k -= 8)
    shaded = shaded << 8 | (uint32_t)fmin((rgb >> k & 255) * bright, 255);
  painter_face(p, corner_m, shaded, opacity);
}

void painter_line(painter *p, sonde_vec3 from_m, sonde_vec3 to_m, uint32_t rgb, double width_px,
                  double nearer_m) {
  assert(p && width_px > 0);
  double a[2], b[2];
  painter_project(&p->camera, from_m, a);
  painter_project(&p->camera, to_m, b);
  uint32_t parts = 1 + (uint32_t)fmin(hypot(a[0] - b[0], a[1] - b[1]) / PIECE_PX, 200);
  sonde_vec3 way = madd(to_m, -1, from_m);
  for (uint32_t k = 0; k < parts; ++k) {
    piece part = {.corners = 2, .rgb = rgb, .opacity = 1, .width_px = (float)width_px};
    part.depth_m = nearer_m;
    for (uint32_t end = 0; end < 2; ++end)
      part.depth_m +=
          0.5 *
          painter_project(&p->camera, madd(from_m, (double)(k + end) / parts, way), part.xy[end]);
    add_piece(p, &part);
  }
}

void painter_ball(painter *p, sonde_vec3 centre_m, double radius_px, uint32_t rgb,
                  double nearer_m) {
  piece ball = {.corners = 1, .rgb = rgb, .opacity = 1, .width_px = (float)radius_px};
  ball.depth_m = nearer_m + painter_project(&p->camera, centre_m, ball.xy[0]);
  add_piece(p, &ball);
}

// By layer; within one layer faces before lines before balls, then by look.
static int compare_pieces(const void *a, const void *b) {
  const piece *x = a, *y = b;
  if (x->layer != y->layer) return x->layer < y->layer ? -1 : 1;
  if (x->corners != y->corners) return x->corners > y->corners ? -1 : 1;
  if (x->rgb != y->rgb) return x->rgb < y->rgb ? -1 : 1;
  if (x->width_px != y->width_px) return x->width_px < y->width_px ? -1 : 1;
  return (x->opacity > y->opacity) - (x->opacity < y->opacity);
}

sonde_status painter_paint(painter *p, sonde_file *drawing, sonde_error *error) {
  assert(p->pieces || !p->count);
  double least = INFINITY, most = -INFINITY;
  for (uint32_t i = 0; i < p->count; ++i)
    least = fmin(least, p->pieces[i].depth_m), most = fmax(most, p->pieces[i].depth_m);
  for (uint32_t i = 0; i < p->count; ++i) {
    double share = (p->pieces[i].depth_m - least) / fmax(most - least, 1e-12);
    p->pieces[i].layer = (uint32_t)fmin(share * LAYERS, LAYERS - 1);
  }
  if (p->count) qsort(p->pieces, p->count, sizeof *p->pieces, compare_pieces);
  double(*xy)[2] = malloc(3 * ((size_t)p->count + 1) * sizeof *xy);
  for (uint32_t i = 0; xy && i < p->count;) {
    const piece *first = &p->pieces[i];
    uint32_t corners = 0;
    char look[128];
    if (first->corners == 1) {
      const double r = (double)first->width_px; // a ball with its highlight
      snprintf(look, sizeof look, "fill='#%06x' stroke='#222' stroke-width='.6'", first->rgb);
      sonde_svg_put_circle(drawing, first->xy[0][0], first->xy[0][1], r, look);
      sonde_svg_put_circle(drawing, first->xy[0][0] - 0.3 * r, first->xy[0][1] - 0.3 * r, 0.32 * r,
                           "fill='#fff' fill-opacity='.55'");
      ++i;
      continue;
    }
    for (; i < p->count && compare_pieces(first, &p->pieces[i]) == 0; ++i)
      for (uint32_t k = 0; k < first->corners; ++k)
        memcpy(xy[corners++], p->pieces[i].xy[k], sizeof *xy);
    if (first->corners == 2)
      snprintf(look, sizeof look,
               "fill='none' stroke='#%06x' stroke-width='%.2g' stroke-linecap='round'", first->rgb,
               (double)first->width_px);
    else if (first->opacity < 1)
      snprintf(look, sizeof look, "fill='#%06x' fill-opacity='%.2g'", first->rgb,
               (double)first->opacity);
    else
      snprintf(look, sizeof look, "fill='#%06x' stroke='#%06x' stroke-width='.6'", first->rgb,
               first->rgb);
    sonde_svg_put_outlines(drawing, (const double(*)[2])xy, corners, first->corners, look);
  }
  bool good = xy && !p->full;
  free(xy);
  p->count = 0;
  return good ? SONDE_OK : (error->status = SONDE_MEMORY);
}
