/**
 * @file files.h
 * Files in formats that need a library of their own (libsonde-files links libpng, libyaml and
 * zlib), and reports.
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

/**
 * Writes a report atomically: one HTML file that holds its data and the script that draws them
 * (web/src/report), opens from disk and loads nothing.
 * @param title of the window, UTF-8
 * @param json [length] one JSON object in UTF-8; its member "kind" names the view: fit, scene,
 * section, exam or class
 * @return IO naming the file, DISK, MEMORY
 * @thread owner
 */
SONDE_API sonde_status sonde_report_write(const char *path, const char *title, const char *json,
                                          size_t length, sonde_error *error);

#ifdef __cplusplus
}
#endif

#endif
