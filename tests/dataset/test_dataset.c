// Plans come back from their text and name what is wrong; draws depend on what they are for alone;
// sums and headers are those of their standards.
#include "dataset/dataset.h"
#include "fixture.h"

#include <stdio.h>
#include <unistd.h>

static void check_sum(const char *text, size_t times, const char *expected) {
  char digest[SHA256_DIGEST_STRING_LENGTH];
  SHA2_CTX sum;
  SHA256Init(&sum);
  for (size_t k = 0; k < times; ++k) SHA256Update(&sum, (const uint8_t *)text, strlen(text));
  SHA256End(&sum, digest);
  assert_string_equal(digest, expected);
}

// FIPS 180-4's examples, and lengths around the end of a block.
static void test_sums(void **state) {
  (void)state;
  check_sum("", 1, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  check_sum("abc", 1, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  check_sum("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 1,
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  check_sum("a", 1000000, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  check_sum("a", 55, "9f4390f8d30c2dd92ec9f095b65e2b9ae9b0a925a5258e241c9f1e910f734318");
  check_sum("a", 64, "ffe054fe7ae0cb6dc65c3af9b61d5209f439851db43d0ba5997337df154668eb");
}

static void put_text(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(text, file);
  assert_int_equal(fclose(file), 0);
}

static void test_plan_comes_back(void **state) {
  (void)state;
  char path[64], *text, *again;
  snprintf(path, sizeof path, "plan_%d.yaml", (int)getpid());
  sonde_dataset_plan plan = sonde_dataset_plan_default(), read;
  snprintf(plan.title, sizeof plan.title, "A \"set\" of \\ legs");
  plan.seed = 4294967295u, plan.frames = 1, plan.clot_share = 1.0 / 3, plan.tilt_rad = 0.123;
  plan.levels = 1u << SONDE_CASE_HARD, plan.body = SONDE_DATASET_BUNDLED;
  plan.arrays = 1u << SONDE_DATASET_image;
  for (int k = 0; k < SONDE_ECHO_SETTINGS; ++k)
    plan.setting[k][0] = plan.setting[k][1] = (double)NAN;
  for (int empty = 0; empty < 2; ++empty) {
    if (!empty) plan.setting[0][0] = plan.setting[0][1] = sonde_echo_ranges()[0].high;
    assert_int_equal(sonde_dataset_plan_text(&plan, &text, NULL), SONDE_OK);
    put_text(path, text);
    sonde_error error = {0};
    if (sonde_dataset_plan_load(path, &read, &error)) fail_msg("%s", error.message);
    assert_int_equal(sonde_dataset_plan_text(&read, &again, NULL), SONDE_OK);
    assert_string_equal(text, again);
    assert_near(read.tilt_rad, plan.tilt_rad, 1e-9);
    assert_int_equal(isnan(read.setting[0][0]), isnan(plan.setting[0][0]));
    sonde_free(text), sonde_free(again);
    plan.setting[0][0] = plan.setting[0][1] = (double)NAN;
  }
  unlink(path);
}

// A plan with one wrong line is refused with that line and with what was expected.
static void test_wrong_plans(void **state) {
  (void)state;
  static const struct {
    const char *line, *says;
  } WRONG[] = {{"legs: 0", "1 to 1e+06"},
               {"legs: many", "legs"},
               {"leg: 3", "leg"},
               {"frames: 6\nframes: 7", "frames"},
               {"clot_share: 1.5", "0 to 1"},
               {"levels: [easy, odd]", "first, easy, hard"},
               {"arrays: []", "one or more of"},
               {"body: cat", "limbs"},
               {"positions: [up]", "prone_bent"},
               {"scanners: []", "1 to 16"},
               {"settings: {depth_mm: 40}", "list"},
               {"settings: {depth_mm: [40]}", "[LOW, HIGH]"},
               {"settings: {depth_mm: [60, 40]}", "lower one first"},
               {"settings: {depth_mm: [1, 40]}", "20"},
               {"settings: {speed: [1, 2]}", "speed"},
               {"force_low_n: 40", "force_low_n <= force_high_n"},
               {"title: [a]", "title"}};
  char path[64], text[256];
  snprintf(path, sizeof path, "wrong_%d.yaml", (int)getpid());
  for (size_t k = 0; k < SONDE_COUNT_OF(WRONG); ++k) {
    sonde_dataset_plan plan;
    sonde_error error = {0};
    snprintf(text, sizeof text, "sonde_dataset: 1\n%s\n", WRONG[k].line);
    put_text(path, text);
    if (!sonde_dataset_plan_load(path, &plan, &error)) fail_msg("taken: %s", WRONG[k].line);
    if (!strstr(error.message, path) || !strstr(error.message, WRONG[k].says))
      fail_msg("%s: says '%s', expected '%s'", WRONG[k].line, error.message, WRONG[k].says);
    const char *line = strstr(error.message, path) + strlen(path);
    assert_true(line[0] == ':' && (line[1] == '2' || line[1] == '3'));
  }
  put_text(path, "sonde_dataset: 2\n");
  sonde_dataset_plan plan;
  assert_int_equal(sonde_dataset_plan_load(path, &plan, NULL), SONDE_VERSION);
  unlink(path);
}

// Keys of two legs, presses or purposes differ; a plan with more legs has the same first ones.
static void test_draws_are_keyed(void **state) {
  (void)state;
  enum { LEGS = 20, PRESSES = 10, PURPOSES = SONDE_DATASET_FOR_TIME + 1 };
  static uint64_t keys[LEGS * PRESSES * PURPOSES];
  size_t count = 0;
  for (uint32_t leg = 0; leg < LEGS; ++leg)
    for (uint32_t press = 0; press < PRESSES; ++press)
      for (int purpose = 0; purpose < PURPOSES; ++purpose)
        keys[count++] = sonde_dataset_key(7, leg, press, (sonde_dataset_purpose)purpose);
  for (size_t i = 0; i < count; ++i)
    for (size_t k = 0; k < i; ++k) assert_true(keys[i] != keys[k]);
  sonde_dataset_plan few = sonde_dataset_plan_default(), many = few;
  few.body = many.body = SONDE_DATASET_BUNDLED;
  many.legs = 1000, many.presses = 9;
  const char *chosen = getenv("SONDE_TEST_MODEL");
  const char *model = chosen ? chosen : SONDE_BINARY_DIR "/share/sonde/thigh.sonde";
  sonde_dataset_def defs[2] = {sonde_dataset_def_default(), sonde_dataset_def_default()};
  sonde_dataset_press press[2];
  sonde_case patient[2];
  for (int k = 0; k < 2; ++k) {
    sonde_case_setup setup = {0};
    sonde_error error = {0};
    defs[k].plan = k ? &many : &few;
    defs[k].scanners = SONDE_SOURCE_DIR "/data/scanners";
    if (sonde_dataset_draw_leg(defs[k].plan, 3, model, &patient[k], &setup, &error) ||
        sonde_dataset_draw_press(&defs[k], 3, 2, &setup, 0.02, &press[k], &error))
      fail_msg("%s", error.message);
    sonde_case_setup_clear(&setup);
  }
  assert_string_equal(patient[0].id, patient[1].id);
  assert_memory_equal(&press[0].start, &press[1].start, sizeof press[0].start);
  assert_string_equal(press[0].scanner_name, press[1].scanner_name);
  assert_true(press[0].force_n == press[1].force_n);
}

// The numbers of one purpose over many legs are even.
static void test_draws_are_even(void **state) {
  (void)state;
  enum { LEGS = 4000 };
  double least = 1, greatest = 0, mean = 0;
  for (uint32_t leg = 0; leg < LEGS; ++leg) {
    const uint64_t key = sonde_dataset_key(1, leg, 2, SONDE_DATASET_FOR_FORCE);
    const double u = sonde_random_uniform(key, 0);
    least = fmin(least, u), greatest = fmax(greatest, u), mean += u / LEGS;
  }
  assert_true(least < 0.002 && greatest > 0.998);
  assert_near(mean, 0.5, 4 * sqrt(1.0 / 12 / LEGS));
}

// POSIX: the sum of the header's bytes, its own field as blanks, stands in it in octal digits.
static void test_tar_header(void **state) {
  (void)state;
  uint8_t block[SONDE_DATASET_TAR_BLOCK];
  sonde_dataset_tar_header(block, "000001_02_03.strain.npy", 8589934591u);
  unsigned sum = 0, told = 0;
  for (int k = 0; k < SONDE_DATASET_TAR_BLOCK; ++k) sum += k >= 148 && k < 156 ? ' ' : block[k];
  assert_int_equal(sscanf((char *)block + 148, "%o", &told), 1);
  assert_int_equal(told, sum);
  assert_string_equal((char *)block, "000001_02_03.strain.npy");
  assert_string_equal((char *)block + 124, "77777777777");
  assert_string_equal((char *)block + 257, "ustar");
}

// NumPy's format: a head of a multiple of 64 bytes that ends with a line feed, then the numbers.
static void test_npy(void **state) {
  (void)state;
  const float numbers[2][3][2] = {{{1, 2}, {3, 4}, {5, 6}}, {{7, 8}, {9, 10}, {11, 12}}};
  const sonde_dataset_array array = {
      .data = numbers, .bytes = 4, .rows = 2, .columns = 3, .parts = 2};
  uint8_t *bytes;
  size_t count;
  assert_int_equal(sonde_dataset_npy(&array, &bytes, &count, NULL), SONDE_OK);
  const size_t head = 10 + bytes[8] + 256u * bytes[9];
  assert_int_equal(head % 64, 0);
  assert_int_equal(bytes[head - 1], '\n');
  assert_int_equal(count, head + sizeof numbers);
  assert_memory_equal(bytes + head, numbers, sizeof numbers);
  assert_non_null(strstr((char *)bytes + 10, "'shape': (2, 3, 2)"));
  sonde_free(bytes);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_sums),
      cmocka_unit_test(test_plan_comes_back),
      cmocka_unit_test(test_wrong_plans),
      cmocka_unit_test(test_draws_are_keyed),
      cmocka_unit_test(test_draws_are_even),
      cmocka_unit_test(test_tar_header),
      cmocka_unit_test(test_npy),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
