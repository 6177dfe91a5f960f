// Plots of the paper's figures: frame, ticks at 1, 2 or 5 times a power of ten, lines, marks, bars.
#include "paper_plot.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

const char *const PLOT_COLOUR[PLOT_COLOURS] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                               "#b8860b", "#56b4e9", "#000000", "#7a5195",
                                               "#8c564b", "#666666", "#2e8b57"};

static double x_of(const paper_plot *p, double x) {
  return p->left + p->width * (x - p->x_low) / (p->x_high - p->x_low);
}
static double y_of(const paper_plot *p, double y) {
  return p->top + p->height * (p->y_high - y) / (p->y_high - p->y_low);
}

static double nice_step(double least) {
  double power = pow(10, floor(log10(least)));
  for (int k = 0; k < 3; ++k)
    if ((k == 0 ? 1 : k == 1 ? 2 : 5) * power >= least * (1 - 1e-9))
      return (k == 0 ? 1 : k == 1 ? 2 : 5) * power;
  return 10 * power;
}

static void draw_line(const paper_plot *p, double x0, double y0, double x1, double y1,
                      const char *look) {
  const double ends[2][2] = {{x0, y0}, {x1, y1}};
  sonde_svg_put_line(p->file, ends, 2, look);
}

void plot_begin(paper_plot *p, const char *title, const char *x_label, const char *y_label) {
  assert(p->file && p->x_high > p->x_low && p->y_high > p->y_low);
  double x_step = nice_step((p->x_high - p->x_low) / fmax(p->width / 60, 3));
  double y_step = nice_step((p->y_high - p->y_low) / fmax(p->height / 45, 3));
  double bottom = p->top + p->height, right = p->left + p->width;
  char words[64];
  p->y_low = floor(p->y_low / y_step + 1e-6) * y_step;
  p->y_high = ceil(p->y_high / y_step - 1e-6) * y_step;
  for (long k = lround(ceil(p->x_low / x_step - 1e-6));
       (double)k * x_step <= p->x_high * (1 + 1e-9); ++k) {
    double x = x_of(p, (double)k * x_step);
    draw_line(p, x, p->top, x, bottom, "stroke='#e4e4e4'");
    draw_line(p, x, bottom, x, bottom + 4, "stroke='#555'");
    snprintf(words, sizeof words, "%g", (double)k * x_step);
    sonde_svg_put_text(p->file, x, bottom + 17, "class='tick middle'", words);
  }
  for (long k = lround(p->y_low / y_step); (double)k * y_step <= p->y_high + 1e-6 * y_step; ++k) {
    double y = y_of(p, (double)k * y_step);
    draw_line(p, p->left, y, right, y, "stroke='#e4e4e4'");
    draw_line(p, p->left - 4, y, p->left, y, "stroke='#555'");
    snprintf(words, sizeof words, "%g", (double)k * y_step);
    sonde_svg_put_text(p->file, p->left - 7, y + 4, "class='tick end'", words);
  }
  const double corner[3][2] = {{p->left, p->top}, {p->left, bottom}, {right, bottom}};
  sonde_svg_put_line(p->file, corner, 3, "stroke='#555' fill='none'");
  if (title) sonde_svg_put_text(p->file, p->left, p->top - 10, "class='head'", title);
  sonde_svg_put_text(p->file, p->left + p->width / 2, bottom + 36, "class='middle'", x_label);
  snprintf(words, sizeof words, "transform='translate(%d %d) rotate(-90)' class='middle'",
           (int)p->left - 40, (int)(p->top + p->height / 2));
  sonde_svg_put_text(p->file, 0, 0, words, y_label);
}

void plot_line(const paper_plot *p, const double (*points)[2], uint32_t count, const char *colour,
               const char *dash) {
  assert(colour);
  double(*xy)[2] = malloc((count + 1) * sizeof *xy);
  char look[128];
  snprintf(look, sizeof look, "fill='none' stroke='%s' stroke-width='1.7' stroke-dasharray='%s'",
           colour, dash ? dash : "none");
  for (uint32_t k = 0; xy && k < count; ++k)
    xy[k][0] = x_of(p, points[k][0]), xy[k][1] = y_of(p, points[k][1]);
  if (xy) sonde_svg_put_line(p->file, (const double(*)[2])xy, count, look);
  free(xy);
}

static void put_mark(const paper_plot *p, double x, double y, const char *colour, uint32_t shape) {
  char look[80];
  snprintf(look, sizeof look, "fill='#fff' stroke='%s' stroke-width='1.3'", colour);
  const double square[4][2] = {{x - 3, y - 3}, {x + 3, y - 3}, {x + 3, y + 3}, {x - 3, y + 3}};
  const double triangle[3][2] = {{x, y - 4}, {x + 3.5, y + 2.5}, {x - 3.5, y + 2.5}};
  const double diamond[4][2] = {{x, y - 4}, {x + 4, y}, {x, y + 4}, {x - 4, y}};
  switch (shape % 4) {
  case 0: sonde_svg_put_circle(p->file, x, y, 3, look); break;
  case 1: sonde_svg_put_outlines(p->file, square, 4, 4, look); break;
  case 2: sonde_svg_put_outlines(p->file, triangle, 3, 3, look); break;
  default: sonde_svg_put_outlines(p->file, diamond, 4, 4, look);
  }
}

void plot_marks(const paper_plot *p, const double (*points)[2], uint32_t count, const char *colour,
                uint32_t shape) {
  for (uint32_t k = 0; k < count; ++k)
    put_mark(p, x_of(p, points[k][0]), y_of(p, points[k][1]), colour, shape);
}

void plot_bar(const paper_plot *p, double from, double to, double value, const char *colour) {
  assert(from < to);
  double x0 = x_of(p, from), x1 = x_of(p, to), y0 = y_of(p, fmax(p->y_low, 0)), y1 = y_of(p, value);
  const double box[4][2] = {{x0, y0}, {x0, y1}, {x1, y1}, {x1, y0}};
  char look[80];
  snprintf(look, sizeof look, "fill='%s' stroke='#8fa1ad' stroke-width='.7'", colour);
  sonde_svg_put_outlines(p->file, box, 4, 4, look);
}

void plot_legend(const paper_plot *p, double x, double y, const char *colour, const char *dash,
                 int shape, const char *name) {
  char look[128];
  snprintf(look, sizeof look, "fill='none' stroke='%s' stroke-width='1.7' stroke-dasharray='%s'",
           colour, dash ? dash : "none");
  draw_line(p, x, y - 4, x + 24, y - 4, look);
  if (shape >= 0) put_mark(p, x + 12, y - 4, colour, (uint32_t)shape);
  sonde_svg_put_text(p->file, x + 30, y, "class='tick'", name);
}
