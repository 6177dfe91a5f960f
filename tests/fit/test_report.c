// The report of an estimation as JSON: its numbers keep the laws of what they name, in their units,
// reproducible, and the file is whole or absent. tests/web/report_test.mjs reads what a browser
// makes of it.
#include "base/random.h"
#include "fixture.h"
#include "sonde/base_json.h"
#include "sonde/fit_report.h"

#include <dirent.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

enum { SITES = 13, DEPTHS = 6, ROWS = SITES * DEPTHS * 2, NAMES = 3, PROFILE = 9 };
#define NASTY "<b>&\"'\x01\xff"

static struct {
  sonde_model *model;
  sonde_site site[SITES];
  double fat_m[SITES];
  sonde_site_table sites;
  sonde_datum datum[ROWS];
  sonde_vec3 position_m[ROWS], normal[ROWS];
  sonde_measurements data;
  double forces[2][ROWS], band_n[ROWS], correlation[NAMES * NAMES], x[PROFILE], rise[PROFILE];
  sonde_report_stage stages[2];
  sonde_report_site site_parameters[SITES];
} made;

static const sonde_report_parameter PARAMETERS[] = {
    {NASTY, "N/m", {25, 20, 30, NAN, NAN}, NASTY},
    {"limit", NULL, {0.9, NAN, NAN, NAN, NAN}, NULL}};
static const char *const LABELS[NAMES] = {NASTY, "ln gm", NULL};
static const sonde_report_identifiability IDENTIFIABILITY[] = {
    {"G", "point only", 0.4}, {"G", "both", 0.05}, {NASTY, NASTY, INFINITY}};
static const sonde_report_holdout HOLDOUTS[] = {{NASTY, NASTY, 0.1, 0.2, 3, 2},
                                                {"fold", NULL, NAN, 0.2, 3, NAN}};
static const sonde_report_timing TIMINGS[] = {{NASTY, 1.5}, {"rest", 2}};
static const char *const NOTES[] = {NASTY};

static void make_sites(void) {
  for (uint32_t s = 0; s < SITES; ++s) {
    sonde_vec3 n = v_unit(vec3(1, 0.1 * (s % 4), 0.15 * (s / 4.0)), vec3(1, 0, 0));
    made.site[s] = (sonde_site){.id = 3 * s,
                                .position_m = v_scale(n, FIXTURE_RADIUS_M),
                                .normal = n,
                                .v = {0, 0, 1},
                                .k0_n_m3 = 1e5 + 1e3 * s,
                                .xm_m = 0.05};
    made.fat_m[s] = 0.01 + 1e-4 * s;
    made.site_parameters[s] = (sonde_report_site){3 * s,
                                                  {1e5 + 1e3 * s, 9e4, 1.2e5, NAN, NAN},
                                                  {0.05, 0.04, INFINITY, 0.045, 0.06},
                                                  {15 + 0.1 * s, 14, 18, NAN, NAN},
                                                  {1.1, 1, 1.2, NAN, NAN}};
  }
  made.sites = (sonde_site_table){SITES, made.site, made.fat_m};
}

// Forces that stiffen; the model errs by a few per cent and lacks the last one.
static void make_rows(void) {
  for (uint32_t i = 0; i < ROWS; ++i) {
    uint32_t s = i / (2 * DEPTHS), probe = i / DEPTHS % 2;
    double depth_mm = 2 + 2 * (i % DEPTHS);
    double force_n = (1 + probe) * depth_mm * (1 + 0.02 * s) / (1 - depth_mm / 50);
    made.datum[i] =
        (sonde_datum){.site = 3 * s, .penetration_m = 1e-3 * depth_mm, .force_n = force_n};
    snprintf(made.datum[i].probe, 24, "%s", probe ? "probe " NASTY : "point");
    made.position_m[i] = made.site[s].position_m;
    made.normal[i] = made.site[s].normal;
    for (uint64_t k = 0; k < 2; ++k)
      made.forces[k][i] = force_n * (1 + 0.03 * sonde_random_normal(k, i));
    made.band_n[i] = 0.05 * force_n;
  }
  made.forces[1][ROWS - 1] = NAN;
  made.data = (sonde_measurements){
      .count = ROWS, .data = made.datum, .position_m = made.position_m, .normal = made.normal};
  made.stages[0] = (sonde_report_stage){"stage 1 " NASTY, 26, made.forces[0], false};
  made.stages[1] = (sonde_report_stage){"stage 3", 28, made.forces[1], true};
}

