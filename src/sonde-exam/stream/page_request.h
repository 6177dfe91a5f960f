// Head of an HTTP request: bounded, checked, and cut into what the server asks for.
#ifndef SONDE_SRC_STREAM_PAGE_REQUEST_H
#define SONDE_SRC_STREAM_PAGE_REQUEST_H

#include "base/base.h"

enum { PAGE_HEAD_BYTES = 16384, PAGE_PATH_TEXT = 160, PAGE_FIELD_TEXT = 160 };

// Header fields that the server reads, in the order of page_request.field.
typedef enum page_field {
  PAGE_HOST,
  PAGE_ORIGIN,
  PAGE_UPGRADE,
  PAGE_WS_KEY,
  PAGE_WS_VERSION,
  PAGE_WS_PROTOCOL,
  PAGE_AUTHORIZATION,
  PAGE_FIELDS
} page_field;

typedef struct page_request {
  char method[8];
  char path[PAGE_PATH_TEXT];  // before '?', as it came
  char query[PAGE_PATH_TEXT]; // after '?'; empty: none
  bool given[PAGE_FIELDS];
  char field[PAGE_FIELDS][PAGE_FIELD_TEXT];
} page_request;

// Size of the head with its empty line; 0: it is not whole yet. @thread any
size_t page_request_size(const char *bytes, size_t count);
// Parses a whole head. @return 0, or the HTTP status that refuses it: 400, 431 (a field that is
// read is too long), 414 (the path is too long), 505 (not HTTP/1.0 or 1.1) @thread any
int page_request_parse(const char *bytes, size_t size, page_request *request);
// Value of a parameter of the query; false when it is absent or does not fit. @thread any
bool page_request_parameter(const page_request *request, const char *name, char *value,
                            size_t size);
// The secret of the field "Authorization: Bearer SECRET"; empty when the request brings none.
// @thread any
const char *page_request_bearer(const page_request *request);

#endif
