// Plans of data sets as YAML files: a table of numbers, and lists of words.
#include "base/base.h"
#include "base/bounds.h"
#include "base/maths.h"
#include "dataset/dataset.h"
#include "files/yaml.h"
#include "sonde/trainer.h"

#include <string.h>

enum { NUMBERS = 10, WHOLES = 6, STRAIGHT = SONDE_LIMB_POSITIONS };

// Numbers of a plan, with the unit of the file.
static const sonde_parameter REALS[NUMBERS - 1] = {
    {"clot_share", "legs with a deep vein thrombosis", 1, 0, 1,
     offsetof(sonde_dataset_plan, clot_share)},
    {"station_share", "presses at a station of the limb, instead of anywhere along the vein", 1, 0,
     1, offsetof(sonde_dataset_plan, station_share)},
    {"along_share", "presses that look along the vein", 1, 0, 1,
     offsetof(sonde_dataset_plan, along_share)},
    {"contact_n", "force of a press's first frame", 1, 0.05, 10,
     offsetof(sonde_dataset_plan, contact_n)},
    {"force_low_n", "least force of a press's last frame", 1, 0.1, 100,
     offsetof(sonde_dataset_plan, force_low_n)},
    {"force_high_n", "greatest force of a press's last frame", 1, 0.1, 100,
     offsetof(sonde_dataset_plan, force_high_n)},
    {"shift_mm", "standard deviation of the probe's place, across the leg", 1e-3, 0, 40e-3,
     offsetof(sonde_dataset_plan, shift_m)},
    {"tilt_deg", "the same of its tilt, about both axes of the face", SONDE_PI / 180, 0,
     30 * SONDE_PI / 180, offsetof(sonde_dataset_plan, tilt_rad)},
    {"turn_deg", "the same of its turn about the beam", SONDE_PI / 180, 0, 90 * SONDE_PI / 180,
     offsetof(sonde_dataset_plan, turn_rad)}};

static const struct {
  const char *name;
  uint32_t low, high;
  size_t offset;
} INTEGERS[WHOLES - 1] = {{"legs", 1, 1000000, offsetof(sonde_dataset_plan, legs)},
                          {"presses", 1, 100, offsetof(sonde_dataset_plan, presses)},
                          {"frames", 1, 100, offsetof(sonde_dataset_plan, frames)},
                          {"width", 16, 2048, offsetof(sonde_dataset_plan, width)},
                          {"height", 16, 2048, offsetof(sonde_dataset_plan, height)}};

static const char *const BODIES[] = {"limbs", "bundled", NULL};

static uint32_t *integer_of(const sonde_dataset_plan *plan, size_t offset) {
  return (uint32_t *)(void *)((char *)(uintptr_t)plan + offset);
}
static double real_of(const sonde_dataset_plan *plan, const sonde_parameter *p) {
  return *(const double *)(const void *)((const char *)plan + p->offset);
}

// Words that a plan lists, each a bit.
static const struct {
  const char *name;
  uint32_t count;
  size_t offset;
} LISTS[] = {{"levels", SONDE_CASE_HARD + 1, offsetof(sonde_dataset_plan, levels)},
             {"positions", STRAIGHT + 1, offsetof(sonde_dataset_plan, positions)},
             {"arrays", SONDE_DATASET_ARRAYS, offsetof(sonde_dataset_plan, arrays)}};

static const char *word_of(size_t list, uint32_t k) {
  SONDE_ASSERT(list < SONDE_COUNT_OF(LISTS) && k < LISTS[list].count);
  return list == 0   ? sonde_case_level_name((sonde_case_level)k)
         : list == 1 ? sonde_position_key((sonde_limb_position)k)
                     : sonde_dataset_array_name(k);
}

const char *sonde_dataset_array_name(uint32_t array) {
  static const char *const NAMES[SONDE_DATASET_ARRAYS] = {
#define NAME(name, bytes, parts, text) #name,
      SONDE_DATASET_ARRAY_LIST(NAME)
#undef NAME
  };
  SONDE_ASSERT(array < SONDE_DATASET_ARRAYS);
  return NAMES[array];
}

const char *sonde_dataset_array_text(uint32_t array) {
  static const char *const TEXTS[SONDE_DATASET_ARRAYS] = {
#define TEXT(name, bytes, parts, text) text,
      SONDE_DATASET_ARRAY_LIST(TEXT)
#undef TEXT
  };
  SONDE_ASSERT(array < SONDE_DATASET_ARRAYS);
  return TEXTS[array];
}

