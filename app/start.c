// posix_spawn with the few things that this program asks of it.
#include "start.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

int app_program(char *path, size_t size) {
  assert(path && size > 1);
  const ssize_t length = readlink("/proc/self/exe", path, size - 1);
  if (length < 0) return errno;
  path[length] = 0;
  return length > 0 ? 0 : ENOENT;
}

int app_start(const app_program_start *what, pid_t *child) {
  assert(what->words && what->words[0] && child);
  const int from[3] = {what->input, what->output, what->errors};
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_t actions;
  sigset_t defaults, none;
  *child = 0;
  sigemptyset(&none);
  sigemptyset(&defaults);
  sigaddset(&defaults, SIGINT);
  sigaddset(&defaults, SIGTERM);
  sigaddset(&defaults, SIGPIPE);
  int code = posix_spawnattr_init(&attributes);
  if (code) return code;
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, (short)(POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK |
                                                (what->own_group ? POSIX_SPAWN_SETPGROUP : 0)));
  code = posix_spawn_file_actions_init(&actions);
  if (!code && what->directory)
    code = posix_spawn_file_actions_addchdir_np(&actions, what->directory);
  for (int to = 0; to < 3 && !code; ++to)
    if (from[to] == APP_NOTHING)
      code =
          posix_spawn_file_actions_addopen(&actions, to, "/dev/null", to ? O_WRONLY : O_RDONLY, 0);
    else if (from[to] != APP_STANDARD)
      code = posix_spawn_file_actions_adddup2(&actions, from[to], to);
  // posix_spawn() changes neither words nor variables; its type is older than const.
  char *const *words = (char *const *)(uintptr_t)what->words;
  char *const *variables = what->variables ? (char *const *)(uintptr_t)what->variables : environ;
  if (!code) code = posix_spawnp(child, words[0], &actions, &attributes, words, variables);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (code) *child = 0;
  return code;
}

int app_await(pid_t child, bool ends) {
  assert(child > 0);
  int ended = 0;
  while (waitpid(child, &ended, 0) < 0 && errno == EINTR)
    if (ends && app_interrupted()) kill(child, SIGTERM);
  return ended;
}
