// What lies in the directory of a data set: its plan, and an index of each leg that is whole.
#include "dataset/dataset.h"

#include <string.h>
#include <sys/stat.h>

void sonde_dataset_path(const char *directory, const char *name, char path[SONDE_DATASET_PATH]) {
  snprintf(path, SONDE_DATASET_PATH, "%.3900s/%.120s", directory, name);
}

static void index_path(const sonde_dataset_def *def, uint32_t leg, char path[SONDE_DATASET_PATH]) {
  char name[40];
  snprintf(name, sizeof name, "index/leg-%06u.json", leg % 1000000);
  sonde_dataset_path(def->directory, name, path);
}

sonde_dataset_file *sonde_dataset_new_file(sonde_dataset_files *f) {
  if (f->count == f->room) {
    const uint32_t room = f->room ? 2 * f->room : 8;
    sonde_dataset_file *grown =
        sonde_realloc(f->list, f->room * sizeof *f->list, room * sizeof *f->list);
    if (!grown) return NULL;
    f->list = grown, f->room = room;
  }
  sonde_dataset_file *file = &f->list[f->count++];
  *file = (sonde_dataset_file){0};
  return file;
}

void sonde_dataset_put_files(sonde_json_out *out, const sonde_dataset_files *files) {
  sonde_json_begin_list(out, "files");
  for (uint32_t k = 0; k < files->count; ++k) {
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "path", files->list[k].path);
    sonde_json_put_integer(out, "bytes", (int64_t)files->list[k].bytes);
    sonde_json_put_text(out, "sha256", files->list[k].sha256);
    sonde_json_end(out);
  }
  sonde_json_end(out);
}

sonde_status sonde_dataset_index_leg(const sonde_dataset_store *store,
                                     const sonde_dataset_tally *tally, sonde_error *error) {
  SONDE_ASSERT(store && store->def && tally);
  char path[SONDE_DATASET_PATH];
  sonde_file *file;
  index_path(store->def, store->leg, path);
  (void)sonde_file_remove_abandoned(path);
  const sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_json_out out = {.file = file, .layout = SONDE_JSON_TABS};
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_integer(&out, "leg", store->leg);
  sonde_json_put_integer(&out, "frames", tally->frames);
  sonde_json_put_integer(&out, "stopped", tally->stopped);
  sonde_json_put_integer(&out, "clots", tally->clots);
  sonde_json_begin_list(&out, "closure");
  for (size_t k = 0; k < SONDE_COUNT_OF(tally->closure); ++k)
    sonde_json_put_integer(&out, NULL, tally->closure[k]);
  sonde_json_end(&out);
  sonde_json_begin_list(&out, "pixels");
  for (size_t k = 0; k < SONDE_COUNT_OF(tally->pixels); ++k)
    sonde_json_put_integer(&out, NULL, (int64_t)tally->pixels[k]);
  sonde_json_end(&out);
  sonde_dataset_put_files(&out, &store->files);
  sonde_json_end(&out);
  sonde_file_printf(file, "\n");
  return sonde_file_commit(file, error);
}

bool sonde_dataset_is_whole(const sonde_dataset_def *def, uint32_t leg, sonde_json **root) {
  char path[SONDE_DATASET_PATH], *text = NULL;
  size_t bytes;
  *root = NULL;
  index_path(def, leg, path);
  bool whole = !sonde_file_load(path, &text, &bytes, NULL) &&
               !sonde_json_parse(text, bytes, NULL, root, NULL);
  const sonde_json *files = sonde_json_member(*root, "files");
  for (const sonde_json *f = sonde_json_first(files); f && whole; f = sonde_json_next(f)) {
    struct stat info;
    const char *name = sonde_json_as_text(sonde_json_member(f, "path"));
    sonde_dataset_path(def->directory, name ? name : "", path);
    whole = stat(path, &info) == 0 && S_ISREG(info.st_mode) &&
            (double)info.st_size == sonde_json_as_number(sonde_json_member(f, "bytes"));
  }
  sonde_free(text);
  return whole;
}

