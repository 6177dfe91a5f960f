// JSON reader after RFC 8259: the text is copied once, its strings are decoded in their place in
// the copy (no escape grows), and values are taken from blocks of nodes that are freed together.
#include "base/base.h"
#include "base/maths.h"
#include "base/utf8.h"
#include "sonde/base_json.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK_NODES = 64, MOST_DEPTH = 32, MOST_VALUES = 200000 };

struct sonde_json {
  sonde_json_kind kind;
  uint32_t line, count; // count of values in a list or object
  const char *key, *text;
  double number;
  sonde_json *first, *next;
};

typedef struct block {
  struct block *before;
  uint32_t used;
  sonde_json node[BLOCK_NODES];
} block;

typedef struct tree {
  sonde_json root; // first, so that the root's address is the tree's
  char *copy;      // of the text, with a 0 behind it
  block *blocks;
} tree;

typedef struct parser {
  tree *tree;
  const sonde_json_source *source;
  char *at, *end;
  uint32_t line, depth, values;
  uint32_t most_depth, most_values;
  sonde_error *error;
} parser;

__attribute__((format(printf, 2, 3))) static sonde_status fail(const parser *p, const char *format,
                                                               ...) {
  char what[200], where[340] = "";
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(what, sizeof what, format, arguments);
  va_end(arguments);
  if (p->source->name) snprintf(where, sizeof where, "%.300s:%u: ", p->source->name, p->line);
  return sonde_fail(p->error, SONDE_FORMAT, "%s%s", where, what);
}

static void skip_space(parser *p) {
  for (; p->at < p->end && strchr(" \t\r\n", *p->at) && *p->at; ++p->at) p->line += *p->at == '\n';
}

// Code unit of four hexadecimal digits, -1 when they are none.
static int32_t hexadecimal(const char *at) {
  int32_t unit = 0;
  for (int k = 0; k < 4; ++k) {
    static const char DIGITS[] = "0123456789abcdef0123456789ABCDEF";
    const char *digit = at[k] ? strchr(DIGITS, at[k]) : NULL;
    if (!digit) return -1;
    unit = 16 * unit + (int32_t)((digit - DIGITS) % 16);
  }
  return unit;
}

// Decodes the escape at p->at, whose backslash was read, to **to.
static sonde_status read_escape(parser *p, char **to) {
  static const char NAMES[] = "\"\\/bfnrt", BYTES[] = "\"\\/\b\f\n\r\t";
  const char *name = *p->at ? strchr(NAMES, *p->at) : NULL;
  if (name) {
    *(*to)++ = BYTES[name - NAMES];
    p->at++;
    return SONDE_OK;
  }
  int32_t unit = *p->at == 'u' ? hexadecimal(p->at + 1) : -1;
  if (unit < 0) return fail(p, "expected an escape: \\\" \\\\ \\/ \\b \\f \\n \\r \\t or \\uXXXX");
  p->at += 5;
  if (unit == 0) return fail(p, "expected a text without the character U+0000");
  if (unit >= 0xd800 && unit < 0xe000) {
    int32_t low = p->at[0] == '\\' && p->at[1] == 'u' ? hexadecimal(p->at + 2) : -1;
    if (unit >= 0xdc00 || low < 0xdc00 || low >= 0xe000)
      return fail(p, "expected a pair of surrogates, found half of one");
    unit = 0x10000 + ((unit - 0xd800) << 10) + (low - 0xdc00);
    p->at += 6;
  }
  int more = unit < 0x80 ? 0 : unit < 0x800 ? 1 : unit < 0x10000 ? 2 : 3;
  static const int HEAD[] = {0, 0xc0, 0xe0, 0xf0};
  *(*to)++ = (char)(HEAD[more] | unit >> (6 * more));
  while (more-- > 0) *(*to)++ = (char)(0x80 | (unit >> (6 * more) & 0x3f));
  return SONDE_OK;
}

