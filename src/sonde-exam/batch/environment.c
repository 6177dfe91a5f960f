// Life of an environment: creation, reset, saving.
#include "batch/environment.h"

#include "base/base.h"
#include "base/maths.h"
#include "echo/lines.h"
#include "exam/session.h"
#include "haptics/motion.h"

#include <string.h>

static sonde_session_controls controls_of(const sonde_environment *env,
                                          const sonde_batch_start *start) {
  sonde_session_controls plain = sonde_session_def_default().controls, wanted = plain;
  wanted.pathology = start->pathology;
  wanted.echo = start->settings;
  wanted.posture = env->patient->setup->circulation.posture;
  wanted.stiffness_scale = start->stiffness_scale;
  wanted.damping_scale = start->damping_scale;
  wanted.friction_scale = start->friction_scale;
  return sonde_controls_clean(&wanted, &plain, 1);
}

sonde_status sonde_environment_open(sonde_environment *env, sonde_patient *patient,
                                    sonde_error *error) {
  SONDE_ASSERT(env->def && env->probe && patient->setup);
  env->patient = patient;
  const sonde_case_setup *setup = patient->setup;
  sonde_session_def session = sonde_session_def_default();
  sonde_case_session(setup, &session);
  session.world.friction = env->def->friction;
  const sonde_setup fixed = sonde_setup_of(&session);
  const sonde_session_controls controls = controls_of(env, &patient->start);
  sonde_status status =
      sonde_subject_create(&fixed, setup->model, &session.world, &controls, &env->subject, error);
  const bool inside = env->def->inside, draws = inside && env->def->width > 0;
  if (!status && inside) status = sonde_interior_create(setup->model, &env->interior, error);
  if (!status && inside)
    status = sonde_interior_set_findings(env->interior, &setup->findings, error);
  sonde_echo_def image = sonde_echo_def_default();
  image.scanner = env->def->scanner;
  if (!status && draws) status = sonde_echo_create(env->interior, &image, &env->echo, error);
  if (!status && draws && image.scanner && image.scanner->radius_m > 0)
    status = sonde_echo_check_view(sight_aperture(image.scanner, env->probe->half_x_m),
                                   image.scanner->radius_m, error);
  if (status) return status;

  // The first environment of a patient gives the others their rest.
  if (!patient->rest) {
    patient->rest_bytes = sonde_subject_size(env->subject);
    patient->rest = sonde_calloc(1, patient->rest_bytes);
    if (!patient->rest) return sonde_fail_memory(error);
    patient->rest_bytes = sonde_subject_remember(env->subject, patient->rest);
    if (env->interior) sonde_interior_remember(env->interior, &patient->inside);
  }
  return sonde_environment_reset(env, &patient->start, error);
}

void sonde_environment_close(sonde_environment *env) {
  sonde_echo_destroy(env->echo);
  sonde_interior_destroy(env->interior);
  sonde_subject_destroy(env->subject);
}

sonde_status sonde_environment_reset(sonde_environment *env, const sonde_batch_start *start,
                                     sonde_error *error) {
  const sonde_bounded scales[] = {{"stiffness_scale", start->stiffness_scale, 0.5, 2},
                                  {"damping_scale", start->damping_scale, 0.25, 4},
                                  {"friction_scale", start->friction_scale, 0, 2}};
  sonde_status status = sonde_bounded_check(scales, SONDE_COUNT_OF(scales), error);
  if (status) return status;
  if (!sonde_pose_usable(start->world_from_probe))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "start: a pose that is none, expected metres and a quaternion");
  const sonde_patient *patient = env->patient;
  status = sonde_subject_recall(env->subject, patient->rest, patient->rest_bytes, error);
  if (!status && env->interior)
    status = sonde_interior_recall(env->interior, &patient->inside, error);
  if (status) return status;
  const sonde_session_controls controls = controls_of(env, start);
  sonde_subject_control(env->subject, &controls);
  env->now = (sonde_environment_moment){.start = *start, .pose = start->world_from_probe};
  env->now.pose.rotation = q_unit(env->now.pose.rotation);
  env->now.start.settings = controls.echo;
  *env->flags = 0;
  sonde_environment_look(env);
  return SONDE_OK;
}

size_t sonde_environment_size(const sonde_environment *env) {
  return sizeof env->now + sonde_subject_size(env->subject);
}

void sonde_environment_save(const sonde_environment *env, void *blob) {
  sonde_environment_moment *moment = blob;
  memcpy(moment, &env->now, sizeof *moment);
  if (env->interior) sonde_interior_remember(env->interior, &moment->inside);
  moment->subject_bytes = sonde_subject_remember(env->subject, moment + 1);
}

sonde_status sonde_environment_restore(sonde_environment *env, const void *blob, size_t bytes,
                                       sonde_error *error) {
  const sonde_environment_moment *moment = blob;
  if (bytes != sonde_environment_size(env) || moment->shown > 1 || !sonde_pose_usable(moment->pose))
    return sonde_fail(error, SONDE_FORMAT,
                      "not a saved environment of this patient: %zu bytes, expected %zu", bytes,
                      sonde_environment_size(env));
  sonde_status status =
      sonde_subject_recall(env->subject, moment + 1, moment->subject_bytes, error);
  if (!status && env->interior)
    status = sonde_interior_recall(env->interior, &moment->inside, error);
  if (status) return status;
  memcpy(&env->now, moment, sizeof *moment);
  *env->flags = sonde_subject_flags(env->subject);
  sonde_environment_tell(env);
  return SONDE_OK;
}
