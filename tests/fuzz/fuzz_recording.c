// Recordings: a reader refuses the bytes or says what holds; a recording of the leg is played for a
// few images, forth and back, one in sixteen: making the inside takes most of a second. The
// libFuzzer build takes every checksum of a file for right (sonde_checksum_fits), so that changed
// bytes get past it.
#include "fuzz.h"

#include "exam/record.h"

static bool inspect(const char *path, bool recover) {
  sonde_recording_info info;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_recording_inspect(path, recover, &info, &error);
  if (!fuzz_checked(status, &error)) return false;
  FUZZ_CHECK(info.version >= SONDE_RECORD_OLDEST && info.version <= SONDE_RECORD_VERSION);
  FUZZ_CHECK(info.ended || recover);
  FUZZ_CHECK(memchr(info.model_path, 0, sizeof info.model_path) != NULL);
  FUZZ_CHECK(memchr(info.model_name, 0, sizeof info.model_name) != NULL);
  return true;
}

static void play(const char *path) {
  sonde_player *player = NULL;
  sonde_frame frame;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_player_def def = {.path = path, .model = fuzz_leg(), .recover = true, .no_cache = true};
  sonde_status status = sonde_player_open(&def, &player, &error);
  if (status) {
    FUZZ_CHECK(error.status == status && error.message[0]);
    return;
  }
  sonde_player_advance(player, 0.01);
  if (sonde_player_next_image(player, false)) sonde_player_frame(player, &frame);
  status = sonde_player_seek(player, 0.002, NULL, &error);
  FUZZ_CHECK(status == SONDE_OK || error.message[0]);
  sonde_player_close(player);
}

static void read_notes(const char *path) {
  sonde_notes notes;
  sonde_error error = {SONDE_OK, "", ""};
  if (!fuzz_checked(sonde_notes_load(path, &notes, &error), &error)) return;
  for (uint32_t k = 0; k < notes.count; ++k)
    FUZZ_CHECK(strlen(notes.list[k].text) <= SONDE_NOTE_MOST_BYTES);
  sonde_notes_clear(&notes);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  const char *path = fuzz_file("exam.rec", bytes, count);
  inspect(path, false);
  read_notes(path);
  if (inspect(path, true) && fuzz_chosen(bytes, count, 16)) play(path);
  return 0;
}
