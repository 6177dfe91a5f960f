// sonde scanner: scanners that ship, their numbers, and scanners fitted to stills.
#include "options.h"
#include "scanner_choice.h"
#include "scanner_fit.h"

#include <assert.h>
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char VERB[] = "scanner";
enum { MOST_FILES = 4096 };

typedef struct options {
  const char *action, *what, *output, *title, *from;
  long evaluations, views, seed;
  scanner_fit fit;
  bool json;
} options;

static void prepare(void *to) {
  *(options *)to =
      (options){.evaluations = 300, .views = 4, .seed = 1, .title = "Fitted to stills"};
}

static bool add_model(void *to, const char *text) {
  scanner_fit *fit = &((options *)to)->fit;
  if (fit->models == SCANNER_FIT_MODELS) {
    fprintf(stderr, "sonde scanner: expected at most %d models\n", SCANNER_FIT_MODELS);
    return false;
  }
  fit->model[fit->models++] = text;
  return true;
}

static const app_option TABLE[] = {
    OPT_ARGUMENT(action, "ACTION", "list, show or fit"),
    OPT_ARGUMENT(what, "WHAT", "a scanner or its file to show, a folder of stills to fit"),
    OPT_JSON(json),
    OPT_GROUP("Fitting"),
    OPT_OUTPUT(output, "o,output", "FILE", "the fitted scanner"),
    OPT_TEXT(title, "title", "TEXT", "its title"),
    OPT_TEXT(from, "from", "NAME|FILE", "the scanner that the search begins with; default venous"),
    OPT_CALL(add_model, "model", "FILE",
             "a model whose pictures are compared with the stills, up to 8; default the bundled "
             "thigh; sonde limb writes better ones"),
    OPT_INTEGER(views, "views", "N", 1, 32, "pictures of each model"),
    OPT_INTEGER(evaluations, "evaluations", "N", 10, 100000, "scanners that are tried"),
    OPT_INTEGER(seed, "seed", "N", 0, 1000000000, "of the search")};

static int check(void *from) {
  const options *o = from;
  const bool lists = o->action && strcmp(o->action, "list") == 0;
  const bool fits = o->action && strcmp(o->action, "fit") == 0;
  if (!o->action || !(lists || fits || strcmp(o->action, "show") == 0))
    return app_usage_error(VERB, "expected list, show or fit, got '%s'",
                           o->action ? o->action : "nothing");
  if (lists == (o->what != NULL))
    return app_usage_error(VERB,
                           lists ? "expected nothing behind list, got '%s'"
                                 : "expected a scanner to show or a folder to fit%s",
                           lists ? o->what : "");
  if (fits && !o->output) return app_usage_error(VERB, "expected -o FILE with fit");
  return APP_OK;
}

static int by_name(const void *a, const void *b) {
  return strcmp(*(char *const *)a, *(char *const *)b);
}

// Names of a folder's files in order, those that end so; *names [*count] and each freed by free().
static sonde_status list_files(const char *directory, const char *const *ends, char ***names,
                               uint32_t *count, sonde_error *error) {
  DIR *list = opendir(directory);
  *count = 0;
  *names = calloc(MOST_FILES, sizeof **names);
  if (!list || !*names) {
    if (list) closedir(list);
    return app_error(error, list ? SONDE_MEMORY : SONDE_IO, "%s: expected a folder", directory);
  }
  for (const struct dirent *item; (item = readdir(list)) && *count < MOST_FILES;)
    for (const char *const *end = ends; *end; ++end) {
      const size_t length = strlen(item->d_name), tail = strlen(*end);
      if (length > tail && strcmp(item->d_name + length - tail, *end) == 0)
        (*names)[(*count)++] = strdup(item->d_name);
    }
  closedir(list);
  qsort(*names, *count, sizeof **names, by_name);
  return SONDE_OK;
}

static void free_names(char **names, uint32_t count) {
  for (uint32_t k = 0; k < count; ++k) free(names[k]);
  free(names);
}

static sonde_status list_scanners(bool json, sonde_error *error) {
  static const char *const YAML[] = {".yaml", NULL};
  char directory[4096], path[5120], title[256], **names;
  uint32_t count;
  app_data_directory("scanners", directory, sizeof directory);
  sonde_status status = list_files(directory, YAML, &names, &count, error);
  if (!status && json) app_json_begin();
  if (!status && !json) printf("%-14s %s\n", "plain", "one look and a logarithm, nothing else");
  for (uint32_t k = 0; k < count && !status; ++k) {
    sonde_scanner scanner;
    snprintf(path, sizeof path, "%s/%s", directory, names[k]);
    status = sonde_scanner_load(path, &scanner, title, sizeof title, error);
    names[k][strlen(names[k]) - strlen(YAML[0])] = 0;
    if (status) break;
    if (json)
      app_json_text(names[k], title);
    else
      printf("%-14s %s\n", names[k], title);
  }
  if (!status && json) app_json_end();
  free_names(names, count);
  return status;
}

