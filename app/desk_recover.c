// Exams that the log lacks: their program was killed or the disk was full. Everything is derived
// from their journals, exams/ID/exam.rec.
//
// copy_member, entry_of_setup, read_old_start   what an exam is about
// copy, take_old_part  the recording of a program that kept it under another name until its end
// never_began, read_entry, sweep, find   one directory
// desk_recover         all of them
// fill, apply, take_comments, play    a journal to a judge
// desk_derive          its files
#include "desk_parts.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool exists(const char *directory, const char *name) {
  char path[DESK_PATH];
  return access(desk_path(path, directory, name), F_OK) == 0;
}

static void copy_member(const cJSON *root, const char *key, char *to, size_t size) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(root, key);
  snprintf(to, size, "%s", cJSON_IsString(item) ? item->valuestring : "");
}

static bool entry_of_setup(const cJSON *root, sonde_log_entry *entry) {
  *entry = (sonde_log_entry){.interrupted = true};
  copy_member(root, "exam", entry->id, sizeof entry->id);
  copy_member(root, "trainee", entry->trainee, sizeof entry->trainee);
  copy_member(root, "case", entry->case_id, sizeof entry->case_id);
  copy_member(root, "title", entry->case_title, sizeof entry->case_title);
  copy_member(root, "protocol", entry->protocol, sizeof entry->protocol);
  copy_member(root, "guidance", entry->guidance, sizeof entry->guidance);
  copy_member(root, "date", entry->date, sizeof entry->date);
  if (!entry->trainee[0]) snprintf(entry->trainee, sizeof entry->trainee, "Guest");
  return entry->id[0] && entry->case_id[0];
}

bool desk_read_setup(const char *recording, cJSON **root) {
  sonde_notes notes;
  *root = NULL;
  if (sonde_notes_load(recording, &notes, NULL)) return false;
  const sonde_note *setup = sonde_notes_last(&notes, SONDE_NOTE_SETUP);
  if (setup) *root = cJSON_Parse(setup->text);
  sonde_notes_clear(&notes);
  return *root != NULL;
}

// ---- exams from before the journal --------------------------------------------------------------

static bool read_old_start(const char *directory, sonde_log_entry *entry) {
  char path[DESK_PATH], *text = NULL;
  size_t size = 0;
  if (sonde_file_load(desk_path(path, directory, "start.json"), &text, &size, NULL)) return false;
  cJSON *root = cJSON_ParseWithLength(text, size);
  bool whole = entry_of_setup(root, entry);
  cJSON_Delete(root);
  sonde_free(text);
  return whole;
}

static void copy(const char *from, const char *to) {
  char *bytes = NULL;
  size_t count = 0;
  sonde_file *file = NULL;
  if (sonde_file_load(from, &bytes, &count, NULL)) return;
  if (!sonde_file_create(to, &file, NULL)) {
    sonde_file_write(file, bytes, count);
    (void)sonde_file_commit(file, NULL);
  }
  sonde_free(bytes);
}

// The recording then grew under another name, which a kill left, until its program ended.
static void take_old_part(const char *directory) {
  DIR *list = opendir(directory);
  for (const struct dirent *entry; list && (entry = readdir(list));) {
    char from[DESK_PATH], to[DESK_PATH];
    if (strncmp(entry->d_name, "exam.rec.part-", 14) != 0 || exists(directory, "exam.rec"))
      continue;
    desk_path(from, directory, entry->d_name);
    copy(from, desk_path(to, directory, "exam.rec"));
  }
  if (list) closedir(list);
}

// ---- the log ------------------------------------------------------------------------------------

// The journal of an exam that began has a whole block from its start on, and grows. What is short
// and has none is what a full disk or a kill left of an exam that did not begin.
static bool never_began(const char *path, sonde_status status) {
  enum { SHORT = 65536 };
  struct stat facts;
  return status == SONDE_FORMAT && stat(path, &facts) == 0 && facts.st_size < SHORT;
}

static void complain(desk_recovered *found, const char *id, const char *why) {
  found->unreadable++;
  snprintf(found->worst, sizeof found->worst, "%.60s: %.170s", id, why);
}

