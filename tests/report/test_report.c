// The page and its figures: well-formed, self-contained, escaped, reproducible, whole or absent.
#include "base/random.h"
#include "fixture.h"
#include "sonde/report.h"

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

// ---- a small checker of well-formedness ---------------------------------------------------------

static const char *check_attributes(const char *p, const char *path) {
  while (*p != '>' && *p != '/') {
    p += strspn(p, " \n");
    size_t name = strcspn(p, "=<> \n");
    if (p[name] != '=' || (p[name + 1] != '"' && p[name + 1] != '\'') || !name)
      fail_msg("%s: attribute at '%.40s'", path, p);
    char quote[] = {p[name + 1], '<', 0};
    p += name + 2;
    size_t value = strcspn(p, quote);
    if (p[value] != quote[0]) fail_msg("%s: value at '%.40s'", path, p);
    char text[64];
    snprintf(text, sizeof text, "%.*s", (int)(value < 60 ? value : 60), p);
    if (strstr(text, "nan") || strstr(text, "inf")) fail_msg("%s: number '%s'", path, text);
    p += value + 1;
    p += strspn(p, " \n");
  }
  return p;
}

static void check_entity(const char *p, const char *path) {
  static const char *const KNOWN[] = {"&lt;", "&gt;", "&amp;", "&quot;", "&#39;"};
  for (size_t i = 0; i < SONDE_COUNT_OF(KNOWN); ++i)
    if (strncmp(p, KNOWN[i], strlen(KNOWN[i])) == 0) return;
  fail_msg("%s: stray & at '%.20s'", path, p);
}

static void check_file(const char *path) {
  enum { DEEP = 32 };
  char *bytes = load(path), names[DEEP][24];
  int depth = 0, elements = 0;
  const char *p = bytes;
  if (strncmp(p, "<?xml", 5) == 0 || strncmp(p, "<!DOC", 5) == 0) p += strcspn(p, ">") + 1;
  for (; *p; ++p) {
    if ((unsigned char)*p < 0x20 && *p != '\n') fail_msg("%s: control character", path);
    if (*p == '&') check_entity(p, path);
    if (*p != '<') continue;
    bool end = p[1] == '/';
    size_t length = strcspn(p + 1 + end, " />\n");
    char name[24];
    assert_true(length > 0 && length < sizeof name);
    snprintf(name, sizeof name, "%.*s", (int)length, p + 1 + end);
    p = end ? p + 2 + length : check_attributes(p + 1 + length, path);
    if (end) {
      if (depth == 0 || strcmp(names[depth - 1], name) != 0) fail_msg("%s: </%s>", path, name);
      --depth;
    } else if (*p != '/') {
      assert_true(depth < DEEP);
      memcpy(names[depth++], name, sizeof name);
    } else {
      ++p;
    }
    ++elements;
    assert_int_equal(*p, '>');
  }
  assert_int_equal(depth, 0);
  assert_true(elements > 5);
  sonde_free(bytes);
}

// ---- tests --------------------------------------------------------------------------------------

static void files_are_well_formed(void **state) {
  (void)state;
  const char *directory = directory_of("full");
  sonde_fit_report report = everything();
  char *page = write_page(&report, directory);
  assert_int_equal(each_file(directory, check_file), 14); // 13 figures and the page
  assert_null(strstr(page, "<b>&"));
  assert_null(strstr(page, "\x01"));
  assert_non_null(strstr(page, "&lt;b&gt;&amp;&quot;&#39;\ufffd\ufffd"));
  assert_non_null(strstr(page, "The data are synthetic"));
  sonde_free(page);
  remove_directory(directory);
}

static void page_needs_nothing_else(void **state) {
  (void)state;
  static const char *const FOREIGN[] = {"<script", "<link", "src=",    "@import",
                                        "url(",    "<img",  "<iframe", "https:"};
  const char *directory = directory_of("self");
  sonde_fit_report report = everything();
  char *page = write_page(&report, directory);
  for (size_t i = 0; i < SONDE_COUNT_OF(FOREIGN); ++i) assert_null(strstr(page, FOREIGN[i]));
  for (const char *p = page; (p = strstr(p, "http:")); ++p)
    assert_int_equal(strncmp(p, "http://www.w3.org/2000/svg", 26), 0);
  sonde_free(page);
  remove_directory(directory);
}

static bool has_section(const char *page, const char *id) {
  char text[64];
  snprintf(text, sizeof text, "<section id=\"%s\"", id);
  bool section = strstr(page, text) != NULL;
  snprintf(text, sizeof text, "href=\"#%s\"", id);
  assert_int_equal(section, strstr(page, text) != NULL);
  return section;
}

