// Command lines from tables: reads the words, checks them, and prints help as text and as JSON.
#include "options.h"

#include <assert.h>
#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { MOST_OPTIONS = 96, WIDTH = 79, WIDEST_HEAD = 22 };

// The table of the command that is read, with what its extension adds.
static struct {
  const app_command *command;
  app_option list[MOST_OPTIONS];
  uint32_t count;
  bool given[MOST_OPTIONS];
  int argc;
  char **argv;
} now;

static bool is_option(const app_option *o) {
  return o->kind != OPTION_ARGUMENT && o->kind != OPTION_MODEL && o->kind != OPTION_REST &&
         o->kind != OPTION_GROUP;
}

// ---- names

// Whether a word of `length` letters is a name of the option: "o,output" has two of them.
static bool has_name(const app_option *o, const char *word, size_t length) {
  for (const char *p = o->name; o->kind != OPTION_GROUP; ++p) {
    size_t part = strcspn(p, ",");
    if (part == length && strncmp(p, word, length) == 0) return true;
    p += part;
    if (!*p) break;
  }
  return false;
}

static int find_name(const char *word, size_t length) {
  for (uint32_t k = 0; k < now.count; ++k)
    if (has_name(&now.list[k], word, length)) return (int)k;
  return -1;
}

// "-o", "--force-n"; of "o,output" the letter.
static const char *dashed(const app_option *o, char text[48]) {
  size_t length = strcspn(o->name, ",");
  snprintf(text, 48, "%s%.*s", !is_option(o) ? "" : length == 1 ? "-" : "--", (int)length, o->name);
  return text;
}

// ---- values

static void *member(const app_option *o, void *options) { return (char *)options + o->at; }

static void store_integer(const app_option *o, void *options, long long value) {
  assert(o->bytes == 4 || o->bytes == 8);
  int32_t narrow = (int32_t)value;
  if (o->bytes == 4)
    memcpy(member(o, options), &narrow, 4);
  else
    memcpy(member(o, options), &value, 8);
}

static long long integer_of(const app_option *o, const void *options) {
  const char *from = (const char *)options + o->at;
  int32_t narrow;
  long long wide;
  memcpy(&narrow, from, 4);
  if (o->bytes == 4) return narrow;
  memcpy(&wide, from, 8);
  return wide;
}

// Adds to a text that has `room` bytes.
__attribute__((format(printf, 3, 4))) static void add(char *text, size_t room, const char *format,
                                                      ...) {
  size_t used = strlen(text);
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text + used, room - used, format, arguments);
  va_end(arguments);
}

// "a, b or c"
static void add_words(char *text, size_t room, const char *const *words) {
  assert(room > 0 && strlen(text) < room);
  for (int k = 0; words[k]; ++k)
    add(text, room, "%s%s", k == 0 ? "" : words[k + 1] ? ", " : " or ", words[k]);
}

// Signs between numbers, as the value's name has them: all that are no capitals.
static const char *separator(const char *p) {
  while (isupper((unsigned char)*p)) ++p;
  return p;
}

static bool read_value(const app_option *o, const char *text, void *options) {
  const char *verb = now.command->verb;
  char name[48], known[300] = "";
  long whole;
  switch (o->kind) {
  case OPTION_FLAG: *(bool *)member(o, options) = true; return true;
  case OPTION_INTEGER:
    if (!app_parse_integer(verb, dashed(o, name), text, (long)o->low, (long)o->high, &whole))
      return false;
    store_integer(o, options, whole);
    return true;
  case OPTION_REAL:
    if (!app_parse_real(verb, dashed(o, name), text, o->low, o->high, member(o, options)))
      return false;
    *(double *)member(o, options) *= o->scale;
    return true;
  case OPTION_WORD:
    for (int k = 0; o->words[k]; ++k)
      if (strcmp(o->words[k], text) == 0) {
        store_integer(o, options, k);
        return true;
      }
    add_words(known, sizeof known, o->words);
    app_usage_error(verb, "%s expects %s, got '%s'", dashed(o, name), known, text);
    return false;
  case OPTION_NUMBERS:
  case OPTION_WHOLES: {
    double *values = member(o, options);
    const char *p = text, *sign = separator(o->value);
    for (size_t k = 0; k < o->bytes / sizeof *values; ++k, sign = separator(sign + (*sign != 0))) {
      const char *end;
      values[k] = sonde_parse_real(p, &end);
      bool good = end != p && isfinite(values[k]) && values[k] >= o->low && values[k] <= o->high &&
                  (o->kind == OPTION_NUMBERS || values[k] == floor(values[k]));
      p = end + (*sign != 0);
      if (good && *end == *sign) continue;
      if (isfinite(o->low))
        app_usage_error(now.command->verb, "%s expects %s%s from %g to %g, got '%s'",
                        dashed(o, name), o->value,
                        o->kind == OPTION_WHOLES ? ", whole numbers" : "", o->low, o->high, text);
      else
        app_usage_error(now.command->verb, "%s expects %s, got '%s'", dashed(o, name), o->value,
                        text);
      return false;
    }
    return true;
  }
  case OPTION_CALL: return o->take(options, text);
  default: *(const char **)member(o, options) = text; return true;
  }
}

