// Learner, watcher and teacher: who controls, who may take, give and return control, who may
// comment, who edits cases.
#include "stream/page_fixture.h"

static const char ANNA[] = "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa";
static const char BO[] = "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb";

// Opens a socket as the page with that id does.
static int open_page(fixture *f, const char *id, const char *token, int *s) {
  char request[640], head[1024];
  snprintf(request, sizeof request,
           "GET /ws?client=%s HTTP/1.1\r\nHost: 127.0.0.1:%u\r\nUpgrade: websocket\r\n"
           "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
           "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: sonde, %s\r\n\r\n",
           id, (unsigned)f->port, token);
  *s = tcp_connect(f->port, 0);
  return http_head(*s, request, head, sizeof head);
}

static int visit(fixture *f, const char *id, const char *token) {
  int s;
  assert_int_equal(open_page(f, id, token, &s), 101);
  return s;
}

static int refused(fixture *f, const char *token) {
  int s, code = open_page(f, BO, token, &s);
  close(s);
  return code;
}

static bool told(int s, bool controls, const char *role, const char *holder, const char *may) {
  char needle[160];
  snprintf(needle, sizeof needle,
           "\"type\":\"controls\",\"controls\":%s,\"role\":\"%s\",\"holder\":\"%s\",\"may\":\"%s\"",
           controls ? "true" : "false", role, holder, may);
  return ws_expect(s, needle);
}

static void act(int s, const char *action) {
  char text[64];
  snprintf(text, sizeof text, "{\"type\":\"role\",\"action\":\"%s\"}", action);
  ws_say(s, text);
}

static const char GOAL[] = "{\"type\":\"goal\",\"position_mm\":[1,2,3],\"rotation\":[1,0,0,0]}";

static void set_return(fixture *f, double return_s) {
  pthread_mutex_lock(&f->server->lock);
  f->server->patience.return_s = return_s;
  pthread_mutex_unlock(&f->server->lock);
}

static void a_reload_keeps_control(void **state) {
  fixture *f = *state;
  set_return(f, 1000); // whatever the machine does meanwhile
  int anna = visit(f, ANNA, WS_TOKEN);
  assert_true(told(anna, true, "learner", "learner", ""));
  int bo = visit(f, BO, WS_TOKEN);
  assert_true(told(bo, false, "watcher", "learner", ""));
  assert_true(told(anna, true, "learner", "learner", "give"));
  close(anna);
  assert_true(told(bo, false, "watcher", "nobody", "take")); // may, but need not
  ws_say(bo, GOAL);
  assert_true(ws_expect(bo, "only watches"));
  anna = visit(f, ANNA, WS_TOKEN);
  assert_true(told(anna, true, "learner", "learner", "give"));
  assert_true(told(bo, false, "watcher", "learner", ""));
  // Before the old connection is noticed to be gone: the new one waits and then takes its place.
  int again = visit(f, ANNA, WS_TOKEN);
  assert_true(told(again, false, "watcher", "learner", ""));
  close(anna);
  assert_true(told(again, true, "learner", "learner", "give"));
  // Who does not wait may take control of what nobody has.
  close(again);
  assert_true(told(bo, false, "watcher", "nobody", "take"));
  act(bo, "take");
  assert_true(told(bo, true, "learner", "learner", ""));
  anna = visit(f, ANNA, WS_TOKEN); // who comes back in time has it back all the same
  assert_true(told(anna, true, "learner", "learner", "give"));
  assert_true(told(bo, false, "watcher", "learner", ""));
  close(anna);
  assert_true(told(bo, false, "watcher", "nobody", "take"));
  set_return(f, 0); // the tests after this one wait for nobody
  close(bo);
}

static void after_a_while_the_next_one_follows(void **state) {
  fixture *f = *state;
  assert_in_range((unsigned)f->server->patience.return_s, 1, 120);
  int anna = visit(f, ANNA, WS_TOKEN), bo = visit(f, BO, WS_TOKEN);
  assert_true(told(bo, false, "watcher", "learner", ""));
  set_return(f, 0.1);
  close(anna);
  assert_true(told(bo, true, "learner", "learner", ""));
  close(bo);
}

