// Exams that the log lacks: their program was killed or the disk was full. Everything is derived
// from their journals, exams/ID/exam.rec.
#include "exam_app_parts.h"

#include <assert.h>
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool exists(const char *directory, const char *name) {
  char path[EXAM_PATH];
  return access(exam_app_path(path, directory, name), F_OK) == 0;
}

static void copy_member(const sonde_json *root, const char *key, char *to, size_t size) {
  assert(size > 1);
  const char *text = sonde_json_as_text(sonde_json_member(root, key));
  snprintf(to, size, "%s", text ? text : "");
}

static sonde_json *parse(const char *text) {
  sonde_json *root = NULL;
  (void)sonde_json_parse(text, strlen(text), NULL, &root, NULL);
  return root;
}

sonde_json *exam_read_setup(const char *recording) {
  sonde_notes notes;
  if (sonde_notes_load(recording, &notes, NULL)) return NULL;
  const sonde_note *setup = sonde_notes_last(&notes, SONDE_NOTE_SETUP);
  sonde_json *root = setup ? parse(setup->text) : NULL;
  sonde_notes_clear(&notes);
  return root;
}

// ---- the log ------------------------------------------------------------------------------------

// The journal of an exam that began has a whole block from its start on, and grows. What is short
// and has none is what a full disk or a kill left of an exam that did not begin.
static bool never_began(const char *path, sonde_status status) {
  enum { SHORT = 65536 };
  struct stat facts;
  return status == SONDE_FORMAT && stat(path, &facts) == 0 && facts.st_size < SHORT;
}

static void complain(exam_recovered *found, const char *id, const char *why) {
  assert(found && why[0]);
  found->unreadable++;
  snprintf(found->worst, sizeof found->worst, "%.60s: %.170s", id, why);
}

// Notes of the first part of an exam, which say what it is about, and of the last one, in which it
// was finished: both the same when there is one part.
typedef struct exam_ends {
  sonde_notes first, more; // more: of the last of several parts
  const sonde_notes *last;
} exam_ends;

static sonde_status load_ends(const char *directory, exam_ends *ends, sonde_error *error) {
  char path[EXAM_PATH];
  *ends = (exam_ends){.last = &ends->first};
  sonde_status status = sonde_notes_load(exam_part_path(path, directory, 1), &ends->first, error);
  const uint32_t parts = exam_part_count(directory);
  if (status || parts < 2) return status;
  ends->last = &ends->more;
  (void)sonde_notes_load(exam_part_path(path, directory, parts), &ends->more, NULL);
  return SONDE_OK;
}

static void clear_ends(exam_ends *ends) {
  sonde_notes_clear(&ends->first);
  sonde_notes_clear(&ends->more);
}

