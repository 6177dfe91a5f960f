// An exam as a statement of xAPI 1.0.3 (Experience API, ADL): who did what, and with which result.
#include "stream/page_secret.h"

#include "sonde/stream_door.h"

#include <string.h>

// RFC 4122, 4.3: a name-based UUID (version 5) in the name space of URLs, so that the same exam has
// the same identity however often it is exported.
static void write_uuid(const char *url, char text[37]) {
  static const unsigned char URLS[16] = {0x6b, 0xa7, 0xb8, 0x11, 0x9d, 0xad, 0x11, 0xd1,
                                         0x80, 0xb4, 0x00, 0xc0, 0x4f, 0xd4, 0x30, 0xc8};
  unsigned char name[16 + 512], d[PAGE_SHA1_BYTES];
  size_t size = strlen(url);
  SONDE_ASSERT(size <= 512);
  memcpy(name, URLS, sizeof URLS);
  memcpy(name + sizeof URLS, url, size);
  page_sha1(name, sizeof URLS + size, d);
  d[6] = (unsigned char)((d[6] & 0x0f) | 0x50);
  d[8] = (unsigned char)((d[8] & 0x3f) | 0x80);
  size_t used = 0;
  for (int i = 0; i < 16; ++i)
    used += (size_t)snprintf(text + used, 37 - used, "%s%02x",
                             i == 4 || i == 6 || i == 8 || i == 10 ? "-" : "", (unsigned)d[i]);
}

// A text in English, as language maps are.
static void put_map(sonde_json_out *out, const char *key, const char *text) {
  sonde_json_begin_object(out, key);
  sonde_json_put_text(out, "en", text);
  sonde_json_end(out);
}

void sonde_door_statement(const sonde_log_entry *entry, const char *home, sonde_json_out *out) {
  SONDE_ASSERT(entry && home && strlen(home) < 200 && out);
  char text[512], uuid[37];
  const char *verb = entry->interrupted ? "terminated" : entry->passed ? "passed" : "failed";
  snprintf(text, sizeof text, "%sexams/%s", home, entry->id);
  write_uuid(text, uuid);
  sonde_json_begin_object(out, NULL);
  sonde_json_put_text(out, "id", uuid);
  sonde_json_begin_object(out, "actor");
  sonde_json_put_text(out, "objectType", "Agent");
  sonde_json_put_text(out, "name", entry->trainee);
  sonde_json_begin_object(out, "account");
  sonde_json_put_text(out, "homePage", home);
  sonde_json_put_text(out, "name", entry->trainee);
  sonde_json_end(out);
  sonde_json_end(out);
  sonde_json_begin_object(out, "verb");
  snprintf(text, sizeof text, "http://adlnet.gov/expapi/verbs/%s", verb);
  sonde_json_put_text(out, "id", text);
  put_map(out, "display", verb);
  sonde_json_end(out);
  sonde_json_begin_object(out, "object");
  sonde_json_put_text(out, "objectType", "Activity");
  snprintf(text, sizeof text, "%scases/%s", home, entry->case_id);
  sonde_json_put_text(out, "id", text);
  sonde_json_begin_object(out, "definition");
  sonde_json_put_text(out, "type", "http://adlnet.gov/expapi/activities/simulation");
  put_map(out, "name", entry->case_title);
  sonde_json_end(out);
  sonde_json_end(out);
  sonde_json_begin_object(out, "result");
  if (!entry->interrupted) {
    sonde_json_begin_object(out, "score");
    sonde_json_put_real(out, "scaled", entry->score / 100, 6);
    sonde_json_put_real(out, "raw", entry->score, 6);
    sonde_json_put_integer(out, "min", 0);
    sonde_json_put_integer(out, "max", 100);
    sonde_json_end(out);
    sonde_json_put_bool(out, "success", entry->passed);
  }
  sonde_json_put_bool(out, "completion", !entry->interrupted);
  if (entry->metrics.time_s >= 0) { // ISO 8601
    const unsigned long hundredths = (unsigned long)(100 * entry->metrics.time_s + 0.5);
    snprintf(text, sizeof text, "PT%lu.%02luS", hundredths / 100, hundredths % 100);
    sonde_json_put_text(out, "duration", text);
  }
  sonde_json_end(out);
  sonde_json_begin_object(out, "context");
  sonde_json_put_text(out, "platform", "Sonde " SONDE_VERSION_STRING);
  sonde_json_put_text(out, "language", "en");
  sonde_json_begin_object(out, "extensions");
  snprintf(text, sizeof text, "%sprotocol", home);
  sonde_json_put_text(out, text, entry->protocol);
  snprintf(text, sizeof text, "%sguidance", home);
  sonde_json_put_text(out, text, entry->guidance);
  snprintf(text, sizeof text, "%sdiagnosis-right", home);
  sonde_json_put_bool(out, text, entry->correct);
  sonde_json_end(out);
  sonde_json_end(out);
  sonde_json_put_text(out, "timestamp", entry->date);
  sonde_json_end(out);
}
