// Motion of rigid bodies and the points at which a step evaluates forces (docs/scene_theory.md).
//
// The unknown of a free rigid body's second slot is the change of angular momentum, as I dw with
// the inertia I at the start of the step. Gyroscopic terms never appear: the momentum is carried
// over exactly and the spin follows from it, w = I(q)^-1 L.
#include "scene/state.h"

#include "base/base.h"
#include "base/maths.h"

sonde_quat sonde_quat_advance(sonde_quat rotation, sonde_vec3 spin, double time_s) {
  return q_unit(q_mul(q_spun(spin, time_s), rotation));
}

sonde_mat3 sonde_inertia_world(sonde_mat3 inertia, sonde_quat rotation) {
  sonde_mat3 r = q_matrix(rotation);
  return m_mul(m_mul(r, inertia), m_transpose(r));
}

sonde_vec3 sonde_spin_between(sonde_quat from, sonde_quat to, double time_s) {
  return q_spin(q_mul(to, q_conj(from)), time_s);
}

// Pose of a body's frame along its path; between two poses straight and at constant spin.
sonde_pose sonde_path_pose(const sonde_path *path, double time_s) {
  SONDE_ASSERT(path->count > 0);
  uint32_t last = path->count - 1, i = 0;
  if (!(time_s > path->time_s[0])) return path->pose[0];
  if (time_s >= path->time_s[last]) return path->pose[last];
  while (path->time_s[i + 1] <= time_s) ++i;
  double span = path->time_s[i + 1] - path->time_s[i], t = (time_s - path->time_s[i]) / span;
  sonde_quat q = path->pose[i].rotation;
  sonde_vec3 spin = sonde_spin_between(q, path->pose[i + 1].rotation, 1);
  return (sonde_pose){v_lerp(path->pose[i].position, path->pose[i + 1].position, t),
                      sonde_quat_advance(q, spin, t)};
}

// Pose of a driven or resting body's centre at a time.
static sonde_pose centre_pose(const sonde_body *body, double time_s) {
  sonde_pose pose =
      body->motion == SONDE_BODY_DRIVEN ? sonde_path_pose(&body->path, time_s) : body->start;
  return (sonde_pose){pose_apply(pose, body->mass.centre_m), pose.rotation};
}

void sonde_rigid_begin(sonde_scene_state *state, double h) {
  SONDE_ASSERT(h > 0);
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (!sonde_body_is_rigid(body)) continue;
    if (body->motion == SONDE_BODY_DRIVEN) {
      // A driven body's velocity and spin are those that bring it to its path's pose in time h.
      SONDE_ASSERT(body->path.count > 0);
      sonde_vec3 *velocity = &state->now.velocity[body->first_slot];
      sonde_pose to = centre_pose(body, state->now.head->time_s + h);
      velocity[0] = v_scale(v_sub(to.position, state->now.position[body->first_slot]), 1 / h);
      velocity[1] = sonde_spin_between(state->now.rotation[b], to.rotation, h);
    }
    sonde_mat3 inertia = sonde_inertia_world(body->mass.inertia_kg_m2, state->now.rotation[b]);
    state->inertia[b].start = inertia;
    state->inertia[b].angular = m_mul_v(inertia, state->now.velocity[body->first_slot + 1]);
  }
}

static sonde_vec3 spin_at(const sonde_scene_state *state, uint32_t body, sonde_quat rotation,
                          sonde_vec3 angular) {
  sonde_vec3 local = q_rotate(q_conj(rotation), angular);
  return q_rotate(rotation, m_mul_v(state->body_inverse[body], local));
}

sonde_quat sonde_rigid_advance(const sonde_scene_state *state, uint32_t body, sonde_quat from,
                               sonde_vec3 angular, double time_s, sonde_vec3 *spin) {
  SONDE_ASSERT(time_s >= 0);
  enum { MOST = 30 };
  sonde_quat rotation = from;
  *spin = spin_at(state, body, from, angular);
  for (int k = 0; k < MOST && time_s > 0; ++k) {
    rotation = sonde_quat_advance(from, *spin, time_s);
    sonde_vec3 next = spin_at(state, body, rotation, angular);
    double change = v_distance(next, *spin);
    *spin = next;
    if (!(change > 1e-15 * v_norm(next))) break;
  }
  return rotation;
}

