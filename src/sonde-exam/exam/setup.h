// What a session starts with besides its controls, as the recording's header keeps it.
#ifndef SONDE_SRC_SETUP_H
#define SONDE_SRC_SETUP_H

#include "sonde/base_json.h"
#include "sonde/echo_scanner.h"
#include "sonde/exam_solid.h"

// What holds for a whole session.
typedef struct sonde_setup {
  sonde_friction friction; // without presets
  uint32_t preset_count;
  sonde_preset presets[SONDE_SESSION_PRESETS];
  double gel_m3;
  bool circulate;
  sonde_circulation circulation;
  bool scans; // the scanner below makes the pictures, else the plain one
  sonde_scanner scanner;
  bool is_solid; // the solid below bears the probe, else springs
  sonde_session_solid solid;
} sonde_setup;

sonde_setup sonde_setup_default(void);
sonde_setup sonde_setup_of(const sonde_session_def *def);
// Into the definition of a session that is to start alike; `def` borrows scanner and solid of
// `setup`.
void sonde_setup_apply(const sonde_setup *setup, sonde_session_def *def);
// Adds "setup" to the header of a recording. @thread owner
void sonde_setup_write(sonde_json_out *header, const sonde_setup *setup);
// The default when the header has none (version 3). @return false: it has one that is not usable
bool sonde_setup_read(const sonde_json *header, sonde_setup *setup);

#endif