static sonde_report_profile profile;

static int make(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  made.model = fixture_model(3, &law);
  made.model->k0_n_m3[5] = NAN; // a hole in a map, not in its numbers
  make_sites();
  make_rows();
  for (int i = 0; i < NAMES * NAMES; ++i) made.correlation[i] = i % (NAMES + 1) ? 0.3 - 0.1 * i : 1;
  made.correlation[1] = NAN;
  for (int i = 0; i < PROFILE; ++i) {
    made.x[i] = 20 + i;
    made.rise[i] = 0.9 * (i - 4) * (i - 4);
  }
  made.rise[0] = NAN;
  profile = (sonde_report_profile){NASTY, "N/m", PROFILE, made.x, made.rise, made.rise, 24, 0};
  return 0;
}

static int unmake(void **state) {
  (void)state;
  sonde_model_destroy(made.model);
  return 0;
}

static sonde_fit_report everything(void) {
  return (sonde_fit_report){.title = "Report " NASTY,
                            .provenance = "synthetic data " NASTY,
                            .command_line = "sonde fit " NASTY,
                            .version = NASTY,
                            .date = NASTY,
                            .model = made.model,
                            .sites = &made.sites,
                            .data = &made.data,
                            .stages = made.stages,
                            .stage_count = 2,
                            .band_n = made.band_n,
                            .parameters = PARAMETERS,
                            .parameter_count = SONDE_COUNT_OF(PARAMETERS),
                            .site_parameters = made.site_parameters,
                            .site_parameter_count = SITES,
                            .correlation_names = LABELS,
                            .correlation = made.correlation,
                            .correlation_count = NAMES,
                            .profiles = &profile,
                            .profile_count = 1,
                            .identifiability = IDENTIFIABILITY,
                            .identifiability_count = SONDE_COUNT_OF(IDENTIFIABILITY),
                            .holdouts = HOLDOUTS,
                            .holdout_count = SONDE_COUNT_OF(HOLDOUTS),
                            .timings = TIMINGS,
                            .timing_count = SONDE_COUNT_OF(TIMINGS),
                            .notes = NOTES,
                            .note_count = SONDE_COUNT_OF(NOTES)};
}

// ---- directories --------------------------------------------------------------------------------

static const char *directory_of(const char *name) {
  static char path[300];
  snprintf(path, sizeof path, "%s/report_test_%s_%d", SONDE_BINARY_DIR, name, (int)getpid());
  return path;
}

// Calls what for every file; returns how many there were.
static int each_file(const char *directory, void (*what)(const char *path)) {
  DIR *open = opendir(directory);
  int count = 0;
  for (struct dirent *entry; open && (entry = readdir(open));) {
    if (entry->d_name[0] == '.') continue;
    char path[600];
    snprintf(path, sizeof path, "%s/%s", directory, entry->d_name);
    ++count;
    what(path);
  }
  if (open) closedir(open);
  return count;
}

static void remove_file(const char *path) {
  if (unlink(path)) rmdir(path);
}

static void remove_directory(const char *directory) {
  each_file(directory, remove_file);
  rmdir(directory);
}

static char *load(const char *path) {
  char *bytes;
  size_t count;
  sonde_error error;
  if (sonde_file_load(path, &bytes, &count, &error)) fail_msg("%s", error.message);
  assert_int_equal(strlen(bytes), count);
  return bytes;
}

static char *write_page(const sonde_fit_report *report, const char *directory) {
  sonde_error error;
  char path[600];
  if (sonde_fit_report_write(report, directory, &error)) fail_msg("%s", error.message);
  snprintf(path, sizeof path, "%s/index.html", directory);
  return load(path);
}

