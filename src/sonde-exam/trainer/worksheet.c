// A worksheet, entry by entry: each is read and checked as a whole before anything is changed,
// since it comes from a page or from a file.
#include "sonde/trainer_worksheet.h"

#include "sonde/limb_model.h"
#include "trainer/judge.h"

#include <string.h>

enum { DEPTH = 3 }; // of lists and objects in an entry
static const double TICKS_MOST = 9007199254740992.0, REFLUX_MOST_S = 20, PICTURE_MOST_MM = 400;

static const char *const WORD[SONDE_SHEET_LISTS][7] = {
    [SONDE_SHEET_FINDINGS] = {"", "compressible", "partly", "not_compressible", "not_seen"},
    [SONDE_SHEET_AGES] = {"", "acute", "chronic", "indeterminate"},
    [SONDE_SHEET_KINDS] = {"", "occlusive", "partly", "free_floating"},
    [SONDE_SHEET_REFLUXES] = {"", "absent", "present"},
    [SONDE_SHEET_CONCLUSIONS] = {"", "no_dvt", "proximal", "distal", "superficial",
                                 "inconclusive"}};

const char *sonde_sheet_word(sonde_sheet_list list, uint32_t value) {
  SONDE_ASSERT(list < SONDE_SHEET_LISTS);
  return value < SONDE_COUNT_OF(WORD[list]) ? WORD[list][value] : NULL;
}

void sonde_worksheet_begin(sonde_worksheet *sheet, const sonde_exam_setups *setups,
                           const sonde_plan *plan) {
  SONDE_ASSERT(sheet && setups && setups->count > 0 && plan->count <= SONDE_PLAN_POINTS);
  const sonde_limb *limb = sonde_limb_of(setups->held[0].model);
  *sheet = (sonde_worksheet){.place_count = plan->count,
                             .deep = {SONDE_PLAN_POINTS, SONDE_PLAN_POINTS},
                             .superficial = {SONDE_PLAN_POINTS, SONDE_PLAN_POINTS}};
  for (uint32_t i = 0; i < plan->count; ++i) sheet->row[i].reflux_s = (double)NAN;
  if (limb)
    snprintf(sheet->side, sizeof sheet->side, "%s",
             sonde_limb_body_of(limb)->side == SONDE_LIMB_LEFT ? "left" : "right");
}

void sonde_worksheet_clear(sonde_worksheet *sheet) {
  if (!sheet) return;
  for (uint32_t i = 0; i < sheet->picture_count; ++i) sonde_image_clear(&sheet->picture[i].image);
  sheet->picture_count = 0;
}

sonde_status sonde_worksheet_store(sonde_worksheet *sheet, sonde_sheet_picture *picture,
                                   sonde_error *error) {
  SONDE_ASSERT(sheet && picture && picture->place < sheet->place_count);
  if (sheet->picture_count == SONDE_SHEET_PICTURES)
    return sonde_fail(error, SONDE_ARGUMENT, "the worksheet has %d pictures, its most",
                      SONDE_SHEET_PICTURES);
  picture->number = ++sheet->last_number;
  sheet->picture[sheet->picture_count++] = *picture;
  picture->image = (sonde_image){0};
  sheet->written = true;
  return SONDE_OK;
}

// ---- an entry

// What is read; the first mistake stays, and after it nothing counts.
typedef struct entry {
  const sonde_json *root;
  const sonde_plan *plan;
  sonde_status status;
  sonde_error *error;
} entry;

#define refuse(e, ...) sonde_fail_once((e)->status, (e)->error, SONDE_ARGUMENT, __VA_ARGS__)

static bool has(const entry *e, const char *key) { return sonde_json_member(e->root, key) != NULL; }

// A number of a range; an integer when `whole`.
static double read_number(entry *e, const sonde_json *item, const char *key, double low,
                          double high, bool whole) {
  double found = sonde_json_as_number(item);
  if (found >= low && found <= high && (!whole || found == floor(found))) return found;
  refuse(e, "\"%s\" must be a %s from %g to %g", key, whole ? "whole number" : "number", low, high);
  return low;
}

static uint32_t read_place(entry *e, const sonde_json *item, const char *key) {
  return (uint32_t)read_number(e, item, key, 0, e->plan->count - 1.0, true);
}

// A word of a list, as its value; `before` when the entry has none.
static uint32_t read_word(entry *e, const char *key, sonde_sheet_list list, uint32_t before) {
  const sonde_json *item = sonde_json_member(e->root, key);
  const char *text = sonde_json_as_text(item);
  if (!item) return before;
  for (uint32_t k = 0; text && k < SONDE_COUNT_OF(WORD[list]) && WORD[list][k]; ++k)
    if (strcmp(text, WORD[list][k]) == 0) return k;
  char known[96] = "";
  for (uint32_t k = 1; k < SONDE_COUNT_OF(WORD[list]) && WORD[list][k]; ++k)
    snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", k > 1 ? ", " : "",
             WORD[list][k]);
  refuse(e, "\"%s\" must be empty, %s", key, known);
  return before;
}

