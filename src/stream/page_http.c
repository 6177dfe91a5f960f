// The HTTP side: loopback names only, the page, the exams, strict headers.
//
// is_local            "127.0.0.1" or "localhost" followed by our port
// send_head           status line and security headers
// send_refusal        a short text answer
// send_file           a built-in file, or one from the development directory
// read_id, send_document, answer_document   report and data of an exam
// send_status         what the program says of itself
// page_http_request   everything but the WebSocket
#include "stream/page_data.h"
#include "stream/page_server.h"

#include <inttypes.h>
#include <string.h>

// host[:port]; the port may be missing only when it is the default of HTTP.
static bool is_local(const char *authority, uint16_t port) {
  static const char *const NAMES[] = {"127.0.0.1", "localhost"};
  for (size_t i = 0; i < SONDE_COUNT_OF(NAMES); ++i) {
    char expected[32];
    snprintf(expected, sizeof expected, "%s:%u", NAMES[i], (unsigned)port);
    if (strcmp(authority, expected) == 0) return true;
    if (port == 80 && strcmp(authority, NAMES[i]) == 0) return true;
  }
  return false;
}

bool page_host_allowed(const char *host, uint16_t port) { return host && is_local(host, port); }

bool page_origin_allowed(const char *origin, uint16_t port) {
  if (!origin) return true;
  static const char SCHEME[] = "http://";
  if (strncmp(origin, SCHEME, sizeof SCHEME - 1) != 0) return false;
  return is_local(origin + sizeof SCHEME - 1, port);
}

