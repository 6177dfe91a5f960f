// The worksheet of an exam for an archive: a structured report of what the examiner wrote, in the
// codes of DICOM and SNOMED CT where they have the word, that names the pictures beside it. Nothing
// of the truth.
#include "exam_app_export.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct report {
  sonde_dicom_item *item;
  uint32_t count, most;
} report;

static sonde_dicom_item *add(report *r, uint32_t level, sonde_dicom_kind kind,
                             sonde_dicom_code name) {
  assert(r->count < r->most);
  sonde_dicom_item *item = &r->item[r->count++];
  *item = (sonde_dicom_item){.level = level, .kind = kind, .name = name};
  return item;
}

static sonde_dicom_code dcm(const char *value, const char *meaning) {
  return (sonde_dicom_code){value, "DCM", meaning};
}

static sonde_dicom_code own(const char *value, const char *meaning) {
  return (sonde_dicom_code){value, SONDE_DICOM_SCHEME, meaning};
}

static void add_text(report *r, uint32_t level, sonde_dicom_code name, const char *text) {
  if (text[0]) add(r, level, SONDE_DICOM_TEXT, name)->text = text;
}

static void add_code(report *r, uint32_t level, sonde_dicom_relation relation,
                     sonde_dicom_code name, sonde_dicom_code code) {
  sonde_dicom_item *item = add(r, level, SONDE_DICOM_CODE, name);
  item->relation = relation, item->code = code;
}

// A word of the worksheet, unless nothing is written.
static void add_word(report *r, uint32_t level, sonde_dicom_code name, sonde_sheet_list list,
                     uint32_t value) {
  static const char *const MEANS[][2] = {{"compressible", "Compressible"},
                                         {"partly", "Partly"},
                                         {"not_compressible", "Not compressible"},
                                         {"not_seen", "Not seen"},
                                         {"acute", "Acute"},
                                         {"chronic", "Chronic"},
                                         {"indeterminate", "Indeterminate"},
                                         {"occlusive", "Occlusive"},
                                         {"free_floating", "Free-floating"},
                                         {"absent", "Absent"},
                                         {"present", "Present"},
                                         {"no_dvt", "No deep vein thrombosis"},
                                         {"proximal", "Proximal deep vein thrombosis"},
                                         {"distal", "Distal deep vein thrombosis"},
                                         {"superficial", "Superficial vein thrombosis"},
                                         {"inconclusive", "Inconclusive"}};
  const char *word = sonde_sheet_word(list, value), *meaning = word;
  if (value == 0) return;
  for (size_t k = 0; k < sizeof MEANS / sizeof *MEANS; ++k)
    if (strcmp(MEANS[k][0], word) == 0) meaning = MEANS[k][1];
  add_code(r, level, level > 2 ? SONDE_DICOM_PROPERTY : SONDE_DICOM_CONTAINS, name,
           own(word, meaning));
}

static void add_number(report *r, uint32_t level, sonde_dicom_relation relation,
                       sonde_dicom_code name, double number, sonde_dicom_code unit) {
  sonde_dicom_item *item = add(r, level, SONDE_DICOM_NUMBER, name);
  item->relation = relation, item->number = number, item->code = unit;
}

// The vein of a segment: SNOMED CT (PS3.16, CID 12103), or the house's word.
static sonde_dicom_code vein(const char *segment) {
  static const char *const KNOWN[][3] = {{"common_femoral", "397363009", "Common Femoral Vein"},
                                         {"femoral_proximal", "83419000", "Femoral vein"},
                                         {"femoral_mid", "83419000", "Femoral vein"},
                                         {"femoral_distal", "83419000", "Femoral vein"},
                                         {"popliteal", "56849005", "Popliteal Vein"},
                                         {"deep_femoral", "23438002", "Profunda Femoris Vein"},
                                         {"posterior_tibial", "4258007", "Posterior Tibial Vein"},
                                         {"peroneal", "71758008", "Peroneal Vein"},
                                         {"gastrocnemius", "264481007", "Gastrocnemius vein"},
                                         {"great_saphenous", "60734001", "Great Saphenous Vein"},
                                         {"small_saphenous", "26805005", "Lesser Saphenous Vein"}};
  for (size_t k = 0; k < sizeof KNOWN / sizeof *KNOWN; ++k)
    if (strcmp(KNOWN[k][0], segment) == 0)
      return (sonde_dicom_code){KNOWN[k][1], "SCT", KNOWN[k][2]};
  return own(segment, sonde_segment_title(segment));
}

