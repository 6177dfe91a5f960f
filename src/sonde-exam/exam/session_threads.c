// The threads of a session in real time, and the lockstep tick.
#include "exam/session.h"

#include "base/base.h"
#include "base/clock.h"

#include <string.h>

static void *image_main(void *argument) {
  sonde_session *session = argument;
  while (!atomic_load_explicit(&session->stop_image, memory_order_acquire)) {
    if (sonde_session_show(session)) continue;
    sonde_clock_sleep_until(sonde_clock_now() + 0.2e-3);
  }
  return NULL;
}

static void *record_main(void *argument) {
  sonde_session *session = argument;
  while (!atomic_load_explicit(&session->stop_record, memory_order_acquire)) {
    sonde_session_drain(session);
    sonde_clock_sleep_until(sonde_clock_now() + 5e-3);
  }
  return NULL;
}

// Does work of the solid whenever there is some, and looks for it so often.
static void *tend(sonde_session *session, bool (*work)(sonde_solid_leg *), double nap_s) {
  while (!atomic_load_explicit(&session->stop_solid, memory_order_acquire))
    if (!work(session->subject->solid)) sonde_clock_sleep_until(sonde_clock_now() + nap_s);
  return NULL;
}

static void *pass_main(void *session) { return tend(session, sonde_solid_leg_work, 0.5e-3); }

static void *place_main(void *session) { return tend(session, sonde_solid_leg_build, 2e-3); }

static sonde_status launch(pthread_t *thread, void *(*body)(void *), sonde_session *session,
                           bool *running, sonde_error *error) {
  int failure = pthread_create(thread, NULL, body, session);
  *running = failure == 0;
  if (failure)
    return sonde_fail(error, SONDE_MEMORY, "session: a thread could not be started: %s",
                      strerror(failure));
  return SONDE_OK;
}

sonde_status sonde_session_start(sonde_session *session, sonde_error *error) {
  SONDE_ASSERT(session != NULL);
  if (atomic_load(&session->loop)) return SONDE_OK;
  atomic_store(&session->stop_image, false);
  atomic_store(&session->stop_record, false);
  atomic_store(&session->stop_solid, false);
  session->last_tick_s = 0.0;
  session->realtime = true;
  sonde_loop *loop = NULL;
  sonde_status status =
      launch(&session->image_thread, image_main, session, &session->image_running, error);
  if (!status && session->recorder)
    status = launch(&session->record_thread, record_main, session, &session->record_running, error);
  if (!status && session->subject->solid) {
    status = launch(&session->pass_thread, pass_main, session, &session->pass_running, error);
    if (!status)
      status = launch(&session->place_thread, place_main, session, &session->place_running, error);
  }
  if (!status)
    status = sonde_loop_start(session->dt_s, sonde_session_realtime_tick, session, &loop, error);
  atomic_store(&session->loop, loop);
  if (status) sonde_session_stop(session);
  return status;
}

// In the order of the flow: tick, then those who live on what it left behind.
void sonde_session_stop(sonde_session *session) {
  sonde_loop *loop = atomic_exchange(&session->loop, NULL);
  if (loop) sonde_loop_stop(loop, &session->loop_stats);
  atomic_store(&session->stop_image, true);
  atomic_store(&session->stop_record, true);
  atomic_store(&session->stop_solid, true);
  if (session->pass_running) pthread_join(session->pass_thread, NULL);
  if (session->place_running) pthread_join(session->place_thread, NULL);
  session->pass_running = session->place_running = false;
  if (session->image_running) pthread_join(session->image_thread, NULL);
  if (session->record_running) pthread_join(session->record_thread, NULL);
  session->image_running = session->record_running = false;
  session->realtime = false;
  sonde_session_drain(session);
  sonde_session_show(session); // what was offered last
  sonde_session_drain(session);
}

void sonde_session_tick(sonde_session *session) {
  SONDE_ASSERT(!atomic_load(&session->loop));
  sonde_session_step(session);
  if (session->subject->solid)
    sonde_solid_leg_await(session->subject->solid, SONDE_LEG_PASS | SONDE_LEG_PLACE);
  sonde_session_show(session);
  sonde_session_drain(session);
}

sonde_session_solid_counts sonde_session_solid_count(const sonde_session *session) {
  SONDE_ASSERT(!atomic_load(&session->loop));
  if (!session->subject->solid) return (sonde_session_solid_counts){0};
  const sonde_leg_counts c = sonde_solid_leg_count(session->subject->solid);
  return (sonde_session_solid_counts){.passes = c.passes,
                                      .factors = c.factors,
                                      .ticks_without_place = c.without_place,
                                      .late = c.late,
                                      .places = c.places,
                                      .refused = c.refused,
                                      .pass_mean_s = c.passes ? c.pass_s / (double)c.passes : 0,
                                      .pass_most_s = c.pass_most_s,
                                      .build_s = c.build_s,
                                      .handed_over_n = c.handed_over_n};
}

sonde_loop_stats sonde_session_loop(const sonde_session *session) {
  sonde_loop *loop = atomic_load(&session->loop);
  return loop ? sonde_loop_read(loop) : session->loop_stats;
}
