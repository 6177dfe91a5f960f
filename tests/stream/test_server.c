// The page's server against polite, slow and hostile clients. A synthetic source stands in for the
// session: it counts what reaches it.
#include "stream/page_fixture.h"

#include <math.h>
#include <sys/stat.h>

// ---- who may come in --------------------------------------------------------------------------

static void files_come_with_strict_headers(void **state) {
  fixture *f = *state;
  char host[32], head[2048];
  snprintf(host, sizeof host, "localhost:%u", (unsigned)f->port);
  assert_int_equal(get(f->port, "GET", "/", host, head), 200);
  assert_non_null(strstr(head, "X-Content-Type-Options: nosniff"));
  assert_non_null(strstr(head, "default-src 'none'; script-src 'self'"));
  assert_null(strstr(head, "unsafe"));
  assert_int_equal(get(f->port, "HEAD", "/index.html", host, head), 200);
  assert_int_equal(get(f->port, "GET", "/etc/passwd", host, head), 404);
  assert_int_equal(get(f->port, "GET", "/../../../../etc/passwd", host, head) / 100, 4);
  assert_int_equal(get(f->port, "GET", "/%2e%2e/%2e%2e/etc/passwd", host, head) / 100, 4);
  assert_int_equal(get(f->port, "POST", "/", host, head), 405);
  assert_int_equal(get(f->port, "GET", "/ws", host, head), 426);
}

static void foreign_hosts_are_refused(void **state) {
  fixture *f = *state;
  char head[2048], other_port[32];
  snprintf(other_port, sizeof other_port, "127.0.0.1:%u", f->port + 1u);
  assert_int_equal(get(f->port, "GET", "/", "evil.example", head), 403);
  assert_int_equal(get(f->port, "GET", "/", other_port, head), 403);
  assert_int_equal(ws_open_as(f->port, "evil.example", NULL, 0), -403);
}

static void only_this_page_may_open_the_socket(void **state) {
  fixture *f = *state;
  char host[32], origin[64];
  snprintf(host, sizeof host, "127.0.0.1:%u", (unsigned)f->port);
  snprintf(origin, sizeof origin, "https://127.0.0.1:%u", (unsigned)f->port);
  static const char *const FOREIGN[] = {"http://evil.example",
                                        "null",
                                        "",
                                        "file://",
                                        "http://127.0.0.1",
                                        "http://127.0.0.1.evil.example:80"};
  for (size_t i = 0; i < SONDE_COUNT_OF(FOREIGN); ++i)
    assert_int_equal(ws_open_as(f->port, host, FOREIGN[i], 0), -403);
  assert_int_equal(ws_open_as(f->port, host, origin, 0), -403); // https is another origin
  assert_int_equal(page_server_clients(f->server), 0);
  snprintf(origin, sizeof origin, "http://localhost:%u", (unsigned)f->port);
  int s = ws_open_as(f->port, host, origin, 0);
  assert_true(s >= 0);
  close(s);
}

static void the_server_listens_on_the_loopback_address_only(void **state) {
  fixture *f = *state;
  int s = socket(AF_INET, SOCK_STREAM, 0), reuse = 0;
  struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(f->port)};
  // Another loopback address is free for others, so the server did not bind to every address.
  assert_int_equal(inet_pton(AF_INET, "127.0.0.2", &address.sin_addr), 1);
  setsockopt(s, SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse);
  assert_int_equal(bind(s, (struct sockaddr *)&address, sizeof address), 0);
  close(s);
}

static void a_used_port_is_named(void **state) {
  fixture *f = *state;
  page_source source = source_of(&f->source);
  sonde_page_def def = {.port = f->port};
  sonde_page_server *second = NULL;
  sonde_error error = {0};
  assert_int_equal(page_server_start(&def, &source, &second, &error), SONDE_PORT);
  assert_null(second);
  char number[16];
  snprintf(number, sizeof number, "%u", (unsigned)f->port);
  assert_non_null(strstr(error.message, number));
  assert_non_null(strstr(error.message, "in use"));
}

// ---- what a client may do ---------------------------------------------------------------------

