// Inside of the exam application. Everything belongs to the owner's thread, except what `lock`
// guards: the page's threads leave requests and watch frames.
#ifndef SONDE_APP_EXAM_APP_PARTS_H
#define SONDE_APP_EXAM_APP_PARTS_H

#include "exam_app.h"

#include <pthread.h>

typedef struct exam_film exam_film;     // exam_app_lesson.h
typedef struct exam_export exam_export; // exam_app_export.h
typedef struct exam_draft exam_draft;   // exam_app_draft.h

enum {
  EXAM_PATH = 4096,
  EXAM_ALIAS = 24,
  EXAM_REQUESTS = 64,
  EXAM_PICTURES = 64,
  EXAM_SAMPLES = 36000,
  EXAM_SENTENCE = 240,
  EXAM_PARTS = 32, // of a recording, one for each time that the patient lies otherwise
  EXAM_LOOKS = 64  // newest images, one of which the learner may store
};

typedef enum exam_phase {
  EXAM_PRACTICE,
  EXAM_PREPARING,
  EXAM_RUNNING,
  EXAM_DONE,
  EXAM_REPLAY,
  EXAM_FILM,
  EXAM_EDIT
} exam_phase;

// Picture at half the image's size; the vein's ratio in it.
typedef struct exam_picture {
  sonde_image image;
  double vein_ratio;
} exam_picture;

// An image that was seen, at half its size, and its moment.
typedef struct exam_look {
  bool there;
  sonde_image image;
  sonde_snapshot snapshot;
  uint32_t part, held;
  double time_s; // of the exam
} exam_look;

// An exam, running or done.
typedef struct exam {
  sonde_comments comments; // made while it ran; the list is realloc()'s
  char id[64], directory[EXAM_PATH], trainee[164];
  sonde_case patient;
  const sonde_exam_protocol *protocol;
  const sonde_lesson *lesson; // that it practises; NULL: none
  uint32_t turn;              // repetition in the lesson, from 0
  char guidance[16];
  sonde_exam_setups setups;
  uint32_t part; // of the recording, from 1
  sonde_plan plan;
  sonde_judge *judge; // under the lock
  bool scored;
  sonde_score score;
  char date[32], tissue[8];              // tissue: solid or springs
  bool noted, in_journal, filed, logged; // the score is a note; on the disk: inputs; files; row
  bool gap_told;                         // that inputs are missing
  double retry_s;                        // clock of the next attempt to write
  void (*also)(void *user, const sonde_frame *frame); // gets every image too; NULL: nobody
  void *also_user;
  pthread_mutex_t *lock; // the application's
  // under the lock
  uint32_t held, turns_to; // setup in whose position the patient is; is from the next image on
  bool turns;
  uint64_t seen_tick;  // of the last image that the judge saw, in this part
  sonde_snapshot seen; // of that image
  uint32_t picture_count, presses_seen;
  sonde_exam_picture picture[EXAM_PICTURES]; // owned here
  exam_picture open, closed;                 // of the press under way
  sonde_exam_sample *sample;                 // [EXAM_SAMPLES] ten a second
  uint32_t sample_count;
  sonde_worksheet sheet;
  sonde_sheet_verdict verdict; // when it is scored
  uint32_t watched_part;       // of the recording, that the looks are of
  uint32_t next_look;
  exam_look look[EXAM_LOOKS], kept_look; // ring; the one that the learner has frozen
} exam;

// Where cases and thighs are.
typedef struct exam_places {
  const char *bundled, *cases, *protocols, *course; // course NULL: none
} exam_places;

typedef struct exam_recovered {
  uint32_t exams, finished, interrupted, running; // journals in the directory
  uint32_t added, unreadable;
  uint32_t never_began;      // the disk did not take the setup, and the learner was told so
  char worst[EXAM_SENTENCE]; // why the last unreadable one is
} exam_recovered;

// A part of a kept exam: which setup it is of, and its time in the exam.
typedef struct exam_replay_part {
  uint32_t held;
  double start_s, length_s;
} exam_replay_part;

typedef struct exam_replay {
  char id[64], title[96], directory[EXAM_PATH];
  sonde_exam_setups setups;
  uint32_t part_count, part; // the one that plays, from 0
  exam_replay_part parts[EXAM_PARTS];
  sonde_player *player; // of that part
  sonde_comments comments;
  sonde_json *result; // the exam's data; NULL: none
  bool playing;
  double speed, time_s, at_s; // time_s of the exam at the clock's at_s
  uint64_t shown_tick;
} exam_replay;

struct exam_app {
  exam_app_def def;
  char cases[EXAM_PATH], own_cases[EXAM_PATH], protocols[EXAM_PATH], exams[EXAM_PATH], trainee[164];
  sonde_case *case_list; // [case_count] those that ship, then the user's own
  uint32_t case_count, shipped_count;
  sonde_exam_protocol *protocol_list;
  uint32_t protocol_count;
  sonde_probe *probes; // [probe_count] that a replay shows
  uint32_t probe_count;
  sonde_exam_log *log;
  sonde_page_server *server;
  sonde_session *session; // practice or exam; NULL in a replay
  exam_phase phase;       // under the lock when changed
  char message[EXAM_SENTENCE];
  exam *exam;              // NULL: none
  exam_replay *replay;     // NULL: none
  exam_film *film;         // NULL: none
  exam_export *export;     // NULL: none
  exam_draft *draft;       // NULL: none
  const sonde_case *trial; // that the next exam is about, whatever the page says; NULL: none
  sonde_course course;
  double published_s;
  bool disk_told; // that the disk does not take the recording
  double disk_told_s;
  double progress; // of preparing an exam, 0 to 1

