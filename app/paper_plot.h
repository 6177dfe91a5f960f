// A plot with linear or logarithmic axes in an SVG drawing.
#ifndef SONDE_APP_PAPER_PLOT_H
#define SONDE_APP_PAPER_PLOT_H

#include "sonde/sonde.h"

typedef struct paper_plot {
  sonde_file *file;
  double left, top, width, height; // pixels of the area between the axes
  double x_low, x_high, y_low, y_high;
} paper_plot;

enum { PLOT_COLOURS = 11 };
// Colours that differ in lightness and hue.
extern const char *const PLOT_COLOUR[PLOT_COLOURS];

// Widens the ends of the plot's range to round steps and draws frame, ticks, grid and labels.
void plot_begin(paper_plot *plot, const char *title, const char *x_label, const char *y_label);
void plot_line(const paper_plot *plot, const double (*points)[2], uint32_t count,
               const char *colour, const char *dash);
void plot_marks(const paper_plot *plot, const double (*points)[2], uint32_t count,
                const char *colour, uint32_t shape);
void plot_bar(const paper_plot *plot, double from, double to, double value, const char *colour);
// A sample of a line or of a mark with its name, at pixels of the drawing.
void plot_legend(const paper_plot *plot, double x, double y, const char *colour, const char *dash,
                 int shape, const char *name);

#endif
