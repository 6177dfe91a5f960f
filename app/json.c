// The JSON object that a command prints: written by the library into memory, then to standard
// output as a whole.
#include "app.h"

#include <assert.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(sizeof(long) == 8, "app_json() reads %lu and %llu alike");

static sonde_json_out out;

static void stop_without_memory(const sonde_error *error) {
  fprintf(stderr, "sonde: %s\n", sonde_status_text(error->status));
  exit(APP_FAILED);
}

void app_json_begin(void) {
  assert(out.depth == 0);
  sonde_error error = {0};
  out = (sonde_json_out){.layout = SONDE_JSON_LINES};
  if (sonde_file_in_memory(&out.file, &error)) stop_without_memory(&error);
  sonde_json_begin_object(&out, NULL);
}

void app_json_object(const char *key) { sonde_json_begin_object(&out, key); }
void app_json_array(const char *key) { sonde_json_begin_list(&out, key); }
void app_json_close(void) { sonde_json_end(&out); }
void app_json_real(const char *key, double value) { sonde_json_put_real(&out, key, value, 9); }
void app_json_bool(const char *key, bool value) { sonde_json_put_bool(&out, key, value); }
void app_json_text(const char *key, const char *value) { sonde_json_put_text(&out, key, value); }
void app_json_integer(const char *key, long long value) {
  sonde_json_put_integer(&out, key, value);
}

void app_json(const char *members, ...) {
  va_list list;
  va_start(list, members);
  for (const char *p = members; *p;) {
    char key[64];
    size_t length = strcspn(p, ":");
    assert(p[length] == ':' && p[length + 1] == '%' && length < sizeof key);
    snprintf(key, sizeof key, "%.*s", (int)length, p);
    const char *spec = p + length + 2;
    p = spec + strcspn(spec, " ");
    bool is_unsigned = p[-1] == 'u';
    switch (spec[0]) {
    case 'g': app_json_real(key, va_arg(list, double)); break;
    case 's': app_json_text(key, va_arg(list, const char *)); break;
    case 'h': app_json_bool(key, va_arg(list, int)); break;
    case 'l': // long and long long have 8 bytes
      app_json_integer(key, va_arg(list, long));
      break;
    default:
      app_json_integer(key, is_unsigned ? (long long)va_arg(list, unsigned) : va_arg(list, int));
    }
    p += *p == ' ';
  }
  va_end(list);
}

void app_json_end(void) {
  assert(out.file && out.depth > 0);
  char *bytes = NULL;
  size_t count = 0;
  sonde_error error = {0};
  while (out.depth > 0) sonde_json_end(&out);
  if (sonde_file_take(out.file, &bytes, &count, &error)) stop_without_memory(&error);
  fwrite(bytes, 1, count, stdout);
  putchar('\n');
  fflush(stdout);
  sonde_free(bytes);
}
