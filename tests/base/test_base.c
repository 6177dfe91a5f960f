// Base room: status sentences, errors, hash, numbers, allocator hook, small maths.
#include "test.h"

#include "base/maths.h"
#include "base/order.h"
#include "base/random.h"

#include <locale.h>

static void every_status_has_its_own_sentence(void **state) {
  (void)state;
  for (int i = 0; i < SONDE_STATUS_COUNT; ++i) {
    const char *text = sonde_status_text((sonde_status)i);
    assert_non_null(text);
    assert_true(strlen(text) >= 7);
    assert_string_not_equal(text, sonde_status_text(SONDE_STATUS_COUNT));
    assert_true(text[strlen(text) - 1] != '.' && text[strlen(text) - 1] != '\n');
    for (int j = 0; j < i; ++j) assert_string_not_equal(text, sonde_status_text((sonde_status)j));
  }
  assert_string_equal(sonde_status_text((sonde_status)-1), sonde_status_text(SONDE_STATUS_COUNT));
}

static void version_is_the_one_of_the_header(void **state) {
  (void)state;
  char text[32];
  snprintf(text, sizeof text, "%d.%d.%d", SONDE_VERSION_MAJOR, SONDE_VERSION_MINOR,
           SONDE_VERSION_PATCH);
  assert_string_equal(sonde_version(), text);
}

static void failure_fills_the_error(void **state) {
  (void)state;
  sonde_error error;
  memset(&error, 'x', sizeof error);
  char longer[2000];
  memset(longer, 'a', sizeof longer - 1);
  longer[sizeof longer - 1] = 0;
  assert_int_equal(sonde_fail(&error, SONDE_FORMAT, "f.csv:%d: %s", 7, longer), SONDE_FORMAT);
  assert_int_equal(error.status, SONDE_FORMAT);
  assert_string_equal(error.where, "failure_fills_the_error");
  assert_memory_equal(error.message, "f.csv:7: aaa", 12);
  assert_int_equal(strlen(error.message), sizeof error.message - 1);
  assert_int_equal(sonde_fail(NULL, SONDE_IO, "nobody listens"), SONDE_IO);
}

static void hash_has_the_published_values(void **state) {
  (void)state;
  // Test vectors of the FNV authors for the 64-bit FNV-1a.
  assert_true(sonde_hash(0, "", 0) == 0xcbf29ce484222325u);
  assert_true(sonde_hash(0, "a", 1) == 0xaf63dc4c8601ec8cu);
  assert_true(sonde_hash(0, "foobar", 6) == 0x85944171f73967e8u);
  uint64_t part = sonde_hash(0, "foo", 3);
  assert_true(sonde_hash(part, "bar", 3) == sonde_hash(0, "foobar", 6));
}

static void parses_and_stops(const char *text, double expected, size_t used) {
  const char *end = NULL;
  double value = sonde_parse_real(text, &end);
  assert_true(value == expected);
  assert_int_equal(end - text, used);
}

static void check_numbers(void) {
  parses_and_stops("1.5", 1.5, 3);
  parses_and_stops("-2.25e-3,7", -2.25e-3, 8);
  parses_and_stops("1,5", 1.0, 1);
  parses_and_stops("0.1", 0.1, 3);
  parses_and_stops("x", 0.0, 0);
  parses_and_stops("", 0.0, 0);
}

static void numbers_are_read_in_the_c_locale(void **state) {
  (void)state;
  check_numbers();
  if (!getenv("LOCPATH")) {
    print_message("no localedef on this machine: no locale with a decimal comma\n");
    skip();
  }
  assert_non_null(setlocale(LC_NUMERIC, "comma"));
  assert_true(strtod("1,5", NULL) == 1.5); // the comma is in force
  check_numbers();
  setlocale(LC_NUMERIC, "C");
}

typedef struct counter {
  int allocated, released, fail_at;
} counter;

static void *counting_allocate(size_t bytes, void *user) {
  counter *c = user;
  if (c->fail_at && ++c->allocated == c->fail_at) return NULL;
  if (!c->fail_at) c->allocated++;
  void *pointer = malloc(bytes);
  if (pointer) memset(pointer, 0xa5, bytes);
  return pointer;
}

static void counting_release(void *pointer, void *user) {
  ((counter *)user)->released++;
  free(pointer);
}

static void allocator_hook_sees_everything(void **state) {
  (void)state;
  counter c = {0, 0, 0};
  sonde_set_allocator(&(sonde_allocator){counting_allocate, counting_release, &c});
  unsigned char *bytes = sonde_calloc(10, 1);
  for (int i = 0; i < 10; ++i) assert_int_equal(bytes[i], 0);
  bytes[9] = 42;
  bytes = sonde_realloc(bytes, 10, 20);
  assert_int_equal(bytes[9], 42);
  for (int i = 10; i < 20; ++i) assert_int_equal(bytes[i], 0);
  void *empty = sonde_calloc(0, 8);
  assert_non_null(empty);
  sonde_free(bytes);
  sonde_free(empty);
  sonde_free(NULL);
  sonde_set_allocator(NULL);
  assert_int_equal(c.allocated, 3);
  assert_int_equal(c.released, 3);
  assert_null(sonde_calloc(SIZE_MAX / 2 + 1, 2)); // the product wraps to 0
}

static void failed_growth_keeps_nothing_half_done(void **state) {
  (void)state;
  counter c = {0, 0, 2};
  sonde_set_allocator(&(sonde_allocator){counting_allocate, counting_release, &c});
  void *block = sonde_calloc(4, 4);
  assert_non_null(block);
  assert_null(sonde_realloc(block, 16, 32));
  sonde_free(block); // sonde_realloc leaves the old block to its owner when it fails
  sonde_set_allocator(NULL);
  assert_int_equal(c.released, 1);
}

