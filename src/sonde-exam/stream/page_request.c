// Head of an HTTP request (RFC 9112), as far as browsers send it to this server.
#include "stream/page_request.h"

#include <string.h>
#include <strings.h>

size_t page_request_size(const char *bytes, size_t count) {
  for (size_t i = 3; i < count; ++i)
    if (bytes[i] == '\n' && memcmp(bytes + i - 3, "\r\n\r\n", 4) == 0) return i + 1;
  return 0;
}

static bool take(const char *from, size_t count, char *to, size_t size) {
  if (count >= size) return false;
  memcpy(to, from, count);
  to[count] = 0;
  return true;
}

// "GET /path?query HTTP/1.1" without the line's end.
static int parse_line(const char *line, size_t count, page_request *request) {
  const char *first = memchr(line, ' ', count);
  if (!first) return 400;
  const char *target = first + 1;
  const char *second = memchr(target, ' ', count - (size_t)(target - line));
  if (!second || !take(line, (size_t)(first - line), request->method, sizeof request->method))
    return 400;
  size_t version = count - (size_t)(second + 1 - line);
  if (version != 8 ||
      (memcmp(second + 1, "HTTP/1.1", 8) != 0 && memcmp(second + 1, "HTTP/1.0", 8) != 0))
    return 505;
  const char *query = memchr(target, '?', (size_t)(second - target));
  size_t path = (size_t)((query ? query : second) - target);
  if (path == 0 || target[0] != '/') return 400;
  if (!take(target, path, request->path, sizeof request->path)) return 414;
  if (query &&
      !take(query + 1, (size_t)(second - query - 1), request->query, sizeof request->query))
    return 414;
  return 0;
}

// A field that comes twice is refused: two readers might choose differently.
static int parse_field(const char *line, size_t count, page_request *request) {
  static const char *const NAMES[PAGE_FIELDS] = {"Host",
                                                 "Origin",
                                                 "Upgrade",
                                                 "Sec-WebSocket-Key",
                                                 "Sec-WebSocket-Version",
                                                 "Sec-WebSocket-Protocol",
                                                 "Authorization"};
  const char *colon = memchr(line, ':', count);
  if (!colon || colon == line || line[0] == ' ' || line[0] == '\t') return 400;
  size_t name = (size_t)(colon - line);
  const char *value = colon + 1, *end = line + count;
  while (value < end && (*value == ' ' || *value == '\t')) ++value;
  while (end > value && (end[-1] == ' ' || end[-1] == '\t')) --end;
  for (int i = 0; i < PAGE_FIELDS; ++i) {
    if (strlen(NAMES[i]) != name || strncasecmp(NAMES[i], line, name) != 0) continue;
    if (request->given[i]) return 400;
    request->given[i] = true;
    return take(value, (size_t)(end - value), request->field[i], PAGE_FIELD_TEXT) ? 0 : 431;
  }
  return 0;
}

int page_request_parse(const char *bytes, size_t size, page_request *request) {
  SONDE_ASSERT(bytes && request && size >= 4);
  *request = (page_request){0};
  if (memchr(bytes, 0, size)) return 400;
  bool first = true;
  const char *end = bytes + size - 2; // the empty line
  for (const char *line = bytes; line < end;) {
    const char *stop = memchr(line, '\r', (size_t)(end - line));
    if (!stop || stop[1] != '\n') return 400;
    size_t count = (size_t)(stop - line);
    int refused = first ? parse_line(line, count, request) : parse_field(line, count, request);
    if (refused) return refused;
    first = false;
    line = stop + 2;
  }
  return first ? 400 : 0;
}

bool page_request_parameter(const page_request *request, const char *name, char *value,
                            size_t size) {
  SONDE_ASSERT(request && name[0] && value && size > 0);
  size_t length = strlen(name);
  for (const char *p = request->query; *p;) {
    size_t count = strcspn(p, "&");
    if (count > length && p[length] == '=' && strncmp(p, name, length) == 0)
      return take(p + length + 1, count - length - 1, value, size);
    p += count + (p[count] == '&');
  }
  return false;
}

const char *page_request_bearer(const page_request *request) {
  static const char SCHEME[] = "Bearer ";
  const char *field = request->field[PAGE_AUTHORIZATION];
  return strncasecmp(field, SCHEME, sizeof SCHEME - 1) == 0 ? field + sizeof SCHEME - 1 : "";
}
