// Inside of the desk. Everything belongs to the owner's thread, except what `lock` guards: the
// page's threads leave requests and watch frames.
#ifndef SONDE_APP_DESK_PARTS_H
#define SONDE_APP_DESK_PARTS_H

#include "desk.h"

#include <cjson/cJSON.h>
#include <pthread.h>

enum {
  DESK_PATH = 4096,
  DESK_ALIAS = 24,
  DESK_REQUESTS = 64,
  DESK_PICTURES = 64,
  DESK_SAMPLES = 36000,
  DESK_SENTENCE = 240
};

typedef enum desk_phase {
  DESK_PRACTICE,
  DESK_PREPARING,
  DESK_RUNNING,
  DESK_DONE,
  DESK_REPLAY
} desk_phase;

// Picture at half the image's size; the vein's ratio in it.
typedef struct desk_picture {
  sonde_image image;
  double vein_ratio;
} desk_picture;

// An exam, running or done.
typedef struct desk_exam {
  sonde_comments comments; // made while it ran; the list is realloc()'s
  char id[64], directory[DESK_PATH], trainee[164];
  sonde_case patient;
  const sonde_exam_protocol *protocol;
  char guidance[16];
  sonde_case_setup setup;
  sonde_plan plan;
  sonde_judge *judge; // under the lock
  double started_s;
  bool scored;
  sonde_score score;
  char date[32];
  bool noted, in_journal, filed, logged; // the score is a note; on the disk: inputs; files; row
  bool gap_told;                         // that inputs are missing
  double again_s;                        // clock of the next attempt
  pthread_mutex_t *lock;                 // the desk's
  // under the lock
  uint64_t seen_tick; // of the last image that the judge saw
  uint32_t picture_count, presses_seen;
  sonde_exam_picture picture[DESK_PICTURES]; // owned here
  desk_picture open, closed;                 // of the press under way
  sonde_exam_sample *sample;                 // [DESK_SAMPLES] ten a second
  uint32_t sample_count;
} desk_exam;

// Where cases and thighs are.
typedef struct desk_library {
  const char *bundled, *cases, *protocols;
} desk_library;

typedef struct desk_recovered {
  uint32_t exams, finished, interrupted, running; // journals in the directory
  uint32_t added, unreadable;
  uint32_t never_began;      // the disk did not take the setup, and the learner was told so
  char worst[DESK_SENTENCE]; // why the last unreadable one is
} desk_recovered;

typedef struct desk_replay {
  char id[64], title[96], recording[DESK_PATH];
  sonde_case_setup setup;
  sonde_player *player;
  sonde_comments comments;
  cJSON *presses; // of the exam's data
  bool playing;
  double speed, time_s, at_s; // time_s of the exam at the clock's at_s
  uint64_t shown_tick;
} desk_replay;

struct desk {
  desk_def def;
  char cases[DESK_PATH], protocols[DESK_PATH], exams[DESK_PATH], trainee[164];
  sonde_case *case_list;
  uint32_t case_count;
  sonde_exam_protocol *protocol_list;
  uint32_t protocol_count;
  sonde_probe *probes; // [probe_count] that a replay shows
  uint32_t probe_count;
  sonde_exam_log *log;
  sonde_page_server *server;
  sonde_session *session; // practice or exam; NULL in a replay
  desk_phase phase;       // under the lock when changed
  char message[DESK_SENTENCE];
  desk_exam *exam;     // NULL: none
  desk_replay *replay; // NULL: none
  double published_s;
  bool disk_told; // that the disk does not take the recording
  double disk_told_s;
  double progress; // of preparing an exam, 0 to 1

  pthread_mutex_t lock;
  sonde_page_request request[DESK_REQUESTS]; // ring
  uint32_t request_first, request_count;
};

// desk_text.c: what the page is told.
void desk_tell_greeting(desk *d);
void desk_tell_exam(desk *d);
void desk_tell_exams(desk *d);
void desk_tell_replay(desk *d);

// desk_exam.c
// Thigh, plan and judge of a case that the exam has.
sonde_status desk_exam_prepare(desk_exam *exam, const char *bundled, const char *cases,
                               const sonde_progress *progress, sonde_error *error);
sonde_status desk_exam_start(desk *d, const sonde_page_request *request, sonde_error *error);
void desk_exam_observe(desk_exam *exam, const sonde_frame *frame); // under the lock
sonde_status desk_exam_finish(desk *d, sonde_error *error);
// The session must be gone.
void desk_exam_destroy(desk_exam *exam);

// desk_keep.c: data, report and log of an exam that is over, derived from what the judge saw.
// The text of the journal's note that says what the exam is about; freed by free().
sonde_status desk_exam_setup_text(const desk_exam *exam, char **text, sonde_error *error);
// Writes what is missing of the files and the log's row.
sonde_status desk_exam_save(sonde_exam_log *log, desk_exam *exam, sonde_error *error);
// Brings an exam that is over to the disk, as far as the disk takes it; later turns try again.
void desk_keep(desk *d);
// Says when the disk does not take the recording, and when it does again.
void desk_watch_disk(desk *d);

// desk_recover.c: exams that the log lacks.
// Adds them to the log: with their score, or as interrupted.
void desk_recover(const char *exams, sonde_exam_log *log, desk_recovered *found);
// Plays the journal of a finished exam to a judge and writes the files that are missing.
sonde_status desk_derive(const desk_library *library, const char *exams, const char *id,
                         sonde_exam_log *log, bool *derived, sonde_error *error);
// What a journal's setup says; the strings are owned by `root`, which cJSON_Delete() frees.
bool desk_read_setup(const char *recording, cJSON **root);

// desk_replay.c
sonde_status desk_replay_open(desk *d, const char *id, sonde_error *error);
void desk_replay_turn(desk *d);
sonde_status desk_replay_seek(desk *d, double time_s, sonde_error *error);
// To the replay that is shown, or to the exam that runs, at its present time.
sonde_status desk_comment(desk *d, const sonde_page_request *request, sonde_error *error);
void desk_replay_destroy(desk_replay *replay);

// desk.c
// directory/name; a path that does not fit is empty, so that nothing is found there.
const char *desk_path(char path[DESK_PATH], const char *directory, const char *name);
// A session on the thigh of `def`, started and shown; what ran before is ended.
sonde_status desk_run_session(desk *d, sonde_session_def *def, const sonde_site *start,
                              sonde_error *error);
sonde_status desk_practice(desk *d, sonde_error *error);
void desk_end_session(desk *d);
// Puts these in the place of the exam and the replay before (NULL: none), whose thighs are not
// shown any more.
void desk_change(desk *d, desk_exam *exam, desk_replay *replay);
void desk_set_phase(desk *d, desk_phase phase, const char *message);
// What the page is told instead of a case's id, which may tell the truth about it: "patient-3";
// empty for a case that is not in the library.
void desk_case_alias(const desk *d, const char *id, char alias[DESK_ALIAS]);
// NULL when there is none.
const sonde_case *desk_find_case(const desk *d, const char *alias);
const sonde_exam_protocol *desk_find_protocol(const desk *d, const char *id);

#endif
