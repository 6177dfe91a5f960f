// put_tenths: a length in tenths of a pixel.
// step:       one coordinate pair relative to the pen, moving the pen.
#include "report/svg.h"

#include <math.h>
#include <string.h>

const char SONDE_SVG_STYLE[] =
    ".fig text{font-family:\"Helvetica Neue\",Arial,\"Liberation Sans\",sans-serif;font-size:12px;"
    "fill:#222}"
    ".fig .tick{font-size:11px;fill:#444}"
    ".fig .small{font-size:9px;fill:#333}"
    ".fig .head{font-size:13px;font-weight:600}"
    ".fig .halo{paint-order:stroke;stroke:#fff;stroke-width:2.5px;stroke-linejoin:round}"
    ".fig .light{fill:#fff}"
    ".fig .middle{text-anchor:middle}.fig .end{text-anchor:end}"
    ".fig .grid{stroke:#e4e4e4;stroke-width:1;fill:none}"
    ".fig .axis{stroke:#555;stroke-width:1;fill:none}"
    ".fig .zero{stroke:#555;stroke-width:1;fill:none}"
    ".fig .dash{stroke:#333;stroke-width:1.2;stroke-dasharray:5 3;fill:none}"
    ".fig .line{fill:none;stroke-width:1.7;stroke-linejoin:round;stroke-linecap:round}"
    ".fig .dots{fill:none;stroke-linecap:round}"
    ".fig .squares{fill:none;stroke-linecap:square}"
    ".fig .band{stroke:none;fill-opacity:.16}";

void sonde_svg_write(sonde_text *out, const sonde_figure *figure, bool alone) {
  SONDE_ASSERT(figure->name[0] && figure->width > 0 && figure->height > 0);
  sonde_number width = sonde_coordinate(figure->width), height = sonde_coordinate(figure->height);
  if (alone) sonde_text_put(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
  sonde_text_format(out,
                    "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"fig\" role=\"img\" "
                    "aria-labelledby=\"%s-title\" viewBox=\"0 0 %s %s\" width=\"%s\" "
                    "height=\"%s\">\n<title id=\"%s-title\">",
                    figure->name, width.s, height.s, width.s, height.s, figure->name);
  sonde_text_escape(out, figure->title);
  sonde_text_put(out, "</title>\n");
  if (alone)
    sonde_text_format(out, "<style>%s</style>\n<rect width=\"%s\" height=\"%s\" fill=\"#fff\"/>\n",
                      SONDE_SVG_STYLE, width.s, height.s);
  sonde_text_append(out, &figure->body);
  sonde_text_put(out, "</svg>\n");
}

void sonde_svg_line(sonde_text *out, double x1, double y1, double x2, double y2, const char *look) {
  sonde_text_format(out, "<line x1='%s' y1='%s' x2='%s' y2='%s' %s/>\n", sonde_coordinate(x1).s,
                    sonde_coordinate(y1).s, sonde_coordinate(x2).s, sonde_coordinate(y2).s, look);
}

void sonde_svg_rect(sonde_text *out, double x, double y, double w, double h, const char *look) {
  SONDE_ASSERT(w >= 0 && h >= 0);
  sonde_text_format(out, "<rect x='%s' y='%s' width='%s' height='%s' %s/>\n", sonde_coordinate(x).s,
                    sonde_coordinate(y).s, sonde_coordinate(w).s, sonde_coordinate(h).s, look);
}

void sonde_svg_circle(sonde_text *out, double x, double y, double radius, const char *look) {
  SONDE_ASSERT(radius > 0);
  sonde_text_format(out, "<circle cx='%s' cy='%s' r='%s' %s/>\n", sonde_coordinate(x).s,
                    sonde_coordinate(y).s, sonde_coordinate(radius).s, look);
}

void sonde_svg_text(sonde_text *out, double x, double y, const char *look, const char *utf8) {
  sonde_text_format(out, "<text x='%s' y='%s' %s>", sonde_coordinate(x).s, sonde_coordinate(y).s,
                    look);
  sonde_text_escape(out, utf8);
  sonde_text_put(out, "</text>\n");
}

void sonde_svg_text_up(sonde_text *out, double x, double y, const char *look, const char *utf8) {
  sonde_text_format(out, "<text transform='translate(%s %s) rotate(-90)' %s>",
                    sonde_coordinate(x).s, sonde_coordinate(y).s, look);
  sonde_text_escape(out, utf8);
  sonde_text_put(out, "</text>\n");
}

void sonde_svg_words(sonde_text *out, double x, double y, const char *look, const char *words) {
  sonde_text_format(out, "<text x='%s' y='%s' %s>%s</text>\n", sonde_coordinate(x).s,
                    sonde_coordinate(y).s, look, words);
}

// Tenths of a pixel as shortly as SVG allows: 12.3, .3, -4.
static void put_tenths(sonde_text *out, long tenths, bool separate) {
  long size = labs(tenths);
  const char *before = tenths < 0 ? "-" : separate ? " " : "";
  if (size % 10 == 0)
    sonde_text_format(out, "%s%ld", before, size / 10);
  else if (size < 10)
    sonde_text_format(out, "%s.%ld", before, size);
  else
    sonde_text_format(out, "%s%ld.%ld", before, size / 10, size % 10);
}

sonde_path sonde_path_begin(sonde_text *out, const char *look) {
  sonde_text_format(out, "<path %s d='", look);
  return (sonde_path){.out = out};
}

static void step(sonde_path *path, const char *command, double x, double y) {
  SONDE_ASSERT(isfinite(x) && isfinite(y) && fabs(x) < 1e7 && fabs(y) < 1e7);
  long to_x = lround(x * 10), to_y = lround(y * 10);
  sonde_text_put(path->out, command);
  put_tenths(path->out, to_x - path->x, false);
  put_tenths(path->out, to_y - path->y, true);
  path->x = to_x;
  path->y = to_y;
}

void sonde_path_move(sonde_path *path, double x, double y) {
  step(path, "m", x, y);
  path->start_x = path->x;
  path->start_y = path->y;
}

void sonde_path_draw(sonde_path *path, double x, double y) { step(path, "l", x, y); }

// Closing returns the pen to where the last move left it.
void sonde_path_close(sonde_path *path) {
  sonde_text_put(path->out, "z");
  path->x = path->start_x;
  path->y = path->start_y;
}

void sonde_path_dot(sonde_path *path, double x, double y) {
  step(path, "m", x, y);
  sonde_text_put(path->out, "h0");
}

void sonde_path_box(sonde_path *path, double x, double y, double w, double h) {
  SONDE_ASSERT(w >= 0 && h >= 0);
  sonde_path_move(path, x, y);
  long across = lround((x + w) * 10) - path->x, down = lround((y + h) * 10) - path->y;
  sonde_text_put(path->out, "h");
  put_tenths(path->out, across, false);
  sonde_text_put(path->out, "v");
  put_tenths(path->out, down, false);
  sonde_text_put(path->out, "h");
  put_tenths(path->out, -across, false);
  sonde_path_close(path);
}

void sonde_path_end(sonde_path *path) { sonde_text_put(path->out, "'/>\n"); }

double sonde_text_width(const char *utf8, double size) {
  double characters = 0;
  for (const char *p = utf8; *p; ++p) characters += (*p & 0xc0) != 0x80;
  return 0.56 * size * characters;
}