// The text whose first quote is at p->at, ended by a 0.
static sonde_status read_text(parser *p, const char **text) {
  char *to = ++p->at;
  *text = to;
  while (*p->at != '"') {
    unsigned char c = (unsigned char)*p->at;
    if (p->at == p->end) return fail(p, "the text ends within a string");
    if (c < 0x20)
      return fail(p, "expected a control character in a string as an escape, found byte %u", c);
    if (c == '\\') {
      p->at++;
      sonde_status status = read_escape(p, &to);
      if (status) return status;
      continue;
    }
    size_t bytes = utf8_character((const unsigned char *)p->at);
    if (bytes == 0) return fail(p, "expected UTF-8, found byte %u", c);
    memmove(to, p->at, bytes);
    to += bytes, p->at += bytes;
  }
  *to = 0;
  p->at++;
  return SONDE_OK;
}

static int by_key(const void *a, const void *b) {
  const sonde_json *x = *(const sonde_json *const *)a, *y = *(const sonde_json *const *)b;
  int order = strcmp(x->key, y->key);
  return order ? order : (x->key > y->key) - (x->key < y->key);
}

static sonde_status read_value(parser *p, sonde_json *value);

// The values of the list or object whose bracket is at p->at.
static sonde_status read_members(parser *p, sonde_json *parent) {
  tree *t = p->tree;
  bool object = *p->at == '{';
  const char close = object ? '}' : ']';
  sonde_json **link = &parent->first;
  parent->kind = object ? SONDE_JSON_OBJECT : SONDE_JSON_LIST;
  if (++p->depth > p->most_depth)
    return fail(p, "expected at most %u levels of nesting", p->most_depth);
  p->at++;
  skip_space(p);
  for (bool empty = *p->at == close; !empty && (parent->count == 0 || *p->at == ',');) {
    if (parent->count > 0) p->at++;
    skip_space(p);
    if (!t->blocks || t->blocks->used == BLOCK_NODES) {
      block *more = SONDE_NEW(block, 1);
      if (!more) return sonde_fail_memory(p->error);
      more->before = t->blocks;
      t->blocks = more;
    }
    sonde_json *value = *link = &t->blocks->node[t->blocks->used++];
    if (object) {
      if (*p->at != '"') return fail(p, "expected a key in quotes");
      sonde_status status = read_text(p, &value->key);
      if (status) return status;
      skip_space(p);
      if (*p->at != ':') return fail(p, "expected ':' behind the key \"%.60s\"", value->key);
      p->at++;
      skip_space(p);
    }
    sonde_status status = read_value(p, value);
    if (status) return status;
    parent->count++;
    link = &value->next;
    skip_space(p);
  }
  if (p->at == p->end) return fail(p, "the text ends before '%c'", close);
  if (*p->at != close) return fail(p, "expected ',' or '%c'", close);
  p->at++;
  p->depth--;

  // The keys of an object differ.
  if (!object || parent->count < 2) return SONDE_OK;
  const sonde_json **list = SONDE_NEW(const sonde_json *, parent->count);
  if (!list) return sonde_fail_memory(p->error);
  uint32_t n = 0;
  for (const sonde_json *v = parent->first; v; v = v->next) list[n++] = v;
  SONDE_ASSERT(n == parent->count);
  qsort(list, n, sizeof *list, by_key);
  const sonde_json *twice = NULL;
  for (uint32_t k = 1; k < n; ++k)
    if (strcmp(list[k - 1]->key, list[k]->key) == 0 && (!twice || list[k]->key < twice->key))
      twice = list[k];
  sonde_free(list);
  if (!twice) return SONDE_OK;
  p->line = twice->line;
  return fail(p, "expected each key once, found \"%.60s\" twice", twice->key);
}

