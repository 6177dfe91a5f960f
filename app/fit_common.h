// Shared by fit, predict and measure: options, the error table and its JSON form.
#ifndef SONDE_APP_FIT_COMMON_H
#define SONDE_APP_FIT_COMMON_H

#include "app.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

// An option: with `text` it takes a value, with `flag` it takes none.
typedef struct app_option {
  const char *name;
  const char **text;
  bool *flag;
} app_option;

static inline const app_option *app_find_option(const app_option *options, size_t count,
                                                const char *name) {
  for (size_t i = 0; i < count; ++i)
    if (strcmp(options[i].name, name) == 0) return &options[i];
  return NULL;
}

// Sorts the arguments into options and one positional; false after printing what is wrong.
static inline bool app_take_options(const char *verb, int argc, char **argv,
                                    const app_option *options, size_t count,
                                    const char **positional) {
  for (int i = 1; i < argc; ++i) {
    if (argv[i][0] != '-' || !argv[i][1]) {
      if (*positional) {
        app_usage_error(verb, "unexpected argument '%s' after '%s'", argv[i], *positional);
        return false;
      }
      *positional = argv[i];
      continue;
    }
    const app_option *option = app_find_option(options, count, argv[i]);
    if (!option) {
      app_usage_error(verb, "unknown option '%s'", argv[i]);
      return false;
    }
    if (option->flag) {
      *option->flag = true;
    } else if (i + 1 < argc) {
      *option->text = argv[++i];
    } else {
      app_usage_error(verb, "option %s expects a value", argv[i]);
      return false;
    }
  }
  return true;
}

// Index of a word in a NULL-terminated list; false after printing the list.
static inline bool app_parse_word(const char *verb, const char *option, const char *text,
                                  const char *const *words, int *index) {
  char known[160] = "";
  for (int i = 0; words[i]; ++i) {
    if (strcmp(words[i], text) == 0) {
      *index = i;
      return true;
    }
    size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, "%s%s", used ? ", " : "", words[i]);
  }
  app_usage_error(verb, "%s expects one of %s, got '%s'", option, known, text);
  return false;
}

static inline bool app_require(const char *verb, const char *what, const char *value) {
  if (!value) app_usage_error(verb, "%s is missing", what);
  return value != NULL;
}

static inline void app_print_statistics(const char *name, const sonde_error_statistics *s) {
  printf("  %-10s %6u %8.3f %8.3f %8.3f %10.3f %8.2f %%\n", name, s->count, s->mae_n, s->sd_n,
         s->rmse_n, s->mean_force_n, s->mae_percent);
}

static inline void app_print_report(const char *title, const sonde_error_report *r) {
  printf("%s\n  %-10s %6s %8s %8s %8s %10s %10s\n", title, "probe", "count", "MAE N", "SD N",
         "RMSE N", "mean N", "MAE");
  for (uint32_t p = 0; p < r->probe_count; ++p) app_print_statistics(r->probe[p], &r->probes[p]);
  app_print_statistics("all", &r->all);
}

static inline void app_json_statistics(const char *key, const sonde_error_statistics *s) {
  app_json_object(key);
  app_json_integer("count", s->count);
  app_json_real("mae_n", s->mae_n);
  app_json_real("sd_n", s->sd_n);
  app_json_real("rmse_n", s->rmse_n);
  app_json_real("mean_force_n", s->mean_force_n);
  app_json_real("mae_percent", s->mae_percent);
  app_json_close();
}

// "interaction", "all" and "probes" into the open object.
static inline void app_json_report(const char *interaction, const sonde_error_report *r) {
  app_json_text("interaction", interaction);
  app_json_statistics("all", &r->all);
  app_json_object("probes");
  for (uint32_t p = 0; p < r->probe_count; ++p) app_json_statistics(r->probe[p], &r->probes[p]);
  app_json_close();
}

#endif
