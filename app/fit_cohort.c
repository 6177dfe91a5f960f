// sonde fit --cohort: many subjects, each fitted by a process of its own, so that none can end
// another.
//
// Subject k belongs to process k mod N, with N and the process's number from MPI's starter or
// --shard. What a subject gave is one file, written when it is whole and valid for the very input
// it names by a hash: the same words again do what is missing. Whoever finds all subjects whole
// writes table and report.
#include "options.h"
#include "start.h"

#include <assert.h>
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

static const char VERB[] = "fit";

enum {
  MOST_SUBJECTS = 100000,
  MOST_WORDS = 64,
  MOST_COLUMNS = 32,
  MOST_NUMBERS = 64,
  PATH_TEXT = 4096,
  ID_TEXT = 65
};

typedef struct options {
  const char *cohort, *directory, *shard;
  char **rest; // words of every fit
  uint32_t part, parts;
  bool json;
} options;

static const options DEFAULTS = {.part = 1, .parts = 1};

static const app_option TABLE[] = {
    OPT_TEXT(
        cohort, "cohort", "LIST|DIR",
        "the subjects: a table with the columns subject and measurements, and options of sonde "
        "fit as further columns (surface, sites, femur, ...), files relative to the table; or a "
        "directory whose folders have indentation.csv, skin.ply and sites.csv"),
    OPT_TEXT(directory, "o,output", "DIR",
             "where models, results, table and report go; made when it is absent"),
    OPT_TEXT(
        shard, "shard", "I/N",
        "fit every N-th subject from the I-th; default: as Open MPI or MPICH says that started "
        "the program, else all"),
    OPT_FLAG(json, "json", "print one JSON object: subjects, fitted, failed, kept, whole, seconds"),
    OPT_REST(rest)};

typedef struct subject {
  char id[ID_TEXT];
  char *words[MOST_WORDS]; // behind "sonde fit", ended by NULL; owned
  uint32_t count;
  uint64_t inputs;
} subject;

typedef struct cohort {
  char home[PATH_TEXT], directory[PATH_TEXT], program[PATH_TEXT]; // absolute; of the list; results
  const char *ending;                                             // of what a fit writes
  subject *list;
  uint32_t count;
} cohort;

// ---- the subjects

static sonde_status add_word(subject *s, const char *word, sonde_error *error) {
  if (s->count + 6 > MOST_WORDS)
    return app_error(error, SONDE_ARGUMENT, "subject %s: more than %d words of options", s->id,
                     MOST_WORDS - 6);
  s->words[s->count] = strdup(word);
  return s->words[s->count++] ? SONDE_OK : app_error(error, SONDE_MEMORY, "out of memory");
}

static sonde_status add_subject(cohort *c, const char *id, const char *where, sonde_error *error) {
  const size_t length = strlen(id);
  bool good = length > 0 && length < ID_TEXT && id[0] != '.' && id[0] != '-';
  for (const char *p = id; *p; ++p)
    good &= (*p >= '0' && *p <= '9') || (*p >= 'a' && *p <= 'z') || (*p >= 'A' && *p <= 'Z') ||
            strchr("._-", *p);
  if (!good || strcmp(id, "cohort") == 0)
    return app_error(error, SONDE_FORMAT,
                     "%.200s: a subject is named by 1 to %d letters, digits, '.', '_' or '-', not "
                     "'%.80s'",
                     where, ID_TEXT - 1, id);
  for (uint32_t k = 0; k < c->count; ++k)
    if (strcmp(c->list[k].id, id) == 0)
      return app_error(error, SONDE_FORMAT, "%.200s: subject %s stands there twice", where, id);
  if (c->count == MOST_SUBJECTS)
    return app_error(error, SONDE_FORMAT, "%.200s: more than %d subjects", where, MOST_SUBJECTS);
  subject *grown = realloc(c->list, (c->count + 1) * sizeof *grown);
  if (!grown) return app_error(error, SONDE_MEMORY, "out of memory");
  c->list = grown;
  subject *s = &c->list[c->count++];
  *s = (subject){0};
  snprintf(s->id, sizeof s->id, "%s", id);
  return SONDE_OK;
}