// What the log should say about one exam.
static bool read_entry(const char *directory, const char *id, sonde_log_entry *entry,
                       desk_recovered *found) {
  char path[DESK_PATH];
  sonde_notes notes = {0};
  sonde_error error = {0};
  if (exists(directory, "start.json")) take_old_part(directory);
  bool recorded = exists(directory, "exam.rec");
  sonde_status status = SONDE_OK;
  if (recorded) status = sonde_notes_load(desk_path(path, directory, "exam.rec"), &notes, &error);
  if (!exists(directory, "start.json") && never_began(path, status)) {
    found->never_began++;
    return false;
  }
  const sonde_note *setup = sonde_notes_last(&notes, SONDE_NOTE_SETUP);
  const sonde_note *score = sonde_notes_last(&notes, SONDE_NOTE_SCORE);
  cJSON *root = setup ? cJSON_Parse(setup->text) : NULL;
  bool known = root ? entry_of_setup(root, entry) : read_old_start(directory, entry);
  sonde_log_entry judged;
  if (score && !sonde_log_entry_parse(score->text, &judged, &error)) *entry = judged, known = true;
  if (!known) complain(found, id, status ? error.message : "says nothing about the exam");
  if (recorded) snprintf(entry->recording, sizeof entry->recording, "%.200s/exam.rec", id);
  found->finished += known && !entry->interrupted;
  found->interrupted += known && entry->interrupted;
  cJSON_Delete(root);
  sonde_notes_clear(&notes);
  return known;
}

// Keyframes, result, table and report are made again; nothing is left of what a killed program had
// begun.
static void sweep(const char *directory) {
  static const char *const NAMES[] = {"exam.rec.keys", "exam.json", "exam.csv", "report.html"};
  char path[DESK_PATH];
  for (size_t k = 0; k < sizeof NAMES / sizeof NAMES[0]; ++k)
    (void)sonde_file_remove_abandoned(desk_path(path, directory, NAMES[k]));
}

static void find(const char *exams, const char *id, sonde_exam_log *log, desk_recovered *found) {
  char directory[DESK_PATH], path[DESK_PATH];
  sonde_log_entry entry = {0};
  sonde_error error = {0};
  bool there = false;
  desk_path(directory, exams, id);
  if (!exists(directory, "exam.rec") && !exists(directory, "start.json")) return;
  found->exams++;
  if (sonde_recording_is_open(desk_path(path, directory, "exam.rec"))) {
    found->running++;
    return;
  }
  sweep(directory);
  if (sonde_exam_log_has(log, id, &there, &error) || there) return;
  if (!read_entry(directory, id, &entry, found)) return;
  if (sonde_exam_log_add(log, &entry, &error))
    complain(found, id, error.message);
  else
    found->added++;
}

void desk_recover(const char *exams, sonde_exam_log *log, desk_recovered *found) {
  *found = (desk_recovered){0};
  DIR *list = opendir(exams);
  for (const struct dirent *entry; list && (entry = readdir(list));)
    if (entry->d_name[0] != '.') find(exams, entry->d_name, log, found);
  if (list) closedir(list);
}

// ---- result and report --------------------------------------------------------------------------

static sonde_status fill(desk_exam *exam, const cJSON *setup, const desk_library *library,
                         sonde_exam_protocol *protocol, sonde_error *error) {
  char name[48];
  sonde_exam_protocol *all = NULL;
  uint32_t count = 0, k = 0;
  copy_member(setup, "exam", exam->id, sizeof exam->id);
  copy_member(setup, "trainee", exam->trainee, sizeof exam->trainee);
  copy_member(setup, "guidance", exam->guidance, sizeof exam->guidance);
  copy_member(setup, "date", exam->date, sizeof exam->date);
  copy_member(setup, "protocol", name, sizeof name);
  const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(setup, "patient"));
  if (!text) return app_error(error, SONDE_FORMAT, "%s: names no patient", exam->directory);
  sonde_status status = sonde_case_parse(text, exam->directory, &exam->patient, error);
  if (!status) status = sonde_exam_protocol_list(library->protocols, &all, &count, error);
  while (k < count && strcmp(all[k].id, name) != 0) ++k;
  if (!status && k == count)
    status = app_error(error, SONDE_NOT_FOUND, "%.300s: there is no protocol '%s' any more",
                       exam->directory, name);
  if (!status) *protocol = all[k];
  sonde_free(all);
  exam->protocol = protocol;
  return status ? status : desk_exam_prepare(exam, library->bundled, library->cases, NULL, error);
}

static void apply(desk_exam *exam, const sonde_note *note) {
  if (note->kind == SONDE_NOTE_HINT) sonde_judge_hint(exam->judge);
  if (note->kind != SONDE_NOTE_DECISION) return;
  char segment[32], word[32];
  sonde_decision decision;
  cJSON *root = cJSON_Parse(note->text);
  copy_member(root, "segment", segment, sizeof segment);
  copy_member(root, "decision", word, sizeof word);
  cJSON_Delete(root);
  if (sonde_decision_parse(word, &decision))
    (void)sonde_judge_decide(exam->judge, sonde_vein_segment(&exam->setup.map, segment), decision,
                             NULL);
}

