// A worksheet as JSON and as a table.
#include "sonde/trainer_worksheet.h"

#include "files/png.h"
#include "sonde/files.h"
#include "trainer/report.h"

#include <string.h>

static void put_word(sonde_json_out *out, const char *key, sonde_sheet_list list, uint32_t value) {
  sonde_json_put_text(out, key, sonde_sheet_word(list, value));
}

static void put_numbers(sonde_json_out *out, const char *key, const double *list, size_t count,
                        double scale) {
  sonde_json_begin_list(out, key);
  for (size_t i = 0; i < count; ++i) sonde_json_put_real(out, NULL, scale * list[i], 7);
  sonde_json_end(out);
}

// Places by their number in the plan; none: null.
static void put_place(sonde_json_out *out, const char *key, uint32_t place) {
  sonde_json_put_real(out, key, place < SONDE_PLAN_POINTS ? (double)place : (double)NAN, 0);
}

static void put_extent(sonde_json_out *out, const char *key, const sonde_sheet_extent *extent) {
  sonde_json_begin_list(out, key);
  if (extent->from < SONDE_PLAN_POINTS) {
    put_place(out, NULL, extent->from);
    put_place(out, NULL, extent->to);
  }
  sonde_json_end(out);
}

static sonde_status put_picture(sonde_json_out *out, const sonde_sheet_picture *picture,
                                uint32_t segment, bool images, sonde_error *error) {
  const sonde_vec3 face_m = picture->probe.position;
  const sonde_quat q = picture->probe.rotation;
  const double position_mm[] = {1e3 * face_m.x, 1e3 * face_m.y, 1e3 * face_m.z};
  const double rotation[] = {q.w, q.x, q.y, q.z};
  const sonde_image *image = &picture->image;
  sonde_json_begin_object(out, NULL);
  sonde_json_put_integer(out, "number", picture->number);
  sonde_json_put_integer(out, "place", picture->place);
  sonde_json_put_text(out, "view", picture->compressed ? "with" : "without");
  sonde_json_put_integer(out, "part", picture->part);
  sonde_json_put_integer(out, "tick", (int64_t)picture->tick);
  sonde_json_put_real(out, "time_s", picture->time_s, 7);
  sonde_json_put_real(out, "force_n", picture->force_n, 4);
  put_numbers(out, "position_mm", position_mm, SONDE_COUNT_OF(position_mm), 1);
  put_numbers(out, "rotation", rotation, SONDE_COUNT_OF(rotation), 1);
  sonde_json_put_real(out, "vein", images ? picture->ratio[segment] : (double)NAN, 3);
  sonde_json_put_real(out, "width_mm", 1e3 * image->width_m, 5);
  sonde_json_put_real(out, "height_mm", 1e3 * image->height_m, 5);
  sonde_json_begin_list(out, "marks");
  for (uint32_t k = 0; k < picture->mark_count; ++k) {
    const sonde_sheet_mark *mark = &picture->mark[k];
    const double length_m = hypot(mark->to_m[0] - mark->from_m[0], mark->to_m[1] - mark->from_m[1]);
    const double at_m[] = {mark->from_m[0], mark->from_m[1], mark->to_m[0], mark->to_m[1],
                           mark->half_m};
    sonde_json_begin_object(out, NULL);
    if (mark->half_m > 0)
      sonde_json_put_real(out, "area_mm2", 0.5e6 * SONDE_PI * length_m * mark->half_m, 4);
    else
      sonde_json_put_real(out, "distance_mm", 1e3 * length_m, 4);
    put_numbers(out, "at_mm", at_m, SONDE_COUNT_OF(at_m), 1e3);
    sonde_json_end(out);
  }
  sonde_json_end(out);
  sonde_status status = SONDE_OK;
  if (images && image->pixels) {
    uint8_t *bytes = NULL;
    size_t count = 0;
    status = sonde_png_encode(image, &bytes, &count, error);
    char *text = status ? NULL : sonde_base64_encode(bytes, count);
    if (!status && !text) status = sonde_fail_memory(error);
    if (text) sonde_json_put_text(out, "image", text);
    sonde_free(text);
    sonde_free(bytes);
  }
  sonde_json_end(out);
  return status;
}

static void put_extent_verdict(sonde_json_out *out, const char *key,
                               const sonde_sheet_extent_verdict *v) {
  const bool off = v->clot && v->said;
  sonde_json_begin_object(out, key);
  sonde_json_put_bool(out, "clot", v->clot);
  sonde_json_put_bool(out, "said", v->said);
  put_extent(out, "truth", &v->truth);
  sonde_json_begin_list(out, "off_stations");
  for (int k = 0; k < 2; ++k) sonde_json_put_real(out, NULL, off ? v->off[k] : (double)NAN, 0);
  sonde_json_end(out);
  sonde_json_begin_list(out, "off_mm");
  for (int k = 0; k < 2; ++k)
    sonde_json_put_real(out, NULL, off ? 1e3 * v->off_m[k] : (double)NAN, 4);
  sonde_json_end(out);
  sonde_json_end(out);
}

