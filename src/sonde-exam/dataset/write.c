// A shard of a data set: legs that are not whole yet are made, and an index of each says that it
// is.
#include "dataset/dataset.h"

#include <math.h>
#include <string.h>

sonde_dataset_def sonde_dataset_def_default(void) {
  return (sonde_dataset_def){.version = SONDE_DEF_VERSION, .shard = 1, .shards = 1};
}

sonde_status sonde_dataset_write(const sonde_dataset_def *def, sonde_dataset_count *count,
                                 sonde_error *error) {
  SONDE_ASSERT(def && def->plan && def->directory && count);
  *count = (sonde_dataset_count){0};
  sonde_status status = sonde_def_check("a data set", def->version, error);
  if (!status) status = sonde_dataset_plan_check(def->plan, error);
  if (!status && !(def->shard >= 1 && def->shard <= def->shards))
    status = sonde_fail(error, SONDE_ARGUMENT, "shard %u of %u, expected 1 to %u", def->shard,
                        def->shards, def->shards);
  sonde_scanner scanner;
  for (uint32_t k = 0; k < def->plan->scanner_count && !status; ++k)
    status = sonde_dataset_scanner(def, k, &scanner, error);
  char path[SONDE_DATASET_PATH];
  sonde_dataset_path(def->directory, "index", path);
  if (!status) status = sonde_directory_make(path, 0777, true, error);
  if (!status) status = sonde_dataset_keep_plan(def, error);
  if (status) return status;
  const uint32_t legs = def->plan->legs;
  for (uint32_t leg = def->shard - 1; leg < legs && !status; leg += def->shards) {
    sonde_json *root;
    const bool whole = sonde_dataset_is_whole(def, leg, &root);
    sonde_json_free(root);
    if (whole) continue;
    const double from = (double)leg / legs, to = fmin(1, (double)(leg + def->shards) / legs);
    sonde_dataset_store store;
    sonde_dataset_tally tally;
    status = sonde_dataset_store_open(&store, def, leg, error);
    if (!status) status = sonde_dataset_make_leg(def, leg, &store, &tally, from, to, error);
    if (!status) status = sonde_dataset_store_commit(&store, error);
    if (!status) status = sonde_dataset_index_leg(&store, &tally, error);
    sonde_dataset_store_close(&store);
    count->made += !status;
  }
  // What is there is counted after a failure too.
  sonde_dataset_contents contents;
  sonde_error later;
  const sonde_status counted = sonde_dataset_gather(def, &contents, &later);
  if (!status && counted && error) *error = later;
  if (!status) status = counted;
  count->legs = contents.legs, count->frames = contents.all.frames;
  count->stopped = contents.all.stopped, count->clots = contents.all.clots;
  count->bytes = contents.bytes;
  if (!status && count->legs == legs) {
    status = sonde_dataset_finish(def, &contents, error);
    count->whole = !status;
  }
  sonde_free(contents.files.list);
  return status;
}

sonde_status sonde_dataset_verify(const char *directory, const sonde_progress *progress,
                                  uint32_t *files, sonde_error *error) {
  SONDE_ASSERT(directory && files);
  char path[SONDE_DATASET_PATH], *text = NULL, digest[SHA256_DIGEST_STRING_LENGTH];
  size_t bytes;
  sonde_json *root = NULL;
  *files = 0;
  sonde_dataset_path(directory, "manifest.json", path);
  sonde_status status = sonde_file_load(path, &text, &bytes, error);
  const sonde_json_source source = {.name = path, .most_values = 1u << 28};
  if (!status) status = sonde_json_parse(text, bytes, &source, &root, error);
  const sonde_json *list = sonde_json_member(root, "files");
  const uint32_t count = sonde_json_count(list);
  if (!status && count == 0)
    status =
        sonde_fail(error, SONDE_FORMAT, "%s: no list of files, expected that of a data set", path);
  for (const sonde_json *f = sonde_json_first(list); f && !status; f = sonde_json_next(f)) {
    const char *name = sonde_json_as_text(sonde_json_member(f, "path"));
    const char *right = sonde_json_as_text(sonde_json_member(f, "sha256"));
    if (!sonde_progress_report(progress, (double)*files / count, "reading")) {
      status = sonde_fail(error, SONDE_CANCELLED, "stopped at file %u of %u", *files, count);
      break;
    }
    // A manifest names files of its own directory.
    if (!name || !right || name[0] == '/' || strstr(name, "..")) {
      status = sonde_fail(error, SONDE_FORMAT,
                          "%s:%u: expected path and sha256 of a file below the directory", path,
                          sonde_json_line(f));
      break;
    }
    char member[SONDE_DATASET_PATH];
    sonde_dataset_path(directory, name, member);
    FILE *file = fopen(member, "rb");
    if (!file) {
      status = sonde_fail(error, SONDE_IO, "%s: cannot be read", member);
      break;
    }
    SHA2_CTX sum;
    SHA256Init(&sum);
    uint8_t block[1 << 14];
    for (size_t got; (got = fread(block, 1, sizeof block, file)) > 0;)
      SHA256Update(&sum, block, got);
    fclose(file);
    SHA256End(&sum, digest);
    if (strcmp(digest, right) != 0)
      status = sonde_fail(error, SONDE_CHECKSUM, "%s: SHA-256 is %s, expected %s", member, digest,
                          right);
    else
      ++*files;
  }
  sonde_json_free(root);
  sonde_free(text);
  return status;
}
