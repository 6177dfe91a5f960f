// What stays of an exam: data, report, a row of the log; also when the program was killed.
//
// write_report, write_log   of an exam that was judged
// desk_hold                 a locked file: other programs may keep exams in the same directory
// find_part, read_start     what a killed program left
// recover_one               its recording and its row
#include "desk_parts.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *name_of(const desk_exam *exam) {
  return exam->trainee[0] ? exam->trainee : "Guest"; // the log wants a name
}

static sonde_score_note note_of(const desk_exam *exam) {
  return (sonde_score_note){exam->id, name_of(exam), exam->protocol->id, exam->guidance,
                            exam->date};
}

// The earlier exams of the trainee are those in the log so far.
static sonde_status write_report(desk *d, desk_exam *exam, sonde_error *error) {
  sonde_log_entry *earlier = NULL;
  sonde_exam_report report = {.patient = &exam->patient,
                              .protocol = exam->protocol,
                              .map = &exam->setup.map,
                              .plan = &exam->plan,
                              .score = &exam->score,
                              .note = note_of(exam),
                              .pictures = exam->picture,
                              .picture_count = exam->picture_count,
                              .samples = exam->sample,
                              .sample_count = exam->sample_count,
                              .recording = "exam.rec"};
  report.presses = sonde_judge_compressions(exam->judge, &report.press_count);
  sonde_status status =
      sonde_exam_log_list(d->log, name_of(exam), 50, &earlier, &report.earlier_count, error);
  if (status) return status;
  report.earlier = earlier;
  uint32_t chosen[SONDE_EXAM_PICTURES];
  sonde_exam_picture pictures[SONDE_EXAM_PICTURES];
  uint32_t count =
      sonde_exam_report_choose(report.presses, report.press_count, SONDE_EXAM_PICTURES, chosen);
  uint32_t found = 0;
  for (uint32_t i = 0; i < count; ++i)
    for (uint32_t k = 0; k < exam->picture_count; ++k)
      if (exam->picture[k].press == chosen[i]) pictures[found++] = exam->picture[k];
  report.pictures = pictures;
  report.picture_count = found;
  char path[DESK_PATH];
  desk_path(path, exam->directory, "report.html");
  status = sonde_exam_report_write(&report, path, error);
  sonde_free(earlier);
  return status;
}

static sonde_status write_log(desk *d, desk_exam *exam, sonde_error *error) {
  sonde_score_note note = note_of(exam);
  sonde_log_entry entry = sonde_log_entry_make(&exam->patient, &exam->score, &note);
  snprintf(entry.recording, sizeof entry.recording, "%s/exam.rec", exam->id);
  return sonde_exam_log_add(d->log, &entry, error);
}

sonde_status desk_exam_save(desk *d, desk_exam *exam, sonde_error *error) {
  char json[DESK_PATH], csv[DESK_PATH];
  sonde_score_note note = note_of(exam);
  desk_path(json, exam->directory, "exam.json");
  desk_path(csv, exam->directory, "exam.csv");
  sonde_status status =
      sonde_score_save(exam->judge, &exam->patient, &exam->score, &note, json, csv, error);
  if (!status) status = write_report(d, exam, error);
  return status ? status : write_log(d, exam, error);
}

// ---- after a program that was killed

int desk_hold(const char *directory) {
  char path[DESK_PATH];
  desk_path(path, directory, "running");
  int file = open(path, O_CREAT | O_RDWR | O_CLOEXEC, 0600);
  if (file >= 0 && flock(file, LOCK_EX | LOCK_NB) == 0) return file;
  if (file >= 0) close(file);
  return -1;
}

static bool exists(const char *directory, const char *name) {
  char path[DESK_PATH];
  desk_path(path, directory, name);
  return access(path, F_OK) == 0;
}

// The recording grows under another name until it is whole.
static void rename_part(const char *directory) {
  DIR *list = opendir(directory);
  for (const struct dirent *entry; list && (entry = readdir(list));) {
    if (strncmp(entry->d_name, "exam.rec.part-", 14) != 0) continue;
    char from[DESK_PATH], to[DESK_PATH];
    desk_path(from, directory, entry->d_name);
    desk_path(to, directory, "exam.rec");
    rename(from, to);
  }
  if (list) closedir(list);
}

static void copy_member(const cJSON *root, const char *key, char *to, size_t size) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(root, key);
  snprintf(to, size, "%s", cJSON_IsString(item) ? item->valuestring : "");
}

static bool read_start(const char *directory, sonde_log_entry *entry) {
  char path[DESK_PATH], *text = NULL;
  size_t size = 0;
  desk_path(path, directory, "start.json");
  if (sonde_file_load(path, &text, &size, NULL)) return false;
  cJSON *root = cJSON_ParseWithLength(text, size);
  copy_member(root, "exam", entry->id, sizeof entry->id);
  copy_member(root, "trainee", entry->trainee, sizeof entry->trainee);
  copy_member(root, "case", entry->case_id, sizeof entry->case_id);
  copy_member(root, "title", entry->case_title, sizeof entry->case_title);
  copy_member(root, "protocol", entry->protocol, sizeof entry->protocol);
  copy_member(root, "guidance", entry->guidance, sizeof entry->guidance);
  copy_member(root, "date", entry->date, sizeof entry->date);
  bool whole = root && entry->id[0];
  cJSON_Delete(root);
  sonde_free(text);
  return whole;
}

static void recover_one(desk *d, const char *directory) {
  sonde_log_entry entry = {.interrupted = true};
  int held = desk_hold(directory);
  if (held < 0) return; // it runs
  rename_part(directory);
  if (read_start(directory, &entry)) {
    bool recorded = exists(directory, "exam.rec");
    if (!entry.trainee[0]) snprintf(entry.trainee, sizeof entry.trainee, "Guest");
    if (recorded) snprintf(entry.recording, sizeof entry.recording, "%.200s/exam.rec", entry.id);
    sonde_exam_log_add(d->log, &entry, NULL); // refused when it is there already
  }
  close(held);
}

void desk_recover(desk *d) {
  DIR *list = opendir(d->exams);
  for (const struct dirent *entry; list && (entry = readdir(list));) {
    char directory[DESK_PATH];
    desk_path(directory, d->exams, entry->d_name);
    if (entry->d_name[0] != '.' && exists(directory, "start.json") &&
        !exists(directory, "exam.json"))
      recover_one(d, directory);
  }
  if (list) closedir(list);
}