// UTF-8 without control characters but line ends; what was there stays when the entry has none.
static void read_text(entry *e, size_t most, char *to, size_t size) {
  const sonde_json *item = sonde_json_member(e->root, "text");
  const char *text = sonde_json_as_text(item);
  if (!item) return;
  size_t count = 0;
  bool plain = text != NULL;
  for (const char *c = plain ? text : ""; *c; ++c) {
    plain &= !((unsigned char)*c < 0x20 && *c != '\n') && *c != 0x7f;
    count += (*c & 0xc0) != 0x80;
  }
  if (plain && count <= most && strlen(text) < size)
    snprintf(to, size, "%s", text);
  else
    refuse(e, "\"text\" must be a text of at most %zu characters", most);
}

// Both ends of a clot; an empty list takes them back.
static void read_extent(entry *e, const char *key, sonde_sheet_extent *extent) {
  const sonde_json *list = sonde_json_member(e->root, key), *first = sonde_json_first(list);
  if (!list) return;
  const uint32_t count = sonde_json_count(list);
  if (sonde_json_kind_of(list) != SONDE_JSON_LIST || (count != 0 && count != 2)) {
    refuse(e, "\"%s\" must be a list of two places or empty", key);
    return;
  }
  *extent = (sonde_sheet_extent){SONDE_PLAN_POINTS, SONDE_PLAN_POINTS};
  if (count == 2)
    *extent =
        (sonde_sheet_extent){read_place(e, first, key), read_place(e, sonde_json_next(first), key)};
}

// Each kind of entry has members of its own; which one it is, is told by the first that it has.
typedef enum kind { HOLD, PICTURE, CHANGE, ROW, WHOLE, KINDS } kind;
static const char *const MEMBER[KINDS][9] = {
    [HOLD] = {"hold"},
    [PICTURE] = {"picture", "place", "view", "marks"},
    [CHANGE] = {"change", "place", "view", "marks", "drop"},
    [ROW] = {"place", "finding", "age", "kind", "reflux", "reflux_s", "text"},
    [WHOLE] = {"conclusion", "text", "deep", "superficial"}};

// ---- what it does

// A new picture of the image of a tick, or another label, place or calipers of one that is there.
static void enter_picture(entry *e, sonde_worksheet *sheet, sonde_sheet_look look, void *user) {
  const bool fresh = has(e, "picture");
  const sonde_json *asked = sonde_json_member(e->root, fresh ? "picture" : "change");
  const double number = read_number(e, asked, fresh ? "picture" : "change", fresh ? 0 : 1,
                                    fresh ? TICKS_MOST : UINT32_MAX, true);
  sonde_sheet_picture next = {0};
  uint32_t k = 0;
  while (!fresh && k < sheet->picture_count && sheet->picture[k].number != (uint32_t)number) ++k;
  if (!fresh && k == sheet->picture_count) refuse(e, "there is no picture of that number");
  if (fresh && sheet->picture_count == SONDE_SHEET_PICTURES)
    refuse(e, "the worksheet has %d pictures, its most", SONDE_SHEET_PICTURES);
  if (e->status) return;
  if (!fresh) next = sheet->picture[k];
  if (fresh || has(e, "place"))
    next.place = read_place(e, sonde_json_member(e->root, "place"), "place");
  const sonde_json *view = sonde_json_member(e->root, "view");
  const char *word = sonde_json_as_text(view);
  if (view && !(word && (strcmp(word, "with") == 0 || strcmp(word, "without") == 0)))
    refuse(e, "\"view\" must be with or without");
  if (view && !e->status) next.compressed = strcmp(word, "with") == 0;

  // Calipers: [[x, depth, x, depth, half of an ellipse's other axis], ...] in mm.
  const sonde_json *list = sonde_json_member(e->root, "marks"), *mark = sonde_json_first(list);
  if (list &&
      (sonde_json_kind_of(list) != SONDE_JSON_LIST || sonde_json_count(list) > SONDE_SHEET_MARKS))
    refuse(e, "\"marks\" must be a list of at most %d calipers", SONDE_SHEET_MARKS);
  if (list) next.mark_count = 0;
  for (; mark && !e->status; mark = sonde_json_next(mark)) {
    double at[5] = {0};
    const sonde_json *item = sonde_json_first(mark);
    if (sonde_json_kind_of(mark) != SONDE_JSON_LIST || sonde_json_count(mark) != 5)
      refuse(e, "a caliper must be a list of five numbers: x, depth, x, depth, half width");
    for (int n = 0; n < 5 && item; ++n, item = sonde_json_next(item))
      at[n] = 1e-3 *
              read_number(e, item, "marks", n == 4 ? 0 : -PICTURE_MOST_MM, PICTURE_MOST_MM, false);
    next.mark[next.mark_count++] = (sonde_sheet_mark){{at[0], at[1]}, {at[2], at[3]}, at[4]};
  }
  const sonde_json_kind drop = sonde_json_kind_of(sonde_json_member(e->root, "drop"));
  if (drop != SONDE_JSON_ABSENT && drop != SONDE_JSON_TRUE) refuse(e, "\"drop\" must be true");
  if (e->status) return;
  if (fresh && (!look || !look(user, (uint64_t)number, &next))) {
    refuse(e, "this picture is too old to be stored: freeze it when it is seen, or store it then");
  } else if (fresh) {
    // A picture at less than a press's force is one without compression.
    if (!has(e, "view")) next.compressed = next.force_n >= BEGIN_N;
    e->status = sonde_worksheet_store(sheet, &next, e->error);
  } else {
    sheet->picture[k] = next;
    if (drop != SONDE_JSON_TRUE) return;
    sonde_image_clear(&sheet->picture[k].image);
    sheet->picture_count--;
    memmove(&sheet->picture[k], &sheet->picture[k + 1],
            (sheet->picture_count - k) * sizeof *sheet->picture);
  }
}

