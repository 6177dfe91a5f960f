// Status sentences, errors, log and progress callbacks.
#include "base/base.h"

#include <stdarg.h>
#include <string.h>

_Static_assert(SONDE_OK == 0, "success is 0, so that `if (status)` means failure");

static const char *const STATUS_TEXT[] = {
#define TEXT(name, text) text,
    SONDE_STATUS_LIST(TEXT)
#undef TEXT
};

static sonde_log_fn log_callback;
static void *log_user;

const char *sonde_status_text(sonde_status status) {
  if ((unsigned)status >= SONDE_STATUS_COUNT) return "unknown status";
  return STATUS_TEXT[status];
}

const char *sonde_version(void) { return SONDE_VERSION_STRING; }

sonde_status sonde_fail_at(sonde_error *error, sonde_status status, const char *where,
                           const char *format, ...) {
  SONDE_ASSERT(status > SONDE_OK && status < SONDE_STATUS_COUNT && where && format);
  if (!error) return status;
  error->status = status;
  snprintf(error->where, sizeof error->where, "%s", where);
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(error->message, sizeof error->message, format, arguments);
  va_end(arguments);
  return status;
}

sonde_status sonde_bounded_check(const sonde_bounded *numbers, size_t count, sonde_error *error) {
  SONDE_ASSERT(numbers != NULL || count == 0);
  for (size_t k = 0; k < count; ++k)
    if (!sonde_bounded_holds(numbers[k]))
      return sonde_fail(error, SONDE_ARGUMENT, "%s is %g, expected %g to %g", numbers[k].name,
                        numbers[k].value, numbers[k].low, numbers[k].high);
  return SONDE_OK;
}

sonde_status sonde_def_check(const char *what, uint32_t version, sonde_error *error) {
  SONDE_ASSERT(what);
  if (version == SONDE_DEF_VERSION) return SONDE_OK;
  return sonde_fail(error, SONDE_ARGUMENT,
                    "%s: options of version %u, expected %d: begin with the default function", what,
                    version, SONDE_DEF_VERSION);
}

void sonde_set_log(sonde_log_fn log, void *user) {
  log_callback = log;
  log_user = user;
}

void sonde_log(sonde_log_level level, const char *format, ...) {
  SONDE_ASSERT(format);
  if (!log_callback) return;
  char message[512];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(message, sizeof message, format, arguments);
  va_end(arguments);
  log_callback(level, message, log_user);
}

bool sonde_progress_report(const sonde_progress *progress, double fraction, const char *what) {
  SONDE_ASSERT(fraction >= 0.0 && what);
  if (!progress || !progress->report) return true;
  return progress->report(fraction, what, progress->user);
}

void sonde_assert_failed(const char *condition, const char *file, int line) {
  fprintf(stderr, "%s:%d: assertion failed: %s\n", file, line, condition);
  abort();
}