// Cuts a line into cells. @return how many it has, of which the first MOST_COLUMNS are told
static uint32_t split(char *line, char *cell[MOST_COLUMNS]) {
  uint32_t count = 0;
  line[strcspn(line, "\r\n")] = 0;
  for (char *at = line; at; ++count) {
    if (count < MOST_COLUMNS) cell[count] = at;
    at = strchr(at, ',');
    if (at) *at++ = 0;
  }
  return count;
}

static sonde_status read_table(cohort *c, const char *path, sonde_error *error) {
  char *text = NULL, *line = NULL, *name[MOST_COLUMNS], *cell[MOST_COLUMNS];
  size_t size = 0;
  uint32_t columns = 0, number = 0, known = 0;
  sonde_status status = sonde_file_load(path, &text, &size, error);
  char *rest = status ? NULL : text + (strncmp(text, "\xef\xbb\xbf", 3) == 0 ? 3 : 0);
  while (!status && (line = strsep(&rest, "\n"))) {
    char where[300];
    snprintf(where, sizeof where, "%.250s:%u", path, ++number);
    if (line[0] == '#' || line[strspn(line, " \r")] == 0) continue;
    if (!columns) {
      columns = split(line, name);
      if (columns > MOST_COLUMNS)
        status = app_error(error, SONDE_FORMAT, "%s: %u columns, expected at most %d", where,
                           columns, MOST_COLUMNS);
      for (uint32_t k = 0; k < columns && !status; ++k) {
        known += strcmp(name[k], "subject") == 0 || strcmp(name[k], "measurements") == 0;
        static const char *const ours[] = {"o", "output", "json", "cohort", "shard", "sample"};
        for (size_t i = 0; i < sizeof ours / sizeof *ours && !status; ++i)
          if (strcmp(name[k], ours[i]) == 0)
            status = app_error(error, SONDE_FORMAT, "%s: the column %s is not a subject's", where,
                               ours[i]);
      }
      if (!status && known != 2)
        status = app_error(error, SONDE_FORMAT,
                           "%s: expected one column subject and one column measurements", where);
    } else {
      const uint32_t cells = split(line, cell);
      if (cells != columns)
        status = app_error(error, SONDE_FORMAT, "%s: %u cells, expected %u", where, cells, columns);
      // The measurements stand first among the words, the other columns are options.
      const char *id = NULL, *measurements = NULL;
      for (uint32_t k = 0; k < columns && !status; ++k) {
        if (strcmp(name[k], "subject") == 0) id = cell[k];
        if (strcmp(name[k], "measurements") == 0) measurements = cell[k];
      }
      if (!status) status = add_subject(c, id, where, error);
      if (!status) status = add_word(&c->list[c->count - 1], measurements, error);
      for (uint32_t k = 0; k < columns && !status; ++k) {
        char option[80];
        if (cell[k] == id || cell[k] == measurements || !cell[k][0]) continue;
        snprintf(option, sizeof option, "--%.70s", name[k]);
        status = add_word(&c->list[c->count - 1], option, error);
        if (!status) status = add_word(&c->list[c->count - 1], cell[k], error);
      }
    }
  }
  sonde_free(text);
  return status;
}

