// A class's door: what goes through it, who may in, and what strangers on its open port cost the
// others: nothing. Behind it stands a page's server with a synthetic source.
#include "stream/page_fixture.h"

#include "stream/door.h"

#include <openssl/err.h>

static const char CODE[] = "ABCD2345", TEACHER[] = "ffeeddccbbaa99887766554433221100";

typedef struct visitor {
  int socket;
  SSL *tls;
} visitor;

static struct {
  sonde_door *door;
  SSL_CTX *context;
  char pem[SONDE_DOOR_IDENTITY];
  atomic_uint joins;
} at;

static int note_join(void *user, const char *name, bool watches, char answer[SONDE_DOOR_ANSWER]) {
  (void)user;
  atomic_fetch_add(&at.joins, 1);
  if (strcmp(name, "Bo") == 0) {
    snprintf(answer, SONDE_DOOR_ANSWER, "Bo has a place\n");
    return 409;
  }
  snprintf(answer, SONDE_DOOR_ANSWER, "{\"name\":\"%s\",\"watches\":%s}", name,
           watches ? "true" : "false");
  return 200;
}

static const char *const LEARNERS[] = {"0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a",
                                       "0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b"};

static int follow(void *user, uint32_t place, int64_t since_unix_s, char **answer) {
  (void)user;
  *answer = SONDE_NEW(char, 64);
  snprintf(*answer, 64, "{\"place\":%u,\"since\":%lld}", place, (long long)since_unix_s);
  return 200;
}

static int open_door(void **state) {
  if (start_server(state)) return -1;
  fixture *f = *state;
  at.context = SSL_CTX_new(TLS_client_method());
  if (sonde_door_identity_make(at.pem, NULL)) return -1;
  sonde_door_def def = {.address = "127.0.0.1",
                        .identity = at.pem,
                        .code = CODE,
                        .teacher_token = TEACHER,
                        .first_port = f->port,
                        .places = 2,
                        .join = note_join,
                        .learner_tokens = LEARNERS,
                        .follow = follow};
  return (int)sonde_door_open(&def, &at.door, NULL);
}

static int close_door(void **state) {
  sonde_door_close(at.door);
  SSL_CTX_free(at.context);
  return stop_server(state);
}

static visitor come(void) {
  visitor v = {tcp_connect(sonde_door_port(at.door), 0), SSL_new(at.context)};
  SSL_set_fd(v.tls, v.socket);
  assert_int_equal(SSL_connect(v.tls), 1);
  return v;
}

static void leave(visitor *v) {
  SSL_free(v->tls);
  close(v->socket);
}

static void say(visitor *v, const void *bytes, size_t count) {
  assert_int_equal(SSL_write(v->tls, bytes, (int)count), (int)count);
}

// Reads until the text ends with `needle` or the connection ends; true when it does. Looks at the
// end alone: the text may be a megabyte, and comes byte by byte.
static bool hear(visitor *v, const char *needle, char *text, size_t size) {
  const size_t length = strlen(needle);
  size_t count = 0;
  bool heard = false;
  while (count + 1 < size && !heard) {
    int got = SSL_read(v->tls, text + count, 1);
    if (got <= 0) break;
    count += (size_t)got;
    if (!text[count - 1]) text[count - 1] = ' '; // binary messages
    heard = count >= length && memcmp(text + count - length, needle, length) == 0;
  }
  text[count] = 0;
  return heard;
}

// The code of an answer, and its text.
static int ask(const char *path, const char *lines, char text[4096]) {
  char request[1024];
  visitor v = come();
  int size =
      snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nHost: class\r\n%s\r\n", path, lines);
  say(&v, request, (size_t)size);
  (void)hear(&v, "\xff", text, 4096); // all of it
  leave(&v);
  return strlen(text) > 12 ? atoi(text + 9) : 0;
}

