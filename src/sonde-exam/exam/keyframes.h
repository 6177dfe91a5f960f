// Keyframes: all that a session's next ticks and images depend on at one image, packed; in memory
// or in a file beside the recording. The file is a cache for this machine and this version of the
// program: it can be deleted and is made again.
#ifndef SONDE_SRC_KEYFRAMES_H
#define SONDE_SRC_KEYFRAMES_H

#include "exam/session.h"

#include <string.h>

// Parts of a keyframe; they lie one behind the other when packed.
typedef struct sonde_keyframe {
  uint64_t tick;
  const sonde_tick_memory *inputs;
  const sonde_image_memory *inside; // before the image of this tick
  const void *world;                // sonde_subject_remember()
  size_t world_bytes;
} sonde_keyframe;

typedef struct sonde_packed_keyframe {
  uint64_t tick;
  uint32_t raw_bytes, packed_bytes, crc;
  unsigned char *packed; // NULL: in the file at `at`
  uint64_t at;
} sonde_packed_keyframe;

// How many of the items, which begin with their tick and are in its order, are at or before a tick.
static inline uint32_t sonde_count_until(const void *items, size_t item_bytes, uint32_t count,
                                         uint64_t tick) {
  uint32_t low = 0, high = count;
  while (low < high) {
    uint32_t middle = low + (high - low) / 2;
    uint64_t there;
    memcpy(&there, (const char *)items + middle * item_bytes, sizeof there);
    if (there <= tick)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

// Where keyframes belong: the recording's name with ".keys" behind it. Freed by sonde_free, NULL
// without memory.
char *sonde_keyframes_path(const char *recording);

// Writing beside the recording while it is made.
typedef struct sonde_keyframe_writer sonde_keyframe_writer;
sonde_status sonde_keyframe_writer_create(const char *path, const sonde_subject *subject,
                                          sonde_keyframe_writer **keys, sonde_error *error);
// Packs and appends; the CPU time is the recorder's.
void sonde_keyframe_writer_add(sonde_keyframe_writer *keys, const sonde_keyframe *key);
void sonde_keyframe_writer_copy(sonde_keyframe_writer *keys, const sonde_packed_keyframe *key);
// Binds the keyframes to the recording whose CRC this is; frees.
sonde_status sonde_keyframe_writer_commit(sonde_keyframe_writer *keys, uint32_t recording_crc,
                                          sonde_error *error);
void sonde_keyframe_writer_discard(sonde_keyframe_writer *keys);

// A list in order of ticks.
typedef struct sonde_keyframes {
  sonde_packed_keyframe *list; // [count], room for `room`
  uint32_t count, room;
  FILE *file;                  // of keys that are not in memory
  unsigned char *raw, *packed; // [raw_room], [compressed raw_room]
  size_t raw_room;
} sonde_keyframes;

// Room for keyframes of a subject. @thread owner
sonde_status sonde_keyframes_init(sonde_keyframes *keys, const sonde_subject *subject,
                                  sonde_error *error);
void sonde_keyframes_clear(sonde_keyframes *keys);
// Those of the file that belong to the recording with that CRC; none otherwise.
void sonde_keyframes_open(sonde_keyframes *keys, const char *path, const sonde_subject *subject,
                          uint32_t recording_crc);
// Adds a copy; one of that tick that is there stays. False without memory.
bool sonde_keyframes_add(sonde_keyframes *keys, const sonde_keyframe *key);
// The last keyframe at or before a tick, NULL: none.
sonde_packed_keyframe *sonde_keyframes_find(const sonde_keyframes *keys, uint64_t tick);
// Unpacks; the parts point into the list's room until the next call. False when it is damaged.
bool sonde_keyframes_unpack(sonde_keyframes *keys, const sonde_packed_keyframe *packed,
                            sonde_keyframe *key);
// Keyframe with its bytes in memory, for copying into a file. False when it is damaged.
bool sonde_keyframes_fetch(sonde_keyframes *keys, const sonde_packed_keyframe *packed,
                           sonde_packed_keyframe *whole);

#endif
