// The JSON object that a command prints: written by the library into memory, then to standard
// output as a whole.
#include "app.h"

#include <stdio.h>
#include <stdlib.h>

static sonde_json_out out;

static void stop_without_memory(const sonde_error *error) {
  fprintf(stderr, "sonde: %s\n", sonde_status_text(error->status));
  exit(APP_FAILED);
}

void app_json_begin(void) {
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

void app_json_end(void) {
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