// What is written at a place, with its pictures.
static void add_place(report *r, const exam *of, uint32_t place, sonde_dicom_about *pictures) {
  const sonde_worksheet *sheet = &of->sheet;
  const sonde_vein_map *map = &of->setups.held[0].map;
  const sonde_sheet_row *row = &sheet->row[place];
  const sonde_plan_point *point = &of->plan.point[place];
  add(r, 1, SONDE_DICOM_CONTAINER, dcm("121070", "Findings"));
  if (point->segment < map->segment_count)
    add_code(r, 2, SONDE_DICOM_MODIFIES, (sonde_dicom_code){"363698007", "SCT", "Finding Site"},
             vein(map->segment[point->segment].name));
  if (sheet->side[0]) {
    const bool left = sheet->side[0] == 'l';
    add_code(r, 2, SONDE_DICOM_MODIFIES, (sonde_dicom_code){"272741003", "SCT", "Laterality"},
             (sonde_dicom_code){left ? "7771000" : "24028007", "SCT", left ? "Left" : "Right"});
  }
  add_text(r, 2, own("station", "Station"), point->title);
  add_word(r, 2, dcm("121071", "Finding"), SONDE_SHEET_FINDINGS, row->finding);
  if (row->finding) {
    add_word(r, 3, own("age", "Age of the clot"), SONDE_SHEET_AGES, row->age);
    add_word(r, 3, own("lumen", "Clot in the lumen"), SONDE_SHEET_KINDS, row->kind);
  }
  add_word(r, 2, own("reflux", "Reflux"), SONDE_SHEET_REFLUXES, row->reflux);
  if (row->reflux && isfinite(row->reflux_s))
    add_number(r, 3, SONDE_DICOM_PROPERTY, own("reflux_time", "Time of reflux"), row->reflux_s,
               (sonde_dicom_code){"s", "UCUM", "second"});
  add_text(r, 2, dcm("121106", "Comment"), row->text);
  for (uint32_t k = 0; k < sheet->picture_count; ++k) {
    const sonde_sheet_picture *picture = &sheet->picture[k];
    if (picture->place != place || !picture->image.pixels) continue;
    pictures[k] = exam_sheet_about(of, picture);
    sonde_dicom_item *item = add(r, 2, SONDE_DICOM_PICTURE,
                                 picture->compressed ? own("with", "With compression")
                                                     : own("without", "Without compression"));
    item->image = &picture->image, item->image_about = &pictures[k];
    add_number(r, 3, SONDE_DICOM_ACQUIRED, own("force", "Force of the probe"), picture->force_n,
               (sonde_dicom_code){"N", "UCUM", "newton"});
  }
}

sonde_status exam_sheet_archive(const exam *of, sonde_error *error) {
  const sonde_worksheet *sheet = &of->sheet;
  const sonde_sheet_extent *const ends[] = {&sheet->deep, &sheet->superficial};
  char path[EXAM_PATH], device[64], extent[2][160];
  report r = {.most = 16 + 10 * sheet->place_count + 2 * sheet->picture_count};
  r.item = calloc(r.most, sizeof *r.item);
  sonde_dicom_about *pictures = calloc(SONDE_SHEET_PICTURES, sizeof *pictures);
  if (!r.item || !pictures) {
    free(r.item);
    free(pictures);
    return app_error(error, SONDE_MEMORY, "out of memory");
  }
  snprintf(device, sizeof device, "Sonde %s", sonde_version());
  add(&r, 0, SONDE_DICOM_CONTAINER, dcm("125100", "Vascular Ultrasound Procedure Report"));
  add_code(&r, 1, SONDE_DICOM_MODIFIES, dcm("121049", "Language of Content Item and Descendants"),
           (sonde_dicom_code){"en", "RFC5646", "English"});
  add_code(&r, 1, SONDE_DICOM_OBSERVED, dcm("121005", "Observer Type"), dcm("121007", "Device"));
  sonde_dicom_item *name = add(&r, 1, SONDE_DICOM_TEXT, dcm("121013", "Device Observer Name"));
  name->relation = SONDE_DICOM_OBSERVED, name->text = device;
  for (uint32_t k = 0; k < sheet->place_count; ++k) add_place(&r, of, k, pictures);
  add(&r, 1, SONDE_DICOM_CONTAINER, dcm("121076", "Conclusions"));
  add_word(&r, 2, dcm("121077", "Conclusion"), SONDE_SHEET_CONCLUSIONS, sheet->conclusion);
  for (int k = 0; k < 2; ++k) {
    if (ends[k]->from >= sheet->place_count || ends[k]->to >= sheet->place_count) continue;
    snprintf(extent[k], sizeof extent[k], "%s - %s", of->plan.point[ends[k]->from].title,
             of->plan.point[ends[k]->to].title);
    add_text(&r, 2,
             k ? own("superficial_ends", "Clot in superficial veins, from and to")
               : own("deep_ends", "Clot in deep veins, from and to"),
             extent[k]);
  }
  add_text(&r, 2, dcm("121073", "Impression"), sheet->text);
  const sonde_dicom_about about = {
      .study = of->id, .patient_id = of->id, .date = of->date, .title = "Worksheet", .series = 3};
  sonde_status status = sonde_report_save_dicom(exam_app_path(path, of->directory, "worksheet.dcm"),
                                                r.item, r.count, &about, error);
  free(r.item);
  free(pictures);
  return status;
}
