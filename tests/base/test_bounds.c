// Limits of input: a file and a stream without an end cost no more than they allow.
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

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_file_is_read_up_to_its_limit),
      cmocka_unit_test(a_stream_without_end_is_refused),
      cmocka_unit_test(a_zero_byte_is_told_with_its_line),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
