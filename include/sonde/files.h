/**
 * @file files.h
 * Files in formats that need a library of their own (libsonde-files links libpng and libyaml).
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

#ifdef __cplusplus
}
#endif

#endif