// The data of the report, written and read back; the directory is removed.
static sonde_json *data_of(const sonde_fit_report *report, const char *name) {
  static const char BEGIN[] = "id=\"report\">";
  const char *directory = directory_of(name);
  char *page = write_page(report, directory);
  const char *from = strstr(page, BEGIN) + sizeof BEGIN - 1, *to = strstr(from, "</script>");
  sonde_json *root;
  sonde_error error;
  if (sonde_json_parse(from, (size_t)(to - from), NULL, &root, &error))
    fail_msg("%s", error.message);
  sonde_free(page);
  remove_directory(directory);
  return root;
}

static const sonde_json *at(const sonde_json *root, const char *path) { // "errors.all.mae_n"
  char names[100], *state = NULL;
  snprintf(names, sizeof names, "%s", path);
  for (char *name = strtok_r(names, ".", &state); name; name = strtok_r(NULL, ".", &state))
    root = sonde_json_member(root, name);
  return root;
}

static double number(const sonde_json *root, const char *path) {
  return sonde_json_as_number(at(root, path));
}

static double sum_of(const sonde_json *list) {
  double sum = 0;
  for (const sonde_json *v = sonde_json_first(list); v; v = sonde_json_next(v))
    sum += sonde_json_as_number(v);
  return sum;
}

// Of a member of each object in the list; nulls count nothing.
static double sum_members(const sonde_json *list, const char *name) {
  double sum = 0;
  for (const sonde_json *v = sonde_json_first(list); v; v = sonde_json_next(v))
    if (sonde_json_kind_of(v) == SONDE_JSON_OBJECT) sum += number(v, name);
  return sum;
}

// ---- tests --------------------------------------------------------------------------------------

static void texts_come_back(void **state) {
  (void)state;
  sonde_fit_report report = everything();
  sonde_json *root = data_of(&report, "texts");
  assert_string_equal(sonde_json_as_text(at(root, "kind")), "fit");
  assert_string_equal(sonde_json_as_text(at(root, "title")), "Report <b>&\"'\x01\ufffd");
  assert_string_equal(sonde_json_as_text(at(root, "command_line")), "sonde fit <b>&\"'\x01\ufffd");
  assert_string_equal(sonde_json_as_text(sonde_json_first(at(root, "probes"))), "point");
  assert_int_equal(sonde_json_kind_of(at(root, "synthetic")), SONDE_JSON_TRUE);
  sonde_json_free(root);
}

// Every measurement with a force of the model is counted once by probe, by depth, by site and by
// bar.
static void counts_add_up(void **state) {
  (void)state;
  sonde_fit_report report = everything();
  sonde_json *root = data_of(&report, "counts");
  double all = number(root, "errors.all.count");
  assert_near(all, ROWS - 1, 0);
  assert_near(sum_members(at(root, "errors.probes"), "count"), all, 0);
  assert_near(sum_members(at(root, "errors.sites"), "count"), all, 0);
  double by_depth = 0;
  for (const sonde_json *d = sonde_json_first(at(root, "errors.depths")); d; d = sonde_json_next(d))
    by_depth += sum_members(at(d, "probes"), "count");
  assert_near(by_depth, all, 0);
  assert_near(sum_of(at(root, "errors.histogram.count")) + number(root, "errors.histogram.outside"),
              all, 0);
  const sonde_json *stage = sonde_json_next(sonde_json_first(at(root, "stages")));
  assert_near(number(stage, "missing"), 1, 0);
  assert_int_equal(sonde_json_kind_of(at(stage, "main")), SONDE_JSON_TRUE);
  sonde_json_free(root);
}

// Errors of a quarter of a newton, up and down by turns.
static void statistics_are_those_of_the_errors(void **state) {
  (void)state;
  sonde_fit_report report = everything();
  double model_n[ROWS], force_n = 0;
  for (int i = 0; i < ROWS; ++i) {
    model_n[i] = made.datum[i].force_n + (i % 2 ? 0.25 : -0.25);
    force_n += made.datum[i].force_n;
  }
  sonde_report_stage stage = {"alternating", 0, model_n, false};
  report.stages = &stage;
  report.stage_count = 1;
  sonde_json *root = data_of(&report, "numbers");
  static const char *const QUARTERS[] = {"mae_n",        "sd_n",      "rmse_n",
                                         "median_abs_n", "p95_abs_n", "max_abs_n"};
  const sonde_json *all = at(root, "errors.all");
  for (size_t i = 0; i < SONDE_COUNT_OF(QUARTERS); ++i)
    assert_near(number(all, QUARTERS[i]), 0.25, 1e-8);
  assert_near(number(all, "bias_n"), 0, 1e-8);
  assert_near(number(all, "bias_percent"), 0, 1e-6);
  assert_near(number(all, "percent_of_mean"), 100 * 0.25 * ROWS / force_n, 1e-5);
  assert_near(number(sonde_json_first(at(root, "stages")), "missing"), 0, 0);
  sonde_json_free(root);
}