static visitor talk(const char *token, const char *lines) {
  char request[640], text[1024];
  visitor v = come();
  int size = snprintf(request, sizeof request,
                      "GET /1/ws HTTP/1.1\r\nHost: class:8443\r\n%sUpgrade: websocket\r\n"
                      "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                      "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: sonde, %s\r\n\r\n",
                      lines, token);
  say(&v, request, (size_t)size);
  assert_true(hear(&v, "\r\n\r\n", text, sizeof text));
  assert_int_equal(atoi(text + 9), 101);
  return v;
}

// A masked text message.
static void tell(visitor *v, const char *text) {
  unsigned char frame[140] = {0x81, (unsigned char)(0x80 | strlen(text)), 1, 2, 3, 4};
  assert_true(strlen(text) < 126);
  for (size_t i = 0; i < strlen(text); ++i)
    frame[6 + i] = (unsigned char)(text[i] ^ frame[2 + i % 4]);
  say(v, frame, 6 + strlen(text));
}

static const char GOAL[] = "{\"type\":\"goal\",\"position_mm\":[1,2,3],\"rotation\":[1,0,0,0]}";

static void a_page_goes_through_the_door(void **state) {
  fixture *f = *state;
  char text[4096];
  assert_int_equal(ask("/1/", "", text), 200);
  assert_int_equal(ask("/1/status.json", "", text), 401);
  assert_int_equal(
      ask("/1/status.json", "Authorization: Bearer 00112233445566778899aabbccddeeff\r\n", text),
      200);
  visitor v = talk(WS_TOKEN, "Origin: https://class:8443\r\n");
  char *much = SONDE_NEW(char, 1 << 20);
  assert_true(hear(&v, "\"type\":\"hello\"", much, 1 << 20));
  assert_true(hear(&v, "\"controls\":true", much, 1 << 20));
  for (int frames = 0; frames < 40;) { // more than all buffers on the way hold
    unsigned char rest[8];             // version, type, sequence
    char ack[64];
    assert_true(hear(&v, "SNDE", much, 1 << 20));
    for (int i = 0; i < 8; ++i) assert_int_equal(SSL_read(v.tls, rest + i, 1), 1);
    if (rest[2] != PAGE_FRAME) continue;
    snprintf(ack, sizeof ack, "{\"type\":\"ack\",\"frame\":%u}",
             rest[4] | (unsigned)rest[5] << 8 | (unsigned)rest[6] << 16);
    tell(&v, ack);
    ++frames;
  }
  tell(&v, GOAL);
  assert_true(reaches(&f->source.goals, 1));
  sonde_free(much);
  leave(&v);
  wait_for_clients(f, 0); // who dies leaves no connection behind
}

static void the_door_asks_who_comes(void **state) {
  (void)state;
  char text[4096];
  assert_int_equal(ask("/", "", text), 200);
  assert_int_equal(ask("/1", "", text), 404);
  assert_int_equal(ask("/3/", "", text), 404);
  assert_int_equal(ask("/2/", "", text), 502); // nobody listens there
  assert_int_equal(ask("/nowhere", "", text), 404);
  assert_int_equal(ask("/1/ws", "Origin: https://elsewhere\r\nUpgrade: websocket\r\n", text), 403);
  assert_int_equal(sonde_door_publish(at.door, SONDE_DOOR_CLASS, "{\"a\":1}", NULL), SONDE_OK);
  uint64_t wrong = sonde_door_wrong(at.door);
  assert_int_equal(ask("/class.json", "", text), 401);
  assert_int_equal(
      ask("/class.json", "Authorization: Bearer 00112233445566778899aabbccddeeff\r\n", text), 401);
  assert_int_equal(sonde_door_wrong(at.door), wrong + 2);
  assert_int_equal(
      ask("/class.json", "Authorization: Bearer ffeeddccbbaa99887766554433221100\r\n", text), 200);
  assert_non_null(strstr(text, "{\"a\":1}"));
}

