// Exports of an exam: a table as CSV or JSON, a PNG per image, a film.
#include "replay_export.h"
#include "exam_app_parts.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_TRACKED = 20000 }; // frames of a sequence
enum { FRAMES_PER_S = 25, CAPTION_SCALE = 2, STRIP = 2 * (CAPTION_HEIGHT * CAPTION_SCALE + 6) };

typedef struct output {
  replay_export *what;
  sonde_player *player;
  sonde_file *csv;
  sonde_json_out json; // its file NULL: not wanted
  film *film;
  sonde_sequence sequence; // count 0: not wanted
  uint8_t *picture;        // [height][width] of the film
  uint32_t width, height;
} output;

typedef struct column {
  const char *name;
  double value;
} column;

enum { COLUMNS = 24 };

static void columns(const sonde_player *player, const sonde_frame *frame, column out[COLUMNS]) {
  const sonde_snapshot *s = &frame->snapshot;
  sonde_vec3 p = s->world_from_probe.position, f = s->force_n, r = s->rendered_force_n;
  sonde_quat q = s->world_from_probe.rotation;
  sonde_session_controls c = sonde_player_controls(player);
  const column list[COLUMNS] = {{"time_s", s->time_s},
                                {"probe_x_mm", 1e3 * p.x},
                                {"probe_y_mm", 1e3 * p.y},
                                {"probe_z_mm", 1e3 * p.z},
                                {"probe_qw", q.w},
                                {"probe_qx", q.x},
                                {"probe_qy", q.y},
                                {"probe_qz", q.z},
                                {"force_x_n", f.x},
                                {"force_y_n", f.y},
                                {"force_z_n", f.z},
                                {"force_normal_n", s->force_normal_n},
                                {"rendered_x_n", r.x},
                                {"rendered_y_n", r.y},
                                {"rendered_z_n", r.z},
                                {"penetration_mm", 1e3 * s->penetration_m},
                                {"contact_area_mm2", 1e6 * s->contact_area_m2},
                                {"vein_area_ratio", s->vein_area_ratio},
                                {"artery_area_ratio", s->artery_area_ratio},
                                {"vein_ap_mm", 1e3 * s->vein_short_m},
                                {"vein_tilt_deg", s->vein_tilt_rad * 57.29577951308232},
                                {"frequency_mhz", 1e-6 * c.echo.frequency_hz},
                                {"depth_mm", 1e3 * c.echo.depth_m},
                                {"gain_db", c.echo.gain_db}};
  memcpy(out, list, sizeof list);
}

static sonde_status print_comments(output *o, sonde_error *error) {
  sonde_comments comments;
  sonde_status status = sonde_comments_load(o->what->recording, &comments, error);
  if (status) return status;
  sonde_json_end(&o->json); // of the images
  sonde_json_begin_list(&o->json, "comments");
  for (uint32_t k = 0; k < comments.count; ++k) {
    const sonde_comment *c = &comments.list[k];
    sonde_json_begin_object(&o->json, NULL);
    sonde_json_put_real(&o->json, "time_s", c->time_s, 9);
    sonde_json_put_text(&o->json, "author", c->author);
    sonde_json_put_text(&o->json, "text", c->text);
    sonde_json_end(&o->json);
  }
  sonde_json_end(&o->json);
  sonde_json_end(&o->json);
  sonde_file_printf(o->json.file, "\n");
  sonde_comments_clear(&comments);
  return SONDE_OK;
}

static void add_percent(char *text, size_t size, const char *name, double ratio) {
  assert(strlen(text) < size);
  size_t used = strlen(text);
  if (isfinite(ratio))
    snprintf(text + used, size - used, "  %s %3.0f %%", name, 100 * ratio);
  else
    snprintf(text + used, size - used, "  %s   - %%", name);
}

// The image as the film shows it.
static void draw_picture(output *o, const sonde_frame *frame) {
  assert(frame->width <= o->width && frame->height + STRIP <= o->height);
  for (uint32_t j = 0; j < frame->height; ++j)
    memcpy(o->picture + (size_t)j * o->width, frame->pixels + (size_t)j * frame->width,
           frame->width);

  // A mark for every centimetre of depth, at the right edge.
  enum { MARK = 7, EDGE = 26 };
  uint32_t left = frame->width > EDGE ? frame->width - EDGE : 0;
  for (uint32_t cm = 1; cm * 0.01 - frame->top_m < frame->height_m; ++cm) {
    uint32_t y = (uint32_t)((cm * 0.01 - frame->top_m) / frame->height_m * frame->height);
    char text[12];
    memset(o->picture + (size_t)y * o->width + left, 170, frame->width > EDGE ? MARK : 0);
    snprintf(text, sizeof text, "%u", cm);
    if (y > CAPTION_HEIGHT)
      caption_draw(o->picture, o->width, frame->height, left + MARK + 4, y - CAPTION_HEIGHT / 2 + 1,
                   1, text);
  }

  // Two lines of text below.
  size_t strip = (size_t)frame->height * o->width;
  memset(o->picture + strip, 24, (size_t)o->width * o->height - strip);
  const sonde_snapshot *s = &frame->snapshot;
  char line[2][96];
  snprintf(line[0], sizeof line[0], "%7.2f s   force %5.1f N", s->time_s, s->force_normal_n);
  snprintf(line[1], sizeof line[1], "depth %5.1f mm", 1e3 * s->penetration_m);
  add_percent(line[1], sizeof line[1], "vein", s->vein_area_ratio);
  add_percent(line[1], sizeof line[1], "artery", s->artery_area_ratio);
  uint32_t scale = o->width >= 32 * CAPTION_WIDTH * CAPTION_SCALE ? CAPTION_SCALE : 1;
  for (uint32_t k = 0; k < 2; ++k)
    caption_draw(o->picture, o->width, o->height, 8, frame->height + 5 + k * STRIP / 2, scale,
                 line[k]);
}