// Without a part its section is gone, link and all, and the others stay.
static void missing_parts_leave_nothing(void **state) {
  (void)state;
  static const char *const IDS[] = {
      "summary",    "stages",      "curves",   "errors",          "tables",  "maps",
      "parameters", "correlation", "profiles", "identifiability", "holdout", "timing"};
  enum { PARTS = 9 };
  const char *directory = directory_of("parts");
  for (int part = -1; part < PARTS; ++part) {
    sonde_fit_report r = everything();
    unsigned gone = 0; // bits of IDS
    if (part == 0) r.stage_count = 0, r.band_n = NULL, gone = 1u << 0 | 1u << 1 | 1u << 3 | 1u << 4;
    if (part == 1) r.model = NULL, gone = 1u << 5;
    if (part == 2) r.parameter_count = r.site_parameter_count = 0, gone = 1u << 6;
    if (part == 3) r.correlation_count = 0, gone = 1u << 7;
    if (part == 4) r.profile_count = 0, gone = 1u << 8;
    if (part == 5) r.identifiability_count = 0, gone = 1u << 9;
    if (part == 6) r.holdout_count = 0, gone = 1u << 10;
    if (part == 7) r.timing_count = 0, gone = 1u << 11;
    if (part == 8) r.data = NULL, r.stage_count = 0, r.band_n = NULL, gone = 0x1f;
    char *page = write_page(&r, directory);
    for (size_t i = 0; i < SONDE_COUNT_OF(IDS); ++i)
      assert_int_equal(has_section(page, IDS[i]), !(gone >> i & 1));
    each_file(directory, check_file);
    sonde_free(page);
    remove_directory(directory);
  }
}

static void empty_report_is_a_page(void **state) {
  (void)state;
  const char *directory = directory_of("empty");
  sonde_fit_report report = {0};
  char *page = write_page(&report, directory);
  assert_null(strstr(page, "<section"));
  assert_null(strstr(page, "<nav"));
  assert_null(strstr(page, "<dl"));
  assert_null(strstr(page, "synthetic"));
  assert_int_equal(each_file(directory, check_file), 1);
  sonde_free(page);
  remove_directory(directory);
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

// The numbers of the summary are those of the statistics.
static void summary_tells_the_statistics(void **state) {
  (void)state;
  const char *directory = directory_of("numbers");
  sonde_fit_report report = everything();
  double zero[ROWS];
  for (int i = 0; i < ROWS; ++i) zero[i] = made.datum[i].force_n + (i % 2 ? 0.25 : -0.25);
  sonde_report_stage stage = {"alternating", 0, zero, false};
  report.stages = &stage;
  report.stage_count = 1;
  char *page = write_page(&report, directory);
  assert_non_null(strstr(page, "<b>0.250 N</b><span>mean absolute error"));
  assert_non_null(strstr(page, "<b>0.250 N</b><span>standard deviation"));
  assert_null(strstr(page, "No force")); // nothing is missing, so no column for it
  sonde_free(page);
  remove_directory(directory);
}

// One row, no force at all, a model without forces, eight probes: pages all the same.
static void odd_data_still_give_a_page(void **state) {
  (void)state;
  const char *directory = directory_of("odd");
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
    sonde_free(write_page(&report, directory));
    each_file(directory, check_file);
    remove_directory(directory);
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
  for (size_t n = 1; status && n < 100000; n += 1 + n / 16) {
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

// The library's own checker of XML where it is installed: it knows more than the one above.
static void xmllint_agrees(void **state) {
  (void)state;
  if (system("command -v xmllint >/dev/null 2>&1") != 0) {
    print_message("xmllint is not installed: skipped\n");
    skip();
  }
  const char *directory = directory_of("lint");
  sonde_fit_report report = everything();
  sonde_free(write_page(&report, directory));
  char command[700];
  snprintf(command, sizeof command, "xmllint --noout --nonet '%s'/*", directory);
  assert_int_equal(system(command), 0);
  remove_directory(directory);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(files_are_well_formed),
      cmocka_unit_test(page_needs_nothing_else),
      cmocka_unit_test(missing_parts_leave_nothing),
      cmocka_unit_test(empty_report_is_a_page),
      cmocka_unit_test(equal_reports_give_equal_bytes),
      cmocka_unit_test(summary_tells_the_statistics),
      cmocka_unit_test(odd_data_still_give_a_page),
      cmocka_unit_test(bad_reports_are_refused),
      cmocka_unit_test(failed_write_leaves_no_half_file),
      cmocka_unit_test(impossible_directories_are_named),
      cmocka_unit_test(lack_of_memory_is_reported),
      cmocka_unit_test(xmllint_agrees),
  };
  return cmocka_run_group_tests(tests, make, unmake);
}
