// reserve:   room for more bytes, doubling.
// sequence:  length of the UTF-8 character that XML allows at p, 0 when there is none.
// digits:    an integer as digits with a decimal point inside.
// power:     " x 10^e" in superscript digits.
#include "report/text.h"

#include <math.h>
#include <stdarg.h>
#include <string.h>

static const char DASH[] = "\u2013", MINUS[] = "\u2212";

static bool reserve(sonde_text *text, size_t more) {
  if (text->failed) return false;
  SONDE_ASSERT(text->used <= text->room);
  if (text->room - text->used > more) return true;
  size_t room = text->room ? 2 * text->room : 1024;
  while (room - text->used <= more) room *= 2;
  char *grown = sonde_realloc(text->bytes, text->used, room);
  text->failed = !grown;
  if (!grown) return false;
  text->bytes = grown;
  text->room = room;
  return true;
}

static void put_bytes(sonde_text *text, const char *bytes, size_t count) {
  if (!reserve(text, count)) return;
  memcpy(text->bytes + text->used, bytes, count);
  text->used += count;
  text->bytes[text->used] = 0;
}

void sonde_text_put(sonde_text *text, const char *bytes) {
  SONDE_ASSERT(bytes);
  put_bytes(text, bytes, strlen(bytes));
}

void sonde_text_append(sonde_text *text, const sonde_text *more) {
  SONDE_ASSERT(text != more);
  if (more->failed) text->failed = true;
  if (more->used) put_bytes(text, more->bytes, more->used);
}

void sonde_text_clear(sonde_text *text) {
  sonde_free(text->bytes);
  *text = (sonde_text){0};
}

void sonde_text_format(sonde_text *text, const char *format, ...) {
  va_list first, second;
  va_start(first, format);
  va_copy(second, first);
  int length = vsnprintf(NULL, 0, format, first);
  SONDE_ASSERT(length >= 0);
  if (reserve(text, (size_t)length)) {
    vsnprintf(text->bytes + text->used, (size_t)length + 1, format, second);
    text->used += (size_t)length;
  }
  va_end(second);
  va_end(first);
}

static bool is_character(uint32_t code) {
  if (code < 0x20) return code == '\t' || code == '\n' || code == '\r';
  return !(code >= 0xd800 && code < 0xe000) && code != 0xfffe && code != 0xffff && code < 0x110000;
}

static size_t sequence(const unsigned char *p) {
  static const uint32_t LEAST[5] = {0, 0, 0x80, 0x800, 0x10000};
  size_t length = p[0] < 0x80 ? 1 : p[0] < 0xc0 ? 0 : p[0] < 0xe0 ? 2 : p[0] < 0xf0 ? 3 : 4;
  if (length == 0 || p[0] > 0xf4) return 0;
  uint32_t code = length == 1 ? p[0] : p[0] & (0xffu >> (length + 1));
  for (size_t i = 1; i < length; ++i) {
    if ((p[i] & 0xc0) != 0x80) return 0; // the terminating 0 stops here too
    code = code << 6 | (p[i] & 0x3fu);
  }
  return code >= LEAST[length] && is_character(code) ? length : 0;
}

static const char *entity(unsigned char c) {
  switch (c) {
  case '<': return "&lt;";
  case '>': return "&gt;";
  case '&': return "&amp;";
  case '"': return "&quot;";
  case '\'': return "&#39;";
  default: return NULL;
  }
}

void sonde_text_escape(sonde_text *text, const char *utf8) {
  for (const unsigned char *p = (const unsigned char *)utf8; p && *p;) {
    size_t length = sequence(p);
    const char *name = entity(*p);
    if (name)
      sonde_text_put(text, name);
    else if (length)
      put_bytes(text, (const char *)p, length);
    else
      sonde_text_put(text, "\ufffd");
    p += length ? length : 1;
  }
}

// ---- numbers ------------------------------------------------------------------------------

static double ten_to(int exponent) {
  double power = 1;
  for (int i = 0; i < abs(exponent); ++i) power *= 10;
  return exponent < 0 ? 1 / power : power;
}

