// A film through ffmpeg, a program of its own that reads grey pictures from a pipe: Debian's
// libraries of it carry parts under the GPL, which a library that links them would take on.
#include "replay_export.h"
#include "start.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

struct film {
  const char *path; // the caller's
  sonde_file *file; // ffmpeg writes its temporary file
  int pipe;         // -1: ffmpeg went away
  pid_t child;
  size_t bytes; // of a picture
  uint64_t frames;
};

static sonde_status fail(sonde_error *error, sonde_status status, const char *what,
                         const char *path) {
  return app_error(error, status, "%.200s: %.200s", path, what);
}

sonde_status film_open(const char *path, uint32_t width, uint32_t height, int frames_per_s,
                       film **out, sonde_error *error) {
  assert(width % 2 == 0 && height % 2 == 0 && frames_per_s > 0);
  int ends[2];
  *out = NULL;
  film *f = calloc(1, sizeof *f);
  if (!f) return fail(error, SONDE_MEMORY, "out of memory", path);
  f->path = path;
  sonde_status status = sonde_file_create(path, &f->file, error);
  if (!status && !sonde_file_temporary(f->file))
    status =
        fail(error, SONDE_IO, "a film is written back and forth, expected a regular file", path);
  if (!status && pipe2(ends, O_CLOEXEC)) status = fail(error, SONDE_DISK, strerror(errno), path);
  if (status) {
    sonde_file_discard(f->file);
    free(f);
    return status;
  }
  signal(SIGPIPE, SIG_IGN); // an ffmpeg that gives up is told by write()
  f->bytes = (size_t)width * height;

  // ffmpeg, without a shell, in its own process group: Ctrl-C ends the pictures, and ffmpeg then
  // finishes the film.
  char size[32], rate[16];
  snprintf(size, sizeof size, "%ux%u", width, height);
  snprintf(rate, sizeof rate, "%d", frames_per_s);
  const char *const arguments[] = {
      "ffmpeg",     "-hide_banner", "-loglevel",   "error",
      "-nostdin",   "-y",           "-f",          "rawvideo",
      "-pix_fmt",   "gray",         "-video_size", size,
      "-framerate", rate,           "-i",          "pipe:0",
      "-an",        "-pix_fmt",     "yuv420p",     "-movflags",
      "+faststart", "-f",           "mp4",         sonde_file_temporary(f->file),
      NULL};
  const app_program_start what = {.words = arguments,
                                  .input = ends[0],
                                  .output = APP_STANDARD,
                                  .errors = APP_STANDARD,
                                  .own_group = true};
  const int failure = app_start(&what, &f->child);
  close(ends[0]);
  f->pipe = ends[1];
  if (!failure) {
    *out = f;
    return SONDE_OK;
  }
  close(ends[1]);
  sonde_file_discard(f->file);
  free(f);
  if (failure == ENOENT)
    return fail(error, SONDE_NOT_FOUND,
                "a film needs the program ffmpeg (Debian package ffmpeg), which is not there; "
                "--frames does without",
                path);
  return fail(error, SONDE_IO, strerror(failure), path);
}

bool film_add(film *f, const uint8_t *pixels) {
  assert(f && pixels);
  for (size_t left = f->bytes; f->pipe >= 0 && left > 0;) {
    ssize_t written = write(f->pipe, pixels + f->bytes - left, left);
    if (written > 0) left -= (size_t)written;
    if (written > 0 || (written < 0 && errno == EINTR)) continue;
    close(f->pipe);
    f->pipe = -1;
  }
  f->frames += f->pipe >= 0;
  return f->pipe >= 0;
}

sonde_status film_close(film *f, sonde_error *error) {
  if (!f) return SONDE_OK;
  bool broken = f->pipe < 0;
  if (!broken) close(f->pipe);
  const int code = app_await(f->child, false);
  sonde_status status = SONDE_OK;
  bool good = !broken && WIFEXITED(code) && WEXITSTATUS(code) == 0;
  if (!good) status = fail(error, SONDE_DISK, "ffmpeg failed; what it said stands above", f->path);
  if (good && f->frames > 0)
    status = sonde_file_commit(f->file, error);
  else
    sonde_file_discard(f->file);
  free(f);
  return status;
}
