// What a class's door answers: its own page, who joins, the teacher's texts; and what of a request
// goes on to a learner's program. Of a request that goes on only the fields that the program reads
// are written anew, so that nothing else of the network reaches it.
#include "stream/door.h"
#include "stream/page_data.h"

#include <ctype.h>
#include <openssl/ssl.h>
#include <string.h>
#include <strings.h>
#include <time.h>

static void reply(door_connection *c, int code, const page_body *body) {
  const char *reason = code == 200 ? "OK" : code == 302 ? "Found" : "Refused";
  page_http_send(&c->answer, code, reason, body);
  door_enter(c, DOOR_ANSWERED);
}

void door_refuse(door_connection *c, int code, const char *sentence) {
  reply(c, code,
        &(page_body){
            .type = "text/plain; charset=utf-8", .bytes = sentence, .size = strlen(sentence)});
}

// A text that is freed when it is sent.
static void reply_copy(door_connection *c, int code, const char *type, const char *text) {
  size_t size = strlen(text);
  char *copy = SONDE_NEW(char, size + 1);
  if (copy) memcpy(copy, text, size);
  reply(c, copy ? code : 503,
        &(page_body){.type = type, .bytes = copy, .size = copy ? size : 0, .owned = copy});
}

// ---- joining

// "%41nna" and "A+B" of a query to UTF-8 without control characters; false when it is anything
// else.
static bool read_name(const char *text, char name[SONDE_DOOR_NAME]) {
  static const char DIGITS[] = "0123456789abcdef";
  size_t size = 0;
  for (const char *p = text; *p; ++p) {
    unsigned char byte = *p == '+' ? ' ' : (unsigned char)*p;
    if (*p == '%') {
      const char *high = p[1] ? strchr(DIGITS, tolower((unsigned char)p[1])) : NULL;
      const char *low = high && p[2] ? strchr(DIGITS, tolower((unsigned char)p[2])) : NULL;
      if (!low) return false;
      byte = (unsigned char)((high - DIGITS) * 16 + (low - DIGITS));
      p += 2;
    }
    if (byte < 0x20 || byte == 0x7f || size == SONDE_DOOR_NAME - 1) return false;
    if (byte != ' ' || size > 0) name[size++] = (char)byte; // no blanks at its beginning
  }
  while (size > 0 && name[size - 1] == ' ') --size; // nor at its end
  name[size] = 0;
  return size > 0;
}

// Every code, right or wrong, is looked at after a while only (door_admit): who guesses has as many
// tries in that time as there are connections, and learns nothing from one that was pushed out.
static void join(door_connection *c, const page_request *request) {
  char text[PAGE_PATH_TEXT], role[16] = "learner";
  bool named =
      page_request_parameter(request, "name", text, sizeof text) && read_name(text, c->name);
  (void)page_request_parameter(request, "role", role, sizeof role);
  c->watches = strcmp(role, "watcher") == 0;
  if (!named || (!c->watches && strcmp(role, "learner") != 0)) {
    door_refuse(c, 400, "who joins says a name of at most 47 bytes, and learner or watcher\n");
    return;
  }
  size_t size = 0;
  c->code[0] = 0;
  // The code may come as it is written on a board: abcd-efgh.
  for (const char *p = page_request_bearer(request); *p; ++p) {
    if (*p == '-' || *p == ' ') continue;
    if (size < SONDE_DOOR_CODE - 1) c->code[size] = (char)toupper((unsigned char)*p);
    if (++size < SONDE_DOOR_CODE) c->code[size] = 0;
  }
  if (size >= SONDE_DOOR_CODE) c->code[0] = 0; // too long: wrong
  door_enter(c, DOOR_JOINS);
}

void door_admit(sonde_door *door, door_connection *c) {
  char text[SONDE_DOOR_ANSWER] = "";
  if (!page_secret_equal(door->code, c->code)) {
    atomic_fetch_add(&door->wrong, 1);
    door_refuse(c, 401, "that is not the code of this class\n");
    return;
  }
  int code = door->def.join(door->def.user, c->name, c->watches, text);
  reply_copy(c, code, code == 200 ? "application/json" : "text/plain; charset=utf-8", text);
}

// ---- learning management systems

// /lms links a ticket to the learner whose secret comes with it; /lms.json is what the ticket's
// holder reads. A ticket that comes again keeps its time: its exams still count.
static bool reply_lms(sonde_door *door, door_connection *c, const page_request *request) {
  const bool reads = strcmp(request->path, "/lms.json") == 0;
  char given[SONDE_DOOR_TICKET], *text = NULL;
  if (!reads && strcmp(request->path, "/lms") != 0) return false;
  if (!door->def.learner_tokens ||
      !page_request_parameter(request, "ticket", given, sizeof given) ||
      strspn(given, "0123456789abcdef") != sizeof given - 1) {
    door_refuse(c, 404, "a ticket is 32 hexadecimal digits\n");
    return true;
  }
  uint32_t place = 0;
  for (uint32_t i = 0; i < door->def.places; ++i) {
    const char *own = reads ? door->ticket[i].text : door->def.learner_tokens[i];
    if (page_secret_equal(own, reads ? given : page_request_bearer(request))) place = i + 1;
  }
  int code = place ? 200 : reads ? 404 : 401;
  if (!place) {
    // A system asks from its first second on, before the learner has joined: that is no guess.
    if (!reads) atomic_fetch_add(&door->wrong, 1);
  } else if (reads) {
    code = door->def.follow(door->def.user, place, door->ticket[place - 1].since_unix_s, &text);
  } else {
    door_ticket *own = &door->ticket[place - 1];
    if (strcmp(own->text, given) != 0) own->since_unix_s = (int64_t)time(NULL);
    memcpy(own->text, given, sizeof own->text);
  }
  reply(c, code,
        &(page_body){.type = "application/json",
                     .bytes = text ? text : "{}",
                     .size = text ? strlen(text) : 2,
                     .owned = text,
                     .shared = reads});
  return true;
}

