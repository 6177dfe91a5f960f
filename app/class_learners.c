// Processes of a class: started, watched, started again, ended.
#include "class_learners.h"
#include "start.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

extern char **environ;
static const double LONG_S = 60, AGAIN_S = 0.5, STOP_S = 5;
enum { ARGUMENTS = 64, VARIABLES = 1024 };

double class_now_s(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

// ---- starting

// PROGRAM run --port N and what the user added; no input, no output, errors to a pipe. The name and
// the tokens go by the environment, which no other user can read, not by the command line.
static int spawn(const class_room *room, class_learner *learner, int errors) {
  assert(learner->port != 0 && learner->name[0] && errors >= 0);
  static const char *const OURS[] = {
      "SONDE_TRAINEE=", "SONDE_PAGE_TOKEN=", "SONDE_TEACHER_TOKEN=", "SONDE_WATCHER_TOKEN="};
  enum { OWN = sizeof OURS / sizeof OURS[0] };
  char port[8], own[OWN][CLASS_NAME + SONDE_PAGE_TOKEN + 24];
  const char *words[ARGUMENTS] = {room->program, "run", "--port", port};
  const char *variables[VARIABLES] = {own[0], own[1], own[2], own[3]};
  int count = 4, variable = OWN;
  snprintf(port, sizeof port, "%u", (unsigned)learner->port);
  snprintf(own[0], sizeof own[0], "%s%s", OURS[0], learner->name);
  snprintf(own[1], sizeof own[1], "%s%s", OURS[1], learner->token);
  snprintf(own[2], sizeof own[2], "%s%s", OURS[2], learner->teacher_token);
  snprintf(own[3], sizeof own[3], "%s%s", OURS[3], learner->watcher_token);
  if (room->argument_count > ARGUMENTS - 5) return E2BIG;
  for (int i = 0; i < room->argument_count; ++i) words[count++] = room->arguments[i];
  for (char **p = environ; *p && variable < VARIABLES - 1; ++p) {
    bool ours = false;
    for (int i = 0; i < OWN; ++i) ours |= strncmp(*p, OURS[i], strlen(OURS[i])) == 0;
    if (!ours) variables[variable++] = *p;
  }
  const app_program_start what = {.words = words,
                                  .variables = variables,
                                  .input = APP_NOTHING,
                                  .output = APP_NOTHING,
                                  .errors = errors};
  return app_start(&what, &learner->process);
}

static const class_status UNKNOWN = {.elapsed_s = (double)NAN, .score = (double)NAN};

bool class_start(const class_room *room, class_learner *learner, class_say say) {
  assert(!learner->process && room->program);
  int ends[2], code = pipe2(ends, O_CLOEXEC | O_NONBLOCK) ? errno : 0;
  learner->started_s = class_now_s();
  learner->last_line[0] = 0;
  learner->status = UNKNOWN;
  if (!code) {
    fcntl(ends[1], F_SETFL, 0); // the program's end waits as usual
    code = spawn(room, learner, ends[1]);
    close(ends[1]);
    if (code)
      close(ends[0]);
    else
      learner->errors_fd = ends[0];
  }
  if (!code) return true;
  char sentence[512];
  snprintf(sentence, sizeof sentence, "%.300s cannot be started: %s", room->program,
           strerror(code));
  learner->gave_up = true;
  say(learner, sentence);
  return false;
}

// ---- watching

// Keeps the last line that a program said.
static void hear(class_learner *learner) {
  assert(learner->process && learner->errors_fd >= 0);
  char bytes[1024];
  ssize_t got;
  while ((got = read(learner->errors_fd, bytes, sizeof bytes - 1)) > 0) {
    bytes[got] = 0;
    for (char *save = NULL, *line = strtok_r(bytes, "\r\n", &save); line;
         line = strtok_r(NULL, "\r\n", &save))
      snprintf(learner->last_line, sizeof learner->last_line, "%.255s", line);
  }
  for (char *p = learner->last_line; *p; ++p)
    if ((unsigned char)*p < 0x20 || *p == 0x7f) *p = ' ';
}

static void forget_process(class_learner *learner) {
  assert(learner->process);
  close(learner->errors_fd);
  learner->process = 0;
}

bool class_watch(class_room *room, class_say say) {
  assert(room->count <= CLASS_LEARNERS);
  uint32_t lost = 0;
  for (uint32_t i = 0; i < room->count; ++i) {
    class_learner *learner = &room->learner[i];
    int status = 0;
    if (learner->process && waitpid(learner->process, &status, WNOHANG) == learner->process) {
      if (app_interrupted()) // Ctrl-C reached it first
        forget_process(learner);
      else {
        // Says why a program ended, and whether it is started again.
        char how[64], words[400], sentence[512];
        hear(learner);
        if (WIFSIGNALED(status))
          snprintf(how, sizeof how, "was ended by signal %d", WTERMSIG(status));
        else
          snprintf(how, sizeof how, "ended with exit code %d", WEXITSTATUS(status));
        double lived_s = class_now_s() - learner->started_s;
        snprintf(words, sizeof words, "%s after %.0f s%s%s", how, lived_s,
                 learner->last_line[0] ? ": " : "", learner->last_line);
        if (lived_s >= LONG_S) learner->restarts = 0;
        forget_process(learner);
        learner->status = UNKNOWN;
        learner->gave_up = learner->restarts >= CLASS_RESTARTS;
        if (learner->gave_up) {
          snprintf(sentence, sizeof sentence, "%s; given up after %d restarts", words,
                   CLASS_RESTARTS);
        } else {
          learner->restarts++;
          learner->start_again_s = class_now_s() + AGAIN_S;
          snprintf(sentence, sizeof sentence, "%s; starting again (%u of %d)", words,
                   learner->restarts, CLASS_RESTARTS);
        }
        say(learner, sentence);
      }
    } else if (learner->process) {
      hear(learner);
    } else if (learner->taken && !learner->gave_up && class_now_s() >= learner->start_again_s &&
               !app_interrupted()) {
      class_start(room, learner, say);
    }
    lost += learner->gave_up;
  }
  return lost < room->count;
}

const char *class_state(const class_learner *learner) {
  if (learner->gave_up) return "given up";
  if (!learner->process) return "ended";
  if (!learner->status.answers) return "starting";
  return learner->status.phase[0] ? learner->status.phase : "running";
}

// ---- stopping

// How many programs have not ended.
static uint32_t running(class_room *room) {
  uint32_t count = 0;
  for (uint32_t i = 0; i < room->count; ++i) {
    class_learner *learner = &room->learner[i];
    if (!learner->process) continue;
    hear(learner); // a full pipe would keep it from ending
    if (waitpid(learner->process, NULL, WNOHANG) == 0)
      ++count;
    else
      forget_process(learner);
  }
  return count;
}

static void signal_all(const class_room *room, int number) {
  assert(number == SIGTERM || number == SIGKILL);
  for (uint32_t i = 0; i < room->count; ++i)
    if (room->learner[i].process) kill(room->learner[i].process, number);
}

void class_stop(class_room *room) {
  assert(room->count <= CLASS_LEARNERS);
  double until_s = class_now_s() + STOP_S;
  signal_all(room, SIGTERM);
  while (running(room) && class_now_s() < until_s)
    nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL);
  signal_all(room, SIGKILL);
  while (running(room)) nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
}