// What the log should say about one exam.
static bool read_entry(const char *directory, const char *id, sonde_log_entry *entry,
                       exam_recovered *found) {
  assert(id[0] && directory[0]);
  char path[EXAM_PATH], *text = NULL;
  size_t size = 0;
  exam_ends notes = {.last = &notes.first};
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  bool old = exists(directory, "start.json"); // from before the journal
  if (old) {
    // An exam from before the journal: its recording then grew under another name, which a kill
    // left, until its program ended.
    DIR *list = opendir(directory);
    for (const struct dirent *file_of; list && (file_of = readdir(list));) {
      char from[EXAM_PATH], to[EXAM_PATH], *bytes = NULL;
      size_t count = 0;
      sonde_file *file = NULL;
      if (strncmp(file_of->d_name, "exam.rec.part-", 14) != 0 || exists(directory, "exam.rec"))
        continue;
      if (sonde_file_load(exam_app_path(from, directory, file_of->d_name), &bytes, &count, NULL))
        continue;
      if (!sonde_file_create(exam_app_path(to, directory, "exam.rec"), &file, NULL)) {
        sonde_file_write(file, bytes, count);
        (void)sonde_file_commit(file, NULL);
      }
      sonde_free(bytes);
    }
    if (list) closedir(list);
  }
  bool recorded = exists(directory, "exam.rec");
  if (recorded) status = load_ends(directory, &notes, &error);
  if (!old && never_began(exam_part_path(path, directory, 1), status)) {
    found->never_began++;
    return false;
  }
  const sonde_note *setup = sonde_notes_last(&notes.first, SONDE_NOTE_SETUP);
  const sonde_note *score = sonde_notes_last(notes.last, SONDE_NOTE_SCORE);
  sonde_json *root = setup ? parse(setup->text) : NULL;
  if (!root && !sonde_file_load(exam_app_path(path, directory, "start.json"), &text, &size, NULL))
    root = parse(text);
  *entry = (sonde_log_entry){.interrupted = true};
  copy_member(root, "exam", entry->id, sizeof entry->id);
  copy_member(root, "trainee", entry->trainee, sizeof entry->trainee);
  copy_member(root, "case", entry->case_id, sizeof entry->case_id);
  copy_member(root, "title", entry->case_title, sizeof entry->case_title);
  copy_member(root, "protocol", entry->protocol, sizeof entry->protocol);
  copy_member(root, "guidance", entry->guidance, sizeof entry->guidance);
  copy_member(root, "date", entry->date, sizeof entry->date);
  if (!entry->trainee[0]) snprintf(entry->trainee, sizeof entry->trainee, "Guest");
  bool known = entry->id[0] && entry->case_id[0];
  sonde_log_entry judged;
  if (score && !sonde_log_entry_parse(score->text, &judged, &error)) *entry = judged, known = true;
  if (!known) complain(found, id, status ? error.message : "says nothing about the exam");
  if (recorded) snprintf(entry->recording, sizeof entry->recording, "%.200s/exam.rec", id);
  found->finished += known && !entry->interrupted;
  found->interrupted += known && entry->interrupted;
  sonde_free(text);
  sonde_json_free(root);
  clear_ends(&notes);
  return known;
}

void exam_recover_log(const char *exams, sonde_exam_log *log, exam_recovered *found) {
  // Keyframes, result, table and report are made again.
  static const char *const MADE[] = {"exam.json", "exam.csv", "report.html", "worksheet.json",
                                     "worksheet.csv"};
  *found = (exam_recovered){0};
  DIR *list = opendir(exams);
  for (const struct dirent *item; list && (item = readdir(list));) {
    const char *id = item->d_name;
    char directory[EXAM_PATH], path[EXAM_PATH];
    sonde_log_entry entry = {0};
    sonde_error error = {0};
    bool there = false;
    exam_app_path(directory, exams, id);
    if (id[0] == '.' || (!exists(directory, "exam.rec") && !exists(directory, "start.json")))
      continue;
    found->exams++;
    bool open = sonde_recording_is_open(exam_app_path(path, directory, "exam.rec"));
    for (uint32_t part = exam_part_count(directory); part > 1 && !open; --part)
      open = sonde_recording_is_open(exam_part_path(path, directory, part));
    if (open) {
      found->running++;
      continue;
    }
    // Nothing is left of what a killed program had begun.
    for (size_t k = 0; k < sizeof MADE / sizeof MADE[0]; ++k)
      (void)sonde_file_remove_abandoned(exam_app_path(path, directory, MADE[k]));
    for (uint32_t part = exam_part_count(directory); part >= 1; --part) {
      char keys[EXAM_PATH];
      snprintf(keys, sizeof keys, "%s.keys", exam_part_path(path, directory, part));
      (void)sonde_file_remove_abandoned(keys);
    }
    if (sonde_exam_log_has(log, id, &there, &error) || there) continue;
    if (!read_entry(directory, id, &entry, found)) continue;
    if (sonde_exam_log_add(log, &entry, &error))
      complain(found, id, error.message);
    else
      found->added++;
  }
  if (list) closedir(list);
}

// ---- result and report --------------------------------------------------------------------------

