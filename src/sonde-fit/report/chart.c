// nice_step:  the smallest of 1, 2, 5 times a power of ten that is not below a value.
// spread_out: ends that are apart.
// frame_x, frame_y: grid, ticks and tick labels of one axis.
#include "report/chart.h"

#include "base/maths.h"

#include <string.h>

double sonde_nice_step(double least) {
  SONDE_ASSERT(least > 0 && isfinite(least));
  double power = pow(10, floor(log10(least)));
  static const double LEADING[] = {1, 2, 5, 10};
  for (size_t i = 0; i < SONDE_COUNT_OF(LEADING); ++i)
    if (LEADING[i] * power >= least * (1 - 1e-9)) return LEADING[i] * power;
  return 10 * power;
}

static void spread_out(double *low, double *high) {
  if (!isfinite(*low) || !isfinite(*high)) *low = 0, *high = 1;
  *low = clamp(*low, -1e100, 1e100);
  *high = clamp(*high, -1e100, 1e100);
  if (*high < *low) *high = *low;
  double size = fmax(fabs(*low), fabs(*high));
  if (*high - *low > 1e-9 * size) return;
  double half = size > 0 ? 0.5 * size : 0.5;
  *low -= half;
  *high += half;
}

sonde_axis sonde_axis_tight(double low, double high, int ticks) {
  SONDE_ASSERT(ticks > 0);
  spread_out(&low, &high);
  sonde_axis axis = {.low = low, .high = high, .step = sonde_nice_step((high - low) / ticks)};
  axis.first = (long)ceil(low / axis.step - 1e-6);
  axis.last = (long)floor(high / axis.step + 1e-6);
  SONDE_ASSERT(axis.last - axis.first <= ticks + 1);
  return axis;
}

sonde_axis sonde_axis_make(double low, double high, int ticks) {
  sonde_axis axis = sonde_axis_tight(low, high, ticks);
  axis.first = (long)floor(axis.low / axis.step + 1e-6);
  axis.last = (long)ceil(axis.high / axis.step - 1e-6);
  axis.low = (double)axis.first * axis.step;
  axis.high = (double)axis.last * axis.step;
  SONDE_ASSERT(axis.high > axis.low);
  return axis;
}

sonde_number sonde_axis_label(const sonde_axis *axis, double value) {
  int decimals = -(int)floor(log10(axis->step) + 1e-6);
  double size = fmax(fabs(axis->low), fabs(axis->high));
  if (fabs(value) < 1e-6 * axis->step) return sonde_fixed(0, 0);
  if (decimals > 4 || size >= 1e6) return sonde_significant(value, 3);
  return sonde_fixed(value, decimals > 0 ? decimals : 0);
}

double sonde_chart_x(const sonde_chart *c, double value) {
  return c->left + c->width * (value - c->x.low) / (c->x.high - c->x.low);
}

double sonde_chart_y(const sonde_chart *c, double value) {
  return c->top + c->height * (c->y.high - value) / (c->y.high - c->y.low);
}

static bool within(const sonde_axis *axis, double value) {
  double slack = 1e-6 * (axis->high - axis->low);
  return isfinite(value) && value >= axis->low - slack && value <= axis->high + slack;
}

bool sonde_chart_holds(const sonde_chart *chart, double x, double y) {
  return within(&chart->x, x) && within(&chart->y, y);
}

static void frame_x(const sonde_chart *c) {
  double bottom = c->top + c->height;
  for (long i = c->x.first; i <= c->x.last; ++i) {
    double x = sonde_chart_x(c, (double)i * c->x.step);
    sonde_svg_line(c->out, x, c->top, x, bottom, "class='grid'");
    sonde_svg_line(c->out, x, bottom, x, bottom + 4, "class='axis'");
    sonde_svg_text(c->out, x, bottom + 17, "class='tick middle'",
                   sonde_axis_label(&c->x, (double)i * c->x.step).s);
  }
}

static void frame_y(const sonde_chart *c) {
  for (long i = c->y.first; i <= c->y.last; ++i) {
    double y = sonde_chart_y(c, (double)i * c->y.step);
    sonde_svg_line(c->out, c->left, y, c->left + c->width, y, "class='grid'");
    sonde_svg_line(c->out, c->left - 4, y, c->left, y, "class='axis'");
    sonde_svg_text(c->out, c->left - 7, y + 4, "class='tick end'",
                   sonde_axis_label(&c->y, (double)i * c->y.step).s);
  }
}

