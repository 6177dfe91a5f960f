// The program sonde: picks the command of the first argument.
#include "options.h"

#include <assert.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

// In the order of help.
static const app_command *const COMMANDS[] = {
    &cmd_run,      &cmd_fit,         &cmd_generate, &cmd_limb,   &cmd_predict, &cmd_measure,
    &cmd_identify, &cmd_press,       &cmd_solve,    &cmd_image,  &cmd_doppler, &cmd_cut,
    &cmd_simulate, &cmd_reconstruct, &cmd_slice,    &cmd_replay, &cmd_send,    &cmd_dataset,
    &cmd_bench,    &cmd_exam,        &cmd_class,    &cmd_cases,  &cmd_course,  &cmd_scanner,
    &cmd_validate, &cmd_paper,       &cmd_devices};

enum { COMMAND_COUNT = sizeof COMMANDS / sizeof COMMANDS[0], WORD_MAX = 16 };

static void print_help(FILE *stream) {
  fprintf(stream, "usage: sonde COMMAND [OPTIONS]\n\ncommands:\n");
  for (int i = 0; i < COMMAND_COUNT; ++i)
    fprintf(stream, "  %-11s  %s\n", COMMANDS[i]->verb, COMMANDS[i]->summary);
  fprintf(stream, "\nsonde COMMAND --help tells the options of a command; sonde --version the "
                  "version.\nExit codes: 0 success, 1 failure, 2 bad input.\n");
}

static int run_command(const char *verb, int argc, char **argv) {
  static _Alignas(max_align_t) char options[16384];
  const app_command *command = NULL;
  for (int i = 0; i < COMMAND_COUNT && !command; ++i)
    if (strcmp(COMMANDS[i]->verb, verb) == 0) command = COMMANDS[i];
  if (!command) {
    // The verb that an unknown word most resembles: insertions, deletions and replacements of
    // letters are counted; more than two make another word. NULL: none.
    const char *near = NULL;
    int least_changes = 3;
    for (int i = 0; i < COMMAND_COUNT && strlen(verb) <= WORD_MAX; ++i) {
      const char *name = COMMANDS[i]->verb;
      int row[WORD_MAX + 1], columns = (int)strlen(name);
      assert(columns <= WORD_MAX);
      for (int j = 0; j <= columns; ++j) row[j] = j;
      for (int k = 1; verb[k - 1]; ++k) {
        int diagonal = row[0];
        row[0] = k;
        for (int j = 1; j <= columns; ++j) {
          int replaced = diagonal + (verb[k - 1] != name[j - 1]);
          int moved = 1 + (row[j] < row[j - 1] ? row[j] : row[j - 1]);
          diagonal = row[j];
          row[j] = replaced < moved ? replaced : moved;
        }
      }
      if (row[columns] < least_changes) least_changes = row[columns], near = name;
    }
    fprintf(stderr, "sonde: unknown command '%s'", verb);
    if (near) fprintf(stderr, "; did you mean '%s'?", near);
    fprintf(stderr, "\n\n");
    print_help(stderr);
    return APP_BAD_INPUT;
  }
  const app_command *form = command->pick ? command->pick(argc, argv) : NULL;
  if (form) command = form;
  assert(command->size <= sizeof options);
  int code = app_options_read(command, argc, argv, options);
  return code >= 0 ? code : command->run(options);
}

static void print_remark(sonde_log_level level, const char *message, void *user) {
  (void)user;
  if (level >= SONDE_LOG_WARNING) fprintf(stderr, "sonde: %s\n", message);
}

// A result that did not reach standard output is a failure.
static int told(int code) {
  if (fflush(stdout) == 0 && !ferror(stdout)) return code;
  fprintf(stderr, "sonde: standard output cannot be written: %s\n", strerror(errno));
  return code == APP_OK ? APP_FAILED : code;
}

int main(int argc, char **argv) {
  sonde_set_log(print_remark, NULL);
  signal(SIGXFSZ, SIG_IGN); // a file beyond the limit is told by write()
  if (argc < 2) {
    print_help(stderr);
    return APP_BAD_INPUT;
  }
  const char *word = argv[1];
  if (strcmp(word, "--version") == 0) {
    printf("sonde %s\n", sonde_version());
    return told(APP_OK);
  }
  if (strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0 || strcmp(word, "help") == 0) {
    char option[] = "--help", *help[] = {argv[2], option, NULL};
    if (argc > 2) return told(run_command(argv[2], 2, help));
    print_help(stdout);
    return told(APP_OK);
  }
  return told(run_command(word, argc - 1, argv + 1));
}
