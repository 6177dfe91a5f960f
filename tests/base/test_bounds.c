// Limits of input: a file, a stream without an end and a JSON text cost no more than they allow.
#include "test.h"

#include "base/bounds.h"

#include <sys/stat.h>
#include <unistd.h>

static const sonde_input_limits SMALL = {"a small file", 100, 5, 3};

static const char *put(const char *bytes, size_t count) {
  static char path[300];
  snprintf(path, sizeof path, "%s/bounds_test.bin", SONDE_BINARY_DIR);
  FILE *stream = fopen(path, "wb");
  assert_non_null(stream);
  assert_int_equal(fwrite(bytes, 1, count, stream), count);
  assert_int_equal(fclose(stream), 0);
  return path;
}

static void a_file_is_read_up_to_its_limit(void **unused) {
  (void)unused;
  char text[101], *bytes;
  size_t count;
  sonde_error error = {0};
  memset(text, 'x', sizeof text);
  const char *path = put(text, 100);
  assert_int_equal(sonde_bounded_load(path, &SMALL, &bytes, &count, &error), SONDE_OK);
  assert_int_equal(count, 100);
  assert_int_equal(bytes[100], 0);
  sonde_free(bytes);
  path = put(text, 101);
  assert_int_equal(sonde_bounded_load(path, &SMALL, &bytes, &count, &error), SONDE_FORMAT);
  assert_null(bytes);
  assert_non_null(strstr(error.message, "is larger than a small file may be"));
  unlink(path);
}

// What the reader allocates for a stream that never ends.
typedef struct tally {
  size_t most;
} tally;

static void *count_allocation(size_t bytes, void *user) {
  tally *t = user;
  if (bytes > t->most) t->most = bytes;
  return malloc(bytes);
}
static void release(void *pointer, void *user) {
  (void)user;
  free(pointer);
}

static void a_stream_without_end_is_refused(void **unused) {
  (void)unused;
  tally t = {0};
  char *bytes;
  size_t count;
  sonde_error error = {0};
  sonde_set_allocator(&(sonde_allocator){count_allocation, release, &t});
  sonde_status status = sonde_bounded_load("/dev/zero", &sonde_limits_yaml, &bytes, &count, &error);
  sonde_set_allocator(NULL);
  assert_int_equal(status, SONDE_FORMAT);
  assert_null(bytes);
  assert_in_range(t.most, 1, 2 * sonde_limits_yaml.most_bytes + 1);
}

static void a_zero_byte_is_told_with_its_line(void **unused) {
  (void)unused;
  char *text;
  size_t count;
  sonde_error error = {0};
  const char *path = put("a\nb\n\0c", 6);
  assert_int_equal(sonde_bounded_load_text(path, &SMALL, &text, &count, &error), SONDE_FORMAT);
  assert_null(text);
  assert_non_null(strstr(error.message, "bounds_test.bin:3: contains a zero byte"));
  unlink(path);
}

static sonde_status shape(const char *text, sonde_error *error) {
  return sonde_bounded_json("x.json", text, strlen(text), &SMALL, error);
}

static void json_is_bounded_before_it_is_parsed(void **unused) {
  (void)unused;
  sonde_error error = {0};
  assert_int_equal(shape("{\"a\": [[1]]}", &error), SONDE_OK);
  assert_int_equal(shape("{\"a\":\n[[[1]]]}", &error), SONDE_FORMAT);
  assert_string_equal(error.message, "x.json:2: expected at most 3 levels of nesting");
  assert_int_equal(shape("[1,2,3,4,5]", &error), SONDE_OK);
  assert_int_equal(shape("[1,2,3,4,5,6]", &error), SONDE_FORMAT);
  assert_string_equal(error.message, "x.json:1: expected at most 5 values");
  // brackets within texts do not count, nor does a quote behind a backslash end a text
  assert_int_equal(shape("[\"[[[[[[\\\"[[[,,,,,,\"]", &error), SONDE_OK);
  // what is not JSON is the parser's to refuse, not to be read beyond its end
  assert_int_equal(shape("\"\\", &error), SONDE_OK);
  assert_int_equal(shape("]]]][", &error), SONDE_OK);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_file_is_read_up_to_its_limit),
      cmocka_unit_test(a_stream_without_end_is_refused),
      cmocka_unit_test(a_zero_byte_is_told_with_its_line),
      cmocka_unit_test(json_is_bounded_before_it_is_parsed),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
