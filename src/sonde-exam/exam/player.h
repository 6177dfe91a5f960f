// Inside of a player: a session that is fed with what was recorded.
#ifndef SONDE_SRC_PLAYER_H
#define SONDE_SRC_PLAYER_H

#include "exam/keyframes.h"

// An image of the recording.
typedef struct sonde_player_image {
  uint64_t tick;
  sonde_record_image told;
} sonde_player_image;

// A change of the controls during the exam; the first one is the start.
typedef struct sonde_player_event {
  uint64_t tick;
  double time_s;
  sonde_session_controls controls;
} sonde_player_event;

enum { SONDE_PLAYER_MARK = 256 }; // ticks between known places in the file

struct sonde_player {
  char *path;
  bool no_cache;
  sonde_recording recording;
  sonde_recording_info info;
  sonde_session *session;
  sonde_player_event *events; // [event_count]
  sonde_player_image *images; // [image_count]
  sonde_record_check *checks; // [check_count]
  size_t *marks;              // [mark_count] places of the first record of every 256th tick
  uint32_t event_count, image_count, check_count, mark_count;

  sonde_keyframes keyframes;
  uint32_t from_file; // keyframes that were there
  sonde_tick_memory start_inputs;
  sonde_image_memory start_inside, inside;
  void *world;       // [sonde_subject_size()]
  void *start_world; // [start_bytes]
  size_t start_bytes;
  uint64_t covered; // keyframes are complete up to this tick

  uint32_t next_event, next_image; // the first that has not happened
  bool followed, drawn;            // the image before next_image is that of the session
  sonde_frame frame;
};

// Lists of events, images, hashes and places.
sonde_status sonde_player_index(sonde_player *player, sonde_error *error);
uint64_t sonde_player_tick(const sonde_player *player);
uint64_t sonde_player_hash(sonde_player *player); // sonde_state_hash()
// Stands at a tick with a keyframe, or at the start.
void sonde_player_restart(sonde_player *player);
bool sonde_player_jump(sonde_player *player, const sonde_packed_keyframe *key);

#endif
