// The thigh under the probe: controls and ticks.
#include "exam/subject.h"

#include "base/base.h"
#include "base/maths.h"
#include "haptics/gel.h"
#include "world/state.h"

#include <string.h>

static const double off_m = 0.2; // a probe that is taken off, from the skin
static const double portion_m3 = 2e-6, portion_radius_m = 0.015;

static void apply_tissue(sonde_subject *subject) {
  sonde_preset p = sonde_setup_preset(&subject->setup, &subject->now.controls);
  sonde_tuning tuning = {p.stiffness_scale, p.damping_multiplier, p.normal_damping_s,
                         p.edge_damping_s};
  sonde_state_retune(subject->state, &tuning);
}

static void apply_friction(sonde_subject *subject) {
  sonde_friction friction = sonde_setup_preset(&subject->setup, &subject->now.controls).friction;
  if (subject->now.controls.gel) {
    friction.gel_film = 0;
    friction =
        sonde_gel_friction(subject->gel, sonde_state_contact_forces(subject->state), &friction);
  }
  subject->now.friction = friction;
  sonde_state_rub(subject->state, &friction);
}

void sonde_subject_control(sonde_subject *subject, const sonde_session_controls *controls) {
  SONDE_ASSERT(controls->stiffness_scale > 0 && controls->friction_scale >= 0);
  sonde_session_controls before = subject->now.controls;
  double time_s = sonde_state_time(subject->state);
  subject->now.controls = *controls;
  // A model that says how it is held brings what its posture adds.
  const bool held = v_norm2(subject->model->gravity.up) > 0;
  subject->now.circulation.posture = held ? SONDE_POSTURE_SUPINE : controls->posture;
  if (controls->valsalva != before.valsalva)
    sonde_circulation_strain(&subject->now.circulation, time_s, controls->valsalva);
  if (!subject->now.placed) subject->now.hand = (sonde_hand_moment){-INFINITY, -INFINITY};
  if (subject->now.placed && controls->squeeze != before.squeeze)
    subject->now.hand.squeeze_s = time_s;
  if (subject->now.placed && controls->deep_breath != before.deep_breath)
    subject->now.hand.breath_s = time_s;
  if (!subject->now.placed ||
      !(before.preset == controls->preset && before.stiffness_scale == controls->stiffness_scale &&
        before.damping_scale == controls->damping_scale))
    apply_tissue(subject);
  // A counter that ran far ahead asks for no more than a few portions.
  const sonde_session_controls *now = &subject->now.controls;
  uint32_t portions = now->gel_put - before.gel_put;
  if (subject->now.placed) {
    if (now->gel_wipe != before.gel_wipe) sonde_gel_wipe(subject->gel);
    if (portions != 0) {
      sonde_vec3 centre_m = subject->model->surface.vertices[(
          v_nearest(sonde_state_positions(subject->state), subject->model->surface.vertex_count,
                    subject->now.pose.position))];
      sonde_gel_put(subject->gel, centre_m, portion_radius_m, portion_m3 * fmin(portions, 5));
    }
  }
  apply_friction(subject);
}

void sonde_subject_step(sonde_subject *subject, const sonde_probe *probe, sonde_pose pose) {
  sonde_subject_moment *now = &subject->now;
  SONDE_ASSERT(subject->state != NULL && v_finite(pose.position));
  sonde_vec3 way = now->placed ? v_sub(pose.position, now->pose.position) : vec3(0, 0, 0);
  sonde_vec3 speed = v_scale(way, 1 / subject->dt_s);
  now->drift_m_s = v_madd(now->drift_m_s, 1.0 / SONDE_GEL_TICKS, v_sub(speed, now->drift_m_s));
  bool off = sonde_subject_guard(subject, probe, pose);
  now->pose = pose;
  now->placed = true;
  sonde_step(subject->state, off || subject->solid ? NULL : probe, pose);
  now->carried = sonde_state_flags(subject->state) & SONDE_FLAG_INSIDE_OUT;
  if (subject->solid) {
    // A probe that is taken off leaves the skin along its axis.
    sonde_solid_contact contact;
    sonde_pose at = pose;
    if (off) at.position = v_madd(pose.position, -off_m, q_rotate(pose.rotation, vec3(0, 0, 1)));
    now->did = sonde_solid_leg_tick(subject->solid, (uint32_t)(probe - subject->probes), at,
                                    subject->told, &contact);
    now->broken = !v_finite(contact.force_n) || !v_finite(contact.torque_nm);
    if (now->broken) contact = (sonde_solid_contact){0};
    subject->felt.force_n = contact.force_n, subject->felt.torque_n_m = contact.torque_nm;
    subject->felt.reaction_n = v_scale(contact.force_n, -1);
    subject->felt.area_m2 = contact.area_m2;
    const double felt[] = {
        contact.force_n.x,   contact.force_n.y,   contact.force_n.z, contact.torque_nm.x,
        contact.torque_nm.y, contact.torque_nm.z, now->did};
    now->felt_hash = sonde_hash(now->felt_hash, felt, sizeof felt);
  }
  if (now->controls.gel) {
    uint32_t part = (uint32_t)((sonde_state_tick(subject->state) - 1) % SONDE_GEL_TICKS);
    sonde_gel_part(subject->gel, sonde_state_contact_forces(subject->state), subject->now.drift_m_s,
                   SONDE_GEL_TICKS * subject->dt_s, part, SONDE_GEL_TICKS);
    bool touching = sonde_subject_contact(subject)->area_m2 > 0;
    if (part + 1 == SONDE_GEL_TICKS || touching != subject->now.touching) apply_friction(subject);
    subject->now.touching = touching;
  }
}

