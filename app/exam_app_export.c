// What the page may download of a kept exam: the files of its worksheet as they are, and its
// recording as a tracked sequence, which `sonde replay` writes in a process of its own, at a lower
// priority, so that nothing waits for it. One export at a time; its file lives until the next one
// or the end of the program.
#include "exam_app_export.h"
#include "start.h"

#include <assert.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static const char *const ENDINGS[] = {"igs.mha", "seq.nrrd", "dcm"};

bool exam_is_id(const char *id) {
  return id[0] && strspn(id, "abcdefghijklmnopqrstuvwxyz0123456789-") == strlen(id);
}

static const char *export_path(const exam_app *app, char path[EXAM_PATH]) {
  const exam_export *e = app->export;
  char name[EXAM_ALIAS + 8];
  snprintf(name, sizeof name, "export-%s", e->name);
  return exam_app_path(path, e->directory, name);
}

// ---- what the page is told

static int of_worksheet(const struct dirent *item) {
  const char *ending = strrchr(item->d_name, '.');
  return strncmp(item->d_name, "worksheet", 9) == 0 && ending &&
         (strcmp(ending, ".dcm") == 0 || strcmp(ending, ".csv") == 0 ||
          strcmp(ending, ".json") == 0);
}

// A file by its name, and its address with the key that opens it: /PLACE/ID/NUMBER,
// /PLACE/ID.ENDING.
static void put_file(const exam_app *app, sonde_json_out *out, const char *key, const char *place,
                     const char *name) {
  char path[160], link[SONDE_PAGE_LINK];
  const char *rest = name + strcspn(name, "-.");
  snprintf(path, sizeof path, "/%s/%s%s%.40s", place, app->export->id, *rest == '-' ? "/" : "",
           *rest == '-' ? rest + 1 : rest);
  sonde_page_link(app->server, path, link);
  sonde_json_begin_object(out, key);
  sonde_json_put_text(out, "name", name);
  sonde_json_put_text(out, "link", link);
  sonde_json_end(out);
}

static void tell(const exam_app *app) {
  const exam_export *e = app->export;
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  struct dirent **list = NULL;
  char *text = NULL, name[EXAM_ALIAS + 8];
  size_t length = 0;
  if (!e->id[0] || sonde_file_in_memory(&out.file, NULL)) return;
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_text(&out, "type", "export");
  sonde_json_put_text(&out, "exam", e->id);
  sonde_json_put_integer(&out, "parts", (int64_t)exam_part_count(e->directory));
  sonde_json_put_text(&out, "what", e->name);
  sonde_json_put_bool(&out, "running", e->child != 0);
  sonde_json_put_real(&out, "progress", 0.01 * e->percent, 2);
  sonde_json_put_text(&out, "message", e->message);
  sonde_json_begin_list(&out, "files");
  snprintf(name, sizeof name, "export-%s", e->name);
  if (e->ready) put_file(app, &out, NULL, "export", name);
  const int count = scandir(e->directory, &list, of_worksheet, alphasort);
  for (int k = 0; k < count; ++k) {
    put_file(app, &out, NULL, "worksheet", list[k]->d_name);
    free(list[k]);
  }
  free(list);
  sonde_json_end(&out);
  sonde_json_end(&out);
  if (!sonde_file_take(out.file, &text, &length, NULL))
    (void)sonde_page_publish(app->server, SONDE_PAGE_FILES, text, NULL);
  sonde_free(text);
}

// ---- the process that writes

// Its lines: "12 %" is progress; any other is why it failed, or nothing.
static void hear(exam_export *e) {
  char bytes[512];
  for (ssize_t got; (got = read(e->said, bytes, sizeof bytes)) > 0;)
    for (ssize_t k = 0; k < got; ++k) {
      if (bytes[k] != '\n') {
        if (e->line_length + 1 < sizeof e->line) e->line[e->line_length++] = bytes[k];
        continue;
      }
      int percent, used = 0;
      e->line[e->line_length] = 0;
      e->line_length = 0;
      if (sscanf(e->line, "%d %%%n", &percent, &used) == 1 && used > 0)
        e->percent = percent;
      else
        snprintf(e->message, sizeof e->message, "%s", e->line);
    }
}

