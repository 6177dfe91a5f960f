// What test_golden.c uses of cmocka, for compilers and processors that cmocka is not built for.
#ifndef SONDE_TESTS_PLAIN_CMOCKA_H
#define SONDE_TESTS_PLAIN_CMOCKA_H

#include <stdio.h>
#include <stdlib.h>

#define print_error(...) fprintf(stderr, __VA_ARGS__)
#define fail_msg(...) (print_error(__VA_ARGS__), fputc('\n', stderr), failed = 1)
#define assert_true(holds) ((holds) ? (void)0 : (void)fail_msg("%d: %s", __LINE__, #holds))
#define assert_int_equal(a, b) assert_true((a) == (b))

static int failed;
struct CMUnitTest {
  const char *name;
  void (*run)(void **state);
};
#define cmocka_unit_test(function) ((struct CMUnitTest){#function, function})
#define cmocka_run_group_tests(tests, setup, teardown)                                             \
  run_all(tests, sizeof(tests) / sizeof *(tests))

static int run_all(const struct CMUnitTest *test, size_t count) {
  for (size_t k = 0; k < count; ++k) {
    printf("%s\n", test[k].name);
    test[k].run(NULL);
  }
  return failed;
}

#endif
