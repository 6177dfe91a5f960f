// A hand that presses the thigh through a device's limits.
#include "haptics_rig.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double DT_S = 1e-3;

sonde_world_def haptics_world(void) { return sonde_session_def_default().world; }

void haptics_rig_follow(haptics_rig *rig, const haptics_rig_def *def, sonde_state *state,
                        sonde_device device) {
  assert(def->limits && device.read);
  *rig = (haptics_rig){.def = *def, .state = state, .device = device};
  sonde_render_def rendering = sonde_render_def_for(def->limits, DT_S, 0.0);
  if (def->direct) {
    rendering.stiffness_n_m = 0.0;
    rendering.controller = false;
  }
  sonde_render_init(&rig->render, &rendering);
  sonde_safety_limits bounds = sonde_safety_limits_of(def->limits);
  if (def->faultless) bounds.velocity_m_s = bounds.impulse_n_s = bounds.continuous_n = 0.0;
  sonde_safety_init(&rig->safety, &bounds);
  sonde_local_def local = sonde_local_def_default();
  if (def->slow_ticks) local.period_s = def->slow_ticks * DT_S;
  sonde_local_init(&rig->local, &local);
  sonde_state_reset(state);
}

sonde_status haptics_rig_start(haptics_rig *rig, const haptics_rig_def *def, sonde_state *state,
                               sonde_error *error) {
  assert(def->site && def->limits && def->mass_kg > 0);
  sonde_hand_def hand = sonde_hand_def_default();
  hand.mass_kg = def->mass_kg;
  hand.damping_n_s_m = def->damping_n_s_m;
  hand.tremor_m = 0.0;
  // at the goal the arm is stretched by what the device can push
  double goal = def->depth_m + 0.8 * def->limits->force_peak_n / hand.stiffness_n_m;
  const sonde_script_key keys[] = {{0.1, sonde_site_pose(def->site, -0.005)},
                                   {0.6, sonde_site_pose(def->site, goal)}};
  sonde_device device;
  sonde_status status = sonde_device_hand(&hand, keys, 2, DT_S, &device, error);
  if (status) return status;
  haptics_rig_follow(rig, def, state, device);
  return SONDE_OK;
}

static double norm(sonde_vec3 v) { return sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

void haptics_rig_tick(haptics_rig *rig) {
  assert(rig->device.read && rig->device.write);
  sonde_device_sample sample;
  sonde_vec3 before = rig->safety.force_n;
  rig->device.read(rig->device.self, rig->tick++, &sample);
  sonde_safety_motion(&rig->safety, sample.world_from_probe.position, DT_S);
  sonde_pose pose = sonde_render_probe(&rig->render, sample.world_from_probe, rig->felt_n, before);
  sonde_step(rig->state, rig->def.probe, pose);
  rig->felt_n = sonde_state_contact(rig->state)->force_n;
  if (rig->def.slow_ticks) {
    // What a scene that answers every so many ticks, and a period late, makes of the true force.
    sonde_vec3 v = {(pose.position.x - rig->last_m.x) / DT_S,
                    (pose.position.y - rig->last_m.y) / DT_S,
                    (pose.position.z - rig->last_m.z) / DT_S};
    if (rig->tick == 1) v = (sonde_vec3){0, 0, 0};
    rig->last_m = pose.position;
    if (rig->tick % (uint64_t)rig->def.slow_ticks == 0) {
      rig->held_n = rig->asked_n;
      if (rig->tick > (uint64_t)rig->def.slow_ticks)
        sonde_local_feed(&rig->local, rig->asked_m, rig->asked_m_s, rig->asked_n);
      rig->asked_m = pose.position;
      rig->asked_m_s = v;
      rig->asked_n = rig->felt_n;
    }
    sonde_vec3 model = sonde_local_force(&rig->local, pose.position);
    rig->felt_n = rig->def.direct ? rig->held_n : model;
  }
  sonde_render_force(&rig->render, rig->felt_n);
  sonde_safety_apply(&rig->safety, rig->render.force_n, (sonde_vec3){0, 0, 0}, DT_S);
  rig->device.write(rig->device.self, rig->safety.force_n, (sonde_vec3){0, 0, 0});
  sonde_vec3 f = rig->safety.force_n;
  sonde_vec3 step = {f.x - before.x, f.y - before.y, f.z - before.z};
  rig->max_force_n = fmax(rig->max_force_n, norm(f));
  rig->max_step_n = fmax(rig->max_step_n, norm(step));
}

void haptics_rig_stop(haptics_rig *rig) {
  if (rig->device.destroy) rig->device.destroy(rig->device.self);
  rig->device = (sonde_device){0};
}

double haptics_rig_depth(const haptics_rig *rig) {
  sonde_pose surface = sonde_site_pose(rig->def.site, 0.0),
             below = sonde_site_pose(rig->def.site, 1);
  sonde_vec3 at = rig->render.device_m, a = surface.position, b = below.position;
  return (at.x - a.x) * (b.x - a.x) + (at.y - a.y) * (b.y - a.y) + (at.z - a.z) * (b.z - a.z);
}
