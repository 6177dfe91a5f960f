// The HTTP side: loopback names only, the page for everyone, everything else for who has the token.
#include "stream/page_data.h"
#include "stream/page_server.h"

#include <fcntl.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

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

void page_http_send(page_out *out, int code, const char *reason, const page_body *body) {
  int size =
      snprintf(out->head, sizeof out->head,
               "HTTP/1.1 %d %s\r\n"
               "Content-Type: %s\r\n"
               "Content-Length: %zu\r\n"
               "%s%s"
               "Cache-Control: no-store\r\n"
               "Content-Security-Policy: %s\r\n"
               "X-Content-Type-Options: nosniff\r\n"
               "Referrer-Policy: no-referrer\r\n"
               "Cross-Origin-Resource-Policy: same-origin\r\n"
               "Cross-Origin-Opener-Policy: same-origin\r\n"
               "Connection: close\r\n\r\n",
               code, reason, body->type, body->size, body->gzip ? "Content-Encoding: gzip\r\n" : "",
               body->shared ? "Access-Control-Allow-Origin: *\r\n" : "",
               body->policy ? body->policy : PAGE_POLICY);
  SONDE_ASSERT(size > 0 && (size_t)size < sizeof out->head);
  out->head_size = (size_t)size;
  out->body = body->bytes;
  out->body_size = body->size;
  out->owned = body->owned;
  out->mapped = body->mapped;
  out->done = 0;
}

static void send_refusal(page_out *out, int code, const char *reason, const char *sentence) {
  page_http_send(out, code, reason,
                 &(page_body){.type = "text/plain; charset=utf-8",
                              .bytes = sentence,
                              .size = strlen(sentence)});
}

void page_http_refuse(page_out *out, int code) {
  const char *reason = code == 431   ? "Request Header Fields Too Large"
                       : code == 414 ? "URI Too Long"
                       : code == 505 ? "HTTP Version Not Supported"
                                     : "Bad Request";
  send_refusal(out, code, reason, "this is not a request that the page makes\n");
}

// `file` names one of the built-in files, so no request can reach outside of the directory.
static void send_file(const sonde_page_server *server, const page_file *file, page_out *out) {
  page_body body = {
      .type = file->type, .bytes = file->bytes, .size = file->size, .gzip = file->gzip};
  if (!server->data_directory[0] && !file->bytes) {
    send_refusal(out, 404, "Not Found", "this build has no page\n");
    return;
  }
  if (server->data_directory[0]) {
    char path[640], *bytes = NULL;
    snprintf(path, sizeof path, "%s/%s", server->data_directory, file->name);
    if (sonde_file_load(path, &bytes, &body.size, NULL)) {
      send_refusal(out, 404, "Not Found", "the file is not in the page's directory\n");
      return;
    }
    body.bytes = body.owned = bytes;
    body.gzip = false;
  }
  page_http_send(out, 200, "OK", &body);
}

// ---- who may have what

static bool knows_token(const sonde_page_server *server, const page_request *request) {
  const char *given = page_request_bearer(request);
  bool learner = page_secret_equal(server->token, given);
  bool watcher = page_secret_equal(server->watcher_token, given);
  return page_secret_equal(server->teacher_token, given) || learner || watcher;
}

static void send_stranger(page_out *out) {
  send_refusal(out, 401, "Unauthorized",
               "open the address that the program printed: it has the token that this asks for\n");
}

// ---- exams

// A report is drawn by its own script, in an origin of its own: it cannot act on the page's behalf.
static const char REPORT_POLICY[] =
    "sandbox allow-scripts allow-downloads allow-modals; default-src 'none'; script-src "
    "'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

typedef struct exam_document {
  const char *prefix, *suffix;      // of the address, around the exam's id
  const char *name, *type, *policy; // name: of the file; before a number, its beginning
} exam_document;

