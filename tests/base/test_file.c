// Atomic output files: a reader sees the old file or the whole new one, and nothing else is left.
#include "test.h"

#include "base/disk.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
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

// A child that is killed leaves its temporary file; what lives is not touched, nor other names.
static void sweep_takes_what_the_dead_left(void **state) {
  (void)state;
  char other[320];
  snprintf(other, sizeof other, "%s/target.bin.part-of", directory);
  int pipe_of[2];
  char byte;
  assert_int_equal(pipe(pipe_of), 0);
  pid_t child = fork();
  if (child == 0) {
    sonde_file *file;
    bool good = sonde_file_create(target, &file, NULL) == SONDE_OK;
    good = good && write(pipe_of[1], "x", 1) == 1;
    alarm(20); // a failing test leaves no child
    if (good) pause();
    _exit(1);
  }
  assert_int_equal(read(pipe_of[0], &byte, 1), 1);
  assert_int_equal(sonde_file_remove_abandoned(target), 0); // it lives
  assert_int_equal(count_entries(), 1);
  kill(child, SIGKILL);
  assert_int_equal(waitpid(child, NULL, 0), child);
  sonde_file *mine;
  assert_int_equal(sonde_file_create(target, &mine, NULL), SONDE_OK);
  fclose(fopen(other, "w"));
  assert_int_equal(sonde_file_remove_abandoned(target), 1);
  assert_int_equal(count_entries(), 2);
  assert_int_equal(sonde_file_remove_abandoned("/nonexistent-directory/x"), 0);
  sonde_file_write(mine, "mine", 4);
  assert_int_equal(sonde_file_commit(mine, NULL), SONDE_OK);
  expect_content("mine");
  close(pipe_of[0]), close(pipe_of[1]);
  assert_int_equal(unlink(other), 0);
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

static void directory_is_refused_at_once(void **state) {
  (void)state;
  assert_int_equal(mkdir(target, 0777), 0); // a directory cannot be replaced by a file
  sonde_file *file;
  sonde_error error;
  assert_int_equal(sonde_file_create(target, &file, &error), SONDE_IO);
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
  assert_int_equal(status, SONDE_DISK);
  assert_non_null(strstr(error.message, "cannot be written"));
  expect_content("old");
  assert_int_equal(count_entries(), 1);
}

static void write_to(const char *path, const char *text) {
  sonde_file *file;
  assert_int_equal(sonde_file_create(path, &file, NULL), SONDE_OK);
  sonde_file_write(file, text, strlen(text));
  assert_int_equal(sonde_file_commit(file, NULL), SONDE_OK);
}

static mode_t kind_of(const char *path) {
  struct stat info;
  assert_int_equal(lstat(path, &info), 0);
  return info.st_mode & S_IFMT;
}

// A chain of a relative and an absolute link into another directory, and a link that leads to
// nothing yet.
static void links_are_followed_and_stay(void **state) {
  (void)state;
  char there[300], first[300], second[400];
  snprintf(there, sizeof there, "%s/there", directory);
  snprintf(first, sizeof first, "%s/first", directory);
  snprintf(second, sizeof second, "%s/second", there);
  assert_int_equal(mkdir(there, 0777), 0);
  assert_int_equal(symlink("there/second", first), 0);
  assert_int_equal(symlink(target, second), 0);
  write_to(first, "through links"); // target.bin did not exist
  expect_content("through links");
  write_to(first, "again");
  expect_content("again");
  assert_int_equal(kind_of(first), S_IFLNK);
  assert_int_equal(kind_of(second), S_IFLNK);
  assert_int_equal(chmod(target, 0640), 0);
  write_to(first, "mode");
  struct stat info;
  assert_int_equal(stat(target, &info), 0);
  assert_int_equal(info.st_mode & 0777, 0640);
  assert_int_equal(unlink(second), 0);
  assert_int_equal(symlink("../first", second), 0); // a circle
  sonde_file *file;
  assert_int_equal(sonde_file_create(first, &file, NULL), SONDE_IO);
  assert_int_equal(unlink(first) + unlink(second) + rmdir(there), 0);
  assert_int_equal(count_entries(), 1);
}

static char from_pipe[16];

static void *read_pipe(void *path) {
  int file = open(path, O_RDONLY);
  ssize_t got = file < 0 ? -1 : read(file, from_pipe, sizeof from_pipe - 1);
  close(file);
  return (void *)(intptr_t)got;
}

static void pipes_are_written_into(void **state) {
  (void)state;
  pthread_t reader;
  void *got;
  assert_int_equal(mkfifo(target, 0600), 0);
  assert_int_equal(pthread_create(&reader, NULL, read_pipe, target), 0);
  write_to(target, "in a pipe");
  pthread_join(reader, &got);
  assert_int_equal((intptr_t)got, 9);
  assert_string_equal(from_pipe, "in a pipe");
  assert_int_equal(kind_of(target), S_IFIFO);
  assert_int_equal(count_entries(), 1);
}

static void devices_stay_devices(void **state) {
  (void)state;
  assert_int_equal(symlink("/dev/null", target), 0);
  write_to(target, "nowhere");
  assert_int_equal(kind_of(target), S_IFLNK);
  assert_int_equal(kind_of("/dev/null"), S_IFCHR);
  sonde_file *file;
  sonde_error error = {0};
  assert_int_equal(sonde_file_create("/dev/full", &file, &error), SONDE_OK);
  sonde_file_printf(file, "%d", 1);
  assert_int_equal(sonde_file_commit(file, &error), SONDE_DISK);
  assert_non_null(strstr(error.message, "/dev/full"));
  assert_int_equal(kind_of("/dev/full"), S_IFCHR);
}

// Standard output is a regular file here: a rename would put another one in its place, and a second
// opening would begin at its start.
static void standard_output_is_written_into(void **state) {
  (void)state;
  char name[32];
  int file = open(target, O_CREAT | O_RDWR, 0600), before = dup(1);
  assert_true(file >= 0 && before >= 0);
  fflush(stdout);
  dup2(file, 1);
  printf("head ");
  write_to("/dev/stdout", "body ");
  printf("tail ");
  fflush(stdout);
  dup2(before, 1);
  close(before);
  snprintf(name, sizeof name, "/dev/fd/%d", file);
  write_to(name, "end");
  close(file);
  expect_content("head body tail end");
  assert_int_equal(count_entries(), 1);
}

typedef struct fault_plan {
  int calls, at;
  int failure;
  bool lasting;
} fault_plan;

static int strike(sonde_disk_call call, const char *path, size_t *bytes, void *user) {
  (void)path;
  fault_plan *plan = user;
  int number = plan->calls++;
  if (plan->at < 0 || number < plan->at || (number > plan->at && !plan->lasting)) return 0;
  if (plan->lasting && (call == SONDE_DISK_REMOVE || call == SONDE_DISK_CLOSE)) return 0;
  *bytes /= 2; // half a write
  return plan->failure;
}

// Replaces an old text by a long new one under a plan. @return what the writer was told
static sonde_status replace(fault_plan *plan, const char *old, const char *new, size_t count) {
  write_all(old);
  sonde_disk_set_fault(strike, plan);
  sonde_file *file;
  sonde_error error = {0};
  sonde_status status = sonde_file_create(target, &file, &error);
  for (size_t k = 0; !status && k < count; k += 1000)
    sonde_file_write(file, new + k, count - k < 1000 ? count - k : 1000);
  if (!status) status = sonde_file_commit(file, &error);
  sonde_disk_set_fault(NULL, NULL);
  if (status) assert_non_null(strstr(error.message, target));
  return status;
}

static void every_failing_call_leaves_the_old_or_the_new(void **state) {
  (void)state;
  static char old[100], new[200000];
  memset(old, 'o', sizeof old - 1);
  memset(new, 'n', sizeof new - 1);
  fault_plan whole = {.at = -1};
  assert_int_equal(replace(&whole, old, new, sizeof new - 1), SONDE_OK);
  assert_true(whole.calls >= 9); // open, 4 writes, sync, close, rename, sync
  for (int k = 0; k < 2 * whole.calls; ++k) {
    bool lasting = k % 2;
    fault_plan plan = {.at = k / 2, .failure = lasting ? ENOSPC : EIO, .lasting = lasting};
    sonde_status status = replace(&plan, old, new, sizeof new - 1);
    char *bytes;
    size_t count;
    assert_int_equal(sonde_file_load(target, &bytes, &count, NULL), SONDE_OK);
    bool is_old = count == sizeof old - 1 && memcmp(bytes, old, count) == 0;
    bool is_new = count == sizeof new - 1 && memcmp(bytes, new, count) == 0;
    sonde_free(bytes);
    assert_true(is_old || is_new);
    // A close that lasting trouble spares may leave a success, nothing else does.
    assert_true(status == SONDE_DISK || (lasting && is_new));
    assert_int_equal(count_entries(), 1);
  }
}

static void extended_file_keeps_what_was_written(void **state) {
  (void)state;
  sonde_file *file;
  write_all("head and tail");
  assert_int_equal(sonde_file_extend(target, 5, &file, NULL), SONDE_OK);
  sonde_file_printf(file, "more");
  assert_int_equal(sonde_file_flush(file, NULL), SONDE_OK);
  expect_content("head more");
  fault_plan plan = {.failure = ENOSPC, .lasting = true};
  sonde_disk_set_fault(strike, &plan);
  sonde_file_printf(file, "12345678");
  sonde_error error = {0};
  assert_int_equal(sonde_file_flush(file, &error), SONDE_DISK);
  assert_non_null(strstr(error.message, target));
  sonde_disk_set_fault(NULL, NULL);
  sonde_file_printf(file, "never"); // behind a gap it would be another text
  assert_int_equal(sonde_file_commit(file, NULL), SONDE_DISK);
  expect_content("head more1234");
}

static void file_in_memory_gives_what_was_written(void **state) {
  (void)state;
  sonde_file *file;
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_in_memory(&file, NULL), SONDE_OK);
  for (int i = 0; i < 40000; ++i) sonde_file_printf(file, "%05d", i);
  assert_int_equal(sonde_file_take(file, &bytes, &count, NULL), SONDE_OK);
  assert_int_equal(count, 200000);
  assert_memory_equal(bytes + 5 * 12345, "12345", 5);
  assert_int_equal(bytes[count], 0);
  sonde_free(bytes);
  assert_int_equal(count_entries(), 0);
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

// sonde_file_check() says of every path what sonde_file_create() then does, and changes nothing.
static void a_check_foresees_whether_a_file_can_be_made(void **state) {
  (void)state;
  write_all("old");
  char missing[320], inside[320], link[320], loop[320];
  snprintf(missing, sizeof missing, "%s/missing/file", directory);
  snprintf(inside, sizeof inside, "%s/file", target); // its parent is no directory
  snprintf(link, sizeof link, "%s/link", directory);
  snprintf(loop, sizeof loop, "%s/loop", directory);
  assert_int_equal(symlink(missing, link), 0);
  assert_int_equal(symlink(loop, loop), 0);
  const char *const paths[] = {target,      missing,     inside,        link, loop, directory,
                               "/dev/null", "/dev/full", "/dev/stdout", "",   "/"};
  for (size_t i = 0; i < SONDE_COUNT_OF(paths); ++i) {
    sonde_error checked = {0}, created = {0};
    sonde_file *file;
    int entries = count_entries();
    sonde_status expected = sonde_file_check(paths[i], &checked);
    assert_int_equal(count_entries(), entries);
    assert_int_equal(sonde_file_create(paths[i], &file, &created), expected);
    assert_string_equal(checked.message, created.message);
    sonde_file_discard(file);
  }
  unlink(link);
  unlink(loop);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      FILE_TEST(sweep_takes_what_the_dead_left),
      FILE_TEST(commit_publishes_the_whole),
      FILE_TEST(commit_replaces_and_keeps_the_usual_mode),
      FILE_TEST(discard_leaves_the_old_file),
      FILE_TEST(missing_directory_is_named),
      FILE_TEST(directory_is_refused_at_once),
      FILE_TEST(links_are_followed_and_stay),
      FILE_TEST(pipes_are_written_into),
      FILE_TEST(devices_stay_devices),
      FILE_TEST(standard_output_is_written_into),
      FILE_TEST(every_failing_call_leaves_the_old_or_the_new),
      FILE_TEST(extended_file_keeps_what_was_written),
      FILE_TEST(file_in_memory_gives_what_was_written),
      FILE_TEST(full_disk_is_reported_and_leaves_the_old_file),
      FILE_TEST(load_names_what_it_cannot_read),
      FILE_TEST(large_files_come_back_whole),
      FILE_TEST(a_check_foresees_whether_a_file_can_be_made),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
