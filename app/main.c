// The program sonde: picks the command of the first argument.
//
// find_command    table entry of a verb
// edit_distance   letters to change between two short words
// suggestion      the verb that an unknown word most resembles
// print_help      list of commands
// told            whether standard output took what was printed
#include "app.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

typedef struct command {
  const char *verb;
  int (*run)(int argc, char **argv);
  const char *summary;
} command;

static const command COMMANDS[] = {
    {"run", cmd_run, "simulate in real time and serve the page"},
    {"fit", cmd_fit, "fit a thigh to measurements and write a model file"},
    {"generate", cmd_generate, "make a thigh from parameters and a seed"},
    {"predict", cmd_predict, "compare a model's forces with measurements"},
    {"measure", cmd_measure, "press a model at its sites with the virtual robot"},
    {"identify", cmd_identify, "find damping and friction from records of a moving probe"},
    {"press", cmd_press, "press once, settle, report force, penetration and vessels"},
    {"image", cmd_image, "write the echographic picture of a model at a pose"},
    {"cut", cmd_cut, "cut the skin along a path and write the cut model"},
    {"simulate", cmd_simulate, "simulate a scene of several bodies"},
    {"reconstruct", cmd_reconstruct, "make a volume from tracked image frames"},
    {"slice", cmd_slice, "make a picture at any pose from tracked frames or a volume"},
    {"replay", cmd_replay, "play a recording again and compare the state hash"},
    {"bench", cmd_bench, "time the simulation's stages"},
    {"exam", cmd_exam, "let a scripted operator examine a case and score it"},
    {"class", cmd_class, "run several learners on one machine"},
    {"cases", cmd_cases, "list, check and draw the cases of the trainer"},
    {"validate", cmd_validate, "measure a room against its targets"},
    {"devices", cmd_devices, "list the input devices of this machine"},
};

enum { COMMAND_COUNT = sizeof COMMANDS / sizeof COMMANDS[0], WORD_MAX = 16 };

static const command *find_command(const char *verb) {
  for (int i = 0; i < COMMAND_COUNT; ++i)
    if (strcmp(COMMANDS[i].verb, verb) == 0) return &COMMANDS[i];
  return NULL;
}

static int least(int a, int b) { return a < b ? a : b; }

// Insertions, deletions and replacements between two words; both must fit WORD_MAX.
static int edit_distance(const char *a, const char *b) {
  int row[WORD_MAX + 1], columns = (int)strlen(b);
  for (int j = 0; j <= columns; ++j) row[j] = j;
  for (int i = 1; a[i - 1]; ++i) {
    int diagonal = row[0];
    row[0] = i;
    for (int j = 1; j <= columns; ++j) {
      int replaced = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = least(replaced, 1 + least(row[j], row[j - 1]));
    }
  }
  return row[columns];
}

static const char *suggestion(const char *word) {
  if (strlen(word) > WORD_MAX) return NULL;
  const char *best = NULL;
  int least_changes = 3; // more than two changes is another word
  for (int i = 0; i < COMMAND_COUNT; ++i) {
    int changes = edit_distance(word, COMMANDS[i].verb);
    if (changes < least_changes) {
      least_changes = changes;
      best = COMMANDS[i].verb;
    }
  }
  return best;
}

static void print_help(FILE *stream) {
  fprintf(stream, "usage: sonde COMMAND [OPTIONS]\n\ncommands:\n");
  for (int i = 0; i < COMMAND_COUNT; ++i)
    fprintf(stream, "  %-11s  %s\n", COMMANDS[i].verb, COMMANDS[i].summary);
  fprintf(stream, "\nsonde COMMAND --help tells the options of a command; sonde --version the "
                  "version.\nExit codes: 0 success, 1 failure, 2 bad input.\n");
}

static int unknown(const char *word) {
  fprintf(stderr, "sonde: unknown command '%s'", word);
  const char *near = suggestion(word);
  if (near) fprintf(stderr, "; did you mean '%s'?", near);
  fprintf(stderr, "\n\n");
  print_help(stderr);
  return APP_BAD_INPUT;
}

static int help_of(const char *verb) {
  const command *found = find_command(verb);
  if (!found) return unknown(verb);
  char name[WORD_MAX + 1], option[] = "--help";
  snprintf(name, sizeof name, "%s", verb);
  char *arguments[] = {name, option, NULL};
  return found->run(2, arguments);
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
    if (argc > 2) return told(help_of(argv[2]));
    print_help(stdout);
    return told(APP_OK);
  }
  const command *found = find_command(word);
  return told(found ? found->run(argc - 1, argv + 1) : unknown(word));
}
