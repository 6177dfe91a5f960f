// JSON: every mistake is refused with its line, what is written reads the same again, and cJSON, an
// independent reader and writer, agrees on both.
#include "test.h"

#include "base/maths.h"
#include "base/random.h"
#include "sonde/base_json.h"

#include <cjson/cJSON.h>
#include <locale.h>
#include <stdlib.h>

static sonde_json *read(const char *text, sonde_error *error) {
  const sonde_json_source source = {"x.json", 0, 3, 20};
  sonde_json *root = NULL;
  sonde_status status = sonde_json_parse(text, strlen(text), &source, &root, error);
  assert_int_equal(status == SONDE_OK, root != NULL);
  return root;
}

static void every_mistake_is_told_with_its_line(void **unused) {
  (void)unused;
  static const char *const CASES[][2] = {
      {"", ":1: the text ends where a value was expected"},
      {" \n\n", ":3: the text ends where"},
      {"[1,\n2", ":2: the text ends before ']'"},
      {"{\"a\": 1\n\n", ":3: the text ends before '}'"},
      {"[1\n2]", ":2: expected ',' or ']'"},
      {"[1,\n]", ":2: expected a value, found byte 93"},
      {"[,1]", ":1: expected a value"},
      {"{\"a\":1,\n}", ":2: expected a key in quotes"},
      {"{a:1}", ":1: expected a key in quotes"},
      {"{'a':1}", ":1: expected a key in quotes"},
      {"{\"a\"\n1}", ":2: expected ':' behind the key \"a\""},
      {"{\"a\":1\n\"b\":2}", ":2: expected ',' or '}'"},
      {"[1}", ":1: expected ',' or ']'"},
      {"{\"a\":1}\n}", ":2: expected the end of the text"},
      {"1 2", ":1: expected the end"},
      {"[\n// a remark\n1]", ":2: expected a value, found byte 47"},
      {"\xef\xbb\xbf{}", ":1: expected a value, found byte 239"},
      {"\f1", ":1: expected a value, found byte 12"},
      {"nul", ":1: expected a value"},
      {"True", ":1: expected a value"},
      {"truth", ":1: expected a value"},
      {"nulls", ":1: expected the end"},
      {"NaN", ":1: expected a value"},
      {"-Infinity", ":1: expected a number"},
      {"[\n01]", ":2: expected a number"},
      {"+1", ":1: expected a value"},
      {".5", ":1: expected a value"},
      {"1.", ":1: expected a number"},
      {"1.e3", ":1: expected a number"},
      {"1e", ":1: expected a number"},
      {"1e+", ":1: expected a number"},
      {"-", ":1: expected a number"},
      {"- 1", ":1: expected a number"},
      {"0x10", ":1: expected the end"},
      {"1,5", ":1: expected the end"},
      {"[\n1e999]", ":2: expected a number within the range of a double"},
      {"\"a", ":1: the text ends within a string"},
      {"\"a\\", ":1: expected an escape"},
      {"[\n\"a\nb\"]", ":2: expected a control character in a string as an escape, found byte 10"},
      {"\"\t\"", ":1: expected a control character"},
      {"\"\\x41\"", ":1: expected an escape"},
      {"\"\\'\"", ":1: expected an escape"},
      {"\"\\u12g4\"", ":1: expected an escape"},
      {"\"\\u12", ":1: expected an escape"},
      {"\"\\u0000\"", ":1: expected a text without the character U+0000"},
      {"\"\\ud834\"", ":1: expected a pair of surrogates"},
      {"\"\\ud834\\n\"", ":1: expected a pair of surrogates"},
      {"\"\\ud834\\u0041\"", ":1: expected a pair of surrogates"},
      {"\"\\udd1e\\ud834\"", ":1: expected a pair of surrogates"},
      {"[\n\"\xff\"]", ":2: expected UTF-8, found byte 255"},
      {"\"\x80\"", ":1: expected UTF-8"},
      {"\"\xc3\"", ":1: expected UTF-8"},             // torn
      {"\"\xe2\x82\"", ":1: expected UTF-8"},         // torn
      {"\"\xc0\xaf\"", ":1: expected UTF-8"},         // overlong
      {"\"\xe0\x80\xaf\"", ":1: expected UTF-8"},     // overlong
      {"\"\xf0\x80\x80\xaf\"", ":1: expected UTF-8"}, // overlong
      {"\"\xed\xa0\x80\"", ":1: expected UTF-8"},     // half a pair
      {"\"\xf4\x90\x80\x80\"", ":1: expected UTF-8"}, // beyond U+10FFFF
      {"\"\xf8\x88\x80\x80\x80\"", ":1: expected UTF-8"},
      {"{\"a\":1,\n\"b\":2,\n\"a\":3}", ":3: expected each key once, found \"a\" twice"},
      {"{\"a\":1,\n\"\\u0061\":3}", ":2: expected each key once"},
      {"{\"b\":1,\"a\":1,\n\"b\":1,\n\"a\":1}", ":2: expected each key once, found \"b\""},
      {"[\n[[\n[1]]]]", ":3: expected at most 3 levels of nesting"},
      {"[1,2,3,4,5,6,7,8,9,10,\n11,12,13,14,15,16,17,18,19,\n20]",
       ":3: expected at most 20 values"}};
  for (size_t k = 0; k < SONDE_COUNT_OF(CASES); ++k) {
    sonde_error error = {0};
    assert_null(read(CASES[k][0], &error));
    char expected[120];
    snprintf(expected, sizeof expected, "x.json%s", CASES[k][1]);
    if (strncmp(error.message, expected, strlen(expected)) != 0)
      fail_msg("%s: '%s', expected '%s'", CASES[k][0], error.message, expected);
    assert_int_equal(error.status, SONDE_FORMAT);
  }
  sonde_json *root = NULL;
  sonde_error error = {0};
  assert_int_equal(sonde_json_parse("[\0]", 3, NULL, &root, &error), SONDE_FORMAT);
  assert_string_equal(error.message, "expected a value, found byte 0");
  const sonde_json_source second = {"m", 7, 0, 0};
  assert_int_equal(sonde_json_parse("\n!", 2, &second, &root, &error), SONDE_FORMAT);
  assert_string_equal(error.message, "m:8: expected a value, found byte 33");
}

