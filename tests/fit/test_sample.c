// One specimen between two plates: tables with known n, K and x_m are read and fitted again.
#include "fixture.h"

#include "sonde/fit_sample.h"

#include <dirent.h>
#include <stdio.h>

#define SILICONE_DIR SONDE_SOURCE_DIR "/../shared/data/silicone_compression"

enum { ROWS = 200 };
static const double K_N_M = 2400, ASYMPTOTE_M = 0.026, DEEPEST_M = 0.02;

static double force_n(double n, double s_m) {
  return K_N_M * s_m / (1 - pow(s_m / ASYMPTOTE_M, n));
}

static sonde_sample table(double n, double error) {
  sonde_sample s = {
      .count = ROWS, .compression_m = SONDE_NEW(double, ROWS), .force_n = SONDE_NEW(double, ROWS)};
  for (uint32_t i = 0; i < ROWS; ++i) {
    s.compression_m[i] = DEEPEST_M * (i + 1) / ROWS;
    s.force_n[i] = force_n(n, s.compression_m[i]) * (1 + error * sin(2.4 * i));
  }
  return s;
}

static sonde_sample_law fit(const sonde_sample *s, double exponent) {
  sonde_sample_law law;
  sonde_error error = {0};
  if (sonde_fit_sample(s, exponent, &law, &error)) fail_msg("%s", error.message);
  return law;
}

static void known_spring_is_recovered(void **state) {
  (void)state;
  for (double n = 1; n <= 3; ++n) {
    sonde_sample s = table(n, 0);
    sonde_sample_law law = fit(&s, n), free_law = fit(&s, 0);
    assert_true(law.converged && free_law.converged);
    assert_near(law.stiffness_n_m, K_N_M, 1e-5 * K_N_M);
    assert_near(law.asymptote_m, ASYMPTOTE_M, 1e-5 * ASYMPTOTE_M);
    assert_true(law.held_out_percent < 1e-3);
    assert_near(free_law.exponent, n, 2e-3);
    assert_near(free_law.stiffness_n_m, K_N_M, 2e-3 * K_N_M);
    sonde_sample_clear(&s);
  }
}

// With errors of 2 % in every row the least held-out error still names the exponent, and a wrong
// exponent's held-out error stays of the size of its misfit instead of exploding.
static void held_out_error_names_the_exponent(void **state) {
  (void)state;
  for (double n = 1; n <= 3; ++n) {
    sonde_sample s = table(n, 0.02);
    double own = fit(&s, n).held_out_percent;
    assert_true(own > 0.5 && own < 3);
    for (double other = 1; other <= 3; ++other) {
      sonde_sample_law law = fit(&s, other);
      if (other != n && !(law.held_out_percent > 1.1 * own))
        fail_msg("n = %g: %g %%, but %g: %g %%", n, own, other, law.held_out_percent);
      assert_true(law.held_out_percent < 4 * law.mae_percent);
    }
    sonde_sample_clear(&s);
  }
}

static void write_table(const char *path, const char *before, double length, double force) {
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(before, file);
  for (int i = ROWS - 1; i >= -3; --i) { // from the deepest row to the air
    double s_m = DEEPEST_M * (i + 1) / ROWS;
    fprintf(file, "%.9g,x,%.9g\n", length * s_m, force * (s_m > 0 ? force_n(1, s_m) : 0));
  }
  fclose(file);
}

