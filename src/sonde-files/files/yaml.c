// Reading a YAML document through libyaml, whose nodes know their lines.
#include "files/yaml.h"

#include "base/bounds.h"
#include "base/maths.h"

#include <stdarg.h>
#include <string.h>
#include <yaml.h>

struct sonde_reader {
  yaml_document_t document;
  bool has_document;
  const char *name;
  sonde_error error;
};

static yaml_node_t *node_of(const sonde_reader *reader, sonde_place at) {
  // libyaml's getters take a pointer to non-const but do not write.
  return at > 0 ? yaml_document_get_node((yaml_document_t *)&reader->document, at) : NULL;
}

bool sonde_reader_good(const sonde_reader *reader) { return reader->error.status == SONDE_OK; }

sonde_status sonde_reader_status(const sonde_reader *reader, sonde_error *error) {
  if (error && reader->error.status) *error = reader->error;
  return reader->error.status;
}

int sonde_reader_line(const sonde_reader *reader, sonde_place at) {
  const yaml_node_t *node = node_of(reader, at);
  return node ? (int)node->start_mark.line + 1 : 1;
}

void sonde_reader_fail(sonde_reader *reader, sonde_place at, sonde_status status,
                       const char *format, ...) {
  SONDE_ASSERT(status && format);
  if (!sonde_reader_good(reader)) return;
  char text[400];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  sonde_fail_at(&reader->error, status, "sonde_reader", "%s:%d: %s", reader->name,
                sonde_reader_line(reader, at), text);
}

void sonde_reader_pass(sonde_reader *reader, sonde_place at, const sonde_error *error) {
  SONDE_ASSERT(error->status);
  sonde_reader_fail(reader, at, error->status, "%s", error->message);
}

// The parser's own complaint, or that there is no memory.
static void fail_parser(sonde_reader *reader, const yaml_parser_t *parser) {
  if (parser->error == YAML_MEMORY_ERROR)
    sonde_fail_memory(&reader->error);
  else
    sonde_fail_at(&reader->error, SONDE_FORMAT, "sonde_reader", "%s:%d: not YAML: %s", reader->name,
                  (int)parser->problem_mark.line + 1,
                  parser->problem ? parser->problem : "unreadable text");
}

static void fail_event(sonde_reader *reader, const yaml_event_t *event, const char *format,
                       unsigned long long most) {
  char text[200];
  snprintf(text, sizeof text, format, most);
  sonde_fail_at(&reader->error, SONDE_FORMAT, "sonde_reader", "%s:%d: %s", reader->name,
                (int)event->start_mark.line + 1, text);
}

sonde_status sonde_reader_create(const char *text, const char *name, sonde_reader **out,
                                 sonde_error *error) {
  SONDE_ASSERT(text && name && out);
  sonde_reader *reader = *out = SONDE_NEW(sonde_reader, 1);
  if (!reader) return sonde_fail_memory(error);
  reader->name = name;
  const size_t count = strlen(text);
  if (count > sonde_limits_yaml.most_bytes)
    sonde_fail_at(&reader->error, SONDE_FORMAT, "sonde_reader",
                  "%s:1: %zu bytes of YAML, expected at most %llu", name, count,
                  (unsigned long long)sonde_limits_yaml.most_bytes);
  for (int pass = 0; pass < 2 && sonde_reader_good(reader); ++pass) {
    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser)) {
      sonde_fail_memory(&reader->error);
      break;
    }
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, count);
    if (pass == 0) {
      // One document within the limits; the whole text is gone over without being kept, so that
      // building the document is bounded.
      const sonde_input_limits *bounds = &sonde_limits_yaml;
      uint32_t documents = 0, depth = 0;
      uint64_t items = 0;
      yaml_event_t event;
      for (bool more = true; more && sonde_reader_good(reader);) {
        if (!yaml_parser_parse(&parser, &event)) {
          fail_parser(reader, &parser);
          break;
        }
        bool opens =
            event.type == YAML_MAPPING_START_EVENT || event.type == YAML_SEQUENCE_START_EVENT;
        bool closes = event.type == YAML_MAPPING_END_EVENT || event.type == YAML_SEQUENCE_END_EVENT;
        documents += event.type == YAML_DOCUMENT_START_EVENT;
        items += opens || event.type == YAML_SCALAR_EVENT || event.type == YAML_ALIAS_EVENT;
        depth += opens;
        depth -= closes && depth > 0;
        if (documents > 1)
          fail_event(reader, &event, "a second document begins, expected %llu", 1);
        else if (depth > bounds->most_depth)
          fail_event(reader, &event, "expected at most %llu levels of nesting", bounds->most_depth);
        else if (items > bounds->most_items)
          fail_event(reader, &event, "expected at most %llu values", bounds->most_items);
        more = event.type != YAML_STREAM_END_EVENT;
        yaml_event_delete(&event);
      }
    } else {
      reader->has_document = yaml_parser_load(&parser, &reader->document) == 1;
      if (!reader->has_document)
        fail_parser(reader, &parser);
      else if (!yaml_document_get_root_node(&reader->document))
        sonde_fail_at(&reader->error, SONDE_FORMAT, "sonde_reader",
                      "%s:1: the file is empty, expected a map", name);
    }
    yaml_parser_delete(&parser);
  }
  sonde_status status = sonde_reader_status(reader, error);
  if (status) {
    sonde_reader_destroy(reader);
    *out = NULL;
  }
  return status;
}

