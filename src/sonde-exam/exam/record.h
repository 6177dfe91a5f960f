// The recording: records in memory, and their bytes in the file (docs/recording.md).
#ifndef SONDE_SRC_RECORD_H
#define SONDE_SRC_RECORD_H

#include "sonde/exam_journal.h"
#include "sonde/exam_player.h"

#include "base/bytes.h"
#include "exam/journal.h"
#include "exam/setup.h"

enum {
  SONDE_RECORD_VERSION = 11,
  SONDE_RECORD_JOURNAL = 8, // from this version on a recording is a journal
  SONDE_RECORD_OLDEST = 3,  // that can be read
  SONDE_RECORD_TICK = 1,
  SONDE_RECORD_CONTROLS = 2,
  SONDE_RECORD_END = 3,
  SONDE_RECORD_IMAGE = 4,
  SONDE_RECORD_CHECK = 5,
  SONDE_RECORD_BLOCK = 6,
  SONDE_RECORD_NOTE = 7,
  SONDE_RECORD_TICK_BYTES = 80,
  SONDE_RECORD_NOTE_BYTES = 24,  // before the note's text
  SONDE_RECORD_MOST_BYTES = 512, // of any record but a note
  SONDE_RECORD_PATH_BYTES = 512,
};
#define SONDE_RECORD_MAGIC "SONDE-RECORDING"
// What comes after the last block is lost when the program dies; never more than this.
#define SONDE_RECORD_BLOCK_S 0.25
// Blocks are brought to the disk at least so often.
#define SONDE_RECORD_SYNC_S 1.0

// A hash on the way: of the state after `tick` ticks, or of all images up to that of `tick`.
typedef enum sonde_check_kind { SONDE_CHECK_STATE, SONDE_CHECK_IMAGES } sonde_check_kind;
typedef struct sonde_record_check {
  sonde_check_kind kind;
  uint64_t tick, hash;
} sonde_record_check;

// An image was made of the state after `tick` ticks.
typedef struct sonde_record_image {
  sonde_vec3 rendered_force_n;
  sonde_fault fault;
} sonde_record_image;

// What the ring carries. Controls of a tick come before the tick, its image behind it.
typedef struct sonde_record {
  uint32_t tag;
  uint32_t did; // of a tick: bits of SONDE_LEG_, what came of the solid
  uint64_t tick;
  union {
    sonde_device_sample sample;
    sonde_session_controls controls;
    sonde_record_image image;
    sonde_record_check check;
  };
} sonde_record;

// What the header says.
typedef struct sonde_record_head {
  const char *model_path, *model_name;
  uint64_t model_checksum;
  sonde_world_def world;
  sonde_setup setup;
  uint32_t image_width, image_height, ticks_per_image;
  uint32_t probe_count;
  const sonde_probe *probes;      // borrowed
  const char *const *probe_names; // [probe_count] as given to sonde_probe_create
} sonde_record_head;

// What the end says.
typedef struct sonde_record_end {
  uint64_t ticks, hash, lost, images, image_hash;
  uint32_t crc;
} sonde_record_end;

// Bytes of a record with its tag, 0 for an unknown tag.
size_t sonde_record_bytes(int version, uint32_t tag);
// What follows the tick in a controls record.
size_t sonde_controls_bytes(int version);
void sonde_controls_put(bytes_cursor *writer, const sonde_session_controls *controls);
void sonde_controls_get(bytes_reader *reader, int version, sonde_session_controls *controls);

typedef struct sonde_recorder sonde_recorder;

// Makes the file, writes the header. @thread owner
sonde_status sonde_recorder_create(const char *path, const sonde_record_head *head,
                                   sonde_recorder **recorder, sonde_error *error);
// False for a pipe or a device, which nothing can stand beside.
bool sonde_recorder_is_file(const sonde_recorder *recorder);
// Every SONDE_RECORD_BLOCK_S of ticks what was written is closed off by a block record and handed
// to the system. A tick that does not follow the last one, or for which there is no room while the
// disk is full, ends the inputs: later ones are counted as lost. @thread recorder
void sonde_recorder_write(sonde_recorder *recorder, const sonde_record *record);
// A note, closed off by a block and brought to the disk. @thread recorder
void sonde_recorder_note(sonde_recorder *recorder, sonde_note_kind kind, uint64_t tick,
                         const char *text);
