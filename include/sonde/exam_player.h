/**
 * @file exam_player.h
 * Recordings played again: any moment of an exam with its image, comments of a teacher.
 */
#ifndef SONDE_EXAM_PLAYER_H
#define SONDE_EXAM_PLAYER_H

#include "sonde/exam.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a recording says of itself. */
typedef struct sonde_recording_info {
  int version; /**< of the file */
  char model_path[512], model_name[64];
  uint64_t model_checksum;
  double dt_s, duration_s; /**< one tick; of all of them */
  uint64_t ticks, images;
  uint32_t image_width, image_height;
  bool ended; /**< false: cut off; ticks and images are those of the whole blocks */
} sonde_recording_info;

/** Reads and checks a recording without a model.
 *  @param recover takes a file that was cut off up to its last whole block
 *  @thread owner */
SONDE_API sonde_status sonde_recording_inspect(const char *path, bool recover,
                                               sonde_recording_info *info, sonde_error *error);

typedef struct sonde_player sonde_player;

typedef struct sonde_player_def {
  const char *path;               /**< recording */
  const sonde_model *model;       /**< borrowed */
  const sonde_findings *findings; /**< of the session's definition; borrowed for the call */
  bool recover;                   /**< accept a file that was cut off */
  bool no_cache;                  /**< neither read nor write the keyframes beside the recording */
} sonde_player_def;

/** Stands before the first tick. Several players may play at a time, each for itself.
 *  @return SONDE_MISMATCH for another model or probe, FORMAT/CHECKSUM/VERSION for an unusable file
 *  @thread owner */
SONDE_API sonde_status sonde_player_open(const sonde_player_def *def, sonde_player **player,
                                         sonde_error *error);
/** Keeps the keyframes of a recording that was played through beside it; frees. NULL is ignored.
 *  @thread owner of the player */
SONDE_API void sonde_player_close(sonde_player *player);
/** @thread any */
SONDE_API const sonde_recording_info *sonde_player_info(const sonde_player *player);

/** Goes to the last tick at or before time_s (clamped to the exam), back or forth, from the nearest
 *  keyframe; state and image are those of playing through.
 *  @return SONDE_CANCELLED; the player then stands where it got
 *  @thread owner of the player */
SONDE_API sonde_status sonde_player_seek(sonde_player *player, double time_s,
                                         const sonde_progress *progress, sonde_error *error);
/** Plays on up to time_s without keyframes; does nothing when it is past. @thread owner of the
 *  player */
SONDE_API void sonde_player_advance(sonde_player *player, double time_s);
/** Plays on to the next image; false when there is none left. @param draw false: everything but the
 *  pixels (quicker); sonde_player_frame() draws them later @thread owner of the player */
SONDE_API bool sonde_player_next_image(sonde_player *player, bool draw);
/** The image in view: the last one at or before the player's time, as the session made it; false
 *  before the first. Valid until the player moves. @thread owner of the player */
SONDE_API bool sonde_player_frame(sonde_player *player, sonde_frame *frame);

/** Where the player stands. @thread owner of the player */
SONDE_API double sonde_player_time(const sonde_player *player);
/** @thread owner */
SONDE_API sonde_session_controls sonde_player_controls(const sonde_player *player);

/** Plays everything from the start and compares with what was recorded, also in between.
 *  @param images also makes every image and compares their hash
 *  @param[out] result a difference is SONDE_OK with result->same or same_images false
 *  @return SONDE_CANCELLED
 *  @thread owner of the player */
SONDE_API sonde_status sonde_player_check(sonde_player *player, bool images,
                                          const sonde_progress *progress,
                                          sonde_replay_result *result, sonde_error *error);

/** A remark on a moment of an exam. Plain UTF-8 text. */
typedef struct sonde_comment {
  double time_s;
  char author[64];
  char text[1024];
} sonde_comment;

enum { SONDE_MAX_COMMENTS = 1000 };

typedef struct sonde_comments {
  uint32_t count;
  sonde_comment *list; /**< [count] by time */
} sonde_comments;

/** Reads the comments of a recording, also those in RECORDING.comments.json beside one from before
 *  version 8. @thread owner
 *  @return SONDE_FORMAT naming the comment of that file that is not one */
SONDE_API sonde_status sonde_comments_load(const char *recording, sonde_comments *comments,
                                           sonde_error *error);
/** Adds a comment to a recording that nobody writes any more: on the disk when this returns OK;
 *  after a failure the recording is as it was. Bytes behind the last whole block are cut off. One
 *  from before version 8 gets RECORDING.comments.json.
 *  @return SONDE_ARGUMENT: no text, a time that is not one, text that is not UTF-8, too many;
 *    DEVICE while it is being recorded, DISK, IO
 *  @thread owner */
SONDE_API sonde_status sonde_comments_add(const char *recording, const sonde_comment *comment,
                                          sonde_error *error);
/** A comment as the text of a SONDE_NOTE_COMMENT, e.g. for sonde_session_note(); freed by
 *  sonde_free(); NULL with the error filled. @thread any */
SONDE_API char *sonde_comment_json(const sonde_comment *comment, sonde_error *error);
SONDE_API void sonde_comments_clear(sonde_comments *comments); /**< @thread owner */

#ifdef __cplusplus
}
#endif
#endif
