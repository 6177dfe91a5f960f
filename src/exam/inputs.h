// What a session is driven by besides the poses, as the recording keeps it: the controls as bytes,
// the set-up as a member of the header.
#ifndef SONDE_SRC_INPUTS_H
#define SONDE_SRC_INPUTS_H

#include "sonde/exam.h"

#include "exam/bytes.h"

#include <cjson/cJSON.h>

// After the tag of a controls record, by version of the recording.
enum { SONDE_CONTROLS_BYTES_3 = 164, SONDE_CONTROLS_BYTES = 220 };

// Writes SONDE_CONTROLS_BYTES. @thread recorder
void sonde_controls_put(byte_writer *w, uint64_t tick, const sonde_session_controls *controls);
// Reads the bytes of version 3 or of the current one; what version 3 lacks gets its default.
void sonde_controls_get(byte_reader *r, int version, uint64_t *tick,
                        sonde_session_controls *controls);

// What holds for a whole session.
typedef struct sonde_setup {
  sonde_friction friction; // without presets
  uint32_t preset_count;
  sonde_preset presets[SONDE_SESSION_PRESETS];
  double gel_m3;
  bool circulate;
  sonde_circulation circulation;
} sonde_setup;

sonde_setup sonde_setup_default(void);
sonde_setup sonde_setup_of(const sonde_session_def *def);
// Adds "setup" to the header of a recording. @thread owner
void sonde_setup_write(cJSON *header, const sonde_setup *setup);
// The default when the header has none (version 3). @return false: it has one that is not usable
bool sonde_setup_read(const cJSON *header, sonde_setup *setup);

#endif