// Tries again what the disk did not take; call it often. @thread recorder
void sonde_recorder_retry(sonde_recorder *recorder);
// Once: the end of the inputs. @param end ticks, images and crc are filled in
void sonde_recorder_end(sonde_recorder *recorder, sonde_record_end *end);
// Brings everything to the disk now. @return DISK, IO when it does not take it
sonde_status sonde_recorder_sync(sonde_recorder *recorder, sonde_error *error);
// Closes the file and frees. NULL is ignored.
void sonde_recorder_close(sonde_recorder *recorder);
// Gives up a recording without inputs: what was there before is there again. NULL is ignored.
void sonde_recorder_discard(sonde_recorder *recorder);

// How the writing goes, for other threads.
typedef struct sonde_recorder_state {
  int trouble;         // errno of the last attempt, 0: none
  uint64_t safe_ticks; // that the system has
  uint64_t lost;       // records that will never be written
  uint32_t safe_notes; // on the disk
} sonde_recorder_state;
sonde_recorder_state sonde_recorder_look(const sonde_recorder *recorder); // @thread any

// A recording read back; arrays are its own.
typedef struct sonde_recording {
  char *bytes; // the file
  int version;
  size_t at;    // next record
  size_t start; // of the records
  size_t end;   // of the records
  char model_path[SONDE_RECORD_PATH_BYTES], model_name[64];
  uint64_t model_checksum;
  sonde_world_def world;
  sonde_setup setup;
  uint32_t image_width, image_height, ticks_per_image;
  uint32_t probe_count;
  char (*probe_names)[SONDE_RECORD_PATH_BYTES];
  uint64_t *probe_hashes;
  bool ended;            // false: cut off; the members below are those of its whole blocks
  sonde_record_end told; // crc: of everything before the end or the last block's record
  size_t notes_end;      // of the whole blocks; notes may follow the end
  uint32_t crc;          // of everything before notes_end, for a journal that goes on
  uint64_t block_ticks;  // of its last whole block
} sonde_recording;

// Reads and checks the whole file. @param recover a file without an end, or with inputs that were
// lost, up to its last whole block
// @thread owner
sonde_status sonde_recording_load(const char *path, bool recover, sonde_recording *recording,
                                  sonde_error *error);
void sonde_recording_clear(sonde_recording *recording);
// Next record of the inputs: no blocks, no notes; false after the last. Only for a recording loaded
// without error.
bool sonde_recording_next(sonde_recording *recording, sonde_record *record);
// A note as it stands in the file; `text` is not terminated.
typedef struct sonde_record_note {
  sonde_note_kind kind;
  uint64_t tick;
  const char *text;
  size_t bytes;
} sonde_record_note;
// The next note at or behind the place *at (start with recording->start); false after the last.
bool sonde_recording_next_note(const sonde_recording *recording, size_t *at,
                               sonde_record_note *note);
// A block record, into bytes[16].
void sonde_record_put_block(unsigned char *bytes, uint32_t crc, uint64_t ticks);
// The bytes of a note but its text, which up to 7 zeros follow; returns how many.
size_t sonde_record_put_note(unsigned char *bytes, sonde_note_kind kind, uint64_t tick,
                             size_t text_bytes);

void sonde_recording_describe(const sonde_recording *recording, sonde_recording_info *info);
// Hash of a probe's body, so that a replay notices another shape behind the same name.
uint64_t sonde_probe_hash(const sonde_probe *probe);
// Appends a note to a recording that nobody writes: on the disk when this returns OK; after a
// failure the recording is as it was. Bytes behind the last whole block are cut off.
// @return VERSION for recordings before version 8, DEVICE for one that is being recorded, ARGUMENT
//   for a text that is too long, DISK, IO @thread owner
sonde_status sonde_notes_add(const char *recording, sonde_note_kind kind, const char *text,
                             sonde_error *error);

#endif
