// The frames of a sweep as sheets one behind the other, spread apart for the eye.
//
// Positions are those of the frames, the way along the sweep stretched so that sheets show; the
// view keeps the first frame's columns and rows upright and shifts depth along a diagonal.
#include "stack_figure.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

enum { FIGURE_WIDTH = 1100, FIGURE_HEIGHT = 760, MARGIN = 20, BORDER = 3 };

typedef struct view {
  sonde_affine first; // plane of the first frame
  double axes[3][3];  // its columns, rows and normal as unit vectors
  double scale;       // pixels of the figure per metre
  double stretch;     // of the way along the sweep
  double left, top;   // figure position of the origin
  sonde_image *figure;
} view;

// Plane of the used part of a frame.
static sonde_affine used_plane(const sonde_sequence *s, uint32_t frame) {
  sonde_affine a = s->frames[frame].world_from_pixel;
  for (int i = 0; i < 3; ++i) a.m[i][3] += a.m[i][0] * s->clip[0] + a.m[i][1] * s->clip[1];
  return a;
}

static void in_axes(const view *v, const sonde_affine *plane, double u, double w, double p[3]) {
  double d[3];
  for (int i = 0; i < 3; ++i)
    d[i] = plane->m[i][0] * u + plane->m[i][1] * w + plane->m[i][3] - v->first.m[i][3];
  for (int k = 0; k < 3; ++k)
    p[k] = d[0] * v->axes[k][0] + d[1] * v->axes[k][1] + d[2] * v->axes[k][2];
}

static void project(const view *v, const sonde_affine *plane, double u, double w, double at[2]) {
  double p[3];
  in_axes(v, plane, u, w, p);
  double depth = p[2] * v->stretch;
  at[0] = v->left + v->scale * (0.55 * p[0] + depth);
  at[1] = v->top + v->scale * (p[1] + 0.22 * p[0] - 0.30 * depth);
}

// Parallelogram of a plane: figure pixel -> plane pixel by the inverse of the projected axes.
// @param stride of the rows of pixels
static void draw_sheet(const view *v, const sonde_affine *plane, const uint8_t *pixels,
                       size_t stride, uint32_t width, uint32_t height, bool made) {
  double o[2], a[2], b[2];
  project(v, plane, 0, 0, o);
  project(v, plane, width - 1, 0, a);
  project(v, plane, 0, height - 1, b);
  double ax = (a[0] - o[0]) / (width - 1), ay = (a[1] - o[1]) / (width - 1);
  double bx = (b[0] - o[0]) / (height - 1), by = (b[1] - o[1]) / (height - 1);
  double det = ax * by - ay * bx;
  if (!(fabs(det) > 1e-9)) return;
  double border = made ? BORDER : 1;
  for (int y = 0; y < FIGURE_HEIGHT; ++y)
    for (int x = 0; x < FIGURE_WIDTH; ++x) {
      double dx = x - o[0], dy = y - o[1];
      double u = (by * dx - bx * dy) / det, w = (ax * dy - ay * dx) / det;
      if (!(u >= 0 && w >= 0 && u <= width - 1 && w <= height - 1)) continue;
      double edge =
          fmin(fmin(u, width - 1 - u) * hypot(ax, ay), fmin(w, height - 1 - w) * hypot(bx, by));
      double grey = pixels[(size_t)(w + 0.5) * stride + (size_t)(u + 0.5)];
      uint8_t *out = &v->figure->pixels[(size_t)y * FIGURE_WIDTH + (size_t)x];
      *out = edge < border ? (made ? 255 : 90) : (uint8_t)(made ? grey : 0.6 * grey);
    }
}

// The view of the used frames; false for a single one, which has no way along the sweep.
static bool fit_view(view *v, const sonde_sequence *s) {
  uint32_t first = 0, last = s->count - 1;
  while (first < last && !s->frames[first].used) ++first;
  while (last > first && !s->frames[last].used) --last;
  if (first == last) return false;

  // Axes: columns, rows and normal of the first frame, the normal towards the last one.
  v->first = used_plane(s, first);
  sonde_affine end = used_plane(s, last);
  double *x = v->axes[0], *y = v->axes[1], *n = v->axes[2], width = 0, height = 0, along[3];
  for (int i = 0; i < 3; ++i) width = hypot(width, v->first.m[i][0]);
  for (int i = 0; i < 3; ++i) height = hypot(height, v->first.m[i][1]);
  for (int i = 0; i < 3; ++i) x[i] = v->first.m[i][0] / width, y[i] = v->first.m[i][1] / height;
  for (int i = 0; i < 3; ++i)
    n[i] = x[(i + 1) % 3] * y[(i + 2) % 3] - x[(i + 2) % 3] * y[(i + 1) % 3];
  in_axes(v, &end, s->clip[2] / 2.0, s->clip[3] / 2.0, along);
  for (int i = 0; i < 3 && along[2] < 0; ++i) n[i] = -n[i];
  in_axes(v, &end, 0, 0, along);
  v->stretch = along[2] > 1e-6 ? 3 * width * s->clip[2] / along[2] : 1;

  // Scale and origin such that all corners fit.
  double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
  v->scale = 1, v->left = v->top = 0;
  for (uint32_t i = 0; i < s->count; ++i) {
    sonde_affine plane = used_plane(s, i);
    for (int corner = 0; corner < 4 && s->frames[i].used; ++corner) {
      double at[2];
      project(v, &plane, corner & 1 ? s->clip[2] - 1.0 : 0, corner & 2 ? s->clip[3] - 1.0 : 0, at);
      for (int k = 0; k < 2; ++k) low[k] = fmin(low[k], at[k]), high[k] = fmax(high[k], at[k]);
    }
  }
  v->scale = fmin((FIGURE_WIDTH - 2 * MARGIN) / (high[0] - low[0]),
                  (FIGURE_HEIGHT - 2 * MARGIN) / (high[1] - low[1]));
  v->left = MARGIN - v->scale * low[0];
  v->top = MARGIN - v->scale * low[1];
  return true;
}

sonde_status stack_draw(const sonde_sequence *s, uint32_t step, double place,
                        const sonde_affine *plane, const sonde_image *picture, sonde_image *figure,
                        sonde_error *error) {
  assert(s->count > 0 && step > 0);
  view v = {.figure = figure};
  sonde_status status = sonde_image_create(FIGURE_WIDTH, FIGURE_HEIGHT, figure, error);
  if (status) return status;
  bool drawn = !fit_view(&v, s);
  for (uint32_t k = s->count;
       k-- > 0;) { // far sheets first, the made picture in front of those behind it
    if (!drawn && place >= k) {
      draw_sheet(&v, plane, picture->pixels, picture->width, picture->width, picture->height, true);
      drawn = true;
    }
    if (!s->frames[k].used || k % step != 0 || fabs(k - place) <= 1e-9) continue;
    sonde_affine sheet = used_plane(s, k);
    size_t corner = ((size_t)k * s->height + s->clip[1]) * s->width + s->clip[0];
    draw_sheet(&v, &sheet, s->pixels + corner, s->width, s->clip[2], s->clip[3], false);
  }
  return SONDE_OK;
}

sonde_status stack_figure(const sonde_sequence *s, uint32_t step, double place,
                          const sonde_affine *plane, const sonde_image *picture, const char *path,
                          sonde_error *error) {
  sonde_image figure = {0};
  sonde_status status = stack_draw(s, step, place, plane, picture, &figure, error);
  if (!status) status = sonde_image_save_png(&figure, path, error);
  sonde_image_clear(&figure);
  return status;
}