static void units_and_sizes_are_read(void **state) {
  (void)state;
  static const struct {
    const char *before;
    double length, force, area_m2, height_m;
  } CASE[] = {
      {"Cylinder Diameter: 50mm;\nHeight: 30 mm\nCompression (mm),Strain [-],Load (N)\n", 1e3, 1,
       1.9634954e-3, 0.03},
      {"displacement_um,other,force_mN\n", 1e6, 1e3, 0, 0},
      {"# by hand\nPENETRATION [cm],other,Force [kN]\n", 1e2, 1e-3, 0, 0},
      {"displacement_m,other,load_n\n", 1, 1, 0, 0},
  };
  const char *path = "test_sample.csv";
  for (size_t k = 0; k < SONDE_COUNT_OF(CASE); ++k) {
    sonde_sample s;
    sonde_error error = {0};
    write_table(path, CASE[k].before, CASE[k].length, CASE[k].force);
    if (sonde_sample_load(path, &s, &error)) fail_msg("%s", error.message);
    assert_int_equal(s.count, ROWS + 1); // two rows in the air are left out
    assert_near(s.area_m2, CASE[k].area_m2, 1e-9);
    assert_near(s.height_m, CASE[k].height_m, 1e-12);
    sonde_sample_law law = fit(&s, 1);
    assert_near(law.stiffness_n_m, K_N_M, 1e-4 * K_N_M);
    assert_near(law.asymptote_m, ASYMPTOTE_M, 1e-4 * ASYMPTOTE_M);
    sonde_sample_clear(&s);
  }
  remove(path);
}

static void says(sonde_status status, const sonde_error *error, const char *text) {
  if (!status || !strstr(error->message, text))
    fail_msg("status %d, '%s', expected '%s'", (int)status, error->message, text);
}

static void bad_tables_are_refused(void **state) {
  (void)state;
  const char *path = "test_sample_bad.csv";
  sonde_sample s;
  sonde_error error = {0};
  write_table(path, "Compression,other,Load\n", 1e3, 1); // without units
  says(sonde_sample_load(path, &s, &error), &error, "names a compression and a force");
  write_table(path, "Compression (mm),other,Load (N)\n", 1e6, 1); // micrometres
  says(sonde_sample_load(path, &s, &error), &error, "are the units right");
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs("Compression (mm),Load (N)\n1,2\n2,3\n", file);
  fclose(file);
  says(sonde_sample_load(path, &s, &error), &error, "expected at least 10");
  remove(path);
  s = table(1, 0);
  sonde_sample_law law;
  says(sonde_fit_sample(&s, 9, &law, &error), &error, "expected 0 to 8");
  for (uint32_t i = 0; i < s.count; ++i) s.force_n[i] = 40 - 1000 * s.compression_m[i];
  sonde_doubts doubts = {0};
  assert_int_equal(sonde_sample_examine(&s, &doubts, &error), SONDE_OK);
  assert_non_null(sonde_doubts_gravest(&doubts));
  assert_string_equal(sonde_doubts_gravest(&doubts)->kind, "falling");
  sonde_sample_clear(&s);
}

// Measured: ten cylinders of silicone (Dawood's database), when they lie beside the project.
static void silicone_follows_the_first_exponent(void **state) {
  (void)state;
  int count = 0;
  DIR *folder = opendir(SILICONE_DIR);
  for (struct dirent *e; folder && (e = readdir(folder));) {
    char path[1024];
    sonde_sample s;
    sonde_error error = {0};
    if (!strstr(e->d_name, ".csv")) continue;
    snprintf(path, sizeof path, "%s/%s", SILICONE_DIR, e->d_name);
    if (sonde_sample_load(path, &s, &error)) fail_msg("%s", error.message);
    sonde_sample_law one = fit(&s, 1), two = fit(&s, 2), three = fit(&s, 3);
    print_message("%s: held out %.2f, %.2f, %.2f %%\n", e->d_name, one.held_out_percent,
                  two.held_out_percent, three.held_out_percent);
    assert_true(one.mae_percent < 6);
    assert_true(one.held_out_percent < two.held_out_percent);
    assert_true(two.held_out_percent < three.held_out_percent && three.held_out_percent < 100);
    assert_near(s.height_m, 0.03, 1e-9);
    sonde_sample_clear(&s);
    ++count;
  }
  if (folder) closedir(folder);
  if (!count) skip();
  assert_int_equal(count, 10);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(known_spring_is_recovered),
      cmocka_unit_test(held_out_error_names_the_exponent),
      cmocka_unit_test(units_and_sizes_are_read),
      cmocka_unit_test(bad_tables_are_refused),
      cmocka_unit_test(silicone_follows_the_first_exponent),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