static void values_are_found_by_key_and_in_order(void **unused) {
  (void)unused;
  sonde_json *root =
      read(" {\"\":null,\"a\":[true,false,\n-0.5e1,\"\\ud834\\udd1e\\u20ac\\/\xc3\xa9\"]"
           ",\"b\":{}}\r\n\t",
           NULL);
  const sonde_json *list = sonde_json_member(root, "a"), *value = sonde_json_first(list);
  assert_int_equal(sonde_json_kind_of(root), SONDE_JSON_OBJECT);
  assert_int_equal(sonde_json_count(root), 3);
  assert_int_equal(sonde_json_kind_of(sonde_json_member(root, "")), SONDE_JSON_NULL);
  assert_int_equal(sonde_json_count(sonde_json_member(root, "b")), 0);
  assert_string_equal(sonde_json_key(sonde_json_next(sonde_json_first(root))), "a");
  assert_int_equal(sonde_json_kind_of(value), SONDE_JSON_TRUE);
  assert_int_equal(sonde_json_kind_of(value = sonde_json_next(value)), SONDE_JSON_FALSE);
  assert_int_equal(sonde_json_line(value), 1);
  assert_true(sonde_json_as_number(value = sonde_json_next(value)) == -5);
  assert_int_equal(sonde_json_line(value), 2);
  assert_string_equal(sonde_json_as_text(sonde_json_next(value)),
                      "\xf0\x9d\x84\x9e\xe2\x82\xac/\xc3\xa9");
  // an absent value and one of another kind have nothing
  assert_null(sonde_json_member(list, "a"));
  assert_null(sonde_json_member(NULL, "a"));
  assert_null(sonde_json_as_text(value));
  assert_null(sonde_json_key(value));
  assert_true(isnan(sonde_json_as_number(list)) && isnan(sonde_json_as_number(NULL)));
  assert_int_equal(sonde_json_kind_of(sonde_json_first(NULL)), SONDE_JSON_ABSENT);
  sonde_json_free(root);
  sonde_json_free(NULL);
}

// ---- against cJSON ------------------------------------------------------------------------------

static uint64_t next(uint64_t *state) { return sonde_random_bits(5, (*state)++); }

static double random_number(uint64_t *r) {
  uint64_t bits = next(r);
  double value;
  memcpy(&value, &bits, sizeof value);
  switch (next(r) % 4) {
  case 0: return isfinite(value) ? value : 0;
  case 1: return (double)(int32_t)bits;
  case 2: return (double)(int32_t)bits / 1000;
  default: return (double)(int64_t)bits;
  }
}

static const char *random_text(uint64_t *r, char text[32]) {
  static const char *const PIECES[] = {"a",    "\"",       "\\",           "/",
                                       "\n",   "\x01",     "\t",           "\x7f",
                                       "\x1f", "\xc3\xa9", "\xe2\x82\xac", "\xf0\x9d\x84\x9e"};
  text[0] = 0;
  for (uint64_t k = next(r) % 6; k > 0; --k) strcat(text, PIECES[next(r) % SONDE_COUNT_OF(PIECES)]);
  return text;
}