static void a_client_is_greeted_and_may_move_the_probe(void **state) {
  fixture *f = *state;
  int s = ws_open(f->port);
  assert_true(s >= 0);
  assert_true(ws_expect(s, "\"type\":\"hello\""));
  assert_true(ws_expect(s, "\"type\":\"controls\""));
  ws_say(s, "{\"type\":\"goal\",\"position_mm\":[1,2,3],\"rotation\":[1,0,0,0]}");
  assert_true(reaches(&f->source.goals, 1));
  ws_say(s, "{\"type\":\"controls\",\"probe\":\"linear\",\"case\":\"chronic_occlusive\","
            "\"gain_db\":6}");
  assert_true(reaches(&f->source.controls, 1));
  assert_true(ws_expect(s, "\"probe\":\"linear\",\"case\":\"chronic_occlusive\""));
  ws_say(s, "{\"type\":\"ping\",\"id\":42}");
  assert_true(ws_expect(s, "{\"type\":\"pong\",\"id\":42}"));
  close(s);
  wait_for_clients(f, 0);
  assert_float_equal(f->source.goal.position.y, 0.002, 1e-9);
  assert_int_equal(f->source.last.probe, 1);
  assert_float_equal(f->source.last.echo.gain_db, 6, 1e-9);
}

static void stop_latches_until_resume(void **state) {
  fixture *f = *state;
  int s = ws_open(f->port);
  ws_say(s, "{\"type\":\"stop\"}");
  assert_true(ws_expect(s, "\"stop\":true"));
  ws_say(s, "{\"type\":\"controls\",\"gain_db\":1}");
  assert_true(reaches(&f->source.controls, 2));
  assert_true(f->source.last.stop); // other controls do not release it
  ws_say(s, "{\"type\":\"resume\"}");
  assert_true(ws_expect(s, "\"stop\":false"));
  close(s);
  wait_for_clients(f, 0);
  assert_int_equal(f->source.last.resume, 1);
}

static void bad_messages_are_answered_and_ignored(void **state) {
  fixture *f = *state;
  int s = ws_open(f->port);
  ws_say(s, "{\"type\":\"goal\",\"position_mm\":[1,2,1e999],\"rotation\":[1,0,0,0]}");
  assert_true(ws_expect(s, "\"type\":\"error\""));
  ws_say(s, "}{");
  assert_true(ws_expect(s, "one JSON object"));
  ws_say(s, "{\"type\":\"controls\",\"probe\":\"banana\"}");
  assert_true(ws_expect(s, "no probe of that name"));
  ws_say(s, "{\"type\":\"controls\",\"case\":\"banana\"}");
  assert_true(ws_expect(s, "no case of that name"));
  ws_say(s, "{\"type\":\"ping\",\"id\":1}"); // and the connection still works
  assert_true(ws_expect(s, "pong"));
  assert_int_equal(atomic_load(&f->source.goals), 0);
  close(s);
}

static void the_first_client_controls_and_the_others_watch(void **state) {
  fixture *f = *state;
  int first = ws_open(f->port);
  assert_true(ws_expect(first, "\"type\":\"controls\",\"controls\":true"));
  int second = ws_open(f->port);
  assert_true(ws_expect(second, "\"type\":\"controls\",\"controls\":false"));
  ws_say(second, "{\"type\":\"goal\",\"position_mm\":[1,2,3],\"rotation\":[1,0,0,0]}");
  assert_true(ws_expect(second, "only watches"));
  assert_int_equal(atomic_load(&f->source.goals), 0);
  ws_say(second, "{\"type\":\"stop\"}"); // anyone may stop
  assert_true(ws_expect(second, "\"stop\":true"));
  close(first); // the next in line takes over
  assert_true(ws_expect(second, "\"type\":\"controls\",\"controls\":true"));
  close(second);
}

static void a_fifth_client_is_turned_away(void **state) {
  fixture *f = *state;
  enum { MOST = PAGE_CLIENTS - PAGE_GUESTS };
  int s[MOST];
  for (int i = 0; i < MOST; ++i) {
    s[i] = ws_open(f->port);
    assert_true(s[i] >= 0);
    wait_for_clients(f, (uint32_t)i + 1);
  }
  assert_int_equal(ws_open(f->port), -503);
  close(s[1]);
  wait_for_clients(f, MOST - 1);
  s[1] = ws_open(f->port);
  assert_true(s[1] >= 0);
  for (int i = 0; i < MOST; ++i) close(s[i]);
}

