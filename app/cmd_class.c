// sonde class: several learners on one machine, one process each, and a table for the teacher.
#include "class_door.h"
#include "options.h"
#include "start.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static const char VERB[] = "class";

typedef struct options {
  long learners, port;
  const char *names, *program, *listen, *data, *scorm;
  char **arguments;
} options;

static const options DEFAULTS = {.port = 8642};

// --program is for tests: what is run instead of this program.
static const app_option TABLE[] = {
    OPT_INTEGER(learners, "learners", "N", 1, CLASS_LEARNERS,
                "how many; default: as many as names"),
    OPT_TEXT(names, "names", "A,B,C", "what to call them; default: Learner 1, Learner 2, ..."),
    OPT_INTEGER(port, "port", "P", 1, 65535, "page of the first learner, the others follow"),
    OPT_GROUP("Network"),
    OPT_TEXT(
        listen, "listen", "ADDRESS:PORT",
        "open the class to the network on this address of the computer (0.0.0.0: all), with TLS: "
        "who knows the code joins by a browser; port 0: any free port"),
    OPT_TEXT(data, "data", "DIR",
             "where the certificate and the teacher's secret are kept; default: sonde/class in "
             "$XDG_DATA_HOME or ~/.local/share"),
    OPT_TEXT(scorm, "scorm", "FILE",
             "write a SCORM 1.2 package by which a learning management system opens this class and "
             "keeps the scores of its exams"),
    OPT_TEXT(program, "program", "FILE", NULL),
    OPT_REST(arguments)};

static int parse_names(const options *s, class_room *room) {
  const char *p = s->names;
  while (p) {
    size_t length = strcspn(p, ",");
    if (room->count == CLASS_LEARNERS)
      return app_usage_error(VERB, "--names expects at most %d names", CLASS_LEARNERS);
    if (length == 0 || length >= CLASS_NAME)
      return app_usage_error(VERB, "--names expects names of 1 to %d bytes, got '%.*s'",
                             CLASS_NAME - 1, (int)length, p);
    class_learner *learner = &room->learner[room->count++];
    snprintf(learner->name, sizeof learner->name, "%.*s", (int)length, p);
    p = p[length] ? p + length + 1 : NULL;
  }
  if (s->learners && room->count && room->count != (uint32_t)s->learners)
    return app_usage_error(VERB, "--learners %ld, but %u names", s->learners, room->count);
  if (!s->learners && !room->count)
    return app_usage_error(VERB, "expected --learners N or --names A,B,C");
  if (!room->count) room->count = (uint32_t)s->learners;
  return APP_OK;
}

static int check_names(const options *s, class_room *room) {
  for (uint32_t i = 0; i < room->count; ++i) {
    class_learner *learner = &room->learner[i];
    if (!learner->name[0]) snprintf(learner->name, sizeof learner->name, "Learner %u", i + 1);
    for (const char *p = learner->name; *p; ++p)
      if ((unsigned char)*p < 0x20 || *p == 0x7f)
        return app_usage_error(VERB, "--names expects no control characters");
    for (uint32_t k = 0; k < i; ++k)
      if (strcmp(room->learner[k].name, learner->name) == 0)
        return app_usage_error(VERB, "two learners are called '%s'", learner->name);
    learner->port = (uint16_t)(s->port + i);
    learner->taken = !s->listen || s->names; // else who joins gives it a name
  }
  if (s->port + room->count - 1 > 65535)
    return app_usage_error(VERB, "--port %ld leaves no room for %u learners", s->port, room->count);
  return APP_OK;
}

// What would make the learners meet in one place.
static int check_arguments(const class_room *room) {
  static const char *const OWN[] = {"--port", "--headless", "--record"};
  for (int i = 0; i < room->argument_count; ++i)
    for (size_t k = 0; k < sizeof OWN / sizeof OWN[0]; ++k) {
      size_t length = strlen(OWN[k]);
      const char *word = room->arguments[i];
      if (strncmp(word, OWN[k], length) == 0 && (word[length] == 0 || word[length] == '='))
        return app_usage_error(VERB, "%s cannot be the same for all learners", OWN[k]);
    }
  return APP_OK;
}

// ---- the screen

static struct {
  bool terminal;
  uint32_t lines; // of the table that stands at the end of the screen
} screen;

static void wipe(void) {
  if (screen.lines) printf("\033[%uA\033[J", screen.lines);
  screen.lines = 0;
}