// The same random value to both writers; keys of one object differ in their first letter.
static void write_both(uint64_t *r, sonde_json_out *out, const char *key, cJSON *to, int depth) {
  char text[32];
  cJSON *item = NULL;
  uint64_t kind = next(r) % (depth < 4 ? 7 : 5);
  double number = random_number(r);
  switch (kind) {
  case 0: sonde_json_put_real(out, key, NAN, 0), item = cJSON_CreateNull(); break;
  case 1: sonde_json_put_bool(out, key, number > 0), item = cJSON_CreateBool(number > 0); break;
  case 2:
    sonde_json_put_text(out, key, random_text(r, text)), item = cJSON_CreateString(text);
    break;
  case 3:
    number = (double)(int32_t)fmax(INT32_MIN, fmin(INT32_MAX, number));
    sonde_json_put_integer(out, key, (int64_t)number), item = cJSON_CreateNumber(number);
    break;
  case 4: sonde_json_put_real(out, key, number, 0), item = cJSON_CreateNumber(number); break;
  case 5: sonde_json_begin_list(out, key), item = cJSON_CreateArray(); break;
  default: sonde_json_begin_object(out, key), item = cJSON_CreateObject();
  }
  if (!to) fail_msg("no place");
  if (cJSON_IsObject(to))
    cJSON_AddItemToObject(to, key, item);
  else
    cJSON_AddItemToArray(to, item);
  if (kind < 5) return;
  for (uint64_t k = 0, count = next(r) % 5; k < count; ++k) {
    char own[40];
    snprintf(own, sizeof own, "%c%s", (char)('A' + k), random_text(r, text));
    write_both(r, out, own, item, depth + 1);
  }
  sonde_json_end(out);
}

static void same(const sonde_json *own, const cJSON *other) {
  sonde_json_kind kind = sonde_json_kind_of(own);
  assert_int_equal(cJSON_IsNull(other), kind == SONDE_JSON_NULL);
  assert_int_equal(cJSON_IsFalse(other), kind == SONDE_JSON_FALSE);
  assert_int_equal(cJSON_IsTrue(other), kind == SONDE_JSON_TRUE);
  assert_int_equal(cJSON_IsArray(other), kind == SONDE_JSON_LIST);
  assert_int_equal(cJSON_IsObject(other), kind == SONDE_JSON_OBJECT);
  if (cJSON_IsNumber(other)) assert_true(sonde_json_as_number(own) == other->valuedouble);
  if (cJSON_IsString(other)) assert_string_equal(sonde_json_as_text(own), other->valuestring);
  assert_int_equal(sonde_json_count(own), cJSON_GetArraySize(other));
  const sonde_json *v = sonde_json_first(own);
  for (const cJSON *o = other->child; o; o = o->next, v = sonde_json_next(v)) {
    assert_non_null(v);
    if (cJSON_IsObject(other)) {
      assert_string_equal(sonde_json_key(v), o->string);
      assert_ptr_equal(sonde_json_member(own, o->string), v);
    }
    same(v, o);
  }
  assert_null(v);
}

static void what_is_written_is_what_cjson_writes_and_reads(void **unused) {
  (void)unused;
  uint64_t r = 0;
  for (int round = 0; round < 3000; ++round) {
    sonde_file *file;
    assert_int_equal(sonde_file_in_memory(&file, NULL), SONDE_OK);
    const sonde_json_layout layout = (sonde_json_layout)(round % 3);
    sonde_json_out out = {.file = file, .layout = layout};
    cJSON *top = cJSON_CreateArray();
    sonde_json_begin_list(&out, NULL);
    for (int k = 0; k < 3; ++k) write_both(&r, &out, "top", top, 1);
    sonde_json_end(&out);
    char *text;
    size_t count;
    assert_int_equal(sonde_file_take(file, &text, &count, NULL), SONDE_OK);
    if (layout != SONDE_JSON_LINES) {
      char *other = layout == SONDE_JSON_TABS ? cJSON_Print(top) : cJSON_PrintUnformatted(top);
      assert_string_equal(text, other);
      cJSON_free(other);
    }
    sonde_json *own;
    assert_int_equal(sonde_json_parse(text, count, NULL, &own, NULL), SONDE_OK);
    cJSON *read_by_other = cJSON_ParseWithOpts(text, NULL, 1);
    assert_non_null(read_by_other);
    same(own, read_by_other);
    // Of a text with one byte changed, cJSON reads whatever the strict reader takes.
    sonde_json_free(own);
    text[next(&r) % count] = "\"\\[]{},:0eE.-u\n"[next(&r) % 15];
    if (sonde_json_parse(text, count, NULL, &own, NULL) == SONDE_OK) {
      cJSON *changed = cJSON_ParseWithOpts(text, NULL, 1);
      assert_non_null(changed);
      same(own, changed);
      cJSON_Delete(changed);
    }
    sonde_json_free(own);
    cJSON_Delete(read_by_other);
    cJSON_Delete(top);
    sonde_free(text);
  }
}

