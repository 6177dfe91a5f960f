// Snapshots of a scene's motion: a header, the block that a step hands to the next, a checksum.
// The numbers are written as this machine holds them (little-endian IEEE 754).
#include "scene/state.h"

#include "base/base.h"

#include <string.h>

static const char MAGIC[8] = "SONDESNP";
enum { SNAPSHOT_VERSION = 2 };

typedef struct header {
  char magic[8];
  uint64_t version, scene, bytes, hash;
} header;
_Static_assert(sizeof(header) == 40, "the header of a snapshot has no padding");

sonde_status sonde_scene_state_save(const sonde_scene_state *state, const char *path,
                                    sonde_error *error) {
  SONDE_ASSERT(state && path);
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  header h = {.version = SNAPSHOT_VERSION,
              .scene = state->scene->checksum,
              .bytes = state->now.bytes,
              .hash = sonde_scene_hash(state)};
  memcpy(h.magic, MAGIC, sizeof h.magic);
  sonde_file_write(file, &h, sizeof h);
  sonde_file_write(file, state->now.block, state->now.bytes);
  return sonde_file_commit(file, error);
}

static sonde_status check(const sonde_scene_state *state, const char *path, const char *bytes,
                          size_t count, sonde_error *error) {
  header h;
  if (count < sizeof h || memcmp(bytes, MAGIC, sizeof MAGIC) != 0)
    return sonde_fail(error, SONDE_FORMAT, "%s: not a snapshot of a scene", path);
  memcpy(&h, bytes, sizeof h);
  if (h.version != SNAPSHOT_VERSION)
    return sonde_fail(error, SONDE_VERSION, "%s: version %llu, expected %d", path,
                      (unsigned long long)h.version, SNAPSHOT_VERSION);
  if (h.scene != state->scene->checksum || h.bytes != state->now.bytes)
    return sonde_fail(error, SONDE_MISMATCH, "%s: a snapshot of another scene", path);
  if (count != sizeof h + h.bytes || sonde_hash(0, bytes + sizeof h, h.bytes) != h.hash)
    return sonde_fail(error, SONDE_CHECKSUM, "%s: the snapshot is damaged", path);
  return SONDE_OK;
}

sonde_status sonde_scene_state_load(sonde_scene_state *state, const char *path,
                                    sonde_error *error) {
  char *bytes = NULL;
  size_t count;
  sonde_status status = sonde_file_load(path, &bytes, &count, error);
  if (!status) status = check(state, path, bytes, count, error);
  if (!status) {
    SONDE_ASSERT(count == sizeof(header) + state->now.bytes);
    memcpy(state->now.block, bytes + sizeof(header), state->now.bytes);
  }
  sonde_free(bytes);
  return status;
}
