/**
 * @file files.h
 * Files in formats that need a library of their own (libsonde-files links libpng, libyaml,
 * libnifti2 and zlib), and reports.
 */
#ifndef SONDE_FILES_H
#define SONDE_FILES_H

#include "sonde/echo.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Writes an 8-bit grey PNG atomically. @thread owner */
SONDE_API sonde_status sonde_image_save_png(const sonde_image *image, const char *path,
                                            sonde_error *error);

/** Pictures of one size and few colours; all memory is the caller's. */
typedef struct sonde_colours {
  uint32_t width, height, frames;
  double frame_s;              /**< how long a frame is shown, up to 65 s */
  uint32_t colours;            /**< 1 to 256 */
  const uint8_t (*palette)[3]; /**< [colours] red, green, blue */
  const uint8_t *pixels;       /**< [frames*height*width] below colours */
} sonde_colours;
/** Writes a PNG atomically: an animated one (APNG, which browsers play and other programs show the
 * first frame of) when there are several frames. @return MEMORY, IO, DISK @thread owner */
SONDE_API sonde_status sonde_colours_save_png(const sonde_colours *picture, const char *path,
                                              sonde_error *error);

/**
 * Writes a report atomically: one HTML file that holds its data and the script that draws them
 * (web/src/report), opens from disk and loads nothing.
 * @param title of the window, UTF-8
 * @param json [length] one JSON object in UTF-8; its member "kind" names the view: fit, scene,
 * exam or paper
 * @return IO naming the file, DISK, MEMORY
 * @thread owner
 */
SONDE_API sonde_status sonde_report_write(const char *path, const char *title, const char *json,
                                          size_t length, sonde_error *error);

/** Writes a text of a CSV row in quotation marks, those within it doubled (RFC 4180).
 * @thread owner */
SONDE_API void sonde_csv_put_text(sonde_file *file, const char *utf8);

/** Begins a drawing as SVG on an output file: lengths in pixels, y downwards, on white; words in
 * the classes tick, head, middle, end, light. @param title UTF-8 @thread owner */
SONDE_API void sonde_svg_begin(sonde_file *file, const char *title, double width, double height);
/** An open line. @param xy [count][2] @param look attributes, e.g. "stroke='#333'" @thread owner */
SONDE_API void sonde_svg_put_line(sonde_file *file, const double (*xy)[2], uint32_t count,
                                  const char *look);
/** Closed outlines of the same look, drawn as one.
 * @param xy [count][2] @param corners of each outline; count is a multiple of it @thread owner */
SONDE_API void sonde_svg_put_outlines(sonde_file *file, const double (*xy)[2], uint32_t count,
                                      uint32_t corners, const char *look);
/** @thread owner */
SONDE_API void sonde_svg_put_circle(sonde_file *file, double x, double y, double radius,
                                    const char *look);
/** Words with their base line at y. @param utf8 escaped here; what XML cannot hold becomes U+FFFD
 * @thread owner */
SONDE_API void sonde_svg_put_text(sonde_file *file, double x, double y, const char *look,
                                  const char *utf8);
/** A grey image, stored within the drawing, stretched to a box. @return MEMORY or IO @thread owner
 */
SONDE_API sonde_status sonde_svg_put_image(sonde_file *file, double x, double y, double width,
                                           double height, const sonde_image *image,
                                           sonde_error *error);
/** Ends the drawing and commits the file. @return as sonde_file_commit() @thread owner */
SONDE_API sonde_status sonde_svg_end(sonde_file *file, sonde_error *error);

#ifdef __cplusplus
}
#endif

#endif
