// Tracked frames in an HDF5 file as the TUS-REC data sets hold them.
#include "frames_hdf5.h"

#ifndef SONDE_HDF5
sonde_status frames_hdf5_load(const char *path, sonde_sequence *s, sonde_error *error) {
  *s = (sonde_sequence){0};
  return app_error(error, SONDE_FORMAT, "%.400s: this program was built without libhdf5", path);
}
#else

#include <assert.h>
#include <errno.h>
#include <hdf5.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { AXES = 3, MATRIX = 16 };
static const hsize_t SIDE_MAX = 1 << 16; // of a picture, pixels
static const hsize_t PACKED_MOST = 1100; // bytes that one byte of a deflated file can hold

// A data set of three axes; its sizes into size[]. @return negative: there is none
static hid_t open_array(hid_t file, const char *name, hsize_t size[AXES]) {
  const hid_t array = H5Dopen2(file, name, H5P_DEFAULT);
  if (array < 0) return array;
  const hid_t space = H5Dget_space(array);
  const bool good = H5Sget_simple_extent_ndims(space) == AXES &&
                    H5Sget_simple_extent_dims(space, size, NULL) == AXES;
  H5Sclose(space);
  if (good) return array;
  H5Dclose(array);
  return -1;
}

static sonde_status read_frames(const char *path, hid_t array, const hsize_t size[AXES],
                                sonde_sequence *s, sonde_error *error) {
  const hid_t type = H5Dget_type(array);
  bool good = H5Tget_class(type) == H5T_INTEGER && H5Tget_size(type) == 1;
  H5Tclose(type);
  for (int k = 0; k < AXES; ++k) good = good && size[k] >= 1 && size[k] <= SIDE_MAX;
  if (!good)
    return app_error(error, SONDE_FORMAT,
                     "%.400s: frames: expected 8-bit grey pictures, at most %llu of them and as "
                     "many pixels along a side",
                     path, (unsigned long long)SIDE_MAX);
  if (size[0] * size[1] * size[2] / PACKED_MOST > H5Dget_storage_size(array))
    return app_error(error, SONDE_FORMAT, "%.400s: frames: the file is too short for them", path);
  sonde_status status =
      sonde_sequence_create((uint32_t)size[2], (uint32_t)size[1], (uint32_t)size[0], s, error);
  if (!status && H5Dread(array, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, s->pixels) < 0)
    status = app_error(error, SONDE_FORMAT, "%.400s: frames: they cannot be read", path);
  return status;
}

static sonde_status read_poses(const char *path, hid_t array, const hsize_t size[AXES],
                               sonde_sequence *s, sonde_error *error) {
  if (size[0] != s->count || size[1] != 4 || size[2] != 4)
    return app_error(error, SONDE_FORMAT, "%.400s: tforms: expected %u matrices of 4 x 4", path,
                     s->count);
  double *matrix = calloc(s->count, MATRIX * sizeof *matrix);
  if (!matrix) return app_error(error, SONDE_MEMORY, "no memory for %u poses", s->count);
  sonde_status status = SONDE_OK;
  if (H5Dread(array, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, matrix) < 0)
    status = app_error(error, SONDE_FORMAT, "%.400s: tforms: expected numbers", path);
  for (uint32_t i = 0; i < s->count && !status; ++i) {
    const double *m = matrix + (size_t)i * MATRIX;
    bool finite = true;
    for (int k = 0; k < MATRIX; ++k) finite = finite && isfinite(m[k]);
    if (!finite) continue;
    const sonde_affine pose = {
        {{m[0], m[1], m[2], m[3]}, {m[4], m[5], m[6], m[7]}, {m[8], m[9], m[10], m[11]}}};
    if (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1)
      status = app_error(error, SONDE_FORMAT,
                         "%.400s: tforms: matrix %u: expected its last row to be 0 0 0 1", path, i);
    else
      status = sonde_sequence_set_transform(s, i, "ProbeToTracker", &pose, error);
  }
  free(matrix);
  return status;
}

sonde_status frames_hdf5_load(const char *path, sonde_sequence *s, sonde_error *error) {
  assert(path && s);
  *s = (sonde_sequence){0};
  if (access(path, R_OK) != 0)
    return app_error(error, SONDE_IO, "%.400s: %s", path, strerror(errno));
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // the program tells what is wrong itself
  const hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
  if (file < 0) return app_error(error, SONDE_FORMAT, "%.400s: expected an HDF5 file", path);
  hsize_t frames_size[AXES], poses_size[AXES];
  const hid_t frames = open_array(file, "frames", frames_size),
              poses = open_array(file, "tforms", poses_size);
  sonde_status status = SONDE_OK;
  if (frames < 0 || poses < 0)
    status = app_error(error, SONDE_FORMAT,
                       "%.400s: expected the data sets frames [count][height][width] and tforms "
                       "[count][4][4]",
                       path);
  if (!status) status = read_frames(path, frames, frames_size, s, error);
  if (!status) status = read_poses(path, poses, poses_size, s, error);
  if (frames >= 0) H5Dclose(frames);
  if (poses >= 0) H5Dclose(poses);
  H5Fclose(file);
  return status;
}
#endif
