// The learners of a class: one process each, started, watched and asked how they are doing.
#ifndef SONDE_APP_CLASS_LEARNERS_H
#define SONDE_APP_CLASS_LEARNERS_H

#include "app.h"

#include <sys/types.h>

enum { CLASS_LEARNERS = 32, CLASS_NAME = 48, CLASS_RESTARTS = 3, CLASS_ANSWER = 4096 };

// What a learner's program says about itself.
typedef struct class_status {
  bool answers; // on its port
  char phase[32], patient[64];
  double elapsed_s, score; // NaN: unknown
} class_status;

typedef struct class_learner {
  char name[CLASS_NAME];
  uint16_t port;
  bool taken; // false: nobody has come for this place, and no program runs
  char token[SONDE_PAGE_TOKEN], teacher_token[SONDE_PAGE_TOKEN]; // of its page
  char watcher_token[SONDE_PAGE_TOKEN];
  pid_t process; // 0: not running
  double started_s, start_again_s;
  uint32_t restarts; // since it last ran for long
  bool gave_up;
  int errors_fd;       // its stderr
  char last_line[256]; // of its stderr
  class_status status;
} class_learner;

typedef struct class_room {
  uint32_t count;
  class_learner learner[CLASS_LEARNERS];
  const char *program;    // run for every learner
  char *const *arguments; // [argument_count] after `run --port N`
  int argument_count;
} class_room;

// A sentence about a learner, e.g. that it died and was started again.
typedef void (*class_say)(const class_learner *learner, const char *sentence);

double class_now_s(void);
// Starts a learner's program. False after saying why.
bool class_start(const class_room *room, class_learner *learner, class_say say);
// Notices programs that ended and starts them again, a few times. False when all have given up.
bool class_watch(class_room *room, class_say say);
// What a table shows of it: one word.
const char *class_state(const class_learner *learner);
// Asks every running program for /status.json; takes at most half a second.
void class_ask(class_room *room);
// Ends all programs: asked first, after five seconds killed.
void class_stop(class_room *room);

#endif