typedef struct heard {
  int count;
  char last[64];
} heard;

static void hear(sonde_log_level level, const char *message, void *user) {
  heard *h = user;
  h->count += level == SONDE_LOG_WARNING;
  snprintf(h->last, sizeof h->last, "%s", message);
}

static bool stop_at_half(double fraction, const char *what, void *user) {
  (void)what;
  (void)user;
  return fraction < 0.5;
}

static void log_and_progress_reach_their_callbacks(void **state) {
  (void)state;
  heard h = {0, ""};
  sonde_log(SONDE_LOG_WARNING, "silence");
  sonde_set_log(hear, &h);
  sonde_log(SONDE_LOG_WARNING, "node %d", 12);
  sonde_set_log(NULL, NULL);
  sonde_log(SONDE_LOG_WARNING, "silence");
  assert_int_equal(h.count, 1);
  assert_string_equal(h.last, "node 12");
  sonde_progress progress = {stop_at_half, NULL};
  assert_true(sonde_progress_report(NULL, 0.9, ""));
  assert_true(sonde_progress_report(&(sonde_progress){NULL, NULL}, 0.9, ""));
  assert_true(sonde_progress_report(&progress, 0.4, ""));
  assert_false(sonde_progress_report(&progress, 0.6, ""));
}

static double pose_gap(sonde_pose a, sonde_pose b) {
  double dot = a.rotation.w * b.rotation.w + a.rotation.x * b.rotation.x +
               a.rotation.y * b.rotation.y + a.rotation.z * b.rotation.z;
  return v_distance(a.position, b.position) + 1.0 - fabs(dot);
}

static void poses_form_a_group(void **state) {
  (void)state;
  sonde_pose p = {{0.1, -0.2, 0.3}, q_unit((sonde_quat){0.3, -0.5, 0.7, 0.2})};
  sonde_pose q = {{-1.0, 0.5, 0.25}, q_unit((sonde_quat){-0.1, 0.9, 0.3, -0.4})};
  sonde_vec3 x = {0.4, 0.5, -0.6};
  assert_true(v_distance(pose_apply(pose_mul(p, q), x), pose_apply(p, pose_apply(q, x))) < 1e-15);
  assert_true(v_distance(pose_apply_inverse(p, pose_apply(p, x)), x) < 1e-15);
  sonde_pose one = pose_mul(p, pose_inverse(p));
  assert_true(pose_gap(one, (sonde_pose){{0, 0, 0}, quat_identity()}) < 1e-15);
  assert_true(v_distance(q_rotate(p.rotation, x), m_mul_v(q_matrix(p.rotation), x)) < 1e-15);
}

static void rotation_matrix_gives_its_quaternion_back(void **state) {
  (void)state;
  const double angles[] = {0.0, 0.3, 1.5, 3.0, 3.14159265358979, -2.0};
  for (size_t a = 0; a < SONDE_COUNT_OF(angles); ++a)
    for (int axis = 0; axis < 3; ++axis) {
      double s = sin(angles[a] / 2), c = cos(angles[a] / 2);
      sonde_quat q = {c, axis == 0 ? s : 0, axis == 1 ? s : 0, axis == 2 ? s : 0};
      sonde_pose there = {{0}, q}, back = {{0}, q_from_matrix(q_matrix(q))};
      assert_true(pose_gap(there, back) < 1e-12);
    }
}

// Halving along an axis parts places as sorting does, whatever their order; leaves are in order.
static void halves_are_those_of_a_sort(void **state) {
  (void)state;
  enum { MOST = 3000, LEAF = 4 };
  static sonde_vec3 point[MOST];
  static uint32_t sorted[MOST], halved[MOST];
  static sonde_ranked scratch[MOST];
  static uint8_t low[MOST];
  for (int kind = 0; kind < 5; ++kind) // random, few values, rising, falling, saw
    for (uint32_t count = 2; count <= MOST; count += count < 40 ? 1 : 493) {
      for (uint32_t i = 0; i < count; ++i) {
        const double random = floor(1000 * sonde_random_uniform(1, i));
        point[i].y = kind == 0   ? random
                     : kind == 1 ? fmod(random, 3)
                     : kind == 2 ? i
                     : kind == 3 ? -(double)i
                                 : i % 50;
        sorted[i] = halved[i] = count - 1 - i;
      }
      sonde_sort_along(point, 1, sorted, count, scratch);
      sonde_halve_along(point, 1, halved, count, LEAF, scratch);
      memset(low, 0, sizeof low);
      for (uint32_t i = 0; i < count / 2; ++i) low[sorted[i]] = 1;
      for (uint32_t i = 0; i < count; ++i) assert_int_equal(low[halved[i]], i < count / 2);
      if (count <= 2 * LEAF + 1) assert_memory_equal(sorted, halved, count * sizeof *sorted);
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_status_has_its_own_sentence),
      cmocka_unit_test(version_is_the_one_of_the_header),
      cmocka_unit_test(failure_fills_the_error),
      cmocka_unit_test(hash_has_the_published_values),
      cmocka_unit_test(numbers_are_read_in_the_c_locale),
      cmocka_unit_test(allocator_hook_sees_everything),
      cmocka_unit_test(failed_growth_keeps_nothing_half_done),
      cmocka_unit_test(log_and_progress_reach_their_callbacks),
      cmocka_unit_test(poses_form_a_group),
      cmocka_unit_test(rotation_matrix_gives_its_quaternion_back),
      cmocka_unit_test(halves_are_those_of_a_sort),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
