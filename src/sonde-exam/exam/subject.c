// The thigh under the probe: creation.
#include "exam/subject.h"

#include "base/base.h"
#include "base/maths.h"
#include "haptics/gel.h"
#include "haptics/motion.h"

#include <string.h>

sonde_preset sonde_setup_preset(const sonde_setup *setup, const sonde_session_controls *c) {
  SONDE_ASSERT(setup->preset_count <= SONDE_SESSION_PRESETS);
  sonde_preset preset = sonde_preset_default();
  preset.friction = setup->friction;
  uint32_t last = setup->preset_count ? setup->preset_count - 1 : 0;
  if (setup->preset_count) preset = setup->presets[c->preset < last ? c->preset : last];
  preset.stiffness_scale *= c->stiffness_scale;
  preset.damping_multiplier *= c->damping_scale;
  preset.friction.mu_static *= c->friction_scale;
  preset.friction.mu_kinetic *= c->friction_scale;
  preset.friction.mu_gel *= c->friction_scale;
  return preset;
}

sonde_status sonde_subject_create(const sonde_setup *setup, const sonde_model *model,
                                  const sonde_world_def *world,
                                  const sonde_session_controls *controls, sonde_subject **out,
                                  sonde_error *error) {
  *out = NULL;
  sonde_subject *subject = SONDE_NEW(sonde_subject, 1);
  if (!subject) return sonde_fail_memory(error);
  subject->model = model;
  subject->setup = *setup;
  subject->dt_s = world->dt_s;
  subject->now.circulation = setup->circulation;
  sonde_status status = sonde_state_create(model, world, &subject->state, error);
  if (!status) status = sonde_gel_create(model, NULL, &subject->gel, error);
  if (!status) status = sonde_surface_index_create(&model->surface, &subject->rest_skin, error);
  if (status) {
    sonde_subject_destroy(subject);
    return status;
  }
  // Half over the sites, half along the vein, where an exam goes. Shares overlap, so that the film
  // is closed between the places.
  const double radius_m = 0.02, along_m = 0.03, all_m3 = subject->setup.gel_m3;
  uint32_t sites = model->site_count, points = model->vein.count;
  if (all_m3 > 0) {
    double half = sites && points ? 0.5 : 1.0;
    for (uint32_t i = 0; i < sites; ++i)
      sonde_gel_put(subject->gel, model->sites[i].position_m, radius_m, half * all_m3 / sites);
    const sonde_mesh *skin = &model->surface;
    for (uint32_t i = 0; i < points; ++i) {
      uint32_t at = v_nearest(skin->vertices, skin->vertex_count, model->vein.point[i].centre_m);
      sonde_gel_put(subject->gel, skin->vertices[at], along_m, half * all_m3 / points);
    }
  }
  subject->now.controls = *controls;
  subject->now.controls.valsalva = false;
  sonde_subject_control(subject, controls);
  *out = subject;
  return SONDE_OK;
}

void sonde_subject_destroy(sonde_subject *subject) {
  if (!subject) return;
  sonde_surface_index_destroy(subject->rest_skin);
  sonde_gel_destroy(subject->gel);
  sonde_state_destroy(subject->state);
  sonde_free(subject);
}

sonde_status sonde_subject_recall(sonde_subject *subject, const void *saved, size_t bytes,
                                  sonde_error *error) {
  size_t own = sonde_subject_save(subject, NULL);
  sonde_subject_moment moment;
  if (bytes > own) memcpy(&moment, saved, sizeof moment);
  // Bytes of a file may hold anything.
  const sonde_session_controls *c = &moment.controls;
  if (bytes <= own ||
      !(c->stiffness_scale >= 0.5 && c->stiffness_scale <= 2 && c->damping_scale >= 0.25 &&
        c->damping_scale <= 4 && c->friction_scale >= 0 && c->friction_scale <= 2 &&
        c->posture < SONDE_POSTURE_COUNT && v_finite(moment.drift_m_s) &&
        (!moment.placed || sonde_pose_usable(moment.pose))))
    return sonde_fail(error, SONDE_FORMAT, "the saved moment is damaged");
  sonde_subject_restore(subject, saved);
  return sonde_state_restore(subject->state, (const char *)saved + own, bytes - own, error);
}
