// What a case adds to a thigh, from the command line.
#include "image_findings.h"

#include "app.h"
#include "pose.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

static const char *const KIND[SONDE_LESION_KINDS] = {"node", "cyst", "haematoma"};
static const double ECHO[SONDE_LESION_KINDS] = {0.2, 0, 0.35};
static const double LENGTH_OVER_WIDTH[SONDE_LESION_KINDS] = {1.5, 2, 1.5};

bool image_findings_lesion(image_findings *f, const char *text) {
  char kind[16], end;
  double mm[4];
  int read = sscanf(text, "%15[a-z]:%lf:%lf:%lf:%lf%c", kind, &mm[0], &mm[1], &mm[2], &mm[3], &end);
  int found = -1;
  for (int k = 0; k < SONDE_LESION_KINDS && read == 5; ++k)
    if (strcmp(kind, KIND[k]) == 0) found = k;
  if (found < 0) {
    app_usage_error("image",
                    "--lesion expects KIND:X:DEPTH:WIDTH:HEIGHT in mm with node, cyst or "
                    "haematoma, got '%s'",
                    text);
    return false;
  }
  if (f->lesion_count == SONDE_LESIONS) {
    app_usage_error("image", "at most %d lesions", SONDE_LESIONS);
    return false;
  }
  f->lesion[f->lesion_count++] = (image_lesion){(sonde_lesion_kind)found, mm[0] * 1e-3,
                                                mm[1] * 1e-3, mm[2] * 1e-3, mm[3] * 1e-3};
  return true;
}

bool image_findings_clot(image_findings *f, const char *text) {
  sonde_error error = {0};
  const char *colon = strchr(text, ':');
  if (f->rest.branch_count == SONDE_BRANCHES || !colon || colon == text || colon - text > 31) {
    app_usage_error("image", "--clot expects BRANCH:CASE, at most %d times, got '%s'",
                    SONDE_BRANCHES, text);
    return false;
  }
  sonde_branch_finding *b = &f->rest.branch[f->rest.branch_count++];
  snprintf(b->branch, sizeof b->branch, "%.*s", (int)(colon - text), text);
  if (!sonde_pathology_preset(colon + 1, &b->pathology, &error)) return true;
  app_usage_error("image", "--clot: %s", error.message);
  return false;
}

sonde_status image_findings_apply(const image_findings *f, sonde_pose at, sonde_interior *interior,
                                  sonde_error *error) {
  assert(f->lesion_count <= SONDE_LESIONS);
  sonde_findings all = f->rest;
  sonde_vec3 x = pose_axis(at, 0), z = pose_axis(at, 2);
  for (uint32_t k = 0; k < f->lesion_count; ++k) {
    const image_lesion *from = &f->lesion[k];
    sonde_lesion *to = &all.lesion[all.lesion_count++];
    *to = (sonde_lesion){.kind = from->kind, .axis = pose_axis(at, 1)};
    to->centre_m = pose_shift(pose_shift(at, from->x_m, x), from->depth_m, z).position;
    to->half_m.x = 0.5 * from->height_m;
    to->half_m.y = 0.5 * from->width_m;
    to->half_m.z = 0.5 * from->width_m * LENGTH_OVER_WIDTH[from->kind];
    to->echogenicity = ECHO[from->kind];
  }
  return sonde_interior_set_findings(interior, &all, error);
}