void sonde_chart_frame(const sonde_chart *c, const char *title, const char *x_label,
                       const char *y_label) {
  SONDE_ASSERT(c->width > 0 && c->height > 0 && c->x.high > c->x.low && c->y.high > c->y.low);
  double bottom = c->top + c->height, right = c->left + c->width;
  frame_x(c);
  frame_y(c);
  sonde_svg_line(c->out, c->left, bottom, right, bottom, "class='axis'");
  sonde_svg_line(c->out, c->left, c->top, c->left, bottom, "class='axis'");
  if (title) sonde_svg_text(c->out, c->left, c->top - 10, "class='head'", title);
  if (x_label)
    sonde_svg_text(c->out, 0.5 * (c->left + right), bottom + 36, "class='middle'", x_label);
  if (y_label)
    sonde_svg_text_up(c->out, c->left - 44, 0.5 * (c->top + bottom), "class='middle'", y_label);
}

// A nested drawing shows nothing outside its own box, without a name that two figures could share.
void sonde_chart_clip(const sonde_chart *c) {
  sonde_number x = sonde_coordinate(c->left), y = sonde_coordinate(c->top);
  sonde_number w = sonde_coordinate(c->width), h = sonde_coordinate(c->height);
  sonde_text_format(c->out,
                    "<svg x='%s' y='%s' width='%s' height='%s' viewBox='%s %s %s %s' "
                    "overflow='hidden'>\n",
                    x.s, y.s, w.s, h.s, x.s, y.s, w.s, h.s);
}

void sonde_chart_unclip(const sonde_chart *c) { sonde_text_put(c->out, "</svg>\n"); }

// Pixels of a value that may lie far outside: bounded, so that no number gets out of hand.
static double bounded_x(const sonde_chart *c, double value) {
  return clamp(sonde_chart_x(c, value), -1e5, 1e5);
}
static double bounded_y(const sonde_chart *c, double value) {
  return clamp(sonde_chart_y(c, value), -1e5, 1e5);
}

void sonde_chart_line(const sonde_chart *c, const double *x, const double *y, uint32_t count,
                      const char *colour, const char *more) {
  char look[160];
  snprintf(look, sizeof look, "class='line' stroke='%s' %s", colour, more ? more : "");
  sonde_path path = sonde_path_begin(c->out, look);
  bool down = false;
  for (uint32_t i = 0; i < count; ++i) {
    bool finite = isfinite(x[i]) && isfinite(y[i]);
    if (finite && down) sonde_path_draw(&path, bounded_x(c, x[i]), bounded_y(c, y[i]));
    if (finite && !down) sonde_path_move(&path, bounded_x(c, x[i]), bounded_y(c, y[i]));
    down = finite;
  }
  sonde_path_end(&path);
}

void sonde_chart_band(const sonde_chart *c, const double *x, const double *low, const double *high,
                      uint32_t count, const char *colour) {
  char look[80];
  bool down = false;
  snprintf(look, sizeof look, "class='band' fill='%s'", colour);
  sonde_path path = sonde_path_begin(c->out, look);
  for (uint32_t side = 0; side < 2; ++side)
    for (uint32_t k = 0; k < count; ++k) {
      uint32_t i = side ? count - 1 - k : k;
      if (!isfinite(x[i]) || !isfinite(low[i]) || !isfinite(high[i])) continue;
      double px = bounded_x(c, x[i]), py = bounded_y(c, side ? low[i] : high[i]);
      if (down)
        sonde_path_draw(&path, px, py);
      else
        sonde_path_move(&path, px, py);
      down = true;
    }
  if (down) sonde_path_close(&path);
  sonde_path_end(&path);
}

void sonde_chart_dots(const sonde_chart *c, const double *x, const double *y, uint32_t count,
                      const char *colour, double size, bool square) {
  char look[160];
  snprintf(look, sizeof look, "class='%s' stroke='%s' stroke-width='%s' stroke-opacity='.55'",
           square ? "squares" : "dots", colour, sonde_coordinate(size).s);
  sonde_path path = sonde_path_begin(c->out, look);
  for (uint32_t i = 0; i < count; ++i)
    if (sonde_chart_holds(c, x[i], y[i]))
      sonde_path_dot(&path, sonde_chart_x(c, x[i]), sonde_chart_y(c, y[i]));
  sonde_path_end(&path);
}

