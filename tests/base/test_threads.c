// Ring, mailbox and clock: order and wholeness of what crosses threads.
#include "test.h"

#include "base/clock.h"
#include "base/mailbox.h"
#include "base/ring.h"

#include <pthread.h>
#include <sched.h>

enum { RECORDS = 200000, WORDS = 16, PUBLISHED = 200000 };

typedef struct record {
  uint64_t word[WORDS];
} record;

// Every word follows from the number, so that a torn record shows.
static record record_of(uint64_t number) {
  record r;
  for (unsigned i = 0; i < WORDS; ++i) r.word[i] = number * 0x9e3779b97f4a7c15u + i;
  return r;
}

static bool is_whole(const record *r, uint64_t *number_times_k) {
  for (unsigned i = 1; i < WORDS; ++i)
    if (r->word[i] != r->word[0] + i) return false;
  *number_times_k = r->word[0];
  return true;
}

static void ring_rejects_bad_sizes(void **state) {
  (void)state;
  sonde_error error;
  sonde_ring *ring = (sonde_ring *)&error;
  assert_int_equal(sonde_ring_create(8, 3, &ring, &error), SONDE_ARGUMENT);
  assert_null(ring);
  assert_non_null(strstr(error.message, "power of two"));
  assert_int_equal(sonde_ring_create(8, 0, &ring, NULL), SONDE_ARGUMENT);
  assert_int_equal(sonde_ring_create(0, 4, &ring, NULL), SONDE_ARGUMENT);
  sonde_ring_destroy(NULL);
}

static void ring_keeps_order_and_says_full(void **state) {
  (void)state;
  sonde_ring *ring;
  assert_int_equal(sonde_ring_create(sizeof(uint64_t), 4, &ring, NULL), SONDE_OK);
  uint64_t in = 0, out = 0, value;
  assert_false(sonde_ring_pop(ring, &value));
  for (int round = 0; round < 10; ++round) { // the counters wrap around the four places
    while (sonde_ring_push(ring, &in)) in++;
    assert_int_equal(in - out, 4);
    for (int i = 0; i < 3; ++i) {
      assert_true(sonde_ring_pop(ring, &value));
      assert_int_equal(value, out);
      out++;
    }
  }
  sonde_ring_destroy(ring);
}

static void *push_all(void *argument) {
  sonde_ring *ring = argument;
  for (uint64_t i = 0; i < RECORDS; ++i) {
    record r = record_of(i);
    while (!sonde_ring_push(ring, &r)) sched_yield();
  }
  return NULL;
}

static void ring_between_threads_loses_nothing(void **state) {
  (void)state;
  sonde_ring *ring;
  assert_int_equal(sonde_ring_create(sizeof(record), 64, &ring, NULL), SONDE_OK);
  pthread_t writer;
  assert_int_equal(pthread_create(&writer, NULL, push_all, ring), 0);
  uint64_t wrong = 0;
  for (uint64_t i = 0; i < RECORDS; ++i) {
    record got, expected = record_of(i);
    while (!sonde_ring_pop(ring, &got)) sched_yield();
    wrong += memcmp(&got, &expected, sizeof got) != 0;
  }
  pthread_join(writer, NULL);
  assert_int_equal(wrong, 0);
  record rest;
  assert_false(sonde_ring_pop(ring, &rest));
  sonde_ring_destroy(ring);
}

static void mailbox_gives_newest_once(void **state) {
  (void)state;
  sonde_mailbox *mailbox;
  assert_int_equal(sonde_mailbox_create(0, &mailbox, NULL), SONDE_ARGUMENT);
  assert_int_equal(sonde_mailbox_create(sizeof(int), &mailbox, NULL), SONDE_OK);
  assert_null(sonde_mailbox_read(mailbox));
  for (int i = 1; i <= 7; ++i) {
    *(int *)sonde_mailbox_write_slot(mailbox) = i;
    sonde_mailbox_publish(mailbox);
  }
  const int *got = sonde_mailbox_read(mailbox);
  assert_non_null(got);
  assert_int_equal(*got, 7);
  assert_null(sonde_mailbox_read(mailbox));
  for (int i = 8; i <= 20; ++i) { // the slot in the reader's hand is never written
    *(int *)sonde_mailbox_write_slot(mailbox) = i;
    sonde_mailbox_publish(mailbox);
    assert_int_equal(*got, 7);
  }
  assert_int_equal(*(const int *)sonde_mailbox_read(mailbox), 20);
  sonde_mailbox_destroy(mailbox);
  sonde_mailbox_destroy(NULL);
}

static void *publish_all(void *argument) {
  sonde_mailbox *mailbox = argument;
  for (uint64_t i = 1; i <= PUBLISHED; ++i) {
    record *slot = sonde_mailbox_write_slot(mailbox);
    *slot = record_of(0);
    for (unsigned k = 0; k < WORDS; ++k) slot->word[k] += i * WORDS;
    sonde_mailbox_publish(mailbox);
  }
  return NULL;
}

static void mailbox_between_threads_is_whole_and_newer(void **state) {
  (void)state;
  sonde_mailbox *mailbox;
  assert_int_equal(sonde_mailbox_create(sizeof(record), &mailbox, NULL), SONDE_OK);
  pthread_t writer;
  assert_int_equal(pthread_create(&writer, NULL, publish_all, mailbox), 0);
  uint64_t last = 0, torn = 0, older = 0;
  while (last < (uint64_t)PUBLISHED * WORDS) {
    const record *slot = sonde_mailbox_read(mailbox);
    if (!slot) {
      sched_yield();
      continue;
    }
    uint64_t number = 0;
    torn += !is_whole(slot, &number);
    older += number <= last;
    last = slot->word[0];
    torn += !is_whole(slot, &number) || number != last; // still the same while we hold it
  }
  pthread_join(writer, NULL);
  assert_int_equal(torn, 0);
  assert_int_equal(older, 0);
  sonde_mailbox_destroy(mailbox);
}

static void clock_rises_and_sleeps_long_enough(void **state) {
  (void)state;
  double start = sonde_clock_now(), before = start;
  for (int i = 0; i < 1000; ++i) {
    double now = sonde_clock_now();
    assert_true(now >= before);
    before = now;
  }
  sonde_clock_sleep_until(start - 1.0); // past: returns
  sonde_clock_sleep_until(-3.0);
  for (int i = 1; i <= 20; ++i) {
    double target = start + 0.05 + 0.0037 * i;
    sonde_clock_sleep_until(target);
    assert_true(sonde_clock_now() >= target - 1e-9);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(ring_rejects_bad_sizes),
      cmocka_unit_test(ring_keeps_order_and_says_full),
      cmocka_unit_test(ring_between_threads_loses_nothing),
      cmocka_unit_test(mailbox_gives_newest_once),
      cmocka_unit_test(mailbox_between_threads_is_whole_and_newer),
      cmocka_unit_test(clock_rises_and_sleeps_long_enough),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