sonde_dataset_plan sonde_dataset_plan_default(void) {
  sonde_dataset_plan plan = {
      .version = SONDE_DEF_VERSION,
      .title = "Compression ultrasound of simulated legs",
      .licence = "CC0-1.0",
      .seed = 1,
      .legs = 12,
      .presses = 4,
      .frames = 6,
      .width = 256,
      .height = 256,
      .levels = 1u << SONDE_CASE_EASY | 1u << SONDE_CASE_HARD,
      .positions = 1u << STRAIGHT | 1u << SONDE_LIMB_SUPINE_TURNED | 1u << SONDE_LIMB_PRONE_BENT,
      .arrays = (1u << SONDE_DATASET_ARRAYS) - 1,
      .scanner_count = 4,
      .scanner = {"venous", "compact", "portable", "research"},
      .clot_share = 0.5,
      .station_share = 0.3,
      .along_share = 0.15,
      .contact_n = 0.5,
      .force_low_n = 5,
      .force_high_n = 30,
      .shift_m = 4e-3,
      .tilt_rad = 4 * SONDE_PI / 180,
      .turn_rad = 6 * SONDE_PI / 180,
  };
  const sonde_echo_range *ranges = sonde_echo_ranges();
  for (int k = 0; k < SONDE_ECHO_SETTINGS; ++k) {
    const bool depth = strcmp(ranges[k].key, "depth_mm") == 0;
    const bool gain = strcmp(ranges[k].key, "gain_db") == 0;
    plan.setting[k][0] = depth ? 40 : gain ? -5 : (double)NAN;
    plan.setting[k][1] = depth ? 65 : gain ? 5 : (double)NAN;
  }
  return plan;
}

sonde_status sonde_dataset_plan_check(const sonde_dataset_plan *plan, sonde_error *error) {
  SONDE_ASSERT(plan != NULL);
  sonde_status status = sonde_def_check("a plan", plan->version, error);
  if (status) return status;
  sonde_bounded numbers[NUMBERS + WHOLES + 2 * SONDE_ECHO_SETTINGS];
  size_t count = 0;
  numbers[count++] = (sonde_bounded){"seed", (double)plan->seed, 0, UINT32_MAX};
  for (size_t k = 0; k < SONDE_COUNT_OF(INTEGERS); ++k)
    numbers[count++] = (sonde_bounded){INTEGERS[k].name, *integer_of(plan, INTEGERS[k].offset),
                                       INTEGERS[k].low, INTEGERS[k].high};
  for (size_t k = 0; k < SONDE_COUNT_OF(REALS); ++k)
    numbers[count++] = (sonde_bounded){REALS[k].name, real_of(plan, &REALS[k]) / REALS[k].unit,
                                       REALS[k].low / REALS[k].unit, REALS[k].high / REALS[k].unit};
  const sonde_echo_range *ranges = sonde_echo_ranges();
  for (int k = 0; k < 2 * SONDE_ECHO_SETTINGS; ++k) {
    const double value = plan->setting[k / 2][k % 2];
    if (!isnan(value))
      numbers[count++] =
          (sonde_bounded){ranges[k / 2].key, value, ranges[k / 2].low, ranges[k / 2].high};
  }
  status = sonde_bounded_check(numbers, count, error);
  if (status) return status;
  if (plan->force_low_n > plan->force_high_n || plan->contact_n > plan->force_low_n)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "forces of %g, %g and %g N, expected contact_n <= force_low_n <= "
                      "force_high_n",
                      plan->contact_n, plan->force_low_n, plan->force_high_n);
  for (int k = 0; k < SONDE_ECHO_SETTINGS; ++k)
    if (plan->setting[k][0] > plan->setting[k][1])
      return sonde_fail(error, SONDE_ARGUMENT, "%s from %g to %g, expected the lower one first",
                        ranges[k].key, plan->setting[k][0], plan->setting[k][1]);
  for (size_t k = 0; k < SONDE_COUNT_OF(LISTS); ++k)
    if (*integer_of(plan, LISTS[k].offset) == 0)
      return sonde_fail(error, SONDE_ARGUMENT, "an empty list of %s, expected one word or more",
                        LISTS[k].name);
  if (plan->scanner_count == 0 || plan->scanner_count > SONDE_DATASET_SCANNERS)
    return sonde_fail(error, SONDE_ARGUMENT, "%u scanners, expected 1 to %d", plan->scanner_count,
                      SONDE_DATASET_SCANNERS);
  return SONDE_OK;
}