// The exam as its setup tells it, prepared, with the comments of its recordings.
static sonde_status fill(exam *of, const sonde_json *setup, const exam_places *places,
                         sonde_exam_protocol *protocol, sonde_error *error) {
  assert(of && places);
  char name[48];
  sonde_exam_protocol *all = NULL;
  uint32_t count = 0, k = 0;
  copy_member(setup, "exam", of->id, sizeof of->id);
  copy_member(setup, "trainee", of->trainee, sizeof of->trainee);
  copy_member(setup, "guidance", of->guidance, sizeof of->guidance);
  copy_member(setup, "date", of->date, sizeof of->date);
  copy_member(setup, "tissue", of->tissue, sizeof of->tissue);
  copy_member(setup, "protocol", name, sizeof name);
  const char *text = sonde_json_as_text(sonde_json_member(setup, "patient"));
  if (!text) return app_error(error, SONDE_FORMAT, "%s: names no patient", of->directory);
  sonde_status status = sonde_case_parse(text, of->directory, &of->patient, error);
  if (!status) status = sonde_exam_protocol_list(places->protocols, &all, &count, error);
  while (k < count && strcmp(all[k].id, name) != 0) ++k;
  // Else that of a lesson.
  sonde_course course = {0};
  if (!status && k == count && places->course)
    status = sonde_course_load(places->course, &course, error);
  const uint32_t lesson = sonde_course_find(&course, name);
  const bool taught = k == count && lesson < course.count;
  if (!status && k == count && !taught)
    status = app_error(error, SONDE_NOT_FOUND, "%.300s: there is no protocol '%s' any more",
                       of->directory, name);
  if (!status) *protocol = taught ? course.lesson[lesson].protocol : all[k];
  sonde_free(all);
  sonde_course_clear(&course);
  of->protocol = protocol;
  if (!status) status = exam_prepare(of, places->bundled, places->cases, NULL, error);

  sonde_comments found = {0};
  if (!status) status = exam_part_comments(of->directory, &found, error);
  if (!status && found.count) {
    size_t bytes = found.count * sizeof *found.list;
    of->comments.list = malloc(bytes);
    if (!of->comments.list) status = app_error(error, SONDE_MEMORY, "out of memory");
    if (!status) memcpy(of->comments.list, found.list, bytes), of->comments.count = found.count;
  }
  sonde_comments_clear(&found);
  return status;
}

static void apply_note(exam *of, const sonde_note *note) {
  if (note->kind == SONDE_NOTE_HINT) sonde_judge_hint(of->judge);
  if (note->kind == SONDE_NOTE_WORKSHEET) (void)exam_sheet_enter(of, note->text, NULL);
  if (note->kind != SONDE_NOTE_DECISION) return;
  char segment[32], word[32];
  sonde_decision decision;
  sonde_json *root = parse(note->text);
  copy_member(root, "segment", segment, sizeof segment);
  copy_member(root, "decision", word, sizeof word);
  sonde_json_free(root);
  if (sonde_decision_parse(word, &decision))
    (void)sonde_judge_decide(of->judge, sonde_vein_segment(&of->setups.held[0].map, segment),
                             decision, NULL);
}

