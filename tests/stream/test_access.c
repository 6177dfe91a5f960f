// Who may have what of the page's server, and what strangers and rude clients cost the others.
#include "stream/page_fixture.h"

#include <errno.h>

// ---- frames that break the protocol

// What a client sends first, and the status that answers it (RFC 6455, 7.4.1).
static void rude_frames_close_the_connection(void **state) {
  fixture *f = *state;
  const struct {
    const char *bytes;
    size_t count;
    int status;
  } rude[] = {
      {"\x82\x81\1\2\3\4x", 7, PAGE_CLOSE_DATA},                // binary
      {"\x01\x81\1\2\3\4x", 7, PAGE_CLOSE_DATA},                // a part of a message
      {"\x80\x81\1\2\3\4x", 7, PAGE_CLOSE_DATA},                // goes on with nothing
      {"\xc1\x81\1\2\3\4x", 7, PAGE_CLOSE_PROTOCOL},            // a reserved bit
      {"\x83\x81\1\2\3\4x", 7, PAGE_CLOSE_PROTOCOL},            // a reserved kind
      {"\x89\xfe\0\x80", 4, PAGE_CLOSE_PROTOCOL},               // a ping longer than 125 bytes
      {"\x09\x81\1\2\3\4x", 7, PAGE_CLOSE_PROTOCOL},            // a part of a ping
      {"\x81\x0f{\"type\":\"stop\"}", 17, PAGE_CLOSE_PROTOCOL}, // 5.1: not masked
  };
  for (size_t i = 0; i < SONDE_COUNT_OF(rude); ++i) {
    int s = ws_open(f->port);
    assert_true(s >= 0);
    assert_int_equal(send(s, rude[i].bytes, rude[i].count, MSG_NOSIGNAL), rude[i].count);
    assert_int_equal(ws_close_status(s), rude[i].status);
    close(s);
    wait_for_clients(f, 0);
  }
  assert_int_equal(atomic_load(&f->source.controls), 0); // the stop was not obeyed
}

// The head alone ends the connection: not one byte of such a frame has to be stored.
static void a_long_frame_is_refused_by_its_head(void **state) {
  fixture *f = *state;
  static const char *const HEADS[] = {"\x81\xfe\x10\x01",           // 4097 bytes
                                      "\x81\xff\0\0\0\0\x19\0\0\0", // 400 MB
                                      "\x81\xff\xff\xff\xff\xff\xff\xff\xff\xff"};
  for (size_t i = 0; i < SONDE_COUNT_OF(HEADS); ++i) {
    int s = ws_open(f->port);
    size_t size = i == 0 ? 4 : 10;
    assert_int_equal(send(s, HEADS[i], size, MSG_NOSIGNAL), size);
    assert_int_equal(ws_close_status(s), PAGE_CLOSE_TOO_BIG);
    close(s);
    wait_for_clients(f, 0);
  }
}

// The longest message of its kind that is allowed comes in small pieces, and more than one in a
// piece.
static void a_message_may_come_in_any_pieces(void **state) {
  fixture *f = *state;
  static char text[PAGE_SHORT_BYTES];
  unsigned char frame[PAGE_SHORT_BYTES + 8] = {0x81, 0xfe, PAGE_SHORT_BYTES >> 8,
                                               PAGE_SHORT_BYTES & 0xff}; // mask 0
  memset(text, ' ', sizeof text);
  memcpy(text, "{\"type\":\"ping\",\"id\":7}", 22);
  memcpy(frame + 8, text, sizeof text);
  int s = ws_open(f->port);
  for (size_t at = 0; at < sizeof frame; at += 1024 + 1)
    assert_true(send(s, frame + at, sizeof frame - at < 1025 ? sizeof frame - at : 1025, 0) > 0);
  assert_true(ws_expect(s, "{\"type\":\"pong\",\"id\":7}"));
  static const char TWO[] = "\x81\x96\0\0\0\0{\"type\":\"ping\",\"id\":8}"
                            "\x81\x96\0\0\0\0{\"type\":\"ping\",\"id\":9}";
  assert_int_equal(send(s, TWO, sizeof TWO - 1, 0), sizeof TWO - 1);
  assert_true(ws_expect(s, "\"id\":9}")); // of two pings the later one is answered
  close(s);
}

// ---- the token --------------------------------------------------------------------------------