static sonde_status take_comments(desk_exam *exam, const char *recording, sonde_error *error) {
  sonde_comments found;
  sonde_status status = sonde_comments_load(recording, &found, error);
  if (status) return status;
  size_t bytes = found.count * sizeof *found.list;
  if (found.count && !(exam->comments.list = malloc(bytes)))
    status = app_error(error, SONDE_MEMORY, "out of memory");
  if (!status && found.count) {
    memcpy(exam->comments.list, found.list, bytes);
    exam->comments.count = found.count;
  }
  sonde_comments_clear(&found);
  return status;
}

// Image by image as the exam was judged, each note after the last image before it.
static sonde_status play(desk_exam *exam, const char *path, const sonde_notes *notes,
                         sonde_error *error) {
  sonde_player *player = NULL;
  sonde_player_def def = {.path = path,
                          .model = exam->setup.model,
                          .findings = &exam->setup.findings,
                          .recover = true,
                          .no_cache = true};
  sonde_progress progress = app_progress();
  sonde_status status = sonde_player_open(&def, &player, error);
  uint32_t next = 0;
  sonde_frame frame;
  bool cancelled = false;
  while (!status && !cancelled && sonde_player_next_image(player, true)) {
    if (!sonde_player_frame(player, &frame)) continue;
    while (next < notes->count && notes->list[next].tick < frame.snapshot.tick)
      apply(exam, &notes->list[next++]);
    desk_exam_observe(exam, &frame);
    double length_s = sonde_player_info(player)->duration_s;
    cancelled =
        !progress.report(sonde_player_time(player) / fmax(length_s, 1e-3), exam->id, progress.user);
  }
  while (next < notes->count) apply(exam, &notes->list[next++]);
  app_progress_end();
  sonde_player_close(player);
  return cancelled ? app_error(error, SONDE_CANCELLED, "cancelled in exam %s", exam->id) : status;
}

// The judge of another version may see it differently: the score that the learner was told stands.
static sonde_status compare(const desk_exam *exam, const sonde_note *note, sonde_error *error) {
  sonde_log_entry told;
  sonde_status status = sonde_log_entry_parse(note->text, &told, error);
  if (status || fabs(told.score - exam->score.score) < 1e-6) return status;
  return app_error(error, SONDE_MISMATCH,
                   "%.300s: the score was %.1f, this version of the program comes to %.1f; its "
                   "files are not made",
                   exam->directory, told.score, exam->score.score);
}

static sonde_status derive(desk_exam *exam, const desk_library *library, sonde_exam_log *log,
                           bool *derived, sonde_error *error) {
  char path[DESK_PATH];
  sonde_notes notes;
  sonde_exam_protocol protocol;
  sonde_status status =
      sonde_notes_load(desk_path(path, exam->directory, "exam.rec"), &notes, error);
  if (status) return never_began(path, status) ? SONDE_OK : status;
  const sonde_note *setup = sonde_notes_last(&notes, SONDE_NOTE_SETUP);
  const sonde_note *score = sonde_notes_last(&notes, SONDE_NOTE_SCORE);
  cJSON *root = setup && score ? cJSON_Parse(setup->text) : NULL;
  if (root) { // an interrupted exam has no result
    status = fill(exam, root, library, &protocol, error);
    if (!status) status = take_comments(exam, path, error);
    if (!status) status = play(exam, path, &notes, error);
    if (!status) {
      sonde_judge_finish(exam->judge);
      sonde_judge_score(exam->judge, &exam->patient, &exam->score);
      status = compare(exam, score, error);
    }
    if (!status) status = desk_exam_save(log, exam, error);
    *derived = !status;
  }
  cJSON_Delete(root);
  sonde_notes_clear(&notes);
  return status;
}

sonde_status desk_derive(const desk_library *library, const char *exams, const char *id,
                         sonde_exam_log *log, bool *derived, sonde_error *error) {
  desk_exam *exam = calloc(1, sizeof *exam);
  *derived = false;
  if (!exam) return app_error(error, SONDE_MEMORY, "out of memory");
  desk_path(exam->directory, exams, id);
  char path[DESK_PATH];
  bool whole = exists(exam->directory, "exam.json") && exists(exam->directory, "exam.csv") &&
               exists(exam->directory, "report.html");
  sonde_status status = SONDE_OK;
  desk_path(path, exam->directory, "exam.rec");
  if (!whole && exists(exam->directory, "exam.rec") && !sonde_recording_is_open(path))
    status = derive(exam, library, log, derived, error);
  desk_exam_destroy(exam);
  return status;
}