// ---- rules

// Calls for each name of a list with blanks; "device>haptics" is handed on as it is.
// NOLINTBEGIN(bugprone-macro-parentheses): names of variables that the macro defines
#define EACH_NAME(p, length, list)                                                                 \
  for (const char *p = (list) ? (list) : ""; *p; p += strspn(p, " "))                              \
    for (size_t length = strcspn(p, " "); length; p += length, length = 0)
// NOLINTEND(bugprone-macro-parentheses)

static bool given_name(const char *name, size_t length) {
  int k = find_name(name, length);
  assert(k >= 0);
  return now.given[k];
}

// "--line, --path and --site", or with another last word; the value follows a single letter.
static void add_names(char *text, size_t room, const char *list, const char *last) {
  assert(room > 0 && strlen(text) < room);
  uint32_t count = 0, k = 0;
  EACH_NAME(p, length, list) count++;
  EACH_NAME(p, length, list) {
    char name[48];
    add(text, room, "%s%s",
        k == 0           ? ""
        : k + 1 == count ? last
                         : ", ",
        dashed(&now.list[find_name(p, length)], name));
    k++;
  }
}

static int check_rules(const app_command *c) {
  char names[300] = "";
  EACH_NAME(p, length, c->required) {
    if (given_name(p, length)) continue;
    const app_option *o = &now.list[find_name(p, length)];
    bool letter = strcspn(o->name, ",") == 1;
    char name[48];
    return app_usage_error(c->verb, "%s%s%s is missing", dashed(o, name), letter ? " " : "",
                           letter ? o->value : "");
  }
  uint32_t chosen = 0, choices = 0;
  EACH_NAME(p, length, c->one_of) {
    chosen += given_name(p, length);
    choices++;
  }
  if (choices && chosen != 1) {
    add_names(names, sizeof names, c->one_of, choices == 2 ? " or " : " and ");
    return choices == 2 ? app_usage_error(c->verb, "give either %s", names)
                        : app_usage_error(c->verb, "expected one of %s, got %u", names, chosen);
  }
  chosen = 0;
  EACH_NAME(p, length, c->not_both) chosen += given_name(p, length);
  if (chosen > 1) {
    add_names(names, sizeof names, c->not_both, " or ");
    return app_usage_error(c->verb, "give either %s, not both", names);
  }
  EACH_NAME(p, length, c->needs) {
    size_t part = strcspn(p, ">");
    assert(part < length);
    if (!given_name(p, part) || given_name(p + part + 1, length - part - 1)) continue;
    char a[48], b[48];
    return app_usage_error(c->verb, "%s belongs to %s", dashed(&now.list[find_name(p, part)], a),
                           dashed(&now.list[find_name(p + part + 1, length - part - 1)], b));
  }
  return APP_OK;
}

// ---- reading

static int print_help(const app_command *command, const void *defaults);
static int print_json(const app_command *command, const void *defaults);

