// Small text on grey pictures: letters of 5 x 9 dots.
#include "replay_export.h"

#include <assert.h>

typedef struct glyph {
  char character;
  uint8_t row[CAPTION_HEIGHT]; // highest of 5 bits: left
} glyph;

static const glyph GLYPHS[] = {
    {'0', {14, 17, 19, 21, 25, 17, 14, 0, 0}}, {'1', {4, 12, 4, 4, 4, 4, 14, 0, 0}},
    {'2', {14, 17, 1, 2, 4, 8, 31, 0, 0}},     {'3', {31, 2, 4, 2, 1, 17, 14, 0, 0}},
    {'4', {2, 6, 10, 18, 31, 2, 2, 0, 0}},     {'5', {31, 16, 30, 1, 1, 17, 14, 0, 0}},
    {'6', {6, 8, 16, 30, 17, 17, 14, 0, 0}},   {'7', {31, 1, 2, 4, 8, 8, 8, 0, 0}},
    {'8', {14, 17, 17, 14, 17, 17, 14, 0, 0}}, {'9', {14, 17, 17, 15, 1, 2, 12, 0, 0}},
    {'.', {0, 0, 0, 0, 0, 12, 12, 0, 0}},      {'-', {0, 0, 0, 14, 0, 0, 0, 0, 0}},
    {'%', {24, 25, 2, 4, 8, 19, 3, 0, 0}},     {'N', {17, 17, 25, 21, 19, 17, 17, 0, 0}},
    {'a', {0, 0, 14, 1, 15, 17, 15, 0, 0}},    {'c', {0, 0, 14, 16, 16, 17, 14, 0, 0}},
    {'d', {1, 1, 13, 19, 17, 17, 15, 0, 0}},   {'e', {0, 0, 14, 17, 31, 16, 14, 0, 0}},
    {'f', {6, 9, 8, 28, 8, 8, 8, 0, 0}},       {'h', {16, 16, 22, 25, 17, 17, 17, 0, 0}},
    {'i', {4, 0, 12, 4, 4, 4, 14, 0, 0}},      {'m', {0, 0, 26, 21, 21, 17, 17, 0, 0}},
    {'n', {0, 0, 22, 25, 17, 17, 17, 0, 0}},   {'o', {0, 0, 14, 17, 17, 17, 14, 0, 0}},
    {'p', {0, 0, 30, 17, 17, 17, 30, 16, 16}}, {'r', {0, 0, 22, 25, 16, 16, 16, 0, 0}},
    {'s', {0, 0, 14, 16, 14, 1, 30, 0, 0}},    {'t', {8, 8, 28, 8, 8, 9, 6, 0, 0}},
    {'v', {0, 0, 17, 17, 17, 10, 4, 0, 0}},    {'y', {0, 0, 17, 17, 17, 17, 15, 1, 14}},
    {'b', {16, 16, 30, 17, 17, 17, 30, 0, 0}}, {'k', {16, 16, 18, 20, 24, 20, 18, 0, 0}},
    {'l', {12, 4, 4, 4, 4, 4, 14, 0, 0}},      {'u', {0, 0, 17, 17, 17, 19, 13, 0, 0}},
    {'x', {0, 0, 17, 10, 4, 10, 17, 0, 0}}};

void caption_draw(uint8_t *pixels, uint32_t width, uint32_t height, uint32_t x, uint32_t y,
                  uint32_t scale, const char *text) {
  assert(scale > 0);
  const uint8_t bright = 220;
  for (; *text; ++text, x += CAPTION_WIDTH * scale) {
    const glyph *g = GLYPHS, *end = GLYPHS + sizeof GLYPHS / sizeof GLYPHS[0];
    while (g < end && g->character != *text) ++g; // none: a space
    // Every dot is a square of `scale` pixels, as far as it lies in the picture.
    for (uint32_t j = 0; g < end && j < CAPTION_HEIGHT * scale && y + j < height; ++j)
      for (uint32_t i = 0; i < 5 * scale && x + i < width; ++i)
        if (g->row[j / scale] >> (4 - i / scale) & 1)
          pixels[(size_t)(y + j) * width + x + i] = bright;
  }
}