static void a_code_opens_a_place(void **state) {
  (void)state;
  char text[4096];
  atomic_store(&at.door->code_s, 0.05);
  atomic_store(&at.joins, 0);
  uint64_t wrong = sonde_door_wrong(at.door);
  static const char *const WRONG[] = {"ABCD2346", "ABCD234", "ABCD23455", "", "BBCD2345"};
  for (size_t i = 0; i < SONDE_COUNT_OF(WRONG); ++i) {
    char line[64];
    snprintf(line, sizeof line, "Authorization: Bearer %s\r\n", WRONG[i]);
    assert_int_equal(ask("/join?name=Anna", line, text), 401);
  }
  assert_int_equal(sonde_door_wrong(at.door), wrong + SONDE_COUNT_OF(WRONG));
  assert_int_equal(atomic_load(&at.joins), 0);
  assert_int_equal(ask("/join?name=%C3%84nne+B", "Authorization: Bearer abcd-2345\r\n", text), 200);
  assert_non_null(strstr(text, "{\"name\":\"\xc3\x84nne B\",\"watches\":false}"));
  assert_int_equal(ask("/join?name=Anna&role=watcher", "Authorization: Bearer ABCD2345\r\n", text),
                   200);
  assert_non_null(strstr(text, "\"watches\":true"));
  assert_int_equal(ask("/join?name=Bo", "Authorization: Bearer ABCD2345\r\n", text), 409);
  static const char *const BAD[] = {"/join",
                                    "/join?name=",
                                    "/join?name=%0A",
                                    "/join?name=%4",
                                    "/join?name=Anna&role=teacher",
                                    "/join?name=+"};
  for (size_t i = 0; i < SONDE_COUNT_OF(BAD); ++i)
    assert_int_equal(ask(BAD[i], "Authorization: Bearer ABCD2345\r\n", text), 400);
  atomic_store(&at.door->code_s, 1);
}

// True when the other side has closed.
static bool closed(int s) {
  char byte[256];
  ssize_t got;
  while ((got = recv(s, byte, sizeof byte, 0)) > 0) continue;
  return got == 0 || errno == ECONNRESET;
}

static void strangers_cost_the_others_nothing(void **state) {
  fixture *f = *state;
  enum { MANY = DOOR_CONNECTIONS + 60 };
  static int silent[MANY];
  char text[4096];
  atomic_store(&at.door->ask_s, 1000);
  page_patience usual = f->server->patience, long_one = usual;
  long_one.silent_s = 1000; // neither answers a ping, however long the others take to come
  set_patience(f, long_one);
  visitor learner = talk(WS_TOKEN, ""), stuck = talk(WS_TOKEN, ""); // stuck never reads
  for (int i = 0; i < MANY; ++i) { // half-open: some say nothing, some half a greeting
    silent[i] = tcp_connect(sonde_door_port(at.door), 0);
    if (i % 2)
      assert_int_equal(send(silent[i], "\x16\x03\x01\x02\x00\x01\x00", 7, MSG_NOSIGNAL), 7);
  }
  assert_int_equal(ask("/", "", text), 200); // a newcomer is let in
  tell(&learner, GOAL);                      // who is in stays in
  assert_true(reaches(&f->source.goals, 1));
  assert_true(closed(silent[0])); // the oldest made room

  int garbage = tcp_connect(sonde_door_port(at.door), 0);
  static char noise[20000];
  for (size_t i = 0; i < sizeof noise; ++i) noise[i] = (char)(i * 7 + 1);
  (void)!send(garbage, noise, sizeof noise, MSG_NOSIGNAL);
  assert_true(closed(garbage));
  visitor huge = come(); // a head without an end
  memset(noise, 'a', sizeof noise);
  say(&huge, "GET / HTTP/1.1\r\nX: ", 19);
  say(&huge, noise, 16000);
  say(&huge, noise, 1000);
  assert_true(hear(&huge, "431", text, sizeof text));
  leave(&huge);
  assert_int_equal(ask("/1/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nGET", "", text), 200); // two in one
  assert_null(strstr(text + 12, "HTTP/1.1"));

  visitor slow = come();
  say(&slow, "GET / HT", 8);
  atomic_store(&at.door->ask_s, 0.2);
  assert_false(hear(&slow, "HTTP", text, sizeof text)); // is closed without an answer
  assert_true(closed(silent[MANY - 1]));
  atomic_store(&at.door->ask_s, 10);
  tell(&learner, GOAL);
  assert_true(reaches(&f->source.goals, 2));
  leave(&slow);
  close(garbage);
  for (int i = 0; i < MANY; ++i) close(silent[i]);
  leave(&stuck);
  leave(&learner);
  set_patience(f, usual);
}