sonde_pathology sonde_subject_pathology(const sonde_subject *subject) {
  sonde_pathology pathology = subject->now.controls.pathology;
  if (subject->setup.circulate)
    sonde_circulation_apply(&subject->now.circulation, sonde_state_tick(subject->state),
                            subject->dt_s, &pathology);
  return pathology;
}

size_t sonde_subject_save(const sonde_subject *subject, void *out) {
  size_t bytes = subject->model->surface.vertex_count * sizeof(double);
  const sonde_gel *gel = subject->gel;
  const double *const arrays[] = {gel->film_m, gel->moisture, gel->change_m3, gel->push_pa};
  char *to = out;
  if (out) {
    sonde_subject_moment now = subject->now;
    if (subject->solid) (void)sonde_solid_leg_remember(subject->solid, &now.rest);
    memcpy(to, &now, sizeof now);
  }
  for (size_t k = 0; out && k < SONDE_COUNT_OF(arrays); ++k)
    memcpy(to + sizeof subject->now + k * bytes, arrays[k], bytes);
  return sizeof subject->now + SONDE_COUNT_OF(arrays) * bytes;
}

void sonde_subject_restore(sonde_subject *subject, const void *saved) {
  SONDE_ASSERT(saved != NULL);
  size_t bytes = subject->model->surface.vertex_count * sizeof(double);
  sonde_gel *gel = subject->gel;
  double *const arrays[] = {gel->film_m, gel->moisture, gel->change_m3, gel->push_pa};
  const char *from = saved;
  memcpy(&subject->now, from, sizeof subject->now);
  for (size_t k = 0; k < SONDE_COUNT_OF(arrays); ++k)
    memcpy(arrays[k], from + sizeof subject->now + k * bytes, bytes);
  apply_tissue(subject);
  sonde_state_rub(subject->state, &subject->now.friction);
}

size_t sonde_subject_size(const sonde_subject *subject) {
  return sonde_subject_save(subject, NULL) + sonde_state_size(subject->state);
}

size_t sonde_subject_remember(const sonde_subject *subject, void *out) {
  size_t own = sonde_subject_save(subject, out);
  return own + sonde_state_save(subject->state, (char *)out + own);
}

uint64_t sonde_subject_saved_hash(const sonde_subject *subject, const void *saved) {
  size_t own = sonde_subject_save(subject, NULL);
  sonde_subject_moment moment;
  memcpy(&moment, saved, sizeof moment);
  const uint64_t hash = sonde_state_saved_hash(subject->model, (const char *)saved + own);
  return subject->solid ? sonde_hash(hash, &moment.felt_hash, sizeof moment.felt_hash) : hash;
}

uint64_t sonde_subject_hash(const sonde_subject *subject) {
  const uint64_t hash = sonde_state_hash(subject->state), felt = subject->now.felt_hash;
  return subject->solid ? sonde_hash(hash, &felt, sizeof felt) : hash;
}

const sonde_contact *sonde_subject_contact(const sonde_subject *subject) {
  return subject->solid ? &subject->felt : sonde_state_contact(subject->state);
}

bool sonde_subject_savable(const sonde_subject *subject) {
  sonde_leg_moment moment;
  return !subject->solid || sonde_solid_leg_remember(subject->solid, &moment);
}
