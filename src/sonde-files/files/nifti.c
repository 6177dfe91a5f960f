// Label volumes by nifticlib: the header is checked before the voxels are read.
#include "files/nifti.h"

#include "base/base.h"
#include "base/bounds.h"
#include "base/maths.h"

#include <errno.h>
#include <nifti2_io.h>
#include <string.h>
#include <strings.h>

enum { MOST_VOXELS = 1 << 28, MOST_SIDE = 1 << 15, MOST_LABEL = 65535 };
// Longest side of a volume that holds a thigh.
static const double LEAST_SIDE_M = 0.15, MOST_SIDE_M = 3;

// Size, origin and steps in metres: from the header's dimensions, its sform or qform, and its unit.
static sonde_status read_header(const char *path, const nifti_image *image,
                                sonde_label_volume *volume, sonde_error *error) {
  const int64_t n[3] = {image->nx, image->ny, image->nz};
  bool fits = image->ndim >= 3 && image->nvox > 0;
  for (int a = 0; a < 3; ++a) fits = fits && n[a] >= 2 && n[a] <= MOST_SIDE;
  if (!fits || image->nvox != n[0] * n[1] * n[2])
    return sonde_fail(
        error, SONDE_FORMAT,
        "%.300s: has %lld dimensions of %lld x %lld x %lld voxels, expected three of 2 "
        "to %d",
        path, (long long)image->ndim, (long long)n[0], (long long)n[1], (long long)n[2],
        (int)MOST_SIDE);
  if (image->nvox > MOST_VOXELS)
    return sonde_fail(
        error, SONDE_FORMAT,
        "%.300s: has %lld voxels, expected at most %d: crop it to one leg or resample "
        "it to 1 mm",
        path, (long long)image->nvox, (int)MOST_VOXELS);
  static const int TYPES[] = {DT_UINT8, DT_INT8,  DT_UINT16, DT_INT16,   DT_UINT32,
                              DT_INT32, DT_INT64, DT_UINT64, DT_FLOAT32, DT_FLOAT64};
  size_t type = 0;
  while (type < SONDE_COUNT_OF(TYPES) && TYPES[type] != image->datatype) ++type;
  if (type == SONDE_COUNT_OF(TYPES))
    return sonde_fail(error, SONDE_FORMAT,
                      "%.300s: the voxels are of type %.40s, expected whole numbers", path,
                      nifti_datatype_string(image->datatype));
  for (int a = 0; a < 3; ++a) volume->size[a] = (uint32_t)n[a];

  if (image->sform_code <= 0 && image->qform_code <= 0)
    return sonde_fail(error, SONDE_FORMAT,
                      "%.300s: sform_code and qform_code are 0, expected one above: without, left "
                      "and right, front and back of the volume are unknown",
                      path);
  const nifti_dmat44 *form = image->sform_code > 0 ? &image->sto_xyz : &image->qto_xyz;
  static const struct {
    const char *name;
    double m;
  } UNIT[] = {{"mm", 1e-3}, {"m", 1}, {"mm", 1e-3}, {"um", 1e-6}};
  int unit = image->xyz_units;
  if (unit < 0 || unit > NIFTI_UNITS_MICRON)
    return sonde_fail(error, SONDE_FORMAT,
                      "%.300s: the unit of length is %.40s, expected m, mm, um", path,
                      nifti_units_string(unit));
  double longest = 0;
  sonde_vec3 *column[] = {&volume->step_m[0], &volume->step_m[1], &volume->step_m[2],
                          &volume->origin_m};
  for (int a = 0; a < 4; ++a) {
    *column[a] = vec3(form->m[0][a], form->m[1][a], form->m[2][a]);
    if (a < 3) longest = fmax(longest, volume->size[a] * v_norm(*column[a]));
  }

  // A unit that is wrong makes a leg of 0.4 mm or of 400 m.
  if (!(longest * UNIT[unit].m >= LEAST_SIDE_M && longest * UNIT[unit].m <= MOST_SIDE_M)) {
    int other = NIFTI_UNITS_METER;
    while (other <= NIFTI_UNITS_MICRON &&
           !(longest * UNIT[other].m >= LEAST_SIDE_M && longest * UNIT[other].m <= MOST_SIDE_M))
      ++other;
    char hint[80] = "";
    if (other <= NIFTI_UNITS_MICRON)
      snprintf(hint, sizeof hint, ": the header's numbers seem to be %s, then it is %.0f mm",
               UNIT[other].name, longest * UNIT[other].m * 1e3);
    return sonde_fail(error, SONDE_FORMAT,
                      "%.300s: the volume's longest side is %.3g mm, as the header's unit is %s, "
                      "expected %.0f to %.0f mm%s",
                      path, longest * UNIT[unit].m * 1e3,
                      unit == NIFTI_UNITS_UNKNOWN ? "unknown and read as mm" : UNIT[unit].name,
                      LEAST_SIDE_M * 1e3, MOST_SIDE_M * 1e3, hint);
  }
  for (int a = 0; a < 4; ++a) *column[a] = v_scale(*column[a], UNIT[unit].m);
  const sonde_vec3 *s = volume->step_m;
  double shape = v_dot(s[0], v_cross(s[1], s[2])), box = v_norm(s[0]) * v_norm(s[1]) * v_norm(s[2]);
  if (!(fabs(shape) > 0.5 * box && box > 0) || !(v_norm(volume->origin_m) < SONDE_FARTHEST_M))
    return sonde_fail(error, SONDE_FORMAT,
                      "%.300s: the axes of %s are not upright to each other, expected a volume of "
                      "boxes",
                      path, image->sform_code > 0 ? "sform" : "qform");
  return SONDE_OK;
}