// The plan lies in the directory, with the version and the format: what is added later must be
// like what is there.
sonde_status sonde_dataset_keep_plan(const sonde_dataset_def *def, sonde_error *error) {
  char path[SONDE_DATASET_PATH], *text = NULL, *old = NULL;
  size_t bytes;
  sonde_file *file;
  sonde_status status = sonde_dataset_plan_text(def->plan, &text, error);
  if (!status) status = sonde_file_in_memory(&file, error);
  if (!status) {
    sonde_file_printf(file, "# Data set made by sonde %s; format %s.\n%s", sonde_version(),
                      def->format   ? def->format->ending
                      : def->folder ? "folder"
                                    : "tar",
                      text);
    sonde_free(text);
    text = NULL;
    status = sonde_file_take(file, &text, &bytes, error);
  }
  sonde_dataset_path(def->directory, "plan.yaml", path);
  if (!status && !sonde_file_load(path, &old, &bytes, NULL)) {
    if (strcmp(text, old) != 0)
      status = sonde_fail(error, SONDE_MISMATCH,
                          "%s: holds a data set of another plan, format or version, expected an "
                          "empty directory or the same plan",
                          def->directory);
  } else if (!status) {
    status = sonde_dataset_save(path, text, strlen(text), error);
  }
  sonde_free(text);
  sonde_free(old);
  return status;
}

sonde_status sonde_dataset_add_file(sonde_dataset_contents *c, const char *path, uint64_t bytes,
                                    const char *sha256, sonde_error *error) {
  SONDE_ASSERT(path && sha256);
  sonde_dataset_file *file = sonde_dataset_new_file(&c->files);
  if (!file) return sonde_fail_memory(error);
  file->bytes = bytes;
  snprintf(file->path, sizeof file->path, "%s", path);
  snprintf(file->sha256, sizeof file->sha256, "%s", sha256);
  c->bytes += bytes;
  return SONDE_OK;
}

// A number of an index, which this program wrote; what is none counts as 0.
static uint64_t number_of(const sonde_json *value) {
  const double number = sonde_json_as_number(value);
  return number > 0 ? (uint64_t)number : 0;
}

sonde_status sonde_dataset_gather(const sonde_dataset_def *def, sonde_dataset_contents *c,
                                  sonde_error *error) {
  SONDE_ASSERT(def && c);
  *c = (sonde_dataset_contents){0};
  sonde_status status = SONDE_OK;
  for (uint32_t leg = 0; leg < def->plan->legs && !status; ++leg) {
    sonde_json *index;
    if (sonde_dataset_is_whole(def, leg, &index)) {
      ++c->legs;
      c->all.frames += (uint32_t)number_of(sonde_json_member(index, "frames"));
      c->all.stopped += (uint32_t)number_of(sonde_json_member(index, "stopped"));
      c->all.clots += (uint32_t)number_of(sonde_json_member(index, "clots"));
      const sonde_json *at = sonde_json_first(sonde_json_member(index, "closure"));
      for (size_t k = 0; k < SONDE_COUNT_OF(c->all.closure); ++k, at = sonde_json_next(at))
        c->all.closure[k] += (uint32_t)number_of(at);
      at = sonde_json_first(sonde_json_member(index, "pixels"));
      for (size_t k = 0; k < SONDE_LABEL_COUNT; ++k, at = sonde_json_next(at))
        c->all.pixels[k] += number_of(at);
      at = sonde_json_first(sonde_json_member(index, "files"));
      for (; at && !status; at = sonde_json_next(at)) {
        const char *path = sonde_json_as_text(sonde_json_member(at, "path"));
        const char *sum = sonde_json_as_text(sonde_json_member(at, "sha256"));
        status = sonde_dataset_add_file(
            c, path ? path : "", number_of(sonde_json_member(at, "bytes")), sum ? sum : "", error);
      }
    }
    sonde_json_free(index);
  }
  return status;
}
