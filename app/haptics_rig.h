// A hand that presses the thigh through a device's limits: shared by sonde bench --haptics and
// sonde validate haptics.
#ifndef SONDE_APP_HAPTICS_RIG_H
#define SONDE_APP_HAPTICS_RIG_H

#include "sonde/sonde.h"

typedef struct haptics_rig_def {
  const sonde_model *model;
  const sonde_probe *probe;
  const sonde_site *site;
  const sonde_device_limits *limits;
  double mass_kg, damping_n_s_m; // of the hand
  double depth_m;                // that the handle is pressed to
  bool direct;                   // neither coupling nor controller, nor local model
  int slow_ticks;                // the scene answers so seldom and as late; 0: every tick
  bool faultless;                // speed, impulse and heat are not watched
} haptics_rig_def;

typedef struct haptics_rig {
  haptics_rig_def def;
  sonde_state *state; // borrowed
  sonde_device device;
  sonde_render render;
  sonde_safety safety;
  sonde_local local;
  sonde_vec3 felt_n, held_n; // tissue force of this tick; newest answer of a slow scene
  sonde_vec3 asked_m, asked_m_s, asked_n; // the answer that is under way
  sonde_vec3 last_m;
  uint64_t tick;
  double max_force_n, max_step_n; // rendered: largest, and largest change in a tick
} haptics_rig;

// The world that sessions use.
sonde_world_def haptics_world(void);
// Starts over at rest: 5 mm above the skin, pressed within half a second, then held.
sonde_status haptics_rig_start(haptics_rig *rig, const haptics_rig_def *def, sonde_state *state,
                               sonde_error *error);
// The same with any device; `device` is taken over.
void haptics_rig_follow(haptics_rig *rig, const haptics_rig_def *def, sonde_state *state,
                        sonde_device device);
void haptics_rig_tick(haptics_rig *rig);
void haptics_rig_stop(haptics_rig *rig);
// How deep the handle is below the rest skin of the site.
double haptics_rig_depth(const haptics_rig *rig);

#endif