static void say(const class_learner *learner, const char *sentence) {
  assert(learner->name[0] && sentence[0]);
  char clock[16];
  time_t now = time(NULL);
  struct tm parts = {0};
  localtime_r(&now, &parts);
  strftime(clock, sizeof clock, "%H:%M:%S", &parts);
  wipe();
  printf("%s %s: %s\n", clock, learner->name, sentence);
  fflush(stdout);
}

static void numbers_of(const class_status *status, char elapsed[16], char score[16]) {
  snprintf(elapsed, 16, "-");
  snprintf(score, 16, "-");
  unsigned seconds = status->elapsed_s >= 0 ? (unsigned)status->elapsed_s : 0;
  if (status->elapsed_s >= 0) snprintf(elapsed, 16, "%u:%02u", seconds / 60, seconds % 60);
  if (isfinite(status->score)) snprintf(score, 16, "%.0f", status->score);
}

// A column of so many characters, and a space.
static void cell(const char *text, int width) {
  assert(width > 0);
  const char *p = text;
  int used = 0;
  for (; *p && used < width; ++used) do
      ++p;
    while (((unsigned char)*p & 0xc0) == 0x80);
  printf("%.*s%*s ", (int)(p - text), text, width - used, "");
}

static void draw_row(const char *name, const char *port, const char *state, const char *patient,
                     const char *elapsed, const char *score) {
  cell(name, 20); // 79 characters in all: a line that wraps would spoil the table
  cell(port, 6);
  cell(state, 10);
  cell(patient, 27);
  printf("%6.6s %5.5s\n", elapsed, score);
}

static void draw(const class_room *room) {
  assert(room->count >= 1 && room->count <= CLASS_LEARNERS);
  wipe();
  uint32_t lines = 1;
  draw_row("learner", "port", "state", "case", "time", "score");
  for (uint32_t i = 0; i < room->count; ++i) {
    const class_learner *learner = &room->learner[i];
    if (!learner->taken) continue;
    char port[8], elapsed[16], score[16];
    snprintf(port, sizeof port, "%u", (unsigned)learner->port);
    numbers_of(&learner->status, elapsed, score);
    draw_row(learner->name, port, class_state(learner),
             learner->status.patient[0] ? learner->status.patient : "-", elapsed, score);
    ++lines;
  }
  screen.lines = screen.terminal ? lines : 0;
  fflush(stdout);
}

// ---- a class

static void print_address(const char *whose, uint16_t port, const char *token) {
  assert(port != 0 && token[0]);
  printf("%s: http://127.0.0.1:%u/#%s\n", whose, (unsigned)port, token);
}

// Makes the secrets of all learners and starts their programs; a learner keeps the secret when the
// program is started again, and so the page finds it.
static int begin(const options *s, class_room *room, class_door **door) {
  sonde_error error = {0};
  for (uint32_t i = 0; i < room->count; ++i)
    if (sonde_page_token_make(room->learner[i].token, &error) ||
        sonde_page_token_make(room->learner[i].teacher_token, &error) ||
        sonde_page_token_make(room->learner[i].watcher_token, &error))
      return app_fail(VERB, &error);
  if (s->listen) {
    char data[4096], exams[4096], address[64];
    const char *given = NULL; // to every learner's program
    const char *colon = strrchr(s->listen, ':');
    long port = 0;
    if (!colon || (size_t)(colon - s->listen) >= sizeof address)
      return app_usage_error(VERB, "--listen expects ADDRESS:PORT, got '%s'", s->listen);
    if (!app_parse_integer(VERB, "listen", colon + 1, 0, 65535, &port)) return APP_BAD_INPUT;
    snprintf(address, sizeof address, "%.*s", (int)(colon - s->listen), s->listen);
    app_data_home(s->data, "class", data, sizeof data);
    for (int i = 0; i < room->argument_count; ++i) {
      const char *word = room->arguments[i];
      if (strncmp(word, "--exams=", 8) == 0) given = word + 8;
      if (strcmp(word, "--exams") == 0) given = room->arguments[i + 1];
    }
    app_data_home(given, "exams", exams, sizeof exams);
    class_door_def def = {address, (uint16_t)port, data, exams, s->names != NULL, s->scorm};
    int code = class_door_open(&def, room, door);
    if (code != APP_OK) return code;
  }
  for (uint32_t i = 0; i < room->count; ++i)
    if (room->learner[i].taken) class_start(room, &room->learner[i], say);
  printf("%u learners. A teacher's address is to watch, comment and take control. Ctrl-C ends "
         "them all.\n",
         room->count);
  for (uint32_t i = 0; i < room->count; ++i)
    if (room->learner[i].taken)
      print_address(room->learner[i].name, room->learner[i].port, room->learner[i].token);
  for (uint32_t i = 0; i < room->count; ++i) {
    char whose[CLASS_NAME + 16];
    snprintf(whose, sizeof whose, "Teacher of %s", room->learner[i].name);
    if (room->learner[i].taken)
      print_address(whose, room->learner[i].port, room->learner[i].teacher_token);
  }
  return APP_OK;
}

