// The step of an environment: its probe, its leg, and what is seen at the end. Nothing here
// allocates or waits, but for a window of the inside that a reset factors.
#include "batch/environment.h"

#include "base/base.h"
#include "base/maths.h"
#include "echo/lines.h"
#include "exam/vessels.h"
#include "haptics/motion.h"

#include <string.h>

static const double OUT_OF_RANGE_N = 400; // no hand's force: the inside is not asked then

static double number(double value) { return isfinite(value) ? value : 0; }

static sonde_vec3 at_most(sonde_vec3 v, double length) {
  double n = v_norm(v);
  return n > length ? v_scale(v, length / n) : v;
}

void sonde_environment_step(sonde_environment *env, const double *action, uint32_t ticks) {
  const sonde_batch_def *def = env->def;
  const double dt_s = env->subject->dt_s;
  const sonde_pose from = env->now.pose;
  const sonde_vec3 asked = vec3(number(action[0]), number(action[1]), number(action[2]));
  const sonde_vec3 turn =
      at_most(vec3(number(action[3]), number(action[4]), number(action[5])), def->speed_rad_s);
  sonde_pose goal = {.position = {action[0], action[1], action[2]},
                     .rotation = {action[3], action[4], action[5], action[6]}};
  goal = sonde_pose_usable(goal) ? (sonde_pose){goal.position, q_unit(goal.rotation)} : from;
  const double most_m = def->speed_m_s * dt_s, most_rad = def->speed_rad_s * dt_s;
  // Equal shares of the way in every tick; a hair more, so that the last one arrives.
  const double share = (1 + 1e-9) / fmax(ticks, 1);
  const double way_m = fmin(share * v_distance(goal.position, from.position) + 1e-12, most_m);
  const double way_rad =
      fmin(share * sonde_quat_angle(from.rotation, goal.rotation) + 1e-12, most_rad);
  uint32_t flags = 0;
  for (uint32_t tick = 0; tick < ticks; ++tick) {
    sonde_pose before = env->now.pose, pose;
    sonde_vec3 axis = q_rotate(before.rotation, vec3(0, 0, 1));
    double force_n = -v_dot(sonde_state_contact(env->subject->state)->force_n, axis);
    if (def->drive == SONDE_BATCH_TO_POSE) {
      pose = sonde_pose_approach(before, goal, way_m, way_rad);
    } else {
      // Of BY_FORCE the third number is a force, which an admittance keeps.
      sonde_vec3 speed = asked;
      if (def->drive == SONDE_BATCH_BY_FORCE)
        speed.z =
            clamp(def->admittance_m_s_n * (asked.z - force_n), -def->speed_m_s, def->speed_m_s);
      speed = at_most(speed, def->speed_m_s);
      // Velocity and angular velocity of the probe's frame, for a tick.
      const double angle = v_norm(turn) * dt_s;
      const sonde_vec3 by = v_scale(v_unit(turn, vec3(0, 0, 1)), sin(0.5 * angle));
      pose.position = v_madd(before.position, dt_s, q_rotate(before.rotation, speed));
      pose.rotation =
          q_unit(q_mul(before.rotation, (sonde_quat){cos(0.5 * angle), by.x, by.y, by.z}));
    }
    // Above the limit of the force the probe goes back, whatever the action says.
    if (force_n > def->force_limit_n) {
      double back_m = fmin(def->admittance_m_s_n * (force_n - def->force_limit_n), def->speed_m_s);
      double in_m = v_dot(v_sub(pose.position, before.position), axis);
      pose.position = v_madd(pose.position, fmin(0, -back_m * dt_s - in_m), axis);
    }
    env->now.pose = pose;
    sonde_subject_step(env->subject, env->probe, pose);
    flags |= sonde_subject_flags(env->subject);
  }
  *env->flags = flags;
}

static void see_vessel(sonde_environment *env, int which) {
  sonde_vessel_state v;
  const bool vein = which == 0;
  if (!sonde_interior_vessel_at_plane(env->interior, which, env->now.pose, &v)) return;
  sonde_vec3 at_m = pose_apply_inverse(env->now.pose, v.centre_m);
  env->now.vessel[vein ? SONDE_BATCH_vein_ratio : SONDE_BATCH_artery_ratio] = v.area_ratio;
  env->now.vessel[vein ? SONDE_BATCH_vein_x_m : SONDE_BATCH_artery_x_m] = at_m.x;
  env->now.vessel[vein ? SONDE_BATCH_vein_z_m : SONDE_BATCH_artery_z_m] = at_m.z;
}

