// Loading a sequence with its poses, and the options that say which part of it.
#include "frames_common.h"

#include <assert.h>
#include <math.h>

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

sonde_status frames_load(const char *path, const frames_options *o, sonde_sequence *s,
                         sonde_located *located, sonde_error *error) {
  assert(path && o);
  sonde_calibration c = {0};
  sonde_status status = o->config ? sonde_calibration_load(o->config, &c, error) : SONDE_OK;
  if (status) return status;

  // The used part of a frame, in whole pixels.
  double v[4];
  bool good = !o->clip || frames_numbers(o->clip, 4, ',', v);
  for (int k = 0; o->clip && k < 4 && good; ++k) {
    good = whole(v[k], k > 1, 1e6);
    if (good) c.clip[k] = (uint32_t)v[k];
  }
  if (!good)
    return app_error(error, SONDE_ARGUMENT, "--clip expects X,Y,W,H in whole pixels, got '%.60s'",
                     o->clip);
  c.has_clip |= o->clip != NULL;
  status = sonde_sequence_load(path, s, error);
  if (!status) status = sonde_sequence_locate(s, &c, o->world, located, error);
  if (status || !o->range) return status;

  // The frames from A to B; at least one of them has a pose.
  if (!frames_numbers(o->range, 2, ':', v) || !whole(v[0], 0, s->count - 1) ||
      !whole(v[1], v[0], s->count - 1))
    return app_error(error, SONDE_ARGUMENT, "--frames expects A:B within 0:%u, got '%.60s'",
                     s->count - 1, o->range);
  located->used = 0;
  for (uint32_t i = 0; i < s->count; ++i) {
    s->frames[i].used = s->frames[i].used && i >= v[0] && i <= v[1];
    located->used += s->frames[i].used;
  }
  if (located->used) return SONDE_OK;
  return app_error(error, SONDE_MISMATCH, "no frame of %.60s has a pose", o->range);
}