// ---- frames -----------------------------------------------------------------------------------

// Sequence of the next frame, 0 when none comes any more.
static uint32_t next_sequence(int s, uint64_t *tick) {
  for (;;) {
    int opcode;
    size_t count;
    unsigned char *data = ws_read(s, &opcode, &count);
    if (!data) return 0;
    bool frame = opcode == 2 && data[6] == PAGE_FRAME;
    uint32_t sequence = data[8] | (uint32_t)data[9] << 8 | (uint32_t)data[10] << 16;
    *tick = data[16] | (uint64_t)data[17] << 8 | (uint64_t)data[18] << 16;
    free(data);
    if (frame) return sequence;
  }
}

static void acknowledge_frame(int s, uint32_t sequence) {
  char text[64];
  snprintf(text, sizeof text, "{\"type\":\"ack\",\"frame\":%u}", sequence);
  ws_say(s, text);
}

// No frame comes for 0.4 s.
static bool stays_silent(int s) {
  const struct timeval silence = {.tv_usec = 400000}, patience = {.tv_sec = PATIENCE_S};
  uint64_t tick;
  setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &silence, sizeof silence);
  bool silent = next_sequence(s, &tick) == 0;
  setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  return silent;
}

static void a_silent_client_gets_two_frames_and_then_the_newest(void **state) {
  fixture *f = *state;
  int s = ws_open(f->port);
  uint64_t tick = 0, last_tick = 0;
  uint32_t first = next_sequence(s, &last_tick), second = next_sequence(s, &tick);
  assert_true(first > 0 && second > first);
  assert_true(stays_silent(s)); // no third one without an acknowledgement
  unsigned before = atomic_load(&f->source.frames);
  acknowledge_frame(s, second);
  uint32_t third = next_sequence(s, &tick);
  assert_true(third > second);
  assert_true(tick + 2 >= before);    // what was missed is not sent later
  acknowledge_frame(s, third + 1000); // acknowledging the future buys nothing
  assert_true(next_sequence(s, &tick) > 0);
  assert_true(stays_silent(s));
  close(s);
}

static void frames_flow_while_they_are_acknowledged(void **state) {
  fixture *f = *state;
  int s = ws_open(f->port);
  uint64_t tick = 0, before = 0;
  for (int i = 0; i < 100; ++i) {
    uint32_t sequence = next_sequence(s, &tick);
    assert_true(sequence > 0 && tick > before);
    before = tick;
    acknowledge_frame(s, sequence);
  }
  close(s);
}

static void a_client_that_does_not_read_holds_up_nobody(void **state) {
  fixture *f = *state;
  char host[32];
  snprintf(host, sizeof host, "127.0.0.1:%u", (unsigned)f->port);
  int stuck = ws_open_as(f->port, host, NULL, 2048);
  for (uint32_t i = 1; i < 2000; i += 100) acknowledge_frame(stuck, i); // asks, never reads
  wait_for_clients(f, 1);
  int s = ws_open(f->port);
  uint64_t tick;
  for (int i = 0; i < 50; ++i) {
    uint32_t sequence = next_sequence(s, &tick);
    assert_true(sequence > 0);
    acknowledge_frame(s, sequence);
  }
  // Each client has one buffer of one frame, whatever it does.
  size_t frame_bytes = PAGE_FRAME_FIXED_BYTES + 6 * NODES + WIDTH * HEIGHT;
  pthread_mutex_lock(&f->server->lock);
  for (int i = 0; i < PAGE_CLIENTS; ++i)
    assert_true(f->server->client[i].out.capacity <= frame_bytes);
  pthread_mutex_unlock(&f->server->lock);
  close(s);
  close(stuck);
}

static void a_flood_is_slowed_down_and_then_cut(void **state) {
  fixture *f = *state;
  int s = ws_open(f->port);
  for (int i = 0; i < 900; ++i) ws_say(s, "{\"type\":\"stop\"}");
  assert_true(ws_expect(s, "too many messages"));
  assert_in_range(atomic_load(&f->source.controls), PAGE_BURST - 1, 890);
  for (int i = 0; i < 6000; ++i) ws_say(s, "{\"type\":\"stop\"}");
  wait_for_clients(f, 0);
  close(s);
}

