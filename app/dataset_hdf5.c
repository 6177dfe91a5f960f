// Data sets as HDF5 files: made in memory by the library's core driver, without times, so that
// equal frames give equal bytes.
#include "dataset_hdf5.h"

#ifndef SONDE_HDF5
const sonde_dataset_format *dataset_hdf5(void) { return NULL; }
#else

#include <assert.h>
#include <hdf5.h>
#include <stdlib.h>
#include <string.h>

enum { KEY = SONDE_DATASET_ARRAYS, JSON, ALL, AXES = 4, DEFLATE = 4 };

typedef struct leg {
  hid_t file, text; // text: type of a JSON
  hid_t made[ALL];  // arrays, keys, JSON; 0: none yet
  hsize_t frames;
} leg;

static sonde_status failed(sonde_error *error, const char *what) {
  return app_error(error, SONDE_MEMORY, "HDF5: %s failed", what);
}

static sonde_status open_leg(void **out, sonde_error *error) {
  leg *l = calloc(1, sizeof *l);
  if (!l) return failed(error, "opening");
  *out = l;
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // the program tells what is wrong itself
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS), create = H5Pcreate(H5P_FILE_CREATE);
  // The oldest layout: images of later ones in memory have a wrong checksum (HDF5 1.10).
  bool good = H5Pset_fapl_core(access, 1 << 20, 0) >= 0 && H5Pset_obj_track_times(create, 0) >= 0;
  l->file = good ? H5Fcreate("leg.h5", H5F_ACC_TRUNC, create, access) : -1;
  l->text = H5Tcopy(H5T_C_S1);
  good = l->file >= 0 && H5Tset_size(l->text, H5T_VARIABLE) >= 0 &&
         H5Tset_cset(l->text, H5T_CSET_UTF8) >= 0;
  H5Pclose(access), H5Pclose(create);
  return good ? SONDE_OK : failed(error, "opening");
}

// One more frame of a dataset, which the first one makes.
static bool append(leg *l, int which, const char *name, hid_t file_type, hid_t type,
                   const hsize_t size[AXES], int axes, const void *data) {
  assert(axes >= 1 && axes <= AXES && data);
  hsize_t now[AXES], most[AXES], from[AXES] = {l->frames}, one[AXES];
  memcpy(now, size, sizeof now), memcpy(most, size, sizeof most), memcpy(one, size, sizeof one);
  one[0] = 1, now[0] = l->frames + 1, most[0] = H5S_UNLIMITED;
  if (l->made[which] <= 0) {
    const hid_t space = H5Screate_simple(axes, now, most), how = H5Pcreate(H5P_DATASET_CREATE);
    bool good = H5Pset_chunk(how, axes, one) >= 0 && H5Pset_obj_track_times(how, 0) >= 0;
    if (axes > 1) good = good && H5Pset_shuffle(how) >= 0 && H5Pset_deflate(how, DEFLATE) >= 0;
    l->made[which] =
        good ? H5Dcreate2(l->file, name, file_type, space, H5P_DEFAULT, how, H5P_DEFAULT) : -1;
    H5Sclose(space), H5Pclose(how);
    if (l->made[which] < 0) return false;
  }
  if (H5Dset_extent(l->made[which], now) < 0) return false;
  const hid_t place = H5Dget_space(l->made[which]), memory = H5Screate_simple(axes, one, NULL);
  const bool good = H5Sselect_hyperslab(place, H5S_SELECT_SET, from, NULL, one, NULL) >= 0 &&
                    H5Dwrite(l->made[which], type, memory, place, H5P_DEFAULT, data) >= 0;
  H5Sclose(place), H5Sclose(memory);
  return good;
}

static sonde_status put_frame(void *of, const sonde_dataset_frame *frame, sonde_error *error) {
  leg *l = of;
  assert(l && frame && frame->json);
  const hsize_t none[AXES] = {1};
  bool good = true;
  for (uint32_t k = 0; k < SONDE_DATASET_ARRAYS && good; ++k) {
    const sonde_dataset_array *a = &frame->array[k];
    if (!a->data) continue;
    const hsize_t size[AXES] = {1, a->rows, a->columns, a->parts};
    const bool real = a->bytes == 4;
    good = append(l, (int)k, sonde_dataset_array_name(k), real ? H5T_IEEE_F32LE : H5T_STD_U8LE,
                  real ? H5T_NATIVE_FLOAT : H5T_NATIVE_UINT8, size, a->parts > 1 ? 4 : 3, a->data);
  }
  const hid_t key = H5Tcopy(H5T_C_S1);
  good = good && H5Tset_size(key, sizeof frame->key) >= 0 &&
         append(l, KEY, "key", key, key, none, 1, frame->key) &&
         append(l, JSON, "json", l->text, l->text, none, 1, &frame->json);
  H5Tclose(key);
  ++l->frames;
  return good ? SONDE_OK : failed(error, "writing a frame");
}

static sonde_status get_bytes(void *of, void **bytes, size_t *count, sonde_error *error) {
  const leg *l = of;
  assert(l && bytes && count);
  const ssize_t size =
      H5Fflush(l->file, H5F_SCOPE_GLOBAL) >= 0 ? H5Fget_file_image(l->file, NULL, 0) : -1;
  *bytes = size > 0 ? malloc((size_t)size) : NULL;
  *count = size > 0 ? (size_t)size : 0;
  if (*bytes && H5Fget_file_image(l->file, *bytes, *count) == size) return SONDE_OK;
  return failed(error, "closing");
}

static void close_leg(void *of) {
  leg *l = of;
  assert(l);
  for (int k = 0; k < ALL; ++k)
    if (l->made[k] > 0) H5Dclose(l->made[k]);
  H5Tclose(l->text);
  if (l->file >= 0) H5Fclose(l->file);
  free(l);
}

const sonde_dataset_format *dataset_hdf5(void) {
  static const sonde_dataset_format FORMAT = {
      .ending = "h5", .open = open_leg, .put = put_frame, .bytes = get_bytes, .close = close_leg};
  return &FORMAT;
}
#endif