static int read_words(int argc, char **argv, void *options) {
  const char *verb = now.command->verb;
  for (int i = 1; i < argc; ++i) {
    int rest = find_name("--", 2);
    if (strcmp(argv[i], "--") == 0) {
      if (rest < 0) continue;
      *(char ***)member(&now.list[rest], options) = argv + i + 1;
      break;
    }
    if (argv[i][0] == '-' && argv[i][1]) {
      // A word that begins with '-', and its value, which may be the next word.
      const char *word = argv[i], *value = NULL;
      bool is_long = word[1] == '-';
      size_t length = is_long ? strcspn(word + 2, "=") : 1;
      int found = find_name(word + 1 + is_long, length);

      // A long name may be cut short where only one begins so.
      int matches = 0, match = -1;
      for (uint32_t j = 0; is_long && length && j < now.count; ++j) {
        const char *comma = strchr(now.list[j].name, ',');
        const char *name = comma ? comma + 1 : now.list[j].name;
        if (!is_option(&now.list[j]) || !name[1] || strncmp(name, word + 2, length) != 0) continue;
        match = (int)j;
        matches++;
      }
      if (found < 0 && matches == 1) found = match;
      if (found < 0 || !is_option(&now.list[found]))
        return app_usage_error(verb, "unknown option '%s'", word);
      const app_option *o = &now.list[found];
      if (is_long && word[2 + length]) value = word + 2 + length + 1;
      if (!is_long && word[2]) value = word + 2;
      if (o->kind == OPTION_FLAG && value)
        return app_usage_error(verb, "%.*s takes no value", (int)(length + 1 + is_long), word);
      if (o->kind != OPTION_FLAG && !value) {
        if (i + 1 >= argc) return app_usage_error(verb, "%s needs a value", word);
        value = argv[++i];
      }
      now.given[found] = true;
      if (!read_value(o, value, options)) return APP_BAD_INPUT;
      continue;
    }
    // The first argument of the table that no word has filled.
    uint32_t k = 0;
    while (k < now.count && (now.given[k] || (now.list[k].kind != OPTION_ARGUMENT &&
                                              now.list[k].kind != OPTION_MODEL)))
      ++k;
    if (k == now.count)
      return app_usage_error(verb, "unexpected argument '%s'%s", argv[i],
                             rest < 0 ? "" : "; options of sonde run come after --");
    now.given[k] = true;
    *(const char **)member(&now.list[k], options) = argv[i];
  }
  return APP_OK;
}

int app_options_read(const app_command *command, int argc, char **argv, void *options) {
  assert(argc >= 1 && options && command->size > 0 && command->count <= MOST_OPTIONS);
  bool help = false, json = false;

  // The table, and the options as they are when nothing is said.
  memset(&now, 0, sizeof now);
  now.command = command;
  now.argc = argc, now.argv = argv;
  memcpy(now.list, command->table, command->count * sizeof *now.list);
  now.count = command->count;
  if (command->extend) now.count += command->extend(now.list + now.count, MOST_OPTIONS - now.count);
  memset(options, 0, command->size);
  if (command->defaults) memcpy(options, command->defaults, command->size);
  if (command->prepare) command->prepare(options);

  // Help is given whatever else was said.
  for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; ++i) {
    help |= strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0;
    json |= strcmp(argv[i], "--json") == 0;
  }
  if (help) return (json ? print_json : print_help)(command, options);

  // The words, the rules of the table, the command's own; then what is missing but has a place.
  int code = read_words(argc, argv, options);
  bool free_form = command->form && code == APP_OK && app_option_given(command->form);
  if (code == APP_OK && !free_form) code = check_rules(command);
  if (code == APP_OK && command->check) code = command->check(options);
  for (uint32_t k = 0; k < now.count && code == APP_OK; ++k) {
    static char bundled[4096];
    char searched[1024];
    const char **text = member(&now.list[k], options);
    if (now.list[k].kind == OPTION_OUTPUT) code = app_check_output(command->verb, *text);
    if (now.list[k].kind != OPTION_MODEL || *text) continue;
    *text = bundled;
    if (!app_bundled_model(bundled, sizeof bundled, searched, sizeof searched))
      code = app_usage_error(command->verb, "no bundled model found (looked at %s)", searched);
  }
  return code == APP_OK ? -1 : code;
}

uint32_t app_list_parameters(app_option *list, uint32_t room, const sonde_parameter *p,
                             uint32_t count, size_t at) {
  assert(list && p);
  if (count > room) count = room;
  for (uint32_t k = 0; k < count; ++k)
    list[k] = (app_option){.name = p[k].name,
                           .value = "X",
                           .kind = OPTION_REAL,
                           .at = at + p[k].offset,
                           .bytes = sizeof(double),
                           .low = p[k].low / p[k].unit,
                           .high = p[k].high / p[k].unit,
                           .scale = p[k].unit,
                           .help = p[k].text};
  return count;
}