static const exam_document DOCUMENTS[] = {
    {"/report/", "", "report.html", "text/html; charset=utf-8", REPORT_POLICY},
    {"/exam/", ".json", "exam.json", "application/json", NULL},
    {"/exam/", ".csv", "exam.csv", "text/csv; charset=utf-8", NULL},
    {"/worksheet/", ".json", "worksheet.json", "application/json", NULL},
    {"/worksheet/", ".csv", "worksheet.csv", "text/csv; charset=utf-8", NULL},
    {"/worksheet/", ".png", "worksheet-", "image/png", NULL}, // ID/NUMBER
    {"/worksheet/", ".dcm", "worksheet-", "application/dicom", NULL},
    {"/worksheet/", ".dcm", "worksheet.dcm", "application/dicom", NULL},
    {"/export/", ".dcm", "export-", "application/dicom", NULL}, // of gigabytes
    {"/export/", ".igs.mha", "export-", "application/octet-stream", NULL},
    {"/export/", ".seq.nrrd", "export-", "application/octet-stream", NULL},
};

// False when the address is not one of an exam.
static bool answer_document(const sonde_page_server *server, const page_request *request,
                            page_out *out) {
  const char *uri = request->path;
  const size_t all = strlen(uri);
  for (size_t i = 0; server->exams_directory[0] && i < SONDE_COUNT_OF(DOCUMENTS); ++i) {
    // An id is lower-case letters, digits and '-', so that it names one directory and nothing else.
    const exam_document *d = &DOCUMENTS[i];
    char id[64], given[64], key[PAGE_SECRET_TEXT], name[40];
    size_t prefix = strlen(d->prefix), suffix = strlen(d->suffix);
    if (all <= prefix + suffix || all - prefix - suffix >= sizeof id) continue;
    if (strncmp(uri, d->prefix, prefix) || strcmp(uri + all - suffix, d->suffix)) continue;
    snprintf(id, sizeof id, "%.*s", (int)(all - prefix - suffix), uri + prefix);
    snprintf(name, sizeof name, "%s", d->name);
    char *number = strchr(id, '/');
    const bool numbered = d->name[strlen(d->name) - 1] == '-';
    if (numbered != (number != NULL)) continue;
    if (number) { // at most six digits
      *number++ = 0;
      const size_t digits = strspn(number, "0123456789");
      if (digits == 0 || digits > 6 || number[digits]) continue;
      snprintf(name, sizeof name, "%s%s%s", d->name, number, d->suffix);
    }
    if (!id[0] || id[strspn(id, "abcdefghijklmnopqrstuvwxyz0123456789-")]) continue;
    // The address of a document says its own key, so that it opens in another tab and opens nothing
    // else.
    bool known = knows_token(server, request);
    if (!known && page_request_parameter(request, "key", given, sizeof given)) {
      page_document_key(server->token, uri, key);
      known = page_secret_equal(key, given);
    }
    char path[640], *bytes = NULL;
    page_body body = {.type = d->type, .policy = d->policy};
    snprintf(path, sizeof path, "%s/%s/%s", server->exams_directory, id, name);
    const int file =
        known && strcmp(d->prefix, "/export/") == 0 ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    struct stat facts;
    if (file >= 0 && fstat(file, &facts) == 0 && S_ISREG(facts.st_mode) && facts.st_size > 0) {
      // A sequence is not read, but mapped: it was given its name when it was whole.
      body.size = body.mapped = (size_t)facts.st_size;
      void *map = mmap(NULL, body.size, PROT_READ, MAP_PRIVATE, file, 0);
      body.bytes = body.owned = map == MAP_FAILED ? NULL : map;
    }
    if (file >= 0) close(file);
    if (!known) {
      send_stranger(out);
    } else if (body.owned) {
      page_http_send(out, 200, "OK", &body);
    } else if (sonde_file_load(path, &bytes, &body.size, NULL)) {
      send_refusal(out, 404, "Not Found", "there is no such exam\n");
    } else {
      body.bytes = body.owned = bytes;
      page_http_send(out, 200, "OK", &body);
    }
    return true;
  }
  return false;
}

// ---- the WebSocket

