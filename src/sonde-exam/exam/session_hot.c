// One tick of a session. Nothing here or below it allocates, locks, prints or waits.
#include "exam/session.h"
#include "exam/vessels.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"
#include "haptics/motion.h"
#include "sonde/haptics_gel.h"

#include <string.h>

static void push(sonde_session *session, const sonde_record *record) {
  if (!session->records || sonde_ring_push(session->records, record)) return;
  uint64_t lost = atomic_load_explicit(&session->lost_records, memory_order_relaxed);
  atomic_store_explicit(&session->lost_records, lost + 1, memory_order_relaxed);
}

// Shared by live and replayed ticks: what the world depends on belongs here.
static void step_world(sonde_session *session) {
  const sonde_probe *probe = &session->probes[session->controls.probe];
  sonde_subject_step(session->subject, probe, session->sample.world_from_probe);
}

// Tissue that nothing touches is soon at rest, and quick to go through.
uint64_t sonde_session_keyframe_tick(const sonde_session *session, uint64_t tick) {
  uint64_t near = tick + 2 * (uint64_t)session->ticks_per_image - 1,
           period = session->keyframe_period;
  if (!sonde_subject_savable(session->subject)) return 0;
  bool touching = sonde_subject_contact(session->subject)->area_m2 > 0;
  return touching || near / period % 2 == 0 ? near / period * period : 0;
}

size_t sonde_session_remember_tick(const sonde_session *session, sonde_tick_memory *memory,
                                   void *world) {
  memory->controls = session->controls;
  memory->sample = session->sample;
  return sonde_subject_remember(session->subject, world);
}

void sonde_session_offer(sonde_session *session) {
  unsigned char *slot = sonde_mailbox_write_slot(session->surface_box);
  sonde_surface_slot *head = (sonde_surface_slot *)(void *)slot;
  sonde_snapshot *snapshot = &head->snapshot;
  *snapshot = sonde_snapshot_of(session->state, session->sample.world_from_probe);
  const sonde_contact *contact = sonde_subject_contact(session->subject);
  snapshot->solid = session->subject->solid != NULL;
  snapshot->force_n = contact->force_n;
  snapshot->force_normal_n =
      -v_dot(contact->force_n, q_rotate(snapshot->world_from_probe.rotation, vec3(0, 0, 1)));
  snapshot->contact_volume_m3 = contact->volume_m3, snapshot->contact_area_m2 = contact->area_m2;
  snapshot->probe = session->controls.probe;
  snapshot->rendered_force_n = session->safety.force_n;
  snapshot->flags = sonde_subject_flags(session->subject);
  snapshot->restores = session->subject->now.restores;
  snapshot->fault = session->safety.fault;
  head->controls = session->controls;
  head->pathology = sonde_subject_pathology(session->subject);
  head->circulation = session->subject->now.circulation;
  head->hand = session->subject->now.hand;
  head->pose_s = session->last_tick_s;
  // All that the next tick depends on goes to the recorder when a keyframe is due.
  uint64_t place =
      session->world_box ? sonde_session_keyframe_tick(session, head->snapshot.tick) : 0;
  head->keyframe = place >= session->keyframe_tick;
  if (head->keyframe) {
    session->keyframe_tick = place + session->keyframe_period;
    sonde_world_slot *part = (void *)sonde_mailbox_write_slot(session->world_box);
    part->tick = sonde_state_tick(session->state);
    part->bytes = sonde_session_remember_tick(session, &part->memory, part + 1);
    sonde_mailbox_publish(session->world_box);
  }
  size_t bytes = session->nodes * sizeof(sonde_vec3);
  memcpy(slot + session->positions_at, sonde_state_positions(session->state), bytes);
  memcpy(slot + session->forces_at, sonde_state_contact_forces(session->state), bytes);
  if (session->controls.gel)
    memcpy(slot + session->film_at, sonde_gel_film(session->subject->gel),
           session->nodes * sizeof(double));
  head->place = NULL;
  if (session->subject->solid)
    head->place =
        sonde_solid_leg_offer(session->subject->solid, (void *)(slot + session->solid_at));
  session->offered_tick = head->snapshot.tick;
  atomic_store_explicit(&session->surface_pending, true, memory_order_relaxed);
  sonde_mailbox_publish(session->surface_box);
}

