// Pictures of other programs as grey values: PNG by libpng, JPEG by libjpeg.
#include "base/base.h"
#include "base/bounds.h"
#include "sonde/files_scanner.h"

#include <stdio.h>
#include <string.h>

#include <jpeglib.h>
#include <png.h>
#include <setjmp.h>

// An error of libjpeg returns to the reader.
typedef struct jpeg_trouble {
  struct jpeg_error_mgr manager;
  jmp_buf out;
  char text[JMSG_LENGTH_MAX];
} jpeg_trouble;

static void leave_jpeg(j_common_ptr jpeg) {
  jpeg_trouble *trouble = (jpeg_trouble *)(void *)jpeg->err;
  jpeg->err->format_message(jpeg, trouble->text);
  longjmp(trouble->out, 1);
}

static void ignore_warning(j_common_ptr jpeg) { (void)jpeg; }

static sonde_status load_jpeg(const char *path, const uint8_t *bytes, size_t count,
                              sonde_image *image, sonde_error *error) {
  struct jpeg_decompress_struct jpeg;
  jpeg_trouble trouble;
  jpeg.err = jpeg_std_error(&trouble.manager);
  trouble.manager.error_exit = leave_jpeg;
  trouble.manager.output_message = ignore_warning;
  if (setjmp(trouble.out)) {
    jpeg_destroy_decompress(&jpeg);
    sonde_image_clear(image);
    return sonde_fail(error, SONDE_FORMAT, "%s: %s", path, trouble.text);
  }
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, bytes, (unsigned long)count);
  jpeg_read_header(&jpeg, TRUE);
  jpeg.out_color_space = JCS_GRAYSCALE;
  sonde_status status = sonde_image_create(jpeg.image_width, jpeg.image_height, image, error);
  if (!status) {
    jpeg_start_decompress(&jpeg);
    while (jpeg.output_scanline < jpeg.output_height) {
      JSAMPROW row = image->pixels + (size_t)jpeg.output_scanline * image->width;
      jpeg_read_scanlines(&jpeg, &row, 1);
    }
    jpeg_finish_decompress(&jpeg);
  }
  jpeg_destroy_decompress(&jpeg);
  return status;
}

sonde_status sonde_image_load(const char *path, sonde_image *image, sonde_error *error) {
  SONDE_ASSERT(path != NULL && image != NULL);
  static const uint8_t PNG[] = {0x89, 'P', 'N', 'G'}, JPEG[] = {0xff, 0xd8};
  char *bytes = NULL;
  size_t count = 0;
  memset(image, 0, sizeof *image);
  sonde_status status = sonde_bounded_load(path, &sonde_limits_image, &bytes, &count, error);
  if (status) return status;
  const uint8_t *data = (const uint8_t *)bytes;
  if (count >= sizeof PNG && memcmp(data, PNG, sizeof PNG) == 0) {
    png_image png = {.version = PNG_IMAGE_VERSION};
    const png_color black = {0, 0, 0};
    bool good = png_image_begin_read_from_memory(&png, data, count) != 0;
    png.format = PNG_FORMAT_GRAY;
    if (good) status = sonde_image_create(png.width, png.height, image, error);
    if (good && !status) good = png_image_finish_read(&png, &black, image->pixels, 0, NULL) != 0;
    if (!good) status = sonde_fail(error, SONDE_FORMAT, "%s: %s", path, png.message);
    if (!good) sonde_image_clear(image);
    png_image_free(&png);
  } else if (count >= sizeof JPEG && memcmp(data, JPEG, sizeof JPEG) == 0)
    status = load_jpeg(path, data, count, image, error);
  else
    status = sonde_fail(error, SONDE_FORMAT, "%s: expected a PNG or JPEG picture", path);
  sonde_free(bytes);
  return status;
}
