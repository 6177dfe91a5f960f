// JSON messages to the page. Numbers are written by integer arithmetic, so that the locale of the
// program that uses the library cannot change the decimal point.
#include "stream/page_message.h"

#include "base/maths.h"

#include <inttypes.h>
#include <stdarg.h>
#include <string.h>

static bool reserve(page_text *text, size_t more) {
  if (text->failed) return false;
  size_t needed = text->count + more + 1;
  if (needed <= text->capacity) return true;
  size_t capacity = needed + needed / 2 + 256;
  char *grown = sonde_realloc(text->text, text->capacity, capacity);
  if (!grown) {
    text->failed = true;
    return false;
  }
  text->text = grown;
  text->capacity = capacity;
  return true;
}

static void put(page_text *text, const char *piece) {
  size_t size = strlen(piece);
  if (!reserve(text, size)) return;
  memcpy(text->text + text->count, piece, size + 1);
  text->count += size;
}

// A JSON string with its quotes; control characters become spaces.
static void put_escaped(page_text *text, const char *raw) {
  put(text, "\"");
  for (const char *c = raw; *c; ++c) {
    char piece[3] = {*c, 0, 0};
    if (*c == '"' || *c == '\\') {
      piece[0] = '\\';
      piece[1] = *c;
    } else if ((unsigned char)*c < 0x20) {
      piece[0] = ' ';
    }
    put(text, piece);
  }
  put(text, "\"");
}

// Four decimals; null when it is not finite or too large to matter.
static void put_real(page_text *text, double value) {
  if (!(fabs(value) < 1e12)) {
    put(text, "null");
    return;
  }
  long long units = llrint(value * 1e4);
  unsigned long long size = (unsigned long long)(units < 0 ? -units : units);
  char piece[40];
  snprintf(piece, sizeof piece, "%s%llu.%04llu", units < 0 ? "-" : "", size / 10000, size % 10000);
  put(text, piece);
}

static void put_integer(page_text *text, uint64_t value) {
  char piece[24];
  snprintf(piece, sizeof piece, "%" PRIu64, value);
  put(text, piece);
}

static void put_key(page_text *text, const char *key) {
  SONDE_ASSERT(text->count > 0);
  char last = text->failed ? '{' : text->text[text->count - 1];
  if (last != '{' && last != '[') put(text, ",");
  put(text, "\"");
  put(text, key);
  put(text, "\":");
}

static void put_named_real(page_text *text, const char *key, double value) {
  put_key(text, key);
  put_real(text, value);
}

static void put_named_text(page_text *text, const char *key, const char *value) {
  put_key(text, key);
  put_escaped(text, value);
}

static void put_named_bool(page_text *text, const char *key, bool value) {
  put_key(text, key);
  put(text, value ? "true" : "false");
}

static void put_named_vector(page_text *text, const char *key, sonde_vec3 v, double scale) {
  put_key(text, key);
  put(text, "[");
  put_real(text, v.x * scale);
  put(text, ",");
  put_real(text, v.y * scale);
  put(text, ",");
  put_real(text, v.z * scale);
  put(text, "]");
}

void page_text_clear(page_text *text) {
  sonde_free(text->text);
  *text = (page_text){0};
}

static void put_probe(page_text *text, const sonde_probe *probe) {
  put(text, "{");
  put_named_text(text, "name", probe->name);
  put_named_real(text, "half_x_mm", probe->half_x_m * 1e3);
  put_named_real(text, "half_y_mm", probe->half_y_m * 1e3);
  put_named_bool(text, "rectangular", probe->rectangular);
  put(text, "}");
}

static void put_probes(page_text *text, const page_hello *hello) {
  put_key(text, "probes");
  put(text, "[");
  for (uint32_t i = 0; i < hello->probe_count; ++i) {
    if (i) put(text, ",");
    put_probe(text, hello->probes[i]);
  }
  put(text, "]");
}

static void put_cases(page_text *text) {
  put_key(text, "cases");
  put(text, "[");
  const char *const *names = sonde_pathology_names();
  for (uint32_t i = 0; names[i]; ++i) {
    if (i) put(text, ",");
    put_escaped(text, names[i]);
  }
  put(text, "]");
}

// The measured points of one site and probe as [[penetration_mm, force_n], ...], in data order.
static void put_curve(page_text *text, const sonde_model *model, uint32_t site, const char *probe) {
  put_key(text, probe);
  put(text, "[");
  bool first = true;
  for (uint32_t i = 0; i < model->datum_count; ++i) {
    const sonde_datum *datum = &model->data[i];
    if (datum->site != site || strcmp(datum->probe, probe) != 0) continue;
    put(text, first ? "[" : ",[");
    put_real(text, datum->penetration_m * 1e3);
    put(text, ",");
    put_real(text, datum->force_n);
    put(text, "]");
    first = false;
  }
  put(text, "]");
}

