// The worksheet of an exam: the images that the learner may store, entries from the page and from
// the journal, files.
#include "exam_app_parts.h"

#include <assert.h>
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- images in reach

void exam_shrink(const sonde_frame *frame, sonde_image *image) {
  assert(image->width == frame->width / 2 && image->height == frame->height / 2);
  for (uint32_t y = 0; y < image->height; ++y)
    for (uint32_t x = 0; x < image->width; ++x) {
      const uint8_t *p = frame->pixels + 2 * (size_t)y * frame->width + 2 * (size_t)x;
      image->pixels[y * image->width + x] =
          (uint8_t)((p[0] + p[1] + p[frame->width] + p[frame->width + 1] + 2) / 4);
    }
  image->width_m = frame->width_m;
  image->height_m = frame->height_m;
  image->top_m = frame->top_m;
  image->tick = frame->snapshot.tick;
}

void exam_sheet_watch(exam *of, const sonde_frame *frame) {
  assert(of->next_look < EXAM_LOOKS && of->judge);
  exam_look *look = &of->look[of->next_look];
  const uint32_t width = frame->width / 2, height = frame->height / 2;
  if (!frame->pixels || !width || !height) return;
  if (look->image.width != width || look->image.height != height) {
    sonde_image_clear(&look->image);
    look->there = !sonde_image_create(width, height, &look->image, NULL);
    if (!look->there) return;
  }
  exam_shrink(frame, &look->image);
  look->there = true;
  look->snapshot = frame->snapshot;
  look->part = of->watched_part, look->held = of->held;
  look->time_s = sonde_judge_state(of->judge).time_s;
  of->next_look = (of->next_look + 1) % EXAM_LOOKS;
}

void exam_sheet_turn(exam *of) {
  of->watched_part++;
  of->kept_look.there = false;
  for (uint32_t k = 0; k < EXAM_LOOKS; ++k) of->look[k].there = false;
}

static void copy_image(const sonde_image *from, sonde_image *to) {
  if (to->width != from->width || to->height != from->height) {
    sonde_image_clear(to);
    if (sonde_image_create(from->width, from->height, to, NULL)) return;
  }
  memcpy(to->pixels, from->pixels, (size_t)from->width * from->height);
  to->width_m = from->width_m, to->height_m = from->height_m;
  to->top_m = from->top_m, to->tick = from->tick;
}

// What sonde_worksheet_enter() asks for.
static bool find_look(void *user, uint64_t tick, sonde_sheet_picture *picture) {
  exam *of = user;
  const exam_look *found =
      of->kept_look.there && of->kept_look.snapshot.tick == tick ? &of->kept_look : NULL;
  for (uint32_t k = 0; k < EXAM_LOOKS && !found; ++k)
    if (of->look[k].there && of->look[k].snapshot.tick == tick) found = &of->look[k];
  if (!found) return false;
  if (!picture) { // frozen: the ring will pass it
    exam_look *kept = &of->kept_look;
    if (kept == found) return true;
    sonde_image own = kept->image;
    *kept = *found;
    kept->image = own;
    copy_image(&found->image, &kept->image);
    kept->there = kept->image.pixels != NULL;
    return kept->there;
  }
  const sonde_vein_map *map = &of->setups.held[found->held].map;
  picture->part = found->part, picture->held = found->held;
  picture->tick = tick;
  picture->time_s = found->time_s;
  picture->force_n = fmax(0, found->snapshot.force_normal_n);
  picture->probe = found->snapshot.world_from_probe;
  for (uint32_t k = 0; k < SONDE_SEGMENTS; ++k)
    picture->ratio[k] =
        k < map->segment_count ? sonde_segment_ratio(map, k, &found->snapshot, NULL) : (double)NAN;
  copy_image(&found->image, &picture->image);
  return picture->image.pixels != NULL;
}

sonde_status exam_sheet_enter(exam *of, const char *entry, sonde_error *error) {
  assert(entry && of->sheet.place_count == of->plan.count);
  return sonde_worksheet_enter(&of->sheet, &of->plan, entry, strlen(entry), find_look, of, error);
}

void exam_sheet_clear(exam *of) {
  sonde_worksheet_clear(&of->sheet);
  sonde_image_clear(&of->kept_look.image);
  for (uint32_t k = 0; k < EXAM_LOOKS; ++k) sonde_image_clear(&of->look[k].image);
}

// ---- the page