static void an_identity_is_a_key_and_its_certificate(void **state) {
  (void)state;
  static char other[SONDE_DOOR_IDENTITY];
  char code[2][SONDE_DOOR_CODE], print[SONDE_DOOR_FINGERPRINT];
  sonde_door *door = NULL;
  assert_int_equal(sonde_door_identity_make(other, NULL), SONDE_OK);
  sonde_door_def def = {.address = "127.0.0.1",
                        .code = CODE,
                        .teacher_token = TEACHER,
                        .places = 1,
                        .join = note_join};
  char *certificate = strstr(other, "-----BEGIN CERTIFICATE");
  assert_non_null(certificate);
  static char mixed[2 * SONDE_DOOR_IDENTITY];
  snprintf(mixed, sizeof mixed, "%.*s%s", (int)(strstr(at.pem, "-----BEGIN CERTIFICATE") - at.pem),
           at.pem, certificate);
  const char *const bad[] = {"", "no PEM", certificate, mixed};
  for (size_t i = 0; i < SONDE_COUNT_OF(bad); ++i) {
    def.identity = bad[i];
    assert_int_equal(sonde_door_open(&def, &door, NULL), SONDE_ARGUMENT);
    assert_null(door);
  }
  def.identity = other;
  def.code = "ABC";
  assert_int_equal(sonde_door_open(&def, &door, NULL), SONDE_ARGUMENT);
  sonde_door_fingerprint(at.door, print);
  assert_int_equal(strlen(print), 95);
  assert_int_equal(strspn(print, "0123456789ABCDEF:"), 95);
  for (int i = 0; i < 2; ++i) assert_int_equal(sonde_door_code_make(code[i], NULL), SONDE_OK);
  assert_string_not_equal(code[0], code[1]);
}

// A ticket leads to the place of the learner who linked it, from any site, and keeps its time.
static void a_ticket_leads_to_its_place(void **state) {
  (void)state;
  static const char SECOND[] = "Authorization: Bearer 0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b\r\n";
  static const char LINK[] = "/lms?ticket=00112233445566778899aabbccddeeff";
  static const char READ[] = "/lms.json?ticket=00112233445566778899aabbccddeeff";
  char text[4096], again[4096];
  uint64_t wrong = sonde_door_wrong(at.door);
  assert_int_equal(ask(READ, SECOND, text), 404);
  assert_int_equal(sonde_door_wrong(at.door), wrong); // a system waits so until somebody joins
  assert_int_equal(ask(LINK, "", text), 401);
  assert_int_equal(ask(LINK, "Authorization: Bearer ffeeddccbbaa99887766554433221100\r\n", text),
                   401); // the teacher's
  assert_null(strstr(text, "Access-Control"));
  assert_int_equal(sonde_door_wrong(at.door), wrong + 2);
  assert_int_equal(ask(LINK, SECOND, text), 200);
  assert_int_equal(ask(READ, "", again), 200);
  assert_non_null(strstr(again, "{\"place\":2,\"since\":1"));
  assert_non_null(strstr(again, "Access-Control-Allow-Origin: *"));
  sleep(2); // whole seconds are told
  assert_int_equal(ask(LINK, SECOND, text), 200);
  assert_int_equal(ask(READ, "", text), 200);
  assert_string_equal(strstr(text, "{\"place"), strstr(again, "{\"place"));
  assert_int_equal(ask("/lms?ticket=0011223344556677889", SECOND, text), 404);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      SERVER_TEST(a_page_goes_through_the_door),
      SERVER_TEST(the_door_asks_who_comes),
      SERVER_TEST(a_code_opens_a_place),
      SERVER_TEST(strangers_cost_the_others_nothing),
      SERVER_TEST(a_ticket_leads_to_its_place),
      SERVER_TEST(an_identity_is_a_key_and_its_certificate),
  };
  return cmocka_run_group_tests(tests, open_door, close_door);
}
