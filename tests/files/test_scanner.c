// Scanner files: what is written is read back, what no scanner can have is refused with its line;
// and pictures of other programs.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <jpeglib.h>

#include "base/base.h"
#include "sonde/files.h"
#include "sonde/files_scanner.h"

static double *number(sonde_scanner *s, const sonde_scanner_number *n) {
  return (double *)(void *)((char *)s + n->offset);
}

static void numbers_come_back(void **state) {
  (void)state;
  uint32_t count;
  const sonde_scanner_number *n = sonde_scanner_numbers(&count);
  sonde_scanner out = sonde_scanner_plain(), in;
  for (uint32_t k = 0; k < count; ++k)
    *number(&out, &n[k]) = n[k].si * (n[k].low + (n[k].high - n[k].low) * (k + 1) / (count + 1));
  for (int k = 0; k < SONDE_SCANNER_SLIDERS; ++k) out.slider_db[k] = k - 3.5;
  char path[] = "/tmp/sonde_scanner_XXXXXX.yaml", title[64];
  const int file = mkstemps(path, 5);
  assert_true(file >= 0);
  close(file);
  assert_int_equal(sonde_scanner_save(&out, "A \"quoted\" one", path, NULL), SONDE_OK);
  assert_int_equal(sonde_scanner_load(path, &in, title, sizeof title, NULL), SONDE_OK);
  assert_string_equal(title, "A \"quoted\" one");
  for (uint32_t k = 0; k < count; ++k) {
    const double wrote = *number(&out, &n[k]), read = *number(&in, &n[k]);
    assert_true(fabs(read - wrote) <= 2e-6 * fabs(wrote));
  }
  assert_memory_equal(in.slider_db, out.slider_db, sizeof in.slider_db);
  unlink(path);
}

static void refuse(const char *text, sonde_status status, const char *says) {
  char path[] = "/tmp/sonde_scanner_XXXXXX.yaml";
  const int file = mkstemps(path, 5);
  assert_true(file >= 0 && write(file, text, strlen(text)) == (ssize_t)strlen(text));
  close(file);
  sonde_scanner s;
  sonde_error error = {0};
  assert_int_equal(sonde_scanner_load(path, &s, NULL, 0, &error), status);
  if (!strstr(error.message, says)) fail_msg("'%s' does not say '%s'", error.message, says);
  unlink(path);
}

static void absurd_files_are_refused(void **state) {
  (void)state;
  refuse("sonde_scanner: 2\ntitle: x\n", SONDE_VERSION, "expected 1");
  refuse("sonde_scanner: 1\ntitle: x\nlooks: 9\n", SONDE_ARGUMENT, "looks");
  refuse("sonde_scanner: 1\ntitle: x\nsharpness: 1\n", SONDE_FORMAT, "sharpness");
  refuse("sonde_scanner: 1\ntitle: x\nsliders_db: [1, 2]\n", SONDE_FORMAT, "2 sliders");
}

// A ramp as JPEG and as PNG is read as the same grey values within what JPEG changes; other bytes
// are no picture.
static void pictures_are_read(void **state) {
  (void)state;
  enum { WIDTH = 64, HEIGHT = 24 };
  char path[] = "/tmp/sonde_picture_XXXXXX.pic";
  const int file = mkstemps(path, 4);
  sonde_image out, in;
  assert_true(file >= 0);
  close(file);
  assert_int_equal(sonde_image_create(WIDTH, HEIGHT, &out, NULL), SONDE_OK);
  for (uint32_t i = 0; i < WIDTH * HEIGHT; ++i) out.pixels[i] = (uint8_t)(3 * (i % WIDTH) + 20);
  assert_int_equal(sonde_image_save_png(&out, path, NULL), SONDE_OK);
  assert_int_equal(sonde_image_load(path, &in, NULL), SONDE_OK);
  assert_true(in.width == WIDTH && in.height == HEIGHT);
  assert_memory_equal(in.pixels, out.pixels, WIDTH * HEIGHT);
  sonde_image_clear(&in);
  // The same by libjpeg.
  FILE *stream = fopen(path, "wb");
  struct jpeg_compress_struct jpeg;
  struct jpeg_error_mgr manager;
  assert_non_null(stream);
  jpeg.err = jpeg_std_error(&manager);
  jpeg_create_compress(&jpeg);
  jpeg_stdio_dest(&jpeg, stream);
  jpeg.image_width = WIDTH, jpeg.image_height = HEIGHT;
  jpeg.input_components = 1, jpeg.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 95, TRUE);
  jpeg_start_compress(&jpeg, TRUE);
  for (uint32_t y = 0; y < HEIGHT; ++y) {
    JSAMPROW row = out.pixels + (size_t)y * WIDTH;
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  fclose(stream);
  assert_int_equal(sonde_image_load(path, &in, NULL), SONDE_OK);
  for (uint32_t i = 0; i < WIDTH * HEIGHT; ++i)
    assert_in_range(in.pixels[i] - out.pixels[i] + 4, 0, 8);
  sonde_image_clear(&in);
  // Half of it, and none.
  assert_int_equal(truncate(path, 30), 0);
  assert_int_equal(sonde_image_load(path, &in, NULL), SONDE_FORMAT);
  assert_null(in.pixels);
  assert_int_equal(truncate(path, 1), 0);
  assert_int_equal(sonde_image_load(path, &in, NULL), SONDE_FORMAT);
  sonde_image_clear(&out);
  unlink(path);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(numbers_come_back),
                                     cmocka_unit_test(absurd_files_are_refused),
                                     cmocka_unit_test(pictures_are_read)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
