// Shapes of a drawing as SVG text. `look` is a list of attributes in single quotes, written as it
// stands: "class='grid'". Coordinates are pixels, y down, one decimal, and must be finite.
#ifndef SONDE_SRC_REPORT_SVG_H
#define SONDE_SRC_REPORT_SVG_H

#include "base/link.h"
#include "report/colour.h"
#include "report/text.h"

// A drawing that is being made. Texts may come from files: they are escaped when written.
typedef struct sonde_figure {
  char name[48];        // of the file without ".svg": letters, digits, hyphens
  char title[160];      // said by screen readers
  double width, height; // pixels
  sonde_text body;
} sonde_figure;

// The rules of the classes that drawings use.
extern SONDE_LINK const char SONDE_SVG_STYLE[];

// The whole drawing; alone it is a file with its own style, else part of a page that has it.
SONDE_LINK void sonde_svg_write(sonde_text *out, const sonde_figure *figure, bool alone);

SONDE_LINK void sonde_svg_line(sonde_text *out, double x1, double y1, double x2, double y2,
                               const char *look);
void sonde_svg_rect(sonde_text *out, double x, double y, double w, double h, const char *look);
SONDE_LINK void sonde_svg_circle(sonde_text *out, double x, double y, double radius,
                                 const char *look);
// Foreign text at a point; classes start, middle, end say how it is anchored.
SONDE_LINK void sonde_svg_text(sonde_text *out, double x, double y, const char *look,
                               const char *utf8);
// The same turned by a quarter, reading upwards.
void sonde_svg_text_up(sonde_text *out, double x, double y, const char *look, const char *utf8);
// Words of our own that may hold markup and numbers.
SONDE_LINK void sonde_svg_words(sonde_text *out, double x, double y, const char *look,
                                const char *words);

// A path: begin, then move and draw in any order, then end. Coordinates are written as steps.
typedef struct sonde_path {
  sonde_text *out;
  long x, y; // tenths of a pixel, the pen's place
  long start_x, start_y;
} sonde_path;
SONDE_LINK sonde_path sonde_path_begin(sonde_text *out, const char *look);
SONDE_LINK void sonde_path_move(sonde_path *path, double x, double y);
SONDE_LINK void sonde_path_draw(sonde_path *path, double x, double y);
SONDE_LINK void sonde_path_close(sonde_path *path);
void sonde_path_dot(sonde_path *path, double x, double y); // needs stroke-linecap
void sonde_path_box(sonde_path *path, double x, double y, double w, double h);
SONDE_LINK void sonde_path_end(sonde_path *path);

// Rough width of a text in pixels, to keep labels apart.
double sonde_text_width(const char *utf8, double size);

#endif
