// Charts with two axes on a drawing: ticks, lines, markers, bands, bars, legends, colour keys.
// Values that are not finite or lie outside the axes are left out; lines and bands are clipped.
#ifndef SONDE_SRC_REPORT_CHART_H
#define SONDE_SRC_REPORT_CHART_H

#include "base/link.h"
#include "report/svg.h"

// Ticks at first*step .. last*step; step is 1, 2 or 5 times a power of ten.
typedef struct sonde_axis {
  double low, high, step;
  long first, last;
} sonde_axis;

// About `ticks` steps over [low, high], widened to whole steps. Values that are not finite or equal
// give an axis around them.
sonde_axis sonde_axis_make(double low, double high, int ticks);
// Ends exactly at low and high, with ticks inside.
sonde_axis sonde_axis_tight(double low, double high, int ticks);
sonde_number sonde_axis_label(const sonde_axis *axis, double value);
// A step of 1, 2 or 5 times a power of ten, at least `least`.
double sonde_nice_step(double least);

typedef struct sonde_chart {
  sonde_text *out;
  double left, top, width, height; // of the plot's inside, pixels
  sonde_axis x, y;
} sonde_chart;

double sonde_chart_x(const sonde_chart *chart, double value);
double sonde_chart_y(const sonde_chart *chart, double value);
bool sonde_chart_holds(const sonde_chart *chart, double x, double y);

// Grid, ticks and labels; a NULL label leaves it out, a title stands above the plot.
void sonde_chart_frame(const sonde_chart *chart, const char *title, const char *x_label,
                       const char *y_label);
// Between these, what leaves the plot is cut off.
void sonde_chart_clip(const sonde_chart *chart);
void sonde_chart_unclip(const sonde_chart *chart);

// Gaps where a value is not finite. Draw between clip and unclip.
void sonde_chart_line(const sonde_chart *chart, const double *x, const double *y, uint32_t count,
                      const char *colour, const char *more);
// Between two curves.
void sonde_chart_band(const sonde_chart *chart, const double *x, const double *low,
                      const double *high, uint32_t count, const char *colour);
void sonde_chart_dots(const sonde_chart *chart, const double *x, const double *y, uint32_t count,
                      const char *colour, double size, bool square);
// One mark of shape `index` (circle, square, triangle, diamond), hollow.
void sonde_chart_mark(const sonde_chart *chart, double x, double y, uint32_t index,
                      const char *colour);
// A box between two values on each axis, cut at the plot.
void sonde_chart_box(const sonde_chart *chart, double x0, double x1, double y0, double y1,
                     const char *look);
void sonde_chart_across(const sonde_chart *chart, double y, const char *look);
void sonde_chart_upright(const sonde_chart *chart, double x, const char *look);

// Entries of a legend: a sample of what is drawn, and a text beside it.
typedef enum sonde_sample {
  SONDE_SAMPLE_LINE,
  SONDE_SAMPLE_DASH,
  SONDE_SAMPLE_MARK,
  SONDE_SAMPLE_BOTH,
  SONDE_SAMPLE_BOX
} sonde_sample;
// Returns the width that it took.
double sonde_legend(sonde_text *out, double x, double y, sonde_sample sample, const char *colour,
                    const char *utf8);

// An upright key of the sequential colours with its axis to the right.
void sonde_colour_key(sonde_text *out, double x, double y, double height, const sonde_axis *axis,
                      const char *title);

#endif
