// The contact of every engine: the probe's planes, regions of touched skin, force on the probe.
#ifndef SONDE_SRC_CONTACT_H
#define SONDE_SRC_CONTACT_H

#include "world/state.h"

#include "base/maths.h"

// The sides of a turned box face backwards by rounding.
static inline bool pushes_forward(const sonde_state *state, sonde_vec3 slope) {
  return v_dot(slope, state->inward) <= 1e-9;
}

// Gradient of the depth t = weight (d - n.x) under one plane.
static inline sonde_vec3 plane_slope(const sonde_state *state, uint32_t k) {
  return v_scale(state->plane_normal[k], -state->plane_weight[k]);
}

// No node is touched. @thread tick
void sonde_contact_forget(sonde_state *state);
// The probe's planes in the world frame. @thread tick
void sonde_contact_place(sonde_state *state, const sonde_probe *probe, sonde_pose pose);
// Joins the regions of two touched nodes; of touched nodes beside one another. @thread tick
void sonde_contact_join(sonde_state *state, uint32_t a, uint32_t b);
void sonde_nodes_join(sonde_state *state);
// Volume, its rate, area and direction of the regions, and which one a touched node belongs to.
// @thread tick
void sonde_contact_regions(sonde_state *state, const sonde_motion *probe);
uint32_t sonde_contact_region_of(const sonde_state *state, uint32_t i);
// Force and torque on the probe, forces and centres of the regions from the pushes. @thread tick
void sonde_contact_wrench(sonde_state *state, sonde_vec3 origin);
// Box of the probe in the world. @thread tick
sonde_box sonde_contact_box(const sonde_probe *probe, sonde_pose pose);
// After a step: whether the probe holds skin that rests elsewhere (SONDE_FLAG_INSIDE_OUT).
// @thread tick
bool sonde_contact_is_inside_out(const sonde_state *state, const sonde_probe *probe,
                                 sonde_pose pose);

// How a bond enters the linear system of a step: scales of its damping and stiffness.
typedef struct sonde_contact_scales {
  double damping, stiffness;
} sonde_contact_scales;
// Force of the bond of a touched node where it is evaluated and its part of the matrix; false where
// there is none. @thread tick
bool sonde_friction_at(const sonde_state *state, uint32_t i, const sonde_motion *probe,
                       const sonde_contact_scales *scales, sonde_vec3 *force, sonde_mat3 *block);
// Bonds, normal pushes and the coefficient at the end of the step; adds friction to
// contact_force[]. @thread tick
void sonde_friction_advance(sonde_state *state, const sonde_motion *probe);
// Forgets all bonds. @thread tick
void sonde_friction_release(sonde_state *state);

#endif
