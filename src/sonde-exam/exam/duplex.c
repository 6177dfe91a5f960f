// Life of a session's duplex, and its controls.
#include "exam/duplex.h"

#include "base/base.h"
#include "base/maths.h"
#include "sonde/limb_model.h"

sonde_duplex_controls sonde_duplex_controls_default(void) {
  return (sonde_duplex_controls){.box = {-0.014, 0.014, 0.006, 0.036, 0, 0},
                                 .scale_m_s = 0.06,
                                 .gate = sonde_gate_settings_default()};
}

sonde_status sonde_duplex_create(const sonde_model *model, const sonde_interior *interior,
                                 const sonde_echo *echo, sonde_duplex **out, sonde_error *error) {
  SONDE_ASSERT(model && interior && echo && out);
  *out = NULL;
  const sonde_limb *limb = sonde_limb_of(model);
  sonde_duplex *d = SONDE_NEW(sonde_duplex, 1);
  if (!d) return sonde_fail_memory(error);
  d->echo = echo;
  sonde_flow_def body = sonde_flow_def_default(limb);
  sonde_flow_def_hold(sonde_limb_pose_of(model), &body);
  d->cells = SONDE_NEW(sonde_colour_cell, SONDE_COLOUR_CELLS);
  sonde_status status = d->cells ? SONDE_OK : sonde_fail_memory(error);
  const sonde_colour_def colour = sonde_colour_def_default(); // drawing tunes it
  if (!status) status = sonde_colour_create(&colour, &d->colour, error);
  if (!status) status = sonde_flow_scene_create(limb, interior, &d->scene, error);
  if (!status) status = sonde_gate_create(&d->gate, error);
  if (!status) status = sonde_flow_start(&body, &d->body, error);
  if (status)
    sonde_duplex_destroy(d);
  else
    *out = d;
  return status;
}

void sonde_duplex_destroy(sonde_duplex *d) {
  if (!d) return;
  sonde_flow_scene_destroy(d->scene);
  sonde_colour_destroy(d->colour);
  sonde_gate_destroy(d->gate);
  sonde_free(d->cells);
  sonde_free(d);
}

sonde_duplex_controls sonde_duplex_clean(const sonde_duplex_controls *wanted,
                                         const sonde_duplex_controls *before) {
  SONDE_ASSERT(wanted && before);
  sonde_duplex_controls c = *wanted;
  if ((unsigned)c.shown > SONDE_DUPLEX_POWER) c.shown = before->shown;
  const double least_m = sonde_duplex_least_m;
  const struct {
    double *to, from, low, high;
  } NUMBER[] = {{&c.box.left_m, before->box.left_m, -0.1, 0.1 - least_m},
                {&c.box.right_m, before->box.right_m, c.box.left_m + least_m, 0.1},
                {&c.box.top_m, before->box.top_m, 0, 0.2},
                {&c.box.bottom_m, before->box.bottom_m, 0, 0.25},
                {&c.box.steer_rad, before->box.steer_rad, -0.35, 0.35},
                {&c.scale_m_s, before->scale_m_s, 0.01, 1},
                {&c.gain_db, before->gain_db, -30, 20}};
  for (size_t i = 0; i < SONDE_COUNT_OF(NUMBER); ++i) {
    *NUMBER[i].to = clamp_wanted(*NUMBER[i].to, NUMBER[i].from, NUMBER[i].low, NUMBER[i].high);
  }
  c.box.right_m = fmax(c.box.right_m, c.box.left_m + least_m);
  c.box.bottom_m = fmax(c.box.bottom_m, c.box.top_m + least_m);
  c.box.radius_m = 0; // the scanner's, whatever is wanted
  c.gate = sonde_gate_clean(&wanted->gate, &before->gate);
  return c;
}

sonde_duplex_memory sonde_duplex_remember(const sonde_duplex *d) {
  SONDE_ASSERT(d != NULL);
  return (sonde_duplex_memory){d->flows, sonde_flow_scene_remember(d->scene)};
}

void sonde_duplex_recall(sonde_duplex *d, const sonde_duplex_memory *memory) {
  SONDE_ASSERT(d && memory);
  d->flows = memory->flows != 0;
  sonde_flow_scene_recall(d->scene, &memory->scene);
  sonde_duplex_forget(d);
}
