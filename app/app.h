// Shared by the subcommands of the program sonde. Uses the public headers only.
#ifndef SONDE_APP_H
#define SONDE_APP_H

#include "sonde/sonde.h"

#include <sys/types.h>
#include <time.h>

// Exit codes of every command.
enum { APP_OK = 0, APP_FAILED = 1, APP_BAD_INPUT = 2 };

// Prints "sonde <verb>: <message>" on stderr and returns the exit code that fits the status.
int app_fail(const char *verb, const sonde_error *error);
// The same for a wrong command line; always APP_BAD_INPUT.
int app_usage_error(const char *verb, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
// Fills the error and returns the status.
sonde_status app_error(sonde_error *error, sonde_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
// Parses a real number of an option within [low, high]; false after printing what was expected.
bool app_parse_real(const char *verb, const char *option, const char *text, double low, double high,
                    double *value);
bool app_parse_integer(const char *verb, const char *option, const char *text, long low, long high,
                       long *value);

// Asks before long work whether an output file (NULL: none) can be written: APP_OK, or the exit
// code after printing why not.
int app_check_output(const char *verb, const char *path);

// Progress on a terminal (stderr), silent in a pipe; Ctrl-C cancels. The line shows what is done,
// its share in per cent and the time; the time goes on while nothing is reported. One piece of work
// at a time; app_progress_end() comes before anything is printed.
sonde_progress app_progress(void);
// From here on the share that is done goes to stderr as lines, "12 %", wherever that is.
void app_progress_lines(void);
// The same for work that reports no share and cannot be cancelled but by ending the program: the
// line says what is done and for how long.
void app_progress_begin(const char *what);
// The fractions reported from here on fill the bar from one share to another: work in parts.
void app_progress_part(double from, double to);
void app_progress_end(void);

// From here on the first Ctrl-C (or SIGTERM) only sets a flag, the second one ends the program.
void app_catch_interrupt(void);
bool app_interrupted(void);

// Path of the bundled model, found beside the program, in the source tree or in the install tree.
// false when there is none; then *searched names the places.
bool app_bundled_model(char *path, size_t size, char *searched, size_t searched_size);

// Path of the bundled leg, found as the bundled model is; false when there is none, or SONDE_MODEL
// names a model instead.
bool app_bundled_leg(char *path, size_t size);

// A clock of the system in seconds.
double app_seconds(clockid_t clock);
// Order statistic: the value that `share` (0..1) of the list does not exceed. Sorts the list; NaN
// when it is empty.
double app_quantile(double *list, size_t count, double share);

// Directory in which the user's data of that name are kept: the given one, else sonde/NAME in
// $XDG_DATA_HOME or ~/.local/share.
void app_data_home(const char *given, const char *name, char *path, size_t size);

// Directory of data that ships (cases, protocols), found as the bundled model is; false when there
// is none.
bool app_data_directory(const char *name, char *path, size_t size);

// The JSON object on standard output: keys in call order, numbers of 9 digits, NaN as null.
void app_json_begin(void);
void app_json_object(const char *key); // nested
void app_json_array(const char *key);  // nested; its members have no keys
void app_json_close(void);             // closes the innermost object or array
void app_json_real(const char *key, double value);
void app_json_integer(const char *key, long long value);
void app_json_bool(const char *key, bool value);
void app_json_text(const char *key, const char *value);
// Several members at once: "force_n:%g steps:%u same:%hhd case:%s"; %hhd is a bool, %u %d %lu %ld
// %llu %lld are integers, with one blank between the members.
void app_json(const char *members, ...) __attribute__((format(printf, 1, 2)));
void app_json_end(void);

#endif