int app_shard(const char *verb, const char *text, uint32_t *part, uint32_t *parts) {
  int used = 0;
  if (!text || (sscanf(text, "%9u/%9u%n", part, parts, &used) == 2 && !text[used] && *part >= 1 &&
                *part <= *parts))
    return APP_OK;
  return app_usage_error(verb, "--shard expects I/N with 1 <= I <= N, such as 3/8, got '%s'", text);
}

uint32_t app_read_numbers(const char *text, double low, double high, double *list, uint32_t most) {
  for (uint32_t count = 0; count < most;) {
    const char *end;
    const double x = sonde_parse_real(text, &end);
    if (end == text || (*end && *end != ',') || !(x >= low && x <= high)) return 0;
    list[count++] = x;
    if (!*end) return count;
    text = end + 1;
  }
  return 0;
}

bool app_option_given(const char *name) { return given_name(name, strlen(name)); }

void app_command_line(char *text, size_t room) {
  assert(room > 0);
  assert(now.command);
  assert(now.command && room > 0);
  snprintf(text, room, "sonde %s", now.command->verb);
  for (int k = 1; k < now.argc; ++k) {
    const char *word = now.argv[k], *quote = strpbrk(word, " \t'") || !word[0] ? "\"" : "";
    add(text, room, " %s%s%s", quote, word, quote);
  }
}

// ---- help

// The default as a user would type it; false: there is none.
static bool default_text(const app_option *o, const void *options, char text[64]) {
  const char *from = (const char *)options + o->at;
  text[0] = 0;
  if (o->kind == OPTION_TEXT && *(const char *const *)(const void *)from)
    snprintf(text, 64, "%s", *(const char *const *)(const void *)from);
  if (o->kind == OPTION_WORD && integer_of(o, options) >= 0)
    snprintf(text, 64, "%s", o->words[integer_of(o, options)]);
  if (o->kind == OPTION_INTEGER) {
    long long value = integer_of(o, options);
    if ((double)value >= o->low && (double)value <= o->high) snprintf(text, 64, "%lld", value);
  }
  if (o->kind == OPTION_REAL) {
    double value;
    memcpy(&value, from, sizeof value);
    value /= o->scale;
    double slack = 1e-9 * fabs(value);
    if (value >= o->low - slack && value <= o->high + slack) snprintf(text, 64, "%g", value);
  }
  const double *list = (const double *)(const void *)from;
  const char *sign = o->kind == OPTION_NUMBERS || o->kind == OPTION_WHOLES ? o->value : "";
  for (size_t k = 0; *sign && isfinite(list[k]); ++k) {
    sign = separator(sign);
    add(text, 64, "%g%.*s", list[k], *sign != 0, sign);
    sign += *sign != 0;
  }
  return text[0] != 0;
}

static bool is_in(const char *list, const app_option *o) {
  bool found = false;
  EACH_NAME(p, length, list) found |= has_name(o, p, length);
  return found;
}

// What it does, and its words or range and its default in brackets, before what the text itself
// says of a default. An option that has to be given has none.
static void full_help(const app_option *o, const void *options, char *text, size_t room) {
  char value[64], facts[400] = "";
  if (o->kind == OPTION_WORD) add_words(facts, sizeof facts, o->words);
  if ((o->kind == OPTION_REAL || o->kind == OPTION_NUMBERS || o->kind == OPTION_WHOLES) &&
      isfinite(o->low)) {
    bool whole = o->low == floor(o->low) && o->high == floor(o->high);
    add(facts, sizeof facts, whole ? "%.0f to %.0f" : "%g to %g", o->low, o->high);
  }
  if (o->kind == OPTION_INTEGER) add(facts, sizeof facts, "%.0f to %.0f", o->low, o->high);
  const app_command *c = now.command;
  const char *said = strstr(o->help, "; default");
  if (!said && default_text(o, options, value) && !is_in(c->required, o) && !is_in(c->one_of, o))
    add(facts, sizeof facts, "%sdefault %s", facts[0] ? "; " : "", value);
  int before = said ? (int)(said - o->help) : (int)strlen(o->help);
  snprintf(text, room, "%.*s%s%s%s%s", before, o->help, facts[0] ? " (" : "", facts,
           facts[0] ? ")" : "", o->help + before);
}