// ---- what the program says and is asked --------------------------------------------------------

static void the_newest_text_of_a_topic_reaches_every_client(void **state) {
  fixture *f = *state;
  assert_int_equal(sonde_page_publish(f->server, SONDE_PAGE_GREETING, "\"trainer\":true", NULL), 0);
  assert_int_equal(sonde_page_publish(f->server, SONDE_PAGE_EXAM, "{\"n\":1}", NULL), 0);
  int early = ws_open(f->port);
  assert_true(ws_expect(early, "\"trainer\":true}"));
  assert_true(ws_expect(early, "{\"n\":1}"));
  assert_int_equal(sonde_page_publish(f->server, SONDE_PAGE_EXAM, "{\"n\":2}", NULL), 0);
  assert_true(ws_expect(early, "{\"n\":2}"));
  int late = ws_open(f->port);
  assert_true(ws_expect(late, "\"type\":\"controls\"")); // first the thigh, then what happens on it
  assert_true(ws_expect(late, "{\"n\":2}"));
  sonde_page_tell(f->server, "a sentence for all");
  assert_true(ws_expect(early, "a sentence for all"));
  assert_true(ws_expect(late, "a sentence for all"));
  close(early);
  close(late);
}

static void requests_come_from_the_client_that_controls(void **state) {
  fixture *f = *state;
  int first = ws_open(f->port);
  assert_true(ws_expect(first, "\"type\":\"controls\""));
  int second = ws_open(f->port);
  assert_true(ws_expect(second, "\"type\":\"controls\""));
  ws_say(second, "{\"type\":\"finish_exam\"}");
  assert_true(ws_expect(second, "only watches"));
  assert_int_equal(atomic_load(&f->requests), 0);
  ws_say(first, "{\"type\":\"start_exam\",\"case\":\"lean\",\"protocol\":\"two_point\","
                "\"guidance\":\"full\",\"trainee\":\"J\xc3\xb6rg\"}");
  assert_true(reaches(&f->requests, 1));
  assert_int_equal(f->request.ask, SONDE_PAGE_START_EXAM);
  assert_string_equal(f->request.id, "lean");
  assert_string_equal(f->request.name, "J\xc3\xb6rg");
  ws_say(first, "{\"type\":\"start_exam\",\"case\":\"lean\",\"protocol\":\"two_point\","
                "\"guidance\":\"none\"}");
  assert_true(ws_expect(first, "full, hints or exam"));
  ws_say(first, "{\"type\":\"play\",\"playing\":true,\"speed\":100}");
  assert_true(ws_expect(first, "from 0.25 to 4"));
  ws_say(first, "{\"type\":\"seek\"}");
  assert_true(ws_expect(first, "time_s"));
  ws_say(first, "{\"type\":\"seek\",\"time_s\":12.5}");
  assert_true(reaches(&f->requests, 2));
  assert_float_equal(f->request.time_s, 12.5, 0);
  close(first);
  close(second);
}

static unsigned first_point_count(int s) {
  for (;;) {
    int opcode;
    size_t count;
    unsigned char *data = ws_read(s, &opcode, &count);
    if (!data) return 0;
    bool skin = opcode == 2 && data[6] == PAGE_MESH && data[8] == PAGE_SKIN;
    unsigned points = data[16];
    free(data);
    if (skin) return points;
  }
}

