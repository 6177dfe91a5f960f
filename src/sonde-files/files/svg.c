// Drawings as SVG, for files that no browser has a part in. Coordinates have one decimal.
#include "base/base.h"
#include "base/utf8.h"
#include "files/png.h"
#include "sonde/files.h"

#include <math.h>
#include <string.h>

// A coordinate in tenths of a pixel, in any locale.
static void put_tenths(sonde_file *file, char before, double x) {
  SONDE_ASSERT(isfinite(x) && fabs(x) < 1e7);
  long tenths = lround(10 * x), size = labs(tenths);
  sonde_file_printf(file, "%c%s%ld", before, tenths < 0 ? "-" : "", size / 10);
  if (size % 10) sonde_file_printf(file, ".%ld", size % 10);
}

static void put_text(sonde_file *file, const char *utf8) {
  for (const unsigned char *c = (const unsigned char *)utf8; *c;) {
    size_t bytes = utf8_character(c);
    if (*c == '<' || *c == '>' || *c == '&')
      sonde_file_printf(file, "&#%u;", *c);
    else if (bytes == 0 || (*c < 0x20 && *c != '\t' && *c != '\n'))
      sonde_file_printf(file, "\ufffd");
    else
      sonde_file_write(file, c, bytes);
    c += bytes ? bytes : 1;
  }
}

void sonde_svg_begin(sonde_file *file, const char *title, double width, double height) {
  SONDE_ASSERT(file && title && width > 0 && height > 0);
  long w = lround(width), h = lround(height);
  sonde_file_printf(
      file,
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns='http://www.w3.org/2000/svg' "
      "viewBox='0 0 %ld %ld' width='%ld' height='%ld' font-family='\"Helvetica Neue\",Arial,"
      "\"Liberation Sans\",sans-serif' font-size='12'>\n<title>",
      w, h, w, h);
  put_text(file, title);
  sonde_file_printf(
      file, "</title>\n<style>text{fill:#222}.tick{font-size:11px;fill:#444}.head{font-size:13px;"
            "font-weight:600}.middle{text-anchor:middle}.end{text-anchor:end}.light{font-size:9px;"
            "fill:#fff}</style>\n<rect width='100%%' height='100%%' fill='#fff'/>\n");
}

static void put_path(sonde_file *file, const double (*xy)[2], uint32_t count, uint32_t corners,
                     const char *end, const char *look) {
  SONDE_ASSERT(file && look && corners > 0 && count % corners == 0);
  sonde_file_printf(file, "<path %s d='", look);
  for (uint32_t i = 0; i < count; ++i) {
    put_tenths(file, i % corners ? 'L' : 'M', xy[i][0]);
    put_tenths(file, ' ', xy[i][1]);
    if ((i + 1) % corners == 0) sonde_file_printf(file, "%s", end);
  }
  sonde_file_printf(file, "'/>\n");
}

void sonde_svg_put_line(sonde_file *file, const double (*xy)[2], uint32_t count, const char *look) {
  if (count) put_path(file, xy, count, count, "", look);
}

void sonde_svg_put_outlines(sonde_file *file, const double (*xy)[2], uint32_t count,
                            uint32_t corners, const char *look) {
  if (count) put_path(file, xy, count, corners, "z", look);
}

static void put_attribute(sonde_file *file, const char *name, double x) {
  sonde_file_printf(file, " %s=", name);
  put_tenths(file, '\'', x);
  sonde_file_printf(file, "'");
}

void sonde_svg_put_circle(sonde_file *file, double x, double y, double radius, const char *look) {
  SONDE_ASSERT(radius > 0 && look);
  sonde_file_printf(file, "<circle");
  put_attribute(file, "cx", x);
  put_attribute(file, "cy", y);
  put_attribute(file, "r", radius);
  sonde_file_printf(file, " %s/>\n", look);
}

void sonde_svg_put_text(sonde_file *file, double x, double y, const char *look, const char *utf8) {
  SONDE_ASSERT(look && utf8);
  sonde_file_printf(file, "<text");
  put_attribute(file, "x", x);
  put_attribute(file, "y", y);
  sonde_file_printf(file, " %s>", look);
  put_text(file, utf8);
  sonde_file_printf(file, "</text>\n");
}

// Bytes of a PNG, which are freed, as a part of the drawing.
static sonde_status put_png(sonde_file *file, double x, double y, double width, double height,
                            uint8_t *bytes, size_t count, sonde_error *error) {
  SONDE_ASSERT(file && bytes && width > 0 && height > 0);
  char *text = sonde_base64_encode(bytes, count);
  sonde_free(bytes);
  if (!text) return sonde_fail_memory(error);
  sonde_file_printf(file, "<image");
  put_attribute(file, "x", x);
  put_attribute(file, "y", y);
  put_attribute(file, "width", width);
  put_attribute(file, "height", height);
  sonde_file_printf(file, " preserveAspectRatio='none' href='data:image/png;base64,");
  sonde_file_write(file, text, strlen(text));
  sonde_file_printf(file, "'/>\n");
  sonde_free(text);
  return SONDE_OK;
}

sonde_status sonde_svg_put_image(sonde_file *file, double x, double y, double width, double height,
                                 const sonde_image *image, sonde_error *error) {
  SONDE_ASSERT(image && image->pixels);
  uint8_t *bytes = NULL;
  size_t count = 0;
  sonde_status status = sonde_png_encode(image, &bytes, &count, error);
  return status ? status : put_png(file, x, y, width, height, bytes, count, error);
}

sonde_status sonde_svg_put_colours(sonde_file *file, double x, double y, double width,
                                   double height, const sonde_colours *picture,
                                   sonde_error *error) {
  uint8_t *bytes = NULL;
  size_t count = 0;
  sonde_status status = sonde_colours_encode(picture, &bytes, &count, error);
  return status ? status : put_png(file, x, y, width, height, bytes, count, error);
}

sonde_status sonde_svg_end(sonde_file *file, sonde_error *error) {
  sonde_file_printf(file, "</svg>\n");
  return sonde_file_commit(file, error);
}