static sonde_status read_folders(cohort *c, const char *path, sonde_error *error) {
  struct dirent **list = NULL;
  static const char *const files[3][2] = {
      {NULL, "indentation.csv"}, {"--surface", "skin.ply"}, {"--sites", "sites.csv"}};
  const int count = scandir(path, &list, NULL, alphasort);
  sonde_status status = SONDE_OK;
  if (count < 0) status = app_error(error, SONDE_IO, "%.300s: %s", path, strerror(errno));
  for (int k = 0; k < count; ++k) {
    char file[PATH_TEXT];
    const char *id = list[k]->d_name;
    snprintf(file, sizeof file, "%.3000s/%.255s/indentation.csv", path, id);
    if (!status && id[0] != '.' && access(file, F_OK) == 0) {
      status = add_subject(c, id, path, error);
      for (int i = 0; i < 3 && !status; ++i) {
        snprintf(file, sizeof file, "%.255s/%s", id, files[i][1]);
        if (files[i][0]) status = add_word(&c->list[c->count - 1], files[i][0], error);
        if (!status) status = add_word(&c->list[c->count - 1], file, error);
      }
    }
    free(list[k]);
  }
  free(list);
  return status;
}

// ---- results

static char *result_path(const cohort *c, const subject *s, const char *ending,
                         char path[2 * PATH_TEXT]) {
  snprintf(path, 2 * PATH_TEXT, "%s/%s%s", c->directory, s->id, ending);
  return path;
}

// The result of a subject, when it is there for this very input; NULL: it is not.
static sonde_json *find_result(const cohort *c, const subject *s) {
  char path[2 * PATH_TEXT], hash[20], *text = NULL;
  size_t size = 0;
  sonde_json *root = NULL;
  struct stat facts;
  if (stat(result_path(c, s, ".json", path), &facts) || sonde_file_load(path, &text, &size, NULL))
    return NULL;
  snprintf(hash, sizeof hash, "%016llx", (unsigned long long)s->inputs);
  if (sonde_json_parse(text, size, NULL, &root, NULL)) root = NULL;
  sonde_free(text);
  const char *inputs = sonde_json_as_text(sonde_json_member(root, "inputs"));
  const char *fitted = sonde_json_as_text(sonde_json_member(root, "status"));
  const bool there =
      inputs && fitted && strcmp(inputs, hash) == 0 &&
      (strcmp(fitted, "fitted") != 0 || access(result_path(c, s, c->ending, path), R_OK) == 0);
  if (there) return root;
  sonde_json_free(root);
  return NULL;
}

static bool is_fitted(const sonde_json *result) {
  const char *status = sonde_json_as_text(sonde_json_member(result, "status"));
  return status && strcmp(status, "fitted") == 0;
}

// Numbers of a fit's JSON object: its own ones and those of "all". The time is no result.
static void put_numbers(sonde_json_out *out, const sonde_json *of, const char *prefix) {
  for (const sonde_json *v = sonde_json_first(of); v; v = sonde_json_next(v)) {
    char key[100];
    snprintf(key, sizeof key, "%s%.80s", prefix, sonde_json_key(v));
    if (sonde_json_kind_of(v) == SONDE_JSON_NUMBER && strcmp(key, "seconds") != 0)
      sonde_json_put_real(out, key, sonde_json_as_number(v), 9);
    else if (sonde_json_kind_of(v) == SONDE_JSON_OBJECT && strcmp(key, "all") == 0)
      put_numbers(out, v, "all_");
  }
}

