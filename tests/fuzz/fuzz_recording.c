// Recordings and the comments beside them: a reader refuses the bytes or says what holds.
#include "fuzz.h"

#include <math.h>

static void inspect(const char *path, bool recover) {
  sonde_recording_info info;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_recording_inspect(path, recover, &info, &error);
  if (status) {
    fuzz_check_error(status, &error);
    return;
  }
  FUZZ_CHECK(info.version >= 3 && info.version <= 6 && (info.ended || recover));
  FUZZ_CHECK(memchr(info.model_path, 0, sizeof info.model_path) != NULL);
  FUZZ_CHECK(memchr(info.model_name, 0, sizeof info.model_name) != NULL);
}

static void read_comments(const char *beside) {
  sonde_comments comments;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_comments_load(beside, &comments, &error);
  if (status) {
    fuzz_check_error(status, &error);
    return;
  }
  FUZZ_CHECK(comments.count <= SONDE_MAX_COMMENTS);
  for (uint32_t k = 0; k < comments.count; ++k) {
    const sonde_comment *c = &comments.list[k];
    FUZZ_CHECK(isfinite(c->time_s) && (k == 0 || c[-1].time_s <= c->time_s));
    FUZZ_CHECK(c->text[0] && memchr(c->text, 0, sizeof c->text));
    FUZZ_CHECK(memchr(c->author, 0, sizeof c->author) != NULL);
  }
  sonde_comments_clear(&comments);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  char beside[128];
  const char *path = fuzz_file("rec", bytes, count);
  inspect(path, false);
  inspect(path, true);
  snprintf(beside, sizeof beside, "%s", path);
  unlink(path);
  path = fuzz_file("rec.comments.json", bytes, count);
  read_comments(beside);
  unlink(path);
  return 0;
}
