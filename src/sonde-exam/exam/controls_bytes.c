// Controls as bytes of a recording (docs/recording.md): the one place that knows their order.
#include "exam/record.h"

#include "base/base.h"

#include <string.h>

size_t sonde_controls_bytes(int version) {
  SONDE_ASSERT(version >= SONDE_RECORD_OLDEST && version <= SONDE_RECORD_VERSION);
  return version < 4 ? 152 : 208;
}

void sonde_controls_put(bytes_cursor *w, const sonde_session_controls *c) {
  const size_t start = w->count;
  const sonde_pathology *p = &c->pathology;
  const sonde_echo_settings *e = &c->echo;
  const double numbers[] = {e->frequency_hz,
                            e->depth_m,
                            e->gain_db,
                            e->dynamic_range_db,
                            e->focus_m,
                            e->tgc_db_per_m,
                            p->venous_pressure_pa,
                            p->arterial_pressure_pa,
                            p->thrombus_fraction,
                            p->thrombus_modulus_pa,
                            p->thrombus_from_m,
                            p->thrombus_to_m,
                            p->lumen_scale,
                            p->echogenicity};
  bytes_u32(w, c->stop ? 1 : 0);
  bytes_u32(w, c->resume);
  for (size_t i = 0; i < SONDE_COUNT_OF(numbers); ++i) bytes_f64(w, numbers[i]);
  bytes_put(w, p->name, sizeof p->name);
  bytes_f64(w, c->pathology.wall_shear_pa);
  bytes_u32(w, (c->gel ? 1u : 0u) | (c->valsalva ? 2u : 0u));
  bytes_u32(w, c->gel_put);
  bytes_u32(w, c->gel_wipe);
  bytes_u32(w, c->posture);
  bytes_u32(w, c->preset);
  bytes_u32(w, 0);
  bytes_f64(w, c->stiffness_scale);
  bytes_f64(w, c->damping_scale);
  bytes_f64(w, c->friction_scale);
  SONDE_ASSERT(w->count == start + sonde_controls_bytes(SONDE_RECORD_VERSION));
}

static double within(double value, double low, double high) {
  return value >= low && value <= high ? value : 1.0;
}

void sonde_controls_get(bytes_reader *r, int version, sonde_session_controls *c) {
  const unsigned char *start = r->at;
  double n[14];
  *c = (sonde_session_controls){
      .probe = c->probe, .stiffness_scale = 1, .damping_scale = 1, .friction_scale = 1};
  c->stop = bytes_take_u32(r) & 1;
  c->resume = bytes_take_u32(r);
  for (int i = 0; i < 14; ++i) n[i] = bytes_take_f64(r);
  c->echo = (sonde_echo_settings){n[0], n[1], n[2], n[3], n[4], n[5]};
  c->pathology = (sonde_pathology){"", n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], 0};
  memcpy(c->pathology.name, r->at, sizeof c->pathology.name);
  c->pathology.name[sizeof c->pathology.name - 1] = 0;
  r->at += sizeof c->pathology.name;
  if (version >= 4) {
    // Numbers out of range are only in a file that no session wrote: a tick takes them as they are.
    c->pathology.wall_shear_pa = bytes_take_f64(r);
    uint32_t flags = bytes_take_u32(r);
    c->gel = flags & 1;
    c->valsalva = flags & 2;
    c->gel_put = bytes_take_u32(r);
    c->gel_wipe = bytes_take_u32(r);
    uint32_t posture = bytes_take_u32(r), preset = bytes_take_u32(r);
    c->posture = posture < SONDE_POSTURE_COUNT ? (sonde_posture)posture : SONDE_POSTURE_SUPINE;
    c->preset = preset < SONDE_SESSION_PRESETS ? preset : 0;
    (void)bytes_take_u32(r);
    c->stiffness_scale = within(bytes_take_f64(r), 0.5, 2.0);
    c->damping_scale = within(bytes_take_f64(r), 0.25, 4.0);
    c->friction_scale = within(bytes_take_f64(r), 0.0, 2.0);
  }
  SONDE_ASSERT(r->at == start + sonde_controls_bytes(version));
}
