// The recording: records in memory, and their bytes in the file (docs/recording.md).
#ifndef SONDE_SRC_RECORD_H
#define SONDE_SRC_RECORD_H

#include "exam/bytes.h"
#include "exam/setup.h"

enum {
  SONDE_RECORD_VERSION = 4,
  SONDE_RECORD_OLDEST = 3, // that can be read
  SONDE_RECORD_TICK = 1,
  SONDE_RECORD_CONTROLS = 2,
  SONDE_RECORD_END = 3,
  SONDE_RECORD_TICK_BYTES = 80,
  SONDE_RECORD_MOST_BYTES = 512, // of any record
  SONDE_RECORD_END_BYTES = 40,
  SONDE_RECORD_PATH_BYTES = 512,
};
#define SONDE_RECORD_MAGIC "SONDE-RECORDING"

// What the ring carries. Controls of a tick come before the tick.
typedef struct sonde_record {
  uint32_t tag;
  uint64_t tick;
  union {
    sonde_device_sample sample;
    sonde_session_controls controls;
  };
} sonde_record;

// What the header says.
typedef struct sonde_record_head {
  const char *model_path, *model_name;
  uint64_t model_checksum;
  sonde_world_def world;
  sonde_setup setup;
  uint32_t probe_count;
  const sonde_probe *probes;      // borrowed
  const char *const *probe_names; // [probe_count] as given to sonde_probe_create
} sonde_record_head;

// What follows the tick in a controls record.
size_t sonde_controls_bytes(int version);
void sonde_controls_put(byte_writer *writer, const sonde_session_controls *controls);
void sonde_controls_get(byte_reader *reader, int version, sonde_session_controls *controls);

typedef struct sonde_recorder sonde_recorder;

// Opens the file and writes the header. @thread owner
sonde_status sonde_recorder_create(const char *path, const sonde_record_head *head,
                                   sonde_recorder **recorder, sonde_error *error);
// @thread recorder
void sonde_recorder_write(sonde_recorder *recorder, const sonde_record *record);
// Writes the end and publishes the file; frees. @param lost records that did not fit the ring
sonde_status sonde_recorder_close(sonde_recorder *recorder, uint64_t hash, uint64_t lost,
                                  sonde_error *error);
// Gives up: nothing is left behind. NULL is ignored.
void sonde_recorder_discard(sonde_recorder *recorder);

// A recording read back; arrays are its own.
typedef struct sonde_recording {
  char *bytes; // the file
  size_t at;   // next record
  size_t end;  // of the records
  char model_path[SONDE_RECORD_PATH_BYTES], model_name[64];
  uint64_t model_checksum;
  sonde_world_def world;
  sonde_setup setup;
  int version; // of the file
  uint32_t probe_count;
  char (*probe_names)[SONDE_RECORD_PATH_BYTES];
  uint64_t *probe_hashes;
  uint64_t ticks, hash, lost;
} sonde_recording;

// Reads and checks the whole file. @thread owner
sonde_status sonde_recording_load(const char *path, sonde_recording *recording, sonde_error *error);
void sonde_recording_clear(sonde_recording *recording);
// Next record; false after the last. Only for a recording that was loaded without error.
bool sonde_recording_next(sonde_recording *recording, sonde_record *record);

// Hash of a probe's body, so that a replay notices another shape behind the same name.
uint64_t sonde_probe_hash(const sonde_probe *probe);

#endif
