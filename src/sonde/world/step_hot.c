// One step of a state (docs/world.md): the probe's motion, the engine's step, and what is told of
// it.
#include "world/contact.h"
#include "world/engine.h"

#include "base/base.h"

static sonde_motion probe_motion(const sonde_state *state, sonde_pose pose) {
  sonde_motion motion = {.origin = pose.position};
  if (!state->has_probe_pose) return motion;
  double rate = 1.0 / state->def.dt_s;
  motion.velocity = v_scale(v_sub(pose.position, state->probe_pose.position), rate);
  sonde_quat turn = q_mul(pose.rotation, q_conj(state->probe_pose.rotation));
  double sign = turn.w < 0 ? -2 * rate : 2 * rate; // small angles: vector part is half the angle
  motion.spin = v_scale(vec3(turn.x, turn.y, turn.z), sign);
  return motion;
}

void sonde_step(sonde_state *state, const sonde_probe *probe, sonde_pose pose) {
  SONDE_ASSERT(state != NULL && state->engine != NULL);
  state->flags = 0;
  if (!v_finite(pose.position)) probe = NULL;
  sonde_motion motion = probe_motion(state, pose);
  bool finite = state->engine->calls->step(state, probe, pose, &motion);
  if (!finite) {
    sonde_state_relax(state);
    state->flags = SONDE_FLAG_NON_FINITE;
  } else if (probe && sonde_contact_is_inside_out(state, probe, pose)) {
    state->flags |= SONDE_FLAG_INSIDE_OUT;
  }
  state->tick++;
  state->flag_count += state->flags != 0;
  state->probe_pose = pose;
  state->has_probe_pose = probe != NULL;
}
