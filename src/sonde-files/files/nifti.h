// Volumes of whole-number labels from NIfTI files.
#ifndef SONDE_SRC_FILES_NIFTI_H
#define SONDE_SRC_FILES_NIFTI_H

#include "base/link.h"
#include "sonde/files.h"

// Labels of voxels with their place in the patient: x to the right, y to the front, z to the head.
typedef struct sonde_label_volume {
  uint32_t size[3];
  uint16_t *label;      // [size[2]][size[1]][size[0]]; freed by sonde_label_volume_clear()
  sonde_vec3 origin_m;  // of the first voxel's middle
  sonde_vec3 step_m[3]; // from voxel to voxel along each index; linearly independent
} sonde_label_volume;

// Reads .nii or .nii.gz (NIfTI-1 and -2). Place and direction come from sform, without one from
// qform; lengths are in the unit of the header, mm when it names none.
// @return FORMAT: no image of whole numbers from 0 to 65535 in three dimensions, neither sform nor
//   qform, or a size that no leg has in the header's unit, with the unit that would fit; IO, MEMORY
// @thread owner
SONDE_LINK sonde_status sonde_label_volume_load(const char *path, sonde_label_volume *volume,
                                                sonde_error *error);
SONDE_LINK void sonde_label_volume_clear(sonde_label_volume *volume); // @thread owner

#endif
