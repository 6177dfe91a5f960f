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

// Makes a node one of the touched; before its share and gradient are added to. @thread tick
void sonde_contact_touch(sonde_state *state, uint32_t i);
// Joins the regions of two touched nodes. @thread tick
void sonde_contact_join(sonde_state *state, uint32_t a, uint32_t b);
// FOUNDATION in the fast engine: a face near the probe, with its push when a point is inside; the
// pushes at probed[], those at the end of the step, and the square of the difference between these
// and the ones that nodes meet when they go on by h dv (uses right[]). @thread tick
void sonde_faces_sample(sonde_state *state, uint32_t face);
void sonde_faces_apply(sonde_state *state, const sonde_motion *probe,
                       const sonde_contact_scales *scales);
void sonde_faces_advance(sonde_state *state, double h);
double sonde_faces_surprise(sonde_state *state, const sonde_motion *probe, double h);
// What the ties take from the product of the matrix with the directions, into carry[] of press[].
void sonde_faces_carry(struct sonde_lanes *lanes);

#endif