// The model is 3 % too stiff everywhere: every bias and every quartile is 3 %, at each depth and
// site.
static void relative_errors_are_relative(void **state) {
  (void)state;
  sonde_fit_report report = everything();
  double model_n[ROWS];
  for (int i = 0; i < ROWS; ++i) model_n[i] = 1.03 * made.datum[i].force_n;
  sonde_report_stage stage = {"stiff", 0, model_n, true};
  report.stages = &stage;
  report.stage_count = 1;
  sonde_json *root = data_of(&report, "relative");
  static const char *const SHARES[] = {"bias_percent", "low_percent", "high_percent",
                                       "percent_of_mean"};
  int seen = 0;
  for (const sonde_json *d = sonde_json_first(at(root, "errors.depths")); d; d = sonde_json_next(d))
    for (const sonde_json *p = sonde_json_first(at(d, "probes")); p; p = sonde_json_next(p))
      for (size_t k = 0; k < SONDE_COUNT_OF(SHARES) && sonde_json_kind_of(p) == SONDE_JSON_OBJECT;
           ++k, ++seen)
        assert_near(number(p, SHARES[k]), 3, 1e-5);
  assert_int_equal(seen, 2 * DEPTHS * (int)SONDE_COUNT_OF(SHARES));
  for (const sonde_json *s = sonde_json_first(at(root, "errors.sites")); s; s = sonde_json_next(s))
    assert_near(number(s, "bias_percent"), 3, 1e-5);
  sonde_json_free(root);
}

// Lengths in mm, stiffness in kPa/mm: 1 kPa/mm is 1e6 N/m^3.
static void units_are_those_of_the_keys(void **state) {
  (void)state;
  sonde_fit_report report = everything();
  sonde_json *root = data_of(&report, "units");
  const sonde_mesh *skin = &made.model->surface;
  assert_near(sonde_json_count(at(root, "skin.position_mm")), 3 * skin->vertex_count, 0);
  assert_near(sonde_json_count(at(root, "skin.face")), 3 * skin->face_count, 0);
  const sonde_json *p = sonde_json_first(at(root, "skin.position_mm"));
  double x = sonde_json_as_number(p), y = sonde_json_as_number(sonde_json_next(p));
  double z = sonde_json_as_number(sonde_json_next(sonde_json_next(p)));
  assert_near(sqrt(x * x + y * y + z * z), 1e3 * FIXTURE_RADIUS_M, 0.02);
  const sonde_json *site = sonde_json_first(at(root, "site_parameters"));
  assert_near(number(site, "k0_kpa_mm.value"), 0.1, 1e-9);
  assert_near(number(site, "xm_mm.value"), 50, 1e-9);
  assert_near(number(site, "shear_n_m.upper"), 18, 1e-9);
  assert_int_equal(sonde_json_kind_of(at(site, "xm_mm.upper")), SONDE_JSON_NULL); // open
  assert_near(number(sonde_json_first(at(root, "sites")), "fat_mm"), 10, 1e-9);
  assert_near(sonde_json_as_number(sonde_json_first(at(root, "rows.depth_mm"))), 2, 1e-9);
  // k0 at node 5 is not a number: null, and the others stay.
  const sonde_json *k0 = sonde_json_first(at(root, "skin.k0_kpa_mm"));
  for (int i = 0; i < 5; ++i) k0 = sonde_json_next(k0);
  assert_int_equal(sonde_json_kind_of(k0), SONDE_JSON_NULL);
  assert_near(sonde_json_as_number(sonde_json_next(k0)), 1e-6 * made.model->k0_n_m3[6], 1e-5);
  sonde_json_free(root);
}