// Nobody else is there whom a new page could disturb: it need not wait. The learner comes first
// again.
static void a_page_that_is_alone_stands_in(void **state) {
  fixture *f = *state;
  set_return(f, 1000);
  int anna = visit(f, ANNA, WS_TOKEN);
  assert_true(told(anna, true, "learner", "learner", ""));
  close(anna);
  wait_for_clients(f, 0);
  int bo = visit(f, BO, WS_TOKEN);
  assert_true(told(bo, true, "learner", "learner", ""));
  anna = visit(f, ANNA, WS_TOKEN);
  assert_true(told(anna, true, "learner", "learner", "give"));
  assert_true(told(bo, false, "watcher", "learner", ""));
  set_return(f, 0);
  close(anna);
  close(bo);
}

static void a_teacher_takes_control_and_gives_it_back(void **state) {
  fixture *f = *state;
  int anna = visit(f, ANNA, WS_TOKEN);
  int teacher = visit(f, BO, f->server->teacher_token);
  assert_true(told(teacher, false, "teacher", "learner", "take"));
  ws_say(teacher, GOAL);
  assert_true(ws_expect(teacher, "only watches"));
  act(teacher, "take");
  assert_true(told(teacher, true, "teacher", "teacher", "return"));
  assert_true(
      told(anna, false, "learner", "teacher", "")); // a learner cannot take it from a teacher
  act(anna, "take");
  assert_true(ws_expect(anna, "may not do that"));
  ws_say(anna, GOAL);
  assert_true(ws_expect(anna, "only watches"));
  ws_say(teacher, GOAL);
  assert_true(reaches(&f->source.goals, 1));
  act(teacher, "return");
  assert_true(told(anna, true, "learner", "learner", "give"));
  act(teacher, "take");
  assert_true(told(anna, false, "learner", "teacher", ""));
  close(teacher); // a teacher who leaves takes nothing along
  assert_true(told(anna, true, "learner", "learner", ""));
  close(anna);
}

static void a_learner_lends_control_and_takes_it_back(void **state) {
  fixture *f = *state;
  int anna = visit(f, ANNA, WS_TOKEN), bo = visit(f, BO, WS_TOKEN);
  assert_true(told(bo, false, "watcher", "learner", ""));
  act(bo, "take");
  assert_true(ws_expect(bo, "may not do that"));
  act(anna, "give");
  assert_true(told(bo, true, "watcher", "watcher", "return"));
  assert_true(told(anna, false, "learner", "watcher", "take"));
  act(anna, "take");
  assert_true(told(bo, false, "watcher", "learner", ""));
  act(anna, "give");
  assert_true(told(bo, true, "watcher", "watcher", "return"));
  act(bo, "return");
  assert_true(told(anna, true, "learner", "learner", "give"));
  act(anna, "steal");
  assert_true(ws_expect(anna, "take, give or return"));
  close(anna);
  close(bo);
}

static void a_watcher_comments_and_does_nothing_else(void **state) {
  fixture *f = *state;
  int anna = visit(f, ANNA, WS_TOKEN), bo = visit(f, BO, WS_TOKEN);
  assert_true(told(bo, false, "watcher", "learner", ""));
  ws_say(bo, "{\"type\":\"comment\",\"time_s\":3,\"text\":\"Wait.\",\"author\":\"Bo\"}");
  assert_true(reaches(&f->requests, 1));
  assert_int_equal(f->request.ask, SONDE_PAGE_COMMENT);
  assert_string_equal(f->request.text, "Wait.");
  static const char *const FORBIDDEN[] = {"{\"type\":\"finish_exam\"}", "{\"type\":\"leave_exam\"}",
                                          "{\"type\":\"hint\"}", "{\"type\":\"resume\"}",
                                          "{\"type\":\"seek\",\"time_s\":1}"};
  for (size_t i = 0; i < SONDE_COUNT_OF(FORBIDDEN); ++i) {
    ws_say(bo, FORBIDDEN[i]);
    assert_true(ws_expect(bo, "only watches"));
  }
  assert_int_equal(atomic_load(&f->requests), 1);
  close(anna);
  close(bo);
}

// An edit of `size` bytes, filled with blanks.
static void say_edit(int s, size_t size) {
  static char text[PAGE_COMMAND_BYTES + 1];
  memset(text, ' ', sizeof text);
  memcpy(text, "{\"type\":\"edit\"}", 15);
  ws_send_frame(s, 0x81, text, size);
}

