// Shared by the subcommands: messages and exit codes, numbers of options, the bundled model.
#include "app.h"
#include "start.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- messages

int app_fail(const char *verb, const sonde_error *error) {
  app_progress_end();
  const char *text = error->message[0] ? error->message : sonde_status_text(error->status);
  fprintf(stderr, "sonde %s: %s\n", verb, text);
  // Other input mends all but these.
  bool failed = error->status == SONDE_MEMORY || error->status == SONDE_CONVERGENCE ||
                error->status == SONDE_DEVICE || error->status == SONDE_CANCELLED ||
                error->status == SONDE_DISK;
  return failed ? APP_FAILED : APP_BAD_INPUT;
}

sonde_status app_error(sonde_error *error, sonde_status status, const char *format, ...) {
  assert(error && status != SONDE_OK);
  va_list arguments;
  va_start(arguments, format);
  error->status = status;
  vsnprintf(error->message, sizeof error->message, format, arguments);
  va_end(arguments);
  return status;
}

int app_usage_error(const char *verb, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  fprintf(stderr, "sonde %s: ", verb);
  vfprintf(stderr, format, arguments);
  fprintf(stderr, "\ntry: sonde %s --help\n", verb);
  va_end(arguments);
  return APP_BAD_INPUT;
}

// ---- numbers

int app_check_output(const char *verb, const char *path) {
  sonde_error error = {0};
  return path && sonde_file_check(path, &error) ? app_fail(verb, &error) : APP_OK;
}

bool app_parse_real(const char *verb, const char *option, const char *text, double low, double high,
                    double *value) {
  assert(low <= high);
  const char *end = text;
  double number = text ? sonde_parse_real(text, &end) : 0.0;
  bool good = text && end != text && *end == 0 && isfinite(number);
  if (good && number >= low && number <= high) {
    *value = number;
    return true;
  }
  app_usage_error(verb, "%s expects a number from %g to %g, got '%s'", option, low, high,
                  text ? text : "nothing");
  return false;
}

bool app_parse_integer(const char *verb, const char *option, const char *text, long low, long high,
                       long *value) {
  assert(low <= high);
  char *end = NULL;
  errno = 0;
  long number = text ? strtol(text, &end, 10) : 0;
  bool good = text && end != text && *end == 0 && errno == 0;
  if (good && number >= low && number <= high) {
    *value = number;
    return true;
  }
  app_usage_error(verb, "%s expects a whole number from %ld to %ld, got '%s'", option, low, high,
                  text ? text : "nothing");
  return false;
}

// ---- bundled model

// Directory two levels above the program: the build or install prefix; false when unknown.
static bool own_prefix(char *path, size_t size) {
  if (app_program(path, size)) return false;
  for (int up = 0; up < 2; ++up) {
    char *slash = strrchr(path, '/');
    if (!slash) return false;
    *slash = 0;
  }
  return true;
}

static bool is_readable(const char *path) { return access(path, R_OK) == 0; }

// A file or directory of share/sonde, below the own prefix or the one of the installation; path:
// the last place looked at, searched: all of them, may be NULL.
static bool find_shared(const char *name, char *path, size_t size, char *searched,
                        size_t searched_size) {
  char prefix[4096] = "";
  if (own_prefix(prefix, sizeof prefix)) {
    snprintf(path, size, "%.3000s/share/sonde/%s", prefix, name);
    if (is_readable(path)) return true;
  }
  if (searched)
    snprintf(searched, searched_size, "%.3000s/share/sonde/%s, %s/share/sonde/%s", prefix, name,
             SONDE_INSTALL_PREFIX, name);
  snprintf(path, size, "%s/share/sonde/%s", SONDE_INSTALL_PREFIX, name);
  return is_readable(path);
}

bool app_bundled_model(char *path, size_t size, char *searched, size_t searched_size) {
  const char *chosen = getenv("SONDE_MODEL");
  if (!chosen || !chosen[0]) return find_shared("thigh.sonde", path, size, searched, searched_size);
  // What the user asks for is not replaced by something else.
  snprintf(path, size, "%s", chosen);
  snprintf(searched, searched_size, "%s (from SONDE_MODEL)", chosen);
  return is_readable(path);
}

bool app_bundled_leg(char *path, size_t size) {
  const char *chosen = getenv("SONDE_MODEL");
  return (!chosen || !chosen[0]) && find_shared("leg.sonde", path, size, NULL, 0);
}

bool app_data_directory(const char *name, char *path, size_t size) {
  char below[256];
  snprintf(below, sizeof below, "data/%s", name);
  return find_shared(below, path, size, NULL, 0);
}

double app_seconds(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

double app_quantile(double *list, size_t count, double share) {
  assert(share >= 0 && share <= 1);
  if (count == 0) return (double)NAN;
  qsort(list, count, sizeof *list, by_value);
  return list[(size_t)(share * (double)(count - 1) + 0.5)];
}

void app_data_home(const char *given, const char *name, char *path, size_t size) {
  const char *data = getenv("XDG_DATA_HOME"), *home = getenv("HOME");
  if (given)
    snprintf(path, size, "%s", given);
  else if (data && data[0])
    snprintf(path, size, "%s/sonde/%s", data, name);
  else
    snprintf(path, size, "%s/.local/share/sonde/%s", home && home[0] ? home : "/tmp", name);
}
