// Numbers from text, in the C locale whatever locale the program has set.
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
