// The probe's planes, shared by the contact laws.
#ifndef SONDE_SRC_CONTACT_H
#define SONDE_SRC_CONTACT_H

#include "world/state.h"

#include "base/maths.h"

// The sides of a turned box face backwards by rounding.
static inline bool pushes_forward(const sonde_state *state, sonde_vec3 slope) {
  return v_dot(slope, state->inward) <= 1e-9;
}

// t = weight (d - n.x) for one plane.
static inline double plane_depth(const sonde_state *state, uint32_t k, sonde_vec3 x) {
  return state->plane_weight[k] * (state->plane_offset[k] - v_dot(state->plane_normal[k], x));
}

static inline sonde_vec3 plane_slope(const sonde_state *state, uint32_t k) {
  return v_scale(state->plane_normal[k], -state->plane_weight[k]);
}

// Joins the regions of two touched nodes. @thread tick
void sonde_contact_join(sonde_state *state, uint32_t a, uint32_t b);
// Joins the regions of touched nodes beside one another. @thread tick
void sonde_nodes_join(sonde_state *state);
// Parts of sonde_contact_detect() and sonde_contact_apply() for the fast engine: no node is
// touched; the probe's planes in the world frame; touched nodes are awake; regions. @thread tick
void sonde_contact_forget(sonde_state *state);
void sonde_contact_place(sonde_state *state, const sonde_probe *probe, sonde_pose pose);
void sonde_contact_wake(sonde_state *state);
void sonde_contact_regions(sonde_state *state, const sonde_motion *probe);
// The contact of the fast engine. Finds touched nodes and adds pushes and their part of the matrix
// to press[], with ties; near_probe is found. @thread tick
void sonde_press_detect(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                        const sonde_motion *motion);
// contact_force[] at the end of the step by the linear system; with `surprise` the square of the
// difference between these pushes and the ones that nodes meet where they go. @thread tick
double sonde_press_meet(sonde_state *state, bool surprise);

#endif