sonde_status sonde_label_volume_load(const char *path, sonde_label_volume *volume,
                                     sonde_error *error) {
  SONDE_ASSERT(path && volume);
  *volume = (sonde_label_volume){0};
  size_t length = strlen(path);
  bool packed = length > 7 && strcasecmp(path + length - 7, ".nii.gz") == 0;
  if (!packed && !(length > 4 && strcasecmp(path + length - 4, ".nii") == 0))
    return sonde_fail(error, SONDE_ARGUMENT, "%.300s: expected a name ending in .nii or .nii.gz",
                      path);
  FILE *stream = fopen(path, "rb");
  if (!stream)
    return sonde_fail(error, SONDE_IO, "%.300s: cannot be opened: %s", path, strerror(errno));
  fclose(stream);

  // The library prints what is wrong unless it is told not to.
  nifti_set_debug_level(0);
  nifti_image *image = nifti_image_read(path, 0);
  if (!image) return sonde_fail(error, SONDE_FORMAT, "%.300s: has no NIfTI header", path);
  sonde_status status = read_header(path, image, volume, error);
  if (!status && nifti_image_load(image) != 0)
    status =
        sonde_fail(error, SONDE_FORMAT, "%.300s: the voxels cannot be read, expected %lld bytes",
                   path, (long long)image->nvox * image->nbyper);

  // Whole numbers after the header's scale, which counts when its slope is not 0.
  const size_t count = status ? 0 : (size_t)image->nvox;
  if (!status) volume->label = SONDE_NEW(uint16_t, count);
  if (!status && !volume->label) status = sonde_fail_memory(error);
  bool scaled = image->scl_slope != 0 && isfinite(image->scl_slope) && isfinite(image->scl_inter);
  for (size_t k = 0; !status && k < count; ++k) {
    const void *data = image->data;
    double value = 0;
    switch (image->datatype) {
    case DT_UINT8: value = ((const uint8_t *)data)[k]; break;
    case DT_INT8: value = ((const int8_t *)data)[k]; break;
    case DT_UINT16: value = ((const uint16_t *)data)[k]; break;
    case DT_INT16: value = ((const int16_t *)data)[k]; break;
    case DT_UINT32: value = ((const uint32_t *)data)[k]; break;
    case DT_INT32: value = ((const int32_t *)data)[k]; break;
    case DT_INT64: value = (double)((const int64_t *)data)[k]; break;
    case DT_UINT64: value = (double)((const uint64_t *)data)[k]; break;
    case DT_FLOAT32: value = (double)((const float *)data)[k]; break;
    default: SONDE_ASSERT(image->datatype == DT_FLOAT64); value = ((const double *)data)[k];
    }
    if (scaled) value = image->scl_slope * value + image->scl_inter;
    if (!(value >= 0 && value <= MOST_LABEL && value == floor(value)))
      status = sonde_fail(error, SONDE_FORMAT,
                          "%.300s: voxel (%zu, %zu, %zu) is %g, expected a label, a whole number "
                          "from 0 to %d",
                          path, k % volume->size[0], k / volume->size[0] % volume->size[1],
                          k / volume->size[0] / volume->size[1], value, (int)MOST_LABEL);
    else
      volume->label[k] = (uint16_t)value;
  }
  nifti_image_free(image);
  if (status) sonde_label_volume_clear(volume);
  return status;
}

void sonde_label_volume_clear(sonde_label_volume *volume) {
  sonde_free(volume->label);
  *volume = (sonde_label_volume){0};
}
