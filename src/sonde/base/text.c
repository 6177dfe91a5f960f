// Numbers from text, in the C locale whatever locale the program has set; characters of UTF-8.
#include "base/base.h"

#include <locale.h>
#include <pthread.h>

static locale_t c_locale;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void make_c_locale(void) { c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0); }

double sonde_parse_real(const char *text, const char **end) {
  pthread_once(&once, make_c_locale);
  SONDE_ASSERT(text);
  char *stop = NULL;
  double value = c_locale ? strtod_l(text, &stop, c_locale) : strtod(text, &stop);
  if (end) *end = stop;
  return value;
}

// RFC 3629. The 0 behind the text ends a character that is torn there.
size_t sonde_utf8_bytes(const unsigned char *c) {
  size_t more = c[0] < 0x80 ? 0 : c[0] < 0xc2 ? 4 : c[0] < 0xe0 ? 1 : c[0] < 0xf0 ? 2 : 3;
  if (more == 4 || c[0] > 0xf4) return 0;
  for (size_t k = 1; k <= more; ++k)
    if ((c[k] & 0xc0) != 0x80) return 0;
  bool overlong = (c[0] == 0xe0 && c[1] < 0xa0) || (c[0] == 0xf0 && c[1] < 0x90);
  bool beyond = (c[0] == 0xed && c[1] > 0x9f) || (c[0] == 0xf4 && c[1] > 0x8f);
  return overlong || beyond ? 0 : more + 1;
}
