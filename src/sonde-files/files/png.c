// Grey images as PNG: the whole file is encoded in memory and then written atomically.
#include "files/png.h"

#include <png.h>

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

void sonde_base64_write(const uint8_t *bytes, size_t count, char *text) {
  static const char DIGITS[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  SONDE_ASSERT(text && (bytes || count == 0));
  size_t used = 0;
  for (size_t i = 0; i < count; i += 3) {
    uint32_t group = (uint32_t)bytes[i] << 16;
    if (i + 1 < count) group |= (uint32_t)bytes[i + 1] << 8;
    if (i + 2 < count) group |= bytes[i + 2];
    text[used++] = DIGITS[group >> 18];
    text[used++] = DIGITS[group >> 12 & 63];
    text[used++] = i + 1 < count ? DIGITS[group >> 6 & 63] : '=';
    text[used++] = i + 2 < count ? DIGITS[group & 63] : '=';
  }
  text[used] = 0;
}

char *sonde_base64_encode(const uint8_t *bytes, size_t count) {
  char *text = SONDE_NEW(char, SONDE_BASE64_TEXT(count));
  if (text) sonde_base64_write(bytes, count, text);
  return text;
}