  pthread_mutex_t lock;
  sonde_page_request request[EXAM_REQUESTS]; // ring
  uint32_t request_first, request_count;
};

// exam_app.c: sessions, phases and requests.
// directory/name; a path that does not fit is empty, so that nothing is found there.
const char *exam_app_path(char path[EXAM_PATH], const char *directory, const char *name);
// The thigh of cases that use the bundled one.
const char *exam_app_bundled(const exam_app *app);
// A session on the thigh of `def`, started and shown; what ran before is ended.
sonde_status exam_app_run_session(exam_app *app, sonde_session_def *def, const sonde_site *start,
                                  sonde_error *error);
sonde_status exam_app_practice(exam_app *app, sonde_error *error);
void exam_app_end_session(exam_app *app);
// Puts these in the place of the exam, the replay and the demonstration before (NULL: none), whose
// thighs are not shown any more.
void exam_app_change(exam_app *app, exam *next, exam_replay *replay);
void exam_app_set_phase(exam_app *app, exam_phase phase, const char *message);
// What the page is told instead of a case's id, which may tell the truth about it: "patient-3";
// empty for a case that is not in the library.
void exam_app_case_alias(const exam_app *app, const char *id, char alias[EXAM_ALIAS]);

// exam_app_messages.c: what the page is told.
void exam_app_tell_greeting(exam_app *app);
void exam_app_tell_exam(exam_app *app);
void exam_app_tell_exams(exam_app *app);
void exam_app_tell_replay(exam_app *app);

// exam_app_parts.c: parts of an exam's recording, counted from 1.
const char *exam_part_path(char path[EXAM_PATH], const char *directory, uint32_t part);
uint32_t exam_part_count(const char *directory);
// What the setup of a part says; false: nothing.
bool exam_part_position(const char *directory, uint32_t part, sonde_limb_position *position);
// The comments of all parts, as sonde_comments_load().
sonde_status exam_part_comments(const char *directory, sonde_comments *comments,
                                sonde_error *error);

// exam_app_exam.c: an exam from its start to its score.
// Thigh, plan and judge of a case that the exam has.
sonde_status exam_prepare(exam *of, const char *bundled, const char *cases,
                          const sonde_progress *progress, sonde_error *error);
sonde_status exam_start(exam_app *app, const sonde_page_request *request, sonde_error *error);
// The patient takes another position of the protocol; presses and findings stay.
sonde_status exam_turn(exam_app *app, const char *position, sonde_error *error);
void exam_observe(exam *of, const sonde_frame *frame); // under the lock, as the next one
// What is observed from now on is of another setup's position.
void exam_hold(exam *of, uint32_t held);
sonde_status exam_finish(exam_app *app, sonde_error *error);
// Judge and worksheet come to their result.
void exam_score(exam *of);
// The session must be gone.
void exam_destroy(exam *of);

// exam_app_sheet.c: the worksheet.
// Means of 2 x 2 pixels. @param image of half the frame's width and height
void exam_shrink(const sonde_frame *frame, sonde_image *image);
// Remembers an image that the learner may store; under the lock.
void exam_sheet_watch(exam *of, const sonde_frame *frame);
// Another part of the recording begins: what was seen is out of reach.
void exam_sheet_turn(exam *of);
// Takes an entry, from the page or from the journal; under the lock.
sonde_status exam_sheet_enter(exam *of, const char *entry, sonde_error *error);
// The page's entry: taken, noted in the journal, its picture on the disk.
sonde_status exam_app_write_sheet(exam_app *app, const char *entry, sonde_error *error);
void exam_app_tell_sheet(exam_app *app);
// Its files, in the exam's directory. @param map of the first setup
sonde_status exam_sheet_save(const exam *of, sonde_error *error);
void exam_sheet_clear(exam *of);

// exam_app_files.c: the journal's notes, and what is derived of an exam that is over.
// A JSON object of texts {key, value}. @param text freed by sonde_free()
sonde_status exam_note_text(const char *const (*texts)[2], size_t count, char **text,
                            sonde_error *error);
// The text of the journal's note that says what the exam is about; freed by sonde_free().
sonde_status exam_setup_text(const exam *of, sonde_limb_position position, char **text,
                             sonde_error *error);
// Writes what is missing of the files and the log's row.
sonde_status exam_save(sonde_exam_log *log, exam *of, sonde_error *error);
// Brings an exam that is over to the disk, as far as the disk takes it; later turns try again.
void exam_app_keep(exam_app *app);
// Says when the disk does not take the recording, and when it does again.
void exam_app_watch_disk(exam_app *app);

// exam_app_recover.c: exams that the log lacks.
// Adds them to the log: with their score, or as interrupted.
void exam_recover_log(const char *exams, sonde_exam_log *log, exam_recovered *found);
// Plays the journal of a finished exam to a judge and writes the files that are missing.
sonde_status exam_derive(const exam_places *places, const char *exams, const char *id,
                         sonde_exam_log *log, bool *derived, sonde_error *error);
// What a journal's setup says; NULL: nothing. Freed by sonde_json_free().
sonde_json *exam_read_setup(const char *recording);

// exam_app_replay.c: any moment of a kept exam, played, with comments.
sonde_status exam_replay_open(exam_app *app, const char *id, sonde_error *error);
void exam_replay_turn(exam_app *app);
// Of the exam: its length, and where the replay is, s.
double exam_replay_length(const exam_replay *replay);
double exam_replay_time(const exam_replay *replay);
sonde_status exam_replay_seek(exam_app *app, double time_s, sonde_error *error);
// To the replay that is shown, or to the exam that runs, at its present time.
sonde_status exam_app_comment(exam_app *app, const sonde_page_request *request, sonde_error *error);
void exam_replay_destroy(exam_replay *replay);

#endif