void sonde_reader_destroy(sonde_reader *reader) {
  if (!reader) return;
  if (reader->has_document) yaml_document_delete(&reader->document);
  sonde_free(reader);
}

sonde_place sonde_reader_root(const sonde_reader *reader) {
  SONDE_ASSERT(reader->has_document);
  return 1; // libyaml numbers nodes from 1, the root first
}

static const char *scalar(const sonde_reader *reader, sonde_place at) {
  const yaml_node_t *node = node_of(reader, at);
  return node && node->type == YAML_SCALAR_NODE ? (const char *)node->data.scalar.value : NULL;
}

bool sonde_read_is_map(const sonde_reader *reader, sonde_place at) {
  const yaml_node_t *node = node_of(reader, at);
  return node && node->type == YAML_MAPPING_NODE;
}

bool sonde_read_is_text(const sonde_reader *reader, sonde_place at) {
  return scalar(reader, at) != NULL;
}

static void list_keys(const char *const *keys, char *text, size_t size) {
  size_t used = 0;
  text[0] = 0;
  for (int i = 0; keys[i] && used + 1 < size; ++i) {
    int length = snprintf(text + used, size - used, "%s%s", i ? ", " : "", keys[i]);
    used += length > 0 ? (size_t)length : 0;
  }
}

void sonde_read_keys(sonde_reader *reader, sonde_place at, const char *what,
                     const char *const *keys) {
  SONDE_ASSERT(what && keys);
  if (!sonde_reader_good(reader)) return;
  char expected[300];
  list_keys(keys, expected, sizeof expected);
  const yaml_node_t *map = node_of(reader, at);
  if (!map || map->type != YAML_MAPPING_NODE) {
    sonde_reader_fail(reader, at, SONDE_FORMAT, "%s must be a map with the keys %s", what,
                      expected);
    return;
  }
  const yaml_node_pair_t *start = map->data.mapping.pairs.start, *end = map->data.mapping.pairs.top;
  for (const yaml_node_pair_t *p = start; p < end && sonde_reader_good(reader); ++p) {
    const char *key = scalar(reader, p->key);
    bool known = false, twice = false;
    for (int i = 0; key && keys[i]; ++i) known |= strcmp(keys[i], key) == 0;
    for (const yaml_node_pair_t *other = start; known && other < p; ++other) {
      const char *before = scalar(reader, other->key);
      twice |= before && strcmp(before, key) == 0;
    }
    if (!known)
      sonde_reader_fail(reader, p->key, SONDE_FORMAT, "unknown key '%s' in %s, expected one of %s",
                        key ? key : "(not a word)", what, expected);
    else if (twice)
      sonde_reader_fail(reader, p->key, SONDE_FORMAT, "key '%s' is given twice in %s", key, what);
  }
}

sonde_place sonde_read_find(sonde_reader *reader, sonde_place at, const char *key) {
  SONDE_ASSERT(reader && key);
  const yaml_node_t *map = node_of(reader, at);
  if (!map || map->type != YAML_MAPPING_NODE) return 0;
  const yaml_node_pair_t *end = map->data.mapping.pairs.top;
  for (const yaml_node_pair_t *p = map->data.mapping.pairs.start; p < end; ++p) {
    const char *name = scalar(reader, p->key);
    if (name && strcmp(name, key) == 0) return p->value;
  }
  return 0;
}

uint32_t sonde_read_count(sonde_reader *reader, sonde_place list) {
  const yaml_node_t *node = node_of(reader, list);
  if (!node || !sonde_reader_good(reader)) return 0;
  if (node->type != YAML_SEQUENCE_NODE) {
    sonde_reader_fail(reader, list, SONDE_FORMAT, "expected a list");
    return 0;
  }
  return (uint32_t)(node->data.sequence.items.top - node->data.sequence.items.start);
}

sonde_place sonde_read_item(const sonde_reader *reader, sonde_place list, uint32_t index) {
  const yaml_node_t *node = node_of(reader, list);
  SONDE_ASSERT(node && node->type == YAML_SEQUENCE_NODE);
  return node->data.sequence.items.start[index];
}