// Fits one subject in a process of its own and writes its result. @return DISK, MEMORY or
// CANCELLED; that the fit failed is a result
static sonde_status fit_subject(const cohort *c, const subject *s, bool *fitted,
                                sonde_error *error) {
  char model[2 * PATH_TEXT], path[2 * PATH_TEXT], said[40], told[40];
  const char *words[MOST_WORDS + 8] = {c->program, VERB};
  uint32_t count = 2;
  for (uint32_t k = 0; k < s->count; ++k) words[count++] = s->words[k];
  words[count++] = "-o", words[count++] = result_path(c, s, c->ending, model);
  words[count++] = "--json";
  // What it says is kept in memory, so that a killed process leaves nothing of it.
  const int out_fd = memfd_create("out", MFD_CLOEXEC), err_fd = memfd_create("err", MFD_CLOEXEC);
  snprintf(said, sizeof said, "/proc/self/fd/%d", out_fd);
  snprintf(told, sizeof told, "/proc/self/fd/%d", err_fd);
  (void)sonde_file_remove_abandoned(model);
  if (out_fd < 0 || err_fd < 0)
    return app_error(error, SONDE_MEMORY, "out of memory or of file descriptors");
  const app_program_start what = {.words = words,
                                  .directory = c->home,
                                  .input = APP_NOTHING,
                                  .output = out_fd,
                                  .errors = err_fd};
  pid_t child;
  const int code = app_start(&what, &child);
  if (code) return app_error(error, SONDE_DISK, "%s: not started: %s", s->id, strerror(code));
  const int ended = app_await(child, true);
  char *out_text = NULL, *err_text = NULL, message[400] = "";
  size_t out_size = 0, err_size = 0;
  sonde_json *root = NULL;
  sonde_status status = sonde_file_load(said, &out_text, &out_size, error);
  if (!status) status = sonde_file_load(told, &err_text, &err_size, error);
  *fitted = !status && WIFEXITED(ended) && WEXITSTATUS(ended) == 0 &&
            !sonde_json_parse(out_text, out_size, NULL, &root, NULL);
  if (!status && !*fitted) { // the last line says why
    while (err_size > 0 && err_text[err_size - 1] == '\n') err_text[--err_size] = 0;
    const char *line = err_size ? strrchr(err_text, '\n') : NULL;
    line = line ? line + 1 : err_text;
    if (strncmp(line, "sonde fit: ", 11) == 0) line += 11;
    snprintf(message, sizeof message, "%.390s", line);
    if (WIFSIGNALED(ended))
      snprintf(message, sizeof message, "ended by signal %d", WTERMSIG(ended));
  }
  close(out_fd), close(err_fd);
  sonde_json_out out = {.layout = SONDE_JSON_LINES};
  if (app_interrupted())
    status = app_error(error, SONDE_CANCELLED, "cancelled; what is whole is kept");
  if (!status) status = sonde_file_create(result_path(c, s, ".json", path), &out.file, error);
  if (!status) {
    char hash[20];
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)s->inputs);
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "subject", s->id);
    sonde_json_put_text(&out, "inputs", hash);
    sonde_json_put_text(&out, "status", *fitted ? "fitted" : "failed");
    sonde_json_put_text(&out, "message", message);
    sonde_json_put_bool(&out, "converged", *fitted && !strstr(err_text, "before it converged"));
    sonde_json_begin_object(&out, "fit");
    put_numbers(&out, root, "");
    sonde_json_end(&out);
    sonde_json_end(&out);
    sonde_file_printf(out.file, "\n");
    status = sonde_file_commit(out.file, error);
  }
  sonde_json_free(root);
  sonde_free(out_text);
  sonde_free(err_text);
  return status;
}

// ---- table and report

// Mean, standard deviation and range of a number over the fitted subjects.
typedef struct column {
  const char *key;
  uint32_t count;
  double mean, m2, least, most;
} column;