static char *written(double value, int digits, const char *string) {
  sonde_file *file;
  char *text;
  size_t count;
  assert_int_equal(sonde_file_in_memory(&file, NULL), SONDE_OK);
  sonde_json_out out = {.file = file};
  if (string)
    sonde_json_put_text(&out, NULL, string);
  else
    sonde_json_put_real(&out, NULL, value, digits);
  assert_int_equal(sonde_file_take(file, &text, &count, NULL), SONDE_OK);
  return text;
}

static void is_written(const char *expected, double value, int digits, const char *string) {
  char *text = written(value, digits, string);
  assert_string_equal(text, expected);
  sonde_free(text);
}

static void numbers_and_texts_are_written_as_json(void **unused) {
  (void)unused;
  is_written("0.1", 0.1, 0, NULL);
  is_written("0.33333333333333331", 1. / 3, 17, NULL);
  is_written("0.333333333", 1. / 3, 9, NULL);
  is_written("-1.5e-300", -1.5e-300, 0, NULL);
  is_written("null", (double)NAN, 0, NULL);
  is_written("null", (double)INFINITY, 9, NULL);
  is_written("null", -(double)INFINITY, 17, NULL);
  is_written("\"\\\"\\\\\\b\\f\\n\\r\\t\\u0001\\u001f\x7f/\"", 0, 0, "\"\\\b\f\n\r\t\x01\x1f\x7f/");
  is_written("\"a\xef\xbf\xbd\xef\xbf\xbd"
             "b\xc3\xa9\"",
             0, 0,
             "a\xff\xc3"
             "b\xc3\xa9"); // Latin-1
  uint64_t r = 1 << 20;
  for (int k = 0; k < 20000; ++k) { // with 17 digits the same double is read
    double value = random_number(&r);
    char *text = written(value, 17, NULL);
    sonde_json *root;
    assert_int_equal(sonde_json_parse(text, strlen(text), NULL, &root, NULL), SONDE_OK);
    assert_true(sonde_json_as_number(root) == value);
    sonde_json_free(root);
    sonde_free(text);
  }
}

static void a_decimal_comma_changes_nothing(void **unused) {
  (void)unused;
  if (!setlocale(LC_NUMERIC, "comma")) skip(); // no localedef on this machine
  is_written("0.333333333", 1. / 3, 9, NULL);
  is_written("-0.1", -0.1, 0, NULL);
  sonde_json *root = read("[1.5]", NULL);
  assert_true(sonde_json_as_number(sonde_json_first(root)) == 1.5);
  sonde_json_free(root);
  setlocale(LC_NUMERIC, "C");
}

static void *allocate(size_t bytes, void *user) {
  int *left = user;
  return (*left)-- > 0 ? malloc(bytes) : NULL;
}

static void release(void *pointer, void *user) {
  (void)user;
  free(pointer);
}

static void out_of_memory_is_a_status(void **unused) {
  (void)unused;
  char text[2000] = "{\"a\":1,\"b\":[0";
  for (int k = 0; k < 200; ++k) strcat(text, ",1");
  strcat(text, "]}");
  int left = 0;
  const sonde_allocator hook = {allocate, release, &left};
  sonde_set_allocator(&hook);
  sonde_status status = SONDE_MEMORY;
  int needed = 0;
  for (; status == SONDE_MEMORY; ++needed) {
    sonde_json *root;
    left = needed;
    status = sonde_json_parse(text, strlen(text), NULL, &root, NULL);
    sonde_json_free(root);
  }
  sonde_set_allocator(NULL);
  assert_int_equal(status, SONDE_OK);
  assert_in_range(needed, 5, 10);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_mistake_is_told_with_its_line),
      cmocka_unit_test(values_are_found_by_key_and_in_order),
      cmocka_unit_test(what_is_written_is_what_cjson_writes_and_reads),
      cmocka_unit_test(numbers_and_texts_are_written_as_json),
      cmocka_unit_test(a_decimal_comma_changes_nothing),
      cmocka_unit_test(out_of_memory_is_a_status),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
