// Starting another program, or this one once more.
#ifndef SONDE_APP_START_H
#define SONDE_APP_START_H

#include "app.h"

#include <sys/types.h>

enum { APP_STANDARD = -1, APP_NOTHING = -2 }; // a descriptor of ours; /dev/null

// A program to be started without a shell. Descriptors 0 to 2 are those that are named here; every
// other one that is marked close-on-exec stays with us. Signals are as if started from a shell.
typedef struct app_program_start {
  const char *const *words;     // ends with NULL; a first word without / is looked for in PATH
  const char *const *variables; // of its environment, ends with NULL; NULL: ours
  const char *directory;        // that it works in; NULL: ours
  int input, output, errors;    // descriptors, or one of APP_...
  bool own_group;               // Ctrl-C at the terminal does not reach it
} app_program_start;

// The absolute path of this program. 0, or a code of errno.
int app_program(char *path, size_t size);
// Starts a program. 0, or a code of errno: ENOENT when there is none of that name; then *child is
// 0.
int app_start(const app_program_start *what, pid_t *child);
// Waits for a program's end, and asks it to end when an interrupt (app_catch_interrupt) comes
// meanwhile and `ends` is set. What waitpid() tells of it.
int app_await(pid_t child, bool ends);

#endif
