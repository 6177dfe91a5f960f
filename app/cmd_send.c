// sonde send: hands DICOM files to an archive by C-STORE, through the separate program storescu.
#include "options.h"
#include "start.h"

#include <assert.h>
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

typedef struct options {
  const char *path, *to, *called, *calling;
  char host[256];   // of `to`
  const char *port; // behind it
  bool json;
} options;

static const options DEFAULTS = {.called = "ANY-SCP", .calling = "SONDE"};

static const app_option TABLE[] = {
    OPT_ARGUMENT(path, "FILE", NULL), OPT_TEXT(to, "to", "HOST:PORT", "where the archive listens"),
    OPT_TEXT(called, "called", "NAME", "application entity of the archive; default ANY-SCP"),
    OPT_TEXT(calling, "calling", "NAME", "application entity of the sender; default SONDE"),
    OPT_FLAG(json, "json", "print one JSON object: files, sent")};

static int check(void *from) {
  options *s = from;
  const char *colon = strrchr(s->to, ':');
  char *end = NULL;
  const long port = colon ? strtol(colon + 1, &end, 10) : 0;
  if (!colon || colon == s->to || s->to[0] == '-' || end == colon + 1 || *end || port < 1 ||
      port > 65535 || (size_t)(colon - s->to) >= sizeof s->host)
    return app_usage_error("send", "--to expects HOST:PORT as in localhost:104, found '%s'", s->to);
  memcpy(s->host, s->to, (size_t)(colon - s->to));
  s->port = colon + 1;
  const char *const names[] = {s->called, s->calling};
  for (int k = 0; k < 2; ++k)
    if (strlen(names[k]) < 1 || strlen(names[k]) > 16 || names[k][0] == '-')
      return app_usage_error(
          "send", "an application entity has 1 to 16 characters and no - first, found '%s'",
          names[k]);
  return APP_OK;
}

static int keep_dicom(const struct dirent *item) {
  const size_t length = strlen(item->d_name);
  return length > 4 && item->d_name[0] != '.' && strcmp(item->d_name + length - 4, ".dcm") == 0;
}

// One file, one association. What storescu says goes to stderr, so that stdout has the JSON alone.
static sonde_status store(const options *s, const char *path, sonde_error *error) {
  // DICOM files begin with 128 bytes of anything and DICM.
  char head[132];
  FILE *file = fopen(path, "rb");
  const bool is_dicom = file && fread(head, 1, sizeof head, file) == sizeof head &&
                        memcmp(head + 128, "DICM", 4) == 0;
  if (file) fclose(file);
  if (!is_dicom)
    return app_error(error, SONDE_FORMAT,
                     "%.300s: expected a DICOM file, found no DICM at byte 128", path);
  const char *const words[] = {"storescu", "-R",    "-aet",  s->calling, "-aec",
                               s->called,  s->host, s->port, path,       NULL};
  const app_program_start what = {
      .words = words, .input = APP_STANDARD, .output = STDERR_FILENO, .errors = APP_STANDARD};
  pid_t child;
  const int code = app_start(&what, &child);
  if (code == ENOENT)
    return app_error(error, SONDE_DEVICE,
                     "the program storescu, which sends, is not there (Debian package dcmtk)");
  if (code) return app_error(error, SONDE_DEVICE, "storescu did not start: %s", strerror(code));
  const int ended = app_await(child, false);
  return WIFEXITED(ended) && WEXITSTATUS(ended) == 0
             ? SONDE_OK
             : app_error(error, SONDE_DEVICE,
                         "%.300s was not stored at %.100s; what storescu said stands above", path,
                         s->to);
}

static int run(void *from) {
  const options *s = from;
  assert(s->path && s->to);
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  struct stat facts;
  struct dirent **list = NULL;
  int count = 1, sent = 0;
  const bool whole = stat(s->path, &facts) == 0 && S_ISDIR(facts.st_mode);
  if (whole) count = scandir(s->path, &list, keep_dicom, alphasort);
  if (!whole && access(s->path, R_OK) != 0)
    status = app_error(&error, SONDE_NOT_FOUND, "%.300s: %s", s->path, strerror(errno));
  else if (count < 1)
    status = app_error(&error, SONDE_NOT_FOUND, "%.300s: no file that ends in .dcm", s->path);
  for (int k = 0; k < count && !status; ++k) {
    char path[8192];
    snprintf(path, sizeof path, whole ? "%s/%s" : "%s", s->path, whole ? list[k]->d_name : "");
    status = store(s, path, &error);
    sent += !status;
  }
  for (int k = 0; whole && k < count; ++k) free(list[k]);
  free(list);
  if (s->json && (!status || sent)) {
    app_json_begin();
    app_json("files:%d sent:%d", count, sent);
    app_json_end();
  } else if (sent) {
    printf("%d of %d files stored at %s\n", sent, count, s->to);
  }
  return status ? app_fail("send", &error) : APP_OK;
}

const app_command cmd_send = {
    .verb = "send",
    .summary = "send DICOM files to an archive",
    .usage = "FILE --to HOST:PORT [options]",
    .text =
        "Stores a DICOM file, or of a directory all files that end in .dcm, in an archive "
        "(C-STORE), one after the other, and ends at the first that is refused. A file that the "
        "archive has already is the same instance. The program storescu of dcmtk does the "
        "sending.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .required = "FILE to",
    .check = check,
    .run = run};