// Another thigh: every client is greeted again, and no frame of the one before follows.
static void another_source_takes_the_place_of_the_first(void **state) {
  fixture *f = *state;
  static sonde_vec3 points[5];
  static uint32_t faces[1][3] = {{0, 1, 2}};
  sonde_model other = {.surface = {5, 1, points, faces}};
  int s = ws_open(f->port);
  assert_int_equal(first_point_count(s), NODES);
  assert_int_equal(sonde_page_show_model(f->server, &other, NULL, 0, NULL), SONDE_OK);
  assert_int_equal(first_point_count(s), 5);
  float skin[15] = {0};
  sonde_frame frame = {.skin_m = skin, .pixels = f->source.pixels, .width = 16, .height = 16};
  frame.snapshot.tick = 77;
  sonde_session_controls controls = first_controls(NULL);
  assert_true(sonde_page_post(f->server, &frame, &controls));
  uint64_t tick = 0;
  assert_true(next_sequence(s, &tick) > 0);
  assert_int_equal(tick, 77);
  ws_say(s, "{\"type\":\"goal\",\"position_mm\":[1,2,3],\"rotation\":[1,0,0,0]}");
  ws_say(s, "{\"type\":\"ping\",\"id\":9}");
  assert_true(ws_expect(s, "\"id\":9"));
  assert_int_equal(atomic_load(&f->source.goals), 0); // nothing to move
  ws_say(s, "{\"type\":\"controls\",\"gain_db\":3}");
  assert_true(ws_expect(s, "no control acts on it"));
  page_source first = source_of(&f->source);
  assert_int_equal(page_server_show(f->server, &first, NULL), SONDE_OK);
  assert_int_equal(first_point_count(s), NODES);
  close(s);
}

static void reports_are_served_and_nothing_else(void **state) {
  fixture *f = *state;
  char host[32], head[2048], path[128];
  snprintf(host, sizeof host, "127.0.0.1:%u", (unsigned)f->port);
  snprintf(path, sizeof path, "%s/2026-a1", f->directory);
  assert_int_equal(mkdir(path, 0700), 0);
  snprintf(path, sizeof path, "%s/2026-a1/report.html", f->directory);
  sonde_file *file = NULL;
  assert_int_equal(sonde_file_create(path, &file, NULL), SONDE_OK);
  sonde_file_printf(file, "<p>x</p>");
  assert_int_equal(sonde_file_commit(file, NULL), SONDE_OK);
  char lines[128], link[SONDE_PAGE_LINK];
  snprintf(lines, sizeof lines, "Authorization: Bearer %s\r\n", WS_TOKEN);
  sonde_page_link(f->server, "/report/2026-a1", link);
  assert_int_equal(get(f->port, "GET", link, host, head), 200);
  assert_non_null(strstr(head, "default-src 'none'"));
  // Its script has an origin of its own and may reach nothing: it cannot act as the page.
  assert_non_null(strstr(head, "sandbox allow-scripts"));
  assert_null(strstr(head, "allow-same-origin"));
  assert_null(strstr(head, "connect-src"));
  assert_null(strstr(head, "script-src 'self'"));
  static const char *const ABSENT[] = {
      "/report/2026-a2", "/report/",           "/report/x/../../y", "/report/2026-a1/report.html",
      "/report/2026-A1", "/exam/2026-a1.json", "/exam/2026-a1.html"};
  for (size_t i = 0; i < SONDE_COUNT_OF(ABSENT); ++i)
    assert_int_equal(get_with(f->port, "GET", ABSENT[i], host, lines, head), 404);
  assert_int_equal(get_with(f->port, "GET", "/report/2026-a1", "evil.example", lines, head), 403);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      SERVER_TEST(files_come_with_strict_headers),
      SERVER_TEST(foreign_hosts_are_refused),
      SERVER_TEST(only_this_page_may_open_the_socket),
      SERVER_TEST(the_server_listens_on_the_loopback_address_only),
      SERVER_TEST(a_used_port_is_named),
      SERVER_TEST(a_client_is_greeted_and_may_move_the_probe),
      SERVER_TEST(stop_latches_until_resume),
      SERVER_TEST(bad_messages_are_answered_and_ignored),
      SERVER_TEST(the_first_client_controls_and_the_others_watch),
      SERVER_TEST(a_fifth_client_is_turned_away),
      SERVER_TEST(a_silent_client_gets_two_frames_and_then_the_newest),
      SERVER_TEST(frames_flow_while_they_are_acknowledged),
      SERVER_TEST(a_client_that_does_not_read_holds_up_nobody),
      SERVER_TEST(the_newest_text_of_a_topic_reaches_every_client),
      SERVER_TEST(requests_come_from_the_client_that_controls),
      SERVER_TEST(another_source_takes_the_place_of_the_first),
      SERVER_TEST(reports_are_served_and_nothing_else),
      SERVER_TEST(a_flood_is_slowed_down_and_then_cut),
  };
  return cmocka_run_group_tests(tests, start_server, stop_server);
}
