/**
 * @file base_json.h
 * JSON texts (RFC 8259): a strict reader into a tree and a writer onto an output file.
 */
#ifndef SONDE_BASE_JSON_H
#define SONDE_BASE_JSON_H

#include "sonde/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Kind of a value. */
typedef enum sonde_json_kind {
  SONDE_JSON_ABSENT, /**< there is no value: NULL */
  SONDE_JSON_NULL,
  SONDE_JSON_FALSE,
  SONDE_JSON_TRUE,
  SONDE_JSON_NUMBER,
  SONDE_JSON_TEXT,
  SONDE_JSON_LIST,
  SONDE_JSON_OBJECT
} sonde_json_kind;

/** A value of a text that was read; NULL is a value that is absent, which every reader takes. */
typedef struct sonde_json sonde_json;

/** Where a text is from, and its limits. */
typedef struct sonde_json_source {
  const char *name;     /**< file in messages; NULL: messages name no file and line */
  uint32_t line;        /**< of the text's first byte in that file; 0: the first */
  uint32_t most_depth;  /**< levels of lists and objects within each other; 0: 32 */
  uint32_t most_values; /**< 0: 200,000 */
} sonde_json_source;

/**
 * Reads one JSON text. Beyond RFC 8259 it refuses the character U+0000 in a text, a key that an
 * object has twice and a number beyond the range of a double.
 * @param source NULL: no name, usual limits @param[out] root freed by sonde_json_free()
 * @return FORMAT with file and line of the first mistake; MEMORY @thread any
 */
SONDE_API sonde_status sonde_json_parse(const char *bytes, size_t count,
                                        const sonde_json_source *source, sonde_json **root,
                                        sonde_error *error);
/** Frees a whole tree with its texts; NULL is ignored. @thread any */
SONDE_API void sonde_json_free(sonde_json *root);

/** @thread any */
SONDE_API sonde_json_kind sonde_json_kind_of(const sonde_json *value);
/** Member of an object; NULL when it has none of that name or is no object. @thread any */
SONDE_API const sonde_json *sonde_json_member(const sonde_json *object, const char *key);
/** First value in a list or object, NULL: none. @thread any */
SONDE_API const sonde_json *sonde_json_first(const sonde_json *parent);
/** The value behind this one in its list or object, NULL: none. @thread any */
SONDE_API const sonde_json *sonde_json_next(const sonde_json *value);
/** Values in a list or object. @thread any */
SONDE_API uint32_t sonde_json_count(const sonde_json *parent);
/** Key of an object's member; NULL for any other value. Lives as long as the tree. @thread any */
SONDE_API const char *sonde_json_key(const sonde_json *value);
/** UTF-8 of a text, NULL for any other value. Lives as long as the tree. @thread any */
SONDE_API const char *sonde_json_as_text(const sonde_json *value);
/** NaN for any other value than a number. @thread any */
SONDE_API double sonde_json_as_number(const sonde_json *value);
/** Line of the file where the value begins, from 1; 0 when absent. @thread any */
SONDE_API uint32_t sonde_json_line(const sonde_json *value);

/** How a text is laid out. */
typedef enum sonde_json_layout {
  SONDE_JSON_COMPACT, /**< no space at all */
  SONDE_JSON_TABS,    /**< a line for each member of an object, a list in one line */
  SONDE_JSON_LINES    /**< a line for each value, indented by two spaces */
} sonde_json_layout;

/** A text that is being written; begins as {.file = ..., .layout = ...}. */
typedef struct sonde_json_out {
  sonde_file *file; /**< borrowed; remembers failures */
  sonde_json_layout layout;
  uint32_t depth;  /**< lists and objects that are open, at most 32 */
  uint32_t lists;  /**< bit k: the one at depth k + 1 is a list */
  uint32_t filled; /**< bit k: the one at depth k + 1 has a value */
} sonde_json_out;

/** Begins an object. @param key of a member; ignored within a list and outermost @thread owner */
SONDE_API void sonde_json_begin_object(sonde_json_out *out, const char *key);
/** Begins a list. @param key as sonde_json_begin_object() @thread owner */
SONDE_API void sonde_json_begin_list(sonde_json_out *out, const char *key);
/** Ends the innermost object or list. @thread owner */
SONDE_API void sonde_json_end(sonde_json_out *out);
/** A text; bytes that are no UTF-8 become U+FFFD each. @thread owner */
SONDE_API void sonde_json_put_text(sonde_json_out *out, const char *key, const char *text);
/** A number in any locale; null when it is not finite. @param digits that count; 0: 15, or 17 where
 * 15 are off by more than one part in 2^52 @thread owner */
SONDE_API void sonde_json_put_real(sonde_json_out *out, const char *key, double value, int digits);
/** @thread owner */
SONDE_API void sonde_json_put_integer(sonde_json_out *out, const char *key, int64_t value);
/** @thread owner */
SONDE_API void sonde_json_put_bool(sonde_json_out *out, const char *key, bool value);

#ifdef __cplusplus
}
#endif

#endif