// Quantiles of the stills of a folder.
static sonde_status measure_stills(options *o, uint32_t *stills, uint32_t *patches,
                                   sonde_error *error) {
  static const char *const PICTURES[] = {".png", ".jpg", ".jpeg", ".PNG", ".JPG", NULL};
  char path[5120], **names = NULL;
  uint32_t count = 0;
  texture_table *table = calloc(1, sizeof *table);
  sonde_status status = table ? list_files(o->what, PICTURES, &names, &count, error)
                              : app_error(error, SONDE_MEMORY, "no memory for the stills");
  if (!status && count < 4)
    status = app_error(error, SONDE_ARGUMENT, "%s holds %u stills, expected 4 or more PNG or JPEG",
                       o->what, count);
  for (uint32_t k = 0; k < count && !status; ++k) {
    sonde_image still;
    snprintf(path, sizeof path, "%.4000s/%.1000s", o->what, names[k]);
    status = sonde_image_load(path, &still, error);
    if (status) break;
    const uint32_t share = TEXTURE_MOST_PATCHES / count;
    texture_add(table, &still, share < 48 ? share : 48);
    sonde_image_clear(&still);
  }
  if (!status && table->patches < 32)
    status = app_error(error, SONDE_ARGUMENT,
                       "%s holds %u patches of 64 x 64 pixels that are not black, expected 32",
                       o->what, table->patches);
  if (!status) {
    texture_quantiles(table, o->fit.real);
    o->fit.real_dark = (double)table->dark / (table->dark + table->patches);
  }
  *stills = count, *patches = table ? table->patches : 0;
  free_names(names, count);
  free(table);
  return status;
}

static sonde_status fit(options *o, sonde_error *error) {
  static char bundled[4096], searched[8192];
  uint32_t stills = 0, patches = 0;
  scanner_fit *f = &o->fit;
  f->evaluations = (uint32_t)o->evaluations, f->views = (uint32_t)o->views;
  f->seed = (uint64_t)o->seed;
  if (f->models == 0) {
    if (!app_bundled_model(bundled, sizeof bundled, searched, sizeof searched))
      return app_error(error, SONDE_NOT_FOUND, "no bundled thigh at %s", searched);
    f->model[f->models++] = bundled;
  }
  sonde_status status = scanner_choose(o->from ? o->from : "venous", &f->scanner, error);
  if (!status) status = measure_stills(o, &stills, &patches, error);
  if (!status) status = scanner_fit_run(f, error);
  if (!status) status = sonde_scanner_save(&f->scanner, o->title, o->output, error);
  if (status) return status;
  if (o->json) {
    app_json_begin();
    app_json("scanner:%s before:%g after:%g", o->output, f->before, f->after);
    app_json_integer("stills", stills);
    app_json_integer("patches", patches);
    app_json_end();
    return SONDE_OK;
  }
  printf("%u stills, %u patches; mean squared distance of the quantiles %.3f, at first %.3f\n",
         stills, patches, f->after, f->before);
  printf("%-16s %28s   %28s\n", "quantiles", "stills 10/50/90 %", "pictures 10/50/90 %");
  for (uint32_t n = 0; n < TEXTURE_FEATURES; ++n)
    printf("%-16s %8.3g  %8.3g  %8.3g   %8.3g  %8.3g  %8.3g\n", texture_name(n), f->real[n][0],
           f->real[n][1], f->real[n][2], f->found[n][0], f->found[n][1], f->found[n][2]);
  return SONDE_OK;
}

static int run(void *from) {
  options *o = from;
  sonde_error error = {0};
  sonde_status status;
  assert(o->action != NULL);
  if (strcmp(o->action, "list") == 0) {
    status = list_scanners(o->json, &error);
    return status ? app_fail(VERB, &error) : APP_OK;
  }
  if (strcmp(o->action, "fit") == 0) {
    app_catch_interrupt();
    status = fit(o, &error);
    return status ? app_fail(VERB, &error) : APP_OK;
  }
  // All numbers of one scanner.
  sonde_scanner scanner;
  if (scanner_choose(o->what, &scanner, &error)) return app_fail(VERB, &error);
  uint32_t count;
  const sonde_scanner_number *numbers = sonde_scanner_numbers(&count);
  if (o->json) app_json_begin();
  for (const sonde_scanner_number *n = numbers; n < numbers + count; ++n) {
    const double value =
        *(const double *)(const void *)((const char *)&scanner + n->offset) / n->si;
    if (o->json)
      app_json_real(n->key, value);
    else
      printf("%-18s %10.4g   %g to %g, plain %g\n", n->key, value, n->low, n->high, n->plain);
  }
  if (o->json)
    app_json_array("sliders_db");
  else
    printf("%-18s", "sliders_db");
  for (int k = 0; k < SONDE_SCANNER_SLIDERS; ++k)
    if (o->json)
      app_json_real(NULL, scanner.slider_db[k]);
    else
      printf(" %g", scanner.slider_db[k]);
  if (o->json) {
    app_json_close();
    app_json_end();
  } else {
    printf("\n");
  }
  return APP_OK;
}

const app_command cmd_scanner = {
    .verb = "scanner",
    .summary = "list and show scanners, fit one to stills",
    .usage = "list|show NAME|fit DIR [-o FILE] [options]",
    .text =
        "Lists the scanners that ship, shows the numbers of one, or searches the numbers whose "
        "pictures have the texture of the stills in a folder. A scanner file holds numbers only. "
        "Ctrl-C ends the search; the best scanner so far is written.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .prepare = prepare,
    .check = check,
    .run = run};
