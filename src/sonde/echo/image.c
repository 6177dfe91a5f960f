// Grey images in memory; room files writes them as PNG.
#include "base/base.h"
#include "sonde/echo.h"

#include <string.h>

enum { LARGEST_SIDE = 16384 };

sonde_status sonde_image_create(uint32_t width, uint32_t height, sonde_image *image,
                                sonde_error *error) {
  SONDE_ASSERT(image != NULL);
  memset(image, 0, sizeof *image);
  if (width == 0 || height == 0 || width > LARGEST_SIDE || height > LARGEST_SIDE)
    return sonde_fail(error, SONDE_ARGUMENT, "image of %u x %u pixels; expected 1 to %d", width,
                      height, LARGEST_SIDE);
  image->pixels = SONDE_NEW(uint8_t, (size_t)width * height);
  if (image->pixels == NULL) return sonde_fail_memory(error);
  image->width = width;
  image->height = height;
  return SONDE_OK;
}

void sonde_image_clear(sonde_image *image) {
  if (image == NULL) return;
  sonde_free(image->pixels);
  memset(image, 0, sizeof *image);
}