void sonde_session_step(sonde_session *session) {
  uint64_t tick = atomic_load_explicit(&session->ticks, memory_order_relaxed);
  // A stop that newer controls have taken back before any tick saw it still trips.
  if (atomic_exchange_explicit(&session->stop_pressed, false, memory_order_acquire))
    sonde_safety_trip(&session->safety, SONDE_FAULT_STOPPED);
  const sonde_session_controls *newest = sonde_mailbox_read(session->control_box);
  if (newest) {
    bool resume = newest->resume != session->controls.resume;
    session->controls = *newest;
    SONDE_ASSERT(session->controls.probe < session->probe_count);
    if (resume && !newest->stop) sonde_safety_resume(&session->safety);
    sonde_subject_control(session->subject, newest);
    sonde_record change = {.tag = SONDE_RECORD_CONTROLS, .tick = tick};
    change.controls = session->controls;
    push(session, &change);
  }
  // A pose that is not one counts as an absent device; the device then stays where it was. What is
  // recorded is the probe's pose behind the coupling: a replay needs no device.
  sonde_device_sample sample = session->sample;
  session->device.read(session->device.self, tick, &sample);
  if (sonde_pose_usable(sample.world_from_probe)) {
    sample.world_from_probe.rotation = q_unit(sample.world_from_probe.rotation);
  } else {
    sample.world_from_probe = session->sample.world_from_probe;
    if (session->render.started) sample.world_from_probe.position = session->render.device_m;
    sample.present = false;
  }
  if (!sample.present) sonde_safety_trip(&session->safety, SONDE_FAULT_DEVICE_LOST);
  sonde_safety_motion(&session->safety, sample.world_from_probe.position, session->dt_s);
  sample.world_from_probe =
      sonde_render_probe(&session->render, sample.world_from_probe,
                         sonde_subject_contact(session->subject)->force_n, session->safety.force_n);
  session->sample = sample;
  sonde_record record = {.tag = SONDE_RECORD_TICK, .tick = tick};
  record.sample = sample;
  step_world(session);
  record.did = session->subject->now.did;
  push(session, &record);
  if (sonde_subject_flags(session->subject) & SONDE_FLAG_NON_FINITE)
    sonde_safety_trip(&session->safety, SONDE_FAULT_NON_FINITE);
  const sonde_contact *contact = sonde_subject_contact(session->subject);
  sonde_render_force(&session->render, contact->force_n);
  sonde_vec3 torque = v_scale(contact->torque_n_m, session->render.def.force_scale);
  sonde_safety_apply(&session->safety, session->render.force_n, torque, session->dt_s);
  session->device.write(session->device.self, session->safety.force_n, session->safety.torque_n_m);
  atomic_store_explicit(&session->fault, (int)session->safety.fault, memory_order_relaxed);
  // In lockstep an image every so many ticks; in real time when the last one is finished, but no
  // sooner: every surface that is offered becomes an image, so that a replay can make the same
  // ones.
  const uint32_t period = session->ticks_per_image;
  bool due = session->realtime
                 ? tick + 1 - session->offered_tick >= period &&
                       !atomic_load_explicit(&session->surface_pending, memory_order_acquire)
                 : (tick + 1) % period == 0;
  if (due) {
    sonde_record made = {.tag = SONDE_RECORD_IMAGE, .tick = tick + 1};
    made.image = (sonde_record_image){session->safety.force_n, session->safety.fault};
    push(session, &made);
    sonde_session_offer(session);
  }
  SONDE_ASSERT(sonde_state_tick(session->state) == tick + 1);
  atomic_store_explicit(&session->ticks, tick + 1, memory_order_release);
}

void sonde_session_replay(sonde_session *session, const sonde_session_controls *controls,
                          const sonde_device_sample *sample, uint32_t told) {
  uint64_t tick = atomic_load_explicit(&session->ticks, memory_order_relaxed);
  if (controls) {
    session->controls = *controls;
    sonde_subject_control(session->subject, controls);
  }
  session->sample = *sample;
  session->subject->told = told;
  step_world(session);
  SONDE_ASSERT(sonde_state_tick(session->state) == tick + 1);
  atomic_store_explicit(&session->ticks, tick + 1, memory_order_release);
}

void sonde_session_realtime_tick(void *user) {
  sonde_session *session = user;
  double now_s = sonde_clock_now();
  if (session->last_tick_s > 0.0 && now_s - session->last_tick_s > session->safety.limits.stale_s)
    sonde_safety_trip(&session->safety, SONDE_FAULT_STALE);
  session->last_tick_s = now_s;
  sonde_session_step(session);
}
