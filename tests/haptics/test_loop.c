// The real-time loop keeps its phase, counts the periods that it misses and can be read without
// waiting. The laws below hold however late the system wakes a thread: runs end after a number of
// ticks, never after a time.
#include "test.h"

#include "base/clock.h"
#include "haptics/loop.h"
#include "sonde/haptics.h"

typedef struct job {
  _Atomic uint64_t ticks;
  double period_s, first_s, last_s;
  uint64_t slow_every;
  double slow_s;
} job;

static void work(void *user) {
  job *j = user;
  double now_s = sonde_clock_now();
  if (j->ticks == 0) j->first_s = now_s;
  j->last_s = now_s;
  if (j->slow_every && j->ticks % j->slow_every == j->slow_every - 1)
    while (sonde_clock_now() < now_s + j->slow_s) continue;
  j->ticks++;
}

// Ticks and missed periods together fill the time from before the start to after the stop: no
// period is served twice and none is forgotten.
static void assert_fills_time(const job *j, const sonde_loop_stats *stats, double before_s,
                              double after_s) {
  double counted = (double)(stats->ticks + stats->deadline_misses);
  assert_true(counted + 1 >= (j->last_s - j->first_s) / j->period_s);
  assert_true(counted <= (after_s - before_s) / j->period_s + 1);
}

static void wait_for_ticks(job *j, uint64_t ticks) {
  while (j->ticks < ticks) sonde_clock_sleep_until(sonde_clock_now() + 1e-3);
}

// Runs a loop until it has made a number of ticks.
static sonde_loop_stats run(job *j, uint64_t ticks) {
  sonde_loop *loop;
  sonde_loop_stats stats;
  double before_s = sonde_clock_now();
  assert_int_equal(sonde_loop_start(j->period_s, work, j, &loop, NULL), SONDE_OK);
  wait_for_ticks(j, ticks);
  sonde_loop_stop(loop, &stats);
  assert_fills_time(j, &stats, before_s, sonde_clock_now());
  return stats;
}

static uint64_t histogram_sum(const sonde_loop_stats *stats) {
  uint64_t sum = 0;
  for (size_t i = 0; i < SONDE_COUNT_OF(stats->lateness_histogram); ++i)
    sum += stats->lateness_histogram[i];
  return sum;
}

static void rejects_bad_periods(void **state) {
  (void)state;
  sonde_loop *loop;
  sonde_error error;
  const double bad[] = {0.0, -1.0, 1e-6, 100.0, (double)NAN};
  for (size_t i = 0; i < SONDE_COUNT_OF(bad); ++i)
    assert_int_equal(sonde_loop_start(bad[i], work, NULL, &loop, &error), SONDE_ARGUMENT);
  sonde_loop_stop(NULL, NULL);
}

static void ticks_every_millisecond(void **state) {
  (void)state;
  job j = {.period_s = 1e-3};
  sonde_loop_stats stats = run(&j, 300);
  assert_int_equal(stats.ticks, j.ticks);
  assert_int_equal(histogram_sum(&stats), stats.ticks);
  assert_true(stats.compute_mean_s <= stats.compute_max_s);
  assert_true(stats.realtime_priority && stats.memory_locked ? stats.priority_note[0] == 0
                                                             : stats.priority_note[0] != 0);
}

static void slow_ticks_are_counted_not_made_up(void **state) {
  (void)state;
  job j = {.period_s = 1e-3, .slow_every = 10, .slow_s = 4.5e-3};
  sonde_loop_stats stats = run(&j, 100);
  uint64_t slow = stats.ticks / j.slow_every;
  assert_true(slow >= 10);
  assert_true(stats.deadline_misses >= 4 * slow); // each covers the begin of 4 periods at least
  assert_true(stats.compute_max_s >= j.slow_s);
}

static void lateness_goes_to_its_bin(void **state) {
  (void)state;
  assert_int_equal(sonde_loop_lateness_bin(-1e-6), 0);
  assert_int_equal(sonde_loop_lateness_bin(9e-6), 0);
  assert_int_equal(sonde_loop_lateness_bin(10e-6), 1);
  assert_int_equal(sonde_loop_lateness_bin(0.7e-3), 6);
  assert_int_equal(sonde_loop_lateness_bin(49e-3), 10);
  assert_int_equal(sonde_loop_lateness_bin(50e-3), 11);
  assert_int_equal(sonde_loop_lateness_bin((double)INFINITY), 11);
}

static void counters_grow_under_a_reader(void **state) {
  (void)state;
  job j = {.period_s = 5e-4};
  sonde_loop *loop;
  assert_int_equal(sonde_loop_start(j.period_s, work, &j, &loop, NULL), SONDE_OK);
  uint64_t last = 0;
  while (last < 300) {
    sonde_loop_stats stats = sonde_loop_read(loop);
    assert_true(stats.ticks >= last);
    last = stats.ticks;
  }
  sonde_loop_stop(loop, NULL);
}

static void two_loops_run_side_by_side(void **state) {
  (void)state;
  job a = {.period_s = 1e-3}, b = {.period_s = 2e-3};
  sonde_loop *loop;
  sonde_loop_stats stats_a;
  double before_s = sonde_clock_now();
  assert_int_equal(sonde_loop_start(a.period_s, work, &a, &loop, NULL), SONDE_OK);
  run(&b, 150);
  wait_for_ticks(&a, 150);
  sonde_loop_stop(loop, &stats_a);
  assert_fills_time(&a, &stats_a, before_s, sonde_clock_now());
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(rejects_bad_periods),
      cmocka_unit_test(ticks_every_millisecond),
      cmocka_unit_test(slow_ticks_are_counted_not_made_up),
      cmocka_unit_test(lateness_goes_to_its_bin),
      cmocka_unit_test(counters_grow_under_a_reader),
      cmocka_unit_test(two_loops_run_side_by_side),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
