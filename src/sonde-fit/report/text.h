// A growing UTF-8 text on the library's allocator, escaping for XML, and numbers as text that do
// not depend on the locale. After a failed allocation a text stays as it is and says so; the caller
// looks once, at the end.
#ifndef SONDE_SRC_REPORT_TEXT_H
#define SONDE_SRC_REPORT_TEXT_H

#include "base/link.h"
#include "base/base.h"

typedef struct sonde_text {
  char *bytes; // terminated by 0 once something was put
  size_t used, room;
  bool failed;
} sonde_text;

void sonde_text_put(sonde_text *text, const char *bytes);
// Only for strings and integers: real numbers go through the functions below.
void sonde_text_format(sonde_text *text, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
// Puts foreign text: the five characters of XML are escaped, what is neither a character of XML nor
// UTF-8 becomes U+FFFD. NULL is empty.
void sonde_text_escape(sonde_text *text, const char *utf8);
void sonde_text_append(sonde_text *text, const sonde_text *more);
SONDE_LINK void sonde_text_clear(sonde_text *text);

// A number as text, by value, so that it can stand in an argument list: sonde_fixed(x, 2).s
typedef struct sonde_number {
  char s[48];
} sonde_number;

// For readers: a true minus sign; an en dash for what is not finite.
SONDE_LINK sonde_number sonde_fixed(double x, int decimals);
sonde_number sonde_fixed_signed(double x, int decimals); // with + in front of what is positive
sonde_number sonde_significant(double x, int digits);    // powers of ten when very large or small
sonde_number sonde_short(double x);                      // at most 4 digits, no zeros at the end
sonde_number sonde_grouped(uint64_t x);                  // 1,828
// For coordinates: one decimal, plain ASCII; asserts that x is finite.
sonde_number sonde_coordinate(double x);

#endif