// Circle, square, triangle, diamond: as paths around the origin.
static const char *const SHAPES[4] = {"m-2.6 0a2.6 2.6 0 1 0 5.2 0a2.6 2.6 0 1 0-5.2 0z",
                                      "m-2.4-2.4h4.8v4.8h-4.8z", "m0-3.2l3 5.4h-6z",
                                      "m0-3.4l3.2 3.4l-3.2 3.4l-3.2-3.4z"};

static void mark(sonde_text *out, double x, double y, uint32_t index, const char *colour) {
  sonde_text_format(out, "<path d='M%s %s%s' fill='#fff' stroke='%s' stroke-width='1.2'/>\n",
                    sonde_coordinate(x).s, sonde_coordinate(y).s,
                    SHAPES[index % SONDE_COUNT_OF(SHAPES)], colour);
}

void sonde_chart_mark(const sonde_chart *c, double x, double y, uint32_t index,
                      const char *colour) {
  if (sonde_chart_holds(c, x, y))
    mark(c->out, sonde_chart_x(c, x), sonde_chart_y(c, y), index, colour);
}

void sonde_chart_box(const sonde_chart *c, double x0, double x1, double y0, double y1,
                     const char *look) {
  if (!isfinite(x0) || !isfinite(x1) || !isfinite(y0) || !isfinite(y1)) return;
  double right = c->left + c->width, bottom = c->top + c->height;
  double a = clamp(sonde_chart_x(c, fmin(x0, x1)), c->left, right);
  double b = clamp(sonde_chart_x(c, fmax(x0, x1)), c->left, right);
  double d = clamp(sonde_chart_y(c, fmax(y0, y1)), c->top, bottom);
  double e = clamp(sonde_chart_y(c, fmin(y0, y1)), c->top, bottom);
  SONDE_ASSERT(b >= a && e >= d);
  sonde_svg_rect(c->out, a, d, b - a, e - d, look);
}

void sonde_chart_across(const sonde_chart *c, double y, const char *look) {
  if (!within(&c->y, y)) return;
  double at = sonde_chart_y(c, y);
  sonde_svg_line(c->out, c->left, at, c->left + c->width, at, look);
}

void sonde_chart_upright(const sonde_chart *c, double x, const char *look) {
  if (!within(&c->x, x)) return;
  double at = sonde_chart_x(c, x);
  sonde_svg_line(c->out, at, c->top, at, c->top + c->height, look);
}

double sonde_legend(sonde_text *out, double x, double y, sonde_sample sample, const char *colour,
                    const char *utf8) {
  char look[160];
  SONDE_ASSERT(strlen(colour) < 40);
  if (sample == SONDE_SAMPLE_BOX) {
    snprintf(look, sizeof look, "fill='%s' fill-opacity='.35'", colour);
    sonde_svg_rect(out, x, y - 9, 22, 10, look);
  } else if (sample != SONDE_SAMPLE_MARK) {
    snprintf(look, sizeof look, "stroke='%s' stroke-width='1.8'%s", colour,
             sample == SONDE_SAMPLE_DASH ? " stroke-dasharray='5 3'" : "");
    sonde_svg_line(out, x, y - 4, x + 22, y - 4, look);
  }
  if (sample == SONDE_SAMPLE_MARK || sample == SONDE_SAMPLE_BOTH)
    mark(out, x + 11, y - 4, 0, colour);
  sonde_svg_text(out, x + 28, y, "class='tick'", utf8);
  return 28 + sonde_text_width(utf8, 11) + 18;
}

void sonde_colour_key(sonde_text *out, double x, double y, double height, const sonde_axis *axis,
                      const char *title) {
  enum { PARTS = 48 };
  SONDE_ASSERT(fmod(height, PARTS) == 0); // whole pixels: no seam shows between two parts
  for (int i = 0; i < PARTS; ++i) {
    char look[48];
    snprintf(look, sizeof look, "fill='%s'", sonde_colour_sequential((i + 0.5) / PARTS, 1).s);
    double from = y + height * (PARTS - 1 - i) / PARTS;
    sonde_svg_rect(out, x, from, 14, height / PARTS, look);
  }
  for (long i = axis->first; i <= axis->last; ++i) {
    double value = (double)i * axis->step;
    double at = y + height * (axis->high - value) / (axis->high - axis->low);
    sonde_svg_line(out, x + 14, at, x + 18, at, "class='axis'");
    sonde_svg_text(out, x + 22, at + 4, "class='tick'", sonde_axis_label(axis, value).s);
  }
  sonde_svg_text(out, x + 36, y - 14, "class='tick end'", title);
}