// Fat, k0 and xm of the sites: the first two grow together, the third is the same everywhere.
static void fat_is_correlated(void **state) {
  (void)state;
  sonde_fit_report report = everything();
  sonde_model with_sites = *made.model;
  with_sites.sites = made.site;
  with_sites.site_count = SITES;
  report.model = &with_sites;
  sonde_json *root = data_of(&report, "fat");
  assert_near(number(root, "skin.fat_correlates_with_k0"), 1, 1e-6);
  assert_int_equal(sonde_json_kind_of(at(root, "skin.fat_correlates_with_xm")), SONDE_JSON_NULL);
  sonde_json_free(root);
}

// The profile is 0.9 (x - 24)^2 on whole numbers: linear between them it crosses 3.841 at 24
// -+ 2.054.
static void profiles_are_bounded_at_the_threshold(void **state) {
  (void)state;
  sonde_fit_report report = everything();
  sonde_json *root = data_of(&report, "profile");
  const sonde_json *p = sonde_json_first(at(root, "profiles"));
  double beyond = 2 + (number(p, "threshold") - 3.6) / (8.1 - 3.6);
  assert_near(number(p, "threshold"), 3.841458821, 1e-8);
  assert_near(number(p, "upper"), 24 + beyond, 1e-6);
  assert_near(number(p, "lower"), 24 - beyond, 1e-6);
  sonde_json_free(root);
}

// A distribution expects no more than all errors within the bars, and nearly all of them.
static void distributions_are_shares(void **state) {
  (void)state;
  sonde_fit_report report = everything();
  sonde_json *root = data_of(&report, "shares");
  const sonde_json *h = at(root, "errors.histogram");
  uint32_t bars = sonde_json_count(at(h, "count")), fitted = 0;
  for (const sonde_json *d = sonde_json_first(at(h, "distributions")); d; d = sonde_json_next(d)) {
    uint32_t points = sonde_json_count(at(d, "share_per_bar"));
    double share = sum_of(at(d, "share_per_bar")) * bars / (points - 1);
    if (share < 0.85 || share > 1.02) fail_msg("%s: %g", sonde_json_as_text(at(d, "name")), share);
    ++fitted;
  }
  assert_int_equal(fitted, 3);
  sonde_json_free(root);
}

static bool has(const sonde_json *root, const char *name) {
  const sonde_json *value = sonde_json_member(root, name);
  sonde_json_kind kind = sonde_json_kind_of(value);
  return kind != SONDE_JSON_ABSENT && (kind != SONDE_JSON_LIST || sonde_json_count(value) > 0);
}

// Without a part its values are gone, and the others stay.
static void missing_parts_leave_nothing(void **state) {
  (void)state;
  static const char *const NAMES_OF[] = {"stages",      "errors",     "rows",
                                         "skin",        "parameters", "site_parameters",
                                         "correlation", "profiles",   "identifiability",
                                         "holdouts",    "timings",    "sites"};
  enum { PARTS = 9 };
  for (int part = -1; part < PARTS; ++part) {
    sonde_fit_report r = everything();
    unsigned gone = 0; // bits of NAMES_OF
    if (part == 0) r.stage_count = 0, r.band_n = NULL, gone = 1u << 0 | 1u << 1;
    if (part == 1) r.model = NULL, gone = 1u << 3;
    if (part == 2) r.parameter_count = r.site_parameter_count = 0, gone = 1u << 4 | 1u << 5;
    if (part == 3) r.correlation_count = 0, gone = 1u << 6;
    if (part == 4) r.profile_count = 0, gone = 1u << 7;
    if (part == 5) r.identifiability_count = 0, gone = 1u << 8;
    if (part == 6) r.holdout_count = 0, gone = 1u << 9;
    if (part == 7) r.timing_count = 0, gone = 1u << 10;
    if (part == 8) r.data = NULL, r.stage_count = 0, r.band_n = NULL, gone = 7;
    sonde_json *root = data_of(&r, "parts");
    for (size_t i = 0; i < SONDE_COUNT_OF(NAMES_OF); ++i)
      if (has(root, NAMES_OF[i]) == (gone >> i & 1)) fail_msg("part %d: %s", part, NAMES_OF[i]);
    sonde_json_free(root);
  }
}

