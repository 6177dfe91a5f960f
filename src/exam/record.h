// The recording: records in memory, and their bytes in the file (docs/recording.md).
#ifndef SONDE_SRC_RECORD_H
#define SONDE_SRC_RECORD_H

#include "sonde/exam_player.h"

#include "exam/bytes.h"
#include "exam/setup.h"

enum {
  SONDE_RECORD_VERSION = 7,
  SONDE_RECORD_OLDEST = 3, // that can be read
  SONDE_RECORD_TICK = 1,
  SONDE_RECORD_CONTROLS = 2,
  SONDE_RECORD_END = 3,
  SONDE_RECORD_IMAGE = 4,
  SONDE_RECORD_CHECK = 5,
  SONDE_RECORD_BLOCK = 6,
  SONDE_RECORD_TICK_BYTES = 80,
  SONDE_RECORD_MOST_BYTES = 512, // of any record
  SONDE_RECORD_PATH_BYTES = 512,
};
#define SONDE_RECORD_MAGIC "SONDE-RECORDING"
// The end of a file that was killed is lost; never more than this.
#define SONDE_RECORD_BLOCK_S 0.25

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
void sonde_controls_put(byte_writer *writer, const sonde_session_controls *controls);
void sonde_controls_get(byte_reader *reader, int version, sonde_session_controls *controls);

typedef struct sonde_recorder sonde_recorder;

// Opens the file and writes the header. @thread owner
sonde_status sonde_recorder_create(const char *path, const sonde_record_head *head,
                                   sonde_recorder **recorder, sonde_error *error);
// Every SONDE_RECORD_BLOCK_S of ticks what was written is closed off by a block record and handed
// to the system. @thread recorder
void sonde_recorder_write(sonde_recorder *recorder, const sonde_record *record);
// Writes the end and publishes the file; frees. @param end ticks, images and crc are filled in
sonde_status sonde_recorder_close(sonde_recorder *recorder, sonde_record_end *end,
                                  sonde_error *error);
// Gives up: nothing is left behind. NULL is ignored.
void sonde_recorder_discard(sonde_recorder *recorder);

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
} sonde_recording;

// Reads and checks the whole file. @param recover a file without an end up to its last whole block
// @thread owner
sonde_status sonde_recording_load(const char *path, bool recover, sonde_recording *recording,
                                  sonde_error *error);
void sonde_recording_clear(sonde_recording *recording);
// Next record but block records; false after the last. Only for a recording loaded without
// error.
bool sonde_recording_next(sonde_recording *recording, sonde_record *record);

void sonde_recording_describe(const sonde_recording *recording, sonde_recording_info *info);
// Hash of a probe's body, so that a replay notices another shape behind the same name.
uint64_t sonde_probe_hash(const sonde_probe *probe);
// The recorded probes, checked to have the recorded shape.
// @param[out] probes [probe_count], cleared by the caller also after a failure
sonde_status sonde_recording_probes(const sonde_recording *recording, const char *path,
                                    sonde_probe *probes, sonde_error *error);
sonde_status sonde_recording_fits(const sonde_recording *recording, const char *path,
                                  const sonde_model *model, sonde_error *error);

#endif