static const char *picture_path(const exam *of, const sonde_sheet_picture *picture,
                                char path[EXAM_PATH]) {
  char name[40];
  snprintf(name, sizeof name, "worksheet-%u.png", picture->number);
  return exam_app_path(path, of->directory, name);
}

sonde_status exam_app_write_sheet(exam_app *app, const char *entry, sonde_error *error) {
  exam *of = app->exam;
  char path[EXAM_PATH];
  if (app->phase != EXAM_RUNNING || !of)
    return app_error(error, SONDE_ARGUMENT, "there is no exam whose worksheet could be written");
  pthread_mutex_lock(&app->lock);
  const uint32_t before = of->sheet.last_number;
  sonde_status status = exam_sheet_enter(of, entry, error);
  const uint64_t tick = of->seen_tick;
  pthread_mutex_unlock(&app->lock);
  if (!status) status = sonde_session_note(app->session, SONDE_NOTE_WORKSHEET, tick, entry, error);
  // The page shows a picture from its file. One that the disk does not take is made from the
  // journal again.
  if (!status && of->sheet.last_number > before) {
    const sonde_sheet_picture *newest = &of->sheet.picture[of->sheet.picture_count - 1];
    status = sonde_image_save_png(&newest->image, picture_path(of, newest, path), error);
  }
  return status;
}

void exam_app_tell_sheet(exam_app *app) {
  const exam *of = app->exam;
  const bool shown = of && (app->phase == EXAM_RUNNING || app->phase == EXAM_DONE);
  char *text = NULL;
  size_t length = 0;
  if (shown) {
    sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
    if (sonde_file_in_memory(&out.file, NULL)) return;
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "type", "worksheet");
    sonde_json_put_text(&out, "exam", of->id);
    (void)sonde_worksheet_put(&out, NULL, &of->sheet, &of->plan, &of->setups.held[0].map,
                              of->scored ? &of->verdict : NULL, false, NULL);
    sonde_json_end(&out);
    (void)sonde_file_take(out.file, &text, &length, NULL);
  }
  if (app->server) (void)sonde_page_publish(app->server, SONDE_PAGE_SHEET, text, NULL);
  sonde_free(text);
}

// ---- files

sonde_status exam_sheet_save(const exam *of, sonde_error *error) {
  char path[EXAM_PATH];
  assert(of->directory[0] && of->protocol);
  const sonde_sheet_verdict *verdict = of->verdict.place_count > 0 ? &of->verdict : NULL;
  sonde_json_out out = {.layout = SONDE_JSON_LINES};
  if (!of->sheet.written) return SONDE_OK;
  for (uint32_t k = 0; k < of->sheet.picture_count; ++k) {
    const sonde_sheet_picture *picture = &of->sheet.picture[k];
    sonde_status status = SONDE_OK;
    if (access(picture_path(of, picture, path), F_OK) != 0)
      status = sonde_image_save_png(&picture->image, path, error);
    // For an archive, as secondary capture; it belongs to the study of the exam.
    const sonde_dicom_about about = {.study = of->id,
                                     .patient_id = of->id,
                                     .date = of->date,
                                     .title = "Worksheet",
                                     .side = (char)toupper((unsigned char)of->sheet.side[0]),
                                     .series = 2,
                                     .number = picture->number};
    memcpy(strrchr(path, '.'), ".dcm", 4);
    if (!status && picture->image.pixels && access(path, F_OK) != 0)
      status = sonde_image_save_dicom(path, &picture->image, &about, error);
    if (status) return status;
  }
  sonde_status status = sonde_worksheet_save_csv(
      &of->sheet, &of->plan, verdict, exam_app_path(path, of->directory, "worksheet.csv"), error);
  if (status) return status;
  status =
      sonde_file_create(exam_app_path(path, of->directory, "worksheet.json"), &out.file, error);
  if (status) return status;
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_integer(&out, "sonde_worksheet", 1);
  sonde_json_put_text(&out, "exam", of->id);
  sonde_json_put_text(&out, "date", of->date);
  sonde_json_put_text(&out, "trainee", of->trainee);
  sonde_json_put_text(&out, "title", of->patient.title);
  sonde_json_put_text(&out, "history", of->patient.history);
  sonde_json_put_text(&out, "protocol", of->protocol->title);
  status = sonde_worksheet_put(&out, NULL, &of->sheet, &of->plan, &of->setups.held[0].map, verdict,
                               true, error);
  sonde_json_end(&out);
  sonde_file_printf(out.file, "\n");
  if (status) {
    sonde_file_discard(out.file);
    return status;
  }
  return sonde_file_commit(out.file, error);
}
