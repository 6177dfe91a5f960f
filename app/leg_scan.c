// A scanned leg among the options of a command.
#include "leg_scan.h"

#include <assert.h>

const char *const LEG_SCAN_AXES[] = {"ras", "lps", NULL};

int leg_scan_check(const char *verb, const char *prefix, const leg_scan_files *f) {
  assert(verb && prefix && f->axes >= -1);
  if ((f->femur || f->muscle) && !f->skin)
    return app_usage_error(verb,
                           "--%sfemur and --%smuscle go together with --%sskin, which is missing",
                           prefix, prefix, prefix);
  if (f->labels && (f->skin || f->axes >= 0))
    return app_usage_error(verb,
                           "--%slabels goes without --%sskin, --%sfemur, --%smuscle and --axes",
                           prefix, prefix, prefix, prefix);
  if (f->names && !f->labels)
    return app_usage_error(verb, "--label-names needs --%slabels", prefix);
  if (f->skin && !f->femur && f->axes < 0)
    return app_usage_error(
        verb,
        "--%sskin without --%sfemur needs --axes ras or lps: which side of it is "
        "in front cannot be seen from the skin",
        prefix, prefix);
  return APP_OK;
}

sonde_status leg_scan_load(const leg_scan_files *f, sonde_leg_labels *part, sonde_error *error) {
  assert(f && part->skin.vertex_count == 0);
  sonde_status status = SONDE_OK;
  if (f->labels) status = sonde_leg_labels_load(f->labels, f->names, part, error);
  if (f->skin) status = sonde_mesh_load(f->skin, 1e-3, &part->skin, error);
  if (!status && f->femur) status = sonde_mesh_load(f->femur, 1e-3, &part->femur, error);
  if (!status && f->muscle) status = sonde_mesh_load(f->muscle, 1e-3, &part->muscle, error);
  return status;
}

sonde_leg_scan leg_scan_of(const leg_scan_files *f, const sonde_leg_labels *part, bool left) {
  assert(f->axes >= -1 && part);
  sonde_axes axes = SONDE_AXES_ANY;
  if (f->labels || f->axes >= 0) axes = f->axes == 1 ? SONDE_AXES_LPS : SONDE_AXES_RAS;
  return (sonde_leg_scan){.skin = &part->skin,
                          .femur = part->femur.face_count ? &part->femur : NULL,
                          .muscle = part->muscle.face_count ? &part->muscle : NULL,
                          .left = left,
                          .axes = axes,
                          .vein = &part->vein,
                          .artery = &part->artery};
}
