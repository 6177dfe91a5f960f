// Pictures of few colours are read back by libpng with their colours; chunks of an animation are
// sound.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <png.h>
#include <zlib.h>

#include "sonde/files.h"

#include "base/base.h"
#include "files/png.h"

enum { WIDTH = 41, HEIGHT = 19, FRAMES = 3 };
static const uint8_t PALETTE[5][3] = {
    {255, 255, 255}, {200, 30, 20}, {20, 40, 200}, {240, 210, 50}, {1, 2, 3}};
static uint8_t pixels[FRAMES * WIDTH * HEIGHT];

static sonde_colours pattern(uint32_t frames) {
  for (uint32_t i = 0; i < sizeof pixels; ++i) pixels[i] = (uint8_t)((i * 7 + i / WIDTH) % 5);
  return (sonde_colours){.width = WIDTH,
                         .height = HEIGHT,
                         .frames = frames,
                         .frame_s = 0.5,
                         .colours = 5,
                         .palette = PALETTE,
                         .pixels = pixels};
}

static void colours_come_back(void **state) {
  (void)state;
  for (uint32_t frames = 1; frames <= FRAMES; frames += 2) {
    sonde_colours picture = pattern(frames);
    uint8_t *bytes;
    size_t count;
    assert_int_equal(sonde_colours_encode(&picture, &bytes, &count, NULL), SONDE_OK);
    png_image png = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_memory(&png, bytes, count));
    png.format = PNG_FORMAT_RGB;
    assert_int_equal(png.width, WIDTH);
    assert_int_equal(png.height, HEIGHT);
    uint8_t back[HEIGHT * WIDTH][3];
    assert_true(png_image_finish_read(&png, NULL, back, 0, NULL));
    for (uint32_t i = 0; i < WIDTH * HEIGHT; ++i)
      assert_memory_equal(back[i], PALETTE[pixels[i]], 3);
    sonde_free(bytes);
  }
}

static uint32_t number_at(const uint8_t *at) {
  return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

// Every chunk has its check sum, frames are numbered without a gap, and each unpacks to its pixels.
static void an_animation_holds_every_frame(void **state) {
  (void)state;
  sonde_colours picture = pattern(FRAMES);
  uint8_t *bytes;
  size_t count;
  assert_int_equal(sonde_colours_encode(&picture, &bytes, &count, NULL), SONDE_OK);
  uint32_t sequence = 0, frame = 0;
  for (size_t at = 8; at < count;) {
    uint32_t length = number_at(bytes + at);
    const uint8_t *name = bytes + at + 4, *data = name + 4;
    assert_int_equal(crc32(0, name, length + 4), number_at(data + length));
    bool first = !memcmp(name, "IDAT", 4), later = !memcmp(name, "fdAT", 4);
    if (!memcmp(name, "acTL", 4)) assert_int_equal(number_at(data), FRAMES);
    if (later || !memcmp(name, "fcTL", 4)) assert_int_equal(number_at(data), sequence++);
    if (!memcmp(name, "fcTL", 4))
      assert_int_equal((data[20] << 8 | data[21]) * 1000 / (data[22] << 8 | data[23]), 500);
    if (first || later) {
      uint8_t rows[HEIGHT * (WIDTH + 1)];
      uLongf size = sizeof rows;
      size_t skip = later ? 4 : 0;
      assert_int_equal(uncompress(rows, &size, data + skip, length - skip), Z_OK);
      assert_int_equal(size, sizeof rows);
      for (uint32_t y = 0; y < HEIGHT; ++y)
        assert_memory_equal(rows + y * (WIDTH + 1) + 1, pixels + (frame * HEIGHT + y) * WIDTH,
                            WIDTH);
      ++frame;
    }
    at += 12 + length;
  }
  assert_int_equal(frame, FRAMES);
  sonde_free(bytes);
}

static void a_missing_folder_is_told(void **state) {
  (void)state;
  sonde_colours picture = pattern(1);
  sonde_error error;
  assert_int_equal(sonde_colours_save_png(&picture, "/nowhere/x.png", &error), SONDE_IO);
  assert_non_null(strstr(error.message, "/nowhere/x.png"));
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(colours_come_back),
                                     cmocka_unit_test(an_animation_holds_every_frame),
                                     cmocka_unit_test(a_missing_folder_is_told)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
