// Grey images and their PNG files.
//
// sonde_image_create, sonde_image_clear
// sonde_png_encode      in memory
// sonde_image_save_png  in memory first, then atomically
#include "echo/png.h"

#include <png.h>
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

sonde_status sonde_png_encode(const sonde_image *image, uint8_t **bytes, size_t *count,
                              sonde_error *error) {
  SONDE_ASSERT(image != NULL && image->pixels != NULL && bytes != NULL && count != NULL);
  png_image png = {.version = PNG_IMAGE_VERSION,
                   .width = image->width,
                   .height = image->height,
                   .format = PNG_FORMAT_GRAY};
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  *count = 0;
  *bytes = sonde_calloc(1, size);
  if (*bytes == NULL) return sonde_fail_memory(error);
  if (!png_image_write_to_memory(&png, *bytes, &size, 0, image->pixels, 0, NULL)) {
    sonde_free(*bytes);
    *bytes = NULL;
    return sonde_fail(error, SONDE_IO, "image as PNG: %s", png.message);
  }
  *count = size;
  return SONDE_OK;
}

sonde_status sonde_image_save_png(const sonde_image *image, const char *path, sonde_error *error) {
  SONDE_ASSERT(path != NULL);
  uint8_t *bytes = NULL;
  size_t count = 0;
  sonde_file *file = NULL;
  sonde_status status = sonde_png_encode(image, &bytes, &count, error);
  if (status == SONDE_OK) status = sonde_file_create(path, &file, error);
  if (status == SONDE_OK) {
    sonde_file_write(file, bytes, count);
    status = sonde_file_commit(file, error);
  }
  sonde_free(bytes);
  return status;
}
