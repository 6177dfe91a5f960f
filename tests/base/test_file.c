// Atomic output files: a reader sees the old file or the whole new one, and nothing else is left.
#include "test.h"

#include <dirent.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

static char directory[256], target[300];

static int set_up(void **state) {
  (void)state;
  snprintf(directory, sizeof directory, "%s/file_test_XXXXXX", SONDE_BINARY_DIR);
  if (!mkdtemp(directory)) return -1;
  snprintf(target, sizeof target, "%s/target.bin", directory);
  return 0;
}

static int count_entries(void) {
  int count = 0;
  DIR *d = opendir(directory);
  for (struct dirent *e = readdir(d); e; e = readdir(d)) count += e->d_name[0] != '.';
  closedir(d);
  return count;
}

static int tear_down(void **state) {
  (void)state;
  unlink(target);
  rmdir(target);
  return rmdir(directory); // fails when a test left something behind
}

static void expect_content(const char *expected) {
  char *bytes;
  size_t count;
  sonde_error error;
  assert_int_equal(sonde_file_load(target, &bytes, &count, &error), SONDE_OK);
  assert_int_equal(count, strlen(expected));
  assert_memory_equal(bytes, expected, count + 1); // with the terminating 0
  sonde_free(bytes);
}

static void write_all(const char *text) {
  sonde_file *file;
  assert_int_equal(sonde_file_create(target, &file, NULL), SONDE_OK);
  sonde_file_write(file, text, strlen(text));
  assert_int_equal(sonde_file_commit(file, NULL), SONDE_OK);
}

static void commit_publishes_the_whole(void **state) {
  (void)state;
  sonde_file *file;
  assert_int_equal(sonde_file_create(target, &file, NULL), SONDE_OK);
  sonde_file_write(file, "abc", 3);
  assert_int_not_equal(access(target, F_OK), 0); // not there before the commit
  sonde_file_printf(file, " %d", 42);
  assert_int_equal(sonde_file_commit(file, NULL), SONDE_OK);
  expect_content("abc 42");
  assert_int_equal(count_entries(), 1);
}

static void commit_replaces_and_keeps_the_usual_mode(void **state) {
  (void)state;
  write_all("old");
  mode_t mask = umask(022);
  write_all("newer");
  umask(mask);
  expect_content("newer");
  struct stat info;
  assert_int_equal(stat(target, &info), 0);
  assert_int_equal(info.st_mode & 0777, 0644);
  assert_int_equal(count_entries(), 1);
}

static void discard_leaves_the_old_file(void **state) {
  (void)state;
  write_all("old");
  sonde_file *file;
  assert_int_equal(sonde_file_create(target, &file, NULL), SONDE_OK);
  sonde_file_write(file, "half", 4);
  sonde_file_discard(file);
  sonde_file_discard(NULL);
  expect_content("old");
  assert_int_equal(count_entries(), 1);
}

static void missing_directory_is_named(void **state) {
  (void)state;
  char path[400];
  snprintf(path, sizeof path, "%s/nowhere/model.sonde", directory);
  sonde_file *file = (sonde_file *)path;
  sonde_error error;
  assert_int_equal(sonde_file_create(path, &file, &error), SONDE_IO);
  assert_null(file);
  assert_non_null(strstr(error.message, path));
  assert_int_equal(count_entries(), 0);
}

static void failed_rename_leaves_nothing(void **state) {
  (void)state;
  assert_int_equal(mkdir(target, 0777), 0); // a directory cannot be replaced by a file
  sonde_file *file;
  sonde_error error;
  assert_int_equal(sonde_file_create(target, &file, &error), SONDE_OK);
  sonde_file_write(file, "x", 1);
  assert_int_equal(sonde_file_commit(file, &error), SONDE_IO);
  assert_non_null(strstr(error.message, target));
  assert_int_equal(count_entries(), 1); // the directory itself
}

static void full_disk_is_reported_and_leaves_the_old_file(void **state) {
  (void)state;
  write_all("old");
  struct rlimit before, small;
  getrlimit(RLIMIT_FSIZE, &before);
  small = (struct rlimit){1000, before.rlim_max};
  void (*handler)(int) = signal(SIGXFSZ, SIG_IGN);
  sonde_file *file;
  sonde_error error = {0};
  assert_int_equal(sonde_file_create(target, &file, NULL), SONDE_OK);
  static const char block[5000];
  setrlimit(RLIMIT_FSIZE, &small);
  for (int i = 0; i < 4; ++i) sonde_file_write(file, block, sizeof block);
  sonde_status status = sonde_file_commit(file, &error);
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, handler);
  assert_int_equal(status, SONDE_IO);
  assert_non_null(strstr(error.message, "cannot be written"));
  expect_content("old");
  assert_int_equal(count_entries(), 1);
}

static void load_names_what_it_cannot_read(void **state) {
  (void)state;
  char *bytes = directory;
  size_t count = 1;
  sonde_error error;
  assert_int_equal(sonde_file_load(target, &bytes, &count, &error), SONDE_IO);
  assert_null(bytes);
  assert_int_equal(count, 0);
  assert_non_null(strstr(error.message, target));
  assert_int_equal(sonde_file_load(directory, &bytes, &count, &error), SONDE_IO);
  assert_non_null(strstr(error.message, "directory"));
}

static void large_files_come_back_whole(void **state) {
  (void)state;
  enum { COUNT = 300001 };
  sonde_file *file;
  assert_int_equal(sonde_file_create(target, &file, NULL), SONDE_OK);
  for (int i = 0; i < COUNT; ++i)
    sonde_file_write(file, &(unsigned char){(unsigned char)(i % 251)}, 1);
  assert_int_equal(sonde_file_commit(file, NULL), SONDE_OK);
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(target, &bytes, &count, NULL), SONDE_OK);
  assert_int_equal(count, COUNT);
  int wrong = 0;
  for (int i = 0; i < COUNT; ++i) wrong += (unsigned char)bytes[i] != i % 251;
  assert_int_equal(wrong, 0);
  assert_int_equal(bytes[COUNT], 0);
  sonde_free(bytes);
}

#define FILE_TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void) {
  const struct CMUnitTest tests[] = {
      FILE_TEST(commit_publishes_the_whole),
      FILE_TEST(commit_replaces_and_keeps_the_usual_mode),
      FILE_TEST(discard_leaves_the_old_file),
      FILE_TEST(missing_directory_is_named),
      FILE_TEST(failed_rename_leaves_nothing),
      FILE_TEST(full_disk_is_reported_and_leaves_the_old_file),
      FILE_TEST(load_names_what_it_cannot_read),
      FILE_TEST(large_files_come_back_whole),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
