// Reading a YAML document with the line of every mistake. A reader keeps the first error: after it
// every call does nothing and returns a default, so that callers check once.
#ifndef SONDE_SRC_YAML_H
#define SONDE_SRC_YAML_H

#include "base/link.h"
#include "sonde/base.h"

typedef struct sonde_reader sonde_reader;
// A place in the document; 0 is absent.
typedef int sonde_place;

// @param name of the document in messages; borrowed
SONDE_LINK sonde_status sonde_reader_create(const char *text, const char *name,
                                            sonde_reader **reader, sonde_error *error);
SONDE_LINK void sonde_reader_destroy(sonde_reader *reader);
SONDE_LINK sonde_place sonde_reader_root(const sonde_reader *reader);
SONDE_LINK bool sonde_reader_good(const sonde_reader *reader);
SONDE_LINK sonde_status sonde_reader_status(const sonde_reader *reader, sonde_error *error);
// Records "name:line: ..." unless there is an error already.
SONDE_LINK void sonde_reader_fail(sonde_reader *reader, sonde_place at, sonde_status status,
                                  const char *format, ...) __attribute__((format(printf, 4, 5)));
// Takes over the error of another call, with the line before it.
SONDE_LINK void sonde_reader_pass(sonde_reader *reader, sonde_place at, const sonde_error *error);
int sonde_reader_line(const sonde_reader *reader, sonde_place at);

// `keys` is NULL-terminated; an unknown or repeated key is an error. `what` names the map.
SONDE_LINK void sonde_read_keys(sonde_reader *reader, sonde_place map, const char *what,
                                const char *const *keys);
SONDE_LINK sonde_place sonde_read_find(sonde_reader *reader, sonde_place map, const char *key);
SONDE_LINK bool sonde_read_is_map(const sonde_reader *reader, sonde_place at);
SONDE_LINK bool sonde_read_is_text(const sonde_reader *reader, sonde_place at);
// Entries of a list, 0 and an error when it is none; absent counts as empty.
SONDE_LINK uint32_t sonde_read_count(sonde_reader *reader, sonde_place list);
SONDE_LINK sonde_place sonde_read_item(const sonde_reader *reader, sonde_place list,
                                       uint32_t index);

// Refuses another version of a format than this one, or none: "`what` of version 2, expected 1".
SONDE_LINK void sonde_read_version(sonde_reader *reader, sonde_place map, const char *key,
                                   const char *what, int version);
// Numbers within [low, high]; a NaN fallback makes the key necessary.
SONDE_LINK double sonde_read_real(sonde_reader *reader, sonde_place map, const char *key,
                                  double low, double high, double fallback);
SONDE_LINK double sonde_read_real_at(sonde_reader *reader, sonde_place at, const char *what,
                                     double low, double high);
SONDE_LINK uint32_t sonde_read_integer(sonde_reader *reader, sonde_place map, const char *key,
                                       uint32_t low, uint32_t high, uint32_t fallback);
SONDE_LINK bool sonde_read_bool(sonde_reader *reader, sonde_place map, const char *key,
                                bool fallback);
// Text of a scalar; NULL and an error when necessary and absent.
SONDE_LINK const char *sonde_read_text(sonde_reader *reader, sonde_place map, const char *key,
                                       bool needed);
SONDE_LINK const char *sonde_read_text_at(sonde_reader *reader, sonde_place at, const char *what);
// Index of the text in the NULL-terminated choices.
SONDE_LINK int sonde_read_choice(sonde_reader *reader, sonde_place map, const char *key,
                                 const char *const *choices, int fallback);
// [x, y, z]; absent gives the fallback.
SONDE_LINK sonde_vec3 sonde_read_vector(sonde_reader *reader, sonde_place map, const char *key,
                                        double magnitude, sonde_vec3 fallback);
SONDE_LINK sonde_vec3 sonde_read_vector_at(sonde_reader *reader, sonde_place at, const char *what,
                                           double magnitude);

#endif
