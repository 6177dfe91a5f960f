// Tables that no tissue gives: refused, warned about, or corrected. Each case is a copy of the
// bundled measurements with one fault.
#include "fit_plate.h"

#include "sonde/fit_plausible.h"

// ---- faults -------------------------------------------------------------------------------

static void metres(sonde_datum *d) { d->penetration_m *= 1e-3; }
static void micrometres(sonde_datum *d) { d->penetration_m *= 1e3; }
static void millinewtons(sonde_datum *d) { d->force_n *= 1e3; }
static void kilonewtons(sonde_datum *d) { d->force_n *= 1e-3; }
static void grams(sonde_datum *d) { d->force_n *= 101.97; }
static void constant(sonde_datum *d) { d->force_n = 3; }
static void falling(sonde_datum *d) { d->force_n = 20 - 500 * d->penetration_m; }
static void saturating(sonde_datum *d) { d->force_n = 20 * (1 - exp(-d->penetration_m / 6e-3)); }
static void clipped(sonde_datum *d) { d->force_n = fmin(d->force_n, 10); }
static void late_zero(sonde_datum *d) { d->penetration_m += 1e-3; }
static void early_zero(sonde_datum *d) { d->penetration_m -= 1e-3; }
static void tare(sonde_datum *d) { d->force_n += 0.3; }
static void none(sonde_datum *d) { (void)d; }

typedef struct fault {
  void (*apply)(sonde_datum *d);
  const char *kind; // NULL: no objection
  sonde_doubt_grade grade;
  const char *says;
} fault;

static const fault FAULT[] = {
    {none, NULL, SONDE_DOUBT_WARNING, NULL},
    {metres, "penetration_mm", SONDE_DOUBT_ABSURD, "metres"},
    {micrometres, "penetration_mm", SONDE_DOUBT_ABSURD, "micrometres"},
    {millinewtons, "force_n", SONDE_DOUBT_ABSURD, "millinewtons"},
    {kilonewtons, "force_n", SONDE_DOUBT_ABSURD, "kilonewtons"},
    {grams, "force_n", SONDE_DOUBT_ABSURD, "gram-force"},
    {constant, "constant", SONDE_DOUBT_ABSURD, "does not change"},
    {falling, "falling", SONDE_DOUBT_ABSURD, "falls with depth"},
    {saturating, "saturating", SONDE_DOUBT_IMPLAUSIBLE, "levels off"},
    {clipped, "saturating", SONDE_DOUBT_IMPLAUSIBLE, "levels off"},
    {late_zero, "contact_zero", SONDE_DOUBT_WARNING, "--estimate-zero"},
    {early_zero, "contact_zero", SONDE_DOUBT_WARNING, "--estimate-zero"},
    {tare, "contact_zero", SONDE_DOUBT_WARNING, "--estimate-tare"},
};

static sonde_measurements load(const char *name) {
  sonde_measurements m;
  sonde_error error;
  char path[512];
  snprintf(path, sizeof path, "%s%s", DATA_DIR, name);
  assert_ok(sonde_measurements_load(path, NULL, &m, &error), &error);
  return m;
}

static void check(const fault *f, const sonde_measurements *m) {
  sonde_doubts doubts = {0};
  sonde_error error;
  assert_ok(sonde_measurements_examine(m, &doubts, &error), &error);
  const sonde_doubt *d = sonde_doubts_gravest(&doubts);
  if (!f->kind) {
    if (d) fail_msg("a sound table is objected to: %s", d->sentence);
    return;
  }
  assert_non_null(d);
  assert_string_equal(d->kind, f->kind);
  assert_int_equal(d->grade, f->grade);
  if (!strstr(d->sentence, f->says)) fail_msg("'%s' is not in '%s'", f->says, d->sentence);
  // A curve is named by its line, a column by that of its largest value.
  if (f->grade != SONDE_DOUBT_WARNING) assert_true(d->line > 1 && d->line <= m->count + 1);
}

static void judges_every_fault(void **state) {
  (void)state;
  for (size_t k = 0; k < sizeof FAULT / sizeof *FAULT; ++k) {
    sonde_measurements m = load("indentation.csv");
    assert_int_equal(m.count, 1828);
    for (uint32_t i = 0; i < m.count; ++i) FAULT[k].apply(&m.data[i]);
    check(&FAULT[k], &m);
    sonde_measurements_clear(&m);
  }
  sonde_measurements noisy = load("indentation_noisy.csv");
  check(&FAULT[0], &noisy);
  sonde_measurements_clear(&noisy);
}

// One curve in another unit among sound ones, and one probe on its own.
static void names_the_curve(void **state) {
  (void)state;
  sonde_measurements m = load("indentation.csv");
  sonde_doubts doubts = {0};
  sonde_error error;
  uint32_t line = 0;
  for (uint32_t i = 0; i < m.count; ++i) {
    if (m.data[i].site != 12 || strcmp(m.data[i].probe, "point") != 0) continue;
    m.data[i].force_n *= 30; // below what a table as a whole would be refused for
    if (!line) line = m.line[i];
  }
  assert_true(line > 0);
  for (uint32_t i = 0; i < m.count; ++i)
    if (m.data[i].force_n > 150) m.data[i].force_n = 150 + 0.1 * m.data[i].force_n;
  assert_ok(sonde_measurements_examine(&m, &doubts, &error), &error);
  const sonde_doubt *d = sonde_doubts_gravest(&doubts);
  assert_non_null(d);
  assert_int_equal(d->site, 12);
  assert_string_equal(d->probe, "point");
  assert_int_equal(d->line, line);
  assert_int_equal(d->curves, 1);
  sonde_measurements_clear(&m);
}