static void upgrade(sonde_page_server *server, const page_request *request, page_out *out,
                    page_client **client) {
  const char *origin = request->given[PAGE_ORIGIN] ? request->field[PAGE_ORIGIN] : NULL;
  const char *key = request->field[PAGE_WS_KEY];
  // The token is one of the subprotocols that the client offers: a browser cannot send it in
  // another field, and an address would be written down. Every offer is compared, whatever came
  // before.
  page_who who = PAGE_NOBODY;
  for (const char *p = request->field[PAGE_WS_PROTOCOL]; *p;) {
    size_t count = strcspn(p, ", ");
    char word[PAGE_FIELD_TEXT];
    snprintf(word, sizeof word, "%.*s", (int)count, p);
    if (page_secret_equal(server->token, word)) who = PAGE_LEARNER;
    if (page_secret_equal(server->watcher_token, word)) who = PAGE_WATCHER;
    if (page_secret_equal(server->teacher_token, word)) who = PAGE_TEACHER;
    p += count + strspn(p + count, ", ");
  }
  char id[PAGE_SECRET_TEXT];
  if (!page_request_parameter(request, "client", id, sizeof id) || !sonde_page_token_valid(id))
    id[0] = 0;
  if (!page_origin_allowed(origin, server->port)) {
    send_refusal(out, 403, "Forbidden", "only this server's own page may connect\n");
  } else if (who == PAGE_NOBODY) {
    send_stranger(out);
  } else if (strcasecmp(request->field[PAGE_UPGRADE], "websocket") != 0 || strlen(key) != 24 ||
             strcmp(request->field[PAGE_WS_VERSION], "13") != 0) {
    page_http_refuse(out, 400);
  } else if (!(*client = page_client_join(server, id, who))) {
    send_refusal(out, 503, "Service Unavailable", "no more pages can connect\n");
  } else {
    char accept[PAGE_ACCEPT_TEXT];
    page_accept_key(key, accept);
    int size = snprintf(out->head, sizeof out->head,
                        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                        "Connection: Upgrade\r\nSec-WebSocket-Accept: %s\r\n"
                        "Sec-WebSocket-Protocol: sonde\r\n\r\n",
                        accept);
    out->head_size = (size_t)size;
  }
}

// ---- a request

void page_http_answer(sonde_page_server *server, const char *head, size_t size, page_out *out,
                      page_client **client) {
  page_request request;
  SONDE_ASSERT(server && head && out && client && !*client);
  *out = (page_out){0};
  int refused = page_request_parse(head, size, &request);
  if (refused)
    page_http_refuse(out, refused);
  else {
    if (!page_host_allowed(request.field[PAGE_HOST], server->port)) {
      send_refusal(out, 403, "Forbidden", "this server answers only to 127.0.0.1 and localhost\n");
    } else if (strcmp(request.method, "GET") != 0 && strcmp(request.method, "HEAD") != 0) {
      send_refusal(out, 405, "Method Not Allowed", "only GET and HEAD\n");
    } else if (strcmp(request.path, "/ws") == 0) {
      if (request.given[PAGE_UPGRADE])
        upgrade(server, &request, out, client);
      else
        send_refusal(out, 426, "Upgrade Required", "/ws is a WebSocket\n");
    } else if (strcmp(request.path, "/favicon.ico") == 0) {
      page_http_send(out, 204, "No Content", &(page_body){.type = "image/x-icon"});
    } else if (strcmp(request.path, "/status.json") == 0) {
      if (knows_token(server, &request)) {
        pthread_mutex_lock(&server->lock);
        const char *newest = server->topic[SONDE_PAGE_STATUS].text;
        size_t length = newest ? strlen(newest) : 2;
        char *text = SONDE_NEW(char, length);
        if (text) memcpy(text, newest ? newest : "{}", length);
        pthread_mutex_unlock(&server->lock);
        if (!text)
          send_refusal(out, 503, "Service Unavailable", "out of memory\n");
        else
          page_http_send(
              out, 200, "OK",
              &(page_body){
                  .type = "application/json", .bytes = text, .size = length, .owned = text});
      } else
        send_stranger(out);
    } else if (!answer_document(server, &request, out)) {
      uint32_t count, i = 0;
      const page_file *files = page_files(&count), *file = NULL;
      const char *name = strcmp(request.path, "/") == 0 ? "index.html" : request.path + 1;
      for (; i < count && !file; ++i)
        if (strcmp(name, files[i].name) == 0) file = &files[i];
      if (file)
        send_file(server, file, out);
      else
        send_refusal(out, 404, "Not Found", "there is no such file\n");
    }
  }
  if (strcmp(request.method, "HEAD") == 0 && !*client) out->body_size = 0;
}