// In a pipe: a line for what has changed.
static void tell_changes(const class_room *room, char told[CLASS_LEARNERS][128]) {
  for (uint32_t i = 0; i < room->count; ++i) {
    const class_learner *learner = &room->learner[i];
    char line[128], elapsed[16], score[16];
    if (!learner->taken) continue;
    numbers_of(&learner->status, elapsed, score);
    snprintf(line, sizeof line, "%s, case %.60s, score %s", class_state(learner),
             learner->status.patient[0] ? learner->status.patient : "-", score);
    if (strcmp(line, told[i]) == 0) continue;
    memcpy(told[i], line, sizeof line);
    say(learner, line);
  }
}

static int run(void *from) {
  const options *s = from;
  static class_room room;
  static char told[CLASS_LEARNERS][128];
  char program[4096];
  char *none[] = {NULL};
  class_door *door = NULL;
  room.arguments = s->arguments ? s->arguments : none;
  while (room.arguments[room.argument_count]) room.argument_count++;
  int code = parse_names(s, &room);
  if (code == APP_OK) code = check_names(s, &room);
  if (code == APP_OK) code = check_arguments(&room);
  if (code == APP_OK && s->scorm && !s->listen)
    code = app_usage_error(VERB, "--scorm needs --listen: a package holds the class's address");
  if (code != APP_OK) return code;
  assert(room.count >= 1 && room.count <= CLASS_LEARNERS);
  if (!s->program && app_program(program, sizeof program)) {
    fprintf(stderr, "sonde class: /proc/self/exe cannot be read\n");
    return APP_FAILED;
  }
  room.program = s->program ? s->program : program;
  double ask_s = 0;
  bool alive = true;
  app_catch_interrupt();
  screen.terminal = isatty(STDOUT_FILENO) == 1;
  code = begin(s, &room, &door);
  if (code != APP_OK) return code;
  draw(&room);
  while (!app_interrupted() && alive) {
    alive = class_watch(&room, say);
    if (door) class_door_turn(door, &room, say);
    for (uint32_t i = 0; i < room.count; ++i) // that it is back will be news
      if (!room.learner[i].process && !room.learner[i].gave_up) told[i][0] = 0;
    if (class_now_s() >= ask_s) {
      class_ask(&room);
      ask_s = class_now_s() + 1;
      if (screen.terminal)
        draw(&room);
      else
        tell_changes(&room, told);
    }
    if (screen.terminal && !screen.lines) draw(&room); // something was said
    nanosleep(&(struct timespec){.tv_nsec = 200000000}, NULL);
  }
  class_stop(&room);
  class_door_close(door);
  if (!alive) fprintf(stderr, "sonde class: no learner's program keeps running\n");
  return alive ? APP_OK : APP_FAILED;
}

const app_command cmd_class = {
    .verb = "class",
    .summary = "run several learners on one machine",
    .usage = "--learners N [--names A,B,C] [--port P] [--listen ADDRESS:PORT] [-- RUN OPTIONS]",
    .text =
        "Starts sonde-run(1) once for each of N learners, each with a page of its own on "
        "127.0.0.1, and shows in a table how they are doing: phase of the exam, case, time, "
        "score; in a pipe a line per change. A program that dies is started again after half a "
        "second, three times at most; the count starts anew after a minute of running. Each "
        "learner has two addresses, printed at the start: the learner's own, and the teacher's, "
        "to watch, comment, take control and give it back. An address has a secret: who has it "
        "can take part. Ctrl-C ends them all. With --listen learners come by the network: one port "
        "with "
        "TLS, a code printed at the start for who joins by a browser, and an address with a secret "
        "for the teacher's board. Who joins gets a place, for whom a program is then started; with "
        "--names only who is on that list gets one.",
    .tail = "Everything after a double hyphen goes to every sonde-run(1), but for the options that "
            "would make the learners meet in one place: a port, a recording, a run without page.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .run = run};