// All pictures of the film up to a time; the last image stands until the next one.
static bool film_until(output *o, double time_s) {
  assert(o->film && isfinite(time_s));
  while (o->what->from_s + (double)o->what->film_frames / FRAMES_PER_S < time_s) {
    if (!film_add(o->film, o->picture)) return false;
    o->what->film_frames++;
  }
  return true;
}

// A frame of the tracked sequence: pixels, transforms, time and the numbers of the table.
static sonde_status track(output *o, const sonde_frame *frame, const sonde_image *image,
                          sonde_error *error) {
  replay_export *what = o->what;
  column list[COLUMNS];
  char text[40];
  if (what->tracked >= o->sequence.count)
    return app_error(error, SONDE_ARGUMENT,
                     "more than %u images; choose a part with --from and --to", o->sequence.count);
  const uint32_t k = what->tracked++;
  sonde_status status =
      sonde_sequence_set_picture(&o->sequence, k, frame->snapshot.world_from_probe, image, error);
  snprintf(text, sizeof text, "%.6f", frame->snapshot.time_s);
  if (!status) status = sonde_sequence_set(&o->sequence, k, "Timestamp", text, error);
  columns(o->player, frame, list);
  for (int i = 0; i < COLUMNS && !status; ++i) {
    if (!isfinite(list[i].value)) continue;
    snprintf(text, sizeof text, "%.9g", list[i].value);
    status = sonde_sequence_set(&o->sequence, k, list[i].name, text, error);
  }
  return status;
}

static sonde_status write_image(output *o, const sonde_frame *frame, sonde_error *error) {
  replay_export *what = o->what;
  bool filmed = !o->film || film_until(o, frame->snapshot.time_s);
  if (o->film) draw_picture(o, frame);
  if (o->csv || o->json.file) {
    // A row per image: numbers with 9 digits, nothing (CSV) or null (JSON) where there is none.
    column list[COLUMNS];
    columns(o->player, frame, list);
    const char *fault = frame->snapshot.fault ? sonde_fault_text(frame->snapshot.fault) : "";
    sonde_session_controls c = sonde_player_controls(o->player);
    const char *const texts[] = {c.pathology.name, fault};
    for (int k = 0; o->csv && k < COLUMNS; ++k)
      sonde_file_printf(o->csv, isfinite(list[k].value) ? "%.9g," : ",", list[k].value);
    for (int k = 0; o->csv && k < 2; ++k) {
      sonde_csv_put_text(o->csv, texts[k]);
      sonde_file_printf(o->csv, k ? "\n" : ",");
    }
    if (o->json.file) {
      sonde_json_begin_object(&o->json, NULL);
      for (int k = 0; k < COLUMNS; ++k)
        sonde_json_put_real(&o->json, list[k].name, list[k].value, 9);
      sonde_json_put_text(&o->json, "case", c.pathology.name);
      sonde_json_put_text(&o->json, "fault", fault);
      sonde_json_end(&o->json);
    }
    what->rows++;
  }
  sonde_image image = {.width = frame->width,
                       .height = frame->height,
                       .width_m = frame->width_m,
                       .height_m = frame->height_m,
                       .top_m = frame->top_m,
                       .pixels = (uint8_t *)(uintptr_t)frame->pixels};
  if (what->sequence) {
    sonde_status status = track(o, frame, &image, error);
    if (status) return status;
  }
  if (what->frames) {
    char path[4200];
    snprintf(path, sizeof path, "%s/image_%08llu.png", what->frames,
             (unsigned long long)frame->snapshot.tick);
    sonde_status status = sonde_image_save_png(&image, path, error);
    if (status) return status;
    what->pictures++;
  }
  return filmed ? SONDE_OK : app_error(error, SONDE_IO, "ffmpeg went away");
}