// A list of words as bits; one that is not there leaves them.
static void read_words(sonde_reader *reader, sonde_place root, size_t list, uint32_t *bits) {
  const sonde_place at = sonde_read_find(reader, root, LISTS[list].name);
  if (!at) return;
  char known[400] = "";
  for (uint32_t k = 0; k < LISTS[list].count; ++k) {
    const size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, "%s%s", k ? ", " : "", word_of(list, k));
  }
  const uint32_t count = sonde_read_count(reader, at);
  *bits = 0;
  if (count == 0)
    sonde_reader_fail(reader, at, SONDE_FORMAT, "%s: an empty list, expected one or more of %s",
                      LISTS[list].name, known);
  for (uint32_t i = 0; i < count; ++i) {
    const sonde_place item = sonde_read_item(reader, at, i);
    const char *word = sonde_read_text_at(reader, item, LISTS[list].name);
    uint32_t k = 0;
    while (word && k < LISTS[list].count && strcmp(word, word_of(list, k)) != 0) ++k;
    if (word && k == LISTS[list].count)
      sonde_reader_fail(reader, item, SONDE_FORMAT, "%s: '%.40s', expected one of %s",
                        LISTS[list].name, word, known);
    if (word) *bits |= 1u << k;
  }
}

static void read_line(sonde_reader *reader, sonde_place root, const char *key, char *to,
                      size_t size) {
  SONDE_ASSERT(to && size > 1);
  const char *text = sonde_read_text(reader, root, key, false);
  if (text && (strlen(text) >= size || strchr(text, '\n')))
    sonde_reader_fail(reader, sonde_read_find(reader, root, key), SONDE_FORMAT,
                      "%s, expected a line of at most %zu bytes", key, size - 1);
  else if (text)
    snprintf(to, size, "%s", text);
}

static void read_scanners(sonde_reader *reader, sonde_place root, sonde_dataset_plan *plan) {
  const sonde_place at = sonde_read_find(reader, root, "scanners");
  if (at) plan->scanner_count = sonde_read_count(reader, at);
  if (plan->scanner_count == 0 || plan->scanner_count > SONDE_DATASET_SCANNERS)
    sonde_reader_fail(reader, at, SONDE_FORMAT, "%u scanners, expected 1 to %d",
                      plan->scanner_count, SONDE_DATASET_SCANNERS);
  for (uint32_t i = 0; at && i < plan->scanner_count && sonde_reader_good(reader); ++i) {
    const sonde_place item = sonde_read_item(reader, at, i);
    const char *word = sonde_read_text_at(reader, item, "scanners");
    if (word && strlen(word) >= sizeof plan->scanner[i])
      sonde_reader_fail(reader, item, SONDE_FORMAT,
                        "name of a scanner of %zu bytes, expected "
                        "at most %zu",
                        strlen(word), sizeof plan->scanner[i] - 1);
    else if (word)
      snprintf(plan->scanner[i], sizeof plan->scanner[i], "%s", word);
  }

  // A map of [low, high] for each setting; what is not there is the scanner's own.
  const sonde_place map = sonde_read_find(reader, root, "settings");
  if (!map) return;
  const sonde_echo_range *ranges = sonde_echo_ranges();
  const char *keys[SONDE_ECHO_SETTINGS + 1] = {NULL};
  for (int k = 0; k < SONDE_ECHO_SETTINGS; ++k) keys[k] = ranges[k].key;
  sonde_read_keys(reader, map, "settings", keys);
  for (int k = 0; k < SONDE_ECHO_SETTINGS; ++k) {
    plan->setting[k][0] = plan->setting[k][1] = (double)NAN;
    const sonde_place list = sonde_read_find(reader, map, ranges[k].key);
    if (!list) continue;
    if (sonde_read_count(reader, list) != 2)
      sonde_reader_fail(reader, list, SONDE_FORMAT, "%s, expected [LOW, HIGH]", ranges[k].key);
    for (uint32_t i = 0; i < 2 && sonde_reader_good(reader); ++i)
      plan->setting[k][i] = sonde_read_real_at(reader, sonde_read_item(reader, list, i),
                                               ranges[k].key, ranges[k].low, ranges[k].high);
    if (plan->setting[k][0] > plan->setting[k][1])
      sonde_reader_fail(reader, list, SONDE_FORMAT,
                        "%s from %g to %g, expected the lower one first", ranges[k].key,
                        plan->setting[k][0], plan->setting[k][1]);
  }
}