// "-o, --output DIR"
static void head_of(const app_option *o, char head[64]) {
  char name[48];
  const char *comma = strchr(o->name, ',');
  snprintf(head, 64, "%s%s%s%s%s", dashed(o, name), comma ? ", --" : "", comma ? comma + 1 : "",
           o->value ? " " : "", o->value ? o->value : "");
}

// Words from column `at` on, further lines from column `indent` on; a newline is kept.
static void print_wrapped(const char *text, int at, int indent) {
  assert(at >= 0 && indent >= 0);
  for (const char *p = text; *p;) {
    int length = (int)strcspn(p, " \n");
    if (at > indent && at + 1 + length > WIDTH) {
      printf("\n%*s", indent, "");
      at = indent;
    } else if (at > indent) {
      putchar(' ');
      at++;
    }
    printf("%.*s", length, p);
    at += length;
    p += length;
    if (*p == '\n') {
      printf("\n%*s", p[1] ? indent : 0, "");
      at = indent;
    }
    p += *p != 0;
  }
  putchar('\n');
}

static int print_help(const app_command *c, const void *defaults) {
  char text[2000], head[64];
  int column = 0;
  const char *lead = "usage:";
  for (const char *line = c->usage; *line; lead = "      ") {
    int length = (int)strcspn(line, "\n");
    snprintf(text, sizeof text, "sonde %s %.*s", c->verb, length, line);
    printf("%s ", lead);
    print_wrapped(text, 7, 7);
    line += length + (line[length] != 0);
  }
  putchar('\n');
  print_wrapped(c->text, 0, 0);
  putchar('\n');
  for (uint32_t k = 0; k < now.count; ++k) {
    if (now.list[k].kind == OPTION_GROUP || !now.list[k].help) continue;
    head_of(&now.list[k], head);
    int wide = (int)strlen(head) + 4;
    column = wide > WIDEST_HEAD || wide < column ? column : wide;
  }
  for (uint32_t k = 0; k < now.count; ++k) {
    const app_option *o = &now.list[k];
    if (o->kind == OPTION_GROUP) {
      snprintf(text, sizeof text, "\n%s:", o->name);
      print_wrapped(text, 0, 0);
    }
    if (o->kind == OPTION_GROUP || !o->help) continue;
    head_of(o, head);
    full_help(o, defaults, text, sizeof text);
    int wide = (int)strlen(head) + 4;
    if (wide > column)
      printf("  %s\n%*s", head, column, "");
    else
      printf("  %-*s", column - 2, head);
    print_wrapped(text, column, column);
  }
  printf("  %-*s%s\n", column - 2, "--help", "this text; with --json as JSON");
  for (uint32_t k = 0; k < now.count; ++k)
    if (now.list[k].kind == OPTION_MODEL) printf("MODEL defaults to the bundled thigh.\n");
  if (c->tail) print_wrapped(c->tail, 0, 0);
  return APP_OK;
}

static int print_json(const app_command *c, const void *defaults) {
  static const char *const KINDS[] = {"flag",     "text",    "output", "integer", "real",
                                      "word",     "numbers", "wholes", "text",    "argument",
                                      "argument", "rest",    "group"};
  app_json_begin();
  app_json_text("command", c->verb);
  app_json_text("summary", c->summary);
  app_json_text("usage", c->usage);
  app_json_text("text", c->text);
  if (c->tail) app_json_text("tail", c->tail);
  app_json_array("options");
  for (uint32_t k = 0; k < now.count; ++k) {
    const app_option *o = &now.list[k];
    char name[48], value[64], text[2000];
    if (!o->help) continue;
    app_json_object("");
    app_json_text("name", dashed(o, name));
    if (strchr(o->name, ',')) app_json_text("long_name", strchr(o->name, ',') + 1);
    if (o->value) app_json_text("value", o->value);
    app_json_text("kind", KINDS[o->kind]);
    if (o->low < o->high && isfinite(o->low)) {
      app_json_real("low", o->low);
      app_json_real("high", o->high);
    }
    if (o->kind == OPTION_WORD) {
      app_json_object("words");
      for (int w = 0; o->words[w]; ++w) app_json_integer(o->words[w], w);
      app_json_close();
    }
    if (default_text(o, defaults, value)) app_json_text("default", value);
    full_help(o, defaults, text, sizeof text);
    app_json_text("help", text);
    app_json_close();
  }
  app_json_close();
  app_json_end();
  return APP_OK;
}