static void without_the_token_there_is_only_the_page(void **state) {
  fixture *f = *state;
  char host[32], head[2048], lines[256], link[SONDE_PAGE_LINK], other[SONDE_PAGE_LINK];
  snprintf(host, sizeof host, "127.0.0.1:%u", (unsigned)f->port);
  assert_int_equal(get(f->port, "GET", "/", host, head), 200);
  static const char *const WRONG[] = {
      "",
      "Authorization: Bearer \r\n",
      "Authorization: Basic 00112233445566778899aabbccddeeff\r\n",
      "Authorization: Bearer 00112233445566778899aabbccddeef\r\n",
      "Authorization: Bearer 00112233445566778899aabbccddeeff0\r\n",
      "Authorization: Bearer 10112233445566778899aabbccddeeff\r\n",
      "Sec-WebSocket-Protocol: 00112233445566778899aabbccddeeff\r\n"};
  static const char *const DATA[] = {"/export/2026-a1/1.igs.mha", "/worksheet/2026-a1.dcm",
                                     "/worksheet/2026-a1/1.dcm",  "/status.json",
                                     "/report/2026-a1",           "/exam/2026-a1.json",
                                     "/exam/2026-a1.csv"};
  for (size_t i = 0; i < SONDE_COUNT_OF(WRONG); ++i)
    for (size_t k = 0; k < SONDE_COUNT_OF(DATA); ++k)
      assert_int_equal(get_with(f->port, "GET", DATA[k], host, WRONG[i], head), 401);
  snprintf(lines, sizeof lines, "Authorization: Bearer %s\r\n", WS_TOKEN);
  assert_int_equal(get_with(f->port, "GET", "/status.json", host, lines, head), 200);
  assert_int_equal(get_with(f->port, "GET", "/report/2026-a1", host, lines, head), 404);
  // The key of a link opens its own document and no other.
  sonde_page_link(f->server, "/report/2026-a1", link);
  assert_int_equal(get(f->port, "GET", link, host, head), 404);
  snprintf(other, sizeof other, "/report/2026-a2%s", strchr(link, '?'));
  assert_int_equal(get(f->port, "GET", other, host, head), 401);
  snprintf(other, sizeof other, "/status.json%s", strchr(link, '?'));
  assert_int_equal(get(f->port, "GET", other, host, head), 401);
  assert_null(strstr(link, WS_TOKEN));
}

static void without_the_token_there_is_no_socket(void **state) {
  fixture *f = *state;
  char host[32], lines[256];
  snprintf(host, sizeof host, "127.0.0.1:%u", (unsigned)f->port);
  static const char *const WRONG[] = {"",
                                      "sonde",
                                      "sonde, 00112233445566778899aabbccddeef0",
                                      "sonde, 00112233445566778899aabbccddeef",
                                      "sonde,, ,",
                                      "sonde, 00112233445566778899AABBCCDDEEFF"};
  assert_int_equal(ws_open_with(f->port, host, "", 0), -401);
  for (size_t i = 0; i < SONDE_COUNT_OF(WRONG); ++i) {
    snprintf(lines, sizeof lines, "Sec-WebSocket-Protocol: %s\r\n", WRONG[i]);
    assert_int_equal(ws_open_with(f->port, host, lines, 0), -401);
  }
  assert_int_equal(page_server_clients(f->server), 0);
  int s = ws_open(f->port);
  assert_true(s >= 0);
  close(s);
}

static void tokens_are_random_and_have_one_form(void **state) {
  (void)state;
  char a[SONDE_PAGE_TOKEN], b[SONDE_PAGE_TOKEN];
  assert_int_equal(sonde_page_token_make(a, NULL), SONDE_OK);
  assert_int_equal(sonde_page_token_make(b, NULL), SONDE_OK);
  assert_true(sonde_page_token_valid(a) && sonde_page_token_valid(b));
  assert_string_not_equal(a, b);
  assert_false(sonde_page_token_valid(NULL));
  assert_false(sonde_page_token_valid(""));
  assert_false(sonde_page_token_valid("0123456789abcdef0123456789abcdeF"));
  assert_true(page_secret_equal(a, a));
  assert_false(page_secret_equal(a, b));
  assert_false(page_secret_equal("", ""));
  assert_false(page_secret_equal(a, NULL));
}

// FIPS 180-4 and RFC 2202: the hash under handshake and keys.
static void the_hash_gives_the_published_values(void **state) {
  (void)state;
  unsigned char digest[PAGE_SHA1_BYTES];
  static const struct {
    const char *text;
    unsigned char first[4];
  } known[] = {
      {"", {0xda, 0x39, 0xa3, 0xee}},
      {"abc", {0xa9, 0x99, 0x3e, 0x36}},
      {"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", {0x84, 0x98, 0x3e, 0x44}}};
  for (size_t i = 0; i < SONDE_COUNT_OF(known); ++i) {
    page_sha1(known[i].text, strlen(known[i].text), digest);
    assert_memory_equal(digest, known[i].first, 4);
  }
  page_hmac_sha1("Jefe", "what do ya want for nothing?", digest);
  assert_memory_equal(digest, "\xef\xfc\xdf\x6a", 4);
}

// ---- connections that cost others nothing
// --------------------------------------------------------

