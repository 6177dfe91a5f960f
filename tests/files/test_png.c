// An image written as PNG is read back by libpng with the same pixels, and a failed write is told.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <png.h>

#include "sonde/echo.h"
#include "sonde/files.h"

#include "base/base.h"

enum { WIDTH = 37, HEIGHT = 23 };

static sonde_image pattern(void) {
  sonde_image image;
  assert_int_equal(sonde_image_create(WIDTH, HEIGHT, &image, NULL), SONDE_OK);
  for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) image.pixels[i] = (uint8_t)(i * 7 + i / WIDTH);
  return image;
}

static void pixels_come_back(void **state) {
  (void)state;
  sonde_image image = pattern();
  char path[] = "/tmp/sonde_png_XXXXXX.png";
  int handle = mkstemps(path, 4);
  assert_true(handle >= 0);
  close(handle);
  assert_int_equal(sonde_image_save_png(&image, path, NULL), SONDE_OK);
  png_image png = {.version = PNG_IMAGE_VERSION};
  assert_true(png_image_begin_read_from_file(&png, path));
  png.format = PNG_FORMAT_GRAY;
  assert_int_equal(png.width, WIDTH);
  assert_int_equal(png.height, HEIGHT);
  uint8_t back[WIDTH * HEIGHT];
  assert_true(png_image_finish_read(&png, NULL, back, 0, NULL));
  assert_memory_equal(back, image.pixels, sizeof back);
  unlink(path);
  sonde_image_clear(&image);
}

static void a_missing_folder_is_told(void **state) {
  (void)state;
  sonde_image image = pattern();
  sonde_error error;
  assert_int_equal(sonde_image_save_png(&image, "/nowhere/x.png", &error), SONDE_IO);
  assert_non_null(strstr(error.message, "/nowhere/x.png"));
  sonde_image_clear(&image);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(pixels_come_back),
      cmocka_unit_test(a_missing_folder_is_told),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