// As JSON and as a text to be read: what failed and why, and each number over the cohort.
static sonde_status write_report(const cohort *c, sonde_json *const result[], const column *columns,
                                 uint32_t count, uint32_t fitted, sonde_error *error) {
  char path[2 * PATH_TEXT];
  sonde_json_out out = {.layout = SONDE_JSON_LINES};
  sonde_file *file = NULL;
  snprintf(path, sizeof path, "%s/cohort.json", c->directory);
  sonde_status status = sonde_file_create(path, &out.file, error);
  if (status) return status;
  snprintf(path, sizeof path, "%s/cohort.txt", c->directory);
  status = sonde_file_create(path, &file, error);
  if (status) {
    sonde_file_discard(out.file);
    return status;
  }
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_integer(&out, "subjects", c->count);
  sonde_json_put_integer(&out, "fitted", fitted);
  sonde_file_printf(file, "%u subjects, %u fitted, %u failed\n", c->count, fitted,
                    c->count - fitted);
  sonde_json_begin_object(&out, "failed");
  for (uint32_t k = 0; k < c->count; ++k) {
    if (is_fitted(result[k])) continue;
    const char *message = sonde_json_as_text(sonde_json_member(result[k], "message"));
    sonde_json_put_text(&out, c->list[k].id, message);
    sonde_file_printf(file, "failed: %s: %s\n", c->list[k].id, message);
  }
  sonde_json_end(&out);
  sonde_json_begin_object(&out, "numbers");
  sonde_file_printf(file, "\n%-28s %6s %14s %14s %14s %14s\n", "number", "of", "mean", "SD",
                    "least", "most");
  for (uint32_t i = 0; i < count; ++i) {
    const column *n = &columns[i];
    const double sd = n->count > 1 ? sqrt(n->m2 / (n->count - 1)) : NAN;
    sonde_json_begin_object(&out, n->key);
    sonde_json_put_integer(&out, "count", n->count);
    sonde_json_put_real(&out, "mean", n->mean, 9);
    sonde_json_put_real(&out, "sd", sd, 9);
    sonde_json_put_real(&out, "least", n->least, 9);
    sonde_json_put_real(&out, "most", n->most, 9);
    sonde_json_end(&out);
    sonde_file_printf(file, "%-28s %6u %14.6g %14.6g %14.6g %14.6g\n", n->key, n->count, n->mean,
                      sd, n->least, n->most);
  }
  sonde_json_end(&out);
  sonde_json_end(&out);
  sonde_file_printf(out.file, "\n");
  status = sonde_file_commit(out.file, error);
  if (!status) return sonde_file_commit(file, error);
  sonde_file_discard(file);
  return status;
}

// Table and report, when every subject is whole. @return how many are, in *whole
static sonde_status conclude(const cohort *c, uint32_t *whole, uint32_t *fitted,
                             sonde_error *error) {
  sonde_json **result = calloc(c->count, sizeof *result);
  sonde_status status = result ? SONDE_OK : app_error(error, SONDE_MEMORY, "out of memory");
  column columns[MOST_NUMBERS];
  uint32_t count = 0;
  *whole = *fitted = 0;
  for (uint32_t k = 0; k < c->count && !status; ++k) {
    result[k] = find_result(c, &c->list[k]);
    *whole += result[k] != NULL;
    if (!result[k] || !is_fitted(result[k])) continue;
    const sonde_json *fit = sonde_json_member(result[k], "fit");
    // The first fitted subject names the columns.
    for (const sonde_json *v = *fitted ? NULL : sonde_json_first(fit); v; v = sonde_json_next(v)) {
      assert(count < MOST_NUMBERS);
      columns[count++] = (column){.key = sonde_json_key(v), .least = INFINITY, .most = -INFINITY};
    }
    ++*fitted;
    for (column *n = columns; n < columns + count; ++n) {
      const double value = sonde_json_as_number(sonde_json_member(fit, n->key));
      if (!isfinite(value)) continue;
      const double off = value - n->mean;
      n->mean += off / ++n->count;
      n->m2 += off * (value - n->mean);
      n->least = fmin(n->least, value), n->most = fmax(n->most, value);
    }
  }
  const bool all = !status && *whole == c->count;
  sonde_file *file = NULL;
  char path[2 * PATH_TEXT];
  snprintf(path, sizeof path, "%s/cohort.csv", c->directory);
  if (all) status = sonde_file_create(path, &file, error);
  if (file) sonde_file_printf(file, "subject,status,converged,message");
  for (uint32_t i = 0; file && i < count; ++i) sonde_file_printf(file, ",%s", columns[i].key);
  for (uint32_t k = 0; file && k < c->count; ++k) {
    const sonde_json *fit = sonde_json_member(result[k], "fit"),
                     *converged = sonde_json_member(result[k], "converged");
    sonde_file_printf(file, "\n%s,%s,%s,", c->list[k].id,
                      is_fitted(result[k]) ? "fitted" : "failed",
                      sonde_json_kind_of(converged) == SONDE_JSON_TRUE ? "true" : "false");
    sonde_csv_put_text(file, sonde_json_as_text(sonde_json_member(result[k], "message")));
    for (uint32_t i = 0; i < count; ++i) {
      const double value = sonde_json_as_number(sonde_json_member(fit, columns[i].key));
      sonde_file_printf(file, isfinite(value) ? ",%.9g" : ",", value);
    }
  }
  if (file) {
    sonde_file_printf(file, "\n");
    status = sonde_file_commit(file, error);
  }
  if (all && !status) status = write_report(c, result, columns, count, *fitted, error);
  for (uint32_t k = 0; result && k < c->count; ++k) sonde_json_free(result[k]);
  free(result);
  return status;
}