sonde_status sonde_worksheet_put(sonde_json_out *out, const char *key, const sonde_worksheet *sheet,
                                 const sonde_plan *plan, const sonde_vein_map *map,
                                 const sonde_sheet_verdict *verdict, bool images,
                                 sonde_error *error) {
  SONDE_ASSERT(out && sheet && plan && map && sheet->place_count == plan->count);
  sonde_status status = SONDE_OK;
  if (key) sonde_json_begin_object(out, key);
  sonde_json_put_text(out, "side", sheet->side);
  sonde_json_put_bool(out, "written", sheet->written);
  sonde_json_begin_list(out, "places");
  for (uint32_t i = 0; i < plan->count; ++i) {
    const sonde_plan_point *place = &plan->point[i];
    const sonde_sheet_row *row = &sheet->row[i];
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "title", place->title);
    sonde_json_put_text(out, "segment", map->segment[place->segment].name);
    sonde_json_put_text(out, "position", sonde_position_key(place->position));
    sonde_json_put_bool(out, "superficial",
                        map->segment[place->segment].kind == SONDE_SEGMENT_SUPERFICIAL);
    put_word(out, "finding", SONDE_SHEET_FINDINGS, row->finding);
    put_word(out, "age", SONDE_SHEET_AGES, row->age);
    put_word(out, "kind", SONDE_SHEET_KINDS, row->kind);
    put_word(out, "reflux", SONDE_SHEET_REFLUXES, row->reflux);
    sonde_json_put_real(out, "reflux_s", row->reflux_s, 4);
    sonde_json_put_text(out, "text", row->text);
    if (verdict) {
      const sonde_sheet_place_verdict *v = &verdict->place[i];
      sonde_json_begin_object(out, "verdict");
      sonde_json_put_text(out, "outcome", sonde_sheet_outcome_name(v->outcome));
      put_word(out, "truth", SONDE_SHEET_FINDINGS, v->truth);
      sonde_json_put_bool(out, "edge", v->edge);
      put_word(out, "age", SONDE_SHEET_AGES, v->truth_age);
      put_word(out, "kind", SONDE_SHEET_KINDS, v->truth_kind);
      sonde_json_put_bool(out, "age_right", v->age_right);
      sonde_json_put_bool(out, "kind_right", v->kind_right);
      sonde_json_put_bool(out, "documented", v->documented);
      sonde_json_put_text(out, "pictures", v->pictures);
      sonde_json_end(out);
    }
    sonde_json_end(out);
  }
  sonde_json_end(out);
  sonde_json_begin_list(out, "pictures");
  for (uint32_t k = 0; k < sheet->picture_count && !status; ++k) {
    const sonde_sheet_picture *picture = &sheet->picture[k];
    status = put_picture(out, picture, plan->point[picture->place].segment, images, error);
  }
  sonde_json_end(out);
  put_extent(out, "deep", &sheet->deep);
  put_extent(out, "superficial", &sheet->superficial);
  put_word(out, "conclusion", SONDE_SHEET_CONCLUSIONS, sheet->conclusion);
  sonde_json_put_text(out, "text", sheet->text);
  if (verdict) {
    const sonde_sheet_verdict *v = verdict;
    const sonde_named figures[] = {{"score", v->score},
                                   {"findings", v->findings},
                                   {"pictures", v->pictures},
                                   {"clot", v->clot}};
    sonde_json_begin_object(out, "verdict");
    sonde_put_named(out, figures, SONDE_COUNT_OF(figures));
    sonde_json_put_integer(out, "places", v->place_count);
    sonde_json_put_integer(out, "right", v->right);
    sonde_json_put_integer(out, "missed", v->missed);
    sonde_json_put_integer(out, "over_called", v->over_called);
    sonde_json_put_integer(out, "documented", v->documented);
    put_word(out, "conclusion", SONDE_SHEET_CONCLUSIONS, v->conclusion);
    sonde_json_put_bool(out, "conclusion_right", v->conclusion_right);
    put_extent_verdict(out, "deep", &v->deep);
    put_extent_verdict(out, "superficial", &v->superficial);
    sonde_json_put_text(out, "summary", v->summary);
    sonde_json_end(out);
  }
  if (key) sonde_json_end(out);
  return status;
}

sonde_status sonde_worksheet_save_csv(const sonde_worksheet *sheet, const sonde_plan *plan,
                                      const sonde_sheet_verdict *verdict, const char *path,
                                      sonde_error *error) {
  SONDE_ASSERT(sheet && plan && path && sheet->place_count == plan->count);
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "place,title,finding,age,kind,reflux,reflux_s,without,with,truth,outcome,"
                          "truth_age,truth_kind,documented\n");
  for (uint32_t i = 0; i < plan->count; ++i) {
    const sonde_sheet_row *row = &sheet->row[i];
    uint32_t pictures[2] = {0};
    for (uint32_t k = 0; k < sheet->picture_count; ++k)
      if (sheet->picture[k].place == i) pictures[sheet->picture[k].compressed]++;
    sonde_file_printf(file, "%u,", i + 1);
    sonde_csv_put_text(file, plan->point[i].title);
    sonde_file_printf(file, ",%s,%s,%s,%s,", sonde_sheet_word(SONDE_SHEET_FINDINGS, row->finding),
                      sonde_sheet_word(SONDE_SHEET_AGES, row->age),
                      sonde_sheet_word(SONDE_SHEET_KINDS, row->kind),
                      sonde_sheet_word(SONDE_SHEET_REFLUXES, row->reflux));
    if (isfinite(row->reflux_s)) sonde_file_printf(file, "%.3g", row->reflux_s);
    sonde_file_printf(file, ",%u,%u", pictures[0], pictures[1]);
    const sonde_sheet_place_verdict *v = verdict ? &verdict->place[i] : NULL;
    if (v)
      sonde_file_printf(file, ",%s,%s,%s,%s,%d\n", sonde_sheet_word(SONDE_SHEET_FINDINGS, v->truth),
                        sonde_sheet_outcome_name(v->outcome),
                        sonde_sheet_word(SONDE_SHEET_AGES, v->truth_age),
                        sonde_sheet_word(SONDE_SHEET_KINDS, v->truth_kind), v->documented);
    else
      sonde_file_printf(file, ",,,,,\n");
  }
  return sonde_file_commit(file, error);
}