sonde_status sonde_dataset_plan_load(const char *path, sonde_dataset_plan *plan,
                                     sonde_error *error) {
  SONDE_ASSERT(path && plan);
  char *text = NULL;
  size_t length;
  sonde_reader *reader = NULL;
  *plan = sonde_dataset_plan_default();
  const char *keys[32] = {"sonde_dataset", "title",    "licence", "seed",
                          "body",          "scanners", "settings"};
  size_t known = 7;
  for (size_t k = 0; k < SONDE_COUNT_OF(INTEGERS); ++k) keys[known++] = INTEGERS[k].name;
  for (size_t k = 0; k < SONDE_COUNT_OF(REALS); ++k) keys[known++] = REALS[k].name;
  for (size_t k = 0; k < SONDE_COUNT_OF(LISTS); ++k) keys[known++] = LISTS[k].name;
  SONDE_ASSERT(known < SONDE_COUNT_OF(keys));
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_yaml, &text, &length, error);
  if (!status) status = sonde_reader_create(text, path, &reader, error);
  if (!status) {
    const sonde_place root = sonde_reader_root(reader);
    sonde_read_keys(reader, root, "a plan", keys);
    sonde_read_version(reader, root, "sonde_dataset", "plan", SONDE_DATASET_VERSION);
    read_line(reader, root, "title", plan->title, sizeof plan->title);
    read_line(reader, root, "licence", plan->licence, sizeof plan->licence);
    plan->seed = sonde_read_integer(reader, root, "seed", 0, UINT32_MAX, (uint32_t)plan->seed);
    plan->body =
        (sonde_dataset_legs)sonde_read_choice(reader, root, "body", BODIES, (int)plan->body);
    for (size_t k = 0; k < SONDE_COUNT_OF(INTEGERS); ++k) {
      uint32_t *at = integer_of(plan, INTEGERS[k].offset);
      *at = sonde_read_integer(reader, root, INTEGERS[k].name, INTEGERS[k].low, INTEGERS[k].high,
                               *at);
    }
    for (size_t k = 0; k < SONDE_COUNT_OF(REALS); ++k) {
      const sonde_parameter *p = &REALS[k];
      *sonde_parameter_of(plan, p) =
          p->unit * sonde_read_real(reader, root, p->name, p->low / p->unit, p->high / p->unit,
                                    real_of(plan, p) / p->unit);
    }
    for (size_t k = 0; k < SONDE_COUNT_OF(LISTS); ++k)
      read_words(reader, root, k, integer_of(plan, LISTS[k].offset));
    read_scanners(reader, root, plan);
    if (sonde_reader_good(reader)) {
      sonde_error why; // forces that do not rise
      const sonde_place at = sonde_read_find(reader, root, "force_low_n");
      if (sonde_dataset_plan_check(plan, &why)) sonde_reader_pass(reader, at ? at : root, &why);
    }
    status = sonde_reader_status(reader, error);
  }
  sonde_reader_destroy(reader);
  sonde_free(text);
  return status;
}

static void put_quoted(sonde_file *file, const char *key, const char *text) {
  sonde_file_printf(file, "%s\"", key);
  for (; *text; ++text)
    sonde_file_printf(file, *text == '"' || *text == '\\' ? "\\%c" : "%c", *text);
  sonde_file_printf(file, "\"\n");
}

sonde_status sonde_dataset_plan_text(const sonde_dataset_plan *plan, char **text,
                                     sonde_error *error) {
  SONDE_ASSERT(plan && text);
  sonde_file *file;
  sonde_status status = sonde_file_in_memory(&file, error);
  if (status) return status;
  sonde_file_printf(file, "sonde_dataset: %d\n", SONDE_DATASET_VERSION);
  put_quoted(file, "title: ", plan->title);
  put_quoted(file, "licence: ", plan->licence);
  sonde_file_printf(file, "seed: %llu\nbody: %s\n", (unsigned long long)plan->seed,
                    BODIES[plan->body]);
  for (size_t k = 0; k < SONDE_COUNT_OF(INTEGERS); ++k)
    sonde_file_printf(file, "%s: %u\n", INTEGERS[k].name, *integer_of(plan, INTEGERS[k].offset));
  for (size_t k = 0; k < SONDE_COUNT_OF(REALS); ++k)
    sonde_file_printf(file, "%s: %.9g\n", REALS[k].name, real_of(plan, &REALS[k]) / REALS[k].unit);
  for (size_t k = 0; k < SONDE_COUNT_OF(LISTS); ++k) {
    const char *between = "";
    sonde_file_printf(file, "%s: [", LISTS[k].name);
    for (uint32_t i = 0; i < LISTS[k].count; ++i) {
      if (!(*integer_of(plan, LISTS[k].offset) >> i & 1)) continue;
      sonde_file_printf(file, "%s%s", between, word_of(k, i));
      between = ", ";
    }
    sonde_file_printf(file, "]\n");
  }
  sonde_file_printf(file, "scanners:\n");
  for (uint32_t k = 0; k < plan->scanner_count; ++k) put_quoted(file, "  - ", plan->scanner[k]);
  const char *before = "settings: {";
  for (int k = 0; k < SONDE_ECHO_SETTINGS; ++k) {
    if (isnan(plan->setting[k][0])) continue;
    sonde_file_printf(file, "%s%s: [%.9g, %.9g]", before, sonde_echo_ranges()[k].key,
                      plan->setting[k][0], plan->setting[k][1]);
    before = ", ";
  }
  sonde_file_printf(file, "%s}\n", *before == ',' ? "" : before);
  size_t count;
  return sonde_file_take(file, text, &count, error);
}
