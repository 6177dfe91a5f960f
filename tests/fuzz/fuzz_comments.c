// Comments beside a recording: any bytes are either a list in order of time or an error.
#include "fuzz.h"

#include <math.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  sonde_comments comments;
  sonde_error error = {SONDE_OK, "", ""};
  fuzz_file("exam.rec.comments.json", bytes, count);
  if (!fuzz_checked(sonde_comments_load(fuzz_path("exam.rec"), &comments, &error), &error))
    return 0;
  FUZZ_CHECK(comments.count <= SONDE_MAX_COMMENTS);
  for (uint32_t k = 0; k < comments.count; ++k) {
    const sonde_comment *c = &comments.list[k];
    FUZZ_CHECK(isfinite(c->time_s) && (k == 0 || c[-1].time_s <= c->time_s));
    FUZZ_CHECK(c->text[0] && memchr(c->text, 0, sizeof c->text));
    FUZZ_CHECK(memchr(c->author, 0, sizeof c->author) != NULL);
  }
  sonde_comments_clear(&comments);
  return 0;
}
