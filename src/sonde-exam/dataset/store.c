// Files of one leg: a tar file, a folder, or one file of a format that the program adds. Each is
// written aside and renamed when it is whole.
#include "dataset/dataset.h"
#include "files/png.h"

#include <string.h>

static const char *ending(const sonde_dataset_def *def) {
  return def->format ? def->format->ending : def->folder ? NULL : "tar";
}

sonde_status sonde_dataset_save(const char *path, const void *bytes, size_t count,
                                sonde_error *error) {
  SONDE_ASSERT(path && bytes);
  sonde_file *file;
  (void)sonde_file_remove_abandoned(path);
  const sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_write(file, bytes, count);
  return sonde_file_commit(file, error);
}

// One more file of the leg, its name below the directory.
static sonde_status new_file(sonde_dataset_store *store, const char *name, const char *end,
                             sonde_dataset_file **file, sonde_error *error) {
  *file = sonde_dataset_new_file(&store->files);
  if (!*file) return sonde_fail_memory(error);
  snprintf((*file)->path, sizeof(*file)->path, "leg-%06u%s%s%s%s", store->leg % 1000000,
           name ? "/" : "", name ? name : "", end ? "." : "", end ? end : "");
  return SONDE_OK;
}

sonde_status sonde_dataset_store_open(sonde_dataset_store *store, const sonde_dataset_def *def,
                                      uint32_t leg, sonde_error *error) {
  SONDE_ASSERT(store && def && def->directory);
  *store = (sonde_dataset_store){.def = def, .leg = leg};
  SHA256Init(&store->sum);
  if (def->format) return def->format->open(&store->made, error);
  char path[SONDE_DATASET_PATH], name[32];
  snprintf(name, sizeof name, "leg-%06u%s", leg % 1000000, def->folder ? "" : ".tar");
  sonde_dataset_path(store->def->directory, name, path);
  if (def->folder) return sonde_directory_make(path, 0777, true, error);
  (void)sonde_file_remove_abandoned(path);
  return sonde_file_create(path, &store->tar, error);
}

static void append(sonde_dataset_store *store, const void *bytes, size_t count) {
  sonde_file_write(store->tar, bytes, count);
  SHA256Update(&store->sum, bytes, count);
  store->bytes += count;
}

// A member of the tar file, or a file of the folder.
static sonde_status put_member(sonde_dataset_store *store, const char *name, const void *bytes,
                               size_t count, sonde_error *error) {
  if (!store->tar) {
    char path[SONDE_DATASET_PATH];
    sonde_dataset_file *file = NULL;
    sonde_status status = new_file(store, name, NULL, &file, error);
    if (status) return status;
    file->bytes = count;
    SHA256Data(bytes, count, file->sha256);
    sonde_dataset_path(store->def->directory, file->path, path);
    return sonde_dataset_save(path, bytes, count, error);
  }
  static const uint8_t ZERO[SONDE_DATASET_TAR_BLOCK];
  uint8_t head[SONDE_DATASET_TAR_BLOCK];
  SONDE_ASSERT(strcmp(store->last, name) < 0); // members are sorted
  snprintf(store->last, sizeof store->last, "%s", name);
  sonde_dataset_tar_header(head, name, count);
  append(store, head, sizeof head);
  append(store, bytes, count);
  append(store, ZERO,
         (SONDE_DATASET_TAR_BLOCK - count % SONDE_DATASET_TAR_BLOCK) % SONDE_DATASET_TAR_BLOCK);
  return sonde_file_flush(store->tar, error); // a full disk is told at once
}

sonde_status sonde_dataset_store_put(sonde_dataset_store *store, const sonde_dataset_frame *frame,
                                     sonde_error *error) {
  SONDE_ASSERT(store && frame);
  if (store->def->format) return store->def->format->put(store->made, frame, error);
  char name[96];
  sonde_status status = SONDE_OK;
  for (uint32_t k = 0; k < SONDE_DATASET_ARRAYS && !status; ++k) {
    const sonde_dataset_array *a = &frame->array[k];
    const bool picture = a->bytes == 1;
    uint8_t *bytes = NULL;
    size_t count = 0;
    if (k == SONDE_DATASET_strain) { // the order of the names
      snprintf(name, sizeof name, "%s.json", frame->key);
      status = put_member(store, name, frame->json, frame->json_bytes, error);
    }
    if (status || !a->data) continue;
    SONDE_ASSERT(!picture || a->parts == 1);
    const sonde_image image = {
        .width = a->columns, .height = a->rows, .pixels = (uint8_t *)(uintptr_t)a->data};
    status = picture ? sonde_png_encode(&image, &bytes, &count, error)
                     : sonde_dataset_npy(a, &bytes, &count, error);
    snprintf(name, sizeof name, "%s.%s.%s", frame->key, sonde_dataset_array_name(k),
             picture ? "png" : "npy");
    if (!status) status = put_member(store, name, bytes, count, error);
    sonde_free(bytes);
  }
  return status;
}

sonde_status sonde_dataset_store_commit(sonde_dataset_store *store, sonde_error *error) {
  SONDE_ASSERT(store);
  const sonde_dataset_def *def = store->def;
  sonde_dataset_file *file = NULL;
  if (def->folder && !def->format) return SONDE_OK; // its files are there already
  sonde_status status = new_file(store, NULL, ending(def), &file, error);
  if (status) return status;
  if (store->tar) {
    static const uint8_t ZERO[2 * SONDE_DATASET_TAR_BLOCK]; // the end of a tar file
    append(store, ZERO, sizeof ZERO);
    sonde_file *tar = store->tar;
    store->tar = NULL;
    status = sonde_file_commit(tar, error);
  } else {
    void *bytes = NULL;
    size_t count = 0;
    char path[SONDE_DATASET_PATH];
    sonde_dataset_path(store->def->directory, file->path, path);
    status = def->format->bytes(store->made, &bytes, &count, error);
    if (!status) {
      SHA256Update(&store->sum, bytes, count);
      store->bytes = count;
      status = sonde_dataset_save(path, bytes, count, error);
    }
    free(bytes);
  }
  file->bytes = store->bytes;
  SHA256End(&store->sum, file->sha256);
  return status;
}

void sonde_dataset_store_close(sonde_dataset_store *store) {
  if (!store->def) return;
  sonde_file_discard(store->tar);
  if (store->made) store->def->format->close(store->made);
  sonde_free(store->files.list);
  *store = (sonde_dataset_store){0};
}