// Every image from the begin to the end of the part; a film begins with the image that stood there.
static sonde_status play(output *o, const sonde_progress *progress, sonde_error *error) {
  replay_export *what = o->what;
  sonde_status status = sonde_player_seek(o->player, what->from_s, progress, error);
  sonde_frame frame;
  bool any = !status && sonde_player_frame(o->player, &frame);
  if (any && frame.snapshot.time_s >= what->from_s) status = write_image(o, &frame, error);
  if (any && o->film) draw_picture(o, &frame);
  while (!status && sonde_player_next_image(o->player, true)) {
    if (!sonde_player_frame(o->player, &frame) || frame.snapshot.time_s > what->to_s) break;
    status = write_image(o, &frame, error);
    double share = (frame.snapshot.time_s - what->from_s) / fmax(what->to_s - what->from_s, 1e-9);
    if (!status && !progress->report(fmin(share, 1), "export", progress->user))
      return app_error(error, SONDE_CANCELLED, "cancelled; what was written is whole");
  }
  if (!status && o->film) (void)film_until(o, what->to_s + 0.5 / FRAMES_PER_S);
  return status;
}

// A DICOM file belongs to the study of its exam, whose number and date the recording's setup tells.
static sonde_status save_sequence(const replay_export *what, const sonde_sequence *sequence,
                                  sonde_error *error) {
  const size_t length = strlen(what->sequence);
  if (length < 4 || strcmp(what->sequence + length - 4, ".dcm") != 0)
    return sonde_sequence_save(what->sequence, sequence, true, error);
  sonde_json *setup = exam_read_setup(what->recording);
  const char *id = sonde_json_as_text(sonde_json_member(setup, "exam"));
  const sonde_dicom_about about = {.study = id,
                                   .patient_id = id,
                                   .date = sonde_json_as_text(sonde_json_member(setup, "date")),
                                   .title = "Compression ultrasound"};
  sonde_status status = sonde_sequence_save_dicom(what->sequence, sequence, &about, error);
  sonde_json_free(setup);
  return status;
}

sonde_status replay_export_run(sonde_player *player, replay_export *what,
                               const sonde_progress *progress, sonde_error *error) {
  assert(what->from_s <= what->to_s);
  output o = {.what = what, .player = player};
  sonde_status status = SONDE_OK;
  const sonde_recording_info *info = sonde_player_info(o.player);
  o.json.layout = SONDE_JSON_LINES;
  if (what->frames) status = sonde_directory_make(what->frames, 0777, false, error);
  if (!status && what->csv) status = sonde_file_create(what->csv, &o.csv, error);
  if (!status && what->json) status = sonde_file_create(what->json, &o.json.file, error);
  if (!status && what->video) { // even sides, as the film's colours want them
    o.width = (info->image_width + 1) / 2 * 2;
    o.height = (info->image_height + STRIP + 1) / 2 * 2;
    o.picture = calloc(o.width, o.height);
    status = o.picture ? film_open(what->video, o.width, o.height, FRAMES_PER_S, &o.film, error)
                       : app_error(error, SONDE_MEMORY, "out of memory");
  }

  if (!status && what->sequence) { // room for all images; what stays unused is never touched
    const uint32_t most = (uint32_t)fmax(fmin((double)info->images, MOST_TRACKED), 1);
    status = sonde_sequence_create(info->image_width, info->image_height, most, &o.sequence, error);
  }
  // The heads of the tables.
  column list[COLUMNS] = {0};
  if (!status) columns(o.player, &(sonde_frame){0}, list);
  for (int k = 0; !status && o.csv && k < COLUMNS; ++k)
    sonde_file_printf(o.csv, "%s,", list[k].name);
  if (!status && o.csv) sonde_file_printf(o.csv, "case,fault\n");
  if (!status && o.json.file) {
    sonde_json_begin_object(&o.json, NULL);
    sonde_json_put_text(&o.json, "recording", what->recording);
    sonde_json_put_text(&o.json, "model", info->model_name);
    sonde_json_put_real(&o.json, "duration_s", info->duration_s, 9);
    sonde_json_begin_list(&o.json, "images");
  }
  if (!status) status = play(&o, progress, error);

  // What a cancelled export has is kept, what a failed one has is not.
  bool keep = status == SONDE_OK || status == SONDE_CANCELLED;
  sonde_error own = {0}, filmed = {0};
  sonde_status first = keep && o.json.file ? print_comments(&o, &own) : SONDE_OK;
  if (what->sequence && keep && !first && !what->tracked)
    first = app_error(&own, SONDE_NOT_FOUND, "no image from %g to %g s", what->from_s, what->to_s);
  if (what->sequence && keep && !first) {
    const uint32_t made = o.sequence.count;
    o.sequence.count = what->tracked;
    first = save_sequence(what, &o.sequence, &own);
    o.sequence.count = made;
  }
  sonde_sequence_clear(&o.sequence);
  sonde_file *files[2] = {o.csv, o.json.file};
  for (int k = 0; k < 2; ++k)
    if (files[k] && keep && !first)
      first = sonde_file_commit(files[k], &own);
    else
      sonde_file_discard(files[k]);
  sonde_status film_status = film_close(o.film, &filmed);
  free(o.picture);
  if (status) return status;
  *error = first ? own : filmed;
  return first ? first : film_status;
}