static void put_site(page_text *text, const page_hello *hello, const sonde_site *site) {
  put(text, "{");
  put_key(text, "id");
  put_integer(text, site->id);
  put_named_vector(text, "position_mm", site->position_m, 1e3);
  put_named_vector(text, "normal", site->normal, 1);
  put_named_vector(text, "u", site->u, 1);
  put_named_vector(text, "v", site->v, 1);
  put_key(text, "curves");
  put(text, "{");
  for (uint32_t i = 0; i < hello->probe_count; ++i)
    put_curve(text, hello->model, site->id, hello->probes[i]->name);
  put(text, "}}");
}

static void put_sites(page_text *text, const page_hello *hello) {
  put_key(text, "sites");
  put(text, "[");
  for (uint32_t i = 0; i < hello->model->site_count; ++i) {
    if (i) put(text, ",");
    put_site(text, hello, &hello->model->sites[i]);
  }
  put(text, "]");
}

static void put_faults(page_text *text) {
  put_key(text, "faults");
  put(text, "[");
  for (int i = 0; i < SONDE_FAULT_COUNT; ++i) {
    if (i) put(text, ",");
    put_escaped(text, sonde_fault_text((sonde_fault)i));
  }
  put(text, "]");
}

void page_write_hello(page_text *text, const page_hello *hello) {
  SONDE_ASSERT(hello->model && (hello->probes || hello->probe_count == 0));
  put(text, "{");
  put_named_text(text, "type", "hello");
  put_key(text, "version");
  put_integer(text, PAGE_VERSION);
  put_named_text(text, "program", sonde_version());
  put_named_text(text, "model", hello->model->name);
  put_named_text(text, "provenance", hello->model->provenance);
  put_key(text, "nodes");
  put_integer(text, hello->model->surface.vertex_count);
  put_key(text, "faces");
  put_integer(text, hello->model->surface.face_count);
  put_named_real(text, "force_limit_n", hello->force_limit_n);
  put_named_bool(text, "controls", hello->controls);
  put_probes(text, hello);
  put_cases(text);
  put_faults(text);
  put_sites(text, hello);
  if (hello->more && hello->more[0]) {
    put(text, ",");
    put(text, hello->more);
  }
  put(text, "}");
}

static const char *const POSTURES[SONDE_POSTURE_COUNT] = {"supine", "sitting", "standing"};

bool page_posture_parse(const char *name, sonde_posture *posture) {
  for (int k = 0; k < SONDE_POSTURE_COUNT; ++k) {
    if (strcmp(name, POSTURES[k]) != 0) continue;
    *posture = (sonde_posture)k;
    return true;
  }
  return false;
}

static void put_patient(page_text *text, const sonde_session_controls *controls, double gel_m3) {
  SONDE_ASSERT(controls->posture < SONDE_POSTURE_COUNT);
  put_named_text(text, "posture", POSTURES[controls->posture]);
  put_named_bool(text, "valsalva", controls->valsalva);
  put_named_bool(text, "gel", controls->gel);
  put_named_real(text, "gel_ml", gel_m3 * 1e6);
  put_named_real(text, "stiffness_scale", controls->stiffness_scale);
  put_named_real(text, "damping_scale", controls->damping_scale);
  put_named_real(text, "friction_scale", controls->friction_scale);
}

void page_write_controls(page_text *text, const sonde_session_controls *controls,
                         const char *probe_name, bool hide_case, double gel_m3, page_role role) {
  static const char *const WHO[] = {"nobody", "learner", "watcher", "teacher"};
  static const char *const MAY[] = {"", "take", "give", "return"};
  const sonde_echo_settings *echo = &controls->echo;
  put(text, "{");
  put_named_text(text, "type", "controls");
  put_named_bool(text, "controls", role.controls);
  put_named_text(text, "role", WHO[role.is]);
  put_named_text(text, "holder", WHO[role.holder]);
  put_named_text(text, "may", MAY[role.may]);
  put_named_text(text, "probe", probe_name);
  put_named_text(text, "case", hide_case ? "" : controls->pathology.name);
  put_named_bool(text, "stop", controls->stop);
  put_named_real(text, "gain_db", echo->gain_db);
  put_named_real(text, "depth_mm", echo->depth_m * 1e3);
  put_named_real(text, "frequency_mhz", echo->frequency_hz * 1e-6);
  put_named_real(text, "dynamic_range_db", echo->dynamic_range_db);
  put_named_real(text, "focus_mm", echo->focus_m * 1e3);
  put_named_real(text, "tgc_db_per_cm", echo->tgc_db_per_m * 1e-2);
  put_patient(text, controls, gel_m3);
  put(text, "}");
}

void page_write_note(page_text *text, const char *kind, const char *sentence) {
  put(text, "{");
  put_named_text(text, "type", kind);
  put_named_text(text, "message", sentence);
  put(text, "}");
}

void page_write_pong(page_text *text, uint32_t id) {
  put(text, "{");
  put_named_text(text, "type", "pong");
  put_key(text, "id");
  put_integer(text, id);
  put(text, "}");
}

void page_write_raw(page_text *text, const char *json) { put(text, json); }