static sonde_status read_value(parser *p, sonde_json *value) {
  static const struct {
    const char *word;
    sonde_json_kind kind;
  } WORDS[] = {{"null", SONDE_JSON_NULL}, {"false", SONDE_JSON_FALSE}, {"true", SONDE_JSON_TRUE}};
  value->line = p->line;
  if (++p->values > p->most_values) return fail(p, "expected at most %u values", p->most_values);
  if (*p->at == '{' || *p->at == '[') return read_members(p, value);
  if (*p->at == '"') {
    value->kind = SONDE_JSON_TEXT;
    return read_text(p, &value->text);
  }
  if (*p->at == '-' || (*p->at >= '0' && *p->at <= '9')) {
    char *c = p->at;
    c += *c == '-';
    size_t whole = strspn(c, "0123456789");
    bool right = whole > 0 && (whole == 1 || *c != '0');
    c += whole;
    if (*c == '.') {
      size_t part = strspn(++c, "0123456789");
      right = right && part > 0;
      c += part;
    }
    if (*c == 'e' || *c == 'E') {
      c += 1 + (c[1] == '+' || c[1] == '-');
      size_t power = strspn(c, "0123456789");
      right = right && power > 0;
      c += power;
    }
    if (!right) return fail(p, "expected a number such as -12.5e-3");
    value->kind = SONDE_JSON_NUMBER;
    value->number = sonde_parse_real(p->at, NULL);
    if (!isfinite(value->number)) return fail(p, "expected a number within the range of a double");
    p->at = c;
    return SONDE_OK;
  }
  for (size_t k = 0; k < SONDE_COUNT_OF(WORDS); ++k) {
    size_t length = strlen(WORDS[k].word);
    if (strncmp(p->at, WORDS[k].word, length) != 0) continue;
    value->kind = WORDS[k].kind;
    p->at += length;
    return SONDE_OK;
  }
  return p->at == p->end ? fail(p, "the text ends where a value was expected")
                         : fail(p, "expected a value, found byte %u", (unsigned char)*p->at);
}

sonde_status sonde_json_parse(const char *bytes, size_t count, const sonde_json_source *source,
                              sonde_json **root, sonde_error *error) {
  static const sonde_json_source ANY = {NULL, 0, 0, 0};
  SONDE_ASSERT((bytes || count == 0) && root);
  *root = NULL;
  tree *t = SONDE_NEW(tree, 1);
  if (t) t->copy = SONDE_NEW(char, count + 1);
  if (!t || !t->copy) {
    sonde_free(t);
    return sonde_fail_memory(error);
  }
  if (count) memcpy(t->copy, bytes, count);
  parser p = {.tree = t,
              .source = source ? source : &ANY,
              .at = t->copy,
              .end = t->copy + count,
              .error = error};
  p.line = p.source->line ? p.source->line : 1;
  p.most_depth = p.source->most_depth ? p.source->most_depth : MOST_DEPTH;
  p.most_values = p.source->most_values ? p.source->most_values : MOST_VALUES;
  skip_space(&p);
  sonde_status status = read_value(&p, &t->root);
  if (!status) skip_space(&p);
  if (!status && p.at != p.end) status = fail(&p, "expected the end of the text");
  if (status)
    sonde_json_free(&t->root);
  else
    *root = &t->root;
  return status;
}

void sonde_json_free(sonde_json *root) {
  tree *t = (tree *)(void *)root;
  if (!t) return;
  for (block *b = t->blocks, *before; b; b = before) {
    before = b->before;
    sonde_free(b);
  }
  sonde_free(t->copy);
  sonde_free(t);
}

sonde_json_kind sonde_json_kind_of(const sonde_json *value) {
  return value ? value->kind : SONDE_JSON_ABSENT;
}

const sonde_json *sonde_json_member(const sonde_json *object, const char *key) {
  SONDE_ASSERT(key);
  if (!object || object->kind != SONDE_JSON_OBJECT) return NULL;
  const sonde_json *v = object->first;
  while (v && strcmp(v->key, key) != 0) v = v->next;
  return v;
}

const sonde_json *sonde_json_first(const sonde_json *parent) {
  return parent ? parent->first : NULL;
}

const sonde_json *sonde_json_next(const sonde_json *value) { return value ? value->next : NULL; }

uint32_t sonde_json_count(const sonde_json *parent) { return parent ? parent->count : 0; }

const char *sonde_json_key(const sonde_json *value) { return value ? value->key : NULL; }

const char *sonde_json_as_text(const sonde_json *value) { return value ? value->text : NULL; }

double sonde_json_as_number(const sonde_json *value) {
  return value && value->kind == SONDE_JSON_NUMBER ? value->number : (double)NAN;
}

