// The files of the page that are built into the program.
#ifndef SONDE_SRC_STREAM_PAGE_DATA_H
#define SONDE_SRC_STREAM_PAGE_DATA_H

#include "base/base.h"

typedef struct page_file {
  const char *name;           // path without the leading slash
  const char *type;           // Content-Type
  const unsigned char *bytes; // NULL: not built, served only from a development directory
  size_t size;
  bool gzip;
} page_file;

// The built-in files; *count receives their number. @thread any
const page_file *page_files(uint32_t *count);
// Those of a class's door: /, /class.js, /class.css. @thread any
const page_file *page_class_files(uint32_t *count);

#endif
