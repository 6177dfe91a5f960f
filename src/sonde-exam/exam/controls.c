// Controls of a session: cleaning, and sharing with readers that must not wait.
#include "exam/session.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static double usable_real(double wanted, double before, double low, double high) {
  return isfinite(wanted) ? clamp(wanted, low, high) : before;
}

sonde_session_controls sonde_controls_clean(const sonde_session_controls *wanted,
                                            const sonde_session_controls *before,
                                            uint32_t probe_count) {
  SONDE_ASSERT(before->probe < probe_count);
  sonde_session_controls controls = *wanted;
  if (controls.probe >= probe_count) controls.probe = before->probe;
  // Ranges are physiological with a wide margin; 1e5 Pa is 750 mmHg.
  sonde_pathology *p = &controls.pathology;
  const sonde_pathology *q = &before->pathology;
  p->name[sizeof p->name - 1] = 0;
  p->venous_pressure_pa = usable_real(p->venous_pressure_pa, q->venous_pressure_pa, 0.0, 1e5);
  p->arterial_pressure_pa = usable_real(p->arterial_pressure_pa, q->arterial_pressure_pa, 0.0, 1e5);
  p->thrombus_fraction = usable_real(p->thrombus_fraction, q->thrombus_fraction, 0.0, 1.0);
  p->thrombus_modulus_pa = usable_real(p->thrombus_modulus_pa, q->thrombus_modulus_pa, 0.0, 1e8);
  p->thrombus_from_m = usable_real(p->thrombus_from_m, q->thrombus_from_m, -10.0, 10.0);
  p->thrombus_to_m = usable_real(p->thrombus_to_m, q->thrombus_to_m, -10.0, 10.0);
  p->lumen_scale = usable_real(p->lumen_scale, q->lumen_scale, 0.1, 3.0);
  p->echogenicity = usable_real(p->echogenicity, q->echogenicity, 0.0, 1.0);
  if ((unsigned)p->form > SONDE_CLOT_RECANALISED) p->form = q->form;
  controls.echo = sonde_echo_settings_clamp(wanted->echo);
  controls.duplex = sonde_duplex_clean(&wanted->duplex, &before->duplex);
  if ((unsigned)controls.posture >= SONDE_POSTURE_COUNT) controls.posture = before->posture;
  if (controls.preset >= SONDE_SESSION_PRESETS) controls.preset = before->preset;
  controls.stiffness_scale =
      usable_real(wanted->stiffness_scale, before->stiffness_scale, 0.5, 2.0);
  controls.damping_scale = usable_real(wanted->damping_scale, before->damping_scale, 0.25, 4.0);
  controls.friction_scale = usable_real(wanted->friction_scale, before->friction_scale, 0.0, 2.0);
  return controls;
}

void sonde_shared_controls_set(sonde_shared_controls *shared, const sonde_session_controls *value) {
  uint64_t words[SONDE_CONTROL_WORDS] = {0};
  memcpy(words, value, sizeof *value);
  unsigned sequence = atomic_load_explicit(&shared->sequence, memory_order_relaxed);
  SONDE_ASSERT(sequence % 2 == 0);
  atomic_store(&shared->sequence, sequence + 1);
  for (size_t i = 0; i < SONDE_CONTROL_WORDS; ++i) atomic_store(&shared->word[i], words[i]);
  atomic_store(&shared->sequence, sequence + 2);
}

sonde_session_controls sonde_shared_controls_get(const sonde_shared_controls *shared) {
  uint64_t words[SONDE_CONTROL_WORDS] = {0};
  unsigned before, after;
  do {
    before = atomic_load(&shared->sequence);
    for (size_t i = 0; i < SONDE_CONTROL_WORDS; ++i) words[i] = atomic_load(&shared->word[i]);
    after = atomic_load(&shared->sequence);
  } while (before != after || before % 2);
  sonde_session_controls value;
  memcpy(&value, words, sizeof value);
  return value;
}
