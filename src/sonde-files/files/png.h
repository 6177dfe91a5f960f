// PNG files in memory.
#ifndef SONDE_SRC_FILES_PNG_H
#define SONDE_SRC_FILES_PNG_H

#include "base/link.h"
#include "base/base.h"
#include "sonde/files.h"

// An 8-bit grey PNG. *bytes [*count] freed by sonde_free.
SONDE_LINK sonde_status sonde_png_encode(const sonde_image *image, uint8_t **bytes, size_t *count,
                                         sonde_error *error);

// A PNG of indexed colours, animated when it has several frames. *bytes [*count] freed by
// sonde_free.
sonde_status sonde_colours_encode(const sonde_colours *picture, uint8_t **bytes, size_t *count,
                                  sonde_error *error);

// The first frame stored within an SVG drawing, stretched to a box. @return MEMORY or IO
SONDE_LINK sonde_status sonde_svg_put_colours(sonde_file *file, double x, double y, double width,
                                              double height, const sonde_colours *picture,
                                              sonde_error *error);

// Characters of `count` bytes in base64, with the end.
#define SONDE_BASE64_TEXT(count) (((count) + 2) / 3 * 4 + 1)
// Writes bytes as text (RFC 4648, section 4). @param[out] text [SONDE_BASE64_TEXT(count)]
SONDE_LINK void sonde_base64_write(const uint8_t *bytes, size_t count, char *text);
// The same in memory of its own. @return freed by sonde_free(); NULL: out of memory
SONDE_LINK char *sonde_base64_encode(const uint8_t *bytes, size_t count);

#endif