static void empty_report_is_a_page(void **state) {
  (void)state;
  sonde_fit_report report = {0};
  sonde_json *root = data_of(&report, "empty");
  static const char *const ABSENT[] = {"title",  "model", "date",   "rows",  "stages",
                                       "errors", "skin",  "probes", "sites", "notes"};
  for (size_t i = 0; i < SONDE_COUNT_OF(ABSENT); ++i) assert_false(has(root, ABSENT[i]));
  assert_int_equal(sonde_json_kind_of(at(root, "synthetic")), SONDE_JSON_FALSE);
  sonde_json_free(root);
}

static uint64_t hash;
static void hash_file(const char *path) {
  char *bytes = load(path);
  // Added up, because directories list their files in any order.
  hash += sonde_hash(sonde_hash(0, bytes, strlen(bytes)), strrchr(path, '/'), 6);
  sonde_free(bytes);
}

static void equal_reports_give_equal_bytes(void **state) {
  (void)state;
  const char *directory = directory_of("equal");
  sonde_fit_report report = everything();
  uint64_t hashes[2];
  for (int i = 0; i < 2; ++i) {
    sonde_free(write_page(&report, directory)); // the second time over the first
    hash = 0;
    each_file(directory, hash_file);
    hashes[i] = hash;
  }
  assert_true(hashes[0] == hashes[1] && hashes[0] != 0);
  made.forces[1][7] += 0.5;
  sonde_free(write_page(&report, directory));
  hash = 0;
  each_file(directory, hash_file);
  made.forces[1][7] -= 0.5;
  assert_true(hash != hashes[0]);
  remove_directory(directory);
}

// One row, no force at all, a model without forces, eight probes: pages all the same.
static void odd_data_still_give_a_page(void **state) {
  (void)state;
  sonde_datum datum[SONDE_FIT_PROBES] = {0};
  double forces[SONDE_FIT_PROBES] = {0};
  for (int odd = 0; odd < 5; ++odd) {
    uint32_t rows = odd == 1 ? SONDE_FIT_PROBES : odd == 4 ? 0 : 1;
    for (int i = 0; i < SONDE_FIT_PROBES; ++i) {
      snprintf(datum[i].probe, 24, "probe %d", i);
      datum[i].penetration_m = odd == 2 ? 0 : 0.9;
      datum[i].force_n = odd == 3 ? -1e5 : 0;
      forces[i] = odd == 0 ? NAN : odd == 3 ? 1e300 : 0;
    }
    sonde_report_stage stage = {"odd", 1, forces, true};
    sonde_measurements data = {
        .count = rows, .data = datum, .position_m = made.position_m, .normal = made.normal};
    sonde_fit_report report = {.data = &data, .stages = &stage, .stage_count = 1, .band_n = forces};
    sonde_json_free(data_of(&report, "odd"));
  }
}

static void assert_refused(const sonde_fit_report *report, const char *part) {
  sonde_error error = {0};
  const char *directory = directory_of("refused");
  assert_int_equal(sonde_fit_report_write(report, directory, &error), SONDE_ARGUMENT);
  if (!strstr(error.message, part)) fail_msg("'%s' does not say '%s'", error.message, part);
  assert_int_not_equal(access(directory, F_OK), 0);
}

static void bad_reports_are_refused(void **state) {
  (void)state;
  sonde_fit_report r = everything();
  r.stage_count = SONDE_REPORT_STAGES + 1;
  assert_refused(&r, "stages");
  r = everything();
  r.data = NULL;
  assert_refused(&r, "without measurements");
  r = everything();
  r.stage_count = 0;
  assert_refused(&r, "band");
  sonde_report_stage nameless = {NULL, 0, made.forces[0], true};
  r = everything();
  r.stages = &nameless;
  r.stage_count = 1;
  assert_refused(&r, "stage 0");
  r = everything();
  made.datum[5].force_n = NAN;
  assert_refused(&r, "measurement 5");
  make_rows();
  sonde_datum many[SONDE_FIT_PROBES + 1] = {0};
  for (int i = 0; i <= SONDE_FIT_PROBES; ++i) snprintf(many[i].probe, 24, "p%d", i);
  sonde_measurements data = {.count = SONDE_FIT_PROBES + 1,
                             .data = many,
                             .position_m = made.position_m,
                             .normal = made.normal};
  r = (sonde_fit_report){.data = &data};
  assert_refused(&r, "more than 8 probes");
}