void exam_export_turn(exam_app *app) {
  exam_export *e = app->export;
  if (!e || !e->child) return;
  const int before = e->percent;
  int ended = 0;
  hear(e);
  const bool over = waitpid(e->child, &ended, WNOHANG) == e->child;
  if (over) {
    char path[EXAM_PATH];
    hear(e); // what it said last
    close(e->said);
    e->child = 0;
    e->ready = WIFEXITED(ended) && WEXITSTATUS(ended) == 0 && !e->cancelled;
    if (e->ready) e->percent = 100, e->message[0] = 0;
    if (!e->ready) {
      (void)unlink(export_path(app, path));
      (void)sonde_file_remove_abandoned(path);
    }
    if (e->cancelled)
      snprintf(e->message, sizeof e->message, "The export was cancelled.");
    else if (!e->ready && !e->message[0])
      snprintf(e->message, sizeof e->message, "The export ended before it was done.");
  }
  if (over || e->percent != before) tell(app);
}

// At once: what it had begun is removed when it is gone.
static void cancel(exam_export *e) {
  if (!e->child) return;
  e->cancelled = true;
  kill(e->child, SIGKILL);
}

// The file of the export before goes.
static sonde_status start(exam_app *app, uint32_t part, const char *ending, sonde_error *error) {
  exam_export *e = app->export;
  char recording[EXAM_PATH], path[EXAM_PATH], program[EXAM_PATH];
  int ends[2], code = app_program(program, sizeof program);
  exam_part_path(recording, e->directory, part);
  snprintf(e->name, sizeof e->name, "%u.%s", part, ending);
  export_path(app, path);
  // This very program, and the exporter of its command line.
  const char *const words[] = {"nice",       "-n",        "3",       program,    "replay",
                               recording,    "--recover", "--cases", app->cases, "--progress",
                               "--sequence", path,        NULL};
  if (!code && pipe2(ends, O_CLOEXEC | O_NONBLOCK)) code = errno;
  if (!code) {
    fcntl(ends[1], F_SETFL, 0); // the program's end waits as usual
    const app_program_start what = {.words = words,
                                    .input = APP_NOTHING,
                                    .output = APP_NOTHING,
                                    .errors = ends[1],
                                    .own_group = true};
    code = app_start(&what, &e->child);
    close(ends[1]);
    e->said = ends[0];
    if (code) close(ends[0]);
  }
  if (code) return app_error(error, SONDE_DISK, "the export did not start: %s", strerror(code));
  return SONDE_OK;
}

sonde_status exam_export_ask(exam_app *app, const sonde_page_request *request, sonde_error *error) {
  if (!app->export) app->export = calloc(1, sizeof *app->export);
  exam_export *e = app->export;
  if (!e) return app_error(error, SONDE_MEMORY, "out of memory");
  char path[EXAM_PATH];
  if (strcmp(request->text, "cancel") == 0) {
    cancel(e);
    return SONDE_OK;
  }
  size_t k = 0;
  while (k < sizeof ENDINGS / sizeof *ENDINGS && strcmp(request->text, ENDINGS[k]) != 0) ++k;
  const bool looks = !request->text[0];
  if (!looks && k == sizeof ENDINGS / sizeof *ENDINGS)
    return app_error(error, SONDE_ARGUMENT, "an export is igs.mha, seq.nrrd or dcm");
  if (e->child && (!looks || strcmp(e->id, request->id) != 0))
    return app_error(error, SONDE_ARGUMENT, "an export is under way: wait for it or cancel it");
  if (app->phase == EXAM_RUNNING || app->phase == EXAM_PREPARING)
    return app_error(error, SONDE_ARGUMENT, "finish or leave the exam before an export");
  if (strcmp(e->id, request->id) != 0 || !looks) { // another file takes its place
    if (e->name[0]) (void)unlink(export_path(app, path));
    *e = (exam_export){.id = ""};
  }
  uint32_t parts = 0;
  if (exam_is_id(request->id)) {
    snprintf(e->id, sizeof e->id, "%s", request->id);
    exam_app_path(e->directory, app->exams, e->id);
    parts = exam_part_count(e->directory);
  }
  sonde_status status = SONDE_OK;
  if (parts == 0)
    status = app_error(error, SONDE_NOT_FOUND, "there is no such exam");
  else if (!looks && (request->turn < 1 || request->turn > parts))
    status = app_error(error, SONDE_ARGUMENT, "the exam has %u parts", parts);
  else if (!looks)
    status = start(app, request->turn, ENDINGS[k], error);
  if (status)
    *e = (exam_export){.id = ""};
  else
    tell(app);
  return status;
}

void exam_export_end(exam_app *app) {
  exam_export *e = app->export;
  char path[EXAM_PATH];
  if (!e) return;
  cancel(e);
  if (e->child) {
    (void)app_await(e->child, false);
    close(e->said);
    e->child = 0;
    (void)sonde_file_remove_abandoned(export_path(app, path));
  }
  if (e->name[0]) (void)unlink(export_path(app, path));
  app->export = NULL;
  free(e);
}
