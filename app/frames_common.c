// Loading a sequence with its poses, and the options that say which part of it.
#include "frames_common.h"

#include "frames_hdf5.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

sonde_status frames_read(const char *path, sonde_sequence *s, sonde_error *error) {
  const char *end = strrchr(path, '.');
  const bool hdf5 = end && (strcmp(end, ".h5") == 0 || strcmp(end, ".hdf5") == 0);
  return hdf5 ? frames_hdf5_load(path, s, error) : sonde_sequence_load(path, s, error);
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
  status = frames_read(path, s, error);
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

sonde_status frames_refine(const frames_options *o, uint32_t left_out, sonde_sequence *s,
                           sonde_pose_findings *f, sonde_error *error) {
  *f = (sonde_pose_findings){0};
  if (!o->refine_poses) return SONDE_OK;
  bool *hidden = calloc(s->count, sizeof *hidden);
  if (!hidden) return app_error(error, SONDE_MEMORY, "out of memory for the poses");
  if (left_out < s->count) hidden[left_out] = true;
  const sonde_progress progress = app_progress();
  const sonde_status status = sonde_sequence_refine_poses(s, hidden, f, &progress, error);
  free(hidden);
  return status;
}

void frames_show(const sonde_pose_findings *f, bool json) {
  static const double MM = 1e3, DEG = 57.29577951308232;
  static const char *const NAMES[] = {"shift along columns", "shift along rows",
                                      "shift along normal",  "turn about columns",
                                      "turn about rows",     "turn about normal"};
  if (!f->frames) return;
  if (json) {
    app_json("pose_jitter_mm:%g pose_jitter_deg:%g pose_moved_mm:%g pose_moved_deg:%g",
             f->jitter_m * MM, f->jitter_rad * DEG, f->moved_m * MM, f->moved_rad * DEG);
    app_json("alike_before_grey:%g alike_after_grey:%g offset_ms:%g offset_sd_ms:%g",
             f->rms_grey_before, f->rms_grey_after, f->offset_s * 1e3, f->offset_sd_s * 1e3);
    app_json_bool("offset_found", f->offset_found);
    app_json_array("calibration");
    for (int k = 0; k < 6; ++k) {
      const double unit = k < 3 ? MM : DEG;
      app_json_object(NULL);
      app_json_text("number", NAMES[k]);
      app_json_real(k < 3 ? "mm" : "deg", f->calibration[k] * unit);
      app_json_real("sd", f->calibration_sd[k] * unit);
      app_json_bool("found", f->calibration_found[k]);
      app_json_close();
    }
    app_json_close();
    return;
  }
  printf(
      "poses         jitter %.3f mm, %.3f deg; moved by %.3f mm, %.3f deg; frames alike to %.2f, "
      "before %.2f grey levels\n",
      f->jitter_m * MM, f->jitter_rad * DEG, f->moved_m * MM, f->moved_rad * DEG, f->rms_grey_after,
      f->rms_grey_before);
  if (f->kept) printf("              kept as given: corrected, the frames are no more alike\n");
  if (!f->timed)
    printf("offset        not looked for: no growing time stamps\n");
  else
    printf("offset        %.1f +- %.1f ms, %s\n", f->offset_s * 1e3, f->offset_sd_s * 1e3,
           f->offset_found ? "corrected" : "not determined: none is taken");
  bool any = false;
  for (int k = 0; k < 6; ++k) {
    const double unit = k < 3 ? MM : DEG;
    any |= f->calibration_found[k];
    if (f->calibration_found[k])
      printf("calibration   %s %.3f +- %.3f %s, corrected\n", NAMES[k], f->calibration[k] * unit,
             f->calibration_sd[k] * unit, k < 3 ? "mm" : "deg");
  }
  if (!any) printf("calibration   not determined: the given one is kept\n");
}