static const char PAGE_POLICY[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

static void send_head(struct mg_connection *connection, int code, const char *reason,
                      const char *type, size_t size, bool gzip, const char *policy) {
  mg_printf(connection,
            "HTTP/1.1 %d %s\r\n"
            "Content-Type: %s\r\n"
            "Content-Length: %zu\r\n"
            "%s"
            "Cache-Control: no-store\r\n"
            "Content-Security-Policy: %s\r\n"
            "X-Content-Type-Options: nosniff\r\n"
            "Referrer-Policy: no-referrer\r\n"
            "Cross-Origin-Resource-Policy: same-origin\r\n"
            "Cross-Origin-Opener-Policy: same-origin\r\n"
            "Connection: close\r\n\r\n",
            code, reason, type, size, gzip ? "Content-Encoding: gzip\r\n" : "", policy);
}

static int send_refusal(struct mg_connection *connection, int code, const char *reason,
                        const char *sentence) {
  send_head(connection, code, reason, "text/plain; charset=utf-8", strlen(sentence), false,
            PAGE_POLICY);
  mg_write(connection, sentence, strlen(sentence));
  return code;
}

static int send_bytes(struct mg_connection *connection, const page_file *file, const void *bytes,
                      size_t size, bool gzip) {
  send_head(connection, 200, "OK", file->type, size, gzip, PAGE_POLICY);
  if (strcmp(mg_get_request_info(connection)->request_method, "HEAD") != 0)
    mg_write(connection, bytes, size);
  return 200;
}

// `file` names one of the built-in files, so no request can reach outside of the directory.
static int send_file(const sonde_page_server *server, struct mg_connection *connection,
                     const page_file *file) {
  if (!server->data_directory[0] && !file->bytes)
    return send_refusal(connection, 404, "Not Found", "this build has no page\n");
  if (!server->data_directory[0])
    return send_bytes(connection, file, file->bytes, file->size, file->gzip);
  char path[640], *bytes = NULL;
  size_t size = 0;
  snprintf(path, sizeof path, "%s/%s", server->data_directory, file->name);
  if (sonde_file_load(path, &bytes, &size, NULL))
    return send_refusal(connection, 404, "Not Found", "the file is not in the page's directory\n");
  int code = send_bytes(connection, file, bytes, size, false);
  sonde_free(bytes);
  return code;
}

// Scripts stay forbidden in a report; its style is its own.
static const char REPORT_POLICY[] =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

typedef struct exam_document {
  const char *prefix, *suffix; // of the address, around the exam's id
  const char *name, *type, *policy;
} exam_document;

static const exam_document DOCUMENTS[] = {
    {"/report/", "", "report.html", "text/html; charset=utf-8", REPORT_POLICY},
    {"/exam/", ".json", "exam.json", "application/json", PAGE_POLICY},
    {"/exam/", ".csv", "exam.csv", "text/csv; charset=utf-8", PAGE_POLICY},
};

// An id is lower-case letters, digits and '-', so that it names one directory and nothing else.
static bool read_id(const char *uri, const exam_document *document, char *id, size_t size) {
  size_t prefix = strlen(document->prefix), suffix = strlen(document->suffix), all = strlen(uri);
  if (all <= prefix + suffix || all - prefix - suffix >= size) return false;
  if (strncmp(uri, document->prefix, prefix) != 0) return false;
  if (strcmp(uri + all - suffix, document->suffix) != 0) return false;
  snprintf(id, size, "%.*s", (int)(all - prefix - suffix), uri + prefix);
  return strspn(id, "abcdefghijklmnopqrstuvwxyz0123456789-") == strlen(id);
}

static int send_document(const sonde_page_server *server, struct mg_connection *connection,
                         const exam_document *document, const char *id) {
  char path[640], *bytes = NULL;
  size_t size = 0;
  snprintf(path, sizeof path, "%s/%s/%s", server->exams_directory, id, document->name);
  if (sonde_file_load(path, &bytes, &size, NULL))
    return send_refusal(connection, 404, "Not Found", "there is no such exam\n");
  send_head(connection, 200, "OK", document->type, size, false, document->policy);
  if (strcmp(mg_get_request_info(connection)->request_method, "HEAD") != 0)
    mg_write(connection, bytes, size);
  sonde_free(bytes);
  return 200;
}

// 0 when the address is not one of an exam.
static int answer_document(const sonde_page_server *server, struct mg_connection *connection,
                           const char *uri) {
  char id[64];
  for (size_t i = 0; server->exams_directory[0] && i < SONDE_COUNT_OF(DOCUMENTS); ++i)
    if (read_id(uri, &DOCUMENTS[i], id, sizeof id))
      return send_document(server, connection, &DOCUMENTS[i], id);
  return 0;
}

static int send_status(sonde_page_server *server, struct mg_connection *connection) {
  char text[1024];
  pthread_mutex_lock(&server->lock);
  const char *newest = server->topic[SONDE_PAGE_STATUS].text;
  snprintf(text, sizeof text, "%s", newest ? newest : "{}");
  pthread_mutex_unlock(&server->lock);
  send_head(connection, 200, "OK", "application/json", strlen(text), false, PAGE_POLICY);
  mg_write(connection, text, strlen(text));
  return 200;
}

static const page_file *find_file(const char *uri) {
  uint32_t count;
  const page_file *files = page_files(&count);
  const char *name = strcmp(uri, "/") == 0 ? "/index.html" : uri;
  SONDE_ASSERT(files && count > 0);
  for (uint32_t i = 0; i < count; ++i)
    if (name[0] == '/' && strcmp(name + 1, files[i].name) == 0) return &files[i];
  return NULL;
}

int page_http_request(struct mg_connection *connection) {
  const struct mg_request_info *request = mg_get_request_info(connection);
  sonde_page_server *server = request->user_data;
  const char *uri = request->local_uri;
  SONDE_ASSERT(server && uri && request->request_method);
  if (!page_host_allowed(mg_get_header(connection, "Host"), server->port))
    return send_refusal(connection, 403, "Forbidden",
                        "this server answers only to 127.0.0.1 and localhost\n");
  if (strcmp(uri, "/ws") == 0) {
    if (mg_get_header(connection, "Upgrade")) return 0; // on to the WebSocket handlers
    return send_refusal(connection, 426, "Upgrade Required", "/ws is a WebSocket\n");
  }
  if (strcmp(request->request_method, "GET") != 0 && strcmp(request->request_method, "HEAD") != 0)
    return send_refusal(connection, 405, "Method Not Allowed", "only GET and HEAD\n");
  if (strcmp(uri, "/favicon.ico") == 0) {
    send_head(connection, 204, "No Content", "image/x-icon", 0, false, PAGE_POLICY);
    return 204;
  }
  if (strcmp(uri, "/status.json") == 0) return send_status(server, connection);
  int answered = answer_document(server, connection, uri);
  if (answered) return answered;
  const page_file *file = find_file(uri);
  if (!file) return send_refusal(connection, 404, "Not Found", "there is no such file\n");
  return send_file(server, connection, file);
}