// Whether a draft is among the messages before the answer to a ping, which what is published
// precedes.
static bool hears_the_draft(int s) {
  bool draft = false;
  ws_say(s, "{\"type\":\"ping\",\"id\":8}");
  for (bool answered = false; !answered;) {
    int opcode;
    size_t count;
    char *data = (char *)ws_read(s, &opcode, &count);
    assert_true(data && opcode != 8);
    draft |= opcode == 1 && strstr(data, "\"type\":\"draft\"") != NULL;
    answered = opcode == 1 && strcmp(data, "{\"type\":\"pong\",\"id\":8}") == 0;
    free(data);
  }
  return draft;
}

// A case holds the answer of an exam. It is also the only message that may be long.
static void only_a_teacher_edits_cases(void **state) {
  fixture *f = *state;
  sonde_page_publish(f->server, SONDE_PAGE_DRAFT, "{\"type\":\"draft\"}", NULL);
  static const char *const OTHERS[] = {WS_TOKEN, WS_GUEST};
  for (size_t i = 0; i < SONDE_COUNT_OF(OTHERS); ++i) {
    int s = visit(f, ANNA, OTHERS[i]);
    assert_false(hears_the_draft(s));
    say_edit(s, PAGE_SHORT_BYTES);
    assert_true(ws_expect(s, "teacher's address"));
    say_edit(s, PAGE_SHORT_BYTES + 1);
    assert_int_equal(ws_close_status(s), PAGE_CLOSE_TOO_BIG);
    close(s);
  }
  assert_int_equal(atomic_load(&f->requests), 0);
  int anna = visit(f, ANNA, WS_TOKEN), teacher = visit(f, BO, f->server->teacher_token);
  assert_true(told(anna, true, "learner", "learner", "")); // the teacher need not control
  assert_true(hears_the_draft(teacher));
  say_edit(teacher, PAGE_COMMAND_BYTES);
  assert_true(reaches(&f->requests, 1));
  assert_int_equal(f->request.ask, SONDE_PAGE_EDIT);
  assert_int_equal(strlen(f->request.entry), PAGE_COMMAND_BYTES);
  say_edit(teacher, PAGE_COMMAND_BYTES + 1);
  assert_int_equal(ws_close_status(teacher), PAGE_CLOSE_TOO_BIG);
  close(teacher);
  close(anna);
}

static void who_may_only_watch_takes_nobodys_place(void **state) {
  fixture *f = *state;
  int guest[PAGE_GUESTS], here[PAGE_CLIENTS - PAGE_GUESTS];
  guest[0] = visit(f, BO, WS_GUEST);
  assert_true(told(guest[0], false, "watcher", "nobody", "")); // though nobody controls
  act(guest[0], "take");
  assert_true(ws_expect(guest[0], "may not do that"));
  ws_say(guest[0], GOAL);
  assert_true(ws_expect(guest[0], "only watches"));
  int anna = visit(f, ANNA, WS_TOKEN);
  assert_true(told(anna, true, "learner", "learner", "")); // to a guest she cannot give control
  for (int i = 1; i < PAGE_GUESTS; ++i) guest[i] = visit(f, BO, WS_GUEST);
  assert_int_equal(refused(f, WS_GUEST), 503);
  for (int i = 1; i < PAGE_CLIENTS - PAGE_GUESTS; ++i)
    here[i] = visit(f, BO, f->server->teacher_token); // there is room for the others all the same
  for (int i = 1; i < PAGE_CLIENTS - PAGE_GUESTS; ++i) close(here[i]);
  close(anna);
  assert_true(told(guest[0], false, "watcher", "nobody", ""));
  for (int i = 0; i < PAGE_GUESTS; ++i) close(guest[i]);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      SERVER_TEST(after_a_while_the_next_one_follows),
      SERVER_TEST(a_reload_keeps_control),
      SERVER_TEST(a_page_that_is_alone_stands_in),
      SERVER_TEST(a_teacher_takes_control_and_gives_it_back),
      SERVER_TEST(a_learner_lends_control_and_takes_it_back),
      SERVER_TEST(a_watcher_comments_and_does_nothing_else),
      SERVER_TEST(only_a_teacher_edits_cases),
      SERVER_TEST(who_may_only_watch_takes_nobodys_place),
  };
  return cmocka_run_group_tests(tests, start_server, stop_server);
}