sonde_status sonde_worksheet_enter(sonde_worksheet *sheet, const sonde_plan *plan, const char *json,
                                   size_t count, sonde_sheet_look look, void *user,
                                   sonde_error *error) {
  SONDE_ASSERT(sheet && plan && json && sheet->place_count == plan->count);
  sonde_json *root = NULL;
  const sonde_json_source source = {.most_depth = DEPTH};
  if (count == 0 || count > SONDE_SHEET_MESSAGE)
    return sonde_fail(error, SONDE_FORMAT, "an entry must have 1 to %d bytes, not %zu",
                      SONDE_SHEET_MESSAGE, count);
  sonde_status status = sonde_json_parse(json, count, &source, &root, error);
  if (status) return status;
  if (sonde_json_kind_of(root) != SONDE_JSON_OBJECT) {
    sonde_json_free(root);
    return sonde_fail(error, SONDE_FORMAT, "an entry must be one JSON object");
  }
  entry e = {.root = root, .plan = plan, .error = error};
  kind is = HOLD;
  while (is < WHOLE && !has(&e, MEMBER[is][0])) ++is;
  uint32_t said = 0;
  for (const sonde_json *item = sonde_json_first(root); item; item = sonde_json_next(item)) {
    const char *key = sonde_json_key(item);
    bool known = strcmp(key, "type") == 0;
    said += !known;
    for (size_t k = 0; k < SONDE_COUNT_OF(MEMBER[is]) && MEMBER[is][k] && !known; ++k)
      known = strcmp(key, MEMBER[is][k]) == 0;
    if (!known) refuse(&e, "an entry with these members has no \"%.40s\"", key);
  }
  if (said == 0) refuse(&e, "an entry must say something: \"place\", \"picture\", \"conclusion\"");
  switch (is) {
  case HOLD: {
    const sonde_json *item = sonde_json_member(root, "hold");
    const double tick = read_number(&e, item, "hold", 0, TICKS_MOST, true);
    if (!e.status && look) (void)look(user, (uint64_t)tick, NULL);
    break;
  }
  case PICTURE:
  case CHANGE: enter_picture(&e, sheet, look, user); break;
  case ROW: {
    const uint32_t place = read_place(&e, sonde_json_member(root, "place"), "place");
    const sonde_json *reflux_s = sonde_json_member(root, "reflux_s");
    sonde_sheet_row row = sheet->row[place];
    row.finding = read_word(&e, "finding", SONDE_SHEET_FINDINGS, row.finding);
    row.age = read_word(&e, "age", SONDE_SHEET_AGES, row.age);
    row.kind = read_word(&e, "kind", SONDE_SHEET_KINDS, row.kind);
    row.reflux = read_word(&e, "reflux", SONDE_SHEET_REFLUXES, row.reflux);
    if (sonde_json_kind_of(reflux_s) == SONDE_JSON_NULL)
      row.reflux_s = (double)NAN;
    else if (reflux_s)
      row.reflux_s = read_number(&e, reflux_s, "reflux_s", 0, REFLUX_MOST_S, false);
    read_text(&e, 200, row.text, sizeof row.text);
    // A finding that is no clot takes back what was said about one.
    if (row.finding != SONDE_SHEET_PARTLY && row.finding != SONDE_SHEET_NOT_COMPRESSIBLE)
      row.age = SONDE_SHEET_NO_AGE, row.kind = SONDE_SHEET_NO_KIND;
    if (!e.status) sheet->row[place] = row, sheet->written = true;
    break;
  }
  default: {
    sonde_sheet_extent deep = sheet->deep, superficial = sheet->superficial;
    char text[SONDE_SHEET_TEXT];
    memcpy(text, sheet->text, sizeof text);
    const uint32_t conclusion =
        read_word(&e, "conclusion", SONDE_SHEET_CONCLUSIONS, sheet->conclusion);
    read_text(&e, 600, text, sizeof text);
    read_extent(&e, "deep", &deep);
    read_extent(&e, "superficial", &superficial);
    if (e.status) break;
    memcpy(sheet->text, text, sizeof text);
    sheet->conclusion = conclusion, sheet->deep = deep, sheet->superficial = superficial;
    sheet->written = true;
  }
  }
  sonde_json_free(root);
  return e.status;
}