// ---- the command

static int check(void *from) {
  options *o = from;
  if (!o->directory || !o->cohort)
    return app_usage_error(VERB, "--cohort LIST needs -o DIR; options of the fits follow --");
  // Number and count of this process as the starters of MPI tell: Open MPI, MPICH and Slurm's PMI.
  static const char *const told[][2] = {{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                        {"PMI_RANK", "PMI_SIZE"}};
  for (size_t k = 0; k < sizeof told / sizeof *told && !o->shard; ++k) {
    const char *rank = getenv(told[k][0]), *size = getenv(told[k][1]);
    if (!rank || !size) continue;
    const long part = strtol(rank, NULL, 10) + 1, parts = strtol(size, NULL, 10);
    if (part < 1 || part > parts || parts > 1000000)
      return app_usage_error(VERB, "%s=%s and %s=%s are no process of a group", told[k][0], rank,
                             told[k][1], size);
    o->part = (uint32_t)part, o->parts = (uint32_t)parts;
    break;
  }
  if (app_shard(VERB, o->shard, &o->part, &o->parts)) return APP_BAD_INPUT;
  static const char *const ours[] = {"-o", "--output", "--json", "--cohort", "--shard", "--sample"};
  for (char **word = o->rest; word && *word; ++word)
    for (size_t k = 0; k < sizeof ours / sizeof *ours; ++k)
      if (strncmp(*word, ours[k], strlen(ours[k])) == 0)
        return app_usage_error(VERB, "%s does not go behind --: each fit has its own", *word);
  return APP_OK;
}

static sonde_status prepare_cohort(const options *o, cohort *c, sonde_error *error) {
  char list[PATH_TEXT];
  struct stat facts;
  c->ending = ".sonde";
  for (char **word = o->rest; word && *word; ++word)
    if (strcmp(*word, "--solid") == 0) c->ending = ".csv";
  const int code = app_program(c->program, sizeof c->program);
  if (code) return app_error(error, SONDE_DISK, "/proc/self/exe: %s", strerror(code));
  if (!realpath(o->cohort, list) || stat(list, &facts))
    return app_error(error, SONDE_NOT_FOUND, "%.300s: %s", o->cohort, strerror(errno));
  const bool folders = S_ISDIR(facts.st_mode);
  snprintf(c->home, sizeof c->home, "%s", list);
  if (!folders) *strrchr(c->home, '/') = 0;
  sonde_status status = folders ? read_folders(c, list, error) : read_table(c, o->cohort, error);
  if (!status && c->count == 0)
    status = app_error(error, SONDE_NOT_FOUND,
                       folders ? "%.300s: no folder has an indentation.csv"
                               : "%.300s: the table has no subject",
                       o->cohort);
  for (uint32_t k = 0; k < c->count && !status; ++k) {
    for (char **word = o->rest; word && *word && !status; ++word)
      status = add_word(&c->list[k], *word, error);
    // What its result depends on: program, words, and the files that words name.
    uint64_t hash = sonde_hash(0, sonde_version(), strlen(sonde_version()));
    for (uint32_t i = 0; i < c->list[k].count; ++i) {
      char path[2 * PATH_TEXT], *bytes = NULL;
      const char *word = c->list[k].words[i];
      size_t size = 0;
      hash = sonde_hash(hash, word, strlen(word) + 1);
      snprintf(path, sizeof path, "%s%s%s", word[0] == '/' ? "" : c->home,
               word[0] == '/' ? "" : "/", word);
      if (stat(path, &facts) || !S_ISREG(facts.st_mode)) continue;
      if (!sonde_file_load(path, &bytes, &size, NULL)) hash = sonde_hash(hash, bytes, size);
      sonde_free(bytes);
    }
    c->list[k].inputs = hash;
  }
  if (!status) status = sonde_directory_make(o->directory, 0777, true, error);
  if (!status && !realpath(o->directory, c->directory))
    status = app_error(error, SONDE_IO, "%.300s: %s", o->directory, strerror(errno));
  return status;
}

static int run(void *from) {
  const options *o = from;
  assert(o->part >= 1 && o->part <= o->parts);
  cohort *c = calloc(1, sizeof *c);
  sonde_error error = {0};
  uint32_t made = 0, failed = 0, kept = 0, whole = 0, fitted = 0;
  const double begin_s = app_seconds(CLOCK_MONOTONIC);
  sonde_status status =
      c ? prepare_cohort(o, c, &error) : app_error(&error, SONDE_MEMORY, "out of memory");
  app_catch_interrupt();
  for (uint32_t k = o->part - 1; !status && k < c->count; k += o->parts) {
    sonde_json *before = find_result(c, &c->list[k]);
    const bool there = is_fitted(before); // what failed is tried again
    bool good = false;
    sonde_json_free(before);
    kept += there;
    if (!there) status = fit_subject(c, &c->list[k], &good, &error);
    if (status || there) continue;
    ++made;
    failed += !good;
    if (!good) fprintf(stderr, "sonde fit: subject %s failed\n", c->list[k].id);
  }
  if (!status) status = conclude(c, &whole, &fitted, &error);
  const double seconds = app_seconds(CLOCK_MONOTONIC) - begin_s;
  const bool all = !status && whole == c->count;
  if (!status && o->json) {
    app_json_begin();
    app_json("subjects:%u shard:%u shards:%u made:%u failed:%u kept:%u whole:%hhd", c->count,
             o->part, o->parts, made, failed, kept, all);
    app_json("fitted:%u seconds:%g", fitted, seconds);
    app_json_end();
  } else if (!status) {
    printf("%s: process %u of %u: %u subjects fitted now, %u failed, %u were there, %.1f s\n",
           o->directory, o->part, o->parts, made - failed, failed, kept, seconds);
    if (all)
      printf("%u of %u subjects fitted: cohort.csv, cohort.json, cohort.txt\n", fitted, c->count);
    else
      printf("not whole yet: %u of %u subjects are there\n", whole, c->count);
  }
  // Among several only the last one tells by its code that some failed: a starter of MPI ends all
  // when one fails, and then there is nothing left to end.
  const int code = status ? app_fail(VERB, &error) : all && fitted < whole ? APP_FAILED : APP_OK;
  for (uint32_t k = 0; c && k < c->count; ++k)
    for (uint32_t i = 0; i < c->list[k].count; ++i) free(c->list[k].words[i]);
  if (c) free(c->list);
  free(c);
  return code;
}

const app_command fit_cohort = {
    .verb = "fit",
    .summary = "fit many subjects",
    .usage = "--cohort LIST -o DIR [--shard I/N] [--json] [-- OPTIONS OF EVERY FIT]\n"
             "mpirun -n N sonde fit --cohort LIST -o DIR",
    .text = "Fits every subject of a list, each by a process of its own: one that fails stops no "
            "other. What is whole is kept, the same words again do the rest and try again what "
            "failed. In the end DIR has a model and a result for each subject, cohort.csv, "
            "cohort.json and cohort.txt, the same bytes by however many processes.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .check = check,
    .run = run};
