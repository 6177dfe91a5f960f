// Progress of long work on a terminal, drawn once a second by a thread of its own, and Ctrl-C.
#include "app.h"

#include <assert.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static volatile sig_atomic_t interrupted;

static void on_interrupt(int number) {
  (void)number;
  interrupted = 1;
}

void app_catch_interrupt(void) {
  struct sigaction action;
  memset(&action, 0, sizeof action);
  action.sa_handler = on_interrupt;
  action.sa_flags = (int)SA_RESETHAND; // the second one acts as usual
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
}

bool app_interrupted(void) { return interrupted != 0; }

// The line and what it says; the mutex guards all of it but `terminal`.
typedef struct progress_line {
  bool terminal, lines, shown, beating, ending;
  int percent; // -1: the share that is done is not known
  char what[64];
  double start_s;
  double from, to; // the part of the bar that the reported fraction fills
  pthread_t thread;
} progress_line;

static progress_line line = {.to = 1};
static bool as_lines; // for another program that reads them
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t ended = PTHREAD_COND_INITIALIZER;

// With the mutex held.
static void draw(void) {
  enum { BAR = 30 };
  static const char FULL[] = "##############################";
  int seconds = (int)(app_seconds(CLOCK_MONOTONIC) - line.start_s);
  if (line.percent >= 0) {
    int full = line.percent * BAR / 100;
    fprintf(stderr, "\r\033[K[%.*s%*s] %3d %% %s", full, FULL, BAR - full, "", line.percent,
            line.what);
  } else {
    fprintf(stderr, "\r\033[K%s", line.what);
  }
  if (seconds > 0) fprintf(stderr, "  %d:%02d", seconds / 60, seconds % 60);
  fflush(stderr);
  line.shown = true;
}

static void *beat(void *unused) {
  (void)unused;
  struct timespec until;
  clock_gettime(CLOCK_REALTIME, &until);
  pthread_mutex_lock(&mutex);
  while (!line.ending) {
    ++until.tv_sec;
    while (!line.ending && pthread_cond_timedwait(&ended, &mutex, &until) == 0) continue;
    if (!line.ending && line.shown) draw();
  }
  pthread_mutex_unlock(&mutex);
  return NULL;
}

static bool report(double fraction, const char *what, void *user) {
  (void)user;
  if (!line.terminal && !line.lines) return !interrupted;
  double share = line.from + (line.to - line.from) * fmin(fmax(fraction, 0), 1);
  int percent = (int)(100 * share);
  pthread_mutex_lock(&mutex);
  bool changed = percent != line.percent || (what && strncmp(what, line.what, 63) != 0);
  line.percent = percent;
  if (what) snprintf(line.what, sizeof line.what, "%s", what);
  if (line.lines && changed) fprintf(stderr, "%d %%\n", percent);
  if (!line.lines && (changed || !line.shown)) draw();
  pthread_mutex_unlock(&mutex);
  return !interrupted;
}

void app_progress_lines(void) { as_lines = true; }

static void open_line(void) {
  app_progress_end();
  line = (progress_line){.terminal = !as_lines && isatty(STDERR_FILENO) == 1,
                         .lines = as_lines,
                         .percent = -1,
                         .to = 1,
                         .start_s = app_seconds(CLOCK_MONOTONIC)};
  if (!line.terminal) return;
  sigset_t all, before;
  sigfillset(&all); // signals are the business of the thread that works
  pthread_sigmask(SIG_SETMASK, &all, &before);
  line.beating = pthread_create(&line.thread, NULL, beat, NULL) == 0; // else reports alone draw
  pthread_sigmask(SIG_SETMASK, &before, NULL);
}

sonde_progress app_progress(void) {
  app_catch_interrupt();
  open_line();
  return (sonde_progress){report, NULL};
}

void app_progress_begin(const char *what) {
  open_line();
  if (!line.terminal) return;
  pthread_mutex_lock(&mutex);
  snprintf(line.what, sizeof line.what, "%s", what);
  draw();
  pthread_mutex_unlock(&mutex);
}

void app_progress_part(double from, double to) {
  assert(0 <= from && from <= to && to <= 1);
  pthread_mutex_lock(&mutex);
  line.from = from, line.to = to;
  pthread_mutex_unlock(&mutex);
}

void app_progress_end(void) {
  pthread_mutex_lock(&mutex);
  line.ending = true;
  pthread_cond_signal(&ended);
  bool beating = line.beating;
  line.beating = false;
  pthread_mutex_unlock(&mutex);
  if (beating) pthread_join(line.thread, NULL);
  if (line.shown) fprintf(stderr, "\r\033[K");
  line.shown = false;
}