// ---- going on to a learner's program

static void pass_on(sonde_door *door, door_connection *c, const page_request *request, size_t size,
                    unsigned long place, const char *path) {
  static const char *const FIELDS[PAGE_FIELDS] = {[PAGE_UPGRADE] = "Connection: Upgrade\r\nUpgrade",
                                                  [PAGE_WS_KEY] = "Sec-WebSocket-Key",
                                                  [PAGE_WS_VERSION] = "Sec-WebSocket-Version",
                                                  [PAGE_WS_PROTOCOL] = "Sec-WebSocket-Protocol",
                                                  [PAGE_AUTHORIZATION] = "Authorization"};
  char head[PAGE_HEAD_BYTES / 4];
  const unsigned port = door->def.first_port + (unsigned)place - 1;
  int used = snprintf(head, sizeof head, "%s %s%s%s HTTP/1.1\r\nHost: 127.0.0.1:%u\r\n",
                      request->method, path, request->query[0] ? "?" : "", request->query, port);
  for (int i = 0; i < PAGE_FIELDS; ++i)
    if (FIELDS[i] && request->given[i])
      used += snprintf(head + used, sizeof head - (size_t)used, "%s: %s\r\n", FIELDS[i],
                       request->field[i]);
  used += snprintf(head + used, sizeof head - (size_t)used, "\r\n");
  SONDE_ASSERT((size_t)used < sizeof head && size >= 4 && size <= c->in->to);
  // A browser's page says where it is from: only the door's own may open a WebSocket.
  static const char SCHEME[] = "https://";
  const char *origin = request->field[PAGE_ORIGIN], *host = request->field[PAGE_HOST];
  if (request->given[PAGE_ORIGIN] && (strncmp(origin, SCHEME, sizeof SCHEME - 1) != 0 || !host[0] ||
                                      strcasecmp(origin + sizeof SCHEME - 1, host) != 0)) {
    door_refuse(c, 403, "only this class's own pages may connect\n");
  } else if (!door_reach(c, (uint16_t)port)) {
    door_refuse(c, 502, "the learner's program is not there yet\n");
  } else {
    size_t rest = c->in->to - size; // what came behind the head
    memmove(c->in->bytes + used, c->in->bytes + size, rest);
    memcpy(c->in->bytes, head, (size_t)used);
    c->in->to = (size_t)used + rest;
    door_enter(c, DOOR_RELAYS);
  }
}

// ---- a request

static bool reply_text(sonde_door *door, door_connection *c, const page_request *request) {
  static const struct {
    const char *path, *type;
  } TEXTS[SONDE_DOOR_TEXTS] = {
      [SONDE_DOOR_CLASS] = {"/class.json", "application/json"},
      [SONDE_DOOR_RESULTS] = {"/results.json", "application/json"},
      [SONDE_DOOR_TABLE] = {"/results.csv", "text/csv; charset=utf-8"},
      [SONDE_DOOR_STATEMENTS] = {"/statements.jsonl", "application/x-ndjson"}};
  for (int i = 0; i < SONDE_DOOR_TEXTS; ++i) {
    if (strcmp(request->path, TEXTS[i].path) != 0) continue;
    if (!page_secret_equal(door->teacher_token, page_request_bearer(request))) {
      atomic_fetch_add(&door->wrong, 1);
      door_refuse(c, 401, "open the teacher's address that the program printed\n");
      return true;
    }
    pthread_mutex_lock(&door->lock);
    reply_copy(c, 200, TEXTS[i].type, door->text[i] ? door->text[i] : "{}");
    pthread_mutex_unlock(&door->lock);
    return true;
  }
  return false;
}

void door_answer(sonde_door *door, door_connection *c, size_t size) {
  page_request request;
  int refused = page_request_parse((const char *)c->in->bytes, size, &request);
  char *end = NULL;
  unsigned long place =
      !refused && isdigit((unsigned char)request.path[1]) ? strtoul(request.path + 1, &end, 10) : 0;
  bool is_place = end && (*end == '/' || !*end);
  if (refused) {
    door_refuse(c, refused, "this is not a request that a class's page makes\n");
  } else if (strcmp(request.method, "GET") != 0 && strcmp(request.method, "HEAD") != 0) {
    door_refuse(c, 405, "only GET and HEAD\n");
  } else if (is_place && (place < 1 || place > door->def.places)) {
    door_refuse(c, 404, "there is no such place in this class\n");
  } else if (is_place && !*end) {
    door_refuse(c, 404, "a place's address ends with /\n");
  } else if (is_place) {
    pass_on(door, c, &request, size, place, end);
  } else if (strcmp(request.path, "/join") == 0) {
    join(c, &request);
  } else if (!reply_lms(door, c, &request) && !reply_text(door, c, &request)) {
    uint32_t count, i = 0;
    const page_file *files = page_class_files(&count);
    while (i < count && strcmp(request.path + 1, files[i].name) != 0) ++i;
    if (i < count)
      reply(c, 200,
            &(page_body){.type = files[i].type,
                         .bytes = files[i].bytes,
                         .size = files[i].size,
                         .gzip = files[i].gzip});
    else
      door_refuse(c, 404, "there is no such file\n");
  }
  if (!refused && strcmp(request.method, "HEAD") == 0 && c->stage == DOOR_ANSWERED)
    c->answer.body_size = 0;
}