void sonde_stage_start(sonde_scene_state *state) {
  for (uint32_t i = 0; i < state->scene->slot_count; ++i) {
    state->stage_position[i] = state->now.position[i];
    state->stage_velocity[i] = state->now.velocity[i];
  }
  for (uint32_t b = 0; b < state->scene->body_count; ++b)
    state->stage_rotation[b] = state->now.rotation[b];
}

// Angular momentum with a share of the step's change.
static sonde_vec3 angular_at(const sonde_scene_state *state, uint32_t b, sonde_vec3 dw,
                             double share) {
  return v_madd(state->inertia[b].angular, share, m_mul_v(state->inertia[b].start, dw));
}

void sonde_stage_at(sonde_scene_state *state, const sonde_vec3 *dv, double h) {
  double lambda = state->scene->step.lambda;
  SONDE_ASSERT(lambda >= 0 && lambda <= 1);
  for (uint32_t r = 0; r < state->moving_count; ++r) {
    uint32_t i = state->moving[r];
    sonde_vec3 v = v_madd(state->now.velocity[i], lambda, dv[i]);
    state->stage_velocity[i] = v;
    state->stage_position[i] = v_madd(state->now.position[i], lambda * h, v);
  }
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (!sonde_body_is_rigid(body)) continue;
    uint32_t spin = body->first_slot + 1;
    sonde_quat from = state->now.rotation[b];
    state->stage_position[spin] = vec3(0, 0, 0);
    if (body->motion == SONDE_BODY_FREE)
      state->stage_rotation[b] =
          sonde_rigid_advance(state, b, from, angular_at(state, b, dv[spin], lambda), lambda * h,
                              &state->stage_velocity[spin]);
    else
      state->stage_rotation[b] = sonde_quat_advance(from, state->now.velocity[spin], lambda * h);
  }
}

bool sonde_stage_finish(sonde_scene_state *state, const sonde_vec3 *dv, double h) {
  SONDE_ASSERT(h > 0);
  const sonde_scene_step *step = &state->scene->step;
  double lambda = step->symplectic ? 1 : step->lambda, sum = 0;
  for (uint32_t r = 0; r < state->moving_count; ++r) {
    uint32_t i = state->moving[r];
    sonde_vec3 mean = v_madd(state->now.velocity[i], lambda, dv[i]);
    state->now.position[i] = v_madd(state->now.position[i], h, mean);
    state->now.velocity[i] = v_add(state->now.velocity[i], dv[i]);
    sum += v_norm2(state->now.position[i]) + v_norm2(state->now.velocity[i]);
  }
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (!sonde_body_is_rigid(body)) continue;
    uint32_t spin = body->first_slot + 1;
    if (body->motion == SONDE_BODY_FREE) {
      // The orientation follows q1 = exp(h w) q0 with w the spin at the stage (for a symplectic
      // step at the end), and the spin follows from the momentum.
      sonde_quat from = state->now.rotation[b];
      sonde_vec3 w, end = angular_at(state, b, dv[spin], 1);
      sonde_rigid_advance(state, b, from, angular_at(state, b, dv[spin], lambda), lambda * h, &w);
      state->now.rotation[b] = sonde_quat_advance(from, w, h);
      state->now.velocity[spin] = spin_at(state, b, state->now.rotation[b], end);
    } else {
      sonde_pose to = centre_pose(body, state->now.head->time_s + h);
      state->now.position[body->first_slot] = to.position;
      state->now.rotation[b] = to.rotation;
    }
    state->now.position[spin] = vec3(0, 0, 0);
    sum += v_norm2(state->now.velocity[spin]);
  }
  return isfinite(sum);
}

void sonde_surface_at(const sonde_scene_state *state, uint32_t b, const sonde_vec3 *position,
                      const sonde_quat *rotation, sonde_vec3 *vertices) {
  SONDE_ASSERT(b < state->scene->body_count && vertices);
  const sonde_body *body = &state->scene->bodies[b];
  const sonde_vec3 *slot = position + body->first_slot;
  if (body->offset_m > 0) {
    sonde_sheet_surface(body, slot, vertices);
    return;
  }
  for (uint32_t i = 0; i < body->surface.vertex_count; ++i) {
    if (sonde_body_is_rigid(body))
      vertices[i] = v_add(slot[0], q_rotate(rotation[b], body->surface.vertices[i]));
    else
      vertices[i] = slot[body->surface_node ? body->surface_node[i] : i];
  }
}
