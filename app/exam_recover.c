// sonde exam --recover: what the journals of a directory say goes into its log, and results and
// reports that are missing are made from them.
#include "exam_app_parts.h"
#include "exam_common.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct recovery {
  const char *directory;
  exam_places places;
  sonde_exam_log *log;
  exam_recovered found;
  uint32_t derived, failed;
} recovery;

static int by_name(const struct dirent **a, const struct dirent **b) {
  return strcmp((*a)->d_name, (*b)->d_name);
}

static int is_visible(const struct dirent *entry) { return entry->d_name[0] != '.'; }

int exam_recover(const exam_library *library, const char *directory, bool json) {
  char path[EXAM_PATH];
  sonde_error error = {0};
  recovery r = {.directory = directory,
                .places = {library->has_bundled ? library->bundled : NULL, library->cases,
                           library->protocols, library->course[0] ? library->course : NULL}};
  exam_app_path(path, directory, "exams.sqlite");
  if (sonde_exam_log_open(path, &r.log, &error)) return app_fail("exam", &error);
  exam_recover_log(directory, r.log, &r.found);
  if (r.found.unreadable) fprintf(stderr, "sonde exam: %s\n", r.found.worst);

  // In the order of the exams, so that each report knows the ones before.
  struct dirent **names = NULL;
  int count = scandir(r.directory, &names, is_visible, by_name);
  bool cancelled = false;
  for (int i = 0; i < count; ++i) {
    bool derived = false;
    error = (sonde_error){0};
    sonde_status status = SONDE_OK;
    if (!cancelled)
      status = exam_derive(&r.places, r.directory, names[i]->d_name, r.log, &derived, &error);
    if (status && status != SONDE_CANCELLED) {
      fprintf(stderr, "sonde exam: %s: %s\n", names[i]->d_name, error.message);
      r.failed++;
    }
    cancelled |= status == SONDE_CANCELLED;
    r.derived += derived;
    free(names[i]);
  }
  free(names);
  sonde_exam_log_close(r.log);
  const exam_recovered *f = &r.found;
  if (json) {
    app_json_begin();
    app_json_integer("exams", f->exams);
    app_json_integer("running", f->running);
    app_json_integer("added", f->added);
    app_json_integer("added_finished", f->finished);
    app_json_integer("added_interrupted", f->interrupted);
    app_json_integer("derived", r.derived);
    app_json_integer("never_began", f->never_began);
    app_json_integer("unreadable", f->unreadable + r.failed);
    app_json_end();
  } else {
    printf("%u exams in %s, %u of them running\n", f->exams, r.directory, f->running);
    printf("added to the log: %u (%u finished, %u interrupted)\n", f->added, f->finished,
           f->interrupted);
    printf("results, reports and worksheets made again: %u\n", r.derived);
    if (f->never_began)
      printf("exams that did not begin, since the disk was full or the program ended: %u\n",
             f->never_began);
  }
  if (cancelled) fprintf(stderr, "sonde exam: cancelled; what was made is kept\n");
  return !cancelled && r.found.unreadable == 0 && r.failed == 0 ? APP_OK : APP_FAILED;
}
