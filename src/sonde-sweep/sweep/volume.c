// Volumes in memory and their files.
#include "sweep/frames.h"

#include <string.h>

static size_t voxel_count(const sonde_volume *v) {
  return (size_t)v->size[0] * v->size[1] * v->size[2];
}

sonde_status sonde_volume_create(const uint32_t size[3], sonde_volume *v, sonde_error *error) {
  SONDE_ASSERT(size != NULL && v != NULL);
  *v = (sonde_volume){.world_from_voxel = affine_scale(affine_identity(), 1e-3)};
  for (int k = 0; k < 3; ++k)
    if (size[k] < 1 || size[k] > SONDE_SIDE_MAX)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "volume of %u x %u x %u voxels, expected 1 to %d along each axis", size[0],
                        size[1], size[2], SONDE_SIDE_MAX);
  memcpy(v->size, size, sizeof v->size);
  v->voxels = SONDE_NEW(uint8_t, voxel_count(v));
  return v->voxels ? SONDE_OK : sonde_fail_memory(error);
}

void sonde_volume_clear(sonde_volume *v) {
  if (!v) return;
  sonde_free(v->voxels);
  *v = (sonde_volume){0};
}

sonde_status sonde_volume_load(const char *path, sonde_volume *v, sonde_error *error) {
  SONDE_ASSERT(path != NULL && v != NULL);
  *v = (sonde_volume){0};
  sonde_header h;
  sonde_affine inverse;
  sonde_status status = sonde_header_load(path, &h, error);
  if (status) return status;
  bool good = h.dimension == 3;
  for (uint32_t k = 0; k < 3 && good; ++k) good = h.size[k] >= 1 && h.size[k] <= SONDE_SIDE_MAX;
  memcpy(v->size, h.size, sizeof v->size);
  v->world_from_voxel = affine_scale(h.mm_from_voxel, 1e-3);
  if (!good)
    status = sonde_fail(error, SONDE_FORMAT,
                        "%.200s: %u axes of %u x %u x %u voxels, expected three of 1 to %d voxels",
                        path, h.dimension, h.size[0], h.size[1], h.size[2], SONDE_SIDE_MAX);
  else if (!affine_inverse(&v->world_from_voxel, &inverse))
    status = sonde_fail(error, SONDE_FORMAT,
                        "%.200s: the axes of the volume are flat, expected three directions that "
                        "span space",
                        path);
  else
    status = sonde_pixels_read(&h, voxel_count(v), &v->voxels, error);
  sonde_header_clear(&h);
  if (status) sonde_volume_clear(v);
  return status;
}

sonde_status sonde_volume_save(const char *path, const sonde_volume *v, bool compressed,
                               sonde_error *error) {
  SONDE_ASSERT(path != NULL && v != NULL && v->voxels != NULL);
  return sonde_pixels_save(path, NULL, v, v->voxels, voxel_count(v), compressed, error);
}
