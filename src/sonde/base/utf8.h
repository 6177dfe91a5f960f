// Characters of UTF-8 (RFC 3629).
#ifndef SONDE_SRC_BASE_UTF8_H
#define SONDE_SRC_BASE_UTF8_H

#include <stdbool.h>
#include <stddef.h>

// Bytes of the character that starts here, 0 when none does: not overlong, no surrogate, not beyond
// U+10FFFF. A 0 behind the text ends a character that is torn there.
static inline size_t utf8_character(const unsigned char *c) {
  size_t more = c[0] < 0x80 ? 0 : c[0] < 0xc2 ? 4 : c[0] < 0xe0 ? 1 : c[0] < 0xf0 ? 2 : 3;
  if (more == 4 || c[0] > 0xf4) return 0;
  for (size_t k = 1; k <= more; ++k)
    if ((c[k] & 0xc0) != 0x80) return 0;
  bool overlong = (c[0] == 0xe0 && c[1] < 0xa0) || (c[0] == 0xf0 && c[1] < 0x90);
  bool beyond = (c[0] == 0xed && c[1] > 0x9f) || (c[0] == 0xf4 && c[1] > 0x8f);
  return overlong || beyond ? 0 : more + 1;
}

#endif
