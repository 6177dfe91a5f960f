// Minimal JSON object writer on stdout (RFC 8259): one object, nested objects, escaped text,
// numbers that are not finite as null; arrays of objects.
#include "app.h"

#include <math.h>
#include <stdio.h>

static int depth;       // open objects and arrays
static bool filled;     // the innermost one has a member already
static uint64_t arrays; // bit `depth`: the one at that depth is an array

static void write_text(const char *text) {
  putchar('"');
  for (const unsigned char *c = (const unsigned char *)text; *c; ++c) {
    if (*c == '"' || *c == '\\')
      printf("\\%c", *c);
    else if (*c == '\n')
      fputs("\\n", stdout);
    else if (*c == '\t')
      fputs("\\t", stdout);
    else if (*c < 0x20)
      printf("\\u%04x", *c);
    else
      putchar(*c);
  }
  putchar('"');
}

static void write_key(const char *key) {
  printf("%s\n%*s", filled ? "," : "", 2 * depth, "");
  filled = true;
  if (arrays >> depth & 1) return;
  write_text(key);
  fputs(": ", stdout);
}

void app_json_begin(void) {
  putchar('{');
  depth = 1;
  arrays = 0;
  filled = false;
}

void app_json_object(const char *key) {
  write_key(key);
  putchar('{');
  depth++;
  filled = false;
}

void app_json_array(const char *key) {
  write_key(key);
  putchar('[');
  arrays |= 1ull << ++depth;
  filled = false;
}

void app_json_close(void) {
  bool array = arrays >> depth & 1;
  arrays &= ~(1ull << depth--);
  if (filled) printf("\n%*s", 2 * depth, "");
  putchar(array ? ']' : '}');
  filled = true;
}

void app_json_real(const char *key, double value) {
  write_key(key);
  if (isfinite(value))
    printf("%.9g", value);
  else
    fputs("null", stdout);
}

void app_json_integer(const char *key, long long value) {
  write_key(key);
  printf("%lld", value);
}

void app_json_bool(const char *key, bool value) {
  write_key(key);
  fputs(value ? "true" : "false", stdout);
}

void app_json_text(const char *key, const char *value) {
  write_key(key);
  write_text(value);
}

void app_json_end(void) {
  while (depth > 0) app_json_close();
  putchar('\n');
  fflush(stdout);
}