// Part by part, image by image as the exam was judged, each note after the last image before it.
static sonde_status play(exam *of, uint32_t parts, sonde_error *error) {
  assert(of && parts > 0);
  char path[EXAM_PATH];
  sonde_status status = SONDE_OK;
  for (uint32_t part = 1; part <= parts && !status; ++part) {
    sonde_limb_position position;
    sonde_notes said = {0};
    sonde_player *player = NULL;
    sonde_frame frame;
    uint32_t held = 0, next = 0;
    if (exam_part_position(of->directory, part, &position)) // else from before positions
      held = sonde_exam_setups_find(&of->setups, position);
    if (held == of->setups.count)
      status = app_error(error, SONDE_MISMATCH, "%.300s: %s is no position of the protocol",
                         of->directory, sonde_position_key(position));
    if (status) break;
    if (part > 1) exam_hold(of, held);
    sonde_player_def def = {.path = exam_part_path(path, of->directory, part),
                            .model = of->setups.held[held].model,
                            .findings = &of->setups.held[held].findings,
                            .recover = true,
                            .no_cache = true};
    sonde_progress progress = app_progress();
    status = sonde_notes_load(path, &said, error);
    if (!status) status = sonde_player_open(&def, &player, error);
    while (!status && sonde_player_next_image(player, true)) {
      if (!sonde_player_frame(player, &frame)) continue;
      while (next < said.count && said.list[next].tick < frame.snapshot.tick)
        apply_note(of, &said.list[next++]);
      exam_observe(of, &frame);
      double share = sonde_player_time(player) / fmax(sonde_player_info(player)->duration_s, 1e-3);
      if (!progress.report(share, of->id, progress.user))
        status = app_error(error, SONDE_CANCELLED, "cancelled in exam %s", of->id);
    }
    while (next < said.count) apply_note(of, &said.list[next++]);
    app_progress_end();
    sonde_player_close(player);
    sonde_notes_clear(&said);
  }
  return status;
}

static sonde_status derive(exam *of, const exam_places *places, sonde_exam_log *log, bool *derived,
                           sonde_error *error) {
  assert(of && log && derived);
  char path[EXAM_PATH];
  exam_ends notes;
  sonde_exam_protocol protocol;
  sonde_log_entry told;
  sonde_status status = load_ends(of->directory, &notes, error);
  if (status)
    return never_began(exam_part_path(path, of->directory, 1), status) ? SONDE_OK : status;
  const uint32_t parts = exam_part_count(of->directory);
  const sonde_note *setup = sonde_notes_last(&notes.first, SONDE_NOTE_SETUP);
  const sonde_note *score = sonde_notes_last(notes.last, SONDE_NOTE_SCORE);
  // An interrupted exam has no result, but what was written in its worksheet stays.
  bool wanted = score != NULL;
  for (uint32_t part = 1; part <= parts && !wanted && !exists(of->directory, "worksheet.json");
       ++part) {
    sonde_notes said;
    if (sonde_notes_load(exam_part_path(path, of->directory, part), &said, NULL)) continue;
    wanted = sonde_notes_last(&said, SONDE_NOTE_WORKSHEET) != NULL;
    sonde_notes_clear(&said);
  }
  sonde_json *root = setup && wanted ? parse(setup->text) : NULL;
  if (root) {
    status = fill(of, root, places, &protocol, error);
    if (!status) status = play(of, parts, error);
    if (!status && score) {
      exam_score(of);
      status = sonde_log_entry_parse(score->text, &told, error);
    }
    // The judge of another version may see it differently: the score that the learner was told
    // stands.
    if (!status && score && fabs(told.score - of->score.score) >= 1e-6)
      status = app_error(error, SONDE_MISMATCH,
                         "%.300s: the score was %.1f, this version of the program comes to %.1f; "
                         "its files are not made",
                         of->directory, told.score, of->score.score);
    if (!status) status = score ? exam_save(log, of, error) : exam_sheet_save(of, error);
    *derived = !status;
  }
  sonde_json_free(root);
  clear_ends(&notes);
  return status;
}

sonde_status exam_derive(const exam_places *places, const char *exams, const char *id,
                         sonde_exam_log *log, bool *derived, sonde_error *error) {
  exam *of = calloc(1, sizeof *of);
  *derived = false;
  if (!of) return app_error(error, SONDE_MEMORY, "out of memory");
  exam_app_path(of->directory, exams, id);
  char path[EXAM_PATH];
  bool whole = exists(of->directory, "exam.json") && exists(of->directory, "exam.csv") &&
               exists(of->directory, "report.html");
  sonde_status status = SONDE_OK;
  bool open = false;
  for (uint32_t part = exam_part_count(of->directory); part > 0 && !open; --part)
    open = sonde_recording_is_open(exam_part_path(path, of->directory, part));
  if (!whole && exists(of->directory, "exam.rec") && !open)
    status = derive(of, places, log, derived, error);
  exam_destroy(of);
  return status;
}