static int halves;
static void count_half(const char *path) { halves += strstr(path, ".part-") != NULL; }

// A directory stands where the page should be: the page cannot appear, and no part of it stays.
static void failed_write_leaves_no_half_file(void **state) {
  (void)state;
  const char *directory = directory_of("failed");
  char blocked[600];
  sonde_error error = {0};
  sonde_fit_report report = everything();
  snprintf(blocked, sizeof blocked, "%s/index.html", directory);
  assert_int_equal(mkdir(directory, 0777), 0);
  assert_int_equal(mkdir(blocked, 0777), 0);
  assert_int_equal(sonde_fit_report_write(&report, directory, &error), SONDE_IO);
  assert_non_null(strstr(error.message, "index.html"));
  halves = 0;
  each_file(directory, count_half);
  assert_int_equal(halves, 0);
  remove_directory(directory);
}

static void impossible_directories_are_named(void **state) {
  (void)state;
  sonde_error error = {0};
  sonde_fit_report report = {0};
  assert_int_equal(sonde_fit_report_write(&report, "/nonexistent/a/b", &error), SONDE_IO);
  assert_non_null(strstr(error.message, "/nonexistent/a/b"));
  const char *file = directory_of("file");
  FILE *stream = fopen(file, "wb");
  assert_non_null(stream);
  fclose(stream);
  assert_int_equal(sonde_fit_report_write(&report, file, &error), SONDE_IO);
  assert_non_null(strstr(error.message, file));
  unlink(file);
}

static size_t calls, fail_at;
static long alive;
static void *counting(size_t bytes, void *user) {
  (void)user;
  if (++calls == fail_at) return NULL;
  ++alive;
  return malloc(bytes);
}
static void releasing(void *pointer, void *user) {
  (void)user;
  --alive;
  free(pointer);
}

static void lack_of_memory_is_reported(void **state) {
  (void)state;
  const char *directory = directory_of("memory");
  sonde_fit_report report = everything();
  sonde_status status = SONDE_MEMORY;
  int failures = 0;
  sonde_set_allocator(&(sonde_allocator){counting, releasing, NULL});
  for (size_t n = 1; status && n < 100000; ++n) {
    calls = 0;
    alive = 0;
    fail_at = n;
    status = sonde_fit_report_write(&report, directory, NULL);
    assert_true(status == SONDE_OK || status == SONDE_MEMORY);
    assert_int_equal(alive, 0);
    failures += status == SONDE_MEMORY;
    halves = 0;
    each_file(directory, count_half);
    assert_int_equal(halves, 0);
  }
  sonde_set_allocator(NULL);
  assert_int_equal(status, SONDE_OK);
  assert_true(failures > 40);
  remove_directory(directory);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(texts_come_back),
      cmocka_unit_test(counts_add_up),
      cmocka_unit_test(statistics_are_those_of_the_errors),
      cmocka_unit_test(relative_errors_are_relative),
      cmocka_unit_test(units_are_those_of_the_keys),
      cmocka_unit_test(fat_is_correlated),
      cmocka_unit_test(profiles_are_bounded_at_the_threshold),
      cmocka_unit_test(distributions_are_shares),
      cmocka_unit_test(missing_parts_leave_nothing),
      cmocka_unit_test(empty_report_is_a_page),
      cmocka_unit_test(equal_reports_give_equal_bytes),
      cmocka_unit_test(odd_data_still_give_a_page),
      cmocka_unit_test(bad_reports_are_refused),
      cmocka_unit_test(failed_write_leaves_no_half_file),
      cmocka_unit_test(impossible_directories_are_named),
      cmocka_unit_test(lack_of_memory_is_reported),
  };
  return cmocka_run_group_tests(tests, make, unmake);
}