uint32_t sonde_json_line(const sonde_json *value) { return value ? value->line : 0; }

// ---- writing ------------------------------------------------------------------------------------

static void put(sonde_json_out *out, const char *text) {
  sonde_file_write(out->file, text, strlen(text));
}

// Quotes, backslashes and control characters are escaped.
static void put_string(sonde_json_out *out, const char *text) {
  static const char NAMES[] = "\"\\bfnrt", BYTES[] = "\"\\\b\f\n\r\t";
  put(out, "\"");
  for (const unsigned char *c = (const unsigned char *)text; *c;) {
    size_t bytes = utf8_character(c);
    const char *escape = strchr(BYTES, *c);
    if (escape)
      sonde_file_printf(out->file, "\\%c", NAMES[escape - BYTES]);
    else if (*c < 0x20)
      sonde_file_printf(out->file, "\\u%04x", *c);
    else if (bytes == 0)
      put(out, "\xef\xbf\xbd");
    else
      sonde_file_write(out->file, c, bytes);
    c += bytes ? bytes : 1;
  }
  put(out, "\"");
}

static void new_line(sonde_json_out *out) {
  put(out, "\n");
  for (uint32_t k = 0; k < out->depth; ++k) put(out, out->layout == SONDE_JSON_TABS ? "\t" : "  ");
}

// What stands before a value: comma, line and key.
static void put_key(sonde_json_out *out, const char *key) {
  static const char *const COLON[] = {":", ":\t", ": "};
  if (out->depth == 0) return;
  uint32_t bit = 1u << (out->depth - 1);
  bool list = out->lists & bit, first = !(out->filled & bit);
  SONDE_ASSERT(list || key);
  out->filled |= bit;
  if (!first) put(out, ",");
  if (out->layout == SONDE_JSON_LINES || (out->layout == SONDE_JSON_TABS && !list))
    new_line(out);
  else if (out->layout == SONDE_JSON_TABS && !first)
    put(out, " ");
  if (list) return;
  put_string(out, key);
  put(out, COLON[out->layout]);
}

static void begin(sonde_json_out *out, const char *key, bool list) {
  put_key(out, key);
  put(out, list ? "[" : "{");
  SONDE_ASSERT(out->depth < 32);
  uint32_t bit = 1u << out->depth++;
  out->lists = list ? out->lists | bit : out->lists & ~bit;
  out->filled &= ~bit;
}

void sonde_json_begin_object(sonde_json_out *out, const char *key) { begin(out, key, false); }

void sonde_json_begin_list(sonde_json_out *out, const char *key) { begin(out, key, true); }

void sonde_json_end(sonde_json_out *out) {
  SONDE_ASSERT(out->depth > 0);
  uint32_t bit = 1u << --out->depth;
  bool list = out->lists & bit, filled = out->filled & bit;
  if (out->layout == SONDE_JSON_LINES ? filled : out->layout == SONDE_JSON_TABS && !list)
    new_line(out);
  put(out, list ? "]" : "}");
}

void sonde_json_put_text(sonde_json_out *out, const char *key, const char *text) {
  SONDE_ASSERT(text);
  put_key(out, key);
  put_string(out, text);
}

void sonde_json_put_real(sonde_json_out *out, const char *key, double value, int digits) {
  char text[40];
  for (int count = digits ? digits : 15;; count = 17) {
    snprintf(text, sizeof text, "%.*g", count, value);
    for (char *c = text; *c; ++c)
      if (!strchr("+-0123456789einfa", *c)) *c = '.'; // the locale's decimal point
    double back = sonde_parse_real(text, NULL);
    if (digits || count == 17 || fabs(back - value) <= fmax(fabs(back), fabs(value)) * 0x1p-52)
      break;
  }
  put_key(out, key);
  put(out, isfinite(value) ? text : "null");
}

void sonde_json_put_integer(sonde_json_out *out, const char *key, int64_t value) {
  put_key(out, key);
  sonde_file_printf(out->file, "%lld", (long long)value);
}

void sonde_json_put_bool(sonde_json_out *out, const char *key, bool value) {
  put_key(out, key);
  put(out, value ? "true" : "false");
}
