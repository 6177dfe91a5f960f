// Loading a sequence with its poses.
//
// frames_fail, frames_numbers
// set_clip, keep_range         options
// frames_load
#include "frames_common.h"

#include <math.h>
#include <stdarg.h>

sonde_status frames_fail(sonde_error *error, sonde_status status, const char *format, ...) {
  va_list list;
  va_start(list, format);
  vsnprintf(error->message, sizeof error->message, format, list);
  va_end(list);
  return error->status = status;
}

bool frames_numbers(const char *text, int count, char separator, double *values) {
  for (int k = 0; k < count; ++k) {
    const char *end;
    values[k] = sonde_parse_real(text, &end);
    if (end == text || !isfinite(values[k]) || *end != (k + 1 < count ? separator : 0))
      return false;
    text = end + 1;
  }
  return true;
}

static bool whole(double value, double low, double high) {
  return value >= low && value <= high && floor(value) == value;
}

static sonde_status set_clip(const char *text, sonde_calibration *c, sonde_error *error) {
  double v[4];
  bool good = frames_numbers(text, 4, ',', v);
  for (int k = 0; k < 4 && good; ++k) {
    good = whole(v[k], k > 1, 1e6);
    if (good) c->clip[k] = (uint32_t)v[k];
  }
  c->has_clip = good;
  if (good) return SONDE_OK;
  return frames_fail(error, SONDE_ARGUMENT, "--clip expects X,Y,W,H in whole pixels, got '%.60s'",
                     text);
}

static sonde_status keep_range(const char *text, sonde_sequence *s, sonde_located *located,
                               sonde_error *error) {
  double v[2];
  if (!frames_numbers(text, 2, ':', v) || !whole(v[0], 0, s->count - 1) ||
      !whole(v[1], v[0], s->count - 1))
    return frames_fail(error, SONDE_ARGUMENT, "--frames expects A:B within 0:%u, got '%.60s'",
                       s->count - 1, text);
  located->used = 0;
  for (uint32_t i = 0; i < s->count; ++i) {
    s->frames[i].used = s->frames[i].used && i >= v[0] && i <= v[1];
    located->used += s->frames[i].used;
  }
  if (located->used) return SONDE_OK;
  return frames_fail(error, SONDE_MISMATCH, "no frame of %.60s has a pose", text);
}

sonde_status frames_load(const char *path, const frames_options *o, sonde_sequence *s,
                         sonde_located *located, sonde_error *error) {
  sonde_calibration c = {0};
  sonde_status status = o->config ? sonde_calibration_load(o->config, &c, error) : SONDE_OK;
  if (!status && o->clip) status = set_clip(o->clip, &c, error);
  if (!status) status = sonde_sequence_load(path, s, error);
  if (!status) status = sonde_sequence_locate(s, &c, o->world, located, error);
  if (!status && o->range) status = keep_range(o->range, s, located, error);
  return status;
}