double sonde_read_real_at(sonde_reader *reader, sonde_place at, const char *what, double low,
                          double high) {
  SONDE_ASSERT(low <= high);
  if (!sonde_reader_good(reader)) return low;
  const char *text = scalar(reader, at), *end = text;
  double value = text ? sonde_parse_real(text, &end) : 0;
  bool good = text && end != text && *end == 0 && isfinite(value);
  if (good && value >= low && value <= high) return value;
  sonde_reader_fail(reader, at, good ? SONDE_ARGUMENT : SONDE_FORMAT,
                    "%s must be a number from %g to %g, got '%s'", what, low, high,
                    text ? text : "no number");
  return low;
}

double sonde_read_real(sonde_reader *reader, sonde_place map, const char *key, double low,
                       double high, double fallback) {
  SONDE_ASSERT(low <= high);
  if (!sonde_reader_good(reader)) return low;
  sonde_place at = sonde_read_find(reader, map, key);
  if (at) return sonde_read_real_at(reader, at, key, low, high);
  if (isnan(fallback)) sonde_reader_fail(reader, map, SONDE_FORMAT, "%s is missing", key);
  return isnan(fallback) ? low : fallback;
}

void sonde_read_version(sonde_reader *reader, sonde_place map, const char *key, const char *what,
                        int version) {
  SONDE_ASSERT(key && what);
  const double found = sonde_read_real(reader, map, key, 0, 1e6, (double)NAN);
  if (found != version)
    sonde_reader_fail(reader, sonde_read_find(reader, map, key), SONDE_VERSION,
                      "%s of version %g, expected %d", what, found, version);
}

uint32_t sonde_read_integer(sonde_reader *reader, sonde_place map, const char *key, uint32_t low,
                            uint32_t high, uint32_t fallback) {
  double value = sonde_read_real(reader, map, key, low, high, fallback);
  if (value != floor(value))
    sonde_reader_fail(reader, sonde_read_find(reader, map, key), SONDE_FORMAT,
                      "%s must be a whole number, got %g", key, value);
  return (uint32_t)value;
}

bool sonde_read_bool(sonde_reader *reader, sonde_place map, const char *key, bool fallback) {
  static const char *const WORDS[] = {"false", "true", NULL};
  return sonde_read_choice(reader, map, key, WORDS, fallback) == 1;
}

const char *sonde_read_text_at(sonde_reader *reader, sonde_place at, const char *what) {
  const char *text = scalar(reader, at);
  if (text && text[0]) return text;
  sonde_reader_fail(reader, at, SONDE_FORMAT, "%s must be a word", what);
  return NULL;
}

const char *sonde_read_text(sonde_reader *reader, sonde_place map, const char *key, bool needed) {
  if (!sonde_reader_good(reader)) return NULL;
  sonde_place at = sonde_read_find(reader, map, key);
  if (at) return sonde_read_text_at(reader, at, key);
  if (needed) sonde_reader_fail(reader, map, SONDE_FORMAT, "%s is missing", key);
  return NULL;
}

int sonde_read_choice(sonde_reader *reader, sonde_place map, const char *key,
                      const char *const *choices, int fallback) {
  SONDE_ASSERT(choices && choices[0]);
  sonde_place at = sonde_read_find(reader, map, key);
  if (!sonde_reader_good(reader) || !at) return fallback;
  const char *text = scalar(reader, at);
  for (int i = 0; text && choices[i]; ++i)
    if (strcmp(choices[i], text) == 0) return i;
  char expected[300];
  list_keys(choices, expected, sizeof expected);
  sonde_reader_fail(reader, at, SONDE_FORMAT, "%s is '%s', expected one of %s", key,
                    text ? text : "no word", expected);
  return fallback;
}

sonde_vec3 sonde_read_vector_at(sonde_reader *reader, sonde_place at, const char *what,
                                double magnitude) {
  SONDE_ASSERT(magnitude > 0);
  sonde_vec3 none = vec3(0, 0, 0);
  if (!sonde_reader_good(reader)) return none;
  const yaml_node_t *node = node_of(reader, at);
  if (!node || node->type != YAML_SEQUENCE_NODE || sonde_read_count(reader, at) != 3) {
    sonde_reader_fail(reader, at, SONDE_FORMAT, "%s must be three numbers [x, y, z]", what);
    return none;
  }
  double value[3];
  for (uint32_t i = 0; i < 3; ++i)
    value[i] =
        sonde_read_real_at(reader, sonde_read_item(reader, at, i), what, -magnitude, magnitude);
  return vec3(value[0], value[1], value[2]);
}

sonde_vec3 sonde_read_vector(sonde_reader *reader, sonde_place map, const char *key,
                             double magnitude, sonde_vec3 fallback) {
  sonde_place at = sonde_read_find(reader, map, key);
  return at ? sonde_read_vector_at(reader, at, key, magnitude) : fallback;
}
