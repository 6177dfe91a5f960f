// One table per command: help, parsing, range checks and the manual page are made from it.
#ifndef SONDE_APP_OPTIONS_H
#define SONDE_APP_OPTIONS_H

#include "app.h"

// States of a vein, for the help of those options that name one.
#define APP_CASES                                                                                  \
  "healthy, partial_mural, free_floating, acute_occlusive, subacute_occlusive, chronic_occlusive " \
  "or recanalised"

typedef enum app_option_kind {
  OPTION_FLAG,     // bool; no value
  OPTION_TEXT,     // const char *
  OPTION_OUTPUT,   // const char *; a file that is written: refused at once when it cannot be
  OPTION_INTEGER,  // of 4 or 8 bytes, within [low, high]
  OPTION_REAL,     // double, within [low, high] before it is multiplied by `scale`
  OPTION_WORD,     // int or enum: index into `words`
  OPTION_NUMBERS,  // double[]: as many as `value` has, between the same signs: "WxH", "A:B,C:D"
  OPTION_WHOLES,   // likewise, whole numbers
  OPTION_CALL,     // what `take` reads; may be given more than once
  OPTION_ARGUMENT, // const char *: a word that is no option, in the order of the table
  OPTION_MODEL,    // likewise; the bundled model when there is none
  OPTION_REST,     // char **: what follows "--", ended by NULL
  OPTION_GROUP     // no option: a title above those that follow
} app_option_kind;

typedef struct app_option {
  const char *name;  // "force-n"; one letter: "o"; both: "o,output"; a title
  const char *value; // what help calls the value
  app_option_kind kind;
  size_t at, bytes; // of the member in the command's options
  double low, high, scale;
  const char *const *words;                      // ended by NULL
  bool (*take)(void *options, const char *text); // false after saying what is wrong
  const char *help;                              // NULL: neither in help nor in the manual
} app_option;

// What a command is, and what it takes. Lists of options are names with blanks between them.
typedef struct app_command {
  const char *verb, *summary;
  const char *usage; // what follows "sonde VERB", a line for each form
  const char *text;  // what it does, for help and manual
  const char *tail;  // said below the options; NULL: nothing
  const app_option *table;
  uint32_t count;
  uint32_t (*extend)(app_option *list, uint32_t room); // more options than `table` has; NULL: none
  size_t size;                                         // of the command's options
  const void *defaults;                                // NULL: zero
  void (*prepare)(void *options);                      // defaults of the library; NULL: none
  const char *required, *one_of, *not_both;
  const char *needs;           // "device>haptics": --device goes with --haptics only
  const char *form;            // "sample": with --sample the other rules are `check`'s; NULL: none
  int (*check)(void *options); // APP_OK, or a code after saying what does not fit; NULL: none
  // The form of the command that the words ask for; NULL: this one.
  const struct app_command *(*pick)(int argc, char **argv);
  int (*run)(void *options);
} app_command;

// A command's own struct is called `options`; a member of another type does not compile.
// NOLINTNEXTLINE(bugprone-macro-parentheses): a type in _Generic() stands without parentheses
#define OPT_AT(m, type) offsetof(options, m), _Generic(((options *)0)->m, type : sizeof(type))
#define OPT_SIZE(m) offsetof(options, m), sizeof(((options *)0)->m)
#define OPT_FLAG(m, name, help)                                                                    \
  { name, NULL, OPTION_FLAG, OPT_AT(m, bool), 0, 0, 0, NULL, NULL, help }
#define OPT_TEXT(m, name, value, help)                                                             \
  { name, value, OPTION_TEXT, OPT_AT(m, const char *), 0, 0, 0, NULL, NULL, help }
#define OPT_OUTPUT(m, name, value, help)                                                           \
  { name, value, OPTION_OUTPUT, OPT_AT(m, const char *), 0, 0, 0, NULL, NULL, help }
#define OPT_INTEGER(m, name, value, low, high, help)                                               \
  { name, value, OPTION_INTEGER, OPT_SIZE(m), low, high, 1, NULL, NULL, help }
#define OPT_REAL(m, name, value, low, high, scale, help)                                           \
  { name, value, OPTION_REAL, OPT_AT(m, double), low, high, scale, NULL, NULL, help }
#define OPT_WORD(m, name, value, words, help)                                                      \
  { name, value, OPTION_WORD, OPT_SIZE(m), 0, 0, 0, words, NULL, help }
#define OPT_NUMBERS(m, name, value, low, high, help)                                               \
  { name, value, OPTION_NUMBERS, OPT_SIZE(m), low, high, 1, NULL, NULL, help }
#define OPT_WHOLES(m, name, value, low, high, help)                                                \
  { name, value, OPTION_WHOLES, OPT_SIZE(m), low, high, 1, NULL, NULL, help }
#define OPT_CALL(take, name, value, help)                                                          \
  { name, value, OPTION_CALL, 0, 0, 0, 0, 0, NULL, take, help }
#define OPT_ARGUMENT(m, name, help)                                                                \
  { name, NULL, OPTION_ARGUMENT, OPT_AT(m, const char *), 0, 0, 0, NULL, NULL, help }
#define OPT_MODEL(m)                                                                               \
  { "MODEL", NULL, OPTION_MODEL, OPT_AT(m, const char *), 0, 0, 0, NULL, NULL, NULL }
#define OPT_REST(m)                                                                                \
  { "--", NULL, OPTION_REST, OPT_AT(m, char **), 0, 0, 0, NULL, NULL, NULL }
#define OPT_GROUP(title)                                                                           \
  { title, NULL, OPTION_GROUP, 0, 0, 0, 0, 0, NULL, NULL, "" }
#define OPT_JSON(m) OPT_FLAG(m, "json", "print one JSON object")
#define OPT_TABLE(list) .table = (list), .count = sizeof(list) / sizeof(*(list))

// Every command.
extern const app_command cmd_run, cmd_fit, cmd_generate, cmd_limb, cmd_predict, cmd_measure,
    cmd_identify, cmd_press, cmd_image, cmd_cut, cmd_simulate, cmd_reconstruct, cmd_slice,
    cmd_replay, cmd_bench, cmd_exam, cmd_class, cmd_cases, cmd_scanner, cmd_validate, cmd_paper,
    cmd_devices, cmd_doppler, cmd_solve, cmd_dataset, cmd_course, cmd_send;
// The form of sonde fit for many subjects.
extern const app_command fit_cohort;

// Options for the parameters of a struct that stands at `at` in the command's options: what a
// command's `extend` returns. The first `room` of `count` are written.
uint32_t app_list_parameters(app_option *list, uint32_t room, const sonde_parameter *p,
                             uint32_t count, size_t at);
// Reads the words behind the verb. -1: go on; else the exit code, after help or after what is
// wrong.
int app_options_read(const app_command *command, int argc, char **argv, void *options);
// Whether the words that were read last had this option; and those words as they were typed, the
// ones with blanks in quotes.
bool app_option_given(const char *name);
// Reads up to `most` numbers from low to high with commas between them; returns how many, 0 when
// the text is anything else.
uint32_t app_read_numbers(const char *text, double low, double high, double *list, uint32_t most);
// Reads the share of one of several processes, I/N with 1 <= I <= N; NULL leaves both numbers.
// Returns APP_OK, or the exit code after saying what is wrong.
int app_shard(const char *verb, const char *text, uint32_t *part, uint32_t *parts);
void app_command_line(char *text, size_t room);

#endif
