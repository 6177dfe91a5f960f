// Keyframes in memory and in their file.
#include "exam/keyframes.h"

#include "base/base.h"

#include <string.h>
#include <zlib.h>

enum { PARTS = sizeof(sonde_tick_memory) + sizeof(sonde_image_memory), LEVEL = 1 };
enum { ENTRY = 0x5945534b, LAST = 0x444e454b }; // "KSEY", "KEND"

// Numbers of this machine, as it has them.
typedef struct file_head {
  char magic[16]; // "SONDE-KEYS 1"
  char version[16];
  uint32_t order, parts; // byte order; sizes of what is saved
  uint64_t state_bytes, model_checksum;
} file_head;

typedef struct file_entry {
  uint32_t tag, raw_bytes, packed_bytes, crc; // LAST: crc of the recording
  uint64_t tick;
} file_entry;

struct sonde_keyframe_writer {
  sonde_file *file;
  unsigned char *raw, *packed;
  size_t raw_room;
};

char *sonde_keyframes_path(const char *recording) {
  SONDE_ASSERT(recording != NULL);
  size_t bytes = strlen(recording) + sizeof ".keys";
  char *path = SONDE_NEW(char, bytes);
  if (path) snprintf(path, bytes, "%s.keys", recording);
  return path;
}

static size_t raw_room(const sonde_subject *subject) { return PARTS + sonde_subject_size(subject); }

static file_head head_of(const sonde_subject *subject) {
  file_head head;
  memset(&head, 0, sizeof head);
  snprintf(head.magic, sizeof head.magic, "SONDE-KEYS 1");
  snprintf(head.version, sizeof head.version, "%s", sonde_version());
  head.order = 0x01020304, head.parts = PARTS;
  head.state_bytes = sonde_subject_size(subject);
  head.model_checksum = subject->model->checksum;
  return head;
}

// Into packed[compressBound(raw_room)]; false when the parts do not fit, which a program's own do.
static bool pack(const sonde_keyframe *key, unsigned char *raw, size_t room, unsigned char *packed,
                 sonde_packed_keyframe *out) {
  size_t bytes = PARTS + key->world_bytes;
  uLongf length = compressBound(room);
  SONDE_ASSERT(bytes <= room && bytes <= UINT32_MAX);
  memcpy(raw, key->inputs, sizeof *key->inputs);
  memcpy(raw + sizeof *key->inputs, key->inside, sizeof *key->inside);
  memcpy(raw + PARTS, key->world, key->world_bytes);
  if (compress2(packed, &length, raw, bytes, LEVEL) != Z_OK) return false;
  *out = (sonde_packed_keyframe){.tick = key->tick,
                                 .raw_bytes = (uint32_t)bytes,
                                 .packed_bytes = (uint32_t)length,
                                 .crc = (uint32_t)crc32_z(0, packed, length),
                                 .packed = packed};
  return true;
}

// ---- writing ------------------------------------------------------------------------------

static void free_writer(sonde_keyframe_writer *keys) {
  if (!keys) return;
  sonde_free(keys->raw);
  sonde_free(keys->packed);
  sonde_free(keys);
}

sonde_status sonde_keyframe_writer_create(const char *path, const sonde_subject *subject,
                                          sonde_keyframe_writer **out, sonde_error *error) {
  *out = NULL;
  sonde_keyframe_writer *keys = SONDE_NEW(sonde_keyframe_writer, 1);
  if (!keys) return sonde_fail_memory(error);
  keys->raw_room = raw_room(subject);
  keys->raw = sonde_calloc(1, keys->raw_room);
  keys->packed = sonde_calloc(1, compressBound(keys->raw_room));
  sonde_status status = keys->raw && keys->packed ? SONDE_OK : sonde_fail_memory(error);
  (void)sonde_file_remove_abandoned(path); // what a killed program left
  if (!status) status = sonde_file_create(path, &keys->file, error);
  if (status) {
    free_writer(keys);
    return status;
  }
  file_head head = head_of(subject);
  sonde_file_write(keys->file, &head, sizeof head);
  *out = keys;
  return SONDE_OK;
}

void sonde_keyframe_writer_copy(sonde_keyframe_writer *keys, const sonde_packed_keyframe *key) {
  SONDE_ASSERT(key->packed != NULL);
  file_entry entry = {ENTRY, key->raw_bytes, key->packed_bytes, key->crc, key->tick};
  sonde_file_write(keys->file, &entry, sizeof entry);
  sonde_file_write(keys->file, key->packed, key->packed_bytes);
}

void sonde_keyframe_writer_add(sonde_keyframe_writer *keys, const sonde_keyframe *key) {
  sonde_packed_keyframe packed;
  if (pack(key, keys->raw, keys->raw_room, keys->packed, &packed))
    sonde_keyframe_writer_copy(keys, &packed);
}

sonde_status sonde_keyframe_writer_commit(sonde_keyframe_writer *keys, uint32_t recording_crc,
                                          sonde_error *error) {
  file_entry last = {LAST, 0, 0, recording_crc, 0};
  sonde_file_write(keys->file, &last, sizeof last);
  sonde_status status = sonde_file_commit(keys->file, error);
  free_writer(keys);
  return status;
}

void sonde_keyframe_writer_discard(sonde_keyframe_writer *keys) {
  if (!keys) return;
  sonde_file_discard(keys->file);
  free_writer(keys);
}