static void digits(char *out, size_t room, uint64_t scaled, int decimals) {
  char reversed[32];
  int used = 0;
  SONDE_ASSERT(decimals >= 0 && decimals <= 15);
  for (int i = 0; i <= decimals || scaled; ++i) {
    if (i == decimals && decimals) reversed[used++] = '.';
    reversed[used++] = (char)('0' + scaled % 10);
    scaled /= 10;
  }
  SONDE_ASSERT((size_t)used < room && used < (int)sizeof reversed);
  for (int i = 0; i < used; ++i) out[i] = reversed[used - 1 - i];
  out[used] = 0;
}

sonde_number sonde_fixed(double x, int decimals) {
  sonde_number number = {{0}};
  double scaled = fabs(x) * ten_to(decimals);
  if (!isfinite(x)) {
    snprintf(number.s, sizeof number.s, "%s", DASH);
  } else if (scaled > 1e15) {
    number = sonde_significant(x, 6);
  } else {
    uint64_t whole = (uint64_t)(scaled + 0.5);
    size_t sign = x < 0 && whole ? strlen(MINUS) : 0;
    memcpy(number.s, MINUS, sign);
    digits(number.s + sign, sizeof number.s - sign, whole, decimals);
  }
  return number;
}

sonde_number sonde_fixed_signed(double x, int decimals) {
  sonde_number number = sonde_fixed(x, decimals), with_sign;
  bool positive = isfinite(x) && x > 0 && strpbrk(number.s, "123456789");
  snprintf(with_sign.s, sizeof with_sign.s, "%s%.40s", positive ? "+" : "", number.s);
  return with_sign;
}

static void power(char *out, size_t room, int exponent) {
  static const char *const RAISED[10] = {"\u2070", "\u00b9", "\u00b2", "\u00b3", "\u2074",
                                         "\u2075", "\u2076", "\u2077", "\u2078", "\u2079"};
  int size = abs(exponent), hundreds = size / 100, tens = size / 10 % 10;
  snprintf(out, room, " \u00d7 10%s%s%s%s", exponent < 0 ? "\u207b" : "",
           hundreds ? RAISED[hundreds % 10] : "", hundreds || tens ? RAISED[tens] : "",
           RAISED[size % 10]);
}

sonde_number sonde_significant(double x, int count) {
  SONDE_ASSERT(count >= 1 && count <= 12);
  if (!isfinite(x) || x == 0) return sonde_fixed(x, 0);
  int exponent = (int)floor(log10(fabs(x)));
  if (fabs(x) / pow(10, exponent) + 0.5 * ten_to(1 - count) >= 10) ++exponent; // 9.996 -> 10.0
  if (exponent >= -4 && exponent < 6)
    return sonde_fixed(x, count - 1 > exponent ? count - 1 - exponent : 0);
  sonde_number number = sonde_fixed(x / pow(10, exponent), count - 1);
  size_t used = strlen(number.s);
  power(number.s + used, sizeof number.s - used, exponent);
  return number;
}

sonde_number sonde_short(double x) {
  sonde_number number = sonde_significant(x, 4);
  size_t used = strlen(number.s);
  if (!strchr(number.s, '.') || strstr(number.s, "\u00d7")) return number;
  while (number.s[used - 1] == '0') number.s[--used] = 0;
  if (number.s[used - 1] == '.') number.s[--used] = 0;
  SONDE_ASSERT(used > 0);
  return number;
}

sonde_number sonde_grouped(uint64_t x) {
  char plain[32];
  sonde_number number = {{0}};
  int length = snprintf(plain, sizeof plain, "%llu", (unsigned long long)x), used = 0;
  for (int i = 0; i < length; ++i) {
    if (i && (length - i) % 3 == 0) number.s[used++] = ',';
    number.s[used++] = plain[i];
  }
  SONDE_ASSERT(used < (int)sizeof number.s);
  return number;
}

sonde_number sonde_coordinate(double x) {
  SONDE_ASSERT(isfinite(x) && fabs(x) < 1e9);
  sonde_number number = {{0}};
  uint64_t tenths = (uint64_t)(fabs(x) * 10 + 0.5);
  number.s[0] = '-';
  size_t sign = x < 0 && tenths;
  bool whole = tenths % 10 == 0;
  digits(number.s + sign, sizeof number.s - sign, whole ? tenths / 10 : tenths, whole ? 0 : 1);
  return number;
}