// ---- loading and unloading, repeats -------------------------------------------------------

#define HEADER "site,probe,x_mm,y_mm,z_mm,nx,ny,nz,penetration_mm,force_n"

// A press to 10 mm and back; unloading gives 0.9 of the force. mode: 0 as measured, 1 sorted by
// depth, 2 with a column phase.
static const char *press_and_back(int mode, char *text, size_t room) {
  size_t used = (size_t)snprintf(text, room, HEADER "%s\n", mode == 2 ? ",phase" : "");
  for (int k = 0; k < 20; ++k) {
    int step = mode == 1 ? k / 2 : k < 10 ? k : 19 - k;
    bool back = mode == 1 ? k % 2 : k >= 10;
    double x = 1 + step + (back ? 0.5 : 0), f = 0.4 * x + 0.02 * x * x;
    used += (size_t)snprintf(text + used, room - used, "0,linear,0,0,0,0,0,1,%g,%g%s\n", x,
                             back ? (mode == 1 ? 0.5 : 0.9) * f : f,
                             mode < 2 ? ""
                             : back   ? ",unloading"
                                      : ",loading");
  }
  return write_temporary(text);
}

static void tells_loading_from_unloading(void **state) {
  (void)state;
  char text[4096];
  sonde_error error;
  for (int mode = 0; mode < 3; ++mode) {
    sonde_measurements m;
    sonde_doubts doubts = {0};
    assert_ok(sonde_measurements_load(press_and_back(mode, text, sizeof text), NULL, &m, &error),
              &error);
    assert_int_equal(m.count, mode == 2 ? 10 : 20);
    assert_int_equal(m.unloading, mode == 2 ? 10 : 0);
    assert_ok(sonde_measurements_examine(&m, &doubts, &error), &error);
    const sonde_doubt *d = sonde_doubts_gravest(&doubts);
    assert_int_equal(mode == 2, d == NULL);
    if (d) {
      assert_string_equal(d->kind, "loading_and_unloading");
      assert_int_equal(d->grade, SONDE_DOUBT_IMPLAUSIBLE);
    }
    if (mode == 0) assert_int_equal(d->line, 12); // the deepest row
    sonde_measurements_clear(&m);
  }
  sonde_measurements m;
  const char *path = write_temporary(HEADER ",phase\n0,linear,0,0,0,0,0,1,2,1,sideways\n");
  assert_int_equal(sonde_measurements_load(path, NULL, &m, &error), SONDE_FORMAT);
  assert_says(&error, ":2: column phase: expected loading or unloading, found 'sideways'");
}

// Three repeats about 1 N: the mean, and the scatter of the mean. Another depth is interpolated.
static void averages_repeats(void **state) {
  (void)state;
  sonde_measurements m;
  sonde_error error;
  const char *path = write_temporary(HEADER ",repeat\n"
                                            "3,point,0,0,0,0,0,1,2,0.9,1\n"
                                            "3,point,0,0,0,0,0,1,4,2.0,1\n"
                                            "3,point,0,0,0,0,0,1,2,1.0,2\n"
                                            "3,point,0,0,0,0,0,1,4,2.1,2\n"
                                            "3,point,0,0,0,0,0,1,1,0.6,3\n"
                                            "3,point,0,0,0,0,0,1,3,1.6,3\n"
                                            "3,point,0,0,0,0,0,1,5,2.6,3\n"
                                            "4,point,0,0,0,0,0,1,2,7,1\n");
  assert_ok(sonde_measurements_load(path, NULL, &m, &error), &error);
  assert_int_equal(m.count, 3);
  assert_int_equal(m.repeats, 3);
  assert_near(m.data[0].force_n, 1.0, 1e-12);
  assert_near(m.data[1].force_n, (2.0 + 2.1 + 2.1) / 3, 1e-12);
  // Squares about the means: 0.02 and 0.02/3, four degrees of freedom; three repeats.
  double scatter_n = sqrt((0.02 + 0.02 / 3) / 4) / sqrt(3);
  assert_near(m.scatter_n[0], scatter_n, 1e-9);
  assert_near(m.scatter_n[1], scatter_n, 1e-9);
  assert_near(m.scatter_n[2], 0, 0);
  sonde_measurements_clear(&m);
  path = write_temporary(HEADER ",repeat\n"
                                "3,point,0,0,0,0,0,1,2,0.9,1\n"
                                "3,point,0,0,0,0,0,1,2,0.9,1\n");
  assert_int_equal(sonde_measurements_load(path, NULL, &m, &error), SONDE_FORMAT);
  assert_says(&error, ":3: repeats line 2");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(judges_every_fault), cmocka_unit_test(names_the_curve),
      cmocka_unit_test(tells_loading_from_unloading), cmocka_unit_test(averages_repeats)};
  return cmocka_run_group_tests(tests, NULL, remove_temporary);
}