// No request has to end before the page is served: 40 that are half sent are still open after it.
static void half_open_requests_delay_nobody(void **state) {
  fixture *f = *state;
  enum { HALF = 300 }; // more than there are places
  int half[HALF];
  char host[32], head[2048];
  snprintf(host, sizeof host, "127.0.0.1:%u", (unsigned)f->port);
  page_patience usual = f->server->patience, long_one = usual;
  long_one.ask_s = long_one.silent_s = 1000;
  set_patience(f, long_one);
  int s = ws_open(f->port);
  for (int i = 0; i < HALF; ++i) {
    half[i] = tcp_connect(f->port, 0);
    (void)!send(half[i], "GET / HTTP/1.1\r\n", 16, MSG_NOSIGNAL);
    if (i != 39) continue;
    assert_int_equal(get(f->port, "GET", "/", host, head), 200);
    for (int k = 0; k <= i; ++k) {
      assert_int_equal(recv(half[k], head, 1, MSG_DONTWAIT), -1); // 0: closed
      assert_int_equal(errno, EAGAIN);
    }
  }
  assert_int_equal(get(f->port, "GET", "/", host, head), 200);
  int second = ws_open(f->port); // and pages come in beside them
  assert_true(ws_expect(second, "\"type\":\"hello\""));
  ws_say(s, "{\"type\":\"ping\",\"id\":5}"); // who was in stays in
  assert_true(ws_expect(s, "\"id\":5}"));
  set_patience(f, usual);
  for (int i = 0; i < HALF; ++i) close(half[i]);
  close(s);
  close(second);
}

static void a_head_without_end_is_refused(void **state) {
  fixture *f = *state;
  static char endless[PAGE_HEAD_BYTES + 1];
  char head[2048];
  memset(endless, 'x', sizeof endless - 1);
  memcpy(endless, "GET / HTTP/1.1\r\nCookie: ", 24);
  int s = tcp_connect(f->port, 0);
  assert_int_equal(http_head(s, endless, head, sizeof head), 431);
  close(s);
  static const struct {
    const char *request;
    int code;
  } odd[] = {{"GET\r\n\r\n", 400},
             {"\r\n\r\n", 400},
             {"GET / HTTP/2.0\r\n\r\n", 505},
             {"GET http://evil.example/ HTTP/1.1\r\n\r\n", 400},
             {"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", 400},
             {"GET / HTTP/1.1\r\n folded\r\n\r\n", 400},
             {"GET / HTTP/1.1\r\nno colon\r\n\r\n", 400},
             {"GET / HTTP/1.1\r\n\r\n", 403}};
  for (size_t i = 0; i < SONDE_COUNT_OF(odd); ++i) {
    s = tcp_connect(f->port, 0);
    assert_int_equal(http_head(s, odd[i].request, head, sizeof head), odd[i].code);
    close(s);
  }
}

// A page that answers no ping is gone, whatever its socket says: the next one controls. The server
// waits for 6 s; here its patience is shorter.
static void a_silent_page_loses_control(void **state) {
  fixture *f = *state;
  assert_true(f->server->patience.silent_s <= 10);
  page_patience usual = f->server->patience;
  int silent = ws_open(f->port);
  assert_true(ws_expect(silent, "\"type\":\"controls\",\"controls\":true"));
  int second = ws_open(f->port);
  assert_true(ws_expect(second, "\"type\":\"controls\",\"controls\":false"));
  set_patience(
      f, (page_patience){.ask_s = 10, .answer_s = 10, .end_s = 2, .ping_s = 0.2, .silent_s = 2});
  bool controls = false;
  for (int i = 0; i < 10000 && !controls; ++i) { // answers what it is asked, as a browser does
    int opcode;
    size_t count;
    unsigned char *data = ws_read(second, &opcode, &count);
    assert_non_null(data);
    if (opcode == PAGE_WS_PING) ws_send_frame(second, 0x8a, (char *)data, count);
    controls = opcode == 1 && strstr((char *)data, "\"type\":\"controls\",\"controls\":true");
    free(data);
  }
  set_patience(f, usual);
  assert_true(controls);
  close(silent);
  close(second);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      SERVER_TEST(rude_frames_close_the_connection),
      SERVER_TEST(a_long_frame_is_refused_by_its_head),
      SERVER_TEST(a_message_may_come_in_any_pieces),
      SERVER_TEST(without_the_token_there_is_only_the_page),
      SERVER_TEST(without_the_token_there_is_no_socket),
      SERVER_TEST(tokens_are_random_and_have_one_form),
      SERVER_TEST(the_hash_gives_the_published_values),
      SERVER_TEST(half_open_requests_delay_nobody),
      SERVER_TEST(a_head_without_end_is_refused),
      SERVER_TEST(a_silent_page_loses_control),
  };
  return cmocka_run_group_tests(tests, start_server, stop_server);
}
