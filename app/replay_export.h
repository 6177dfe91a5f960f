// What `sonde replay` writes of an exam: tables, pictures, a film.
#ifndef SONDE_APP_REPLAY_EXPORT_H
#define SONDE_APP_REPLAY_EXPORT_H

#include "app.h"

typedef struct replay_export {
  const char *recording;
  const char *csv, *json, *video, *frames, *sequence; // NULL: not wanted
  double from_s, to_s;
  // filled in
  uint32_t rows, pictures, film_frames, tracked;
} replay_export;

// Plays from from_s to to_s and writes what is wanted. After a CANCELLED what was written is whole.
sonde_status replay_export_run(sonde_player *player, replay_export *what,
                               const sonde_progress *progress, sonde_error *error);

// A film of grey pictures through a separate program ffmpeg.
typedef struct film film;
// @return NOT_FOUND without ffmpeg
sonde_status film_open(const char *path, uint32_t width, uint32_t height, int frames_per_s,
                       film **out, sonde_error *error);
bool film_add(film *f, const uint8_t *pixels);
// Waits for ffmpeg and gives the film its name; without a single frame nothing is left.
sonde_status film_close(film *f, sonde_error *error);

// Draws text of digits, the letters of the captions and . - % on a grey picture.
void caption_draw(uint8_t *pixels, uint32_t width, uint32_t height, uint32_t x, uint32_t y,
                  uint32_t scale, const char *text);
// Height of a line and width of a character at scale 1.
enum { CAPTION_HEIGHT = 9, CAPTION_WIDTH = 6 };

#endif