// ---- list ---------------------------------------------------------------------------------

sonde_status sonde_keyframes_init(sonde_keyframes *keys, const sonde_subject *subject,
                                  sonde_error *error) {
  *keys = (sonde_keyframes){.raw_room = raw_room(subject)};
  keys->raw = sonde_calloc(1, keys->raw_room);
  keys->packed = sonde_calloc(1, compressBound(keys->raw_room));
  return keys->raw && keys->packed ? SONDE_OK : sonde_fail_memory(error);
}

void sonde_keyframes_clear(sonde_keyframes *keys) {
  for (uint32_t k = 0; k < keys->count; ++k) sonde_free(keys->list[k].packed);
  sonde_free(keys->list);
  sonde_free(keys->raw);
  sonde_free(keys->packed);
  if (keys->file) fclose(keys->file);
  *keys = (sonde_keyframes){0};
}

// Room for one more; false without memory.
static bool grow(sonde_keyframes *keys) {
  if (keys->count < keys->room) return true;
  uint32_t room = keys->room ? 2 * keys->room : 64;
  sonde_packed_keyframe *list =
      sonde_realloc(keys->list, keys->room * sizeof *list, room * sizeof *list);
  if (!list) return false;
  keys->list = list;
  keys->room = room;
  return true;
}

// Place of the first keyframe behind a tick.
static uint32_t place_after(const sonde_keyframes *keys, uint64_t tick) {
  return sonde_count_until(keys->list, sizeof *keys->list, keys->count, tick);
}

sonde_packed_keyframe *sonde_keyframes_find(const sonde_keyframes *keys, uint64_t tick) {
  uint32_t after = place_after(keys, tick);
  return after > 0 ? &keys->list[after - 1] : NULL;
}

bool sonde_keyframes_add(sonde_keyframes *keys, const sonde_keyframe *key) {
  uint32_t at = place_after(keys, key->tick);
  if (at > 0 && keys->list[at - 1].tick == key->tick) return true;
  sonde_packed_keyframe packed;
  if (!grow(keys) || !pack(key, keys->raw, keys->raw_room, keys->packed, &packed)) return false;
  packed.packed = sonde_calloc(1, packed.packed_bytes);
  if (!packed.packed) return false;
  memcpy(packed.packed, keys->packed, packed.packed_bytes);
  memmove(keys->list + at + 1, keys->list + at, (keys->count - at) * sizeof *keys->list);
  keys->list[at] = packed;
  keys->count++;
  return true;
}

void sonde_keyframes_open(sonde_keyframes *keys, const char *path, const sonde_subject *subject,
                          uint32_t recording_crc) {
  SONDE_ASSERT(keys->file == NULL && keys->count == 0);
  file_head head, mine = head_of(subject);
  keys->file = fopen(path, "rb");
  if (!keys->file) return;
  bool good =
      fread(&head, sizeof head, 1, keys->file) == 1 && memcmp(&head, &mine, sizeof head) == 0;
  // The list of a whole file for this recording: entries in the order of ticks, then its CRC.
  file_entry entry = {0};
  while (good && fread(&entry, sizeof entry, 1, keys->file) == 1 && entry.tag == ENTRY) {
    uint64_t last = keys->count ? keys->list[keys->count - 1].tick : 0;
    long at = ftell(keys->file);
    good = at >= 0 && entry.raw_bytes >= PARTS && entry.raw_bytes <= keys->raw_room &&
           entry.packed_bytes <= compressBound(keys->raw_room) && entry.tick > last && grow(keys) &&
           fseek(keys->file, (long)entry.packed_bytes, SEEK_CUR) == 0;
    if (!good) break;
    keys->list[keys->count++] = (sonde_packed_keyframe){.tick = entry.tick,
                                                        .raw_bytes = entry.raw_bytes,
                                                        .packed_bytes = entry.packed_bytes,
                                                        .crc = entry.crc,
                                                        .at = (uint64_t)at};
  }
  good = good && entry.tag == LAST && entry.crc == recording_crc;
  if (good) return;
  keys->count = 0;
  fclose(keys->file);
  keys->file = NULL;
}

bool sonde_keyframes_fetch(sonde_keyframes *keys, const sonde_packed_keyframe *packed,
                           sonde_packed_keyframe *whole) {
  *whole = *packed;
  if (packed->packed) return true;
  whole->packed = keys->packed;
  return keys->file && fseek(keys->file, (long)packed->at, SEEK_SET) == 0 &&
         fread(keys->packed, 1, packed->packed_bytes, keys->file) == packed->packed_bytes &&
         crc32_z(0, keys->packed, packed->packed_bytes) == packed->crc;
}

bool sonde_keyframes_unpack(sonde_keyframes *keys, const sonde_packed_keyframe *packed,
                            sonde_keyframe *key) {
  sonde_packed_keyframe whole;
  uLongf bytes = keys->raw_room;
  if (!sonde_keyframes_fetch(keys, packed, &whole)) return false;
  if (uncompress(keys->raw, &bytes, whole.packed, whole.packed_bytes) != Z_OK ||
      bytes != packed->raw_bytes)
    return false;
  *key = (sonde_keyframe){.tick = packed->tick,
                          .inputs = (const void *)keys->raw,
                          .inside = (const void *)(keys->raw + sizeof(sonde_tick_memory)),
                          .world = keys->raw + PARTS,
                          .world_bytes = bytes - PARTS};
  return true;
}
