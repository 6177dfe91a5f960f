/**
 * @file files_scanner.h
 * Scanners as YAML files, and pictures that real scanners stored.
 */
#ifndef SONDE_FILES_SCANNER_H
#define SONDE_FILES_SCANNER_H

#include "sonde/echo_scanner.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SONDE_SCANNER_VERSION 1

/** The plain scanner: one look, logarithm, nothing else. @thread any */
SONDE_API sonde_scanner sonde_scanner_plain(void);
/** Reads a scanner (docs/echo.md). What the file leaves out is as the plain scanner has it.
 *  @param[out] title NULL, or [size] its title
 *  @return IO, FORMAT, VERSION, ARGUMENT with the line @thread owner */
SONDE_API sonde_status sonde_scanner_load(const char *path, sonde_scanner *scanner, char *title,
                                          size_t size, sonde_error *error);
/** The scanner of a name: "plain", one of a directory (NAME.yaml there), or a file, whose name has
 * a dot or a slash. @param directory NULL: the working directory
 *  @return NOT_FOUND; as sonde_scanner_load() @thread owner */
SONDE_API sonde_status sonde_scanner_find(const char *name, const char *directory,
                                          sonde_scanner *scanner, sonde_error *error);
/** Writes a scanner atomically, all numbers. @param title one line, UTF-8 @return IO, DISK
 *  @thread owner */
SONDE_API sonde_status sonde_scanner_save(const sonde_scanner *scanner, const char *title,
                                          const char *path, sonde_error *error);
/** Reads a PNG or JPEG picture as grey values; its size in metres is unknown (0).
 *  @param[out] image cleared by sonde_image_clear() @return IO, FORMAT, MEMORY @thread owner */
SONDE_API sonde_status sonde_image_load(const char *path, sonde_image *image, sonde_error *error);

#ifdef __cplusplus
}
#endif

#endif
