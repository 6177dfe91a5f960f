// Controls as bytes of a recording (docs/recording.md): the one place that knows their order.
#include "exam/duplex.h"
#include "exam/record.h"

#include "base/base.h"
#include "base/maths.h"

#include <stddef.h>
#include <string.h>

// Members that follow each other in memory as in the file.
enum { ECHO = 6, PATHOLOGY = 8, BOX = 5, GATE = 9 };
_Static_assert(offsetof(sonde_echo_settings, tgc_db_per_m) == (ECHO - 1) * sizeof(double),
               "the settings' numbers from frequency_hz on");
_Static_assert(offsetof(sonde_pathology, echogenicity) ==
                   offsetof(sonde_pathology, venous_pressure_pa) + (PATHOLOGY - 1) * sizeof(double),
               "the pathology's numbers from venous_pressure_pa on");

_Static_assert(offsetof(sonde_colour_box, steer_rad) == (BOX - 1) * sizeof(double),
               "the box's numbers from left_m on");
_Static_assert(sizeof(sonde_gate_settings) == GATE * sizeof(double), "the gate's, from x_m on");

size_t sonde_controls_bytes(int version) {
  SONDE_ASSERT(version >= SONDE_RECORD_OLDEST && version <= SONDE_RECORD_VERSION);
  return version < 4 ? 152 : version < 9 ? 208 : version < 10 ? 280 : 360;
}

void sonde_controls_put(bytes_cursor *w, const sonde_session_controls *c) {
  const size_t start = w->count;
  const double *echo = &c->echo.frequency_hz, *vessels = &c->pathology.venous_pressure_pa;
  bytes_u32(w, c->stop ? 1 : 0);
  bytes_u32(w, c->resume);
  for (int i = 0; i < ECHO; ++i) bytes_f64(w, echo[i]);
  for (int i = 0; i < PATHOLOGY; ++i) bytes_f64(w, vessels[i]);
  bytes_put(w, c->pathology.name, sizeof c->pathology.name);
  bytes_f64(w, c->pathology.wall_shear_pa);
  bytes_u32(w, (c->gel ? 1u : 0u) | (c->valsalva ? 2u : 0u));
  bytes_u32(w, c->gel_put);
  bytes_u32(w, c->gel_wipe);
  bytes_u32(w, c->posture);
  bytes_u32(w, c->preset);
  bytes_f32(w, c->pathology.sheath);
  bytes_f64(w, c->stiffness_scale);
  bytes_f64(w, c->damping_scale);
  bytes_f64(w, c->friction_scale);
  bytes_u32(w, c->squeeze);
  bytes_u32(w, c->deep_breath);
  bytes_u32(w, c->duplex.shown);
  bytes_u32(w, c->pathology.form);
  for (int i = 0; i < BOX; ++i) bytes_f64(w, (&c->duplex.box.left_m)[i]);
  bytes_f64(w, c->duplex.scale_m_s);
  bytes_f64(w, c->duplex.gain_db);
  bytes_u32(w, c->duplex.gated ? 1 : 0);
  bytes_u32(w, 0);
  for (int i = 0; i < GATE; ++i) bytes_f64(w, (&c->duplex.gate.x_m)[i]);
  SONDE_ASSERT(w->count == start + sonde_controls_bytes(SONDE_RECORD_VERSION));
}

static double within(double value, double low, double high) {
  return value >= low && value <= high ? value : 1.0;
}

void sonde_controls_get(bytes_reader *r, int version, sonde_session_controls *c) {
  const unsigned char *start = r->at;
  *c = (sonde_session_controls){
      .probe = c->probe, .stiffness_scale = 1, .damping_scale = 1, .friction_scale = 1};
  const sonde_duplex_controls usual = sonde_duplex_controls_default();
  c->duplex = usual;
  double *echo = &c->echo.frequency_hz, *vessels = &c->pathology.venous_pressure_pa;
  c->stop = bytes_take_u32(r) & 1;
  c->resume = bytes_take_u32(r);
  for (int i = 0; i < ECHO; ++i) echo[i] = bytes_take_f64(r);
  for (int i = 0; i < PATHOLOGY; ++i) vessels[i] = bytes_take_f64(r);
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
    c->pathology.sheath = clamp(bytes_take_f32(r), 0, 1);
    c->stiffness_scale = within(bytes_take_f64(r), 0.5, 2.0);
    c->damping_scale = within(bytes_take_f64(r), 0.25, 4.0);
    c->friction_scale = within(bytes_take_f64(r), 0.0, 2.0);
  }
  if (version >= 9) {
    c->squeeze = bytes_take_u32(r);
    c->deep_breath = bytes_take_u32(r);
    const uint32_t shown = bytes_take_u32(r);
    const uint32_t form = bytes_take_u32(r);
    c->pathology.form = form <= SONDE_CLOT_RECANALISED ? (sonde_clot_form)form : SONDE_CLOT_MURAL;
    sonde_duplex_controls duplex = {.shown = shown <= SONDE_DUPLEX_POWER ? (sonde_duplex_shown)shown
                                                                         : SONDE_DUPLEX_OFF};
    for (int i = 0; i < BOX; ++i) (&duplex.box.left_m)[i] = bytes_take_f64(r);
    duplex.scale_m_s = bytes_take_f64(r);
    duplex.gain_db = bytes_take_f64(r);
    duplex.gate = usual.gate;
    if (version >= 10) {
      duplex.gated = bytes_take_u32(r) & 1;
      (void)bytes_take_u32(r);
      for (int i = 0; i < GATE; ++i) (&duplex.gate.x_m)[i] = bytes_take_f64(r);
    }
    c->duplex = sonde_duplex_clean(&duplex, &usual);
  }
  SONDE_ASSERT(r->at == start + sonde_controls_bytes(version));
}