void sonde_environment_tell(sonde_environment *env) {
  const sonde_contact *contact = sonde_state_contact(env->subject->state);
  const sonde_pose pose = env->now.pose;
  const double p[] = {pose.position.x, pose.position.y, pose.position.z, pose.rotation.w,
                      pose.rotation.x, pose.rotation.y, pose.rotation.z};
  SONDE_ASSERT(SONDE_COUNT_OF(p) == SONDE_BATCH_POSE);
  memcpy(env->pose, p, sizeof p);
  sonde_vec3 force = q_rotate(q_conj(pose.rotation), contact->force_n),
             torque = q_rotate(q_conj(pose.rotation), contact->torque_n_m);
  const double w[] = {force.x, force.y, force.z, torque.x, torque.y, torque.z};
  memcpy(env->wrench, w, sizeof w);
  memcpy(env->vessel, env->now.vessel, sizeof env->now.vessel);
  *env->time_s = sonde_state_time(env->subject->state);
}

void sonde_environment_look(sonde_environment *env) {
  const sonde_batch_start *start = &env->now.start;
  const sonde_state *state = env->subject->state;
  const sonde_pose pose = env->now.pose;
  SONDE_ASSERT(v_finite(pose.position));
  const bool off = *env->flags & SONDE_FLAG_INSIDE_OUT; // the probe sees no body
  const sonde_pathology pathology = sonde_subject_pathology(env->subject);
  for (int k = 0; k < SONDE_BATCH_VESSEL; ++k) env->now.vessel[k] = (double)NAN;
  sonde_snapshot *snapshot = &env->now.snapshot;
  *snapshot = sonde_snapshot_of(state, pose);
  snapshot->flags = *env->flags;
  snapshot->restores = env->subject->now.restores;
  snapshot->venous_pressure_pa = pathology.venous_pressure_pa;
  snapshot->arterial_pressure_pa = pathology.arterial_pressure_pa;

  // Inside and vessels follow from the last look, or in equilibrium after a reset.
  const uint64_t tick = sonde_state_tick(state);
  const bool usable = env->interior && !off && fabs(snapshot->force_normal_n) < OUT_OF_RANGE_N;
  if (usable) {
    double since_s = (double)(tick - env->now.shown_tick) * env->subject->dt_s;
    sonde_interior_input input = {
        .positions_m = sonde_state_positions(env->subject->state),
        .contact_forces_n = sonde_state_contact_forces(state),
        .world_from_probe = pose,
        .pathology = &pathology,
        .dt_s = env->now.shown ? since_s : -1,
        .tick = tick,
        .face_half_x_m = env->probe->half_x_m,
        .face_half_y_m = env->probe->half_y_m,
        .posture = env->patient->setup->circulation.posture,
    };
    sonde_interior_update(env->interior, &input);
    env->now.shown = true, env->now.shown_tick = tick;
    sonde_snapshot_read_vessels(env->interior, snapshot);
    see_vessel(env, 0);
    see_vessel(env, 1);
    env->now.vessel[SONDE_BATCH_vein_tilt_rad] = snapshot->vein_tilt_rad;
    env->now.vessel[SONDE_BATCH_vein_short_m] = snapshot->vein_short_m;
    env->now.vessel[SONDE_BATCH_other_ratio] = snapshot->other_vein_ratio;
  }

  sonde_environment_tell(env);
  if (!env->echo) return;
  sonde_image image = {.width = env->def->width, .height = env->def->height, .pixels = env->pixels};
  if (!usable) {
    memset(image.pixels, 0, (size_t)image.width * image.height);
    return;
  }
  sonde_echo_flow flow = sonde_echo_flow_default();
  flow.t_s = *env->time_s;
  flow.circulation = env->subject->now.circulation;
  sonde_echo_set_flow(env->echo, &flow);
  sonde_echo_render(env->echo, pose, sight_aperture(env->def->scanner, env->probe->half_x_m),
                    &pathology, &start->settings, &image);
}
