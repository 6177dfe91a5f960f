// Limits of what is read. Every reader of a file or of a message takes its limits from here, so
// that no input costs more memory or time than they allow; docs/limits.md lists them for users.
#ifndef SONDE_SRC_BOUNDS_H
#define SONDE_SRC_BOUNDS_H

#include "base/link.h"
#include "base/base.h"

// Limits of one kind of input.
typedef struct sonde_input_limits {
  const char *what;    // the kind in a message, such as "a YAML file"
  uint64_t most_bytes; // of the file
  uint64_t most_items; // nodes of a document, rows of a table, elements of a mesh
  uint32_t most_depth; // levels of nesting; 0: the format does not nest
} sonde_input_limits;

SONDE_LINK extern const sonde_input_limits sonde_limits_yaml;
SONDE_LINK extern const sonde_input_limits sonde_limits_json;
SONDE_LINK extern const sonde_input_limits sonde_limits_xml;
SONDE_LINK extern const sonde_input_limits sonde_limits_mesh;
SONDE_LINK extern const sonde_input_limits sonde_limits_image;
SONDE_LINK extern const sonde_input_limits sonde_limits_recording;
SONDE_LINK extern const sonde_input_limits sonde_limits_snapshot;
extern const sonde_input_limits sonde_limits_table, sonde_limits_model;

// Most bytes that one reader may allocate for what a file describes but does not hold byte by byte,
// such as pixels that are packed.
#define SONDE_MOST_UNPACKED_BYTES ((uint64_t)8 << 30)

// A body of a file reaches no farther from its origin; more is a wrong unit.
#define SONDE_FARTHEST_M 1e4

// Reads a whole file within the limits as sonde_file_load(); a longer one, or a stream that does
// not end, is refused after at most most_bytes. @thread owner
// @return FORMAT naming the limit; IO
SONDE_LINK sonde_status sonde_bounded_load(const char *path, const sonde_input_limits *bounds,
                                           char **bytes, size_t *count, sonde_error *error);
// The same for a text: a byte 0 is refused with its line.
SONDE_LINK sonde_status sonde_bounded_load_text(const char *path, const sonde_input_limits *bounds,
                                                char **text, size_t *count, sonde_error *error);

// Line of a place in a text, from 1. @thread any
SONDE_LINK uint32_t sonde_line_of(const char *text, const char *at);

// Whether the checksum that a file tells is that of its bytes. In a libFuzzer build every checksum
// counts as right, so that changed bytes reach what lies behind it.
static inline bool sonde_checksum_fits(uint64_t told, uint64_t computed) {
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
  (void)told, (void)computed;
  return true;
#else
  return told == computed;
#endif
}

#endif
