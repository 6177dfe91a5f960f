// The file of a record: round trip, and what is refused with file, line and what was expected.
#include "identify_test.h"

#define HEADER "time_s,penetration_mm,slide_mm,normal_n,tangential_n\n"

static sonde_motion_record some(sonde_motion_sample samples[60]) {
  for (int k = 0; k < 60; ++k)
    samples[k] = (sonde_motion_sample){0.01 * k, 1e-4 * k, -2e-4 * k, 0.1 * k, -0.03 * k};
  sonde_motion_record r = {.protocol = SONDE_PROTOCOL_SLIDE,
                           .site = 27,
                           .probe = "linear",
                           .axis = 'v',
                           .gel_film = 1.5,
                           .synthetic = true,
                           .count = 60,
                           .samples = samples};
  return r;
}

static void comes_back_as_written(void **unused) {
  (void)unused;
  sonde_motion_sample samples[60];
  sonde_motion_record out = some(samples), in;
  sonde_error error = {0};
  assert_ok(sonde_motion_record_save(temporary_path(), &out, &error), &error);
  assert_ok(sonde_motion_record_load(temporary_path(), &in, &error), &error);
  assert_int_equal(in.count, out.count);
  assert_int_equal(in.site, 27);
  assert_int_equal(in.protocol, SONDE_PROTOCOL_SLIDE);
  assert_int_equal(in.axis, 'v');
  assert_string_equal(in.probe, "linear");
  assert_true(in.synthetic);
  assert_near(in.gel_film, 1.5, 0);
  for (uint32_t k = 0; k < in.count; ++k) {
    assert_near(in.samples[k].time_s, samples[k].time_s, 1e-6);
    assert_near(in.samples[k].penetration_m, samples[k].penetration_m, 1e-8);
    assert_near(in.samples[k].slide_m, samples[k].slide_m, 1e-8);
    assert_near(in.samples[k].normal_n, samples[k].normal_n, 1e-5);
    assert_near(in.samples[k].tangential_n, samples[k].tangential_n, 1e-5);
  }
  sonde_motion_record_clear(&in);
  unlink(temporary_path());
}

static void refuse(const char *text, const char *word) {
  sonde_motion_record record;
  sonde_error error = {0};
  sonde_status status = sonde_motion_record_load(write_temporary(text), &record, &error);
  assert_int_equal(status, SONDE_FORMAT);
  assert_says(&error, word);
  assert_says(&error, temporary_path());
  assert_null(record.samples);
  unlink(temporary_path());
}

static void bad_files_are_refused(void **unused) {
  (void)unused;
  refuse("time_s,penetration_mm,slide_mm,normal_n\n0,0,0,0\n", "tangential_n");
  refuse(HEADER "0,0,0,0,0\n0.1,0,0,0,0\n0.1,0,0,0,0\n", ":4: column time_s");
  refuse(HEADER "0,0,0,0,0\n0.1,0,0,0,0\n", "too short: 2 samples");
  refuse(HEADER "0,0,0,nan,0\n", ":2: column normal_n");
  refuse(HEADER "0,9000,0,0,0\n", "column penetration_mm");
  refuse("# free words are fine\n# site: here\n" HEADER "0,0,0,0,0\n", ":2: site");
  refuse("# protocol: tap\n" HEADER "0,0,0,0,0\n", ":1: protocol: expected ramp-hold or slide");
  refuse("# axis: w\n" HEADER "0,0,0,0,0\n", ":1: axis");
  refuse("# gel_film: -1\n" HEADER "0,0,0,0,0\n", ":1: gel_film");
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(comes_back_as_written),
                                     cmocka_unit_test(bad_files_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
